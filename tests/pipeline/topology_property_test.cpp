// What the default method promises about the topology holds for any image. TREEMARCH_RANDOM_IMAGES=N tries N images
// instead of 1,000, TREEMARCH_RANDOM_SEED=S others.
#include <gtest/gtest.h>

#include <cstdlib>
#include <string>

#include "support/shapes.h"
#include "treemarch/mesh/quality.h"
#include "treemarch/mesh/validate.h"
#include "treemarch/pipeline/mesh_image.h"
#include "treemarch/report/fidelity.h"

namespace treemarch {
namespace {

struct Tally {
  int images = 0, pinched = 0, breaches = 0;
};

int number_from(const char* variable, int otherwise) {
  const char* text = std::getenv(variable);
  return text ? std::atoi(text) : otherwise;
}

template <int Dim>
void try_image(testing::Shapes kind, unsigned seed, Tally& tally) {
  std::mt19937 random(seed);
  const auto below = [&](int n) { return static_cast<int>(random() % static_cast<unsigned>(n)); };
  Coord<Dim> extent{};
  const int most = Dim == 2 || seed % 50 == 0 ? 22 : 10;
  for (int d = 0; d < Dim; ++d) extent[d] = 3 + below(most);
  const int labels = 2 + below(below(4) == 0 ? 19 : 4);
  const auto image = testing::ShapePainter<Dim>(extent, labels, seed).paint(kind);
  SCOPED_TRACE("seed " + std::to_string(seed) + ", kind " + std::to_string(static_cast<int>(kind)) + ", dimension " +
               std::to_string(Dim));
  MeshOptions options;
  options.sizes.min_size = 1;
  options.keep_background = below(2) == 0;
  if (image.labels.size() == 1) options.keep_background = true;
  Execution execution(2);
  const Mesh<Dim> mesh = mesh_image(image, options, execution).mesh;
  const Fidelity fidelity = measure_fidelity(image, mesh, 0, execution);
  ++tally.images;
  tally.pinched += fidelity.topology->image_pinches > 0;
  tally.breaches += fidelity.topology->breached();
  EXPECT_TRUE(fidelity.topology->image_pinches > 0 || !fidelity.topology->breached()) << fidelity.topology->breach();
  if (std::getenv("TREEMARCH_RANDOM_IMAGES") && fidelity.topology->breached())
    std::printf("seed %u, kind %d, dimension %d: %s\n", seed, static_cast<int>(kind), Dim,
                fidelity.topology->breach().c_str());
  EXPECT_TRUE(fidelity.lost_labels().empty());
  EXPECT_TRUE(validate(mesh, execution).sound());
  EXPECT_GE(measure_quality(mesh, {}, 1, execution).angles.min, 18);
}

TEST(topology_property, random_images_keep_their_topology) {
  const int count = number_from("TREEMARCH_RANDOM_IMAGES", 1000);
  const auto first = static_cast<unsigned>(number_from("TREEMARCH_RANDOM_SEED", 0));
  Tally tally;
  for (int i = 0; i < count; ++i) {
    const unsigned seed = first + static_cast<unsigned>(i);
    const auto kind = static_cast<testing::Shapes>(i % testing::kShapeKinds);
    if (i / testing::kShapeKinds % 3 == 0)
      try_image<2>(kind, seed, tally);
    else
      try_image<3>(kind, seed, tally);
  }
  EXPECT_GT(tally.pinched, tally.images / 4);
  EXPECT_LT(tally.pinched, tally.images);
  EXPECT_LE(10 * tally.breaches, tally.pinched);
  RecordProperty("pinched", tally.pinched);
  RecordProperty("breaches", tally.breaches);
}

}  // namespace
}  // namespace treemarch
