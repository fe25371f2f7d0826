// stages/load/threemf/expansion.cpp: references are followed down to meshes, and those inside out within another one are voids.
#include "stages/load/threemf/expansion.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <map>
#include <numeric>
#include <optional>
#include <tuple>
#include <utility>

#include "stages/load/text.h"
#include "stages/load/threemf/extensions.h"
#include "stages/load/winding/winding.h"

namespace lamina::load {
namespace {

/// What an object comes to when its components are followed.
struct Expanded {
  std::uint64_t objects = 0, triangles = 0;
  std::uint32_t height = 0;
  bool open = false;
};

constexpr std::uint64_t kTooMany = std::uint64_t{1} << 62;

Status resolve(const Source& source, const ModelPackage& package, ObjectReference& reference) {
  const auto found = package.object_of_id.find({reference.file, reference.id});
  if (found == package.object_of_id.end())
    return source.error(fmt::format("line {} names object {} of {}, which does not contain it; export it again", reference.line,
                                    reference.id, package.files[reference.file].name.substr(1)));
  reference.object = found->second;
  return {};
}

/// Counts objects and triangles below an object. false  it contains itself, or is too deep
bool count_below(const ModelPackage& package, std::vector<Expanded>& all, std::uint32_t index, std::uint32_t depth) {
  Expanded& it = all[index];
  if (it.objects > 0) return true;
  if (it.open || depth > kDeepestComponents) return false;
  it.open = true;
  std::uint64_t objects = 1, triangles = package.objects[index].triangles.size();
  for (const ObjectReference& component : package.objects[index].components) {
    if (!count_below(package, all, component.object, depth + 1)) return false;
    const Expanded& below = all[component.object];
    objects = std::min(objects + below.objects, kTooMany);
    triangles = std::min(triangles + below.triangles, kTooMany);
    it.height = std::max(it.height, below.height + 1);
  }
  it.open = false;
  it.objects = objects;
  it.triangles = triangles;
  return it.height <= kDeepestComponents;
}

bool refers_forward(const ModelPackage& package) {
  for (std::uint32_t i = 0; i < package.objects.size(); ++i) {
    for (const ObjectReference& component : package.objects[i].components)
      if (component.file == package.objects[i].file && component.object > i) return true;
  }
  return false;
}

/// Whether a mesh is its own bounding box, as a mesh is that only stands for slices.
bool is_box(const ModelObject& object) {
  if (object.triangles.size() != 12 || object.vertices.empty()) return false;
  auto lo = object.vertices.front(), hi = lo;
  for (const auto& v : object.vertices) {
    for (std::size_t axis = 0; axis < 3; ++axis) lo[axis] = std::min(lo[axis], v[axis]), hi[axis] = std::max(hi[axis], v[axis]);
  }
  return std::all_of(object.vertices.begin(), object.vertices.end(), [&](const auto& v) {
    return (v[0] == lo[0] || v[0] == hi[0]) && (v[1] == lo[1] || v[1] == hi[1]) && (v[2] == lo[2] || v[2] == hi[2]);
  });
}

/// What is said of an object that lamina cannot plan as the mesh that it holds.
Status check_content(const Source& source, const ModelPackage& package, const ModelObject& object) {
  const auto refused = [&](std::string_view space, std::string_view what) {
    return source.error(fmt::format("{} {} the extension {}, which lamina does not read; {}", label(package, object), what,
                                    extension_label(space), extension_of(space).remedy));
  };
  const bool has_mesh = !object.triangles.empty();
  if (object.beams > 0 && (package.needs_beams || !has_mesh))
    return refused(kBeamNamespace, fmt::format("has {} beams of", object.beams));
  if (object.low_resolution || (object.sliced && object.components.empty() && (!has_mesh || is_box(object))))
    return refused(kSliceNamespace, "is defined by slices, with a mesh only as placeholder, of");
  if (!has_mesh && object.components.empty() && !object.content.empty())
    return refused(object.content, "consists of geometry of");
  return {};
}

struct Expansion {
  const Source& source;
  const ModelPackage& package;
  std::vector<Leaf> leaves = {};
  std::uint64_t supports = 0, surfaces = 0, others = 0, modifiers = 0, not_printable = 0;
  std::uint32_t item = 0;
  std::vector<bool> reported;  // of objects

