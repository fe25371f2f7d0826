// stages/replay/printing.h: a layer on the virtual machine, driven by the readers of dialects.
#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "stages/replay/fired_words.h"
#include "stages/replay/machine.h"

namespace lamina::replay {

/// Half of the last digit of speeds as they are spelt, in mm/s.
inline constexpr double kHalfMmPerMinute = 0.5 / 60;

/// What a program is carried out for.
enum class Purpose : std::uint8_t {
  kPrint,    // its drops, one by one
  kCompare,  // its drops, 64 pixels at a time: whether they are those of the image, and not where they are not
  kTime      // its movements alone: nothing fires, and no image is held
};

/// Where the axes stand between two layers, as programs count them: the head waits at its safe place, the roller at home,
/// the build vat at the top of the layer below. Each layer's program begins and ends so (check_cycle), so that a layer is
/// carried out without those before it.
struct AxisPositions {
  double x_mm = 0, y_mm = 0, build_mm = 0, roller_mm = 0;
};

/// The first fault of a program ends it: ok() becomes false, later faults are not recorded, and pixels printed after it
/// are undefined. Readers return when ok() is false.
class Printing {
 public:
  /// planes  most drops of a pixel
  Printing(const VirtualMachine& machine, const Layer& layer, Purpose purpose, const VirtualMachine::Watch* watch = nullptr,
           std::uint32_t planes = 1);
  /// For kCompare. planes  of the machine's size; outlive this object
  Printing(const VirtualMachine& machine, const Layer& layer, std::span<const BitRows* const> planes);

  const Machine& profile() const { return machine_.machine_; }
  /// Sweeps that are there since nozzles cannot fire all of their drops at the scan's speed, by number; after finish().
  const std::set<std::uint32_t>& added_sweeps() const { return added_; }
  /// Times the others alone; before the program.
  void leave_out(std::set<std::uint32_t> sweeps) { left_out_ = std::move(sweeps); }
  std::uint32_t layer() const { return layer_.index; }
  const Layer& of_layer() const { return layer_; }
  /// Where the program finds the machine.
  AxisPositions axis_positions() const;
  std::uint32_t nozzles() const { return static_cast<std::uint32_t>(machine_.nozzle_.size()); }
  /// "layer 12, swath 3, step 417: what"; before the first swath or its first step, the text says so instead.
  void fault(std::string_view what);
  bool ok() const { return fault_.empty(); }
  /// errors  kVerification: the first fault
  Status status() const { return ok() ? Status() : Status(Error{Fault::kVerification, fault_}); }

  // --- sweeps
  /// of  how many the program says that the layer has, where its dialect numbers them
  void begin_sweep(std::uint32_t number, bool backward, std::optional<std::uint32_t> of = {});
  /// Moves nozzle 0 to a carriage position, in mm.
  void go_across(double carriage_mm);
  /// Carriage position in mm of a step, and the step at a position; 0 if no step is near.
  double position_of(double step) const;
  std::int64_t step_at(double carriage_mm);
  /// For messages: the sweep being read before its start, and the step of a vector before it fires.
  void reading_sweep(std::uint32_t number) {
    reading_sweep_ = number;
    reading_ = INT64_MIN;
  }
  void reading_step(std::int64_t step) { reading_ = step; }
  /// Of programs that are timed without some sweeps: whether that at hand is one, and whether the others run there and back
  /// anew.
  bool leaves_out_sweep() const { return left_out_.contains(sweep_); }
  bool turns_anew() const { return !left_out_.empty() && profile().motion.both_directions; }
  void at_step(std::int64_t step);
  /// The lowest bits of words that fire are the first nozzles; else the highest ones are.
  void lowest_bits_first() { flip_ = 0; }
  /// Fires all nozzles with set bits: words for each bit of the drops, the lowest bit first.
  /// returns  the most drops of a nozzle
  std::uint32_t fire_words(std::span<const std::uint64_t> words, std::uint32_t bits = 1);
  /// Bits of a nozzle's drops in programs of heads that fire several at a place; 1 for others.
  std::uint32_t drop_bits() const { return replay::drop_bits(profile().head.max_drops); }

  // --- what the program says of itself
  void state_layers(std::uint32_t layers);
  void state_heights(std::optional<double> bottom_mm, double thickness_mm);

