#include "stages/write/atomic_file.h"

#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>

#include "tests/write/images.h"

namespace lamina::write {
namespace {

std::span<const std::byte> bytes_of(const std::string& text) { return std::as_bytes(std::span(text)); }

TEST(WriteFile, TheFileIsThereWholeAndNothingElse) {
  const testing::Folder folder;
  const std::string text(3'000'000, 'x');
  ASSERT_TRUE(write_file(folder / "layer.tif", bytes_of(text)).ok());
  EXPECT_EQ(testing::load(folder / "layer.tif"), text);
  ASSERT_TRUE(write_file(folder / "empty.tif", {}).ok());
  EXPECT_EQ(testing::load(folder / "empty.tif"), "");
  EXPECT_EQ(folder.files(), 2u);
}

TEST(WriteFile, AnOlderFileIsReplaced) {
  const testing::Folder folder;
  ASSERT_TRUE(write_file(folder / "layer.tif", bytes_of("old and longer")).ok());
  ASSERT_TRUE(write_file(folder / "layer.tif", bytes_of("new")).ok());
  EXPECT_EQ(testing::load(folder / "layer.tif"), "new");
  EXPECT_EQ(folder.files(), 1u);
}

TEST(WriteFile, AMissingFolderIsNamedWithTheReason) {
  const testing::Folder folder;
  const Status status = write_file(folder / "no/layer.tif", bytes_of("x"));
  ASSERT_FALSE(status.ok());
  EXPECT_EQ(status.error().fault, Fault::kOutput);
  EXPECT_EQ(status.error().message, (folder / "no/layer.tif") + ": cannot write: No such file or directory");
}

TEST(WriteFile, AFullDiskIsSaidAndTheOlderFileStays) {
  const testing::Folder folder;
  const std::string path = folder / "layer.tif";
  ASSERT_TRUE(write_file(path, bytes_of("old")).ok());
  std::filesystem::create_symlink("/dev/full", path + ".part");
  const Status status = write_file(path, bytes_of("new"));
  ASSERT_FALSE(status.ok());
  EXPECT_EQ(status.error().fault, Fault::kOutput);
  EXPECT_NE(status.error().message.find("disk full"), std::string::npos) << status.error().message;
  EXPECT_EQ(status.error().message.find(path), 0u);
  EXPECT_EQ(testing::load(path), "old");
  EXPECT_EQ(folder.files(), 1u);
}

TEST(WriteFile, AWriteThatStopsInTheMiddleLeavesNoFile) {
  const testing::Folder folder;
  const std::string path = folder / "layer.tif";
  // In a process of its own, which must not write its test results into a limit of 4 kB.
  const pid_t child = ::fork();
  if (child == 0) {
    std::signal(SIGXFSZ, SIG_IGN);
    const rlimit limit{4096, 4096};
    ::setrlimit(RLIMIT_FSIZE, &limit);
    const Status status = write_file(path, bytes_of(std::string(10'000, 'x')));
    ::_exit(!status.ok() && status.error().message.find("File too large") != std::string::npos ? 0 : 1);
  }
  int result = -1;
  ASSERT_EQ(::waitpid(child, &result, 0), child);
  EXPECT_EQ(result, 0);
  EXPECT_EQ(folder.files(), 0u);
}

TEST(WriteFile, AFolderOfThatNameIsAnErrorAndLeavesNothing) {
  const testing::Folder folder;
  std::filesystem::create_directory(folder / "layer.tif");
  EXPECT_FALSE(write_file(folder / "layer.tif", bytes_of("x")).ok());
  EXPECT_EQ(folder.files(), 1u);
}

}  // namespace
}  // namespace lamina::write