  Status add(const ObjectReference& reference, const Transform& transform, std::vector<Note>& notes) {
    const std::uint32_t index = reference.object;
    const ModelObject& object = package.objects[index];
    if (reference.role == Role::kNegative || object.role == Role::kNegative) return negative(object, "is");
    if (reference.role == Role::kModifier || object.role == Role::kModifier) {
      ++modifiers;
      return {};
    }
    const bool is_mesh = object.components.empty();  // the type of others is that of their components
    if (is_mesh && object.type != ModelObject::Type::kModel) {
      ++(object.type == ModelObject::Type::kSupport   ? supports
         : object.type == ModelObject::Type::kSurface ? surfaces
                                                      : others);
      return {};
    }
    if (!reported[index]) {
      if (const Status fits = check_content(source, package, object); !fits) return fits;
      for (const Volume& volume : object.volumes) {
        if (volume.role == Role::kNegative)
          return negative(object, fmt::format("has {},", quoted(std::string_view(volume.name))));
      }
      report(object, notes);
      reported[index] = true;
    }
    const double unit = package.files[object.file].unit_mm;
    if (!object.triangles.empty()) {
      Transform scaled;
      scaled.linear = {unit, 0, 0, 0, unit, 0, 0, 0, unit};
      leaves.push_back({index, after(transform, scaled), item});
    }
    for (const ObjectReference& component : object.components)
      if (const Status added = add(component, after(transform, component.transform), notes); !added) return added;
    return {};
  }

  Status negative(const ModelObject& object, std::string_view is) const {
    return source.error(
        fmt::format("{} {} a negative volume that takes material away, which lamina does not; export it as STL "
                    "from the program that wrote it, which cuts it out",
                    label(package, object), is));
  }

