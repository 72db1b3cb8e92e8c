/// \file
/// Finds the factors of a field's weights that give every label the volume of its voxels.
#pragma once

#include <cstdint>
#include <vector>

#include "treemarch/core/execution.h"
#include "treemarch/image/label_image.h"
#include "treemarch/mesh/mesh.h"
#include "treemarch/report/guarantee.h"

namespace treemarch {

/// Rounds of meshing and correcting, each label on its own: the first step follows from the area of its interfaces, the
/// next ones from how its volume answered (secant).
template <int Dim>
class VolumeKeeper {
 public:
  /// \param left_out material whose volume is not asked for; its factor stays 1 (the background), kOutside for none
  VolumeKeeper(const LabelImage<Dim>& image, MaterialId left_out);

  /// FieldOptions::scale of the next round.
  [[nodiscard]] std::vector<float> scale() const;
  /// Looks at the mesh of a round; its materials are those of the image.
  /// \return whether another round is worth while
  bool look(const Mesh<Dim>& mesh, VolumeReport& report, const Execution& execution);

 private:
  struct Label {
    double target = 0;    // volume
    double response = 0;  // of the volume to the logarithm of the factor
    double volume = 0;    // in the last round
    double step = 0;      // of the logarithm, before the last round
    double log_scale = 0;
    bool counts = false;  // has 1,000 voxels or more
  };
  std::vector<Label> labels_;
  MaterialId left_out_;
};

}  // namespace treemarch
