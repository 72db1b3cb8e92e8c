/// \file
/// What the default method did to keep its promise.
#pragma once

#include "treemarch/improve/fit.h"
#include "treemarch/improve/improve.h"
#include "treemarch/improve/repair_topology.h"
#include "treemarch/march/cut.h"

namespace treemarch {

struct GuaranteeReport {
  double quality_floor = 0;  ///< in force after the cut, in degrees; lower than asked where the lattice is stretched
  CutReport cut;
  RepairReport repair;
  ImproveReport improve;
  FitReport fit;
};

}  // namespace treemarch
