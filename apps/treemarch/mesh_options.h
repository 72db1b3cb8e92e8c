/// \file
/// What the mesh should be like, as written on the command line.
#pragma once

#include <CLI/CLI.hpp>
#include <optional>
#include <string>
#include <vector>

#include "image_options.h"
#include "treemarch/image/label_image.h"
#include "treemarch/pipeline/mesh_image.h"

namespace treemarch::app {

/// MeshOptions before labels and units are resolved against an image.
struct MeshTextOptions {
  MeshOptions plain;  ///< those that need no image to be understood
  std::optional<std::string> min_size, max_size, tolerance, detail;
  std::vector<std::string> regions;     ///< box:...=S or sphere:...=S
  std::string size_image;               ///< file
  std::vector<std::string> sizes;       ///< LABEL=S
  std::vector<std::string> interfaces;  ///< A:B=S
  std::vector<std::string> weights;     ///< LABEL=W
  std::string balance = "1";
  std::string order = "largest";  ///< the name of a MaterialOrder, or labels
};

void add_mesh_options(CLI::App& mesh, MeshTextOptions& options);

/// \param sizes values in millimetres by place, from text.size_image; may be null.
/// \throw Error(usage) for unknown labels, for numbers out of range and for sizes that apply nowhere.
template <int Dim>
MeshOptions resolve(const MeshTextOptions& text, const LabelImage<Dim>& image, const GreyImage<Dim>* sizes);

}  // namespace treemarch::app
