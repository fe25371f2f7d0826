// stages/formats/gcode/commands.h: carries out the commands of a G-code file one after another, as its printer would.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "stages/formats/gcode/read_gcode.h"
#include "stages/formats/gcode/words.h"
#include "stages/support/io/file_reader.h"

namespace lamina::formats {

/// Facts of a whole file, gathered line by line; a later comment of the same kind does not replace an earlier one.
///
///     ; filament_diameter = 1.75,1.75      Slic3r, PrusaSlicer, Orca; with a colon BambuStudio
///     ;   filamentDiameters,1.75|1.75      Simplify3D
///     ; fiber_dia_mm = 1.75                KISSlicer
///     ;Filament Diameter #1: 1.75          ideaMaker
///     ;CURA_PROFILE_STRING:eNrt...         Cura up to 15.04: settings, deflated, base64
///     ;SETTING_3 {"...                     Cura since then: what of its profile was changed
///     ;Filament used: 1.3m 9.1g            Cura up to 15.04: its weight per metre decides 1.75 mm or 2.85 mm
///     ;FLAVOR:Griffin                      CuraEngine: printers for 2.85 mm
///     ;FLAVOR:UltiGCode                    CuraEngine: E counts mm3; so does "; use_volumetric_e = 1" of PrusaSlicer
///     ; machine: Anet A8                   lamina
///     ; filament_density = 1.24,1.24       PrusaSlicer, Orca; with a colon BambuStudio
///     ; filament used [cm3] = 1.23         lamina, PrusaSlicer: density by what [g] of it weigh
struct SlicerFacts {
  double filament_mm = 0;    // diameter; 0 if not stated
  double nozzle_mm = 0;      // 0 if not stated
  double density_g_cm3 = 0;  // 0 if not stated
  bool volumetric = false;
  std::string machine;  // a name, at most 100 characters; empty if not stated

  /// Takes a line that begins with a semicolon.
  void read(std::string_view comment);

 private:
  /// How sure a way to know the diameter is.
  enum class DiameterSource : std::uint8_t { kNone, kFlavor, kWeight, kProfile, kSetting };
  DiameterSource source_ = DiameterSource::kNone;
  double used_cm3_ = 0;
  bool density_set_ = false;
  void state_density(double g_cm3);
  void state_filament(double diameter_mm, DiameterSource source);
  void read_flavor(std::string_view flavor);
  void read_weight(std::string_view used);
  void read_setting(std::string_view comment);
};

/// The value of a setting in a CURA_PROFILE_STRING; 0 if it is not there.
/// cost  64 KiB at most are inflated
double cura_profile_number(std::string_view base64, std::string_view setting);

/// The words of a G2 or G3, in mm. I and J lead from the start to the centre, regardless of G90 and G91; R excludes them.
struct ArcWords {
  bool clockwise = false;  // G2
  double i = 0, j = 0;
  std::optional<double> radius;  // R; negative: the longer way round
};

/// A circular way between two points as firmwares run it: plan_arc() and G2_G3() of Marlin (MarlinFirmware/Marlin @000f5c7,
/// Marlin/src/gcode/motion/G2_G3.cpp), from which Klipper's planArc() (Klipper3d/klipper @84104bb,
/// klippy/extras/gcode_arcs.py) is taken. Both run chords of about 1 mm; these deviate by kTolerance at most.
///
/// - The end at the start: a full circle.
/// - An end off the circle: the radius of the start holds, and the last chord leads to the end.
/// - |R| shorter than half of the way: half a circle around the middle.
///
/// units  mm
class Arc {
 public:
  static constexpr double kTolerance = 0.005;
  struct ArcPoint {
    double x = 0, y = 0;
  };

  /// False where Marlin prints an error and stays where it is (Klipper and RepRapFirmware end the print): neither R nor I and
  /// J; R with an end at the start; or, without a word of Marlin, an end in the direction of the start, counter-clockwise.
  /// Also of radii beyond all numbers of a firmware.
  bool plan(ArcPoint from, ArcPoint to, const ArcWords& words);
  /// At least 1. The chords within a bed of some metres are a few thousand, for any radius.
  std::uint64_t chords() const { return chords_; }
  /// The end of a chord, 1 .. chords(); that of the last one is the arc's.
  ArcPoint end_of(std::uint64_t chord) const;
  double miss() const { return miss_; }                // of the end, off the circle
  bool radius_short() const { return short_radius_; }  // R is more than 1 % too short, which RepRapFirmware refuses

