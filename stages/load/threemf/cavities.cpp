#include "stages/load/threemf/cavities.h"

#include <algorithm>
#include <array>
#include <iterator>
#include <limits>
#include <map>
#include <numeric>
#include <optional>
#include <tuple>
#include <vector>

#include "stages/load/matrix.h"
#include "stages/load/winding/winding.h"

namespace lamina::load {
namespace {

using Point = std::array<double, 3>;

constexpr std::uint64_t kMostWork = std::uint64_t{1} << 28;  // boxes compared: more than objects that lie side by side need

struct Extent {
  Point lo, hi;
  bool holds(const Extent& other) const {
    for (std::size_t axis = 0; axis < 3; ++axis)
      if (!(lo[axis] <= other.lo[axis] && other.hi[axis] <= hi[axis])) return false;
    return true;
  }
};

Point minus(const Point& a, const Point& b) { return {a[0] - b[0], a[1] - b[1], a[2] - b[2]}; }
double dot(const Point& a, const Point& b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }
Point cross(const Point& a, const Point& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}

Point moved(const Transform& transform, const Point& at) {
  Point out = apply(transform.linear, at);
  for (std::size_t axis = 0; axis < 3; ++axis) out[axis] += transform.translation[axis];
  return out;
}

/// Six times the volume, in the file's unit.
double volume_of(const ModelObject& object) {
  double sum = 0;
  const auto& at = object.vertices;
  for (const auto& [a, b, c] : object.triangles)
    sum += dot(minus(at[a], at[0]), cross(minus(at[b], at[0]), minus(at[c], at[0])));
  return sum;
}

Extent extent_of(const ModelObject& object, const Transform& transform) {
  constexpr double kFar = std::numeric_limits<double>::infinity();
  Extent extent{{kFar, kFar, kFar}, {-kFar, -kFar, -kFar}};
  for (const auto& corners : object.triangles) {
    for (const std::uint32_t corner : corners) {
      const Point at = moved(transform, object.vertices[corner]);
      for (std::size_t axis = 0; axis < 3; ++axis) {
        extent.lo[axis] = std::min(extent.lo[axis], at[axis]);
        extent.hi[axis] = std::max(extent.hi[axis], at[axis]);
      }
    }
  }
  return extent;
}

/// How often a closed mesh goes around points near it.
class Container {
 public:
  Container(const ModelObject& object, const Transform& transform, const Extent& extent) : from_(extent.lo) {
    Buffer<Triangle> triangles;
    triangles.reserve(object.triangles.size());
    const auto at = [&](std::uint32_t corner) {
      const Point nm = in_nm(moved(transform, object.vertices[corner]));
      return Point3{static_cast<Nm>(nm[0]), static_cast<Nm>(nm[1]), static_cast<Nm>(nm[2])};
    };
    const bool mirrors = transform.mirrors();
    for (const auto& [a, b, c] : object.triangles) triangles.push_back({at(a), at(mirrors ? c : b), at(mirrors ? b : c)});
    tree_.emplace(triangles, Point3{0, 0, 0});
  }
  bool holds(const Point& point) const { return tree_->at(in_nm(point)) > 0.75; }

 private:
  Point in_nm(Point at) const {
    at = minus(at, from_);
    for (double& axis : at) axis = std::min(static_cast<double>(kNmReach), 1e6 * axis);
    return at;
  }
  Point from_;
  std::optional<WindingTree> tree_;
};

class Search {
 public:
  explicit Search(const ModelPackage& package) : package_(package), volumes_(package.objects.size()) {}

  bool is_negative(const Leaf& leaf) {
    std::optional<double>& volume = volumes_[leaf.object];
    if (!volume) volume = volume_of(package_.objects[leaf.object]);
    return *volume < 0;
  }

  /// The leaves from `first` to `end` are of one item. Solids are met in the order of their left ends and kept up to the right.
  void item(std::vector<Leaf>& leaves, std::uint32_t first, std::uint32_t end) {
    const auto negative = [&](const Leaf& leaf) { return is_negative(leaf); };
    if (end - first < 2 || std::none_of(leaves.begin() + first, leaves.begin() + end, negative)) return;
    std::vector<Extent> extents;
    for (std::uint32_t i = first; i < end; ++i)
      extents.push_back(extent_of(package_.objects[leaves[i].object], leaves[i].transform));
    const auto extent = [&](std::uint32_t i) -> const Extent& { return extents[i - first]; };
    std::vector<std::uint32_t> order(end - first), open, around;
    std::iota(order.begin(), order.end(), first);
    std::sort(order.begin(), order.end(), [&](std::uint32_t one, std::uint32_t other) {
      return std::tuple(extent(one).lo[0], is_negative(leaves[one]), one) <
             std::tuple(extent(other).lo[0], is_negative(leaves[other]), other);
    });
    std::map<std::uint32_t, Container> containers;
    for (const std::uint32_t inner : order) {
      if (!is_negative(leaves[inner])) {
        open.push_back(inner);
        continue;
      }
      work_ += open.size();
      if (work_ > kMostWork) return;
      std::erase_if(open, [&](std::uint32_t i) { return extent(i).hi[0] < extent(inner).lo[0]; });
      around.clear();
      std::copy_if(open.begin(), open.end(), std::back_inserter(around),
                   [&](std::uint32_t i) { return extent(i).holds(extent(inner)); });
      std::sort(around.begin(), around.end());
      for (const std::uint32_t outer : around) {
        const Leaf& leaf = leaves[outer];
        const auto found = containers.try_emplace(outer, package_.objects[leaf.object], leaf.transform, extent(outer)).first;
        if (!is_within(leaves[inner], found->second)) continue;
        leaves[inner].container = outer;
        break;
      }
    }
  }

 private:
  /// Some corners tell of all: a void that leaves the solid is none.
  bool is_within(const Leaf& leaf, const Container& container) const {
    const ModelObject& object = package_.objects[leaf.object];
    const std::size_t last = object.triangles.size() - 1;
    for (std::size_t k = 0; k < 3; ++k) {
      const std::uint32_t corner = object.triangles[k * last / 2][k];
      if (!container.holds(moved(leaf.transform, object.vertices[corner]))) return false;
    }
    return true;
  }

  const ModelPackage& package_;
  std::vector<std::optional<double>> volumes_;  // of objects, six times
  std::uint64_t work_ = 0;
};

}  // namespace

void find_cavities(const ModelPackage& package, std::vector<Leaf>& leaves) {
  Search search(package);
  for (std::uint32_t begin = 0, end = 0; begin < leaves.size(); begin = end) {
    while (end < leaves.size() && leaves[end].item == leaves[begin].item) ++end;
    search.item(leaves, begin, end);
  }
}

}  // namespace lamina::load
