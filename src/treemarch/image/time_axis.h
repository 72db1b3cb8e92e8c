/// \file
/// Time as the last axis of an image.
#pragma once

#include "treemarch/image/frame.h"

namespace treemarch {

/// Makes a step of time, that is along the last axis, `length` long in the inner frame, where stages compare lengths
/// along all axes. Places in the world stay. \pre length > 0; time is not mixed with space by the frame.
template <int Dim>
void set_time_step(Frame<Dim>& frame, double length) {
  Vec<Dim>& time = frame.direction[Dim - 1];
  time = (frame.spacing[Dim - 1] / length) * time;
  frame.spacing[Dim - 1] = length;
}

}  // namespace treemarch
