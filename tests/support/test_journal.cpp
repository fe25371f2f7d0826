#include <gtest/gtest.h>

#include <vector>

#include "stages/support/io/journal.h"
#include "tests/commands/program.h"

namespace lamina::test {
namespace {

std::vector<std::string> lines_of(Journal& journal) {
  std::vector<std::string> lines;
  EXPECT_TRUE(journal.read([&](const std::string& line, std::uint64_t) { lines.push_back(line); }).ok());
  return lines;
}

TEST(Journal, LinesAreThereAgainAndATornOneIsAlone) {
  const Directory directory;
  const std::string path = directory / "journal";
  {
    auto journal = Journal::open(path, "held");
    ASSERT_TRUE(journal.ok());
    EXPECT_TRUE(journal->empty());
    ASSERT_TRUE(journal->append("one\n").ok());
    ASSERT_TRUE(journal->append("two\n").ok());
    EXPECT_FALSE(journal->empty());
  }
  write_text(path, read_text(path) + "tor");
  auto journal = Journal::open(path, "held");
  ASSERT_TRUE(journal.ok());
  EXPECT_EQ(lines_of(*journal), (std::vector<std::string>{"one", "two", "tor"}));
  ASSERT_TRUE(journal->append("three\n").ok());
  EXPECT_EQ(read_text(path), "one\ntwo\ntor\nthree\n");
  ASSERT_TRUE(journal->clear().ok());
  EXPECT_TRUE(journal->empty());
}

TEST(Journal, OneProcessHoldsItAndTheOtherIsReported) {
  const Directory directory;
  const auto first = Journal::open(directory / "journal", "is held");
  ASSERT_TRUE(first.ok());
  const auto second = Journal::open(directory / "journal", "is held");
  ASSERT_FALSE(second.ok());
  EXPECT_EQ(second.error().message, (directory / "journal") + ": is held");
  EXPECT_FALSE(Journal::open(directory / "absent/journal", "is held").ok());
}

}  // namespace
}  // namespace lamina::test