  // --- movements; each takes its time
  enum class MovingPart : std::uint8_t { kHead, kRoller, kVat };
  /// Before a part moves: whether the others are out of its way, and roller and vats as fast as the profile has it.
  void check_way(MovingPart part, double mm_s);
  /// Roller and head have an axis in common.
  bool roller_on_gantry() const;
  /// The head may still move, or it rests: lines of the machine's own that do not wait for it belong there alone.
  void under_way(bool moving) { under_way_ = moving; }
  /// From rest to rest if the profile knows the head's acceleration.
  /// drops  of a scan: the most that a nozzle fires at a place of it
  void head_moves(double mm, double mm_s, bool scanning, std::uint32_t drops = 1);
  /// Whether a sweep has the profile's ramp before its first drops and behind its last, each so many mm long; a fault if not.
  bool has_ramps(double before_mm, double behind_mm, double adjacent_mm = 1e-3);
  /// works_mm_s  how fast it came, of a G1 outside of sweeps; 0: by a travel, or in a sweep
  void head_is_at(double x_mm, double y_mm, double works_mm_s);
  void feeds(std::uint32_t vat, double mm, double mm_s);
  void build_vat_is_at(double mm);
  /// The same, where a program states only the distance from where the layer before left it.
  void build_vat_goes_down(double mm) {
    count.moves = moves_powder_ = true;
    lowered_mm_ = mm;
  }
  /// may_spread  such a movement can be that over the powder
  void roller_is_at(double mm, bool may_spread = true);
  /// The first error of the powder; reported at the layer's end, where its true heights are known.
  void wrong_powder(std::string what) {
    if (spread_wrong_.empty()) spread_wrong_ = std::move(what);
  }
  /// Powder is spread now: the build vat is at its stated position, vats have fed so much, and the spreader goes so far above
  /// both.
  void spreads(double build_mm, double fed_mm, double clearance_mm);
  /// The last ways of the axes of pistons that have play, and come to each place from below.
  void pistons_came(double build_mm, double feed_mm);
  void takes(double seconds) { seconds_ += seconds; }

  // --- care of head and powder
  /// Every nozzle that is not blocked fires so many drops where the carriage stands, off the bed.
  void spits(double x_mm, double y_mm, std::uint64_t drops, double seconds);
  /// Faults a nozzle that is not blocked and over the bed where the carriage stands.
  void outside_bed(double x_mm, double y_mm);
  /// The head leaves the place where it stood: shots there have to be whole.
  void leaves_position();
  /// The program waits for somebody to fill the vats; before powder is fed.
  void refills();
  /// It waits for the layer to dry; behind the sweeps.
  void dwells(double seconds);
  /// Whether a line is the next of the machine's own, which its profile has: behind a wiper, around the pause in which the
  /// layer dries. Whole blocks, in their order.
  bool takes_own(std::string_view line);
  /// The roller turns so fast against its way, or, at 0, no longer.
  void roller_turns(double rpm) { rpm_ = rpm; }
  /// A program that moves no powder has a record that the host carries out; it spreads the layer before the first one that is
  /// not of its powder.
  void state_host(std::string_view record, bool of_powder);
  /// Of these: the layers of powder below this one.
  void state_base(std::uint32_t layers, double layer_mm);

  /// Checks the powder cycle of the layer, and that it leaves the machine as the next one expects it; called at the end.
  void check_cycle();
  /// Ends the layer: adds the time of what the profile knows and the program does not spell.
  const Count& finish();
  /// Compares with the image of each drop; see VirtualMachine::replay.
  void compare(std::span<const BitRows* const> planes, std::uint64_t moved, std::uint64_t lost);

  Count count;

