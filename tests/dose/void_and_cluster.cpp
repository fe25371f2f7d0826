#include "tests/dose/void_and_cluster.h"

#include <algorithm>
#include <array>
#include <cstdlib>

#include "stages/dose/blue_noise.h"

namespace lamina::dose {
namespace {

constexpr std::uint32_t kMask = kTileSide - 1;
constexpr std::uint32_t kFew = kTilePixels / 32;
constexpr std::uint32_t kBlock = 8, kBlocks = kTileSide / kBlock;  // squares whose least energy is kept

/// round(4096 exp(-d^2 / 4.5)) for d = 0, 1, ...: a Gaussian of 1.5 pixels.
constexpr std::array<std::uint32_t, 7> kGauss{4096, 3280, 1684, 554, 117, 16, 1};
constexpr int kGaussReach = static_cast<int>(kGauss.size()) - 1;

using Energies = std::vector<std::uint32_t>;

/// The weight of a pixel on one that lies so far along columns and rows, for a whole tile twice as long and as high, so
/// that any shift of it is a window.
Energies far_weights() {
  Energies weights(std::size_t{4} * kTilePixels);
  for (std::uint32_t y = 0; y < 2 * kTileSide; ++y) {
    for (std::uint32_t x = 0; x < 2 * kTileSide; ++x) {
      const std::uint32_t dx = std::min(x & kMask, kTileSide - (x & kMask)), dy = std::min(y & kMask, kTileSide - (y & kMask));
      const std::uint64_t near = 2 + dx * dx + dy * dy;
      weights[y * 2 * kTileSide + x] = static_cast<std::uint32_t>((std::uint64_t{1} << 30) / (near * near));
    }
  }
  return weights;
}

/// Set pixels with the energy that they give to every pixel, by the weight of far pixels.
class FarField {
 public:
  explicit FarField(const Energies& weights) : weights_(weights), energy_(kTilePixels, 0), set_(kTilePixels, 0) {}

  bool set(std::uint32_t pixel) const { return set_[pixel] != 0; }
  void change(std::uint32_t pixel) {
    set_[pixel] ^= 1;
    const std::uint32_t turn = set_[pixel] != 0 ? 0u : ~0u;  // (w ^ ~0) - ~0 is -w modulo 2^32
    const std::uint32_t left = kTileSide - pixel % kTileSide, top = kTileSide - pixel / kTileSide;
    for (std::uint32_t y = 0; y < kTileSide; ++y) {
      const std::uint32_t* weight = weights_.data() + (top + y) * 2 * kTileSide + left;
      std::uint32_t* energy = energy_.data() + y * kTileSide;
      for (std::uint32_t x = 0; x < kTileSide; ++x) energy[x] += (weight[x] ^ turn) - turn;
    }
  }
  /// The set pixel of most energy; the first one of equals.
  std::uint32_t tightest_cluster() const {
    return first_of_largest([](std::uint32_t energy, std::uint32_t set) { return set != 0 ? energy + 1 : 0; });
  }
  /// The pixel of least energy that is not set; the first one of equals.
  std::uint32_t largest_void() const {
    return first_of_largest([](std::uint32_t energy, std::uint32_t set) { return set != 0 ? 0 : ~energy; });
  }

 private:
  /// Row by row, so that the search for the first of equals is within one row.
  template <class Value>
  std::uint32_t first_of_largest(Value value) const {
    std::uint32_t best = 0, maximum = 0;
    for (std::uint32_t row = 0; row < kTilePixels; row += kTileSide) {
      std::uint32_t of_row = 0;
      for (std::uint32_t i = row; i < row + kTileSide; ++i) of_row = std::max(of_row, value(energy_[i], set_[i]));
      if (of_row > maximum) best = row, maximum = of_row;
    }
    while (value(energy_[best], set_[best]) != maximum) ++best;
    return best;
  }

  const Energies& weights_;
  Energies energy_, set_;
};

/// The same by the Gaussian, which is short: pixels are only added.
class NearField {
 public:
  NearField() : energy_(kTilePixels, 0), min_(kBlocks * kBlocks, 0), at_(kBlocks * kBlocks, 0) {}

