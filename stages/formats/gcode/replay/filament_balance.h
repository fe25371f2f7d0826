// stages/formats/gcode/replay/filament_balance.h: compares what is drawn back between two beads with what is fed before the
// second.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "stages/formats/gcode/replay/defects.h"

namespace lamina::formats::gcode {

/// Filament moved between beads: on the spot, or drawn back along a way. All of a file's pauses have one balance: 0, or the
/// extra length of Slic3r, PrusaSlicer (retract_restart_extra) and Cura (retraction_extra_prime_amount). The most frequent
/// balance is taken for it; others are faults. Memory: a table of kBalances balances.
class FilamentBalance {
 public:
  static constexpr double kToleranceMm = 0.1;  // of filament

  /// Filament that deposits nothing; mm, below 0: drawn back.
  void feed(double mm, bool absolute, FileLine at);
  /// A bead.
  void bead(FileLine at);
  /// After a change of tool, a pause or start code: the next bead is not compared.
  void forget();
  /// Reports the balances that differ from that of most pauses.
  void finish(Defects& defects) const;
  bool drawn_back() const { return sum_ < -kToleranceMm; }
  std::uint64_t retractions() const { return retractions_; }

 private:
  struct BackStep {
    double mm = 0;
    FileLine at;
    bool absolute = false;  // E
  };
  struct PauseBalance {
    double mm = 0, deepest = 0;  // the sum; the farthest that was drawn back
    std::uint64_t count = 0;
    FileLine first;
    BackStep last_back;  // of the first
  };
  static constexpr std::size_t kBalances = 64;

  std::array<PauseBalance, kBalances> balances_{};
  std::size_t size_ = 0;
  double sum_ = 0, deepest_ = 0;  // since the last bead, mm
  FileLine fed_at_;               // the last one that fed
  BackStep step_;                 // the last one since the last bead
  bool open_ = false, exempt_ = false;
  std::uint64_t retractions_ = 0;
};

}  // namespace lamina::formats::gcode