 private:
  struct Sweep {
    std::uint32_t number;
    std::int64_t first_line;
  };
  /// What differs in all planes.
  struct Differences {
    std::uint64_t missing = 0, added = 0;
    std::string first, first_of_all;  // that nothing explains; explained or not
    std::vector<bool> may_be_lost;
    std::vector<std::uint64_t> wanted, neighbour;
    std::int64_t neighbour_row = -1;
  };
  void compare_words(std::uint64_t moved, std::uint64_t lost);
  void compare_plane(const BitRows& image, std::uint32_t plane, std::uint64_t moved, std::uint64_t lost,
                     Differences& differ) const;
  std::uint32_t max_drops(std::span<const std::uint64_t> words, std::uint32_t bits) const;
  void fire(std::uint32_t nozzle, std::uint32_t drops);
  void fire_singly(std::span<const std::uint64_t> words, std::uint32_t bits);
  /// The 64 pixels of a word that are fired more than so many times.
  std::uint64_t fired_more(std::uint32_t times, std::size_t word) const;
  /// what  the complete message
  void fail(std::string what) {
    if (ok()) fault_ = std::move(what);
  }
  void wrong_cycle(std::string_view what);
  bool roller_at_home() const { return std::abs(roller_mm_ - profile().powder.roller_mm[0]) < 1e-3; }
  bool head_at(const std::array<double, 2>& at) const;
  bool head_at_safe() const { return head_at(profile().motion.safe_mm); }
  void check_spread();
  void check_speed(double mm_s, bool scanning);
  void state_sweep(std::uint32_t of);
  std::int64_t first_of_layer(const BitRows& image) const;
  void check_numbers(std::int64_t first_of_layer);
  // Of heads that fire several drops: sweeps follow each other over a place until its drops are fired.
  std::uint32_t sweeps_per_position() const;
  void leave_sweep();
  /// Whether care was taken before this sweep, which has just ended. since_s  of the layer, behind it; below 0: not yet
  void check_maintenance(std::string_view what, std::uint32_t every, double limit_s, double since_s);
  /// mm of powder below the layer, fed with it.
  double base_mm() const { return layer_.index == 0 ? profile().powder.base_mm() : 0; }
  std::uint32_t base_layers() const { return layer_.index == 0 ? profile().powder.base_layers : 0; }
  void strokes(double build_mm, double fed_mm);
  void waits_capped(std::string_view what);
  void check_pauses();
  void check_stated();
  void leaves_wiper(std::string_view what);
  std::vector<bool> lines_that_may_be_lost() const;
  /// Across and along the scan, of a pixel.
  std::array<std::int64_t, 2> line_and_position(std::uint32_t column, std::uint32_t row) const;
  std::int64_t line_of(std::uint32_t column, std::uint32_t row) const { return line_and_position(column, row)[0]; }
  double across_um(double carriage_mm) const;
  bool pixel(std::int64_t line, std::int64_t position, std::uint32_t& column, std::uint32_t& row) const;
  std::string describe_position(std::uint32_t column, std::uint32_t row) const;

  const VirtualMachine& machine_;
  const VirtualMachine::Watch* watch_;
  Layer layer_;
  Purpose purpose_;
  std::uint32_t row_words_;
  std::uint32_t sweep_ = 0;
  std::int64_t first_line_ = 0, step_ = 0, previous_step_ = 0;
  std::int64_t reading_ = INT64_MIN, reading_sweep_ = INT64_MIN;
  bool rolled_ = false;  // to the far end
  bool under_way_ = false, host_spread_ = false;
  std::optional<std::uint32_t> swaths_stated_;  // swaths of the layer
  std::optional<double> lowered_mm_;
  double roller_mm_ = 0;
  std::optional<std::array<double, 2>> head_mm_;  // if the program says where
  bool moves_powder_ = false;                     // moves a vat or the roller
  double seconds_ = 0;
  bool backward_ = false, sweeping_ = false, stepped_ = false, fired_here_ = false;
  std::uint32_t planes_, times_bits_, flip_ = 63;
  std::optional<FiredWords> words_;   // for kCompare
  std::vector<std::uint64_t> fired_;  // how many times, for 64 pixels a word for each bit of it, the leftmost one in bit 0
  struct PositionCount {
    std::uint32_t number = 0, drops = 0;  // drops: of the pixel that gets most
  } position_;
  std::set<std::uint32_t> added_, left_out_;
  std::uint32_t sweep_max_ = 0;  // drops of a nozzle at a step of the sweep at hand
  std::vector<Sweep> sweeps_;
  bool based_ = false;                 // with a stated base
  std::uint32_t strokes_ = 0;          // of the roller to its far end
  double spat_s_ = -1, wiped_s_ = -1;  // when the layer's last care ended; -1: none yet
  std::uint64_t spat_here_ = 0;        // drops of a nozzle since the head stands
  std::size_t own_ = 0;                // lines of the block at hand that came
  std::uint32_t wiper_blocks_ = 0, lamp_blocks_ = 0;
  bool lamp_on_ = false;          // by the lines that begin the pause to dry
  bool at_wiper_ = false;         // the head has just gone over it
  bool filled_ = false;           // vats are, and the head has not gone back to its safe place
  double dwelt_s_ = 0, rpm_ = 0;  // rpm: of the roller
  std::string fault_;             // the first one
  std::string spread_wrong_;      // the first fault of spreading
};

/// The readers of dialects, whose formats stages/program/ documents: each reads a layer's program, the whole file. An invalid
/// program sets the fault of the printing.
void read_nuferbj(std::string_view text, Printing& printing);
void read_raw(std::string_view text, Printing& printing);
void read_planes(std::string_view text, Printing& printing);
void read_hp45(std::string_view text, Printing& printing);
void read_oasis(std::string_view text, Printing& printing);
void read_brundlefab(std::string_view text, Printing& printing);
void read_m578(std::string_view text, Printing& printing);

}  // namespace lamina::replay
