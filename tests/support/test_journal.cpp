#include <gtest/gtest.h>

#include <atomic>
#include <cerrno>
#include <chrono>
#include <filesystem>
#include <optional>
#include <thread>
#include <vector>

#include "stages/support/io/journal.h"
#include "stages/support/io/rename.h"
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

TEST(Journal, AFileThatIsRemovedBeforeItIsLockedIsMadeAgain) {
  const Directory directory;
  const std::string path = directory / "journal";
  for (int round = 0; round < 5; ++round) {
    std::optional<Result<Journal>> first(Journal::open(path, "held"));
    std::thread other([&] {
      auto second = Journal::open(path, "held");
      ASSERT_TRUE(second.ok()) << second.error().message;
      EXPECT_TRUE(is_journal_held(path));
    });
    std::this_thread::sleep_for(std::chrono::milliseconds(8));
    std::filesystem::remove(path);
    first.reset();
    other.join();
  }
}

TEST(Rename, WithoutOneStepExactlyOneOfManyGetsTheName) {
  const Directory directory;
  for (int round = 0; round < 300; ++round) {
    const std::string name = directory / std::to_string(round);
    std::atomic<int> ready = 0, renamed = 0;
    std::vector<std::thread> threads;
    for (int i = 0; i < 2; ++i) {
      const std::string from = directory / ("from" + std::to_string(i));
      write_text(from, "");
      threads.emplace_back([&, from] {
        for (++ready; ready < 2;) std::this_thread::yield();
        const int reason = rename_new_by_link(from, name);
        EXPECT_TRUE(reason == 0 || reason == EEXIST) << reason;
        EXPECT_EQ(std::filesystem::exists(from), reason != 0);
        renamed += reason == 0;
      });
    }
    for (std::thread& thread : threads) thread.join();
    EXPECT_EQ(renamed, 1);
  }
  EXPECT_EQ(rename_new_by_link(directory / "absent", directory / "other"), ENOENT);
  std::filesystem::create_directory(directory / "folder");
  EXPECT_EQ(rename_new_by_link(directory / "folder", directory / "0"), EEXIST);
  EXPECT_EQ(rename_new_by_link(directory / "folder", directory / "moved"), 0);
}

}  // namespace
}  // namespace lamina::test
