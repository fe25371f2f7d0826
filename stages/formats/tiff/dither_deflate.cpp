#include "stages/formats/tiff/dither_deflate.h"

#include <algorithm>
#include <bit>
#include <cstring>

namespace lamina::formats::tiff {
namespace {

using png::BitString;
using png::BitWriter;

constexpr std::size_t kDistance = 16, kMaxCode = 15;
constexpr std::uint32_t kDistanceSymbol = 7, kDistanceExtra = 3, kDistanceExtraBits = 2;  // of 13 to 16
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

/// As png::word_lengths() of at most 15 bits: weights are flattened until that is so.
std::array<std::uint8_t, png::kSymbols> code_lengths(std::array<std::uint32_t, png::kSymbols> weights) {
  while (true) {
    const auto lengths = png::word_lengths(weights);
    if (*std::ranges::max_element(lengths) <= kMaxCode) return lengths;
    for (std::uint32_t& weight : weights) weight = (weight + 1) / 2 + 1;
  }
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
    if (length > 0) {
      weights_[285] += length / png::kLongestMatch;
      const std::uint32_t rest = length % png::kLongestMatch;
      if (rest >= png::kShortestMatch) ++weights_[png::length_class(rest).symbol];
    }
    at += ahead;
    literals = at;
    if (at == end) break;
  }
  for (std::size_t b = 0; b < 256; ++b) weights_[b] += counts[0][b] + counts[1][b] + counts[2][b] + counts[3][b];
}

void DitherDeflate::make_code() {
  lengths_ = code_lengths(weights_);
  const auto words = png::words_of(lengths_);
  for (std::size_t b = 0; b < 256; ++b) byte_[b] = words[b];
  end_ = words[png::kEndOfBlock];
  constexpr BitString kBack(kDistanceExtra << 1, 1 + kDistanceExtraBits);  // the only distance has the word 0
  for (std::uint32_t length = png::kShortestMatch; length <= png::kLongestMatch; ++length) {
    const png::LengthClass found = png::length_class(length);
    match_[length] = join(join(words[found.symbol], BitString(found.extra, found.extra_bits)), kBack);
  }
}

/// One block, which states its code (RFC 1951, 3.2.7): lengths of all symbols and of distances 0 to 7, without repeats.
void DitherDeflate::put_head(BitWriter& writer) const {
  constexpr std::size_t kLengthSymbols = 19;
  std::array<std::uint32_t, kLengthSymbols> weights{};
  for (const std::uint8_t length : lengths_) ++weights[length];
  weights[0] += kDistanceSymbol;
  ++weights[1];
  auto lengths = png::word_lengths(weights);
  while (*std::ranges::max_element(lengths) > 7) {
    for (std::uint32_t& weight : weights) weight = weight > 0 ? weight / 2 + 1 : 0;
    lengths = png::word_lengths(weights);
  }
  const auto words = png::words_of(lengths);
  constexpr std::array<std::uint8_t, kLengthSymbols> kOrder = {16, 17, 18, 0, 8,  7, 9,  6, 10, 5,
                                                               11, 4,  12, 3, 13, 2, 14, 1, 15};
  writer.put(BitString(1, 1));  // the last block
  writer.put(BitString(2, 2));  // which states its code
  writer.put(BitString(png::kSymbols - 257, 5));
  writer.put(BitString(kDistanceSymbol, 5));
  writer.put(BitString(kLengthSymbols - 4, 4));
  for (const std::uint8_t symbol : kOrder) writer.put(BitString(lengths[symbol], 3));
  for (const std::uint8_t length : lengths_) writer.put(words[length]);
  for (std::uint32_t distance = 0; distance <= kDistanceSymbol; ++distance) writer.put(words[distance == kDistanceSymbol]);
}

void DitherDeflate::put_pieces(std::span<const std::byte> bytes, BitWriter& writer) const {
  const std::byte* at = bytes.data();
  const auto word = [&](const std::byte* of) { return byte_[static_cast<std::uint8_t>(*of)]; };
  for (const Piece& piece : pieces_) {
    const std::byte* const end = at + piece.literals;
    for (; end - at >= 3; at += 3) writer.put(join(join(word(at), word(at + 1)), word(at + 2)));
    for (; at < end; ++at) writer.put(word(at));
    std::uint32_t left = piece.match;
    for (; left >= png::kLongestMatch; left -= png::kLongestMatch) writer.put(match_[png::kLongestMatch]);
    if (left >= png::kShortestMatch) {
      writer.put(match_[left]);
    } else {
      for (std::uint32_t i = 0; i < left; ++i) writer.put(word(at + piece.match - left + i));
    }
    at += piece.match;
  }
}

std::size_t DitherDeflate::compress(std::span<const std::byte> bytes, std::byte* out) {
  find_pieces(bytes);
  make_code();
  out[0] = std::byte{0x78};  // a window of 32 KiB
  out[1] = std::byte{0x01};
  BitWriter writer(out + 2);
  put_head(writer);
  put_pieces(bytes, writer);
  writer.put(end_);
  std::byte* end = writer.finish();
  const std::uint32_t check = adler_of(bytes);
  for (int shift = 24; shift >= 0; shift -= 8) *end++ = static_cast<std::byte>(check >> shift & 0xFF);
  return static_cast<std::size_t>(end - out);
}

}  // namespace lamina::formats::tiff
