// Wrong use of the real program: one line, the documented exit code, and nothing half made.
#include <gtest/gtest.h>
#include <sys/mount.h>
#include <sys/stat.h>
#include <zlib.h>

#include <algorithm>
#include <cstdlib>
#include <cstring>

#include "tests/commands/program.h"

namespace lamina::test {
namespace {

using Words = std::vector<std::string>;

void append(std::string& bytes, std::uint32_t value, int count) {
  for (int i = 0; i < count; ++i) bytes += static_cast<char>(value >> (8 * i) & 0xff);
}

// A zip with one deflated entry, as small as it gets.
std::string zip_of(const std::string& name, const std::string& content) {
  std::string packed(compressBound(content.size()), '\0');
  z_stream stream{};
  deflateInit2(&stream, 9, Z_DEFLATED, -15, 9, Z_DEFAULT_STRATEGY);
  stream.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(content.data()));
  stream.avail_in = static_cast<uInt>(content.size());
  stream.next_out = reinterpret_cast<Bytef*>(packed.data());
  stream.avail_out = static_cast<uInt>(packed.size());
  deflate(&stream, Z_FINISH);
  packed.resize(stream.total_out);
  deflateEnd(&stream);
  const auto crc =
      static_cast<std::uint32_t>(crc32(0, reinterpret_cast<const Bytef*>(content.data()), static_cast<uInt>(content.size())));
  const auto entry = [&](std::string& bytes) {
    append(bytes, 20, 2);  // version
    append(bytes, 0, 2);   // flags
    append(bytes, 8, 2);   // deflate
    append(bytes, 0x21, 4);
    append(bytes, crc, 4);
    append(bytes, static_cast<std::uint32_t>(packed.size()), 4);
    append(bytes, static_cast<std::uint32_t>(content.size()), 4);
    append(bytes, static_cast<std::uint32_t>(name.size()), 2);
    append(bytes, 0, 2);  // extra
  };
  std::string bytes, directory;
  append(bytes, 0x04034b50, 4);
  entry(bytes);
  bytes += name + packed;
  append(directory, 0x02014b50, 4);
  append(directory, 20, 2);
  entry(directory);
  append(directory, 0, 4);  // comment, disk
  append(directory, 0, 2);  // attributes
  append(directory, 0, 4);
  append(directory, 0, 4);  // offset
  directory += name;
  const auto start = static_cast<std::uint32_t>(bytes.size());
  bytes += directory;
  append(bytes, 0x06054b50, 4);
  append(bytes, 0, 4);
  append(bytes, 1, 2);
  append(bytes, 1, 2);
  append(bytes, static_cast<std::uint32_t>(directory.size()), 4);
  append(bytes, start, 4);
  append(bytes, 0, 2);
  return bytes;
}

class WrongUse : public ::testing::Test {
 protected:
  WrongUse() { write_box(directory_ / "part.stl", {0, 0, 0}, {20, 10, 5}); }

  // The arguments are refused with this code and one line that holds these words; nothing is left behind.
  void refused(int code, const std::vector<std::string>& arguments, const std::vector<std::string>& words) {
    const auto before = files_below(directory_.path());
    const Outcome outcome = run_lamina(arguments, directory_.path());
    std::string call;
    for (const std::string& argument : arguments) call += argument + " ";
    EXPECT_EQ(outcome.code, code) << call << "\n" << outcome.err;
    EXPECT_EQ(outcome.error_lines(), 1u) << call << "\n" << outcome.err;
    EXPECT_EQ(outcome.out, "") << call;
    for (const std::string& word : words) EXPECT_NE(outcome.err.find(word), std::string::npos) << call << "\n" << outcome.err;
    EXPECT_EQ(files_below(directory_.path()), before) << call;
  }

