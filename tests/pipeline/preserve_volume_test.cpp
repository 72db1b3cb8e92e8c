#include "treemarch/pipeline/preserve_volume.h"

#include <gtest/gtest.h>

#include <cmath>

#include "support/images.h"
#include "treemarch/core/error.h"
#include "treemarch/mesh/quality.h"
#include "treemarch/pipeline/mesh_image.h"
#include "treemarch/report/fidelity.h"

namespace treemarch {
namespace {

double worst_error(const LabelImage<3>& image, const Mesh<3>& mesh) {
  double worst = 0;
  for (const LabelFidelity& l : measure_fidelity(image, mesh, 0, Execution(2)).labels)
    if (l.voxels >= 1000 && !l.is_background) worst = std::max(worst, std::abs(l.volume / l.image_volume - 1));
  return worst;
}

/// Balls and a ring of a few voxels' radius, whose volumes smoothing changes most.
LabelImage<3> small_shapes() {
  const Coord<3> extent{40, 26, 26};
  std::vector<std::int32_t> values(static_cast<std::size_t>(product(extent)));
  for (std::int64_t i = 0; i < product(extent); ++i) {
    const Coord<3> c = coord_of(i, extent);
    const Vec<3> x{c[0] + 0.5, c[1] + 0.5, c[2] + 0.5};
    std::int32_t& v = values[static_cast<std::size_t>(i)];
    if (norm(x - Vec<3>{12, 13, 13}) < 9) v = 1;
    if (std::hypot(std::hypot(x[1] - 13, x[2] - 13) - 8, x[0] - 28) < 3) v = 2;
    if (std::hypot(x[1] - 13, x[2] - 13) < 4) v = 3;
  }
  return make_label_image(extent, values);
}

TEST(preserve_volume, volumes_are_those_of_the_voxels) {
  const auto image = small_shapes();
  for (const double size : {1.0, 2.0}) {
    SCOPED_TRACE(size);
    MeshOptions options;
    options.sizes.min_size = size;
    Execution execution(2);
    EXPECT_GT(worst_error(image, mesh_image(image, options, execution).mesh), 0.01);
    options.preserve_volume = true;
    const auto kept = mesh_image(image, options, execution);
    EXPECT_LE(worst_error(image, kept.mesh), 0.005);
    EXPECT_NEAR(worst_error(image, kept.mesh), kept.guarantee->volume.error_after, 1e-9);
    EXPECT_EQ(kept.guarantee->volume.labels, 3);
    EXPECT_GE(measure_quality(kept.mesh, {}, 1, execution).angles.min, 20);
    EXPECT_FALSE(measure_fidelity(image, kept.mesh, 0, execution).topology->breached());
  }
}

TEST(preserve_volume, is_refused_where_it_has_no_meaning) {
  const auto image = small_shapes();
  Execution execution(2);
  MeshOptions options;
  options.preserve_volume = true;
  options.field = FieldKind::solid_angle;
  EXPECT_THROW(mesh_image(image, options, execution), Error);
  options.field.reset();
  options.method = Method::paper;
  EXPECT_THROW(mesh_image(image, options, execution), Error);
}

}  // namespace
}  // namespace treemarch
