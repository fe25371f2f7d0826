// tests/formats/test_gcode_dialects.cpp: the same commands as the parsers of Marlin, Klipper and RepRapFirmware accept them.
#include <gtest/gtest.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <functional>
#include <random>

#include "tests/formats/gcode_text.h"

namespace lamina {
namespace {

using test::Directory;
using test::gcode_file;
using Commands = std::vector<std::vector<std::string>>;  // a line each; of a comment one word

/// Layers with widths of tags and of E, with retractions on the spot and in moves, an arc, both modes of E, M221 and a tool.
Commands random_commands(unsigned seed) {
  std::mt19937 random(seed);
  const auto number = [&](double low, double high, int digits) {
    return fmt::format("{:.{}f}", std::uniform_real_distribution<double>(low, high)(random), digits);
  };
  Commands lines = {{"G21"}, {"G90"}, {"M83"}, {"G28", "X0"}, {"G92", "E0"}, {"M106", "S255"}, {"M221", "S95"}};
  for (int layer = 1; layer <= 4; ++layer) {
    lines.push_back({";LAYER_CHANGE"});
    lines.push_back({";HEIGHT:0.2"});
    if (layer == 2) lines.push_back({";WIDTH:0.45"});
    if (layer == 3) lines.push_back({";WIDTH:0"});
    if (layer == 4) lines.insert(lines.end(), {{"M221", "T1", "S80"}, {"T1"}});
    lines.push_back({"G1", fmt::format("Z{:.1f}", 0.2 * layer), "F7200"});
    for (int i = 0; i < 12; ++i) {
      lines.push_back({"G0", "X" + number(1, 200, 3), "Y" + number(1, 200, 3)});
      lines.push_back({"G1", "X" + number(1, 200, 3), "Y-" + number(1, 20, 2), "E" + number(0.1, 9, 5)});
      lines.push_back({"G1", "X" + number(1, 200, 0), "Y" + number(1, 200, 0), "E" + number(1, 9, 0)});
      if (i % 3 == 0) lines.insert(lines.end(), {{"G1", "X5", "E-2"}, {"G1", "X60", "Y60"}, {"G1", "X70", "Y60", "E2.5"}});
      if (i % 4 == 0) lines.insert(lines.end(), {{"G1", "E-1.5", "F2400"}, {"G1", "E1.5"}, {"G2", "X80", "Y60", "I5", "E1"}});
    }
  }
  return lines;
}

using Writer = std::function<std::string(const std::vector<std::string>&)>;

std::string text_of(const Commands& lines, const Writer& line_of, const std::string& end = "\n") {
  std::string text;
  for (const std::vector<std::string>& line : lines) text += (line[0][0] == ';' ? line[0] : line_of(line)) + end;
  return text;
}

/// `between` separates the words, `behind` each letter from its number.
std::string joined(const std::vector<std::string>& words, const std::string& between, const std::string& behind = "") {
  std::string text;
  for (const std::string& word : words) text += (text.empty() ? "" : between) + word.substr(0, 1) + behind + word.substr(1);
  return text;
}

std::string lower(std::string text) {
  std::ranges::transform(text, text.begin(), [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return text;
}

std::string numbered(const std::vector<std::string>& words) {
  static int line = 0;
  const std::string text = fmt::format("N{} {}", ++line, joined(words, " "));
  int sum = 0;
  for (const char c : text) sum ^= c;
  return fmt::format("{}*{}", text, sum);
}

/// G01, +5, .5 and 5. for the same numbers.
std::string other_numbers(const std::vector<std::string>& words) {
  std::string text;
  for (std::string word : words) {
    if (word[0] == 'G' && word.size() == 2) word.insert(1, "0");
    if (word.substr(1, 2) == "0.") word.erase(1, 1);
    if (std::string("XYZE").find(word[0]) != std::string::npos && word[1] != '-') word.insert(1, "+");
    if (word[0] != 'G' && word[0] != 'M' && word[0] != 'T' && word.find('.') == std::string::npos) word += ".";
    text += word + " ";
  }
  return text;
}

/// Files that have to be read as the first one.
std::vector<std::string> dialects(const Commands& commands) {
  const Writer usual = [](const auto& words) { return joined(words, " "); };
  const std::string picture = ";" + std::string(70'000, 'A') + "\n", remark(5'000, 'r');
  std::mt19937 random(3);
  std::vector<std::string> files = {
      text_of(commands, usual),
      text_of(commands, usual, "\r\n"),
      text_of(commands, usual, "\r"),
      text_of(commands, [](const auto& words) { return lower(joined(words, " ")); }),
      text_of(commands, [](const auto& words) { return joined(words, ""); }),
      text_of(commands, [](const auto& words) { return joined(words, " ", " "); }),
      text_of(commands, [](const auto& words) { return "  \t" + joined(words, " \t ", "\t") + " "; }),
      text_of(commands, numbered),
      text_of(commands, [](const auto& words) { return joined(words, " ") + " ; G1 X5 E7 (not) *3"; }),
      text_of(commands, [](const auto& words) { return "(first)" + joined(words, " (E5; X7*1) ") + "(last"; }),
      text_of(commands, other_numbers),
      picture + text_of(commands, [&](const auto& words) { return joined(words, " ") + ";" + remark; }) + picture,
      text_of(commands,
              [](const auto& words) {  // repeats the last move
                return words[0] == "G1" && words.back()[0] != 'F' && words[1][0] != 'E' && words.size() > 3
                           ? "G1\n" + joined({words.begin() + 1, words.end()}, " ")
                           : joined(words, " ");
              }),
      text_of(commands, [](const auto& words) { return words[0] == "G1" ? "G90 " + joined(words, " ") : joined(words, " "); }),
  };
  Commands shuffled = commands;
  for (std::vector<std::string>& words : shuffled) std::shuffle(words.begin() + 1, words.end(), random);
  files.push_back(text_of(shuffled, usual));
  files.push_back(text_of(
      shuffled, [](const auto& words) { return "n7" + lower(joined(words, "()")) + "*9"; }, "\r"));
  return files;
}

TEST(GcodeDialects, AnyOfThemGivesTheSameVolumeLayersAndBeads) {
  for (const unsigned seed : {1u, 2u, 3u}) {
    const std::vector<std::string> files = dialects(random_commands(seed));
    const Directory directory, other;
    const auto first = gcode_file(directory, files[0]);
    ASSERT_TRUE(first) << first.error().message;
    EXPECT_EQ(first->count(), 4u);
    for (std::size_t k = 1; k < files.size(); ++k) {
      SCOPED_TRACE(fmt::format("seed {}, file {}: {}", seed, k, files[k].substr(0, 200)));
      const auto file = gcode_file(other, files[k]);
      ASSERT_TRUE(file) << file.error().message;
      EXPECT_EQ(file->fed_mm3(), first->fed_mm3());
      ASSERT_EQ(file->count(), first->count());
      for (std::uint32_t n = 0; n < first->count(); ++n) {
        const auto right = first->layer(n, true), layer = file->layer(n, true);
        ASSERT_TRUE(right && layer);
        EXPECT_EQ(layer->z, right->z);
        ASSERT_EQ(layer->beads.size(), right->beads.size());
        for (std::size_t i = 0; i < right->beads.size(); ++i) {
          const formats::GcodeBead &bead = layer->beads[i], &other_bead = right->beads[i];
          ASSERT_TRUE(bead.from == other_bead.from && bead.to == other_bead.to && bead.width == other_bead.width) << i;
          ASSERT_EQ(layer->feeds[i].volume_mm3, right->feeds[i].volume_mm3) << i;
          ASSERT_EQ(layer->feeds[i].primed_mm3, right->feeds[i].primed_mm3) << i;
          ASSERT_EQ(layer->feeds[i].speed_mm_s, right->feeds[i].speed_mm_s) << i;
        }
      }
    }
  }
}

TEST(GcodeDialects, NotesNameTheFirstLineOnWhichFirmwaresDiffer) {
  const std::vector<std::pair<std::string, std::string>> files = {
      {"g1 X10 E1\n", "line 2: lower-case letters"},
      {"G1 X 10 E1\n", "line 2: a blank in front of a number"},
      {"G1 X5 E1\nG1 X10 (side) E1\nG1 Y1 (side)\n", "line 3 and 1 more: comments in parentheses"},
      {"G1X10E1\n", "line 2: E directly behind a digit"},
      {"G1 X10 E1 X20 E2\n", "line 2: a letter twice"},
      {"G1 X10 E1\rG1 X20 E1\n", "line 2: CR alone"},
      {"G1 X10 E1\nX20 E1\n", "line 3: words without a command"},
      {"G90 G1 X10 E1\n", "line 2: several commands in a line"},
      {"M221\nG1 X10 E1\n", "line 2: M221 without S"},
      {"M106 S255 G1 X10 E1\n", "line 2: several commands in a line"},
      {"T0 G1 X10 E1\n", "line 2: several commands in a line"},
      {"G1 X10 E1\nX5 is the left side\n", "line 3: begins as a move without a command and is text"},
      {"G1 X10 E1\nE1 to E3 of X,Y\nZ1?\n", "line 3 and 1 more: begins as a move"},
      {"M221 S95 T1\nG1 X10 E1\n", "line 2: M221 is of one tool"},
      {"M221 S95\nT1\nG1 X10 E1\n", "line 3: M221 is of one tool"},
      {"M221 S95\nG1 X10 E1\n", "line 2: M221 S95 is applied: volumes are that percentage of E"},
  };
  const Directory directory;
  for (const auto& [text, expected] : files) {
    const auto file = gcode_file(directory, "M83\n;HEIGHT:0.2\n" + text);
    ASSERT_TRUE(file) << text << file.error().message;
    const auto found = std::ranges::find_if(file->notes(), [&, &note = expected](const std::string& line) {
      return line.starts_with(note.substr(0, 5)) && line.find(note.substr(note.find(':'))) != std::string::npos;
    });
    EXPECT_NE(found, file->notes().end()) << text;
  }
  const auto usual = gcode_file(directory, "N1 G01 X10.5 Y+1 ; (side)\n\tM117 e1 (x)\nMACRO_G1 x=5 x=6\nM83\r\nG1 X5 E.5*5\n");
  ASSERT_TRUE(usual) << usual.error().message;
  EXPECT_EQ(usual->notes(), std::vector<std::string>());
}

TEST(GcodeDialects, FilesThatNameTheirFirmwareHaveNoNoteOnToolsOfM221) {
  const Directory directory;
  for (const std::string firmware : {"Marlin", "RepRap", "Klipper"}) {
    const auto file = gcode_file(directory, ";FLAVOR:" + firmware + "\nM83\n;HEIGHT:0.2\nM221 S50 T1\nG1 X10 E1\n");
    ASSERT_TRUE(file) << file.error().message;
    for (const std::string& note : file->notes()) EXPECT_EQ(note.find("one tool"), std::string::npos) << note;
    const double share = firmware == "Klipper" ? 0.5 : 1;
    EXPECT_NEAR(file->fed_mm3(), share * test::kPi / 4 * 1.75 * 1.75, 1e-9) << firmware;
  }
}

// RepRapFirmware runs every G and M of a line; what stands behind other commands is not lost, and layers begin at any of them.
TEST(GcodeDialects, CommandsOfALineAreThoseOfLinesOfTheirOwn) {
  const std::string apart =
      "M83\nG1 Z0.2\nM106 S255\nG1 X10 E1\nT1\nG1 X0 E1\nM83\nG1 Z0.4\nG1 X5 Y1 E1\nG1 X9 E2\nG1 Z0.6\nG1 X10 E1\nM104 S9\nG1 Y3 E1\n";
  const std::string joined =
      "M83\nG1 Z0.2 M106 S255 G1 X10 E1\nT1 G1 X0 E1 M83 G1 Z0.4 G1 X5 Y1 E1\nG1 X9 E2 (side) G1 Z0.6 G1 X10 E1 M104 S9 G1 Y3 E1 ; end\n";
  const Directory one, other;
  const auto right = gcode_file(one, apart), file = gcode_file(other, joined);
  ASSERT_TRUE(right && file);
  ASSERT_EQ(right->count(), 3u);
  ASSERT_EQ(file->count(), 3u);
  EXPECT_EQ(file->fed_mm3(), right->fed_mm3());
  for (std::uint32_t n = 0; n < 3; ++n) {
    const auto expected = right->layer(n), layer = file->layer(n);
    ASSERT_TRUE(expected && layer) << n;
    EXPECT_EQ(layer->z, expected->z);
    ASSERT_EQ(layer->beads.size(), expected->beads.size()) << n;
    for (std::size_t i = 0; i < layer->beads.size(); ++i) {
      EXPECT_EQ(layer->beads[i].from, expected->beads[i].from) << n << ' ' << i;
      EXPECT_EQ(layer->beads[i].to, expected->beads[i].to) << n << ' ' << i;
      EXPECT_EQ(layer->beads[i].width, expected->beads[i].width) << n << ' ' << i;
    }
  }
}

TEST(GcodeDialects, TextOfCommandsIsNoCommand) {
  const Directory directory;
  const auto file = gcode_file(directory,
                               "M83\n;HEIGHT:0.2\nM117 G1 X9 E9\nM118 S G1 X9 E9\nM23 G1.gco\nM486 AG1 X9 E9\nM98 P\"G1 X9 E9\"\nG1 X5 E1\n");
  ASSERT_TRUE(file) << file.error().message;
  EXPECT_NEAR(file->fed_mm3(), test::kPi / 4 * 1.75 * 1.75, 1e-9);
  EXPECT_EQ(file->notes(), std::vector<std::string>());
}

TEST(GcodeDialects, ExponentsAreWordsAndTextIsNoCommand) {
  const Directory directory;
  const auto file = gcode_file(directory,
                               "M83\nG1 Z.2\nG1X30Y11E1\nEXCLUDE_OBJECT_START NAME=X1\nTIMELAPSE\nM117 G1 X9 E9\n"
                               "M83 relative\nG28 home\nY12E1\n");
  ASSERT_TRUE(file) << file.error().message;
  const auto layer = file->layer(0);
  ASSERT_EQ(layer->beads.size(), 2u);
  EXPECT_EQ(layer->beads[0].to, (Point2{30'000'000, 11'000'000}));
  EXPECT_EQ(layer->beads[1].to, (Point2{30'000'000, 12'000'000}));
  EXPECT_NEAR(file->fed_mm3(), 2 * test::kPi / 4 * 1.75 * 1.75, 1e-9);
}

TEST(GcodeDialects, WordsThatAreNoNumbersAreRefusedWithTheLine) {
  const Directory directory;
  const std::vector<std::string> words = {"Xnan", "X-", "X+-5", "X.", "X--1", "Einf", "X" + std::string(400, '9')};
  for (const std::string& word : words) {
    const auto file = gcode_file(directory, "M83\nG1 X1 E1\nG1 " + word + " E1\n");
    ASSERT_FALSE(file) << word;
    EXPECT_NE(file.error().message.find("line 3: '" + word.substr(1, 20) + "' is not a number"), std::string::npos)
        << file.error().message;
  }
  for (const std::string word : {"{move.x}", "#5", "X1,5", "\xc2\xb5"})
    EXPECT_FALSE(gcode_file(directory, "M83\nG1 X1 E1\nG1 " + word + " E1\n")) << word;
}

}  // namespace
}  // namespace lamina
