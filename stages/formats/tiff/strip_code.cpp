#include "stages/formats/tiff/strip_code.h"

#include <algorithm>

namespace lamina::formats::tiff {
namespace {

using png::BitString;
using png::BitWriter;

constexpr std::size_t kMaxCode = 15;
constexpr std::uint32_t kDistanceSymbol = 7, kDistanceExtra = 3, kDistanceExtraBits = 2;  // of 16, among 13 to 16

/// As png::word_lengths() of at most 15 bits: weights are flattened until that is so.
std::array<std::uint8_t, png::kSymbols> code_lengths(std::array<std::uint32_t, png::kSymbols> weights) {
  while (true) {
    const auto lengths = png::word_lengths(weights);
    if (*std::ranges::max_element(lengths) <= kMaxCode) return lengths;
    for (std::uint32_t& weight : weights) weight = (weight + 1) / 2 + 1;
  }
}

/// Takes a match of 3 bytes or more apart into some of 3 to 258.
template <class Take>
void for_matches(std::size_t length, Take take) {
  for (; length >= png::kLongestMatch + png::kShortestMatch; length -= png::kLongestMatch) take(std::size_t{png::kLongestMatch});
  if (length > png::kLongestMatch) take(length - png::kShortestMatch);
  take(length > png::kLongestMatch ? std::size_t{png::kShortestMatch} : length);
}

}  // namespace

void count_whole_match(std::size_t length, StripWeights& weights) {
  for_matches(length, [&](std::size_t match) { ++weights[png::length_class(static_cast<std::uint32_t>(match)).symbol]; });
}

void count_match(std::size_t length, StripWeights& weights) {
  weights[285] += static_cast<std::uint32_t>(length / png::kLongestMatch);
  const auto rest = static_cast<std::uint32_t>(length % png::kLongestMatch);
  if (rest >= png::kShortestMatch) ++weights[png::length_class(rest).symbol];
}

void StripCode::make(const StripWeights& weights) {
  lengths_ = code_lengths(weights);
  const auto words = png::words_of(lengths_);
  for (std::size_t b = 0; b < 256; ++b) byte_[b] = words[b];
  end_ = words[png::kEndOfBlock];
  for (std::uint32_t length = png::kShortestMatch; length <= png::kLongestMatch; ++length) {
    const png::LengthClass found = png::length_class(length);
    match_[length] = join(words[found.symbol], BitString(found.extra, found.extra_bits));
  }
}

/// One block, which states its code (RFC 1951, 3.2.7): lengths of all symbols and of distances up to its own, without repeats.
void StripCode::put_head(BitWriter& writer) const {
  constexpr std::size_t kLengthSymbols = 19;
  std::array<std::uint32_t, kLengthSymbols> weights{};
  for (const std::uint8_t length : lengths_) ++weights[length];
  // Distances have words of one bit: 16 after 1, if there is 1.
  const auto length_of = [&](std::uint32_t distance) { return distance == kDistanceSymbol || (near_ && distance == 0) ? 1u : 0u; };
  for (std::uint32_t distance = 0; distance <= kDistanceSymbol; ++distance) ++weights[length_of(distance)];
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
  for (std::uint32_t distance = 0; distance <= kDistanceSymbol; ++distance) writer.put(words[length_of(distance)]);
}

BitWriter StripCode::start(std::byte* out) const {
  out[0] = std::byte{0x78};  // a window of 32 KiB
  out[1] = std::byte{0x01};
  BitWriter writer(out + 2);
  put_head(writer);
  return writer;
}

void StripCode::put(const std::byte* at, std::size_t count, BitWriter& writer) const {
  const std::byte* const end = at + count;
  for (; end - at >= 3; at += 3) writer.put(join(join(of_byte(at[0]), of_byte(at[1])), of_byte(at[2])));
  for (; at < end; ++at) writer.put(of_byte(*at));
}

std::uint32_t StripCode::put_match(std::size_t length, BitWriter& writer) const {
  const BitString back = back_of(true);
  for (; length >= png::kLongestMatch; length -= png::kLongestMatch) writer.put(join(match_[png::kLongestMatch], back));
  if (length < png::kShortestMatch) return static_cast<std::uint32_t>(length);
  writer.put(join(match_[length], back));
  return 0;
}

void StripCode::put_whole_match(std::size_t length, bool far, BitWriter& writer) const {
  const BitString back = back_of(far);
  for_matches(length, [&](std::size_t match) { writer.put(join(match_[match], back)); });
}

BitString StripCode::back_of(bool far) const {
  return far ? BitString(kDistanceExtra << 1 | (near_ ? 1u : 0u), 1 + kDistanceExtraBits) : BitString(0, 1);
}

std::byte* StripCode::finish(std::uint32_t adler, BitWriter& writer) const {
  writer.put(end_);
  std::byte* end = writer.finish();
  for (int shift = 24; shift >= 0; shift -= 8) *end++ = static_cast<std::byte>(adler >> shift & 0xFF);
  return end;
}

}  // namespace lamina::formats::tiff
