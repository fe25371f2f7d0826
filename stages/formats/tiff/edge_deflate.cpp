#include "stages/formats/tiff/edge_deflate.h"

#include <algorithm>
#include <bit>
#include <cstring>
#include <utility>

#include "stages/geometry/bits.h"

namespace lamina::formats::tiff {
namespace {

constexpr std::uint64_t kModulus = 65'521;
/// A match of fewer takes more bits than literals: 0 and 255 are the most frequent ones.
constexpr std::size_t kMinMatch = 6;
constexpr std::size_t kFar = 16;  // the width of the blue-noise tile in bytes
constexpr std::uint64_t kLarge = std::uint64_t{1} << 40;
static_assert(std::endian::native == std::endian::little);

/// Bytes of the word that are 0 from the lowest one on; not of 0.
std::size_t low_zeros(std::uint64_t word) { return static_cast<std::size_t>(std::countr_zero(word)) / 8; }

}  // namespace

EdgeDeflate::EdgeDeflate() {
  code_.add_distance(kFar);
  code_.add_distance(1);
}

void EdgeDeflate::start() {
  pieces_.clear();
  used_ = taken_ = equal_ = 0;
  sum_ = 1, sums_ = 0;
  counts_ = {};
}

void EdgeDeflate::add(const WordSpans& row, std::size_t bytes) {
  std::size_t at = 0;
  const std::uint64_t* mixed = row.mixed.data();
  for (const WordSpans::WordSpan& span : row.span) {
    const std::size_t begin = std::size_t{8} * span.first, end = std::min(std::size_t{8} * span.end, bytes);
    add_equal(false, begin - at);
    if (span.full) {
      add_equal(true, end - begin);
    } else {
      for (std::size_t byte = begin; byte < end; byte += 8, ++mixed) {
        const std::size_t count = std::min<std::size_t>(8, end - byte);
        byte >= begin + 16 && *mixed == mixed[-2] ? add_repeated(*mixed, count) : add_word(*mixed, count);
      }
    }
    at = end;
  }
  add_equal(false, bytes - at);
}

void EdgeDeflate::add_equal(bool full, std::size_t count) {
  if (count == 0) return;
  if (full != full_) end_equal();
  full_ = full;
  equal_ += count;
}

/// Equal bytes at both ends of a word join those before and behind it.
void EdgeDeflate::add_word(std::uint64_t word, std::size_t bytes) {
  const std::uint64_t ones = full_ ? ~std::uint64_t{0} : 0;
  const std::size_t head = equal_ > 0 && word != ones ? std::min(bytes, low_zeros(word ^ ones)) : 0;
  equal_ += head;
  if (head == bytes) return;
  const std::size_t shift = 64 - 8 * bytes;
  const std::uint64_t above = word << shift;
  const bool full = above >> 63 != 0;
  const std::uint64_t rest = full ? ~above : above;
  const std::size_t tail = std::min(bytes - head, static_cast<std::size_t>(std::countl_zero(rest)) / 8);
  if (const std::size_t middle = bytes - head - tail; middle > 0) {
    end_equal();
    put_literals(word >> 8 * head, middle);
  }
  add_equal(full, tail);
}

/// A word that is the one two before it.
void EdgeDeflate::add_repeated(std::uint64_t word, std::size_t bytes) {
  end_equal();
  if (taken_ == used_ && !pieces_.empty() && pieces_.back().far) {
    pieces_.back().match += static_cast<std::uint32_t>(bytes);
  } else if (bytes < kMinMatch) {
    return put_literals(word, bytes);
  } else {
    pieces_.push_back(
        {static_cast<std::uint32_t>(used_ - std::exchange(taken_, used_)), static_cast<std::uint32_t>(bytes), true});
  }
  const std::uint64_t turned = turn_bytes(word);
  sum(reinterpret_cast<const std::byte*>(&turned), bytes);
}

void EdgeDeflate::end_equal() {
  if (equal_ == 0) return;
  const std::uint64_t value = full_ ? 255 : 0, word = full_ ? ~std::uint64_t{0} : 0, match = std::exchange(equal_, 0) - 1;
  if (match < kMinMatch) return put_literals(word, match + 1);
  put_literals(word, 1);
  pieces_.push_back(
      {static_cast<std::uint32_t>(used_ - std::exchange(taken_, used_)), static_cast<std::uint32_t>(match), false});
  sums_ += match * sum_ + value * (match * (match + 1) / 2);
  sum_ += value * match;
  if (sum_ >= kLarge || sums_ >= kLarge) sum_ %= kModulus, sums_ %= kModulus;
}

void EdgeDeflate::sum(const std::byte* at, std::size_t count) {
  for (std::size_t i = 0; i < count; ++i) {
    sum_ += static_cast<std::uint8_t>(at[i]);
    sums_ += sum_;
  }
}

/// bytes  up to 8, the first one lowest, as bit_rows.h has their bits
void EdgeDeflate::put_literals(std::uint64_t bytes, std::size_t count) {
  if (literals_.size() < used_ + 8) literals_.resize(2 * used_ + 64);
  std::byte* const to = literals_.data() + used_;
  const std::uint64_t word = turn_bytes(bytes);
  std::memcpy(to, &word, sizeof word);
  for (std::size_t i = 0; i < count; ++i) ++counts_[i % 2][static_cast<std::uint8_t>(to[i])];
  sum(to, count);
  used_ += count;
}

std::size_t EdgeDeflate::finish(std::byte* out) {
  end_equal();
  StripWeights weights;
  weights.fill(1);
  for (const EdgePiece& piece : pieces_) count_whole_match(piece.match, weights);
  for (std::size_t b = 0; b < 256; ++b) weights[b] += counts_[0][b] + counts_[1][b];
  code_.make(weights);
  png::BitWriter writer = code_.start(out);
  const std::byte* at = literals_.data();
  for (const EdgePiece& piece : pieces_) {
    code_.put(at, piece.literals, writer);
    code_.put_whole_match(piece.match, piece.far ? 0 : 1, writer);
    at += piece.literals;
  }
  code_.put(at, used_ - taken_, writer);
  const auto adler = static_cast<std::uint32_t>(sums_ % kModulus << 16 | sum_ % kModulus);
  return static_cast<std::size_t>(code_.finish(adler, writer) - out);
}

}  // namespace lamina::formats::tiff
