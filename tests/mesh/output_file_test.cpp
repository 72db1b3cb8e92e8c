#include "treemarch/mesh/output_file.h"

#include <gtest/gtest.h>
#include <sys/resource.h>
#include <unistd.h>

#include <csignal>
#include <filesystem>
#include <fstream>
#include <sstream>

#include "treemarch/core/error.h"

namespace treemarch {
namespace {

namespace fs = std::filesystem;

class OutputFileTest : public ::testing::Test {
 protected:
  void SetUp() override {
    folder_ = fs::path(::testing::TempDir()) / ("output_file_test" + std::to_string(::getpid()));
    fs::create_directories(folder_);
  }
  void TearDown() override { fs::remove_all(folder_); }
  [[nodiscard]] std::string path(const std::string& name) const { return folder_ / name; }
  [[nodiscard]] std::size_t file_count() const {
    return static_cast<std::size_t>(std::distance(fs::directory_iterator(folder_), fs::directory_iterator()));
  }
  static std::string content(const std::string& path) {
    std::ostringstream text;
    text << std::ifstream(path).rdbuf();
    return text.str();
  }
  template <class Act>
  static void expect_error(Act&& act, const std::string& part) {
    try {
      act();
      ADD_FAILURE() << "no error";
    } catch (const Error& error) {
      EXPECT_EQ(error.kind(), ErrorKind::output);
      EXPECT_NE(std::string(error.what()).find(part), std::string::npos) << error.what();
      EXPECT_EQ(std::string(error.what()).find('\n'), std::string::npos);
    }
  }
  fs::path folder_;
};

TEST_F(OutputFileTest, AppearsOnCommitOnly) {
  {
    OutputFile file(path("a"), false);
    file.write("hello world");
    file.write_at(6, "W", 1);
    file.write("!");
    EXPECT_EQ(file.position(), 12);
    EXPECT_FALSE(fs::exists(path("a")));
    file.commit();
  }
  EXPECT_EQ(content(path("a")), "hello World!");
  { OutputFile(path("b"), false).write("never"); }
  EXPECT_EQ(file_count(), 1U);
}

TEST_F(OutputFileTest, KeepsWhatIsThere) {
  std::ofstream(path("a")) << "old";
  expect_error([&] { OutputFile(path("a"), false); }, "exists already");
  { OutputFile(path("a"), true).write("half"); }
  EXPECT_EQ(content(path("a")), "old");
  OutputFile file(path("a"), true);
  file.write("new");
  file.commit();
  EXPECT_EQ(content(path("a")), "new");
  EXPECT_EQ(file_count(), 1U);
}

TEST_F(OutputFileTest, RefusesPlacesThatAreNoFiles) {
  expect_error([&] { OutputFile(folder_.string(), true); }, "is a folder");
  expect_error([&] { OutputFile("/dev/full", true); }, "not a regular file");
  expect_error([&] { OutputFile(path("missing/a"), true); }, "No such file or directory");
  expect_error([&] { OutputFile(path(std::string(300, 'x')), true); }, "cannot be written");
  EXPECT_EQ(file_count(), 0U);
}

TEST_F(OutputFileTest, FullDiskIsAnError) {
  // A limit to the size of files stands for the disk: the same error path, but without mounting anything.
  rlimit before{};
  ASSERT_EQ(::getrlimit(RLIMIT_FSIZE, &before), 0);
  const auto handler = std::signal(SIGXFSZ, SIG_IGN);
  rlimit small = before;
  small.rlim_cur = 100000;
  ASSERT_EQ(::setrlimit(RLIMIT_FSIZE, &small), 0);
  expect_error(
      [&] {
        OutputFile file(path("large"), false);
        const std::string data(99000, 'x');
        for (int i = 0; i < 10; ++i) file.write(data);
        file.commit();
      },
      "writing failed");
  expect_error(  // little enough to stay in the buffer until the end
      [&] {
        OutputFile file(path("late"), false);
        for (int i = 0; i < 100001; ++i) file.write("x");
        file.commit();
      },
      "writing failed");
  ASSERT_EQ(::setrlimit(RLIMIT_FSIZE, &before), 0);
  std::signal(SIGXFSZ, handler);
  EXPECT_EQ(file_count(), 0U);
}

}  // namespace
}  // namespace treemarch
