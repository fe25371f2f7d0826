#include <gtest/gtest.h>

#include <array>
#include <filesystem>

#include "stages/support/io/file.h"
#include "tests/commands/program.h"

namespace lamina::test {
namespace {

TEST(Replaceable, AFileIsWhatItsHeadSays) {
  const Directory directory;
  constexpr std::array<std::string_view, 3> marks = {"^made here", "drawn by us", ""};
  const auto replaceable = [&](const std::string& text) {
    write_text(directory / "file", text);
    return is_replaceable(directory / "file", marks);
  };
  EXPECT_TRUE(is_replaceable(directory / "absent", marks));
  EXPECT_TRUE(replaceable(""));
  EXPECT_TRUE(replaceable("made here, today"));
  EXPECT_FALSE(replaceable("not made here"));
  EXPECT_TRUE(replaceable("<!-- drawn by us -->"));
  EXPECT_FALSE(replaceable(std::string(4096, ' ') + "drawn by us"));
}

TEST(Replaceable, LinksLeadToTheSameFileAndDevicesAreStreams) {
  const Directory directory;
  write_text(directory / "file", "text");
  std::filesystem::create_symlink(directory / "file", directory / "link");
  EXPECT_TRUE(same_file(directory / "file", directory / "link"));
  EXPECT_FALSE(same_file(directory / "file", directory / "absent"));
  EXPECT_TRUE(is_file(directory / "link"));
  EXPECT_FALSE(is_file("/dev/null"));
  EXPECT_TRUE(is_stream("/dev/null"));
  EXPECT_TRUE(is_stream("-"));
  EXPECT_FALSE(is_stream(directory / "file"));
}

}  // namespace
}  // namespace lamina::test
