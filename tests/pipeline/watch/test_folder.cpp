// tests/pipeline/watch/test_folder.cpp: when a file of a watched folder counts as complete.
#include "pipeline/watch/folder.h"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <thread>
#include <utility>

#include "tests/commands/program.h"

namespace lamina::pipeline {
namespace {

namespace fs = std::filesystem;
const std::atomic<bool> kNoStop{false};

class FilesOfAFolder : public ::testing::Test {
 protected:
  FilesOfAFolder() : folder_(std::move(*Folder::open(directory_.path().string(), {"done"}))) { scan(); }

  void scan() {
    folder_.take_events();
    EXPECT_TRUE(folder_.scan().ok());
  }
  bool complete(const std::string& name, double settle_seconds = 1000) {
    scan();
    return folder_.is_complete(name, settle_seconds, kNoStop);
  }
  bool has_leases(const std::string& name) {
    const int file = ::open((directory_ / name).c_str(), O_RDONLY | O_CLOEXEC);
    const bool leased = ::fcntl(file, F_SETLEASE, F_RDLCK) == 0;
    ::close(file);
    return leased;
  }
  void put_box(const std::string& name) { test::write_box(directory_ / name, {0, 0, 0}, {1, 2, 3}); }

  test::Directory directory_;
  Folder folder_;
};

TEST_F(FilesOfAFolder, AreThoseOfPartsAndJobs) {
  fs::create_directories(directory_ / "sub/.hidden");
  fs::create_directories(directory_ / "done");
  for (const char* name : {"a.stl", "sub/B.STL.gz", "c.3mf", "d.obj", "e.toml", "f.stl.part", "g.txt", ".h.stl",
                           "sub/.hidden/i.stl", "done/j.stl", "k.stl~", "l.stl.crdownload"})
    test::write_text(directory_ / name, "x");
  fs::create_symlink("a.stl", directory_ / "link.stl");
  scan();
  std::string names;
  for (const auto& [name, file] : folder_.files()) names += name + " ";
  EXPECT_EQ(names, "a.stl c.3mf d.obj e.toml sub/B.STL.gz ");
}

TEST_F(FilesOfAFolder, AreCompleteAtOnceWhenTheirWriterClosesThemAndTheyStateTheirLength) {
  put_box("whole.stl");
  EXPECT_TRUE(complete("whole.stl"));
  std::ofstream open(directory_ / "open.stl", std::ios::binary);
  open << test::read_text(directory_ / "whole.stl") << std::flush;
  EXPECT_FALSE(complete("open.stl"));
  open.close();
  EXPECT_TRUE(complete("open.stl"));
  // Opened again: what is written now may be half of it.
  open.open(directory_ / "open.stl", std::ios::binary | std::ios::in);
  open << "x" << std::flush;
  EXPECT_FALSE(complete("open.stl"));
  open.close();
  EXPECT_TRUE(complete("open.stl"));
}

TEST_F(FilesOfAFolder, AreCompleteAtOnceEvenIfTheyCameBeforeTheEventsOfTheirFolder) {
  fs::create_directories(directory_ / "sub");
  put_box("sub/a.stl");
  if (!has_leases("sub/a.stl")) GTEST_SKIP() << "a file system without leases";
  EXPECT_TRUE(complete("sub/a.stl"));
  const test::Directory next;
  fs::copy_file(directory_ / "sub/a.stl", next / "a.stl");
  std::ofstream open(next / "a.stl", std::ios::binary | std::ios::in);
  Folder other = std::move(*Folder::open(next.path().string(), {}));
  EXPECT_TRUE(other.scan().ok());
  EXPECT_FALSE(other.is_complete("a.stl", 1000, kNoStop));
  open.close();
  other.take_events();
  EXPECT_TRUE(other.scan().ok());
  EXPECT_TRUE(other.is_complete("a.stl", 1000, kNoStop));
}

TEST_F(FilesOfAFolder, AreIncompleteWhileTheyAreWrittenEvenIfSizeAndTimeStay) {
  put_box("a.stl");
  EXPECT_TRUE(complete("a.stl"));
  const auto time = fs::last_write_time(directory_ / "a.stl");
  std::ofstream open(directory_ / "a.stl", std::ios::binary | std::ios::in);
  open << "x" << std::flush;
  fs::last_write_time(directory_ / "a.stl", time);
  EXPECT_FALSE(complete("a.stl"));
  open.close();
  EXPECT_TRUE(complete("a.stl"));
}

TEST_F(FilesOfAFolder, AreCompleteAtOnceWhenTheyAreRenamedUnlessSomethingIsMissing) {
  test::write_text(directory_ / "new.part", "v 0 0 0\n");
  fs::rename(directory_ / "new.part", directory_ / "a.obj");
  EXPECT_TRUE(complete("a.obj"));
  test::write_text(directory_ / "new.part", std::string(100, '\0'));
  fs::resize_file(directory_ / "new.part", 83);
  fs::rename(directory_ / "new.part", directory_ / "b.stl");
  EXPECT_FALSE(complete("b.stl", 0));
  EXPECT_EQ(Folder::lack_of(folder_.files().at("b.stl"), 0), "83 of at least 84 bytes");
}

TEST_F(FilesOfAFolder, AreIncompleteWhileAnyoneHasThemOpenForWritingHoweverLongUnchanged) {
  put_box("a.stl");
  test::write_text(directory_ / "b.obj", "v 0 0 0\n");
  if (!has_leases("a.stl")) GTEST_SKIP() << "a file system without leases";
  for (const char* name : {"a.stl", "b.obj"}) {
    EXPECT_TRUE(complete(name, 0));
    std::ofstream open(directory_ / name, std::ios::binary | std::ios::in);
    EXPECT_FALSE(complete(name, 0)) << name;
    EXPECT_EQ(Folder::lack_of(folder_.files().at(name), 0), "a program has it open for writing");
    open.close();
    EXPECT_TRUE(complete(name, 0)) << name;
  }
}

TEST_F(FilesOfAFolder, AreReadAgainAfterAnErrorWithoutAChange) {
  put_box("a.stl");
  const int file = ::open((directory_ / "a.stl").c_str(), O_RDONLY | O_CLOEXEC);
  if (::fcntl(file, F_SETLEASE, F_WRLCK) != 0) GTEST_SKIP() << "a file system without leases";  // nobody else can open it
  EXPECT_FALSE(complete("a.stl", 0));
  EXPECT_NE(Folder::lack_of(folder_.files().at("a.stl"), 0).find("a.stl: cannot be opened"), std::string::npos);
  ::fcntl(file, F_SETLEASE, F_UNLCK);
  ::close(file);
  EXPECT_FALSE(complete("a.stl", 0));  // not at once: there is no busy loop
  std::this_thread::sleep_for(std::chrono::milliseconds(1100));
  EXPECT_TRUE(complete("a.stl", 0));
}

TEST_F(FilesOfAFolder, HaveOneWatcherAlsoInFoldersAboveAndBelow) {
  for (const char* folder : {"a/b/c", "a/next", "a/.hidden/d"}) fs::create_directories(directory_ / folder);
  const auto fault = [](const std::string& root) {
    const auto folder = Folder::open(root, {});
    return folder ? Fault::kInterrupted : folder.error().fault;
  };
  EXPECT_EQ(fault(directory_ / "a"), Fault::kUsage);
  EXPECT_EQ(fault(directory_.path()), Fault::kOutput);
  const test::Directory root;
  for (const char* folder : {"a/b/c", "a/next", "a/.hidden/d"}) fs::create_directories(root / folder);
  {
    const auto watched = Folder::open(root / "a/b", {}), hidden = Folder::open(root / "a/.hidden/d", {});
    for (const auto& folder : {root / "a", root.path().string(), root / "a/b/c"}) EXPECT_EQ(fault(folder), Fault::kUsage);
    EXPECT_EQ(fault(root / "a/next"), Fault::kInterrupted);  // no fault
  }
  EXPECT_EQ(fault(root / "a"), Fault::kInterrupted);
}

TEST_F(FilesOfAFolder, OfOtherFormatsAreCompleteAfterATimeWithoutAChange) {
  test::write_text(directory_ / "a.obj", "v 0 0 0\n");
  EXPECT_FALSE(complete("a.obj"));
  EXPECT_TRUE(complete("a.obj", 0));
  std::this_thread::sleep_for(std::chrono::milliseconds(300));
  EXPECT_TRUE(complete("a.obj", 0.2));
  std::ofstream(directory_ / "a.obj", std::ios::app) << "v 1 0 0\n";
  EXPECT_FALSE(complete("a.obj", 0.2));
}

}  // namespace
}  // namespace lamina::pipeline
