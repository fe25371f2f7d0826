#include "stages/replay/fired_words.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <utility>

#include "stages/geometry/isa.h"
#include "stages/geometry/targets.h"
#include "stages/geometry/transpose.h"

namespace lamina::replay {
namespace {

/// The 64 pixels that have more than so many drops.
/// stride  words from a bit of the drops to the next one
std::uint64_t exceeding(const std::uint64_t* word, std::size_t stride, std::uint32_t bits, std::uint32_t drops) {
  std::uint64_t more = 0, same = ~std::uint64_t{0};
  for (std::uint32_t b = bits; b-- > 0;) {
    const std::uint64_t has = word[b * stride];
    if ((drops >> b & 1) == 0) more |= same & has;
    same &= (drops >> b & 1) != 0 ? has : ~has;
  }
  return more;
}

using Square = std::uint64_t[64];

LAMINA_BODY std::uint64_t count_body(const Square& square) {
  std::uint64_t count = 0;
  for (const std::uint64_t word : square) count += static_cast<std::uint64_t>(std::popcount(word));
  return count;
}
std::uint64_t count_plain(const Square& square) { return count_body(square); }
#ifdef LAMINA_WIDE_KERNELS
LAMINA_AVX2 std::uint64_t count_popcnt(const Square& square) { return count_body(square); }
#else
std::uint64_t count_popcnt(const Square& square) { return count_body(square); }
#endif

}  // namespace

// What is expected.

ExpectedLines::ExpectedLines(std::span<const BitRows* const> planes, bool turned)
    : planes_(planes),
      turned_(turned),
      words_(((turned ? planes[0]->rows() : planes[0]->columns()) + 63) / 64),
      bits_(static_cast<std::uint32_t>(std::bit_width(planes.size()))) {
  row_.resize(planes[0]->words());
  if (turned) turn_all();
}

// Each plane has pixels of the one before, one drop more.
void ExpectedLines::add_row(std::uint32_t row, std::span<std::uint64_t> counts) {
  const std::size_t words = row_.size();
  planes_[0]->row(row, counts.first(words));
  std::fill(counts.begin() + static_cast<std::ptrdiff_t>(words), counts.end(), 0);
  for (const BitRows* const plane : planes_.subspan(1)) {
    plane->row(row, row_);
    for (std::size_t w = 0; w < words; ++w) {
      std::uint64_t carry = row_[w];
      for (std::uint32_t b = 0; b < bits_ && carry != 0; ++b) {
        const std::uint64_t had = counts[b * words + w];
        counts[b * words + w] = had ^ carry;
        carry &= had;
      }
    }
  }
}

void ExpectedLines::turn_all() {
  const std::uint32_t rows = planes_[0]->rows(), columns = planes_[0]->columns();
  const std::size_t row_words = row_.size();
  lines_.resize(std::size_t{columns} * bits_ * words_);
  Buffer<std::uint64_t> counts(64 * bits_ * row_words);
  for (std::uint32_t block = 0; block < words_; ++block) {
    for (std::uint32_t i = 0; i < 64; ++i) {
      const std::span<std::uint64_t> row = std::span(counts).subspan(i * bits_ * row_words, bits_ * row_words);
      if (block * 64 + i < rows) {
        add_row(block * 64 + i, row);
      } else {
        std::ranges::fill(row, 0);
      }
    }
    for (std::size_t word = 0; word < bits_ * row_words; ++word) {
      std::uint64_t square[64];
      for (std::uint32_t i = 0; i < 64; ++i) square[i] = counts[i * bits_ * row_words + word];
      transpose_square(square);
      const std::size_t bit = word / row_words, first = word % row_words * 64;
      for (std::size_t i = 0; i < 64 && first + i < columns; ++i)
        lines_[((first + i) * bits_ + bit) * words_ + block] = square[i];
    }
  }
}

void ExpectedLines::line(std::uint32_t index, std::span<std::uint64_t> counts) {
  if (!turned_) return add_row(index, counts);
  const std::size_t size = std::size_t{bits_} * words_;
  std::copy_n(lines_.begin() + static_cast<std::ptrdiff_t>(index * size), size, counts.begin());
}

// What is fired.

std::uint64_t FiredWords::bytes(const VirtualMachine& machine, std::uint32_t planes) {
  const bool turned = machine.machine_.mounting.scan_axis != ScanAxis::kX;
  const std::uint64_t bits = static_cast<std::uint64_t>(std::bit_width(planes)), lines = machine.lines_;
  const std::uint64_t words = (std::uint64_t{machine.positions_} + 63) / 64, stride = words + 2 * kChunks + 1;
  const std::uint64_t nozzle_words = (machine.nozzle_.size() + 127) / 128 * 2;
  const std::uint64_t window = static_cast<std::uint64_t>(machine.ticks_) * kWindow * machine.counts().drop_bits * nozzle_words;
  const std::uint64_t image = turned ? bits * (lines * words + lines + 64) : 0;  // with rows of a block that is turned over
  return 8 * (machine.max_open_lines() * bits * stride + window + image) + lines * sizeof(Line);
}

FiredWords::FiredWords(const VirtualMachine& machine, std::span<const BitRows* const> planes)
    : machine_(machine),
      expected_(planes, machine.machine_.mounting.scan_axis != ScanAxis::kX),
      maximum_(static_cast<std::uint32_t>(planes.size())),
      bits_(expected_.bits()),
      stride_(expected_.words() + 2 * kChunks + 1),
      nozzle_words_((machine.machine_.head.nozzles + 127) / 128 * 2),
      nozzle_bits_(machine.counts().drop_bits),
      positions_(machine.positions_),
      lines_flip_(machine.begins_at(machine.machine_.mounting.scan_axis == ScanAxis::kX ? Side::kFront : Side::kRight)),
      positions_flip_(machine.begins_at(machine.machine_.mounting.scan_axis == ScanAxis::kX ? Side::kRight : Side::kFront)),
      count_(widest_isa() >= Isa::kAvx2 ? count_popcnt : count_plain),
      used_(nozzle_words_),
      below_(machine.nozzle_.size()),
      lines_(machine.lines_),
      max_open_(machine.max_open_lines()),
      first_set_(std::int64_t{machine.lines_} - 1) {
  const auto ticks = static_cast<std::size_t>(machine.ticks_);
  vectors_.assign(ticks * kWindow * nozzle_bits_ * nozzle_words_, 0);
  filled_.resize(ticks * kChunks);
  any_.resize(ticks * nozzle_bits_ * nozzle_words_);
  allowed_.resize(ticks * nozzle_words_);
  for (const VirtualMachine::Nozzle& nozzle : machine.nozzle_) {
    const std::int64_t lag = nozzle.step_offset / machine.ticks_;
    shift_.push_back(positions_flip_ ? positions_ - kWindow + lag : -lag);
  }
  wanted_.resize(std::size_t{bits_} * expected_.words());
}

void FiredWords::fire(std::int64_t first_line, std::int64_t step, std::span<const std::uint64_t> vector, std::uint32_t bits,
                      std::uint32_t flip) {
  const std::size_t words = vector.size() / bits;
  if (step < 0 || words > nozzle_words_ || bits > nozzle_bits_) wrong_ = true;
  if (wrong_) return;
  if (first_line != first_line_) {
    flush();
    settle();
    first_line_ = first_line;
  }
  const std::int64_t position = step / machine_.ticks_;
  const auto residue = static_cast<std::size_t>(step % machine_.ticks_);
  if (position / kWindow != window_) {
    flush();
    window_ = position / kWindow;
  }
  if (flip != flip_) allow(flip);
  const auto location = static_cast<std::size_t>(positions_flip_ ? kWindow - 1 - position % kWindow : position % kWindow);
  const std::size_t size = std::size_t{nozzle_bits_} * nozzle_words_;
  std::uint64_t* const row = vectors_.data() + (residue * kWindow + location) * size;
  std::uint64_t& filled = filled_[residue * kChunks + location / 64];
  if ((filled >> (location % 64) & 1) != 0) {
    std::uint64_t twice = 0;
    for (std::size_t i = 0; i < words * bits; ++i) {
      for (std::uint32_t b = 0; b < nozzle_bits_; ++b) twice |= vector[i] & row[b * nozzle_words_ + i % words];
    }
    if (twice != 0) flush();  // a nozzle fires there again
  }
  filled |= std::uint64_t{1} << (location % 64);
  for (std::uint32_t b = 0; b < bits; ++b) {
    std::uint64_t* const to = row + std::size_t{b} * nozzle_words_;
    std::uint64_t* const any = any_.data() + residue * size + std::size_t{b} * nozzle_words_;
    const std::uint64_t* const from = vector.data() + b * words;
    for (std::size_t w = 0; w < words; ++w) {
      to[w] |= from[w];
      any[w] |= from[w];
    }
  }
}

// A step fires nozzles whose pixels are there, if they are not blocked.
void FiredWords::allow(std::uint32_t flip) {
  flip_ = flip;
  std::ranges::fill(allowed_, 0);
  for (std::uint32_t n = 0; n < machine_.nozzle_.size(); ++n) {
    const VirtualMachine::Nozzle& nozzle = machine_.nozzle_[n];
    const auto residue = static_cast<std::size_t>(nozzle.step_offset % machine_.ticks_);
    if (!nozzle.blocked && machine_.machine_.head.max_drops > 0)
      allowed_[residue * nozzle_words_ + n / 64] |= std::uint64_t{1} << (n % 64 ^ flip);
  }
}

void FiredWords::flush() {
  const std::size_t size = std::size_t{nozzle_bits_} * nozzle_words_;
  for (std::uint32_t residue = 0; residue < filled_.size() / kChunks; ++residue) {
    std::uint64_t* const filled = filled_.data() + residue * kChunks;
    if (std::all_of(filled, filled + kChunks, [](std::uint64_t rows) { return rows == 0; })) continue;
    for (std::uint32_t word = 0; word < nozzle_words_ && !wrong_; ++word) turn(residue, word);
    for (std::size_t chunk = 0; chunk < kChunks; ++chunk) {
      for (std::uint64_t& left = filled[chunk]; left != 0; left &= left - 1) {
        const std::size_t row = residue * kWindow + chunk * 64 + static_cast<std::size_t>(std::countr_zero(left));
        std::fill_n(vectors_.begin() + static_cast<std::ptrdiff_t>(row * size), size, 0);
      }
    }
    std::fill_n(any_.begin() + static_cast<std::ptrdiff_t>(residue * size), size, 0);
  }
}

// The positions of a window of 64 nozzles.
void FiredWords::turn(std::uint32_t residue, std::uint32_t word) {
  const std::size_t size = std::size_t{nozzle_bits_} * nozzle_words_;
  const std::uint64_t* const any = any_.data() + residue * size + word;
  std::uint64_t fires = 0;
  for (std::uint32_t b = 0; b < nozzle_bits_; ++b) fires |= any[std::size_t{b} * nozzle_words_];
  if (fires == 0) return;
  if ((fires & ~allowed_[residue * nozzle_words_ + word]) != 0) wrong_ = true;
  if (wrong_) return;
  used_[word] |= fires;
  Square squares[kMaxBits][kChunks];
  for (std::uint32_t b = 0; b < nozzle_bits_; ++b) {
    std::uint64_t count = 0;
    for (std::size_t chunk = 0; chunk < kChunks; ++chunk) {
      Square& square = squares[b][chunk];
      const std::uint64_t* const from = vectors_.data() + (residue * kWindow + chunk * 64) * size + b * nozzle_words_ + word;
      std::uint64_t differs = 0;
      for (std::size_t i = 0; i < 64; ++i) differs |= (square[i] = from[i * size]) ^ from[0];
      if (differs == 0) {  // within a part, or between parts
        for (std::size_t i = 0; i < 64; ++i) square[i] = std::uint64_t{0} - (from[0] >> i & 1);
      } else {
        transpose_square(square);
      }
      count += count_(square);
    }
    drops_ += count << b;
  }
  for (; fires != 0 && !wrong_; fires &= fires - 1) {
    const auto bit = static_cast<std::uint32_t>(std::countr_zero(fires));
    add(word * 64 + (bit ^ flip_), bit, squares);
  }
}

void FiredWords::add(std::uint32_t nozzle, std::uint32_t bit, const Square (&squares)[kMaxBits][kChunks]) {
  std::uint64_t* line = below_[nozzle];
  if (line == nullptr) line = open(nozzle);
  // From the words before the line.
  const std::int64_t first = kWindow + shift_[nozzle] + (positions_flip_ ? -kWindow : kWindow) * window_;
  if (first < 0 || first > kWindow + positions_) wrong_ = true;
  if (wrong_) return;
  const auto shift = static_cast<unsigned>(first & 63);
  line += first >> 6;
  if (bits_ == 1 && nozzle_bits_ == 1) {
    std::uint64_t twice = 0, before = 0;
    for (std::size_t chunk = 0; chunk <= kChunks; ++chunk) {
      const std::uint64_t drops = chunk == kChunks ? 0 : squares[0][chunk][bit];
      const std::uint64_t now = drops << shift | before;
      before = drops >> 1 >> (63 - shift);
      twice |= line[chunk] & now;
      line[chunk] |= now;
    }
    if (twice != 0) wrong_ = true;
    return;
  }
  Drops before{};
  for (std::size_t chunk = 0; chunk <= kChunks; ++chunk) {
    Drops now = before;
    for (std::uint32_t b = 0; b < nozzle_bits_ && chunk < kChunks; ++b) {
      now[b] |= squares[b][chunk][bit] << shift;
      before[b] = squares[b][chunk][bit] >> 1 >> (63 - shift);
    }
    if (nozzle_bits_ > 1 && exceeding(now.data(), 1, nozzle_bits_, machine_.machine_.head.max_drops) != 0) wrong_ = true;
    add_counts(line + chunk, now);
  }
}

void FiredWords::add_counts(std::uint64_t* words, const Drops& drops) {
  std::uint64_t carry = 0, beyond = 0;
  if (nozzle_bits_ == 1) {
    carry = drops[0];
    for (std::uint32_t b = 0; b < bits_ && carry != 0; ++b) {
      const std::uint64_t had = std::exchange(words[b * stride_], words[b * stride_] ^ carry);
      carry &= had;
    }
    if ((carry | (drops[0] & exceeding(words, stride_, bits_, maximum_))) != 0) wrong_ = true;
    return;
  }
  for (std::uint32_t b = 0; b < std::max(bits_, nozzle_bits_); ++b) {
    const std::uint64_t had = b < bits_ ? words[b * stride_] : 0, more = b < nozzle_bits_ ? drops[b] : 0;
    const std::uint64_t sum = had ^ more ^ carry;
    carry = (had & more) | (carry & (had ^ more));
    if (b < bits_) {
      words[b * stride_] = sum;
    } else {
      beyond |= sum;
    }
  }
  if ((beyond | carry | exceeding(words, stride_, bits_, maximum_)) != 0) wrong_ = true;
}

std::uint64_t* FiredWords::open(std::uint32_t nozzle) {
  const std::int64_t at = first_line_ + machine_.nozzle_[nozzle].line;
  if (at < 0 || at >= machine_.lines_) {
    wrong_ = true;
    return nullptr;
  }
  Line& line = lines_[index_of(at)];
  if (line.state != LineState::kOpen) {
    const std::size_t size = bits_ * stride_;
    if (free_.empty() && stock_.size() == max_open_) {
      wrong_ = true;
      return nullptr;
    }
    if (free_.empty()) free_.push_back(stock_.emplace_back(std::make_unique_for_overwrite<std::uint64_t[]>(size)).get());
    line.words = free_.back();
    free_.pop_back();
    std::fill_n(line.words, size, 0);
    if (line.state == LineState::kDone) {
      expected_.line(index_of(at), wanted_);
      for (std::uint32_t b = 0; b < bits_; ++b) {
        std::copy_n(wanted_.begin() + b * expected_.words(), expected_.words(), line.words + b * stride_ + kChunks);
      }
    }
    line.state = LineState::kOpen;
  }
  return below_[nozzle] = line.words;
}

void FiredWords::settle() {
  for (std::uint32_t word = 0; word < nozzle_words_ && !wrong_; ++word) {
    for (std::uint64_t left = used_[word]; left != 0; left &= left - 1) {
      const std::uint32_t number = word * 64 + (static_cast<std::uint32_t>(std::countr_zero(left)) ^ flip_);
      const VirtualMachine::Nozzle& nozzle = machine_.nozzle_[number];
      along_um_ = std::max(along_um_, std::abs(nozzle.along_um));
      across_um_ = std::max(across_um_, std::abs(nozzle.across_um));
      below_[number] = nullptr;
      const std::uint32_t index = index_of(first_line_ + nozzle.line);
      if (lines_[index].state != LineState::kOpen || !has_all(index)) continue;
      first_set_ = std::min(first_set_, first_line_ + nozzle.line);
      free_.push_back(lines_[index].words);
      lines_[index] = {nullptr, LineState::kDone};
    }
    used_[word] = 0;
  }
}

bool FiredWords::within_image(const std::uint64_t* words) const {
  std::uint64_t outside = 0;
  for (std::uint32_t b = 0; b < bits_; ++b) {
    const std::uint64_t* const bit = words + b * stride_;
    for (std::size_t w = 0; w < kChunks; ++w) outside |= bit[w] | bit[stride_ - 1 - w];
    outside |= bit[stride_ - 1 - kChunks];
    if (positions_ % 64 != 0) outside |= bit[stride_ - 2 - kChunks] >> (positions_ % 64);
  }
  return outside == 0;
}

bool FiredWords::has_all(std::uint32_t index) {
  const std::uint64_t* const words = lines_[index].words;
  if (!within_image(words)) wrong_ = true;
  expected_.line(index, wanted_);
  const std::size_t size = expected_.words();
  for (std::uint32_t b = 0; b < bits_; ++b) {
    const std::uint64_t* const line = words + b * stride_ + kChunks;
    if (!std::equal(line, line + size, wanted_.begin() + static_cast<std::ptrdiff_t>(b * size))) return false;
  }
  return !wrong_;
}

// What differs at the end.

bool FiredWords::difference(std::int64_t line, std::uint32_t drops, std::vector<std::uint64_t>& lacks,
                            std::vector<std::uint64_t>& has) {
  const Line& at = lines_[index_of(line)];
  if (at.state == LineState::kDone) return false;
  expected_.line(index_of(line), wanted_);
  const std::size_t size = expected_.words();
  lacks.resize(size);
  has.resize(size);
  std::uint64_t any = 0;
  for (std::size_t w = 0; w < size; ++w) {
    const std::uint64_t wanted = exceeding(wanted_.data() + w, size, bits_, drops);
    const std::uint64_t fired = at.words == nullptr ? 0 : exceeding(at.words + kChunks + w, stride_, bits_, drops);
    lacks[w] = wanted & ~fired;
    has[w] = fired & ~wanted;
    any |= wanted ^ fired;
    if (wanted != 0) first_set_ = std::min(first_set_, line);
  }
  return any != 0;
}

/// Nothing is fired, as the image has it.
bool FiredWords::is_empty(std::int64_t line) {
  if (lines_[index_of(line)].state != LineState::kEmpty) return false;
  expected_.line(index_of(line), wanted_);
  return std::ranges::all_of(wanted_, [](std::uint64_t word) { return word == 0; });
}

bool FiredWords::compare_line(std::int64_t line, const std::vector<bool>& may_be_lost, bool moved, bool lost,
                              Differences& differences) {
  auto& [missing, added, lacks, has, neighbour] = differences;
  if (is_empty(line)) return true;
  const std::int64_t passes = machine_.machine_.mounting.passes;
  for (std::uint32_t drops = 0; drops < maximum_; ++drops) {
    if (!difference(line, drops, lacks, has)) continue;
    std::uint64_t lacking = 0, having = 0;
    for (const std::uint64_t word : lacks) lacking += static_cast<std::uint64_t>(std::popcount(word));
    for (const std::uint64_t word : has) having += static_cast<std::uint64_t>(std::popcount(word));
    missing += lacking;
    added += having;
    if (lacking > 0 && !((moved || lost) && may_be_lost[static_cast<std::size_t>(line)])) return false;
    if (having == 0) continue;
    if (!moved) return false;
    // Drops of a blocked nozzle are those of a neighbouring line.
    std::vector<std::uint64_t> left = has;
    for (const std::int64_t next : {line - passes, line + passes}) {
      if (next < 0 || next >= static_cast<std::int64_t>(lines_.size()) || !may_be_lost[static_cast<std::size_t>(next)])
        continue;
      if (!difference(next, drops, neighbour, has)) continue;
      for (std::size_t w = 0; w < left.size(); ++w) left[w] &= ~neighbour[w];
    }
    if (std::ranges::any_of(left, [](std::uint64_t word) { return word != 0; })) return false;
  }
  return true;
}

bool FiredWords::agrees(const std::vector<bool>& may_be_lost, std::uint64_t moved, std::uint64_t lost) {
  flush();
  settle();
  Differences differences;
  for (std::size_t line = 0; line < lines_.size() && !wrong_; ++line) {
    const auto number = static_cast<std::int64_t>(line);
    const std::uint64_t* const words = lines_[index_of(number)].words;
    if (words != nullptr && !within_image(words)) return false;
    if (!compare_line(number, may_be_lost, moved > 0, lost > 0, differences)) return false;
  }
  return !wrong_ && differences.added == moved && differences.missing == moved + lost;
}

}  // namespace lamina::replay