  Directory directory_;
};

TEST_F(WrongUse, UnknownNamesAreRefusedWithTheNearestKnownOne) {
  refused(2, {"jett"}, {"'jett'", "'jet'"});
  refused(2, {"jet", "part.stl", "--dip", "600", "-o", "out"}, {"--dip", "'--dpi'"});
  refused(2, {"jet", "part.stl", "--resune", "-o", "out"}, {"--resune", "'--resume'"});
  refused(2, {"jet", "part.stl", "-x", "-o", "out"}, {"-x"});
  refused(2, {"verify", "--qick", "."}, {"--qick", "'--quick'"});
  refused(2, {"merge", "--out", "x", "."}, {"--out", "'--output'"});
  refused(2, {"jet", "part.stl", "--format", "tiff", "-o", "out"}, {"--format", "tiff-g4"});
  refused(2, {"jet", "part.stl", "--set", "bed.dip=600", "-o", "out"}, {"bed.dip", "'dpi'"});
}

TEST_F(WrongUse, ValuesOutOfRangeNameTheirOption) {
  const std::pair<const char*, const char*> values[] = {
      {"--dpi", "0"},         {"--dpi", "-1"},       {"--dpi", "1e9"},   {"--dpi", "nan"},     {"--dpi", "600x"},
      {"--dpi", "600.12345"}, {"--layer", "0"},      {"--layer", "-1"},  {"--layer", "NaN"},   {"--layer", "inf"},
      {"--layer", "1e-9"},    {"--layer", "0.05mm"}, {"--bed", "0x0"},   {"--bed", "-10x10"},  {"--bed", "10"},
      {"--bed", "2148x100"},  {"--bed", "nanxnan"},  {"--copies", "0"},  {"--copies", "1e10"}, {"--copies", "2.5"},
      {"--gap", "-1"},        {"--scale", "0"},      {"--scale", "1,2"}, {"--scale", "nan"},   {"--rotate", "90"},
      {"--shrink", "0"},      {"--shrink", "-1"},    {"--at", "-1,0"},   {"--at", "1"},        {"--unit", "parsec"},
      {"--engine", "magic"},  {"--isa", "sse9"},     {"--fill", "some"}, {"--mirror", "z"},    {"--layers", "3:3"},
      {"--layers", "x"},      {"--shard", "0/4"},    {"--shard", "5/4"}, {"--threads", "-1"},  {"--memory", "0"},
      {"--memory", "lots"},   {"--weld", "-1"},      {"--bottom", "-1"}, {"--dpi", ""},        {"-o", ""},
  };
  for (const auto& [option, value] : values)
    refused(2, {"jet", "part.stl", "-o", "out", option, value}, {option + std::strlen(option) - 1});
}

TEST_F(WrongUse, OptionsThatExcludeEachOtherAreRefused) {
  refused(2, {"jet", "part.stl", "-o", "out", "--resume", "--overwrite"}, {"--resume", "--overwrite"});
  refused(2, {"jet", "part.stl", "-o", "out", "--layers", "0:1", "--shard", "1/2"}, {"--layers", "--shard"});
  refused(2, {"jet", "part.stl", "part.stl", "-o", "out", "--at", "0,0"}, {"--at"});
  refused(2, {"jet", "part.stl", "-o", "--resume"}, {"--output", "--resume"});
}

TEST_F(WrongUse, MissingThingsAreNamed) {
  refused(2, {"jet", "-o", "out"}, {"part"});
  refused(2, {"jet", "part.stl"}, {"-o DIR"});
  refused(3, {"jet", "absent.stl", "-o", "out"}, {"absent.stl"});
  refused(2, {"jet", "--job", "absent.toml", "-o", "out"}, {"absent.toml"});
  refused(2, {"verify", "absent"}, {"absent"});
  refused(5, {"verify", "."}, {"manifest.json"});
  refused(2, {"verify"}, {"directory"});
  refused(2, {"merge", "absent", "-o", "out"}, {"absent"});
  refused(2, {"merge", "."}, {"-o OUT"});
  refused(4, {"design", "--pore", "0.12x0.9", "--machine", "anet-a8", "-o", "absent/x.toml"}, {"there is no folder absent"});
  // Inputs need not exist: outputs are checked before they are read.
  for (const std::string command : {"export", "extrude", "heights", "report", "stream"})
    refused(4, {command, "absent-input", "-o", "absent/x.stl"}, {"there is no folder absent"});
  for (const std::string command : {"jet", "slice", "convert", "merge", "batch"})
    refused(4, {command, "absent-input", "-o", "/dev/null/x"}, {"/dev/null is no folder"});
  // A dry run writes nothing.
  for (const Words& command : {Words{"extrude", "--machine", "anet-a8"}, Words{"jet", "--layer", "1"}, Words{"slice"}}) {
    Words words{command.front(), "part.stl", "--dry-run", "-o",
                command.front() == "extrude" ? "absent/x.gcode" : "/dev/null/x"};
    words.insert(words.end(), command.begin() + 1, command.end());
    EXPECT_EQ(run_lamina(words, directory_.path()).code, 0) << command.front();
  }
}

TEST_F(WrongUse, JobFileWithNanIsRefusedByLine) {
  write_text(directory_ / "job.toml", "[layers]\nthickness_mm = nan\n[[part]]\npath = 'part.stl'\n");
  refused(2, {"jet", "--job", "job.toml", "-o", "out"}, {"job.toml:2", "layers.thickness_mm"});
}

TEST_F(WrongUse, BedSmallerThanThePartSaysBothSizes) {
  refused(2, {"jet", "part.stl", "--bed", "15x15", "-o", "out"}, {"part.stl", "20 x 10 mm", "15 x 15 mm"});
  refused(2, {"jet", "part.stl", "--bed", "15x25", "-o", "out"}, {"--rotate 0,0,90"});
  refused(2, {"jet", "part.stl", "--bed", "100x100", "--at", "81,0", "-o", "out"}, {"part.stl", "1 mm"});
  refused(2, {"jet", "part.stl", "--bed", "50x50", "--copies", "9", "-o", "out"}, {"part.stl", "--copies"});
  refused(2, {"jet", "part.stl", "--layers", "9999:", "--dpi", "60", "-o", "out"}, {"--layers"});
}

TEST_F(WrongUse, DirectoryThatCannotBeWrittenIsAnOutputError) {
  write_text(directory_ / "file", "not a directory");
  refused(4, {"jet", "part.stl", "-o", "file"}, {"file"});
  refused(2, {"jet", "part.stl", "-o", "part.stl"}, {"part.stl", "is read by this call as a part"});
  refused(4, {"jet", "part.stl", "-o", "part.stl/out"}, {"part.stl/out"});
  refused(4, {"jet", "part.stl", "-o", "/proc/nowhere/out"}, {"/proc/nowhere/out"});
  refused(4, {"jet", "part.stl", "--dry-run", "--save-job", "/proc/nowhere/job.toml"}, {"/proc/nowhere/job.toml"});
}

TEST_F(WrongUse, WrittenFilesReplaceNeitherPartsNorDevices) {
  refused(2, {"jet", "part.stl", "--dry-run", "--save-job", "part.stl"}, {"part.stl", "is read by this call as a part"});
  EXPECT_EQ(run_lamina({"info", "part.stl"}, directory_.path()).code, 0);
  ASSERT_EQ(::mkfifo((directory_ / "pipe").c_str(), 0600), 0);
  std::filesystem::create_symlink("pipe", directory_ / "device");
  refused(4, {"jet", "part.stl", "--dry-run", "--save-job", "pipe"}, {"pipe", "a device or a pipe"});
  refused(4, {"jet", "part.stl", "--dry-run", "--save-job", "device"}, {"device", "a device or a pipe"});
  refused(4, {"jet", "part.stl", "--dry-run", "--save-job", "."}, {"a directory"});
  // A link to a file stays one.
  write_text(directory_ / "file.toml", "# A job of lamina.");
  std::filesystem::create_symlink("file.toml", directory_ / "link.toml");
  EXPECT_EQ(run_lamina({"jet", "part.stl", "--dry-run", "--quiet", "--save-job", "link.toml"}, directory_.path()).code, 0);
  EXPECT_TRUE(std::filesystem::is_symlink(directory_ / "link.toml"));
  EXPECT_NE(read_text(directory_ / "file.toml").find("part.stl"), std::string::npos);
}

TEST_F(WrongUse, StandardOutputThatIsFullIsAnOutputError) {
  const std::string command = "cd '" + directory_.path().string() +
                              "' && '" LAMINA_PROGRAM "' jet part.stl --dry-run --json --quiet > /dev/full 2> err; exit $?";
  EXPECT_EQ(WEXITSTATUS(std::system(command.c_str())), 4);
  EXPECT_NE(read_text(directory_ / "err").find("standard output"), std::string::npos);
}

TEST_F(WrongUse, ReaderThatHasGoneAwayIsNoReasonToCrash) {
  const std::string command = "cd '" + directory_.path().string() +
                              "' && { '" LAMINA_PROGRAM "' jet part.stl --dpi 60 --json -o out; echo $? > code; } 2>&1 | true";
  ASSERT_EQ(std::system(command.c_str()), 0);
  EXPECT_EQ(read_text(directory_ / "code"), "0\n");
  EXPECT_TRUE(std::filesystem::exists(directory_ / "out/manifest.json"));
}

TEST_F(WrongUse, ToolpathsToAClosedPipeAreNotSaidToBeKept) {
  const std::string command = "cd '" + directory_.path().string() +
                              "' && { while [ ! -e closed ]; do sleep 0.01; done; '" LAMINA_PROGRAM
                              "' extrude part.stl --machine marlin --layer 0.02 --quiet -o - 2> err; "
                              "echo $? > code; } | { exec 0<&-; : > closed; }";
  ASSERT_EQ(std::system(command.c_str()), 0);
  EXPECT_EQ(read_text(directory_ / "code"), "4\n");
  EXPECT_EQ(read_text(directory_ / "err"), "lamina: -: cannot write: Broken pipe\n");
}

TEST_F(WrongUse, DirectoriesOfOtherJobsAreLeftAlone) {
  const auto jet = [&](std::vector<std::string> more) {
    more.insert(more.begin(), {"jet", "part.stl", "-o", "out", "--layer", "0.5"});
    return more;
  };
  ASSERT_EQ(run_lamina(jet({"--dpi", "60"}), directory_.path()).code, 0);
  const std::string before = tree_text(directory_.path());
  refused(2, jet({"--dpi", "60"}), {"out/manifest.json", "--overwrite", "--resume"});
  refused(2, jet({"--dpi", "70", "--resume"}), {"out/manifest.json", "bed.dpi = [70, 70], was [60, 60]"});
  refused(2, jet({"--dpi", "60", "--shard", "1/2"}), {"out/manifest.json"});
  write_box(directory_ / "part.stl", {0, 0, 0}, {20, 9, 5});
  refused(2, jet({"--dpi", "60", "--resume"}), {"geometry of part.stl"});
  write_box(directory_ / "part.stl", {0, 0, 0}, {20, 10, 5});
  EXPECT_EQ(tree_text(directory_.path()), before);
  // Layers without a manifest are somebody's.
  std::filesystem::remove(directory_ / "out/manifest.json");
  refused(2, jet({"--dpi", "60"}), {"out/layers"});
  refused(2, jet({"--dpi", "60", "--resume"}), {"out/layers"});
  ASSERT_EQ(run_lamina(jet({"--dpi", "70", "--format", "png", "--overwrite", "--layers", "0:3"}), directory_.path()).code, 0);
  EXPECT_EQ(files_below(directory_ / "out"),
            (std::vector<std::string>{"layers/000000.png", "layers/000001.png", "layers/000002.png", "manifest.json"}));
}

TEST_F(WrongUse, NothingThatIsFinishedFallsOutOfTheManifest) {
  const auto jet = [&](std::vector<std::string> more) {
    more.insert(more.begin(), {"jet", "part.stl", "--dpi", "60", "--quiet"});
    return more;
  };
  ASSERT_EQ(run_lamina(jet({"--layer", "0.5", "-o", "out", "--layers", "2:5"}), directory_.path()).code, 0);
  refused(2, jet({"--layer", "0.5", "-o", "out", "--layers", "2:4", "--resume"}), {"out/manifest.json", "2:5"});
  refused(2, jet({"--layer", "0.5", "-o", "out", "--layers", "5:8", "--resume"}), {"out/manifest.json", "2:5"});
  ASSERT_EQ(run_lamina(jet({"--layer", "0.5", "-o", "out", "--resume"}), directory_.path()).code, 0) << "more layers";
  EXPECT_EQ(run_lamina({"verify", "out"}, directory_.path()).code, 0);
  ASSERT_EQ(run_lamina(jet({"--layer", "0.5", "-o", "whole"}), directory_.path()).code, 0);
  EXPECT_EQ(tree_text(directory_.path() / "out"), tree_text(directory_.path() / "whole"));
  // A shard of another job cannot know what to clear away.
  for (const char* shard : {"1/2", "2/2"}) {
    ASSERT_EQ(run_lamina(jet({"--layer", "0.5", "-o", "shards", "--shard", shard}), directory_.path()).code, 0);
  }
  refused(2, jet({"--layer", "1", "-o", "shards", "--shard", "1/2", "--overwrite"}),
          {"shards/manifest-1-of-2.json", "another job"});
  EXPECT_EQ(run_lamina(jet({"--layer", "0.5", "-o", "shards", "--shard", "1/2", "--overwrite"}), directory_.path()).code, 0);
  EXPECT_EQ(run_lamina({"merge", "shards", "-o", "shards"}, directory_.path()).code, 0);
  EXPECT_EQ(run_lamina({"verify", "shards"}, directory_.path()).code, 0);
}

TEST_F(WrongUse, ZipBombIsRefusedAsInputBeforeItExpands) {
  write_text(directory_ / "bomb.3mf", zip_of("_rels/.rels", std::string(150u << 20, ' ')));
  ASSERT_LT(std::filesystem::file_size(directory_ / "bomb.3mf"), 1u << 20);
  refused(3, {"jet", "bomb.3mf", "-o", "out", "--quiet"}, {"bomb.3mf", "expands"});
  refused(3, {"info", "bomb.3mf"}, {"bomb.3mf", "expands"});
}

TEST_F(WrongUse, InfoNamesItsOptionsAndFiles) {
  refused(2, {"info"}, {"part"});
  refused(2, {"info", "part.stl", "--unit", "parsec"}, {"--unit: unknown value 'parsec'"});
  refused(2, {"info", "part.stl", "--scale", "0"}, {"--scale: 0"});
  refused(2, {"info", "part.stl", "--jsno"}, {"--jsno", "'--json'"});
  refused(3, {"info", "absent.stl"}, {"absent.stl"});
}

TEST_F(WrongUse, FullDiskLeavesNothingHalfUnderAFinalName) {
  const std::string disk = directory_ / "disk";
  std::filesystem::create_directory(disk);
  if (::mount("none", disk.c_str(), "tmpfs", 0, "size=12m") != 0) {
    GTEST_SKIP() << "FULL DISK NOT TESTED: a tmpfs cannot be mounted here (" << std::strerror(errno) << "); run as root";
  }
  // What cannot fit is refused before it starts; what may fit is tried.
  const std::vector<std::string> words = words_of("jet part.stl -o disk/out --format tiff-none --bed 100x100 --dpi 300");
  std::vector<std::string> larger = words;
  larger.insert(larger.end(), {"--layer", "0.01"});
  const Outcome refused = run_lamina(larger, directory_.path());
  EXPECT_EQ(refused.code, 4) << refused.err;
  EXPECT_NE(refused.err.find("disk: the job needs about "), std::string::npos) << refused.err;
  EXPECT_FALSE(std::filesystem::exists(disk + "/out"));
  const Outcome outcome = run_lamina(words, directory_.path());
  EXPECT_EQ(outcome.code, 4) << outcome.err;
  EXPECT_NE(outcome.err.find("No space left"), std::string::npos) << outcome.err;
  EXPECT_EQ(std::ranges::count(outcome.err.substr(outcome.err.find("lamina:")), '\n'), 1) << outcome.err;
  EXPECT_FALSE(std::filesystem::exists(disk + "/out/manifest.json"));
  for (const std::string& name : files_below(disk + "/out/layers")) {
    EXPECT_GT(std::filesystem::file_size(disk + "/out/layers/" + name), 0u) << name;
    EXPECT_FALSE(name.ends_with(".part")) << name;
  }
  const Outcome full =
      run_lamina({"jet", "part.stl", "--dry-run", "--quiet", "--save-job", "disk/job.toml"}, directory_.path());
  EXPECT_TRUE(full.code == 4 || full.code == 0) << full.err;
  ::umount(disk.c_str());
}

}  // namespace
}  // namespace lamina::test
