/// \file
/// Lengths as users write them.
#pragma once

#include <string_view>

namespace treemarch {

/// A length `2mm`, `2.5um`, `0.1cm`, `2vox` or `2` in millimetres; a bare number is millimetres, a `vox` is the
/// smallest spacing of the image. \param smallest_spacing in millimetres, > 0. \param option for the message. \throw
/// Error(usage) if it is not a length, or not greater than zero.
double parse_length(std::string_view text, double smallest_spacing, std::string_view option);

}  // namespace treemarch
