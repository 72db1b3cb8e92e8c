/// \file
/// A picture of a mesh, drawn without a display.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "treemarch/core/execution.h"
#include "treemarch/image/frame.h"
#include "treemarch/mesh/mesh.h"

namespace treemarch {

struct PictureOptions {
  bool overwrite = false;  ///< else an existing file is an error
  int width = 1600;        ///< pixels; the height is 3/4 of it in 3D and follows the mesh in 2D
  /// Cells of this label are left out of a 3D picture, so that what they surround is seen; pale in 2D.
  std::optional<std::int32_t> background = 0;
};

/// Writes a PNG. 3D: shaded, seen from the front, left and above (superior is up where the frame knows it, else the
/// third axis), without the cells of the octant that is nearest to the eye. 2D: flat, as image viewers show it (the
/// second axis down) unless the frame names its axes. A label has the same colour in every picture. \throw
/// Error(output), Error(usage) where the extension is not .png.
template <int Dim>
void write_picture(const std::string& path, const Mesh<Dim>& mesh, const Frame<Dim>& frame,
                   const PictureOptions& options, const Execution& execution);

}  // namespace treemarch
