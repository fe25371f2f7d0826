#include "stages/program/fire_drops.h"

#include <algorithm>
#include <bit>

#include "stages/geometry/drop_rows.h"
#include "stages/geometry/isa.h"
#include "stages/geometry/targets.h"
#include "stages/program/transpose.h"

namespace lamina::program {
namespace {

constexpr std::uint64_t kAll = ~std::uint64_t{0};
constexpr std::size_t kBlockWords = 32 << 10;  // of the lines of bits that are held at once: 256 KiB

std::uint64_t turned(std::uint64_t word, std::uint64_t by) { return std::rotl(word, static_cast<int>(by % 64)); }

/// One sweep while its vectors are made. Steps of residue r are r + ticks * q.
class DropSweep {
 public:
  DropSweep(const HeadGrid& grid, std::span<const DropLine> line, std::uint32_t first, DropScratch& scratch,
            SweepVectors& vectors, FiredDrops& fired)
      : grid_(grid), line_(line), first_(first), scratch_(scratch), vectors_(vectors), fired_(fired) {}

  /// The steps at which anything fires, and the most drops of a nozzle. False if there are none.
  bool measure() {
    fired_ = {};
    std::uint64_t begin = UINT64_MAX, end = 0;
    for (std::uint32_t i = 0; i < line_.size(); ++i) {
      const DropLine& line = line_[i];
      const std::uint64_t ticks = grid_.steps_per_pixel, lag = grid_.lag[i];
      const std::size_t runs = line.change.size() / 2;
      for (std::size_t k = 0; k < runs && line.change[2 * k] * ticks + lag < begin; ++k) {
        if (const std::uint32_t at = first_fired(line, k); at != UINT32_MAX) {
          begin = std::min(begin, at * ticks + lag);
          break;
        }
      }
      for (std::size_t k = runs; k > 0 && line.change[2 * k - 1] * ticks + lag > end; --k) {
        if (const std::uint32_t at = end_of_fired(line, k - 1); at != 0) {
          end = std::max(end, (at - 1) * ticks + lag + 1);
          break;
        }
      }
      for (std::size_t k = 0; grid_.drop_bits > 1 && k < runs; ++k) measure_drops(line, k);
    }
    if (end == 0) return false;
    if (grid_.drop_bits == 1) fired_.maximum = 1;
    vectors_.first_step = static_cast<std::uint32_t>(begin);
    vectors_.steps = static_cast<std::uint32_t>(end - begin);
    return true;
  }

  template <class Transpose>
  LAMINA_BODY void make(Transpose transpose) {
    const std::uint64_t ticks = grid_.steps_per_pixel;
    mark_residues();
    const std::size_t rows = std::size_t{grid_.words()} * 64 * grid_.drop_bits;
    block_ = std::clamp<std::size_t>(kBlockWords / rows, 2, 64);
    scratch_.rows.resize(rows * block_);
    scratch_.next.assign(line_.size(), 0);
    vectors_.bits.resize(std::size_t{vectors_.steps} * vectors_.words);
    const std::uint64_t last = vectors_.first_step + std::uint64_t{vectors_.steps} - 1;
    for (std::uint64_t q = vectors_.first_step / ticks / 64 * 64; q * ticks <= last; q += 64 * block_) {
      std::fill(scratch_.rows.begin(), scratch_.rows.end(), 0);
      for (std::uint32_t i = 0; i < line_.size(); ++i) {
        if (!line_[i].change.empty()) expand(i, q);
      }
      for (std::uint64_t b = 0; b < block_ && (q + 64 * b) * ticks <= last; ++b) {
        for (std::uint32_t word = 0; word < vectors_.words; ++word) {
          for (std::uint32_t residue = 0; residue < ticks; ++residue) put(word, residue, q, b, transpose);
        }
        add_firing((q + 64 * b) * ticks, (q + 64 * b + 64) * ticks);
      }
    }
  }

 private:
  struct InSweep {
    std::uint32_t low, high;  // drops of the pixels of a run
  };
  InSweep drops_of(const DropZone& zone) const {
    const std::uint32_t low = drops_in_sweep(grid_, zone.base, first_);
    return {low, zone.extra == DropZone::Extra::kNone ? low : drops_in_sweep(grid_, zone.base + 1u, first_)};
  }

