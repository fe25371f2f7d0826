#include <gtest/gtest.h>

#include "stages/support/text/escape.h"

namespace lamina::test {
namespace {

using Words = std::vector<std::string>;

TEST(ShellWords, WordsAreSplitAsAShellSplitsThem) {
  const auto words = [](std::string_view line) { return *split_words(line); };
  EXPECT_EQ(words("jet a.stl --dpi 600"), (Words{"jet", "a.stl", "--dpi", "600"}));
  EXPECT_EQ(words("  jet\t'my part.stl'  \"b\\\"c\" d\\ e '' # rest\r"), (Words{"jet", "my part.stl", "b\"c", "d e", ""}));
  EXPECT_EQ(words("jet a#b 'c'\"d\"e"), (Words{"jet", "a#b", "cde"}));
  EXPECT_EQ(words("# only a comment 'with a quote"), Words{});
  EXPECT_EQ(words(""), Words{});
  EXPECT_FALSE(split_words("jet 'a.stl").ok());
  EXPECT_FALSE(split_words("jet \"a.stl").ok());
}

}  // namespace
}  // namespace lamina::test
