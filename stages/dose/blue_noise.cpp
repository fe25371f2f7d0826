#include "stages/dose/blue_noise.h"

#include "stages/dose/blue_noise_tile.h"

namespace lamina::dose {
namespace {

constexpr std::uint32_t kBitsOfRank = 14, kBitsOfCharacter = 6;
static_assert(1u << kBitsOfRank == kTilePixels);

std::uint32_t bits_of(char c) {
  if (c >= 'A' && c <= 'Z') return static_cast<std::uint32_t>(c - 'A');
  if (c >= 'a' && c <= 'z') return static_cast<std::uint32_t>(c - 'a') + 26;
  if (c >= '0' && c <= '9') return static_cast<std::uint32_t>(c - '0') + 52;
  return c == '+' ? 62 : 63;
}

std::vector<std::uint16_t> unpacked() {
  std::vector<std::uint16_t> ranks;
  ranks.reserve(kTilePixels);
  std::uint32_t bits = 0, held = 0;
  for (const char c : kBlueNoiseTile) {
    bits |= bits_of(c) << held;
    held += kBitsOfCharacter;
    if (held < kBitsOfRank) continue;
    ranks.push_back(static_cast<std::uint16_t>(bits & (kTilePixels - 1)));
    bits >>= kBitsOfRank;
    held -= kBitsOfRank;
  }
  return ranks;
}

}  // namespace

const std::vector<std::uint16_t>& blue_noise_ranks() {
  static const std::vector<std::uint16_t> kRanks = unpacked();
  return kRanks;
}

}  // namespace lamina::dose
