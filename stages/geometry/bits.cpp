#include "stages/geometry/bits.h"

#include <algorithm>
#include <bit>
#include <cstring>

#include "stages/geometry/isa.h"
#include "stages/geometry/targets.h"

namespace lamina {
namespace {

std::uint64_t load_word(const std::byte* at, std::size_t bytes) {
  std::uint64_t word = 0;
  std::memcpy(&word, at, bytes);
  if constexpr (std::endian::native == std::endian::little) word = __builtin_bswap64(word);
  return word;
}

std::uint64_t turn_word(std::uint64_t word) { return turn_bytes(__builtin_bswap64(word)); }

/// Sets the bits first .. last of a row.
void set_run(std::uint32_t first, std::uint32_t last, std::byte* bytes) {
  const std::size_t first_byte = first / 8, last_byte = last / 8;
  const auto head = static_cast<std::byte>(0xFFu >> (first & 7));
  const auto tail = static_cast<std::byte>(0xFF00u >> ((last & 7) + 1));
  if (first_byte == last_byte) {
    bytes[first_byte] |= head & tail;
    return;
  }
  bytes[first_byte] |= head;
  bytes[last_byte] |= tail;
  std::memset(bytes + first_byte + 1, 0xFF, last_byte - first_byte - 1);
}

/// Changes of a row of words, with the pixel before the first one clear. returns  one past the last one written
std::uint32_t* put_changes(std::span<const std::uint64_t> words, std::uint32_t columns, std::uint32_t* next) {
  std::uint64_t before = 0;  // the pixel to the left, in the lowest bit
  std::uint32_t column = 0;
  for (const std::uint64_t word : words) {
    std::uint64_t changes = word ^ (word << 1 | before);
    before = word >> 63;
    if (column + 64 > columns && columns % 64 != 0) changes &= (std::uint64_t{1} << columns % 64) - 1;
    for (; changes != 0; changes &= changes - 1) *next++ = column + static_cast<std::uint32_t>(std::countr_zero(changes));
    column += 64;
  }
  const bool last = columns % 64 == 0 ? before != 0 : !words.empty() && (words.back() >> (columns - 1) % 64 & 1) != 0;
  if (last) *next++ = columns;
  return next;
}

LAMINA_BODY void bits_body(std::span<const std::uint64_t> words, std::span<std::byte> row) {
  const std::uint64_t* from = words.data();
  std::byte *to = row.data(), *const whole = to + row.size() / 8 * 8;
  const auto word_of = [](std::uint64_t word) {
    word = turn_bytes(word);
    return std::endian::native == std::endian::big ? __builtin_bswap64(word) : word;
  };
  for (; to < whole; to += 8) {
    const std::uint64_t word = word_of(*from++);
    std::memcpy(to, &word, sizeof word);
  }
  if (row.size() % 8 == 0) return;
  const std::uint64_t word = word_of(*from);
  std::memcpy(to, &word, row.size() % 8);
}
void bits_plain(std::span<const std::uint64_t> words, std::span<std::byte> row) { bits_body(words, row); }
#if defined(LAMINA_WIDE_KERNELS)
LAMINA_AVX2 void bits_avx2(std::span<const std::uint64_t> words, std::span<std::byte> row) { bits_body(words, row); }
#endif
auto bits_kernel() {
#if defined(LAMINA_WIDE_KERNELS)
  if (widest_isa() >= Isa::kAvx2) return bits_avx2;
#endif
  return bits_plain;
}

}  // namespace

void expand_row(std::span<const std::uint32_t> change, std::span<std::byte> row) {
  std::memset(row.data(), 0, row.size());
  for (std::size_t i = 0; i + 1 < change.size(); i += 2) set_run(change[i], change[i + 1] - 1, row.data());
}

void add_runs(std::span<const std::uint32_t> change, std::span<std::uint64_t> words) {
  for (std::size_t i = 0; i + 1 < change.size(); i += 2) {
    const std::uint32_t begin = change[i], last = change[i + 1] - 1;
    const std::uint64_t head = ~std::uint64_t{0} << begin % 64, tail = ~std::uint64_t{0} >> (63 - last % 64);
    if (begin / 64 == last / 64) {
      words[begin / 64] |= head & tail;
      continue;
    }
    words[begin / 64] |= head;
    std::fill(words.begin() + begin / 64 + 1, words.begin() + last / 64, ~std::uint64_t{0});
    words[last / 64] |= tail;
  }
}

void bits_of_words(std::span<const std::uint64_t> words, std::span<std::byte> row) { bits_kernel()(words, row); }

void words_of_bits(std::span<const std::byte> row, std::uint32_t columns, std::uint64_t flip, std::span<std::uint64_t> words) {
  const std::size_t bytes = row_bytes(columns);
  for (std::size_t at = 0; at < bytes; at += 8)
    words[at / 8] = turn_word(load_word(row.data() + at, std::min<std::size_t>(8, bytes - at)) ^ flip);
  if (columns % 64 != 0) words[columns / 64] &= (std::uint64_t{1} << columns % 64) - 1;
}

void reverse_row(std::span<std::uint64_t> words, std::uint32_t columns) {
  std::ranges::reverse(words);
  for (std::uint64_t& word : words) word = turn_word(word);
  const std::uint32_t shift = (64 - columns % 64) % 64;
  for (std::size_t i = 0; shift != 0 && i < words.size(); ++i)
    words[i] = words[i] >> shift | (i + 1 < words.size() ? words[i + 1] << (64 - shift) : 0);
}

std::span<const std::uint32_t> RowRuns::read(std::uint32_t number) {
  Row& row = read_[number % 2];
  if (row.number != number) {
    words_.resize(bits_->words());
    row.change.resize(std::size_t{columns_} + 1);
    bits_->row(number, words_);
    row.used = static_cast<std::size_t>(put_changes(words_, columns_, row.change.data()) - row.change.data());
    row.number = number;
  }
  return std::span(row.change).first(row.used);
}

void RowBits::put(std::uint32_t number, std::span<std::byte> row) {
  if (bits_ == nullptr) return expand_row(runs_.row(number), row);
  bits_->row(number, words_);
  bits_of_words(words_, row);
}

void RowBits::put_set(std::uint32_t number, std::span<std::byte> row, Buffer<RowSpan>& spans) {
  constexpr std::size_t kNear = 32;  // bytes: spans that are nearer are one
  if (bits_ == nullptr) {
    const std::span<const std::uint32_t> change = runs_.row(number);
    const std::size_t before = spans.size();
    for (std::size_t i = 0; i + 1 < change.size(); i += 2) {
      const std::uint32_t begin = change[i], last = change[i + 1] - 1;
      set_run(begin, last, row.data());
      if (spans.size() == before || spans.back().end + kNear < begin / 8) spans.push_back({begin / 8, 0});
      spans.back().end = std::size_t{last} / 8 + 1;
    }
    return;
  }
  set_.clear();
  bits_->set_words(number, words_, set_);
  for (const RowSpan& words : set_) {
    const RowSpan bytes{8 * words.begin, std::min(8 * words.end, row.size())};
    bits_of_words(std::span(words_).subspan(words.begin), row.subspan(bytes.begin, bytes.end - bytes.begin));
    spans.push_back(bytes);
  }
}

PixelCounts counts_of(const BitRows& image) {
  PixelCounts counts;
  Buffer<std::uint64_t> words(image.words());
  for (std::uint32_t r = 0; r < image.rows(); ++r) {
    image.row(r, words);
    std::uint64_t before = 0;
    for (const std::uint64_t word : words) {
      counts.set += static_cast<std::uint64_t>(std::popcount(word));
      counts.changes += static_cast<std::uint64_t>(std::popcount(word ^ (word << 1 | before)));
      before = word >> 63;
    }
    // Behind the last column of a row that ends with its last word.
    if (image.columns() % 64 == 0) counts.changes += before;
  }
  return counts;
}

RunsBuilder::RunsBuilder(std::uint32_t columns, std::uint32_t rows, Keep keep) : keep_(keep), rows_(rows) {
  runs_.columns = columns;
  runs_.row_offset.push_back(0);
}

bool RunsBuilder::add_row(std::span<const std::byte> row, bool invert) {
  const std::uint32_t columns = runs_.columns;
  const std::uint64_t flip = invert ? ~std::uint64_t{0} : 0;
  if (bits_) {
    words_of_bits(row, columns, flip, bits_->row(next_++));
    return true;
  }
  // Rounded up to an even number a row has at most `columns` + 1 changes; growth keeps that much free.
  if (runs_.change.size() - used_ < std::size_t{columns} + 2) {
    runs_.change.resize(std::max(runs_.change.size() * 2, used_ + columns + 2));
  }
  std::uint32_t* next = runs_.change.data() + used_;
  std::uint64_t before = 0;  // the pixel to the left, in the highest bit
  for (std::uint32_t column = 0; column < columns; column += 64) {
    const std::uint32_t left = columns - column;
    std::uint64_t word = load_word(row.data() + column / 8, left >= 64 ? 8 : row_bytes(left)) ^ flip;
    if (left < 64) word &= ~(~std::uint64_t{0} >> left);
    std::uint64_t changes = word ^ (word >> 1 | before);
    before = word << 63;
    if (keep_ == Keep::kCounts) {
      counts_.set += static_cast<std::uint64_t>(std::popcount(word));
      counts_.changes += static_cast<std::uint64_t>(std::popcount(changes));
      continue;
    }
    while (changes != 0) {
      const int position = std::countl_zero(changes);
      *next++ = column + static_cast<std::uint32_t>(position);
      changes ^= std::uint64_t{1} << 63 >> position;
    }
  }
  if (before != 0 && keep_ != Keep::kCounts) *next++ = columns;
  if (before != 0 && keep_ == Keep::kCounts) ++counts_.changes;
  return end_row(static_cast<std::size_t>(next - runs_.change.data()));
}

bool RunsBuilder::add_changes(std::span<const std::uint32_t> change) {
  if (keep_ == Keep::kCounts) {
    for (std::size_t i = 0; i + 1 < change.size(); i += 2) counts_.set += change[i + 1] - change[i];
    counts_.changes += change.size();
    ++next_;
    return true;
  }
  if (bits_) {
    add_runs(change, bits_->row(next_++));
    return true;
  }
  if (runs_.change.size() - used_ < change.size()) {
    runs_.change.resize(std::max(runs_.change.size() * 2, used_ + change.size()));
  }
  std::ranges::copy(change, runs_.change.data() + used_);
  return end_row(used_ + change.size());
}

bool RunsBuilder::add_all(Runs& rows) {
  if (next_ == 0 && keep_ != Keep::kCounts) {
    next_ = rows.view().rows();
    used_ = rows.change.size();
    runs_ = std::move(rows);
    rows.row_offset = {};
    rows.change = {};
    keep_smaller();
    return true;
  }
  for (std::uint32_t r = 0; r < rows.view().rows(); ++r) {
    if (!add_changes(rows.view().row(r))) return false;
  }
  return true;
}

bool RunsBuilder::end_row(std::size_t used) {
  ++next_;
  if (keep_ == Keep::kCounts) return true;
  used_ = used;
  if (used_ > UINT32_MAX) return false;
  runs_.row_offset.push_back(static_cast<std::uint32_t>(used_));
  keep_smaller();
  return true;
}

void RunsBuilder::keep_smaller() {
  if (keep_ != Keep::kSmaller || 2 * sizeof(std::uint32_t) * used_ <= bytes_of_bits(runs_.columns, rows_)) return;
  bits_.emplace(runs_.columns, rows_);
  for (std::uint32_t r = 0; r < next_; ++r) add_runs(runs_.view().row(r), bits_->row(r));
  runs_.change = {};
  runs_.row_offset = {};
  used_ = 0;
}

Runs RunsBuilder::finish() {
  runs_.change.resize(used_);
  used_ = 0;
  return std::move(runs_);
}

}  // namespace lamina
