// The loops that read a sound STL say the same with every instruction set, and what slow arithmetic says.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <memory>
#include <numeric>
#include <random>
#include <vector>

#include "stages/geometry/isa.h"
#include "stages/load/kernels/kernels.h"

namespace lamina::test {
namespace {

/// What this processor has.
std::vector<Isa> usable_sets() {
  std::vector<Isa> sets;
  for (const Isa isa : {Isa::kPlain, Isa::kAvx2, Isa::kAvx512}) {
    if (isa <= widest_isa()) sets.push_back(isa);
  }
  return sets;
}

std::vector<char> facets_of(const std::vector<float>& numbers) {
  std::vector<char> bytes(numbers.size() / 9 * load::kFacetBytes, '\x7f');
  for (std::size_t i = 0; i < numbers.size() / 9; ++i) std::memcpy(bytes.data() + 50 * i + 12, numbers.data() + 9 * i, 36);
  return bytes;
}

TEST(LoadKernels, SnapToTheNearestHalvesAwayFromZero) {
  std::mt19937 random(1);
  std::uniform_real_distribution<float> anywhere(-2147.4f, 2147.4f), near(-0.01f, 0.01f);
  for (const std::size_t count : {1u, 2u, 255u, 256u, 257u, 1000u}) {
    std::vector<float> numbers(9 * count);
    for (std::size_t i = 0; i < numbers.size(); ++i) numbers[i] = i % 2 == 0 ? anywhere(random) : near(random);
    // 2^-7 mm are 7812.5 nm: odd multiples are halves.
    const float special[] = {0.0f, -0.0f, 0x1p-7f, -0x1p-7f, 3 * 0x1p-7f, -5 * 0x1p-7f, 2147.4836f, -2147.4836f, 1e-40f};
    for (std::size_t i = 0; i < 9 && count > 1; ++i) numbers[numbers.size() - 12 + i] = special[i];
    const std::vector<char> bytes = facets_of(numbers);
    for (const Isa isa : usable_sets()) {
      SCOPED_TRACE(isa_name(isa));
      std::vector<Triangle> out(count);
      load::CoordinateBox box;
      ASSERT_TRUE(load::load_kernels_for(isa).snap(bytes.data(), count, out.data(), box));
      std::vector<Nm> snapped(numbers.size());
      std::memcpy(snapped.data(), out.data(), 4 * snapped.size());
      std::array<float, 3> lo{3e38f, 3e38f, 3e38f}, hi{-3e38f, -3e38f, -3e38f};
      for (std::size_t i = 0; i < numbers.size(); ++i) {
        ASSERT_EQ(snapped[i], std::llround(static_cast<double>(numbers[i]) * 1e6)) << numbers[i];
        lo[i % 3] = std::min(lo[i % 3], numbers[i]);
        hi[i % 3] = std::max(hi[i % 3], numbers[i]);
      }
      EXPECT_EQ(box.lo, lo);
      EXPECT_EQ(box.hi, hi);
    }
  }
}

TEST(LoadKernels, RefuseWhatCannotBeSnappedWhereverItIs) {
  for (const float bad : {NAN, -NAN, INFINITY, -INFINITY, 2147.484f, -2147.484f, 3e38f}) {
    for (const std::size_t at : {0u, 8u, 9u * 255 + 4, 9u * 256, 9u * 299 + 8}) {
      std::vector<float> numbers(300 * 9, 1.0f);
      numbers[at] = bad;
      const std::vector<char> bytes = facets_of(numbers);
      for (const Isa isa : usable_sets()) {
        std::vector<Triangle> out(300);
        load::CoordinateBox box;
        EXPECT_FALSE(load::load_kernels_for(isa).snap(bytes.data(), 300, out.data(), box))
            << isa_name(isa) << " " << bad << " " << at;
      }
    }
  }
}

std::vector<Triangle> random_facets(std::size_t count) {
  std::mt19937 random(static_cast<unsigned>(count));
  std::uniform_int_distribution<Nm> anywhere(-INT32_MAX, INT32_MAX);
  std::vector<Triangle> list(count);
  for (Triangle& t : list) {
    for (Point3* p : {&t.a, &t.b, &t.c}) *p = {anywhere(random), anywhere(random), anywhere(random)};
  }
  if (count > 5) list[1].b = list[1].a, list[2].c = list[2].a, list[3] = {list[3].b, list[3].b, list[3].b};
  if (count > 9) list[8] = list[7], std::swap(list[8].b, list[8].c);
  return list;
}

std::unique_ptr<SortedBlock> sorted_block_of(const std::vector<Triangle>& list) {
  auto block = std::make_unique<SortedBlock>();
  std::vector<std::uint16_t> order(list.size());
  std::iota(order.rbegin(), order.rend(), std::uint16_t{0});
  block->take(list, order);
  return block;
}

TEST(LoadKernels, TakeTheCensusOfTheListAndHashesThatDistinguishVertices) {
  for (const std::size_t count : {1u, 4u, 7u, 8u, 16u, 17u, 333u, 4096u}) {
    const std::vector<Triangle> list = random_facets(count);
    const auto block = sorted_block_of(list);
    for (const std::uint64_t share : {1u, 3u}) {
      load::CensusSums expected;
      expected.add(list, share);
      std::sort(expected.sampled.begin(), expected.sampled.end());
      std::vector<std::uint16_t> hashes;
      for (const Isa isa : usable_sets()) {
        SCOPED_TRACE(std::string(isa_name(isa)) + ", " + std::to_string(count));
        block->hash.fill(7);
        load::CensusSums sums;
        load::load_kernels_for(isa).census(*block, share, sums);
        std::sort(sums.sampled.begin(), sums.sampled.end());
        EXPECT_EQ(sums.boundary, expected.boundary);
        EXPECT_EQ(sums.fingerprint, expected.fingerprint);
        EXPECT_EQ(sums.sampled, expected.sampled);
        const std::vector<std::uint16_t> own(block->hash.begin(),
                                             block->hash.begin() + block->clusters() * SortedBlock::kCorners);
        if (isa == Isa::kPlain) hashes = own;
        EXPECT_EQ(own, hashes);
      }
      std::sort(hashes.begin(), hashes.end());
      const auto different = static_cast<std::size_t>(std::unique(hashes.begin(), hashes.end()) - hashes.begin());
      EXPECT_GT(different, std::min<std::size_t>(2 * count, 8000));
    }
  }
}

TEST(LoadKernels, TheBoundaryIsNothingOnlyWhereEveryEdgeIsWalkedBothDirections) {
  std::mt19937 random(4);
  const auto any = [&] {
    return Point3{static_cast<Nm>(random() % 1000), static_cast<Nm>(random() % 1000), static_cast<Nm>(random() % 1000)};
  };
  for (int round = 0; round < 200; ++round) {
    const Point3 a = any(), b = any(), c = any(), d = any();
    std::vector<Triangle> list = {{a, c, b}, {a, b, d}, {b, c, d}, {c, a, d}, {a, b, b}, {c, c, c}};
    load::CensusSums closed, open, turned;
    closed.add(list, 1);
    EXPECT_EQ(closed.boundary, 0u);
    open.add(std::span(list).subspan(1), 1);
    EXPECT_NE(open.boundary, 0u);
    std::swap(list[2].a, list[2].b);
    turned.add(list, 1);
    EXPECT_NE(turned.boundary, 0u);
  }
}

TEST(LoadKernels, PrismsAreTheSameBitsAndTheVolumeOfEachFacet) {
  for (const std::size_t count : {1u, 15u, 16u, 4096u}) {
    const std::vector<Triangle> list = random_facets(count);
    const auto block = sorted_block_of(list);
    const Nm plane = list.front().a.z;
    long double volume = 0, shadow = 0;
    for (const Triangle& t : list) {
      const long double ux = static_cast<long double>(t.b.x) - t.a.x, uy = static_cast<long double>(t.b.y) - t.a.y;
      const long double vx = static_cast<long double>(t.c.x) - t.a.x, vy = static_cast<long double>(t.c.y) - t.a.y;
      shadow += ux * vy - vx * uy;
      volume += (ux * vy - vx * uy) * (static_cast<long double>(t.a.z) + t.b.z + t.c.z - 3.0L * plane);
    }
    const load::Prisms plain = load::load_kernels_for(Isa::kPlain).prisms(*block, plane);
    EXPECT_EQ(plain.plane, plane);
    EXPECT_NEAR(plain.doubled_shadow, static_cast<double>(shadow), 1e-12 * 1.6e19 * static_cast<double>(count));
    EXPECT_NEAR(plain.sixfold_volume, static_cast<double>(volume), 1e-12 * 1e29 * static_cast<double>(count));
    for (const Isa isa : usable_sets()) {
      const load::Prisms wide = load::load_kernels_for(isa).prisms(*block, plane);
      EXPECT_EQ(wide.doubled_shadow, plain.doubled_shadow) << isa_name(isa);
      EXPECT_EQ(wide.sixfold_volume, plain.sixfold_volume) << isa_name(isa);
    }
  }
}

}  // namespace
}  // namespace lamina::test