  void add(std::uint32_t pixel) {
    const std::uint32_t column = pixel % kTileSide, row = pixel / kTileSide;
    for (int dy = -kGaussReach; dy <= kGaussReach; ++dy) {
      const std::uint32_t y = (row + static_cast<std::uint32_t>(dy)) & kMask,
                          by_row = kGauss[static_cast<unsigned>(std::abs(dy))];
      for (int dx = -kGaussReach; dx <= kGaussReach; ++dx) {
        const std::uint32_t x = (column + static_cast<std::uint32_t>(dx)) & kMask;
        std::uint32_t& energy = energy_[y * kTileSide + x];
        if (energy != kSet) energy += by_row * kGauss[static_cast<unsigned>(std::abs(dx))];
      }
    }
    energy_[pixel] = kSet;
    constexpr std::uint32_t kReach = static_cast<std::uint32_t>(kGaussReach);
    const std::uint32_t first_x = (column - kReach) & kMask, first_y = (row - kReach) & kMask;
    for (std::uint32_t y = first_y / kBlock * kBlock; y <= first_y + 2 * kReach; y += kBlock) {
      for (std::uint32_t x = first_x / kBlock * kBlock; x <= first_x + 2 * kReach; x += kBlock)
        inspection(x & kMask, y & kMask);
    }
  }
  /// The pixel of least energy that is not set; the first one of equals within the first block of equals.
  std::uint32_t largest_void() const { return at_[static_cast<std::size_t>(std::ranges::min_element(min_) - min_.begin())]; }

 private:
  static constexpr std::uint32_t kSet = ~0u;

  /// Searches for the minimum energy of a block again.
  void inspection(std::uint32_t left, std::uint32_t top) {
    const std::uint32_t block = top / kBlock * kBlocks + left / kBlock;
    min_[block] = kSet;
    for (std::uint32_t y = top; y < top + kBlock; ++y) {
      for (std::uint32_t x = left; x < left + kBlock; ++x) {
        if (energy_[y * kTileSide + x] >= min_[block]) continue;
        min_[block] = energy_[y * kTileSide + x];
        at_[block] = y * kTileSide + x;
      }
    }
  }
  Energies energy_, min_;
  std::vector<std::uint32_t> at_;
};

}  // namespace

std::vector<std::uint16_t> void_and_cluster_ranks() {
  const Energies weights = far_weights();
  FarField first(weights);
  // Any start does; this one has no pattern: a linear congruential generator (D. Knuth, W. Lewis, 1981).
  for (std::uint32_t random = 1, count = 0; count < kFew;) {
    random = random * 1'664'525u + 1'013'904'223u;
    const std::uint32_t pixel = random >> 18;
    if (first.set(pixel)) continue;
    first.change(pixel);
    ++count;
  }
  for (std::uint32_t tries = 0; tries < 2 * kFew; ++tries) {
    const std::uint32_t from = first.tightest_cluster();
    first.change(from);
    const std::uint32_t to = first.largest_void();
    first.change(to);
    if (from == to) break;
  }
  std::vector<std::uint16_t> rank(kTilePixels);
  NearField between;
  FarField gaps(weights);
  std::vector<bool> ranked(kTilePixels, false);
  for (std::uint32_t i = 0; i < kTilePixels; ++i) {
    ranked[i] = first.set(i);
    if (ranked[i]) between.add(i);
  }
  for (std::uint32_t left = kFew; left-- > 0;) {
    const std::uint32_t pixel = first.tightest_cluster();
    first.change(pixel);
    rank[pixel] = static_cast<std::uint16_t>(left);
  }
  for (std::uint32_t next = kFew; next < kTilePixels - kFew; ++next) {
    const std::uint32_t pixel = between.largest_void();
    between.add(pixel);
    ranked[pixel] = true;
    rank[pixel] = static_cast<std::uint16_t>(next);
  }
  for (std::uint32_t i = 0; i < kTilePixels; ++i) {
    if (!ranked[i]) gaps.change(i);
  }
  for (std::uint32_t next = kTilePixels - kFew; next < kTilePixels; ++next) {
    const std::uint32_t pixel = gaps.tightest_cluster();  // the gaps that lie closest are filled first
    gaps.change(pixel);
    rank[pixel] = static_cast<std::uint16_t>(next);
  }
  return rank;
}

}  // namespace lamina::dose
