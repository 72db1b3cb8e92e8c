#include "treemarch/pipeline/length.h"

#include <gtest/gtest.h>

#include "treemarch/core/error.h"

namespace treemarch {
namespace {

TEST(Length, UnitsGiveMillimetres) {
  EXPECT_DOUBLE_EQ(parse_length("2", 0.5, "--min-size"), 2);
  EXPECT_DOUBLE_EQ(parse_length("2mm", 0.5, "--min-size"), 2);
  EXPECT_DOUBLE_EQ(parse_length("2vox", 0.5, "--min-size"), 1);
  EXPECT_DOUBLE_EQ(parse_length("2.5um", 0.5, "--min-size"), 0.0025);
  EXPECT_DOUBLE_EQ(parse_length("2.5\u00b5m", 0.5, "--min-size"), 0.0025);
  EXPECT_DOUBLE_EQ(parse_length("1e3nm", 0.5, "--min-size"), 0.001);
  EXPECT_DOUBLE_EQ(parse_length("3cm", 0.5, "--min-size"), 30);
  EXPECT_DOUBLE_EQ(parse_length("3m", 0.5, "--min-size"), 3000);
}

TEST(Length, RefusesWhatIsNone) {
  for (const char* text : {"", "mm", "0", "-1", "0vox", "-2mm", "nan", "inf", "2 mm", "2x", "2vx", "1,5"})
    EXPECT_THROW(parse_length(text, 1, "--min-size"), Error) << text;
}

}  // namespace
}  // namespace treemarch
