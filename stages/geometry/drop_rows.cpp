#include "stages/geometry/drop_rows.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cstring>
#include <utility>

#include "stages/geometry/isa.h"
#include "stages/geometry/targets.h"

namespace lamina {
namespace {

// The values of a word's first pixel are sorted into intervals, in which at most two bits of the word turn: between bits that
// pass the threshold, as between those that pass 0, multiples of the step are farther apart than an interval.
constexpr unsigned kCoreBits = 9;
constexpr std::uint32_t kCoreInterval = 1u << (32 - kCoreBits);

/// Bit i: whether value + i * step is below the threshold.
std::uint64_t core_bits(std::uint32_t value, std::uint32_t step, std::uint32_t threshold) {
  std::uint64_t bits = 0;
  for (std::uint32_t i = 0; i < 64; ++i, value += step) bits |= std::uint64_t{value < threshold} << i;
  return bits;
}

LAMINA_BODY std::uint64_t word_of(const CoreWord& of, std::uint32_t value) {
  const std::uint64_t first = value >= of.turn[0] ? 1 : 0, second = value >= of.turn[1] ? 1 : 0;
  return of.bits ^ first << of.bit[0] ^ second << of.bit[1];
}
LAMINA_BODY std::uint64_t core_word(const CorePattern& core, std::uint32_t value) {
  if (core.words.empty()) return core_bits(value, core.column_step, core.threshold);
  return word_of(core.words[value / kCoreInterval], value);
}

/// Calls take(word, bits) for the words of the bits [begin, end) of a row, of which bit b has the value first + b *
/// column_step.
template <class Take>
LAMINA_BODY void for_core_words(const CorePattern& core, std::uint64_t begin, std::uint64_t end, std::uint32_t first,
                                Take take) {
  const std::uint64_t last = (end - 1) / 64;
  const std::uint32_t step = 64 * core.column_step;
  std::uint64_t word = begin / 64, mask = ~std::uint64_t{0} << (begin % 64);
  for (std::uint32_t value = first + static_cast<std::uint32_t>(word) * step; word < last; ++word, value += step) {
    take(word, core_word(core, value) & mask);
    mask = ~std::uint64_t{0};
  }
  mask &= ~std::uint64_t{0} >> (63 - (end - 1) % 64);
  take(last, core_word(core, first + static_cast<std::uint32_t>(last) * step) & mask);
}

LAMINA_BODY std::uint64_t count_body(const CorePattern& core, std::uint64_t begin, std::uint64_t end, std::uint32_t first) {
  std::uint64_t count = 0;
  for_core_words(core, begin, end, first,
                 [&](std::uint64_t, std::uint64_t bits) { count += static_cast<std::uint64_t>(std::popcount(bits)); });
  return count;
}
std::uint64_t count_plain(const CorePattern& core, std::uint64_t begin, std::uint64_t end, std::uint32_t first) {
  return count_body(core, begin, end, first);
}
#if defined(LAMINA_WIDE_KERNELS)
LAMINA_AVX2 std::uint64_t count_avx2(const CorePattern& core, std::uint64_t begin, std::uint64_t end, std::uint32_t first) {
  return count_body(core, begin, end, first);
}
#endif
auto count_kernel() {
#if defined(LAMINA_WIDE_KERNELS)
  if (widest_isa() >= Isa::kAvx2) return count_avx2;
#endif
  return count_plain;
}

}  // namespace

void tabulate(CorePattern& core) {
  if (!core.words.empty() && core.words_step == core.column_step && core.words_threshold == core.threshold) return;
  core.words_step = core.column_step, core.words_threshold = core.threshold;
  core.words.resize(std::size_t{1} << kCoreBits);
  for (std::uint32_t i = 0; i < core.words.size(); ++i) {
    const std::uint32_t first = i * kCoreInterval, last = first + (kCoreInterval - 1);
    CoreWord& word = core.words[i];
    word = {core_bits(first, core.column_step, core.threshold), {first, first}, {0, 0}};
    std::size_t turns = 0;
    for (std::uint32_t bit = 0; bit < 64; ++bit) {
      for (const std::uint32_t at : {0 - bit * core.column_step, core.threshold - bit * core.column_step}) {
        if (at <= first || at > last) continue;
        if (turns == 2) return core.words.clear();  // a step of other multiples: no table
        word.turn[turns] = at, word.bit[turns++] = static_cast<std::uint8_t>(bit);
      }
    }
    if (turns == 1) word.bits ^= 1;  // the other one always turns bit 0
  }
}

void set_core(std::uint64_t* row, std::uint64_t begin, std::uint64_t end, std::uint32_t first, const CorePattern& core,
              std::uint64_t allowed, std::size_t stride) {
  if (begin >= end) return;
  for_core_words(core, begin, end, first,
                 [&](std::uint64_t word, std::uint64_t bits) { row[word * stride] |= bits & allowed; });
}

std::uint64_t extra_bits(const DropPatterns& patterns, const DropZone& zone, std::uint32_t row, std::uint32_t word) {
  if (zone.extra == DropZone::Extra::kNone) return 0;
  if (zone.extra == DropZone::Extra::kTile) return patterns.tile_row(zone, row)[word % 2];
  const CorePattern& core = patterns.core;
  return core_word(core, core.of_row(row) + 64 * word * core.column_step);
}

/// Sets the bits of a run of a zone.
void DropPlane::add(const DropZone& zone, std::uint32_t row, std::uint32_t begin, std::uint32_t end,
                    std::uint64_t* words) const {
  const DropPatterns& patterns = *image_.patterns;
  if (zone.base > drop_) {
    set_pattern(words, begin, end, ~std::uint64_t{0}, ~std::uint64_t{0});
  } else if (zone.base == drop_ && zone.extra == DropZone::Extra::kTile) {
    const std::uint64_t* const tile = patterns.tile_row(zone, row);
    set_pattern(words, begin, end, tile[0], tile[1]);
  } else if (zone.base == drop_ && zone.extra == DropZone::Extra::kCore) {
    const CorePattern& core = patterns.core;
    set_core(words, begin, end, core.of_row(row), core, ~std::uint64_t{0});
  }
}

void DropPlane::row(std::uint32_t number, std::span<std::uint64_t> words) const {
  const LevelsView& zones = image_.zones;
  std::ranges::fill(words, 0);
  for (std::size_t i = zones.row_offset[number]; i < zones.row_offset[number + 1]; ++i)
    add(image_.patterns->zone[zones.level[i]], number, zones.change[2 * i], zones.change[2 * i + 1], words.data());
}

namespace {

/// A row of words from its runs; spans that are nearer than a few words are one.
struct SpanWriter {
  std::uint64_t* words;
  Buffer<RowSpan>& spans;
  std::size_t at = 0;  // the word that is being made, of the last span
  std::uint64_t word = 0;
  bool any = false;

