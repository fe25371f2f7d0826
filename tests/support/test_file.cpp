#include "stages/support/io/file.h"

#include "stages/support/io/temporary.h"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/sysmacros.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>
#include <functional>
#include <thread>

#include "tests/formats/images.h"

namespace lamina {
namespace {

std::span<const std::byte> bytes_of(const std::string& text) { return std::as_bytes(std::span(text)); }

/// The exit code of what runs in a process of its own, whose limits and whose end are not those of the test.
int in_a_process(const std::function<int()>& run) {
  const pid_t child = ::fork();
  if (child == 0) ::_exit(run());
  int result = -1;
  return ::waitpid(child, &result, 0) == child && WIFEXITED(result) ? WEXITSTATUS(result) : -1;
}

std::string message_of(const Result<File>& file) { return file ? std::string() : file.error().message; }

bool ends_with(const std::string& text, const std::string& end) { return text.ends_with(end); }

TEST(WriteFile, TheFileIsThereWholeAndNothingElse) {
  const formats::testing::Folder folder;
  const std::string text(3'000'000, 'x');
  ASSERT_TRUE(write_file(folder / "layer.tif", bytes_of(text)).ok());
  EXPECT_EQ(formats::testing::load(folder / "layer.tif"), text);
  ASSERT_TRUE(write_file(folder / "empty.tif", "").ok());
  EXPECT_EQ(formats::testing::load(folder / "empty.tif"), "");
  EXPECT_EQ(folder.files(), 2u);
}

TEST(WriteFile, AnOlderFileIsReplaced) {
  const formats::testing::Folder folder;
  ASSERT_TRUE(write_file(folder / "layer.tif", bytes_of("old and longer")).ok());
  ASSERT_TRUE(write_file(folder / "layer.tif", bytes_of("new")).ok());
  EXPECT_EQ(formats::testing::load(folder / "layer.tif"), "new");
  EXPECT_EQ(folder.files(), 1u);
}

TEST(WriteFile, AMissingFolderIsNamedWithTheReason) {
  const formats::testing::Folder folder;
  const Status status = write_file(folder / "no/layer.tif", bytes_of("x"));
  ASSERT_FALSE(status.ok());
  EXPECT_EQ(status.error().fault, Fault::kOutput);
  EXPECT_EQ(status.error().message, (folder / "no/layer.tif") + ": cannot write: No such file or directory");
}

TEST(WriteFile, AFullDiskIsSaid) {
  const Status status = write_file("/dev/full", "new", {.stream = true});
  ASSERT_FALSE(status.ok());
  EXPECT_EQ(status.error().fault, Fault::kOutput);
  EXPECT_EQ(status.error().message, "/dev/full: disk full (No space left on device); free some space");
}

TEST(WriteFile, AWriteThatStopsInTheMiddleLeavesTheOlderFile) {
  const formats::testing::Folder folder;
  const std::string path = folder / "layer.tif";
  ASSERT_TRUE(write_file(path, "old").ok());
  EXPECT_EQ(in_a_process([&] {
              std::signal(SIGXFSZ, SIG_IGN);
              const rlimit limit{4096, 4096};
              ::setrlimit(RLIMIT_FSIZE, &limit);
              const Status status = write_file(path, std::string(100'000, 'x'));
              return !status.ok() && status.error().message.find("File too large") != std::string::npos ? 0 : 1;
            }),
            0);
  EXPECT_EQ(formats::testing::load(path), "old");
  EXPECT_EQ(folder.files(), 1u);
}

TEST(WriteFile, AFolderOfThatNameIsAnErrorAndLeavesNothing) {
  const formats::testing::Folder folder;
  std::filesystem::create_directory(folder / "layer.tif");
  EXPECT_FALSE(write_file(folder / "layer.tif", bytes_of("x")).ok());
  EXPECT_EQ(folder.files(), 1u);
}

TEST(File, AppearsWholeOrNotAtAll) {
  const formats::testing::Folder folder;
  const std::string path = folder / "part.gcode";
  {
    auto file = File::open(path);
    ASSERT_TRUE(file.ok());
    ASSERT_TRUE(file->append("half").ok());
    EXPECT_FALSE(std::filesystem::exists(path));
  }
  EXPECT_EQ(folder.files(), 0u) << "given up";
  auto file = File::open(path, {.hash = true});
  ASSERT_TRUE(file.ok());
  std::string whole;
  for (const std::size_t size : {1, 70'000, 3, 16'383, 16'384, 65'536, 5}) {
    const std::string piece(size, static_cast<char>('a' + whole.size() % 26));
    ASSERT_TRUE(file->append(piece).ok());
    whole += piece;
    EXPECT_EQ(file->size(), whole.size());
  }
  const auto digest = file->finish();
  ASSERT_TRUE(digest.ok());
  EXPECT_EQ(formats::testing::load(path), whole);
  EXPECT_EQ(digest->bytes, whole.size());
  EXPECT_EQ(digest->hash, hash_bytes(bytes_of(whole)));
  EXPECT_EQ(folder.files(), 1u);
}

TEST(File, TheSecondWriterOfAFileIsRefusedAsLongAsTheFirstIsThere) {
  const formats::testing::Folder folder;
  const std::string path = folder / "part.gcode";
  std::filesystem::create_symlink("part.gcode", folder / "other.gcode");
  auto first = File::open(path);
  ASSERT_TRUE(first.ok());
  ASSERT_TRUE(first->append("first").ok());
  for (const std::string& name : {path, folder / "other.gcode"}) {
    const auto second = File::open(name);
    ASSERT_FALSE(second.ok());
    EXPECT_EQ(second.error().fault, Fault::kOutput);
    EXPECT_EQ(second.error().message, name + ": another run is writing here right now; wait for it or name another file");
  }
  EXPECT_FALSE(File::reopen(path, 0).ok());
  EXPECT_FALSE(check_not_being_written(path).ok());
  ASSERT_TRUE(first->finish().ok());
  EXPECT_EQ(formats::testing::load(path), "first");
  EXPECT_TRUE(check_not_being_written(path).ok());
  EXPECT_TRUE(write_file(path, "second").ok());
}

TEST(File, OfManyThatBeginAtOnceEachIsWholeOrRefused) {
  const formats::testing::Folder folder;
  const std::string path = folder / "part.gcode";
  std::atomic<int> written{0}, refused{0}, wrong{0};
  std::vector<std::thread> writers;
  for (int t = 0; t < 8; ++t) {
    writers.emplace_back([&, t] {
      for (int k = 0; k < 200; ++k) {
        const Status status = write_file(path, std::string(5'000, static_cast<char>('a' + t)));
        if (status) {
          ++written;
        } else {
          ++refused;
          if (!status.error().message.ends_with("wait for it or name another file")) ++wrong;
        }
      }
    });
  }
  for (std::thread& writer : writers) writer.join();
  EXPECT_EQ(wrong, 0);
  EXPECT_GT(written, 0);
  EXPECT_EQ(written + refused, 1600);
  const std::string text = formats::testing::load(path);
  EXPECT_EQ(text, std::string(5'000, text.empty() ? '?' : text.front()));
  EXPECT_EQ(folder.files(), 1u);
}

TEST(File, WhatAKilledRunLeftIsReplaced) {
  const formats::testing::Folder folder;
  const std::string path = folder / "part.gcode";
  for (const bool lock : {true, false}) {
    EXPECT_EQ(in_a_process([&] {
                auto file = File::open(path, {.lock = lock});
                if (file && file->append(std::string(100'000, 'x'))) ::kill(::getpid(), SIGKILL);
                return 1;
              }),
              -1);
    EXPECT_EQ(folder.files(), 1u) << "what the killed run left";
    formats::testing::save(path + ".part", bytes_of("somebody else's"));
    ASSERT_TRUE(write_file(path, "whole").ok());
    EXPECT_EQ(formats::testing::load(path), "whole") << lock;
    EXPECT_EQ(formats::testing::load(path + ".part"), "somebody else's");
    EXPECT_EQ(folder.files(), 2u);
    std::filesystem::remove(path);
    std::filesystem::remove(path + ".part");
  }
}

TEST(File, OnlyTemporaryFilesOfTheSameNameAreRemoved) {
  const formats::testing::Folder folder;
  const std::string path = folder / "part.gcode", longest = folder / std::string(250, 'n');
  const std::vector<std::string> others = {temporary_name(folder / "other.gcode"), path + ".lamina-short.part",
                                           path + ".lamina-ABCDEFGHIJKLM.part", temporary_name(path) + ".part"};
  for (const std::string& other : others) formats::testing::save(other, bytes_of("stays"));
  const std::string stale = temporary_name(path), of_longest = temporary_name(longest);
  for (const std::string& name : {stale, of_longest}) formats::testing::save(name, bytes_of("left"));
  ASSERT_TRUE(write_file(path, "whole").ok());
  ASSERT_TRUE(write_file(longest, "whole").ok());
  for (const std::string& other : others) EXPECT_EQ(formats::testing::load(other), "stays") << other;
  EXPECT_FALSE(std::filesystem::exists(stale) || std::filesystem::exists(of_longest));
  EXPECT_EQ(named_by_temporary("part.gcode.lamina-abcdefg234567.part"), "part.gcode");
  EXPECT_EQ(named_by_temporary("part.gcode.part"), "");
}

TEST(File, WhatCannotBeReplacedByAgreementIsAnErrorInTheEnd) {
  const formats::testing::Folder folder;
  const std::string path = folder / "part.gcode";
  auto file = File::open(path, {.keep_part = true, .replace = false});
  ASSERT_TRUE(file.ok() && file->append("long work").ok());
  formats::testing::save(path, bytes_of("somebody was faster"));
  const auto digest = file->finish();
  ASSERT_FALSE(digest.ok());
  EXPECT_EQ(digest.error().message, path + ": cannot write: File exists");
  EXPECT_EQ(formats::testing::load(path), "somebody was faster");
  EXPECT_EQ(formats::testing::load(path + ".part"), "long work");
}

TEST(File, InAJobsDirectoryLinksAreReplacedAndNotFollowed) {
  const formats::testing::Folder folder;
  formats::testing::save(folder / "archive", bytes_of("precious"));
  std::filesystem::create_symlink("archive", folder / "layer.tif");
  ASSERT_TRUE(write_file(folder / "layer.tif", "new", {.lock = false, .follow = false}).ok());
  EXPECT_EQ(formats::testing::load(folder / "archive"), "precious");
  EXPECT_EQ(formats::testing::load(folder / "layer.tif"), "new");
  EXPECT_FALSE(std::filesystem::is_symlink(folder / "layer.tif"));
}

TEST(Claim, OfManyThatBeginAtOnceOneHoldsADirectory) {
  const formats::testing::Folder folder;
  const std::string path = folder / "manifest.json";
  for (int round = 0; round < 20; ++round) {
    std::atomic<int> held{0}, maximum{0}, taken{0};
    std::vector<std::thread> runs;
    for (int t = 0; t < 8; ++t) {
      runs.emplace_back([&] {
        for (int k = 0; k < 5; ++k) {
          const auto claim = Claim::take(path, "out");
          if (!claim) continue;
          ++taken;
          maximum = std::max(maximum.load(), ++held);
          std::this_thread::yield();
          --held;
        }
      });
    }
    for (std::thread& run : runs) run.join();
    EXPECT_GT(taken, 0);
    EXPECT_EQ(maximum, 1);
    EXPECT_EQ(folder.files(), 0u);
  }
}

TEST(Claim, StaysWithTheFileThatReplacesIt) {
  const formats::testing::Folder folder;
  const std::string path = folder / "manifest.json";
  {
    auto claim = Claim::take(path, "out");
    ASSERT_TRUE(claim.ok());
    EXPECT_FALSE(claim->found());
    auto file = File::open(path, {.lock = false});
    ASSERT_TRUE(file.ok() && file->append("head\n").ok());
    claim->hand_over();
    ASSERT_TRUE(file->become_part().ok());
    { const auto dropped = std::move(*claim); }
    EXPECT_EQ(formats::testing::load(path + ".part"), "head\n");
    const auto second = Claim::take(path, "out");
    ASSERT_FALSE(second.ok());
    EXPECT_EQ(second.error().message, "out: another run is writing here right now; wait for it or name another file");
    EXPECT_FALSE(check_not_being_written(path).ok());
  }
  EXPECT_TRUE(check_not_being_written(path).ok());
  const auto later = Claim::take(path, "out");
  ASSERT_TRUE(later.ok());
  EXPECT_TRUE(later->found());
  EXPECT_EQ(folder.files(), 1u);
}

TEST(File, AFileOfSeveralNamesKeepsItsBytesUnderTheOtherOne) {
  const formats::testing::Folder folder;
  formats::testing::save(folder / "precious", bytes_of("precious"));
  std::filesystem::create_hard_link(folder / "precious", folder / "part.gcode.part");
  ASSERT_TRUE(write_file(folder / "part.gcode", "whole", {.keep_part = true}).ok());
  EXPECT_EQ(formats::testing::load(folder / "precious"), "precious");
}

TEST(File, NothingIsWrittenThroughALinkOfTheTemporaryFile) {
  const formats::testing::Folder folder;
  formats::testing::save(folder / "victim", bytes_of("precious"));
  std::filesystem::create_symlink("victim", folder / "part.gcode.part");
  const std::string refusal = (folder / "part.gcode.part") + ": is a link where lamina writes its temporary file; remove it";
  EXPECT_EQ(message_of(File::open(folder / "part.gcode", {.keep_part = true})), refusal);
  EXPECT_EQ(Claim::take(folder / "part.gcode", "out").error().message, refusal);
  EXPECT_FALSE(File::reopen(folder / "part.gcode", 0).ok());
  for (const bool lock : {true, false}) {
    ASSERT_TRUE(write_file(folder / "part.gcode", "elsewhere", {.lock = lock}).ok());
    EXPECT_TRUE(std::filesystem::is_symlink(folder / "part.gcode.part"));
    std::filesystem::remove(folder / "part.gcode");
  }
  EXPECT_EQ(formats::testing::load(folder / "victim"), "precious");
  EXPECT_FALSE(std::filesystem::exists(folder / "part.gcode"));
  std::filesystem::create_directory(folder / "other.gcode.part");
  EXPECT_TRUE(ends_with(message_of(File::open(folder / "other.gcode", {.keep_part = true})),
                        "other.gcode.part: is no file where lamina writes its temporary file; remove it"));
}

TEST(File, LinksAreFollowedToTheFileThatTheyLeadTo) {
  const formats::testing::Folder folder;
  std::filesystem::create_directory(folder / "deep");
  formats::testing::save(folder / "deep/there", bytes_of("old"));
  std::filesystem::create_symlink("deep/there", folder / "second");
  std::filesystem::create_symlink("second", folder / "first");
  std::filesystem::create_symlink(folder / "deep/absent", folder / "dangling");
  ASSERT_TRUE(write_file(folder / "first", "new").ok());
  EXPECT_TRUE(std::filesystem::is_symlink(folder / "first") && std::filesystem::is_symlink(folder / "second"));
  EXPECT_EQ(formats::testing::load(folder / "deep/there"), "new");
  ASSERT_TRUE(write_file(folder / "dangling", "made").ok());
  EXPECT_TRUE(std::filesystem::is_symlink(folder / "dangling"));
  EXPECT_EQ(formats::testing::load(folder / "deep/absent"), "made");
  std::filesystem::create_symlink("round", folder / "round");
  EXPECT_EQ(message_of(File::open(folder / "round")), (folder / "round") + ": cannot write: Too many levels of symbolic links");
}

TEST(File, DevicesAndPipesAreNeverReplacedAndTakeBytesOnlyAsAStream) {
  const formats::testing::Folder folder;
  ASSERT_EQ(::mkfifo((folder / "pipe").c_str(), 0600), 0);
  std::filesystem::create_symlink("pipe", folder / "link");
  std::vector<std::string> names = {"pipe", "link"};
  const bool devices = ::mknod((folder / "null").c_str(), S_IFCHR | 0600, makedev(1, 3)) == 0;
  if (devices) names.push_back("null");
  for (const std::string& name : names) {
    EXPECT_EQ(message_of(File::open(folder / name)), (folder / name) + ": is a device or a pipe, not a file; name another one");
  }
  for (const char* name : {"/dev/stdout", "/proc/self/fd/1", "/dev/null", "-"}) EXPECT_FALSE(File::open(name).ok()) << name;

  for (const std::string& name : {std::string("pipe"), std::string("link")}) {
    const int reader = ::open((folder / "pipe").c_str(), O_RDONLY | O_NONBLOCK);
    auto file = File::open(folder / name, {.stream = true, .hash = true});
    ASSERT_TRUE(file.ok()) << message_of(file);
    EXPECT_TRUE(file->streams());
    ASSERT_TRUE(file->append("through the pipe").ok());
    ASSERT_TRUE(file->finish().ok());
    char text[64] = {};
    EXPECT_EQ(::read(reader, text, sizeof text), 16);
    EXPECT_STREQ(text, "through the pipe");
    ::close(reader);
  }
  struct stat status {};
  EXPECT_TRUE(::lstat((folder / "pipe").c_str(), &status) == 0 && S_ISFIFO(status.st_mode));
  if (!devices) GTEST_SKIP() << "mknod is not permitted here: no device was tried but those of /dev";
  ASSERT_TRUE(write_file(folder / "null", std::string(100'000, 'x'), {.stream = true}).ok());
  EXPECT_TRUE(::lstat((folder / "null").c_str(), &status) == 0 && S_ISCHR(status.st_mode));
}

TEST(File, StandardOutputIsAStreamUnderAllItsNames) {
  const formats::testing::Folder folder;
  std::filesystem::create_symlink("/dev/stdout", folder / "link");
  std::fflush(stdout);  // what the runner of the tests has said is not for the file
  EXPECT_EQ(in_a_process([&] {
              const int out = ::open((folder / "out").c_str(), O_WRONLY | O_CREAT, 0600);
              if (::dup2(out, STDOUT_FILENO) < 0) return 1;
              for (const std::string& name : {std::string("-"), std::string("/dev/stdout"), std::string("/proc/self/fd/1"),
                                              std::string("/dev/fd/1"), folder / "link"}) {
                if (!write_file(name, name.substr(name.size() - 1), {.stream = true})) return 2;
              }
              return 0;
            }),
            0);
  EXPECT_EQ(formats::testing::load(folder / "out"), "-t11k");
  EXPECT_EQ(folder.files(), 2u);
  EXPECT_FALSE(std::filesystem::exists("-"));
}

TEST(File, AReaderThatIsGoneIsAnError) {
  int ends[2];
  ASSERT_EQ(::pipe(ends), 0);
  ::close(ends[0]);
  const auto before = std::signal(SIGPIPE, SIG_IGN);
  const Status status = write_file("/dev/fd/" + std::to_string(ends[1]), "x", {.stream = true});
  std::signal(SIGPIPE, before);
  ::close(ends[1]);
  ASSERT_FALSE(status.ok());
  EXPECT_TRUE(ends_with(status.error().message, ": cannot write: Broken pipe"));
}

TEST(File, WhatIsKeptIsContinuedFromAnyOfItsBytes) {
  const formats::testing::Folder folder;
  const std::string path = folder / "part.gcode";
  const std::string whole = "layer 0\nlayer 1\nlayer 2\n";
  EXPECT_EQ(in_a_process([&] {
              auto file = File::open(path, {.keep_part = true});
              if (!file || !file->append(whole.substr(0, 16)) || !file->flush() || !file->append("stop")) return 1;
              ::kill(::getpid(), SIGKILL);
              return 2;
            }),
            -1);
  EXPECT_EQ(formats::testing::load(path + ".part"), whole.substr(0, 16)) << "what was flushed";
  {
    auto file = File::reopen(path, 8, {.hash = true, .keep_part = true});
    ASSERT_TRUE(file.ok()) << message_of(file);
    EXPECT_EQ(file->size(), 8u);
    EXPECT_EQ(file->digest().hash, hash_bytes(bytes_of(whole.substr(0, 8))));
    EXPECT_FALSE(File::open(path).ok()) << "locked again";
    ASSERT_TRUE(file->append(whole.substr(8, 3)).ok());
  }
  EXPECT_EQ(formats::testing::load(path + ".part"), whole.substr(0, 11)) << "kept where it is let go";
  const auto longer = File::reopen(path, 12);
  EXPECT_EQ(message_of(longer),
            path + ".part: is shorter than the 12 bytes that its record names; start over with --overwrite");
  EXPECT_EQ(formats::testing::load(path + ".part"), whole.substr(0, 11));
  auto file = File::reopen(path, 8, {.hash = true});
  ASSERT_TRUE(file.ok());
  ASSERT_TRUE(file->append(whole.substr(8)).ok());
  const auto digest = file->finish();
  ASSERT_TRUE(digest.ok());
  EXPECT_EQ(formats::testing::load(path), whole);
  EXPECT_EQ(digest->hash, hash_bytes(bytes_of(whole)));
  EXPECT_EQ(digest->bytes, whole.size());
  EXPECT_EQ(folder.files(), 1u);
  EXPECT_EQ(message_of(File::reopen(path, 0)), path + ".part: cannot write: No such file or directory");
}

TEST(File, WhatIsDiscardedIsGone) {
  const formats::testing::Folder folder;
  auto file = File::open(folder / "part.gcode", {.keep_part = true});
  ASSERT_TRUE(file.ok() && file->append("x").ok());
  EXPECT_EQ(folder.files(), 1u);
  file->discard();
  EXPECT_EQ(folder.files(), 0u);
}

}  // namespace
}  // namespace lamina
