#include "stages/arrange/fill_build.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <map>
#include <numeric>
#include <set>
#include <tuple>

namespace lamina::arrange {
namespace {

/// A level filled in one order of the demands.
class Filling {
 public:
  Filling(const BedCells& bed, std::span<const NestShape> shapes, std::span<const Demand> demands,
          std::span<const FixedShape> fixed)
      : shapes_(shapes), demands_(demands), level_(bed, shapes.size()) {
    for (const FixedShape& each : fixed) level_.put(each.put, each.at);
  }

  void fill(const std::vector<std::uint32_t>& order) {
    for (const std::uint32_t number : order) {
      if (!demands_[number].group) {
        put_copies(number);
      } else if (tried_.insert(*demands_[number].group).second) {
        put_group(order, *demands_[number].group);
      }
    }
  }

  std::vector<PutShape> put;
  std::map<std::pair<std::int32_t, std::int32_t>, double> covered;  // mm2, by rank

 private:
  /// returns  how many copies it put
  std::uint32_t put_copies(std::uint32_t number) {
    std::uint32_t count = 0;
    while (count < demands_[number].copies && put_one(number)) ++count;
    return count;
  }
  void put_group(const std::vector<std::uint32_t>& order, std::uint32_t group) {
    const BedLevel level = level_;
    const std::vector<PutShape> before = put;
    const auto covered_before = covered;
    for (const std::uint32_t number : order) {
      if (demands_[number].group != group || put_copies(number) == demands_[number].copies) continue;
      level_ = level;
      put = before;
      covered = covered_before;
      return;
    }
  }
  /// Puts one copy where the row of its last cells is the front-most, in any of its turns.
  bool put_one(std::uint32_t number) {
    std::optional<PutShape> best;
    std::tuple<std::uint32_t, std::uint32_t> score{UINT32_MAX, UINT32_MAX};
    for (const std::uint32_t shape : demands_[number].shapes) {
      const SearchShape& search = shapes_[shape].search;
      const auto at = level_.find(shape, search, std::get<0>(score));
      if (!at) continue;
      const std::tuple<std::uint32_t, std::uint32_t> own{at->y + search.depth(), at->x};
      if (best && own >= score) continue;
      score = own;
      best = PutShape{number, shape, {at->x + shapes_[shape].reach, at->y + shapes_[shape].reach}};
    }
    if (!best) return false;
    level_.put(shapes_[best->shape].put, best->at);
    put.push_back(*best);
    covered[demands_[number].rank] += shapes_[best->shape].area_mm2;
    return true;
  }

  std::span<const NestShape> shapes_;
  std::span<const Demand> demands_;
  BedLevel level_;
  std::set<std::uint32_t> tried_;  // groups
};

}  // namespace

std::vector<PutShape> fill_build(const BedCells& bed, std::span<const NestShape> shapes, std::span<const Demand> demands,
                                 std::span<const FixedShape> fixed) {
  constexpr std::size_t kOrders = 4;
  const auto size_of = [&](std::uint32_t number, std::size_t by) -> double {
    if (demands[number].shapes.empty()) return 0;
    const NestShape& shape = shapes[demands[number].shapes.front()];
    switch (by) {
      case 0: return shape.area_mm2;
      case 1: return shape.search.depth();
      case 2: return shape.search.width();
      default: return 0;
    }
  };
  std::array<std::optional<Filling>, kOrders> filled;
  tbb::parallel_for(std::size_t{0}, kOrders, [&](std::size_t by) {
    std::vector<std::uint32_t> order;
    for (std::uint32_t number = 0; number < demands.size(); ++number)
      if (demands[number].copies > 0) order.push_back(number);
    std::ranges::stable_sort(order, {},
                             [&](std::uint32_t number) { return std::pair(demands[number].rank, -size_of(number, by)); });
    filled[by].emplace(bed, shapes, demands, fixed).fill(order);
  });
  std::size_t best = 0;
  for (std::size_t by = 1; by < kOrders; ++by) {
    for (const Demand& demand : demands)
      filled[by]->covered.try_emplace(demand.rank, 0), filled[best]->covered.try_emplace(demand.rank, 0);
    const auto differs = std::ranges::mismatch(filled[by]->covered, filled[best]->covered);
    if (differs.in1 != filled[by]->covered.end() && differs.in1->second > differs.in2->second) best = by;
  }
  return std::move(filled[best]->put);
}

}  // namespace lamina::arrange
