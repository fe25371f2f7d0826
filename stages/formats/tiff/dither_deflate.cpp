#include "stages/formats/tiff/dither_deflate.h"

#include <algorithm>
#include <bit>
#include <cstring>

namespace lamina::formats::tiff {
namespace {

constexpr std::size_t kDistance = 16;
static_assert(std::endian::native == std::endian::little);

std::uint64_t word_at(const std::byte* at) {
  std::uint64_t word = 0;
  std::memcpy(&word, at, sizeof word);
  return word;
}

/// Bytes from `at` on, before `end`, that are those 16 before them.
std::size_t repeats(const std::byte* at, const std::byte* end) {
  const std::byte* const begin = at;
  for (; end - at >= 8; at += 8) {
    const std::uint64_t differs = word_at(at) ^ word_at(at - kDistance);
    if (differs != 0) return static_cast<std::size_t>(at - begin) + static_cast<std::size_t>(std::countr_zero(differs)) / 8;
  }
  while (at < end && *at == *(at - kDistance)) ++at;
  return static_cast<std::size_t>(at - begin);
}

/// Of RFC 1950: a sum of bytes, and the sum of its values on the way, both modulo 65521. In columns, which compilers vectorise.
std::uint32_t adler_of(std::span<const std::byte> bytes) {
  constexpr std::uint64_t kModulus = 65'521;
  constexpr std::size_t kColumns = 32, kRows = 64, kBlock = kColumns * kRows;
  std::uint64_t sum = 1, sums = 0;
  const auto* at = reinterpret_cast<const std::uint8_t*>(bytes.data());
  std::size_t left = bytes.size();
  for (; left >= kBlock; left -= kBlock, at += kBlock) {
    std::array<std::uint16_t, kColumns> column{};
    std::array<std::uint32_t, kColumns> above{};  // sums of the column's values before each row
    for (std::size_t r = 0; r < kRows; ++r) {
      for (std::size_t c = 0; c < kColumns; ++c) above[c] += column[c];
      for (std::size_t c = 0; c < kColumns; ++c) column[c] = static_cast<std::uint16_t>(column[c] + at[r * kColumns + c]);
    }
    std::uint64_t total = 0;
    sums += kBlock * sum;
    for (std::size_t c = 0; c < kColumns; ++c) {
      total += column[c];
      sums += std::uint64_t{kColumns} * above[c] + (kColumns - c) * column[c];
    }
    sum = (sum + total) % kModulus;
    sums %= kModulus;
  }
  for (; left > 0; --left) sums += sum += *at++;
  return static_cast<std::uint32_t>(sums % kModulus << 16 | sum % kModulus);
}

}  // namespace

void DitherDeflate::find_pieces(std::span<const std::byte> bytes) {
  pieces_.clear();
  std::array<std::array<std::uint32_t, 256>, 4> counts{};
  const std::byte* const end = bytes.data() + bytes.size();
  const std::byte *literals = bytes.data(), *at = literals + std::min(kDistance, bytes.size());
  weights_.fill(1);
  while (true) {
    while (end - at >= 8 && word_at(at) != word_at(at - kDistance)) at += 8;
    if (end - at < 8) at = end;
    const std::size_t ahead = repeats(at, end);
    const std::byte* begin = at;  // of the match
    if (ahead > 0) {
      while (begin > literals && begin - bytes.data() > std::ptrdiff_t{kDistance} && *(begin - 1) == *(begin - 1 - kDistance))
        --begin;
    }
    const auto length = static_cast<std::uint32_t>(at + ahead - begin);
    pieces_.push_back({static_cast<std::uint32_t>(begin - literals), length});
    const std::byte* literal = literals;
    for (; begin - literal >= 4; literal += 4) {
      for (std::size_t i = 0; i < 4; ++i) ++counts[i][static_cast<std::uint8_t>(literal[i])];
    }
    for (; literal < begin; ++literal) ++counts[0][static_cast<std::uint8_t>(*literal)];
    count_match(length, weights_);
    at += ahead;
    literals = at;
    if (at == end) break;
  }
  for (std::size_t b = 0; b < 256; ++b) weights_[b] += counts[0][b] + counts[1][b] + counts[2][b] + counts[3][b];
}

std::size_t DitherDeflate::compress(std::span<const std::byte> bytes, std::byte* out) {
  find_pieces(bytes);
  code_.make(weights_);
  png::BitWriter writer = code_.start(out);
  const std::byte* at = bytes.data();
  for (const Piece& piece : pieces_) {
    code_.put(at, piece.literals, writer);
    at += piece.literals + piece.match;
    const std::uint32_t left = code_.put_match(piece.match, writer);
    code_.put(at - left, left, writer);
  }
  return static_cast<std::size_t>(code_.finish(adler_of(bytes), writer) - out);
}

}  // namespace lamina::formats::tiff
