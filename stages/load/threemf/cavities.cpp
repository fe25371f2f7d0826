#include "stages/load/threemf/cavities.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <limits>
#include <map>
#include <numeric>
#include <optional>
#include <tuple>
#include <utility>
#include <vector>

#include "stages/load/matrix.h"
#include "stages/load/winding/winding.h"

namespace lamina::load {
namespace {

using Point = std::array<double, 3>;

// What objects that lie side by side need, and a million voids at some 200 looks a point.
constexpr std::uint64_t kMaxWork = std::uint64_t{1} << 28;      // boxes compared
constexpr std::uint64_t kMaxCompared = std::uint64_t{1} << 29;  // facets, and boxes of facets, that points were held against

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

bool is_finite(const Point& at) { return std::isfinite(at[0]) && std::isfinite(at[1]) && std::isfinite(at[2]); }

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
      if (!is_finite(at)) continue;
      for (std::size_t axis = 0; axis < 3; ++axis) {
        extent.lo[axis] = std::min(extent.lo[axis], at[axis]);
        extent.hi[axis] = std::max(extent.hi[axis], at[axis]);
      }
    }
  }
  return extent;
}

/// The way back. nullopt: the transform flattens
std::optional<Transform> inverse(const Transform& transform) {
  const Matrix& m = transform.linear;
  const Point x{m[0], m[3], m[6]}, y{m[1], m[4], m[7]}, z{m[2], m[5], m[8]};
  const Point rows[] = {cross(y, z), cross(z, x), cross(x, y)};
  const double determinant = dot(x, rows[0]);
  Transform back;
  for (std::size_t row = 0; row < 3; ++row)
    for (std::size_t column = 0; column < 3; ++column) back.linear[3 * row + column] = rows[row][column] / determinant;
  const Point start = lamina::load::apply(back.linear, transform.translation);
  for (std::size_t axis = 0; axis < 3; ++axis) back.translation[axis] = -start[axis];
  if (!std::all_of(back.linear.begin(), back.linear.end(), [](double one) { return std::isfinite(one); }) || !is_finite(start))
    return std::nullopt;
  return back;
}

/// How often an object goes around points near it, in its own coordinates: one for all of its copies.
class Container {
 public:
  Container(const ModelObject& object, double unit_mm) {
    const Extent extent = extent_of(object, {});
    from_ = extent.lo;
    const Point sides = minus(extent.hi, extent.lo);
    const double size = std::max({sides[0], sides[1], sides[2]});
    if (!(size > 1e-100 && size < 1e100)) return;
    // A nanometre is halved as often as the reach allows, so that what transforms enlarge is as fine.
    const double reach = static_cast<double>(kNmReach);
    scale_ = std::min(1e6 * unit_mm, reach / size);
    while (2 * scale_ * size <= reach) scale_ *= 2;
    Buffer<Triangle> triangles;
    triangles.reserve(object.triangles.size());
    const auto at = [&](const Point& corner) {
      const Point steps = in_steps(corner);
      return Point3{static_cast<Nm>(steps[0]), static_cast<Nm>(steps[1]), static_cast<Nm>(steps[2])};
    };
    for (const auto& corners : object.triangles) {
      const Point &a = object.vertices[corners[0]], &b = object.vertices[corners[1]], &c = object.vertices[corners[2]];
      if (is_finite(a) && is_finite(b) && is_finite(c)) triangles.push_back({at(a), at(b), at(c)});
    }
    tree_.emplace(triangles, Point3{0, 0, 0});
  }
  bool holds(const Point& point, std::uint64_t& inspected) const {
    return tree_ && is_finite(point) && tree_->at(in_steps(point), &inspected) > 0.75;
  }

 private:
  Point in_steps(Point at) const {
    at = minus(at, from_);
    for (double& axis : at) axis = std::min(static_cast<double>(kNmReach), std::round(scale_ * axis));
    return at;
  }
  Point from_{};
  double scale_ = 0;  // steps of the grid in the file's unit
  std::optional<WindingTree> tree_;
};

class CavitySearch {
 public:
  explicit CavitySearch(const ModelPackage& package) : package_(package), volumes_(package.objects.size()) {}

  bool is_negative(const Leaf& leaf) {
    std::optional<double>& volume = volumes_[leaf.object];
    if (!volume) volume = volume_of(package_.objects[leaf.object]);
    return *volume < 0;
  }