  void report(const ModelObject& object, std::vector<Note>& notes) const {
    const auto count = std::count_if(object.volumes.begin(), object.volumes.end(),
                                     [](const Volume& volume) { return volume.role == Role::kModifier; });
    if (count > 0)
      notes.push_back(
          {false, fmt::format("{}: {} of its volumes, such as {}, are modifiers or support blockers and are not planned",
                              label(package, object), count, quoted(std::string_view(object.volumes.front().name)))});
    if (object.beams > 0)
      notes.push_back(
          {false, fmt::format("{}: {} beams of a lattice, which the file does not require, are not planned; its mesh is",
                              label(package, object), object.beams)});
    if (object.sliced) notes.push_back({false, fmt::format("{}: its mesh is planned, not its slices", label(package, object))});
  }
};

// --- an object inside out within another one is a void.

using Point = Vector;

// What adjacent objects need, and a million voids at some 200 inspections a point.
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

bool is_finite(const Point& at) { return std::isfinite(at[0]) && std::isfinite(at[1]) && std::isfinite(at[2]); }

Point moved(const Transform& transform, const Point& at) {
  Point out = multiply(transform.linear, at);
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
  const Point start = multiply(back.linear, transform.translation);
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
  /// Copies that are only moved share one pass over their triangles; sums are rounded the same either way.
  Extent extent(const Leaf& leaf) {
    const auto [found, is_new] = turned_.try_emplace({leaf.object, leaf.transform.linear});
    if (is_new) found->second = extent_of(package_.objects[leaf.object], {leaf.transform.linear, {}});
    Extent placed = found->second;
    for (std::size_t axis = 0; axis < 3; ++axis)
      placed.lo[axis] += leaf.transform.translation[axis], placed.hi[axis] += leaf.transform.translation[axis];
    return placed;
  }

  /// Some corners decide for all: a void that leaves the solid is none.
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

/// Gives the leaves of negative volume that lie within one of positive volume of the same build item their container: the rule
/// by which 3MF fills a group of meshes makes them voids. All others of negative volume are no solid by that rule, and are left
/// to be turned over: programs that mirror write them.
///
/// leaves  in the order of the build
/// source  3MF Consortium, Core Specification 1.3, sections 4.1, 4.1.1 and 3.4.3.1
/// cost    two passes over the triangles of items that have an object of negative volume, one of others of several objects;
///         100 bytes a triangle of the objects that may contain such an one, once for all copies; a bounded number of facets
///         is inspected, half a minute at worst, after which the others are left, with a note
void find_cavities(const ModelPackage& package, std::vector<Leaf>& leaves, std::vector<Note>& notes) {
  CavitySearch search(package);
  for (std::uint32_t begin = 0, end = 0; begin < leaves.size(); begin = end) {
    while (end < leaves.size() && leaves[end].item == leaves[begin].item) ++end;
    search.item(leaves, begin, end);
  }
  if (search.gave_up())
    notes.push_back({true,
                     "has too many nested objects to detect all voids: inside-out objects that are not reported as voids are "
                     "planned as solids"});
}

}  // namespace

Status resolve_references(const Source& source, ModelPackage& package, std::uint64_t triangle_limit) {
  for (ModelObject& object : package.objects) {
    for (ObjectReference& component : object.components)
      if (const Status found = resolve(source, package, component); !found) return found;
  }
  std::vector<Expanded> all(package.objects.size());
  std::uint64_t objects = 0, triangles = 0;
  for (std::uint32_t i = 0; i < package.objects.size(); ++i) {
    if (!count_below(package, all, i, 0))
      return source.error(fmt::format("an object contains itself, or components are nested more than {} deep; export it again",
                                      kDeepestComponents));
    objects = std::max(objects, all[i].objects);
  }
  for (ObjectReference& item : package.items) {
    if (const Status found = resolve(source, package, item); !found) return found;
    objects = std::min(objects + all[item.object].objects, kTooMany);
    triangles = std::min(triangles + all[item.object].triangles, kTooMany);
  }
  if (triangles > triangle_limit)
    return source.error(fmt::format("its components expand to more triangles than the limit of {}", triangle_limit));
  if (objects > kMaxObjects)
    return source.error(fmt::format("its components expand to more than {} objects; export them as one", kMaxObjects));
  package.has_forward_references = refers_forward(package);
  return {};
}

Result<std::vector<Leaf>> expand_build(const Source& source, const ModelPackage& package, std::vector<Note>& notes) {
  Expansion expansion{.source = source, .package = package, .reported = std::vector<bool>(package.objects.size())};
  for (const ObjectReference& item : package.items) {
    if (!item.printable) {
      ++expansion.not_printable, ++expansion.item;
      continue;
    }
    const ModelObject& object = package.objects[item.object];
    if (object.type == ModelObject::Type::kOther && object.components.empty())
      return source.error(fmt::format("the build names {}, which is of type \"other\", as 3MF forbids; export it again",
                                      label(package, object)));
    if (const Status added = expansion.add(item, item.transform, notes); !added) return added.error();
    ++expansion.item;
  }
  std::string all;  // that is left out
  const auto left_out = [&](std::uint64_t count, const char* what, const char* kind) {
    if (count == 0) return;
    notes.push_back({false, fmt::format("{} {}{} not planned: {}", count, what, count == 1 ? " is" : "s are", kind)});
    all += (all.empty() ? "" : "; ") + notes.back().text;
  };
  left_out(expansion.supports, "object", "support");
  left_out(expansion.surfaces, "object", "type \"surface\", which is no solid");
  left_out(expansion.modifiers, "object", "modifier or support blocker of the program that wrote the file");
  left_out(expansion.others, "object", "type \"other\" (modifiers, say)");
  left_out(expansion.not_printable, "build item", "marked as not printable");
  if (expansion.leaves.empty() && !all.empty())
    return source.error(fmt::format("nothing to print ({}); export the part as a printable object of type \"model\"", all));
  if (expansion.leaves.empty()) return source.error("its build items hold no triangles to print");
  find_cavities(package, expansion.leaves, notes);
  return std::move(expansion.leaves);
}

}  // namespace lamina::load
