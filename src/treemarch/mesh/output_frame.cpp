#include "treemarch/mesh/output_frame.h"

#include <string>

#include "treemarch/core/error.h"
#include "treemarch/mesh/cell_topology.h"

namespace treemarch {
namespace {

char opposite(char axis) {
  constexpr std::string_view kAxes = "RLAPSI";
  const std::size_t i = kAxes.find(axis);
  return i == std::string_view::npos ? '\0' : kAxes[i ^ 1U];
}

/// Axis r of the result is the axis of `frame` with the same letter, or the negative of the one with the opposite. Time
/// stays as it is.
template <int Dim>
Frame<Dim> turned_to(const Frame<Dim>& frame, const std::string& axes) {
  Frame<Dim> result = frame;
  const int spatial = frame.space.ends_with('T') || Dim == 4 ? Dim - 1 : Dim;
  result.space = axes.substr(0, static_cast<std::size_t>(spatial)) + (spatial < Dim ? "T" : "");
  for (int r = 0; r < spatial; ++r) {
    int from = 0;
    while (from < spatial && from < static_cast<int>(frame.space.size()) && frame.space[from] != axes[r] &&
           frame.space[from] != opposite(axes[r]))
      ++from;
    if (from >= spatial || from >= static_cast<int>(frame.space.size()))
      throw Error(ErrorKind::usage, "--space: the image does not say where its axes point" +
                                        (frame.space.empty() ? "" : " (\"" + frame.space + "\")") +
                                        "; leave the option out or give --space index");
    const double sign = frame.space[from] == axes[r] ? 1 : -1;
    result.origin[r] = sign * frame.origin[from];
    for (int c = 0; c < Dim; ++c) result.direction[c][r] = sign * frame.direction[c][from];
  }
  return result;
}

}  // namespace

template <int Dim>
Frame<Dim> output_frame(const Frame<Dim>& frame, OutputSpace space) {
  if (space == OutputSpace::ras) return turned_to(frame, "RAS");
  if (space == OutputSpace::lps) return turned_to(frame, "LPS");
  if (space == OutputSpace::file) return frame;
  Frame<Dim> index;
  index.spacing = frame.spacing;
  for (int d = 0; d < Dim; ++d) index.direction[d][d] = 1 / frame.spacing[d];
  index.space = "index";
  return index;
}

template <int Dim>
bool is_left_handed(const Frame<Dim>& frame) {
  return determinant<Dim>(frame.direction) < 0;
}

template Frame<2> output_frame(const Frame<2>&, OutputSpace);
template Frame<3> output_frame(const Frame<3>&, OutputSpace);
template Frame<4> output_frame(const Frame<4>&, OutputSpace);
template bool is_left_handed(const Frame<2>&);
template bool is_left_handed(const Frame<3>&);
template bool is_left_handed(const Frame<4>&);

}  // namespace treemarch
