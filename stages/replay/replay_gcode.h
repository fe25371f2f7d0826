// stages/replay/replay_gcode.h: lines of G-code, and the axes of a powder printer that they move.
#pragma once

#include <charconv>
#include <map>
#include <string>
#include <string_view>

#include "stages/replay/replay_printing.h"

namespace lamina::pipeline {

/// One line: a command such as G1 or M812, and its words.
struct GcodeLine {
  std::string_view command;
  std::map<char, double> word;
  std::string_view rest;  // all behind the command

  bool has(char letter) const { return word.contains(letter); }
};

/// The lines of a program one after another, without comments and empty ones; faults name them.
class GcodeReader {
 public:
  GcodeReader(std::string_view text, Printing& printing) : left_(text), printing_(printing) {}

  bool next(GcodeLine& line) { return take(line, true); }
  /// The same, but words of M117, which is a text, are not read.
  bool next_comment(GcodeLine& line) { return take(line, false); }
  double number(const GcodeLine& line, char letter) const;
  std::uint32_t count(const GcodeLine& line, char letter) const;
  [[noreturn]] void fault(const std::string& what) const;

 private:
  bool take(GcodeLine& line, bool all_words);
  std::string_view left_, now_;
  Printing& printing_;
  std::size_t number_ = 0;
};

/// The axes and what their moves mean: the head over the bed, the build vat, the feed vats, the roller.
class Axes {
 public:
  Axes(Printing& printing, GcodeReader& reader) : printing_(printing), reader_(reader) {}

  /// Carries out G0, G1, G90, G91; false for any other command.
  /// The head's positions are in `at`; the build vat has to reach the depth of the layer before the head moves.
  bool take(const GcodeLine& line, bool scanning);
  double at(const std::string& axis) { return at_[axis[0]]; }

 private:
  Printing& printing_;
  GcodeReader& reader_;
  std::map<char, double> at_;
  bool relative_ = false;
  double feed_mm_s_ = 0;
};

}  // namespace lamina::pipeline
