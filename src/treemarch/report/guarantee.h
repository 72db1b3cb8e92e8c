/// \file
/// What the default method did to keep its promise.
#pragma once

#include <cstdint>

#include "treemarch/improve/fit.h"
#include "treemarch/improve/improve.h"
#include "treemarch/march/cut.h"
#include "treemarch/repair/repair_topology.h"

namespace treemarch {

/// What was done to keep the volumes of the labels.
struct VolumeReport {
  int rounds = 0;  ///< of meshing; 0 where it was not asked for
  /// Largest relative error of the volume of a label of 1,000 voxels or more, without and with the correction.
  double error_before = 0, error_after = 0;
  std::int64_t labels = 0;      ///< of 1,000 voxels or more
  std::int64_t labels_off = 0;  ///< those that are off by more than 0.5 %
};

struct GuaranteeReport {
  double quality_floor = 0;  ///< in force after the cut, in degrees; lower than asked where the lattice is stretched
  CutReport cut;
  RepairReport repair;
  ImproveReport improve;
  FitReport fit;
  VolumeReport volume;
};

}  // namespace treemarch