  /// Whether there was too much to compare.
  bool gave_up() const { return work_ > kMaxWork || compared_ > kMaxCompared; }

  /// The leaves from `first` to `end` are of one item. Solids are met in the order of their left ends and kept up to the right.
  void item(std::vector<Leaf>& leaves, std::uint32_t first, std::uint32_t end) {
    const auto negative = [&](const Leaf& leaf) { return is_negative(leaf); };
    if (end - first < 2 || gave_up() || std::none_of(leaves.begin() + first, leaves.begin() + end, negative)) return;
    std::vector<Extent> extents;
    for (std::uint32_t i = first; i < end; ++i) extents.push_back(extent(leaves[i]));
    const auto box = [&](std::uint32_t i) -> const Extent& { return extents[i - first]; };
    std::vector<std::uint32_t> order(end - first), open, around;
    std::iota(order.begin(), order.end(), first);
    std::sort(order.begin(), order.end(), [&](std::uint32_t one, std::uint32_t other) {
      return std::tuple(box(one).lo[0], is_negative(leaves[one]), one) <
             std::tuple(box(other).lo[0], is_negative(leaves[other]), other);
    });
    for (const std::uint32_t inner : order) {
      if (!is_negative(leaves[inner])) {
        open.push_back(inner);
        continue;
      }
      work_ += open.size();
      if (gave_up()) return;
      std::erase_if(open, [&](std::uint32_t i) { return box(i).hi[0] < box(inner).lo[0]; });
      around.clear();
      std::copy_if(open.begin(), open.end(), std::back_inserter(around),
                   [&](std::uint32_t i) { return box(i).holds(box(inner)); });
      std::sort(around.begin(), around.end());
      for (const std::uint32_t outer : around) {
        if (gave_up()) return;
        if (!is_within(leaves[inner], leaves[outer])) continue;
        leaves[inner].container = outer;
        break;
      }
    }
  }

 private:
  /// Copies that are moved alone share a look at their triangles; sums are rounded the same either way.
  Extent extent(const Leaf& leaf) {
    const auto [found, is_new] = turned_.try_emplace({leaf.object, leaf.transform.linear});
    if (is_new) found->second = extent_of(package_.objects[leaf.object], {leaf.transform.linear, {}});
    Extent placed = found->second;
    for (std::size_t axis = 0; axis < 3; ++axis)
      placed.lo[axis] += leaf.transform.translation[axis], placed.hi[axis] += leaf.transform.translation[axis];
    return placed;
  }

  /// Some corners tell of all: a void that leaves the solid is none.
  bool is_within(const Leaf& leaf, const Leaf& outer) {
    const std::optional<Transform> back = inverse(outer.transform);
    if (!back) return false;
    const ModelObject &object = package_.objects[leaf.object], &around = package_.objects[outer.object];
    const Container& container =
        containers_.try_emplace(outer.object, around, package_.files[around.file].unit_mm).first->second;
    const Transform inward = after(*back, leaf.transform);
    const std::size_t last = object.triangles.size() - 1;
    for (std::size_t k = 0; k < 3; ++k) {
      const std::uint32_t corner = object.triangles[k * last / 2][k];
      if (!container.holds(moved(inward, object.vertices[corner]), compared_)) return false;
    }
    return true;
  }

  const ModelPackage& package_;
  std::vector<std::optional<double>> volumes_;     // of objects, six times
  std::map<std::uint32_t, Container> containers_;  // by object
  std::map<std::pair<std::uint32_t, Matrix>, Extent> turned_;
  std::uint64_t work_ = 0, compared_ = 0;
};

}  // namespace

void find_cavities(const ModelPackage& package, std::vector<Leaf>& leaves, std::vector<Note>& notes) {
  CavitySearch search(package);
  for (std::uint32_t begin = 0, end = 0; begin < leaves.size(); begin = end) {
    while (end < leaves.size() && leaves[end].item == leaves[begin].item) ++end;
    search.item(leaves, begin, end);
  }
  if (search.gave_up())
    notes.push_back({true,
                     "has too many objects within each other to look for all that are voids: what is inside out and not "
                     "called a void is planned as a solid"});
}

}  // namespace lamina::load
