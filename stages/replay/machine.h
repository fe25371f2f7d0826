// stages/replay/machine.h: a virtual machine that replays print programs.
//
// It shares only the profile with the compiler: it has separate parsers for each dialect, computes each nozzle's position
// at every shot from pitch, angle and offsets, and places the drop on the nearest pixel.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "stages/data/bit_rows.h"
#include "stages/data/layer.h"
#include "stages/data/machine.h"
#include "stages/data/runs.h"
#include "stages/data/status.h"
#include "stages/replay/count.h"

namespace lamina::replay {

class Printing;

/// Bits of a nozzle's drops in programs of heads that fire several at a place; 1 for others.
std::uint32_t drop_bits(std::uint32_t max_drops);

/// The pixels of a machine, derived independently from its profile.
class VirtualMachine {
 public:
  /// columns, rows  of the images. layers: of the job; 0: as programs say.
  /// errors  kVerification if the profile cannot be this job's
  static Result<VirtualMachine> build(const Machine& machine, std::uint32_t columns, std::uint32_t rows,
                                      std::uint32_t layers = 0);

  const Machine& profile() const { return machine_; }
  std::uint32_t layers() const { return layers_; }
  /// Sizes that headers of programs state. steps: of a pixel; drop_bits: of a nozzle's drops at a position
  struct Counts {
    std::uint32_t nozzles, positions, lines, steps, drop_bits;
    double step_um;
  };
  Counts counts() const;

  /// Replays the program of a layer (the whole file) and compares the printed pixels with the image.
  ///
  /// layer     its index, and the position of the build vat
  /// image     the expected image
  /// moved     recorded pixels of blocked nozzles that neighbours fire
  /// lost      recorded pixels of blocked nozzles that no nozzle fires
  /// errors    kVerification: "layer 12, swath 3, step 417: what is wrong"; truncated text, a word unknown to the dialect,
  ///           a nozzle that does not exist, is blocked or fires twice on a pixel, a set pixel that a working nozzle passes
  ///           without firing, a fired pixel that is not set, wrong numbers of moved or lost pixels, a scan speed above the
  ///           nozzles' firing rate; if the dialect moves the machine: a wrong height of the build vat, a wrong dose, a
  ///           roller that does not go to its far end and back, a head that does not wait where the next layer finds it
  /// cost      O(text + pixels / 64); where something is wrong O(text + drops) more, to find it. memory: bytes_of_replay(),
  ///           then bytes_of_drops()
  Result<Count> replay(std::string_view program, const Layer& layer, const RunsView& image, std::uint64_t moved,
                       std::uint64_t lost) const;
  /// The same for pixels of several drops: plane k, from 0, holds the pixels that have to get more than k drops, and a pixel
  /// that is fired more often than there are planes is a fault. memory  that for each bit of their number
  Result<Count> replay(std::string_view program, const Layer& layer, std::span<const RunsView> planes, std::uint64_t moved,
                       std::uint64_t lost) const;
  Result<Count> replay(std::string_view program, const Layer& layer, std::span<const BitRows* const> planes,
                       std::uint64_t moved, std::uint64_t lost) const;
  /// What replay() does: 64 pixels at a time, whose errors do not say where (a program with more open lines than
  /// max_open_lines() is one); after an error drop by drop, 25 ns each.
  Result<Count> replay_words(std::string_view program, const Layer& layer, std::span<const BitRows* const> planes,
                             std::uint64_t moved, std::uint64_t lost) const;
  Result<Count> replay_drops(std::string_view program, const Layer& layer, std::span<const BitRows* const> planes,
                             std::uint64_t moved, std::uint64_t lost) const;

  /// Memory that replay_words() and replay_drops() take at most, besides text and image. planes  most drops of a pixel
  std::uint64_t bytes_of_replay(std::uint32_t planes) const;
  std::uint64_t bytes_of_drops(std::uint32_t planes) const;
  /// Lines of which a program has fired some drops and not all: those of two swaths, and those next to blocked nozzles.
  std::uint32_t max_open_lines() const;

  /// How long a layer's program takes, by its movements alone, and its care: nothing fires on the bed. The machine stands where
  /// the layer below left it, so that layers can be timed in any order and their times add up to that of the job.
  /// program  of a dialect with motion; vectors may be left out of those of nuferbj
  /// errors   kVerification: a word unknown to the dialect
  Result<Count> timed(std::string_view program, const Layer& layer) const;

  /// A drop, by column and row of the image, sweep and step.
  struct Drop {
    std::uint32_t column, row, sweep, step, nozzle;
    std::int64_t first_line;  // of nozzle 0 in this sweep
  };
  /// Called with each drop in the order of the program.
  using Watch = std::function<void(const Drop&)>;
  /// Runs a program without comparing; nothing of it is timed. planes  most drops of a pixel. errors  as replay
  Result<Count> run(std::string_view program, std::uint32_t layer, const Watch& watch, std::uint32_t planes = 1) const;

  /// Position of a nozzle at a step of a sweep, in fractional columns and rows of the image.
  std::array<double, 2> nozzle_at(std::int64_t first_line, double step, std::uint32_t nozzle) const;

 private:
  friend class Printing;
  friend class FiredWords;
  Result<Count> replay(std::string_view program, Printing& printing, std::span<const BitRows* const> planes,
                       std::uint64_t moved, std::uint64_t lost) const;
  /// Whether sweeps or nozzles count from a side.
  bool begins_at(Side side) const { return machine_.mounting.scan_from == side || machine_.mounting.nozzle_0 == side; }

  Machine machine_;
  std::uint32_t columns_ = 0, rows_ = 0, layers_ = 0;
  double line_um_ = 0, position_um_ = 0, step_um_ = 0;
  std::uint32_t lines_ = 0, positions_ = 0;
  struct Nozzle {
    std::int64_t line;           // from that of nozzle 0
    std::int64_t step_offset;    // steps after the foremost nozzle, rounded
    double along_um, across_um;  // from the centre of its pixel when it fires
    bool blocked;
  };
  std::vector<Nozzle> nozzle_;
  std::int64_t ticks_ = 1;  // steps per pixel
};

}  // namespace lamina::replay
