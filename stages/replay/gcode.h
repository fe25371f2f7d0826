// stages/replay/gcode.h: lines of G-code, and the axes of a powder printer.
#pragma once

#include <charconv>
#include <map>
#include <optional>
#include <string>
#include <string_view>

#include "stages/replay/printing.h"

namespace lamina::replay {

/// One line: a command such as G1 or M812, and its words.
struct GcodeLine {
  std::string_view command;
  std::map<char, double> word;
  std::string_view rest;  // text after the command

  bool has(char letter) const { return word.contains(letter); }
};

/// Adds words such as X1.5, which blanks part. returns  nothing, or what is no word
std::optional<std::string_view> add_words(std::string_view text, std::map<char, double>& words);

/// Iterates over the lines of a program without comments and empty lines. A fault names its line and ends the iteration.
class GcodeReader {
 public:
  GcodeReader(std::string_view text, Printing& printing) : left_(text), printing_(printing) {}

  bool next(GcodeLine& line);
  /// A required word of the line; 0 at a fault.
  double number(const GcodeLine& line, char letter);
  std::uint32_t count(const GcodeLine& line, char letter);
  void fault(std::string_view what);

 private:
  std::string_view left_, now_;
  Printing& printing_;
  std::size_t number_ = 0;
};

/// The axes that move the head along and across the scan.
struct ScanAxes {
  std::string along, across;
  explicit ScanAxes(const Machine& machine) {
    const bool x = machine.mounting.scan_axis == ScanAxis::kX;
    along = x ? machine.motion.x_axis : machine.motion.y_axis;
    across = x ? machine.motion.y_axis : machine.motion.x_axis;
  }
};

/// The axes and their functions: the head over the bed, the build vat, the feed vats, the roller.
class Axes {
 public:
  /// They stand as the layer before left them.
  Axes(Printing& printing, GcodeReader& reader);

  /// Executes G0, G1, G90, G91; false for any other command. Vats feed by G91 alone. A fault may leave the axes unmoved.
  /// A roller on the gantry is where the head is; there it spreads on its way to the far end.
  bool take(const GcodeLine& line, bool scanning);
  /// The layer ends: faults what the next one does not expect.
  void end();
  double speed_mm_s() const { return feed_mm_s_; }  // the last F
  double at(const std::string& axis) { return at_[axis[0]]; }
  /// Its last way, from before to where it stands; 0: none.
  double last_way(const std::string& axis) { return way_[axis[0]]; }

 private:
  bool paths_are_clear(const GcodeLine& line);
  Printing& printing_;
  GcodeReader& reader_;
  std::map<char, double> at_, way_;
  bool relative_ = false, roller_on_gantry_ = false;
  double feed_mm_s_ = 0;
};

}  // namespace lamina::replay
