#include "treemarch/pipeline/label_table.h"

#include <gtest/gtest.h>

#include "treemarch/core/error.h"

namespace treemarch {
namespace {

const LabelTable& table() {
  static const LabelTable t({0, 5, -3, 2147483647, 6}, {"", "liver", "7", "left-lung", ""});
  return t;
}

TEST(LabelTable, FindsNumbersAndNames) {
  EXPECT_EQ(table().find("5", "--size"), 1U);
  EXPECT_EQ(table().find("liver", "--size"), 1U);
  EXPECT_EQ(table().find("-3", "--size"), 2U);
  EXPECT_EQ(table().find("2147483647", "--size"), 3U);
  EXPECT_EQ(table().find("7", "--size"), 2U) << "a name wins over a number";
}

TEST(LabelTable, FindsSets) {
  using Ids = std::vector<MaterialId>;
  EXPECT_EQ(table().find_set("5,0", "--keep"), (Ids{0, 1}));
  EXPECT_EQ(table().find_set("-3-5", "--keep"), (Ids{0, 1, 2}));
  EXPECT_EQ(table().find_set("liver,5-6,5", "--keep"), (Ids{1, 4}));
  EXPECT_EQ(table().find_set("left-lung", "--keep"), (Ids{3}));
}

TEST(LabelTable, RefusesTheUnknown) {
  for (const char* text : {"8", "", "5x", "lung", "2147483648", "1.0"}) {
    EXPECT_THROW((void)table().find(text, "--size"), Error) << text;
    EXPECT_THROW((void)table().find_set(text, "--size"), Error) << text;
  }
  EXPECT_THROW((void)table().find_set("10-20", "--size"), Error);
  EXPECT_THROW((void)table().find_set("5,,6", "--size"), Error);
}

TEST(LabelTable, SplitsAssignments) {
  EXPECT_EQ(split_assignment("a=b=3", "-x"), (std::pair<std::string_view, std::string_view>("a=b", "3")));
  for (const char* text : {"", "=", "a=", "=3", "a"}) EXPECT_THROW(split_assignment(text, "-x"), Error) << text;
}

}  // namespace
}  // namespace treemarch
