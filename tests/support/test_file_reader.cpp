#include "stages/support/io/file_reader.h"

#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include "stages/support/hash/hash.h"
#include "stages/support/text/json_text.h"
#include "stages/support/text/toml.h"
#include "tests/commands/program.h"

namespace lamina {
namespace {

struct Lines {
  std::vector<std::string> lines;
  std::string error;
  bool whole = true;  // the last one had an end
};

Lines lines_of(FileReader reader) {
  Lines read;
  std::uint64_t bytes = 0;
  for (std::string_view line; reader.next(line);) {
    read.lines.emplace_back(line);
    read.whole = reader.ended_by_break();
    bytes += line.size() + (read.whole ? 1 : 0);
    EXPECT_EQ(reader.offset(), bytes);
    EXPECT_EQ(reader.line_number(), read.lines.size());
  }
  if (!reader.status()) read.error = reader.status().error().message;
  return read;
}

class FileReaders : public ::testing::Test {
 protected:
  /// The lines of a file, whose whole text has to be read, too.
  Lines read(const std::string& text, const ReadRules& rules = {}) {
    const std::string path = directory_ / "file";
    test::write_text(path, text);
    auto opened = FileReader::open(path, rules);
    if (!opened) return {{}, opened.error().message};
    const auto all = read_file(path, rules);
    EXPECT_TRUE(all && *all == text);
    return lines_of(std::move(*opened));
  }
  test::Directory directory_;
};

TEST_F(FileReaders, LinesAreThoseOfTheTextWhereverPiecesEnd) {
  EXPECT_EQ(read("").lines, std::vector<std::string>());
  EXPECT_EQ(read("\n\na").lines, (std::vector<std::string>{"", "", "a"}));
  EXPECT_FALSE(read("a\nb").whole);
  EXPECT_TRUE(read("a\nb\n").whole);
  for (const std::size_t length : {65'534, 65'535, 65'536, 65'537, 200'000}) {
    const std::string line(length, 'x');
    const Lines three = read("y\n" + line + "\nz", {.longest_line = 200'000});
    ASSERT_EQ(three.lines.size(), 3u) << length << three.error;
    EXPECT_TRUE(three.lines[1] == line && three.lines[2] == "z");
  }
}

TEST_F(FileReaders, LinesEndWithCrToo) {
  const auto lines = [&](const std::string& text) {
    test::write_text(directory_ / "file", text);
    auto reader = FileReader::open(directory_ / "file", {.longest_line = 200'000, .cr_ends = true});
    std::vector<std::string> read;
    std::string ends;
    for (std::string_view line; reader->next(line);) {
      read.emplace_back(line);
      ends += reader->ended_by_cr() ? 'c' : reader->ended_by_break() ? 'l' : '-';
      auto other = FileReader::open(directory_ / "file", {.longest_line = 200'000, .cr_ends = true});
      std::string_view next;
      other->go_to(reader->offset(), reader->line_number());
      EXPECT_TRUE(!other->next(next) || next == text.substr(reader->offset(), next.size()));
    }
    EXPECT_EQ(reader->offset(), text.size());
    return read.push_back(ends), read;
  };
  using All = std::vector<std::string>;
  EXPECT_EQ(lines("a\rb\r\nc\nd"), (All{"a", "b", "c", "d", "cll-"}));
  EXPECT_EQ(lines("\r\r\n\n\r"), (All{"", "", "", "", "cllc"}));
  EXPECT_EQ(lines("a\n\rb\r"), (All{"a", "", "b", "lcc"}));
  for (const std::size_t length : {254, 255, 256, 257, 65'534, 65'535, 65'536, 131'071, 131'072}) {
    const std::string line(length, 'x');
    EXPECT_EQ(lines(line + "\r\ny\r" + line), (All{line, "y", line, "lc-"})) << length;
    EXPECT_EQ(lines(line + "\r" + line + "\n"), (All{line, line, "cl"})) << length;
  }
}

TEST_F(FileReaders, BoundsAreReportedWithTheLine) {
  EXPECT_EQ(read("a\n" + std::string(64, 'x'), {.longest_line = 64}).error, "");
  const Lines line = read("a\n" + std::string(65, 'x'), {.no_text = "is no list", .longest_line = 64});
  EXPECT_EQ(line.lines.size(), 1u);
  EXPECT_TRUE(line.error.ends_with("file:2: a line of more than 64 bytes; is no list")) << line.error;
  EXPECT_TRUE(read({"a\nb\0c\n", 6}).error.ends_with("file:2: is no text file"));
  EXPECT_EQ(read({"a\nb\0c\n", 6}, {.any_bytes = true}).lines.size(), 2u);
  test::write_text(directory_ / "large", std::string(2048, 'x'));
  const auto large = FileReader::open(directory_ / "large", {.fault = Fault::kInput, .max_bytes = 1024});
  ASSERT_FALSE(large);
  EXPECT_EQ(large.error().fault, Fault::kInput);
  EXPECT_TRUE(large.error().message.ends_with("large: holds more than 1 KiB, the most for such a file"));
}

TEST_F(FileReaders, OnlyRegularFilesAreOpenedAndPipesByRequest) {
  ASSERT_EQ(::mkfifo((directory_ / "pipe").c_str(), 0600), 0);
  for (const bool streams : {false, true}) {
    for (const std::string& path :
         {directory_ / "pipe", directory_.path().string(), std::string("/dev/zero"), directory_ / "no"}) {
      const auto opened = FileReader::open(path, {.fault = Fault::kUsage, .missing = "is not there", .streams = streams});
      ASSERT_FALSE(opened) << path;
      EXPECT_TRUE(opened.error().message.starts_with(path + ": is ")) << opened.error().message;
    }
  }
  int ends[2];
  ASSERT_EQ(::pipe(ends), 0);
  ASSERT_EQ(::write(ends[1], "a\nb\n", 4), 4);
  ::close(ends[1]);
  const std::string name = "/dev/fd/" + std::to_string(ends[0]);
  EXPECT_FALSE(FileReader::open(name, {}));
  auto stream = FileReader::open(name, {.streams = true});
  ASSERT_TRUE(stream.ok());
  EXPECT_EQ(lines_of(std::move(*stream)).lines, (std::vector<std::string>{"a", "b"}));
  ::close(ends[0]);
}

TEST_F(FileReaders, AStreamEndsAtItsBound) {
  int ends[2];
  ASSERT_EQ(::pipe(ends), 0);
  ASSERT_EQ(::write(ends[1], "a\nb\n", 4), 4);
  ::close(ends[1]);
  auto stream = FileReader::open("/dev/fd/" + std::to_string(ends[0]), {.max_bytes = 3, .streams = true});
  ASSERT_TRUE(stream.ok());
  EXPECT_FALSE(stream->text());
  EXPECT_FALSE(stream->status());
  ::close(ends[0]);
}

TEST_F(FileReaders, PositionsAndIntervals) {
  test::write_text(directory_ / "file", "one\ntwo\nthree\n");
  auto file = FileReader::open(directory_ / "file", {});
  ASSERT_TRUE(file.ok());
  std::string_view line;
  file->go_to(8, 2);
  ASSERT_TRUE(file->next(line));
  EXPECT_EQ(line, "three");
  EXPECT_EQ(file->line_number(), 3u);
  EXPECT_EQ(digest_range(*file, 4, 3), hash_text("two"));
  EXPECT_EQ(digest_range(*file, 4, 100), std::nullopt);
  EXPECT_EQ(digest_range(*file, UINT64_MAX, 2), std::nullopt);
  EXPECT_EQ(digest_file(directory_ / "file", 14)->hash, hash_text("one\ntwo\nthree\n"));
  EXPECT_EQ(digest_file(directory_ / "file", 15)->bytes, 14u);
  EXPECT_EQ(digest_file(directory_ / "file", 15)->hash, Hash128());
}

std::string repeated(std::string_view piece, int times) {
  std::string text;
  for (int i = 0; i < times; ++i) text += piece;
  return text;
}

TEST(TextShape, TomlBeyondBoundsIsRefusedBeforeItIsParsed) {
  const struct {
    std::string text, words;
  } rows[] = {
      {"a" + repeated(".a", 100'000) + " = 1", "f:1:32: a key of more than 16 parts"},
      {"[a" + repeated(".a", 100'000) + "]", "a key of more than 16 parts"},
      {"[[a" + repeated(" . \"a\"", 100'000) + "]]", "a key of more than 16 parts"},
      {"x = { a" + repeated(".'a'", 100'000) + " = 1 }", "a key of more than 16 parts"},
      {"x = \"\"\"\n\\\"\"\"\"\"\na" + repeated(".a", 100'000) + " = 1", "f:3:32: a key of more than 16 parts"},
      {"x = '''\n''''\na" + repeated(".a", 100'000) + " = 1", "f:3:32: a key of more than 16 parts"},
      {"x = " + repeated("[", 100'000), "more than 16 levels"},
      {"x = " + repeated("{ a = ", 100'000), "more than 16 levels"},
      {"x = " + repeated("[ { a = ", 100'000), "more than 16 levels"},
      {"x = [" + repeated("1,", 1'000'001) + "]", "more than 1000000 values"},
  };
  for (const auto& row : rows) {
    const auto read = read_toml(row.text, "f");
    ASSERT_FALSE(read) << row.text.substr(0, 60);
    EXPECT_NE(read.error().message.find(row.words), std::string::npos) << row.text.substr(0, 60) << "\n"
                                                                       << read.error().message;
    EXPECT_EQ(read.error().message.find('\n'), std::string::npos);
  }
}

TEST(TextShape, StringsCommentsAndSoundFilesPass) {
  const std::string dots = repeated("a.", 1000), brackets = repeated("[{", 1000);
  for (const std::string& text : {"x = \"" + dots + brackets + "\"", "x = '" + dots + brackets + "'",
                                  "x = \"\"\"" + dots + "\n\\\"" + brackets + "\"\"\"", "# " + dots + brackets + "\nx = 1",
                                  "x = '''" + dots + "''" + brackets + "'''''", "x = [" + repeated("0.5, ", 1000) + "]",
                                  repeated("[[part]]\na.b.c = 1.5\n", 1000)}) {
    const auto read = read_toml(text, "f");
    EXPECT_TRUE(read.ok()) << text.substr(0, 60) << "\n" << (read ? "" : read.error().message);
  }
  EXPECT_TRUE(json_nests_within("{\"a\": \"[[[[\\\"[[[\", \"b\": [[1]]}", 3));
  EXPECT_FALSE(json_nests_within("{\"a\": [[1]]}", 2));
}

}  // namespace
}  // namespace lamina
