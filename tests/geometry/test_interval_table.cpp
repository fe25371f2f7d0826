// Laws of tables of intervals: they find exactly what a look at every interval finds, each once.
#include <gtest/gtest.h>

#include <random>

#include "stages/geometry/interval_table.h"

namespace lamina::test {
namespace {

using Entry = IntervalTable<Nm>::Entry;

IntervalTable<Nm> table_of(const std::vector<Entry>& entries, std::uint32_t finest) {
  std::int64_t lowest = INT64_MAX, highest = INT64_MIN;
  for (const Entry& entry : entries) {
    lowest = std::min<std::int64_t>(lowest, entry.low);
    highest = std::max<std::int64_t>(highest, entry.low);
  }
  return {lowest, highest, finest, [&](auto use) { std::ranges::for_each(entries, use); }};
}

std::vector<Entry> random_entries(std::mt19937& random, int shortest) {
  std::vector<Entry> entries;
  for (std::uint32_t id = 0; id < 600; ++id) {
    const auto low = static_cast<Nm>(random() % 4000) - 2000;
    // Powers of two, whose ends are those of buckets, are half of them.
    const auto length =
        std::max(shortest, static_cast<int>(id % 2 == 0 ? 1u << random() % 12 : random() % (id % 7 == 1 ? 3000 : 9)));
    entries.push_back({low, low + length, id});
  }
  return entries;
}

TEST(IntervalTable, FindsWhatATestOfEveryIntervalFinds) {
  std::mt19937 random(5);
  for (const std::uint32_t finest : {0u, 3u, 14u}) {
    const std::vector<Entry> entries = random_entries(random, finest == 0 ? 1 : 0);
    const IntervalTable<Nm> table = table_of(entries, finest);
    for (std::int64_t first = -2100; first < 6200; first += 3) {
      const std::int64_t last = first + static_cast<std::int64_t>(random() % 3 == 0 ? random() % 500 : 0);
      std::vector<std::uint32_t> found, expected;
      table.find(first, last, [&](std::uint32_t id) { found.push_back(id); });
      for (const Entry& entry : entries) {
        if (entry.low <= last && entry.high > first) expected.push_back(entry.id);
      }
      std::ranges::sort(found);
      ASSERT_EQ(found, expected) << first << " .. " << last << ", finest " << finest;
    }
  }
}

TEST(IntervalTable, AppendsInTheOrderOfFindAndNoMoreThanStated) {
  std::mt19937 random(6);
  const IntervalTable<Nm> table = table_of(random_entries(random, 1), 0);
  for (std::int64_t number = -2100; number < 6200; number += 7) {
    std::vector<std::uint32_t> found{77};
    Buffer<std::uint32_t> appended{77};
    table.find(number, number, [&](std::uint32_t id) { found.push_back(id); });
    table.append(number, appended);
    ASSERT_TRUE(std::ranges::equal(found, appended)) << number;
    ASSERT_LE(appended.size() - 1, table.max_found(number));
  }
}

TEST(IntervalTable, BoxesAreFoundByHeightAndFlatOnesBetweenTwoHeights) {
  const auto box = [](Nm low, Nm high) { return Box{{0, 0, low}, {1, 1, high}}; };
  const std::vector<Box> boxes{box(0, 16'384), box(-2'000'000'000, 2'000'000'000), box(500, 500), Box(), box(16'384, 20'000)};
  const IntervalTable<Nm> table = heights_of(boxes);
  const auto found = [&](std::int64_t first, std::int64_t last) {
    std::vector<std::uint32_t> ids;
    table.find(first, last, [&](std::uint32_t id) { ids.push_back(id); });
    std::ranges::sort(ids);
    return ids;
  };
  EXPECT_EQ(found(500, 500), (std::vector<std::uint32_t>{0, 1}));
  EXPECT_EQ(found(499, 500), (std::vector<std::uint32_t>{0, 1, 2}));
  EXPECT_EQ(found(16'384, 16'384), (std::vector<std::uint32_t>{1, 4}));
  EXPECT_EQ(found(2'000'000'000, 2'000'000'000), std::vector<std::uint32_t>());
  EXPECT_EQ(found(-2'000'000'000, -2'000'000'000), std::vector<std::uint32_t>{1});
}

TEST(IntervalTable, WithoutIntervalsNothingIsFound) {
  const IntervalTable<Nm> table = heights_of({});
  table.find(-5, 5, [](std::uint32_t) { FAIL(); });
  EXPECT_EQ(table.max_found(0), 0u);
  EXPECT_EQ(table.bytes(), 0u);
}

}  // namespace
}  // namespace lamina::test
