#include "treemarch/mesh/picture.h"

#include <gtest/gtest.h>
#include <png.h>
#include <unistd.h>

#include <cmath>
#include <filesystem>

#include "support/meshes.h"
#include "treemarch/core/error.h"
#include "treemarch/mesh/raster.h"

namespace treemarch {
namespace {

namespace fs = std::filesystem;
using testing::box_mesh;
using testing::mixed_mesh;

struct Pixels {
  int width = 0, height = 0;
  std::vector<std::uint8_t> rgb;
  /// Hue and the like without the shading: the colour divided by its brightest channel.
  [[nodiscard]] bool shows(std::int32_t label) const {
    for (std::size_t i = 0; i < rgb.size(); i += 3)
      if (distance(&rgb[i], label) < 0.04) return true;
    return false;
  }
  static double distance(const std::uint8_t* pixel, std::int32_t label) {
    const Colour want = label_colour(label);
    std::array<double, 3> got;
    for (int k = 0; k < 3; ++k) got[k] = std::pow(pixel[k] / 255.0, 2.2);
    const double a = *std::max_element(got.begin(), got.end()), b = *std::max_element(want.begin(), want.end());
    if (a < 0.05) return 1;
    double worst = 0;
    for (int k = 0; k < 3; ++k) worst = std::max(worst, std::abs(got[k] / a - want[k] / b));
    return worst;
  }
};

class PictureTest : public ::testing::Test {
 protected:
  void SetUp() override {
    path_ = fs::path(::testing::TempDir()) / ("picture_test" + std::to_string(::getpid()) + ".png");
  }
  void TearDown() override { fs::remove(path_); }

  template <int Dim>
  Pixels draw(const Mesh<Dim>& mesh, const Frame<Dim>& frame, std::optional<std::int32_t> background = 0,
              int threads = 2) {
    write_picture(path_, mesh, frame, {.overwrite = true, .width = 400, .background = background}, Execution(threads));
    png_image image{};
    image.version = PNG_IMAGE_VERSION;
    EXPECT_TRUE(png_image_begin_read_from_file(&image, path_.c_str()));
    image.format = PNG_FORMAT_RGB;
    Pixels pixels{static_cast<int>(image.width), static_cast<int>(image.height), {}};
    pixels.rgb.resize(PNG_IMAGE_SIZE(image));
    EXPECT_TRUE(png_image_finish_read(&image, nullptr, pixels.rgb.data(), 0, nullptr));
    return pixels;
  }
  std::string path_;
};

TEST_F(PictureTest, ShowsTheInsideThroughTheCut) {
  // A core of label 5 that label 2 surrounds on all sides, and background around it.
  const Mesh<3> mesh = box_mesh<3>({12, 12, 12}, [](const Coord<3>& c) {
    const int from_hull = std::min({c[0], c[1], c[2], 11 - c[0], 11 - c[1], 11 - c[2]});
    return from_hull == 0 ? 0 : from_hull < 4 ? 2 : 5;
  });
  const Pixels cut = draw<3>(mesh, {});
  EXPECT_EQ(cut.width, 400);
  EXPECT_EQ(cut.height, 300);
  EXPECT_TRUE(cut.shows(2));
  EXPECT_TRUE(cut.shows(5));
  EXPECT_FALSE(cut.shows(0));
  EXPECT_TRUE(draw<3>(mesh, {}, std::nullopt).shows(0));
  EXPECT_EQ(draw<3>(mesh, {}, 0, 1).rgb, draw<3>(mesh, {}, 0, 3).rgb);
}

TEST_F(PictureTest, SuperiorIsUpWhateverTheAxes) {
  // The first axis of the image points down (inferior): its first layer has to be at the top of the picture.
  const Mesh<3> mesh = box_mesh<3>({8, 4, 4}, [](const Coord<3>& c) { return c[0] < 4 ? 3 : 7; });
  Frame<3> frame;
  frame.space = "IRP";
  const Pixels p = draw(mesh, frame);
  std::int64_t rows[2] = {0, 0}, count[2] = {0, 0};
  for (int y = 0; y < p.height; ++y)
    for (int x = 0; x < p.width; ++x)
      for (int k = 0; k < 2; ++k)
        if (Pixels::distance(&p.rgb[3 * (y * p.width + x)], k ? 7 : 3) < 0.04) {
          rows[k] += y;
          ++count[k];
        }
  ASSERT_GT(count[0], 100);
  ASSERT_GT(count[1], 100);
  EXPECT_LT(rows[0] / count[0] + 20, rows[1] / count[1]);
}

TEST_F(PictureTest, OfTwoDimensionsIsAsViewersShowIt) {
  const Mesh<2> mesh = box_mesh<2>({4, 2}, [](const Coord<2>& c) { return 1 + c[0] / 2 + 2 * c[1]; });
  const Pixels p = draw<2>(mesh, {});
  EXPECT_EQ(p.height, 200);
  auto label_at = [&](int x, int y, std::int32_t label) { return Pixels::distance(&p.rgb[3 * (y * 400 + x)], label); };
  EXPECT_LT(label_at(70, 60, 1), 0.04);
  EXPECT_LT(label_at(330, 60, 2), 0.04);
  EXPECT_LT(label_at(70, 145, 3), 0.04);
  EXPECT_LT(label_at(330, 145, 4), 0.04);
}

TEST_F(PictureTest, OfAnyMesh) {
  EXPECT_TRUE(draw<3>(mixed_mesh(), {}).shows(1));
  EXPECT_NO_THROW(draw<3>(Mesh<3>{}, {}));
  EXPECT_NO_THROW(draw<2>(Mesh<2>{}, {}));
  EXPECT_TRUE(draw<3>(box_mesh<3>({2, 2, 2}, [](const Coord<3>&) { return 0; }), {}).shows(0));
}

TEST_F(PictureTest, IsAPngOrNothing) {
  EXPECT_THROW(write_picture<3>("/tmp/a.jpg", mixed_mesh(), {}, {}, Execution(1)), Error);
  draw<3>(mixed_mesh(), {});
  EXPECT_THROW(write_picture<3>(path_, mixed_mesh(), {}, {}, Execution(1)), Error);
}

}  // namespace
}  // namespace treemarch
