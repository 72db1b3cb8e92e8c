/// \file
/// Shared by the source files that read through ITK; not for other code, since it includes ITK.
#pragma once

#include <itkImageIOBase.h>

#include <functional>
#include <string>

#include "treemarch/image/raw_image.h"

namespace treemarch {

/// Runs `work` and turns what ITK throws into one-line errors about `path`. \throw Error(input)
void guard_itk(const std::string& path, const std::function<void()>& work);

/// The sample type of what ITK found. \throw Error(input) for colours, vectors and types that are no plain numbers.
SampleType itk_sample_type(const std::string& path, const itk::ImageIOBase& io);

/// Reads all samples of an image of which the information has been read.
void read_itk_samples(itk::ImageIOBase& io, void* out);

}  // namespace treemarch