  void start(std::size_t first) {
    constexpr std::size_t kNear = 4;
    if (any && first == at) return;
    end();
    if (any && at + 1 + kNear >= first) {
      for (std::size_t w = at + 1; w < first; ++w) words[w] = 0;
    } else {
      spans.push_back({first, first});
    }
    at = first, word = 0, any = true;
  }
  /// of(word)  its bits
  template <class Bits>
  LAMINA_BODY void put(std::uint32_t begin, std::uint32_t end, const Bits& of) {
    const std::size_t first = begin / 64, last = (std::size_t{end} - 1) / 64;
    start(first);
    const std::uint64_t head = ~std::uint64_t{0} << begin % 64, tail = ~std::uint64_t{0} >> (63 - (end - 1) % 64);
    if (first == last) {
      word |= of(first) & head & tail;
      return;
    }
    words[first] = word | (of(first) & head);
    for (std::size_t w = first + 1; w < last; ++w) words[w] = of(w);
    at = last, word = of(last) & tail;
  }
  void end() {
    if (!any) return;
    words[at] = word;
    spans.back().end = at + 1;
  }
};

LAMINA_BODY void set_words_body(const DropImageView& image, std::uint32_t drop, std::uint32_t row, SpanWriter writer) {
  const LevelsView& zones = image.zones;
  const DropPatterns& patterns = *image.patterns;
  const CorePattern& core = patterns.core;
  const std::uint32_t value = core.of_row(row), step = 64 * core.column_step;
  const CoreWord* const table = core.words.empty() ? nullptr : core.words.data();
  for (std::size_t i = zones.row_offset[row]; i < zones.row_offset[row + 1]; ++i) {
    const DropZone& zone = patterns.zone[zones.level[i]];
    const std::uint32_t begin = zones.change[2 * i], end = zones.change[2 * i + 1];
    if (zone.base > drop) {
      writer.put(begin, end, [](std::size_t) { return ~std::uint64_t{0}; });
    } else if (zone.base == drop && zone.extra == DropZone::Extra::kTile) {
      const std::uint64_t* const tile = patterns.tile_row(zone, row);
      writer.put(begin, end, [&](std::size_t word) { return tile[word % 2]; });
    } else if (zone.base == drop && zone.extra == DropZone::Extra::kCore) {
      writer.put(begin, end, [&](std::size_t word) {
        const std::uint32_t first = value + static_cast<std::uint32_t>(word) * step;
        return table == nullptr ? core_bits(first, core.column_step, core.threshold)
                                : word_of(table[first / kCoreInterval], first);
      });
    }
  }
  writer.end();
}
void set_words_plain(const DropImageView& image, std::uint32_t drop, std::uint32_t row, const SpanWriter& writer) {
  set_words_body(image, drop, row, writer);
}
#if defined(LAMINA_WIDE_KERNELS)
LAMINA_AVX2 void set_words_avx2(const DropImageView& image, std::uint32_t drop, std::uint32_t row, const SpanWriter& writer) {
  set_words_body(image, drop, row, writer);
}
#endif
auto set_words_kernel() {
#if defined(LAMINA_WIDE_KERNELS)
  if (widest_isa() >= Isa::kAvx2) return set_words_avx2;
#endif
  return set_words_plain;
}

}  // namespace

void DropPlane::set_words(std::uint32_t number, std::span<std::uint64_t> words, Buffer<RowSpan>& spans) const {
  set_words_kernel()(image_, drop_, number, {words.data(), spans});
}

void DropPlane::spans(std::uint32_t number, WordSpans& spans) const {
  const LevelsView& zones = image_.zones;
  const DropPatterns& patterns = *image_.patterns;
  spans.span.clear(), spans.mixed.clear();
  const std::uint32_t run = zones.row_offset[number], end_run = zones.row_offset[number + 1];
  if (run == end_run) return;
  constexpr std::uint64_t kFull = ~std::uint64_t{0};
  std::array<std::array<std::uint64_t, 2>, 256> pattern_of;  // by level
  for (std::size_t level = 0; level < patterns.zone.size(); ++level) {
    const DropZone& zone = patterns.zone[level];
    pattern_of[level] = zone.base > drop_ ? std::array{kFull, kFull} : std::array{std::uint64_t{0}, std::uint64_t{0}};
    if (zone.base != drop_ || zone.extra != DropZone::Extra::kTile) continue;
    std::copy_n(patterns.tile_row(zone, number), 2, pattern_of[level].begin());
  }
  std::uint32_t at = 0;  // the word that is being made
  std::uint64_t word = 0;
  for (std::uint32_t i = run; i < end_run; ++i) {
    const std::array<std::uint64_t, 2>& pattern = pattern_of[zones.level[i]];
    const std::uint32_t begin = zones.change[2 * std::size_t{i}], end = zones.change[2 * std::size_t{i} + 1];
    const std::uint32_t first = begin / 64, last = (end - 1) / 64;
    const std::uint64_t head = ~std::uint64_t{0} << begin % 64, tail = ~std::uint64_t{0} >> (63 - (end - 1) % 64);
    if (first != at) spans.add(std::exchange(at, first), std::exchange(word, 0));
    if (first == last) {
      word |= head & tail & pattern[first % 2];
      continue;
    }
    spans.add(first, word | (head & pattern[first % 2]));
    if ((pattern[0] & pattern[1]) == kFull) {
      spans.add_span(first + 1, last, true);
    } else if ((pattern[0] | pattern[1]) != 0) {
      for (std::uint32_t w = first + 1; w < last; ++w) spans.add(w, pattern[w % 2]);
    }
    at = last;
    word = tail & pattern[last % 2];
  }
  spans.add(at, word);
}

namespace {

/// A row of runs while it is made; the last run is open.
struct RowWriter {
  std::uint32_t* change;
  std::uint64_t set = 0;  // 1: the last pixel so far
  std::uint32_t end = 0;  // one past it

