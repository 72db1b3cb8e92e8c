#include "treemarch/mesh/mesh_source.h"

#include <gtest/gtest.h>

#include <filesystem>

#include "treemarch/core/error.h"

namespace treemarch {
namespace {

/// A mesh that is only counted: so many cells and points, and nothing behind them.
MeshSource counted(CellType type, std::int64_t cells, std::int64_t points) {
  MeshSource mesh;
  mesh.point_count = points;
  mesh.blocks.push_back({.type = type, .size = cells});
  return mesh;
}

TEST(MeshSource, ConnectivityBeyond32Bits) {
  constexpr std::int64_t kMost = 0x7fffffff;
  const MeshSource fits = counted(CellType::tetrahedron, kMost / 4, 1000),
                   beyond = counted(CellType::tetrahedron, kMost / 4 + 1, 1000);
  EXPECT_TRUE(fits.fits_32_bits());
  EXPECT_FALSE(beyond.fits_32_bits());
  EXPECT_EQ(beyond.corner_count(), kMost + 1);
  EXPECT_FALSE(counted(CellType::triangle, 1, kMost + 1).fits_32_bits());
  MeshSource hybrid = counted(CellType::tetrahedron, 3'000'000'000, 1);
  hybrid.blocks.push_back({.type = CellType::hexahedron, .size = 2'000'000'000});
  EXPECT_EQ(hybrid.corner_count(), 28'000'000'000);
  EXPECT_EQ(hybrid.cell_count(), 5'000'000'000);
}

TEST(MeshSource, GmshArraysAreNumberedWith32Bits) {
  const auto path = (std::filesystem::temp_directory_path() / "treemarch_mesh_source_test.msh").string();
  {
    OutputFile file(path, true);
    EXPECT_THROW(write_msh(counted(CellType::tetrahedron, 0x80000000, 1), file, Execution(1)), Error);
  }
  EXPECT_FALSE(std::filesystem::exists(path));
}

}  // namespace
}  // namespace treemarch
