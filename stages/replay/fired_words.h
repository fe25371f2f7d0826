// stages/replay/fired_words.h: what a layer fires against what its image has, 64 pixels at a time.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "stages/data/bit_rows.h"
#include "stages/data/buffer.h"
#include "stages/replay/machine.h"

namespace lamina::replay {

/// The drops that a layer's image has, line by line along the scan.
class ExpectedLines {
 public:
  /// planes  outlive this object. turned: lines are columns of the image; all of them are turned over at once
  ExpectedLines(std::span<const BitRows* const> planes, bool turned);

  std::uint32_t words() const { return words_; }
  /// Bits of the drops of a pixel.
  std::uint32_t bits() const { return bits_; }
  /// counts  words() for each of bits(): bit b of the drops of 64 pixels, the first one in bit 0
  void line(std::uint32_t index, std::span<std::uint64_t> counts);

 private:
  void add_row(std::uint32_t row, std::span<std::uint64_t> counts);
  void turn_all();

  std::span<const BitRows* const> planes_;
  bool turned_;
  std::uint32_t words_, bits_;
  Buffer<std::uint64_t> row_;
  Buffer<std::uint64_t> lines_;  // of an image that is turned over
};

/// What the sweeps of a layer fire. Vectors of 64 positions are turned over at a time, and added to the lines below their
/// nozzles; a line that has all drops of its image is released, so that the lines of a swath are kept, not those of the bed.
/// It finds whether anything is wrong, and not where: drop by drop, Printing describes the first fault.
class FiredWords {
 public:
  /// Memory that one takes at most.
  static std::uint64_t bytes(const VirtualMachine& machine, std::uint32_t planes);
  /// planes  of the machine's size; outlive this object
  FiredWords(const VirtualMachine& machine, std::span<const BitRows* const> planes);

  /// The vector of a step while nozzle 0 is over first_line. Steps of any order.
  /// vector  words for each bit of the drops, the lowest bit first
  /// flip    nozzle n is bit n % 64 ^ flip of word n / 64
  void fire(std::int64_t first_line, std::int64_t step, std::span<const std::uint64_t> vector, std::uint32_t bits,
            std::uint32_t flip);
  /// Whether the layer prints its image, but for drops of blocked nozzles; called once, at its end.
  /// may_be_lost  by line: no nozzle that works comes over it, or a blocked one
  bool agrees(const std::vector<bool>& may_be_lost, std::uint64_t moved, std::uint64_t lost);

  // --- then
  std::uint64_t drops() const { return drops_; }
  /// The first line that the image has anything on; the last one if none has.
  std::int64_t first_line() const { return first_set_; }
  /// The greatest distances of a drop from its pixel's centre.
  double along_um() const { return along_um_; }
  double across_um() const { return across_um_; }

 private:
  enum class LineState : std::uint8_t { kEmpty, kOpen, kDone };  // nothing is fired, some is, all is
  struct Line {
    std::uint64_t* words = nullptr;
    LineState state = LineState::kEmpty;
  };
  struct Differences {
    std::uint64_t missing = 0, added = 0;  // drops, of the layer
    std::vector<std::uint64_t> lacks, has, neighbour;
  };
  static constexpr std::uint32_t kMaxBits = 4;           // of a nozzle's drops
  static constexpr std::size_t kChunks = 4;              // of 64 positions
  static constexpr std::int64_t kWindow = 64 * kChunks;  // positions that are turned over at a time
  using Square = std::uint64_t[64];                      // nozzles, of 64 positions
  using Drops = std::array<std::uint64_t, kMaxBits>;     // of 64 pixels, the lowest bit first

  void allow(std::uint32_t flip);
  void flush();
  void turn(std::uint32_t residue, std::uint32_t word);
  void add(std::uint32_t nozzle, std::uint32_t bit, const Square (&squares)[kMaxBits][kChunks]);
  void add_counts(std::uint64_t* words, const Drops& drops);
  std::uint64_t* open(std::uint32_t nozzle);
  void settle();
  bool has_all(std::uint32_t index);
  bool within_image(const std::uint64_t* words) const;
  bool is_empty(std::int64_t line);
  bool compare_line(std::int64_t line, const std::vector<bool>& may_be_lost, bool moved, bool lost, Differences& differences);
  /// The pixels of a line that have to get more than so many drops and do not, and those that get them and must not.
  /// returns  whether there are any
  bool difference(std::int64_t line, std::uint32_t drops, std::vector<std::uint64_t>& lacks, std::vector<std::uint64_t>& has);
  std::uint32_t index_of(std::int64_t line) const {
    return static_cast<std::uint32_t>(lines_flip_ ? static_cast<std::int64_t>(lines_.size()) - 1 - line : line);
  }

  const VirtualMachine& machine_;
  ExpectedLines expected_;
  std::uint32_t maximum_, bits_;  // drops of a pixel, and bits of their number
  std::size_t stride_;            // words of a bit of a line, with kChunks before it and one more behind
  std::uint32_t nozzle_words_, nozzle_bits_;
  std::int64_t positions_;
  bool lines_flip_, positions_flip_;  // lines, positions count from the end of the image
  bool wrong_ = false;
  std::uint64_t (*count_)(const Square&);  // set bits
  std::uint32_t flip_ = UINT32_MAX;

  // A window of all nozzles; steps of one residue belong together.
  std::int64_t first_line_ = 0, window_ = -1;
  Buffer<std::uint64_t> vectors_;       // residue x position x bit x word
  std::vector<std::uint64_t> filled_;   // residue x chunk: which positions
  std::vector<std::uint64_t> any_;      // residue x bit x word: nozzles that fire
  std::vector<std::uint64_t> allowed_;  // residue x word: nozzles that can fire at a step of it
  std::vector<std::int64_t> shift_;     // by nozzle: its first position in window 0
  std::vector<std::uint64_t> used_;     // nozzles of the sweeps at this first line
  std::vector<std::uint64_t*> below_;   // by nozzle: its line

  std::vector<Line> lines_;
  const std::uint32_t max_open_;  // lines; a program with more counts as wrong, so that memory is bounded
  std::vector<std::unique_ptr<std::uint64_t[]>> stock_;
  std::vector<std::uint64_t*> free_;
  Buffer<std::uint64_t> wanted_;

  std::uint64_t drops_ = 0;
  std::int64_t first_set_ = 0;
  double along_um_ = 0, across_um_ = 0;
};

}  // namespace lamina::replay