  /// The pixels of word `word` of a line that get a drop in this sweep, if they are of the zone.
  std::uint64_t fired_bits(const DropLine& line, const DropZone& zone, std::uint32_t word) const {
    const InSweep drops = drops_of(zone);
    if (drops.high == 0) return 0;
    return line.allowed & (drops.low > 0 ? kAll : extra_bits(*line.patterns, zone, line.row, word));
  }
  /// Calls bits_of(word) from the first or the last word of a run until it is not 0. returns  the first pixel; UINT32_MAX: none
  template <class Bits>
  static std::uint32_t first_set(std::uint32_t begin, std::uint32_t end, const Bits& bits_of) {
    for (std::uint32_t at = begin; at < end; at = (at / 64 + 1) * 64) {
      const std::uint64_t bits = bits_of(at / 64) >> (at % 64);
      if (bits == 0) continue;
      const std::uint32_t found = at + static_cast<std::uint32_t>(std::countr_zero(bits));
      return found < end ? found : UINT32_MAX;
    }
    return UINT32_MAX;
  }
  std::uint32_t first_fired(const DropLine& line, std::size_t run) const {
    const DropZone& zone = line.patterns->zone[line.zone[run]];
    return first_set(line.change[2 * run], line.change[2 * run + 1],
                     [&](std::uint32_t word) { return fired_bits(line, zone, word); });
  }
  /// One past the last pixel that fires; 0: none.
  std::uint32_t end_of_fired(const DropLine& line, std::size_t run) const {
    const DropZone& zone = line.patterns->zone[line.zone[run]];
    const std::uint32_t begin = line.change[2 * run];
    for (std::uint32_t end = line.change[2 * run + 1]; end > begin; end = (end - 1) / 64 * 64) {
      const std::uint64_t bits = fired_bits(line, zone, (end - 1) / 64) << (63 - (end - 1) % 64);
      if (bits == 0) continue;
      const std::uint32_t found = end - static_cast<std::uint32_t>(std::countl_zero(bits));
      return found > begin ? found : 0;
    }
    return 0;
  }
  void measure_drops(const DropLine& line, std::size_t run) {
    const DropZone& zone = line.patterns->zone[line.zone[run]];
    const InSweep drops = drops_of(zone);
    if (drops.high <= fired_.maximum) return;
    const auto any = [&](bool extra) {
      return first_set(line.change[2 * run], line.change[2 * run + 1], [&](std::uint32_t word) {
               const std::uint64_t bits = extra_bits(*line.patterns, zone, line.row, word);
               return line.allowed & (extra ? bits : ~bits);
             }) != UINT32_MAX;
    };
    if (any(true) && drops.high > drops.low) {
      fired_.maximum = drops.high;
    } else if (drops.low > fired_.maximum && (any(false) || any(true))) {
      fired_.maximum = drops.low;
    }
  }

  /// Sets what a nozzle fires at its steps from q on, of its residue.
  LAMINA_BODY void expand(std::uint32_t nozzle, std::uint64_t q) {
    const DropLine& line = line_[nozzle];
    const std::uint64_t shift = grid_.lag[nozzle] / grid_.steps_per_pixel - q;  // bit of position p is p + shift, modulo 2^64
    const std::uint64_t end_of_block = q + 64 * block_;
    const std::uint64_t allowed = turned(line.allowed, shift);
    const std::size_t bit = nozzle ^ grid_.bit_order, plane = std::size_t{grid_.words()} * 64 * block_;
    std::uint64_t* const row = scratch_.rows.data() + bit / 64 * 64 * block_ + bit % 64;
    std::uint32_t& next = scratch_.next[nozzle];
    const auto runs = static_cast<std::uint32_t>(line.change.size() / 2);
    while (next < runs && line.change[2 * std::size_t{next} + 1] + shift + q <= q) ++next;
    for (std::uint32_t k = next; k < runs; ++k) {
      const std::uint64_t at = line.change[2 * std::size_t{k}] + shift + q,
                          stop = line.change[2 * std::size_t{k} + 1] + shift + q;
      if (at >= end_of_block) break;
      const std::uint64_t begin = at > q ? at - q : 0, end = std::min(stop, end_of_block) - q;
      const DropZone& zone = line.patterns->zone[line.zone[k]];
      const InSweep drops = drops_of(zone);
      for (std::uint32_t b = 0; b < grid_.drop_bits; ++b) {
        const bool low = (drops.low >> b & 1) != 0, high = (drops.high >> b & 1) != 0;
        if (low && high) {
          set_pattern(row + b * plane, begin, end, allowed, allowed, 64);
        } else if (low || high) {
          set_extra(line, zone, shift, begin, end, high ? 0 : kAll, allowed, row + b * plane);
        }
      }
    }
  }

  /// Where a pixel of the zone gets one drop more, or (turn: all ones) where it gets none.
  static void set_extra(const DropLine& line, const DropZone& zone, std::uint64_t shift, std::uint64_t begin, std::uint64_t end,
                        std::uint64_t turn, std::uint64_t allowed, std::uint64_t* row) {
    if (zone.extra == DropZone::Extra::kTile) {
      const std::uint64_t* const tile = line.patterns->tile_row(zone, line.row);
      // Bit b of the row is column b - shift of the tile.
      const std::uint64_t by = shift % 64;
      const bool swapped = (shift & 64) != 0;
      const std::uint64_t low = (swapped ? tile[1] : tile[0]) ^ turn, high = (swapped ? tile[0] : tile[1]) ^ turn;
      const std::uint64_t even = low << by | high >> 1 >> (63 - by), odd = high << by | low >> 1 >> (63 - by);
      return set_pattern(row, begin, end, even & allowed, odd & allowed, 64);
    }
    const CorePattern& core = line.patterns->core;
    const std::uint32_t first = core.of_row(line.row) - static_cast<std::uint32_t>(shift) * core.column_step;
    set_core(row, begin, end, first, core, allowed, 64);
  }

