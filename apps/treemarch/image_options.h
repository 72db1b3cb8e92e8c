/// \file
/// How an image is read: the options that the subcommands share.
#pragma once

#include <CLI/CLI.hpp>
#include <algorithm>
#include <optional>
#include <string>

#include "treemarch/core/error.h"
#include "treemarch/core/execution.h"
#include "treemarch/image/read_image.h"

namespace treemarch::app {

struct ImageOptions {
  std::optional<std::string> spacing;  ///< --spacing as given
  std::optional<double> threshold;
  std::optional<int> volume;
  bool any_labels = false;
  bool space_time = false;
  std::optional<std::string> time_step;  ///< --time-step as given
};

void add_image_options(CLI::App& command, ImageOptions& options);
/// Those for images that move; without them a file of several volumes is one of them.
void add_space_time_options(CLI::App& command, ImageOptions& options);

/// Reads the image and calls f with it, a LabelImage<2> or LabelImage<3>.
template <class F>
void with_image(const std::string& path, const ImageOptions& options, Execution& execution, F&& f);
/// The same, and f takes LabelImage<4> too: for commands that have add_space_time_options().
template <class F>
void with_moving_image(const std::string& path, const ImageOptions& options, Execution& execution, F&& f);

/// The image as it was read. \throw Error
AnyImage load_image(const std::string& path, const ImageOptions& options, Execution& execution);

/// Applies --time-step where there is time: a step counts as so long, else as the smallest side of a voxel.
/// \throw Error(usage) for a text that is no length or an image that does not move.
template <int Dim>
void scale_time(const std::string& path, const ImageOptions& options, Frame<Dim>& frame);

/// The same file as grey values. \throw Error
AnyGreyImage load_grey_image(const std::string& path, const ImageOptions& options, Execution& execution);

/// Smallest side of a voxel.
template <int Dim>
double smallest_spacing(const LabelImage<Dim>& image) {
  return *std::min_element(image.frame.spacing.begin(), image.frame.spacing.end());
}

template <class F>
void with_image(const std::string& path, const ImageOptions& options, Execution& execution, F&& f) {
  AnyImage image = load_image(path, options, execution);
  if (auto* flat = std::get_if<LabelImage<2>>(&image)) return f(std::move(*flat));
  if (auto* solid = std::get_if<LabelImage<3>>(&image)) return f(std::move(*solid));
  throw Error(ErrorKind::input, path + ": is neither 2D nor 3D");
}

template <class F>
void with_moving_image(const std::string& path, const ImageOptions& options, Execution& execution, F&& f) {
  AnyImage any = load_image(path, options, execution);
  std::visit(
      [&]<int Dim>(LabelImage<Dim>& image) {
        scale_time(path, options, image.frame);
        f(std::move(image));
      },
      any);
}

}  // namespace treemarch::app
