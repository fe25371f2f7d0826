#include "stages/formats/tiff/strip_code.h"

#include <algorithm>
#include <bit>

namespace lamina::formats::tiff {
namespace {

using png::BitString;
using png::BitWriter;

constexpr std::size_t kMaxCode = 15;

constexpr auto kLengthClass = [] {
  std::array<png::LengthClass, png::kLongestMatch + 1> of{};
  for (std::uint32_t length = png::kShortestMatch; length < of.size(); ++length) of[length] = png::length_class(length);
  return of;
}();

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
  for (; length >= png::kLongestMatch + png::kShortestMatch; length -= png::kLongestMatch)
    take(std::size_t{png::kLongestMatch});
  if (length > png::kLongestMatch) take(length - png::kShortestMatch);
  take(length > png::kLongestMatch ? std::size_t{png::kShortestMatch} : length);
}

}  // namespace

void count_whole_match(std::size_t length, StripWeights& weights) {
  for_matches(length, [&](std::size_t match) { ++weights[kLengthClass[match].symbol]; });
}

void count_match(std::size_t length, StripWeights& weights) {
  for (; length > png::kLongestMatch; length -= png::kLongestMatch) ++weights[285];
  if (length >= png::kShortestMatch) ++weights[kLengthClass[length].symbol];
}

void StripCode::add_distance(std::size_t bytes) {
  const auto less = static_cast<std::uint32_t>(bytes - 1);
  const std::uint32_t extra_bits = less < 4 ? 0 : static_cast<std::uint32_t>(std::bit_width(less)) - 2;
  const std::uint32_t symbol = 2 * extra_bits + (less >> extra_bits);
  if (std::ranges::find(distances(), symbol, &StripDistance::symbol) != distances().end()) return;
  distance_[distances_++] = {bytes, symbol, less & ((1u << extra_bits) - 1), extra_bits, {}};
}

void StripCode::make(const StripWeights& weights) {
  if (weights != weights_) make_symbols(weights);  // empty strips are alike
  // Distances have words of one bit; 1 and 1; 1, 2 and 2; or 1, 2, 3 and 3.
  distance_lengths_ = {};
  for (std::size_t d = 0; d < distances_; ++d)
    distance_lengths_[distance_[d].symbol] =
        static_cast<std::uint8_t>(std::max<std::size_t>(1, std::min(d + 1, distances_ - 1)));
  const auto backs = png::words_of(distance_lengths_);
  for (StripDistance& of : std::span(distance_).first(distances_))
    of.word = join(backs[of.symbol], BitString(of.extra, of.extra_bits));
}

void StripCode::make_symbols(const StripWeights& weights) {
  weights_ = weights;
  lengths_ = code_lengths(weights);
  const auto words = png::words_of(lengths_);
  for (std::size_t b = 0; b < 256; ++b) byte_[b] = words[b];
  end_ = words[png::kEndOfBlock];
  for (std::uint32_t length = png::kShortestMatch; length <= png::kLongestMatch; ++length) {
    const png::LengthClass& found = kLengthClass[length];
    match_[length] = join(words[found.symbol], BitString(found.extra, found.extra_bits));
  }
}

/// One block, which states its code (RFC 1951, 3.2.7): lengths of all symbols and of distances, without repeats.
void StripCode::put_head(BitWriter& writer) const {
  constexpr std::size_t kLengthSymbols = 19;
  std::array<std::uint32_t, kLengthSymbols> weights{};
  for (const std::uint8_t length : lengths_) ++weights[length];
  std::size_t last = kDistanceSymbols - 1;
  while (distance_lengths_[last] == 0) --last;
  const auto of_distances = std::span(distance_lengths_).first(last + 1);
  for (const std::uint8_t length : of_distances) ++weights[length];
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
  writer.put(BitString(last, 5));
  writer.put(BitString(kLengthSymbols - 4, 4));
  for (const std::uint8_t symbol : kOrder) writer.put(BitString(lengths[symbol], 3));
  for (const std::uint8_t length : lengths_) writer.put(words[length]);
  for (const std::uint8_t length : of_distances) writer.put(words[length]);
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

void StripCode::put_whole_match(std::size_t length, std::size_t distance, BitWriter& writer) const {
  const BitString back = distance_[distance].word;
  for_matches(length, [&](std::size_t match) { writer.put(join(match_[match], back)); });
}

std::byte* StripCode::finish(std::uint32_t adler, BitWriter& writer) const {
  writer.put(end_);
  std::byte* end = writer.finish();
  for (int shift = 24; shift >= 0; shift -= 8) *end++ = static_cast<std::byte>(adler >> shift & 0xFF);
  return end;
}

}  // namespace lamina::formats::tiff
