// tests/commands/test_inputs.cpp: whatever lies in place of a file that a command reads ends it in one line, soon and in
// little memory: a pipe that nobody writes to, a folder, a device, a key of 100,000 parts, a line of 6 GiB.
#include <gtest/gtest.h>
#include <poll.h>
#include <signal.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cstdlib>

#include "tests/commands/program.h"

namespace lamina::test {
namespace {

namespace fs = std::filesystem;

constexpr int kPatienceMs = 60'000;               // hashing 6 GiB on a slow machine is no hang
constexpr std::uint64_t kMaxKilobytes = 700'000;  // resident; the program itself takes some 60,000
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
constexpr bool kMemoryIsMeasurable = false;
#else
constexpr bool kMemoryIsMeasurable = true;
#endif

/// Kills a program that goes on for too long. returns  kB that it held at most
std::uint64_t watch_over(int process) {
  const auto handle = static_cast<int>(::syscall(SYS_pidfd_open, process, 0));
  EXPECT_GE(handle, 0) << "a kernel since 5.3 has it";
  pollfd ended{handle, POLLIN, 0};
  if (::poll(&ended, 1, kPatienceMs) == 0) ::kill(process, SIGKILL);
  ::close(handle);
  // The library's waitid() keeps to itself what the kernel's says of the memory.
  siginfo_t how{};
  rusage usage{};
  EXPECT_EQ(::syscall(SYS_waitid, P_PID, process, &how, WEXITED | WNOWAIT, &usage), 0);
  return static_cast<std::uint64_t>(usage.ru_maxrss);
}

std::string dotted_key() {
  std::string text = "a";
  for (int i = 1; i < 100'000; ++i) text += ".a";
  return text + "=1\n";
}

/// A file of 6 GiB that takes one block of the disk.
void write_sparse(const fs::path& path, std::string_view begin) {
  write_text(path, begin);
  ASSERT_EQ(::truncate(path.c_str(), off_t{6} << 30), 0) << path;
}

struct Thing {
  const char* name;
  void (*put)(const fs::path&);
};
const Thing kThings[] = {
    {"a pipe", [](const fs::path& path) { ASSERT_EQ(::mkfifo(path.c_str(), 0600), 0); }},
    {"a line of 6 GiB", [](const fs::path& path) { write_sparse(path, "{\n"); }},
    {"a folder", [](const fs::path& path) { fs::create_directory(path); }},
    {"/dev/zero", [](const fs::path& path) { fs::create_symlink("/dev/zero", path); }},
    {"a key of 100,000 parts", [](const fs::path& path) { write_text(path, dotted_key()); }},
    {"brackets", [](const fs::path& path) { write_text(path, "{\n\"lamina\": " + std::string(100'000, '[')); }},
    {"NUL and no UTF-8", [](const fs::path& path) { write_text(path, std::string_view("{\n\xff\xfe\0=\x80\n1\n\0", 12)); }},
};

class Inputs : public ::testing::Test {
 protected:
  Inputs() { write_one_of_each_kind(directory_); }

  Outcome run(const std::string& line) {
    return run_lamina(words_of(line), directory_.path(), [&](int process) { kilobytes_ = watch_over(process); });
  }

  Directory directory_;
  std::uint64_t kilobytes_ = 0;
};

TEST_F(Inputs, AnythingInsteadOfAFileEndsInOneLine) {
  for (const char* line : {"jet part.stl --machine hp45 --layer 1 -o out --quiet", "slice part.stl --layer 1 -o cut --quiet",
                           "extrude part.stl --machine anet-a8 --layer 0.3 -o part.gcode --quiet"}) {
    const Outcome outcome = run(line);
    ASSERT_EQ(outcome.code, 0) << line << outcome.err;
  }
  const std::string resume = "jet part.stl --machine hp45 --layer 1 -o out --resume --quiet";
  const struct {
    std::string line;
    const char* file;
    std::vector<int> codes;
    bool one_line = true;  // else one for each layer that differs, or a batch's own lines
  } rows[] = {
      {"jet --job job.toml --dry-run", "job.toml", {2}},
      {"slice --job job.toml --dry-run", "job.toml", {2}},
      {"extrude --job job.toml --dry-run", "job.toml", {2}},
      {"heights --job job.toml", "job.toml", {2}},
      {"permeability job.toml --machine anet-a8", "job.toml", {2}},
      {"permeability job.toml --machine ./printer.toml", "printer.toml", {2}},
      {"jet part.stl --machine ./powder.toml --dry-run", "powder.toml", {2}},
      {"extrude part.stl --machine ./printer.toml --dry-run", "printer.toml", {2}},
      {"machines --check ./powder.toml", "powder.toml", {2}},
      {"calibrate --machine ./printer.toml -o new", "printer.toml", {2}},
      {"batch list.txt -o farm --overwrite", "list.txt", {2}, false},
      {"heights part.stl --measure tops.txt", "tops.txt", {3}},
      {"permeability drops.csv --convention dinisio2022", "drops.csv", {3}},
      {"calibrate --machine anet-a8 --measured widths.csv -o new.toml", "widths.csv", {3}},
      {"preview part.gcode -o new.png --quiet", "part.gcode", {2, 5}},
      {"verify part.gcode", "part.gcode", {2, 5}, false},
      {"report part.gcode -o new.html", "part.gcode", {5}},
      {"verify part.gcode", "part.gcode.json", {5}},
      {"report part.gcode -o new.html", "part.gcode.json", {5}},
      {"extrude part.stl --machine anet-a8 --layer 0.3 -o part.gcode --resume --quiet", "part.gcode.json", {5}},
      {"verify out", "out/manifest.json", {5}},
      {"report out -o new.html", "out/manifest.json", {5}},
      {"preview out -o new.png --quiet", "out/manifest.json", {5}},
      {"merge out -o out", "out/manifest.json", {5}},
      {resume, "out/manifest.json", {5}},
      {"verify out", "out/layers/000001.tif", {5}},
      {"report out -o new.html", "out/layers/000001.tif", {5}},
      {"preview out -o new.png --quiet", "out/layers/000001.tif", {5}},
      {"merge out -o out", "out/layers/000001.tif", {5}},
      {resume, "out/layers/000001.tif", {0, 4}},
      {"verify out", "out/program/000001.hp45", {5}},
      {"report out -o new.html", "out/program/000001.hp45", {5}},
      {"verify out", "out/program/machine.toml", {5}},
      {"report out -o new.html", "out/program/machine.toml", {5}},
      {"verify cut", "cut/manifest.json", {5}},
      {"preview cut -o new.png --quiet", "cut/job.toml", {2}},
      {"design --pore 0.12x0.9 --machine ./printer.toml --voxel 40 -o new.toml", "printer.toml", {2}},
  };
  const fs::path kept = directory_.path() / "kept";
  std::size_t turn = 0;
  for (const auto& row : rows) {
    const fs::path file = directory_.path() / row.file;
    fs::rename(file, kept);
    // A pipe and an endless line in place of every file, the others two in turn.
    for (const std::size_t k : {std::size_t{0}, std::size_t{1}, 2 + turn % 5, 2 + (turn + 2) % 5}) {
      const Thing& thing = kThings[k];
      fs::remove_all(file);
      thing.put(file);
      const Outcome outcome = run(row.line);
      const std::string what = row.line + ", " + row.file + " is " + thing.name + ": " + outcome.err.substr(0, 1000);
      EXPECT_NE(std::ranges::find(row.codes, outcome.code), row.codes.end()) << outcome.code << " " << what;
      if (row.one_line) {
        EXPECT_EQ(outcome.error_lines(), outcome.code == 0 ? 0u : 1u) << what;
      }
      if (kMemoryIsMeasurable) {
        EXPECT_LT(kilobytes_, kMaxKilobytes) << what;
      }
    }
    fs::remove_all(file);
    fs::rename(kept, file);
    ++turn;
  }
}

TEST_F(Inputs, AJobAndAListComeThroughStandardInputWhereThatIsSaid) {
  const std::string program = LAMINA_PROGRAM;
  const auto shell = [&](const std::string& line) {
    return std::system(("cd " + directory_.path().string() + " && " + line + " > said 2>&1").c_str());
  };
  EXPECT_EQ(shell("cat job.toml | " + program + " jet --job - --dpi 60 -o piped --quiet"), 0) << read_text(directory_ / "said");
  EXPECT_EQ(shell(program + " jet --job job.toml --dpi 60 -o named --quiet"), 0) << read_text(directory_ / "said");
  EXPECT_EQ(tree_text(directory_.path() / "piped"), tree_text(directory_.path() / "named"));
  EXPECT_EQ(shell("cat list.txt | " + program + " batch - -o farm --quiet"), 0) << read_text(directory_ / "said");
  write_text(directory_ / "nested.txt", "jet --job -\n");
  EXPECT_NE(shell("cat job.toml | " + program + " batch nested.txt -o nested"), 0);
  EXPECT_NE(read_text(directory_ / "said").find("cannot read standard input"), std::string::npos);
}

}  // namespace
}  // namespace lamina::test