 private:
  ArcPoint from_, to_, spoke_;  // spoke: from the centre to the start
  double travel_ = 0;           // radians, counter-clockwise
  double miss_ = 0;
  bool short_radius_ = false;
  std::uint64_t chords_ = 1;
};

/// Opens a file to read commands from. errors  kUsage: cannot be read, or is binary G-code or an archive
Result<FileReader> open_gcode(const std::string& path);

/// A straight move, or a chord of an arc, that extrudes filament; mm.
struct RawBead {
  double from[3], to[3];
  double fed;               // mm of filament, or mm3: what leaves the nozzle
  bool volumetric;          // fed is mm3
  double speed;             // mm/s
  bool joined;              // BeadFeed
  double primed;            // before it: mm of filament, or mm3
  bool first;               // of its command
  double acceleration = 0;  // mm/s2, commanded; 0: not stated
  double length() const;    // over the bed
};

/// Lines of a file that firmwares do not agree on: how many, and the first.
struct OddLines {
  std::uint64_t count = 0, line = 0;
  void add(std::uint64_t at) { line = count++ == 0 ? at : line; }
};

/// A move as it is commanded, or a chord of an arc that deposits; mm, and mm of filament or mm3 (GcodeFile::FilePosition).
struct GcodeMove {
  const double* from;  // x, y, z
  const double* to;
  double fed;  // with M221; below 0: drawn back
  bool states_feed_rate;
};

/// Receives all that a file commands, in its order, before GcodeCommands::next() returns the bead of it. Names and numbers of
/// commands that GcodeCommands itself does not run come as they are.
class CommandObserver {
 public:
  virtual ~CommandObserver() = default;
  virtual void on_move(const GcodeMove& move) = 0;
  /// G and M commands other than moves, and T with the number of a tool as its code. Not of those that take text.
  virtual void on_command(char letter, double code, const GcodeWords& words) = 0;
  /// A command without a letter and a number: a macro of Klipper.
  virtual void on_text(std::string_view command) = 0;
  /// A line that begins with a semicolon.
  virtual void on_comment(std::string_view comment) = 0;
};

class GcodeCommands {
 public:
  using FilePosition = GcodeFile::FilePosition;

  GcodeCommands(FileReader& file, std::vector<std::string>& types) : path_(file.path()), types_(types), file_(file) {}
  /// Reports to an observer, which must outlive this.
  void report_to(CommandObserver& observer) { observer_ = &observer; }

  void go_to(const FilePosition& position) {
    position_ = position;
    file_.go_to(position.byte, position.line);
    chord_ = 0;
    commands_ = {};
  }
  const FilePosition& position() const { return position_; }  // behind the line that next() returned for
  const FilePosition& before() const { return before_; }      // in front of the command, or of the line of a tag
  std::optional<std::string> fault;
  bool layer_tag = false;  // the line begins a layer
  SlicerFacts facts;       // of the lines so far
  OddLines left_out, off_circle, short_radius;
  std::array<OddLines, static_cast<std::size_t>(Difference::kCount)> differences;
  OddLines flows;                   // M221 with another percentage than 100
  double flow = 100;                // that of the first
  OddLines unfed, unfed_after_g90;  // moves with E that feed nothing; or less, after Marlin's G90 took back M83
  std::uint64_t moves_with_e = 0;

  /// The next bead, or the tag of a layer; false at the end, or if there is a fault.
  bool next(std::optional<RawBead>& bead);

 private:
  bool read_line();
  void fail(std::string_view what);
  bool read_tag();
  double tag_length(std::string_view text);
  void name_type(std::string_view name);
  bool read_words(WordScanner& scanner, GcodeWords& words, bool any);
  bool run_command(std::optional<RawBead>& bead);
  void set_mode(char letter, double code, const GcodeWords& words);
  void set_relative(bool relative);
  void set_flow(const GcodeWords& words);
  void differ_by_tool();
  void change_tool(double number);
  bool pass_over(WordScanner scanner, char letter, double code);
  void set_acceleration(double mm_s2);
  bool feeds_relative() const;
  void differ(Difference difference) { differences[static_cast<std::size_t>(difference)].add(position_.line); }
  bool move(double code, const GcodeWords& words, std::optional<RawBead>& bead);
  void count_unfed(const GcodeWords& words, double fed);
  void feed(double fed);
  bool deposit(RawBead raw, std::optional<RawBead>& bead);
  bool begin_arc(bool clockwise, const GcodeWords& words, const double (&to)[4], double fed);
  bool next_chord(std::optional<RawBead>& bead);
  bool within_reach(const RawBead& bead);

  const std::string& path_;
  std::vector<std::string>& types_;
  FileReader& file_;
  CommandObserver* observer_ = nullptr;
  std::string_view text_, commands_;  // the line, and what of it is not run yet
  std::string stripped_;
  bool parentheses_ = false;  // of the line
  bool later_ = false;        // the next command is not the first one of the line
  bool deposited_ = false;    // of the command
  FilePosition position_, before_, line_start_;
  Arc arc_;                  // under way
  std::uint64_t chord_ = 0;  // the last one that was given; 0 if no arc is under way
  RawBead whole_{};          // the arc from its start to its end
};

}  // namespace lamina::formats