  void start(std::uint32_t begin) {
    if (begin == end) return;
    *change = end;
    change += set;
    set = 0;
  }
  void put(std::uint32_t begin, std::uint32_t stop) {
    start(begin);
    *change = begin;
    change += 1 - set;
    set = 1;
    end = stop;
  }
  /// bits_of(word)  the pixels of a word that are set
  template <class Bits>
  void put_bits(std::uint32_t begin, std::uint32_t stop, const Bits& bits_of) {
    start(begin);
    const std::uint32_t last = (stop - 1) / 64;
    for (std::uint32_t word = begin / 64; word <= last; ++word) {
      const std::uint64_t bits = bits_of(word);
      const std::uint32_t first = word == begin / 64 ? begin % 64 : 0;
      std::uint64_t turns = bits ^ bits << 1;
      turns ^= (((bits << 1) >> first & 1) ^ set) << first;  // the pixel before the first one
      turns &= ~std::uint64_t{0} << first;
      if (word == last) turns &= ~std::uint64_t{0} >> (63 - (stop - 1) % 64);
      for (; turns != 0; turns &= turns - 1) *change++ = 64 * word + static_cast<std::uint32_t>(std::countr_zero(turns));
      set = bits >> (word == last ? (stop - 1) % 64 : 63) & 1;
    }
    end = stop;
  }
};

}  // namespace

void runs_of(const DropImageView& image, std::uint32_t drop, Runs& result) {
  const LevelsView& zones = image.zones;
  result.columns = zones.columns;
  result.row_offset.assign(1, 0);
  std::size_t used = 0;
  for (std::uint32_t row = 0; row < zones.rows(); ++row) {
    const std::uint32_t first = zones.row_offset[row], last = zones.row_offset[row + 1];
    if (const std::size_t maximum = used + zones.columns + 2; first < last && result.change.size() < maximum)
      result.change.resize(std::max({2 * result.change.size(), result.change.capacity(), maximum}));
    RowWriter writer{result.change.data() + used};
    for (std::uint32_t i = first; i < last; ++i) {
      const DropZone& zone = image.patterns->zone[zones.level[i]];
      const std::uint32_t begin = zones.change[2 * std::size_t{i}], end = zones.change[2 * std::size_t{i} + 1];
      if (zone.base > drop) {
        writer.put(begin, end);
      } else if (zone.base == drop && zone.extra != DropZone::Extra::kNone) {
        writer.put_bits(begin, end, [&](std::uint32_t word) { return extra_bits(*image.patterns, zone, row, word); });
      }
    }
    if (writer.set != 0) *writer.change++ = writer.end;
    used = first < last ? static_cast<std::size_t>(writer.change - result.change.data()) : used;
    result.row_offset.push_back(static_cast<std::uint32_t>(used));
  }
  result.change.resize(used);
}

void levels_of(const DropImageView& image, Levels& result) {
  const LevelsView& zones = image.zones;
  result.start(zones.columns);
  for (std::uint32_t row = 0; row < zones.rows(); ++row) {
    for (std::uint32_t i = zones.row_offset[row]; i < zones.row_offset[row + 1]; ++i) {
      const DropZone& zone = image.patterns->zone[zones.level[i]];
      std::uint32_t begin = zones.change[2 * std::size_t{i}];
      const std::uint32_t end = zones.change[2 * std::size_t{i} + 1];
      if (zone.extra == DropZone::Extra::kNone) {
        result.append(begin, end, zone.base);
        continue;
      }
      while (begin < end) {
        const std::uint64_t left = extra_bits(*image.patterns, zone, row, begin / 64) >> (begin % 64);
        const bool more = (left & 1) != 0;
        const auto same = static_cast<std::uint32_t>(more ? std::countr_one(left) : std::countr_zero(left));
        const std::uint32_t stop = std::min({end, begin + same, (begin / 64 + 1) * 64});
        result.append(begin, stop, static_cast<std::uint8_t>(zone.base + (more ? 1 : 0)));
        begin = stop;
      }
    }
    result.end_row();
  }
}

void DropCounter::start(const DropPatterns& patterns) {
  patterns_ = &patterns;
  const std::size_t rows = patterns.tile.size() / 2;
  before_.resize(rows * kRow);
  for (std::size_t row = 0; row < rows; ++row) {
    std::uint8_t* const before = before_.data() + row * kRow;
    std::uint64_t count = 0;  // eight columns at once: a bit becomes a byte, and a product their sums
    constexpr std::uint64_t kOnes = 0x0101'0101'0101'0101, kDiagonal = 0x8040'2010'0804'0201;
    for (std::uint32_t c = 0; c < kTileSide; c += 8) {
      const std::uint64_t bits = patterns.tile[2 * row + c / 64] >> c % 64 & 255;
      const std::uint64_t ones = ((bits * kOnes & kDiagonal) + 127 * kOnes) >> 7 & kOnes;
      std::uint64_t sums = count * kOnes + (ones * kOnes << 8);
      count += static_cast<std::uint64_t>(std::popcount(bits));
      if constexpr (std::endian::native == std::endian::big) sums = __builtin_bswap64(sums);
      std::memcpy(before + c, &sums, sizeof sums);
    }
    before[kTileSide] = static_cast<std::uint8_t>(count);
  }
}

std::uint64_t DropCounter::extra(std::uint8_t zone, std::uint32_t row, std::uint32_t begin, std::uint32_t end) const {
  const DropZone& of = patterns_->zone[zone];
  if (of.extra == DropZone::Extra::kNone || begin >= end) return 0;
  if (of.extra == DropZone::Extra::kCore) {
    const CorePattern& core = patterns_->core;
    return count_kernel()(core, begin, end, core.of_row(row));
  }
  return between(before(zone, row), begin, end);
}

const std::uint8_t* DropCounter::before(std::uint8_t zone, std::uint32_t row) const {
  static constexpr std::array<std::uint8_t, kRow> kNone{};
  const DropZone& of = patterns_->zone[zone];
  if (of.extra == DropZone::Extra::kCore) return nullptr;
  if (of.extra == DropZone::Extra::kNone) return kNone.data();
  return before_.data() + (of.tile * std::size_t{kTileSide} + row % kTileSide) * kRow;
}

DropTotals::DropTotals(const DropImageView& image, const DropCounter& counter) {
  for (const DropZone& zone : image.patterns->zone) zones_.push_back({zone});
  const LevelsView& zones = image.zones;
  std::array<const std::uint8_t*, 256> before;
  ZoneTotal* const totals = zones_.data();
  for (std::uint32_t row = 0; row < zones.rows(); ++row) {
    const std::size_t first = zones.row_offset[row], last = zones.row_offset[row + 1];
    for (std::size_t z = 0; z < zones_.size() && first < last; ++z)
      before[z] = counter.before(static_cast<std::uint8_t>(z), row);
    for (std::size_t i = first; i < last; ++i) {
      const std::uint32_t begin = zones.change[2 * i], end = zones.change[2 * i + 1];
      const std::uint8_t level = zones.level[i], *const of_row = before[level];
      totals[level].pixels += end - begin;
      totals[level].extra +=
          of_row != nullptr ? DropCounter::between(of_row, begin, end) : counter.extra(level, row, begin, end);
    }
  }
}

std::uint64_t DropTotals::drops() const {
  std::uint64_t drops = 0;
  for (const ZoneTotal& of : zones_) drops += of.zone.base * of.pixels + of.extra;
  return drops;
}

std::uint64_t DropTotals::pixels(std::uint32_t drop) const {
  std::uint64_t pixels = 0;
  for (const ZoneTotal& of : zones_) pixels += of.zone.base > drop ? of.pixels : of.zone.base == drop ? of.extra : 0;
  return pixels;
}

std::uint32_t DropTotals::maximum() const {
  std::uint32_t maximum = 0;
  for (const ZoneTotal& of : zones_) {
    if (of.pixels > 0) maximum = std::max(maximum, of.zone.base + (of.extra > 0 ? 1u : 0u));
  }
  return maximum;
}

}  // namespace lamina
