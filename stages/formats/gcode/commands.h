// stages/formats/gcode/commands.h: carries out the commands of a G-code file one after another, as its printer would.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "stages/formats/gcode/arc.h"
#include "stages/formats/gcode/comments.h"
#include "stages/formats/gcode/read_gcode.h"
#include "stages/support/io/file_reader.h"

namespace lamina::read {

/// A straight move, or a chord of an arc, that lays filament; mm.
struct RawBead {
  double from[3], to[3];
  double fed;             // mm of filament, or mm3
  bool volumetric;        // fed is mm3
  double speed;           // mm/s
  bool joined;            // BeadFeed
  double primed;          // before it: mm of filament, or mm3
  bool first;             // of its line
  double length() const;  // over the bed
};

/// Arcs of a file that firmwares do not agree on: how many, and the line of the first.
struct OddArcs {
  std::uint64_t count = 0, line = 0;
  void add(std::uint64_t at) { line = count++ == 0 ? at : line; }
};

class GcodeCommands {
 public:
  using Place = GcodeFile::Place;

  GcodeCommands(FileReader& file, std::vector<std::string>& types) : path_(file.path()), types_(types), file_(file) {}

  void go_to(const Place& place) {
    place_ = place;
    file_.go_to(place.byte, place.line);
    chord_ = 0;
  }
  const Place& place() const { return place_; }    // behind the line that next() returned for
  const Place& before() const { return before_; }  // in front of it
  std::optional<std::string> fault;
  bool layer_tag = false;  // the line begins a layer
  SlicerFacts facts;       // of the lines so far
  OddArcs left_out, off_circle, short_radius;

  /// The next bead, or the tag of a layer; false at the end, or if there is a fault.
  bool next(std::optional<RawBead>& bead);

 private:
  struct Words {
    double value[26] = {};
    std::uint32_t given = 0;  // a bit a letter
    bool has(char letter) const { return given >> (letter - 'A') & 1; }
    double operator[](char letter) const { return has(letter) ? value[letter - 'A'] : 0; }
  };
  bool read_line();
  void fail(std::string_view what);
  bool read_tag();
  double tag_length(std::string_view text);
  void name_type(std::string_view name);
  bool read_number(std::string_view& left, double& value);
  bool read_words(std::string_view left, Words& words);
  bool run_command(std::optional<RawBead>& bead);
  bool set_mode(char letter, double code, std::string_view left);
  void set_relative(bool relative);
  bool feeds_relative() const;
  bool move(double code, const Words& words, std::optional<RawBead>& bead);
  bool begin_arc(bool clockwise, const Words& words, const double (&to)[4], double fed);
  bool next_chord(std::optional<RawBead>& bead);
  bool within_reach(const RawBead& bead);

  const std::string& path_;
  std::vector<std::string>& types_;
  FileReader& file_;
  std::string_view text_;
  Place place_, before_;
  Arc arc_;                  // under way
  std::uint64_t chord_ = 0;  // the last one that was given; 0 if no arc is under way
  RawBead whole_{};          // the arc from its start to its end
};

}  // namespace lamina::read