  /// Which nozzles of a word fire at steps of a residue.
  void mark_residues() {
    const std::uint32_t ticks = grid_.steps_per_pixel;
    if (ticks == 1) return;
    scratch_.of_residue.assign(std::size_t{grid_.words()} * ticks, 0);
    for (std::uint32_t i = 0; i < grid_.nozzles; ++i) {
      const std::uint32_t bit = i ^ grid_.bit_order;
      scratch_.of_residue[std::size_t{bit} / 64 * ticks + grid_.lag[i] % ticks] |= std::uint64_t{1} << (bit % 64);
    }
  }

  /// Writes a word of the vectors of 64 steps of a residue.
  template <class Transpose>
  LAMINA_BODY void put(std::uint32_t word, std::uint32_t residue, std::uint64_t q, std::uint64_t b, Transpose transpose) {
    const std::uint32_t ticks = grid_.steps_per_pixel;
    const std::uint64_t* const rows = scratch_.rows.data() + (word * block_ + b) * 64;
    alignas(64) std::uint64_t square[64];
    std::uint64_t any = 0, drops = 0;
    if (ticks == 1) {
      for (std::uint32_t i = 0; i < 64; ++i) any |= square[i] = rows[i];
    } else {
      const std::uint64_t here = scratch_.of_residue[std::size_t{word % grid_.words()} * ticks + residue];
      for (std::uint32_t i = 0; i < 64; ++i) any |= square[i] = rows[i] & (0 - (here >> i & 1));
    }
    if (any != 0) {
      transpose(square);
      for (std::uint32_t i = 0; i < 64; ++i) drops += static_cast<std::uint64_t>(std::popcount(square[i]));
      fired_.drops += drops << (word / grid_.words());
    }
    const std::uint64_t step = (q + 64 * b) * ticks + residue - vectors_.first_step;  // before the first step: very large
    const std::size_t stride = std::size_t{ticks} * vectors_.words;
    std::uint64_t* const out = vectors_.bits.data() + word;
    if (step < vectors_.steps && vectors_.steps - step > 63 * ticks) {
      std::uint64_t* at = out + step * vectors_.words;
      for (std::uint32_t k = 0; k < 64; ++k, at += stride) *at = square[k];  // all 0 where none is set
      return;
    }
    for (std::uint64_t k = 0; k < 64; ++k) {
      if (const std::uint64_t s = step + k * ticks; s < vectors_.steps) out[s * vectors_.words] = square[k];
    }
  }

  /// Appends those of the steps [from, to) that fire.
  void add_firing(std::uint64_t from, std::uint64_t to) {
    from = std::max<std::uint64_t>(from, vectors_.first_step);
    to = std::min<std::uint64_t>(to, std::uint64_t{vectors_.first_step} + vectors_.steps);
    const std::uint64_t* vector = vectors_.bits.data() + (from - vectors_.first_step) * vectors_.words;
    for (std::uint64_t s = from; s < to; ++s, vector += vectors_.words) {
      std::uint64_t any = 0;
      for (std::uint32_t w = 0; w < vectors_.words; ++w) any |= vector[w];
      if (any == 0) continue;
      const auto step = static_cast<std::uint32_t>(s - vectors_.first_step);
      if (!vectors_.firing.empty() && vectors_.firing.back() == step) {
        ++vectors_.firing.back();
      } else {
        vectors_.firing.push_back(step);
        vectors_.firing.push_back(step + 1);
      }
    }
  }

  const HeadGrid& grid_;
  std::span<const DropLine> line_;
  std::uint32_t first_;
  DropScratch& scratch_;
  SweepVectors& vectors_;
  FiredDrops& fired_;
  std::size_t block_ = 1;  // words of a row that are held
};

void make_plain(DropSweep& sweep) { sweep.make(transpose_64x64); }
#if defined(LAMINA_WIDE_KERNELS)
LAMINA_AVX2 void make_avx2(DropSweep& sweep) { sweep.make(transpose_64x64); }
LAMINA_AVX512 void make_avx512(DropSweep& sweep) { sweep.make(transpose_64x64_avx512); }
#endif

auto make_kernel() {
#if defined(LAMINA_WIDE_KERNELS)
  if (widest_isa() == Isa::kAvx512) return make_avx512;
  if (widest_isa() == Isa::kAvx2) return make_avx2;
#endif
  return make_plain;
}

}  // namespace

bool fire_drops(const HeadGrid& grid, std::span<const DropLine> line, std::uint32_t first, DropScratch& scratch,
                SweepVectors& vectors, FiredDrops& fired) {
  vectors.words = grid.words() * grid.drop_bits;
  vectors.firing.clear();
  DropSweep sweep(grid, line, first, scratch, vectors, fired);
  if (!sweep.measure()) {
    vectors.first_step = vectors.steps = 0;
    vectors.bits.clear();
    return false;
  }
  make_kernel()(sweep);
  return true;
}

}  // namespace lamina::program
