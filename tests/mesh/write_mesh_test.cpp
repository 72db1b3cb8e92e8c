// What is written is read back in read_mesh_test.cpp and, by other programs, in read_samples.py. Here: what is not
// written.
#include "treemarch/mesh/write_mesh.h"

#include <gtest/gtest.h>
#include <sys/resource.h>
#include <unistd.h>

#include <csignal>
#include <filesystem>

#include "support/meshes.h"
#include "treemarch/core/error.h"

namespace treemarch {
namespace {

namespace fs = std::filesystem;
using testing::box_mesh;

class WriteMeshTest : public ::testing::Test {
 protected:
  void SetUp() override {
    folder_ = fs::path(::testing::TempDir()) / ("write_mesh_test" + std::to_string(::getpid()));
    fs::create_directories(folder_);
  }
  void TearDown() override { fs::remove_all(folder_); }
  template <class Act>
  static ErrorKind kind_of_error(Act&& act) {
    try {
      act();
    } catch (const Error& error) {
      EXPECT_EQ(std::string(error.what()).find('\n'), std::string::npos);
      return error.kind();
    }
    ADD_FAILURE() << "no error";
    return ErrorKind::limits;
  }
  fs::path folder_;
};

TEST_F(WriteMeshTest, PathsAreCheckedBeforeTheWork) {
  EXPECT_NO_THROW(check_mesh_path(folder_ / "a.vtu", false));
  EXPECT_EQ(kind_of_error([&] { check_mesh_path(folder_ / "a.xyz", false); }), ErrorKind::usage);
  EXPECT_EQ(kind_of_error([&] { check_mesh_path(folder_ / "a", false); }), ErrorKind::usage);
  EXPECT_EQ(kind_of_error([&] { check_mesh_path(folder_ / "missing" / "a.msh", false); }), ErrorKind::output);
  EXPECT_TRUE(fs::is_empty(folder_));
}

TEST_F(WriteMeshTest, FullDiskLeavesNothing) {
  const Mesh<3> mesh = box_mesh<3>({30, 30, 30}, [](const Coord<3>& c) { return c[0] * c[1] % 7; });
  rlimit before{};
  ASSERT_EQ(::getrlimit(RLIMIT_FSIZE, &before), 0);
  const auto handler = std::signal(SIGXFSZ, SIG_IGN);
  rlimit small = before;
  small.rlim_cur = 200000;
  ASSERT_EQ(::setrlimit(RLIMIT_FSIZE, &small), 0);
  for (const char* name : {"a.vtu", "a.msh", "a.mesh"})
    EXPECT_EQ(kind_of_error([&] { write_mesh<3>(folder_ / name, mesh, {}, {}, Execution(2)); }), ErrorKind::output);
  ASSERT_EQ(::setrlimit(RLIMIT_FSIZE, &before), 0);
  std::signal(SIGXFSZ, handler);
  EXPECT_TRUE(fs::is_empty(folder_));
}

TEST_F(WriteMeshTest, InterruptLeavesNothing) {
  Execution execution(2);
  execution.cancel();
  const Mesh<3> mesh = box_mesh<3>({3, 3, 3}, [](const Coord<3>&) { return 1; });
  EXPECT_THROW(write_mesh<3>(folder_ / "a.vtu", mesh, {}, {}, execution), Cancelled);
  EXPECT_TRUE(fs::is_empty(folder_));
}

TEST(OutsideLabel, IsNoLabel) {
  EXPECT_EQ(outside_label({0, 1, 2}), -1);
  EXPECT_EQ(outside_label({-2, -1, 5, -4}), -3);
}

}  // namespace
}  // namespace treemarch
