// Bodies and pieces on runs against a flood of voxels.
#include <gtest/gtest.h>

#include <array>
#include <map>
#include <random>
#include <vector>

#include "stages/inspect/bodies.h"
#include "stages/inspect/thin.h"

namespace lamina::inspect {
namespace {

struct Volume {
  std::uint32_t columns, rows, layers;
  std::vector<std::uint8_t> set;
  bool at(std::int64_t c, std::int64_t r, std::int64_t l) const {
    if (c < 0 || r < 0 || l < 0 || c >= columns || r >= rows || l >= layers) return false;
    return set[static_cast<std::size_t>((l * rows + r) * columns + c)] != 0;
  }
  Runs layer(std::uint32_t l) const {
    Runs runs;
    runs.columns = columns;
    runs.row_offset.push_back(0);
    for (std::uint32_t r = 0; r < rows; ++r) {
      for (std::uint32_t c = 0; c <= columns; ++c) {
        if (at(c, r, l) != at(std::int64_t{c} - 1, r, l)) runs.change.push_back(c);
      }
      runs.row_offset.push_back(static_cast<std::uint32_t>(runs.change.size()));
    }
    return runs;
  }
};

Volume random_volume(std::uint32_t seed, double share) {
  Volume volume{23, 17, 9, {}};
  std::mt19937 random(seed);
  volume.set.resize(23 * 17 * 9);
  for (auto& voxel : volume.set) voxel = std::uniform_real_distribution<>(0, 1)(random) < share;
  return volume;
}

/// Sizes of bodies by flooding voxels, largest first.
std::vector<std::uint64_t> flood(const Volume& volume, bool diagonal) {
  std::vector<std::uint8_t> seen(volume.set.size(), 0);
  std::vector<std::uint64_t> sizes;
  for (std::size_t start = 0; start < seen.size(); ++start) {
    if (seen[start] != 0 || volume.set[start] == 0) continue;
    std::vector<std::size_t> open{start};
    seen[start] = 1;
    std::uint64_t size = 0;
    while (!open.empty()) {
      const std::size_t at = open.back();
      open.pop_back();
      ++size;
      const auto c = static_cast<std::int64_t>(at % volume.columns),
                 r = static_cast<std::int64_t>(at / volume.columns % volume.rows),
                 l = static_cast<std::int64_t>(at / volume.columns / volume.rows);
      for (std::int64_t dl = -1; dl <= 1; ++dl) {
        for (std::int64_t dr = -1; dr <= 1; ++dr) {
          for (std::int64_t dc = -1; dc <= 1; ++dc) {
            const auto steps = std::abs(dc) + std::abs(dr);
            if (dl != 0 ? steps != 0 : steps > (diagonal ? 2 : 1)) continue;
            if (!volume.at(c + dc, r + dr, l + dl)) continue;
            const auto next = static_cast<std::size_t>(((l + dl) * volume.rows + r + dr) * volume.columns + c + dc);
            if (seen[next] != 0) continue;
            seen[next] = 1;
            open.push_back(next);
          }
        }
      }
    }
    sizes.push_back(size);
  }
  std::sort(sizes.rbegin(), sizes.rend());
  return sizes;
}

struct Count {
  std::vector<std::uint64_t> sizes;
  std::uint32_t begun = 0;
  void begin(Body&) { ++begun; }
  void grow(Body&) {}
  void join(const Body&, const Body&, const Body&) {}
  void end(const Body& body) { sizes.push_back(body.pixels); }
};

TEST(Bodies, AreThoseOfAFloodOfVoxels) {
  for (std::uint32_t seed = 0; seed < 60; ++seed) {
    const Volume volume = random_volume(seed, 0.1 + 0.01 * seed);
    for (const bool diagonal : {false, true}) {
      Follower follower(diagonal);
      Count count;
      for (std::uint32_t l = 0; l < volume.layers; ++l) {
        follower.add({l, static_cast<Nm>(l * 50'000), 50'000}, volume.layer(l), count);
      }
      follower.finish(count);
      std::sort(count.sizes.rbegin(), count.sizes.rend());
      ASSERT_EQ(count.sizes, flood(volume, diagonal)) << seed;
      EXPECT_GE(count.begun, count.sizes.size());
    }
  }
}

TEST(Bodies, BoxesHeightsAndVolumesAreThoseOfTheirVoxels) {
  // An arch: two feet, joined by a lintel in the third layer.
  Volume arch{12, 5, 3, std::vector<std::uint8_t>(12 * 5 * 3, 0)};
  const auto set = [&](std::uint32_t c, std::uint32_t r, std::uint32_t l) { arch.set[(l * 5 + r) * 12 + c] = 1; };
  for (std::uint32_t l = 0; l < 2; ++l) set(2, 2, l), set(9, 2, l);
  for (std::uint32_t c = 2; c < 10; ++c) set(c, 2, 2);
  struct Rules : Count {
    std::uint32_t joined = 0;
    Body last;
    void join(const Body& stays, const Body& ends, const Body& piece) {
      ++joined;
      EXPECT_EQ(stays.pixels + ends.pixels, 2u + 8 + 2);  // a foot with the lintel, the other foot
      EXPECT_EQ(piece.box.right, 10u);
    }
    void end(const Body& body) { last = body; }
  } rules;
  Follower follower(true);
  for (std::uint32_t l = 0; l < 3; ++l) follower.add({l, static_cast<Nm>(l * 100), 100}, arch.layer(l), rules);
  follower.finish(rules);
  EXPECT_EQ(rules.begun, 2u);
  EXPECT_EQ(rules.joined, 1u);
  EXPECT_EQ(rules.last.pixels, 12u);
  EXPECT_EQ(rules.last.pixel_nm, 1200u);
  EXPECT_EQ(rules.last.bottom, 0);
  EXPECT_EQ(rules.last.top, 300);
  EXPECT_EQ(rules.last.first_layer, 0u);
  EXPECT_EQ(rules.last.last_layer, 2u);
  EXPECT_EQ(rules.last.box.left, 2u);
  EXPECT_EQ(rules.last.box.right, 10u);
}

/// Whether a pixel is in no disc of the image, pixel by pixel.
TEST(ThinPlaces, AreThosePixelsThatNoDiscCovers) {
  const PixelGrid grid{PixelAxis(254, 10 * kNmPerMm), PixelAxis(254, 10 * kNmPerMm)};  // pixels of 100 um
  std::mt19937 random(7);
  for (const std::int64_t radius : {100'000, 150'000, 250'000, 400'000}) {
    const Disc disc = disc_of(grid, radius);
    for (int turn = 0; turn < 20; ++turn) {
      Volume image{40, 30, 1, std::vector<std::uint8_t>(40 * 30, 0)};
      for (int k = 0; k < 6; ++k) {
        const auto draw = [&](std::uint32_t below) { return std::uniform_int_distribution<std::uint32_t>(0, below)(random); };
        const std::uint32_t left = draw(34), top = draw(24), wide = 1 + draw(14), high = 1 + draw(12);
        for (std::uint32_t r = top; r < std::min(30u, top + high); ++r) {
          for (std::uint32_t c = left; c < std::min(40u, left + wide); ++c) image.set[r * 40 + c] = 1;
        }
      }
      const auto in_disc = [&](std::int64_t dc, std::int64_t dr) {
        return 1e10 * static_cast<double>(dc * dc + dr * dr) <= static_cast<double>(radius * radius);
      };
      const auto set_or_beyond = [&](std::int64_t c, std::int64_t r) {
        return c < 0 || r < 0 || c >= 40 || r >= 30 || image.at(c, r, 0);
      };
      std::uint64_t thin = 0;
      for (std::int64_t r = 0; r < 30; ++r) {
        for (std::int64_t c = 0; c < 40; ++c) {
          if (!image.at(c, r, 0)) continue;
          bool covered = false;
          for (std::int64_t dr = -4; dr <= 4 && !covered; ++dr) {
            for (std::int64_t dc = -4; dc <= 4 && !covered; ++dc) {
              if (!in_disc(dc, dr) || c + dc < 0 || r + dr < 0 || c + dc >= 40 || r + dr >= 30) continue;
              bool fits = true;
              for (std::int64_t er = -4; er <= 4 && fits; ++er) {
                for (std::int64_t ec = -4; ec <= 4 && fits; ++ec) {
                  fits = !in_disc(ec, er) || set_or_beyond(c + dc + ec, r + dr + er);
                }
              }
              covered = fits;
            }
          }
          thin += covered ? 0 : 1;
        }
      }
      ThinScratch scratch;
      ASSERT_EQ(thin_places(image.layer(0), disc, 0, scratch).pixels, thin) << radius << " " << turn;
    }
  }
}

TEST(ThinPlaces, CornersOfThickBodiesAreNoneAndWallsAre) {
  const PixelGrid grid{PixelAxis(508, 20 * kNmPerMm), PixelAxis(508, 20 * kNmPerMm)};  // pixels of 50 um
  const Disc disc = disc_of(grid, 400'000);                                            // least width 0.8 mm: 16 pixels
  Runs image;
  image.columns = grid.columns();
  image.row_offset.push_back(0);
  for (std::uint32_t r = 0; r < grid.rows(); ++r) {
    if (r >= 100 && r < 200) image.change.insert(image.change.end(), {100, 200});
    if (r >= 150 && r < 160) image.change.back() = 300;  // a fin of half a millimetre, five long
    image.row_offset.push_back(static_cast<std::uint32_t>(image.change.size()));
  }
  ThinScratch scratch;
  const ThinPlaces places = thin_places(image, disc, 2 * 16 * 16, scratch);
  ASSERT_EQ(places.count, 1u);
  EXPECT_GE(places.largest, 980u);  // discs of the block reach a little way into the fin
  EXPECT_LE(places.largest, 1000u);
  EXPECT_EQ(places.box.right, 300u);
}

}  // namespace
}  // namespace lamina::inspect
