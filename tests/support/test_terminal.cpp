#include <gtest/gtest.h>

#include "stages/support/text/terminal.h"

namespace lamina {
namespace {

TEST(Terminal, BarsFitNextToTheirText) {
  EXPECT_EQ(progress_bar(0.5, "half", 18), "[#####.....] half");
  EXPECT_EQ(progress_bar(0, "", 80), "[" + std::string(40, '.') + "] ");
  EXPECT_EQ(progress_bar(1, "", 80), "[" + std::string(40, '#') + "] ");
  EXPECT_EQ(progress_bar(0.5, "no room", 20), "no room");
}

TEST(Terminal, ALineIsDrawnAgainAndTakenAwayOnce) {
  StatusLine line;
  EXPECT_EQ(line.clear(), "");
  EXPECT_EQ(line.draw("1/200 layers", 8), "\r\x1b[K1/200 l");
  EXPECT_EQ(line.clear(), "\r\x1b[K");
  EXPECT_EQ(line.clear(), "");
}

}  // namespace
}  // namespace lamina
