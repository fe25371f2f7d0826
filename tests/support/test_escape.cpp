#include <gtest/gtest.h>

#include "stages/support/text/escape.h"

namespace lamina::test {
namespace {

TEST(Escape, EveryLanguageShowsTheTextThatItWasGiven) {
  EXPECT_EQ(roff(".a -o\n'b\\ c.d"), "\\&.a \\-o\n\\&'b\\e c.d");
  EXPECT_EQ(markdown_cell("a|b <c> *d*\ne_f"), "a\\|b \\<c> \\*d\\* e\\_f");
  EXPECT_EQ(markdown_code("A|B,*"), "`A\\|B,*`");
  EXPECT_EQ(zsh_argument("it's [1:2] \\"), "it'\\''s \\[1\\:2\\] \\\\");
  EXPECT_EQ(fish_word("it's \\"), "'it\\'s \\\\'");
}

}  // namespace
}  // namespace lamina::test
