// stages/load/threemf.cpp: build items and components of a 3MF model become meshes where they stand.
#include <fmt/core.h>
#include <tbb/blocked_range.h>
#include <tbb/parallel_reduce.h>

#include <algorithm>

#include "stages/load/threemf_model.h"

namespace lamina::load {
namespace {

struct Expansion {
  const ModelFile& model;
  std::vector<Leaf> leaves;
  std::uint64_t supports = 0;

  void add(std::uint32_t object, const Transform& transform, std::uint32_t item) {
    const ModelObject& it = model.objects[object];
    if (it.type == ModelObject::Type::kSupport) {
      ++supports;
      return;
    }
    if (!it.triangles.empty()) leaves.push_back({object, transform, item});
    for (const auto& component : it.components) add(component.object, after(transform, component.transform), item);
  }
};

std::string label(const ModelObject& object) {
  return object.name.empty() ? fmt::format("object {}", object.id) : fmt::format("object {} \"{}\"", object.id, object.name);
}

struct Worst {
  Box bounds;
  std::size_t bad = SIZE_MAX;  // first triangle that cannot be snapped
};

Result<Facets> snap_leaf(const Source& source, const ModelObject& object, const Leaf& leaf, double unit_mm,
                         const LoadOptions& options) {
  // The unit is part of the transform here, so that item and component translations are scaled by it.
  Transform unit;
  unit.linear = {unit_mm, 0, 0, 0, unit_mm, 0, 0, 0, unit_mm};
  const Snapper snapper(after(options.transform, after(unit, leaf.transform)), 1.0);
  Facets facets;
  const std::size_t count = object.triangles.size();
  facets.triangles.resize(count);
  const auto snap = [&](std::size_t i, Triangle& out) {
    const auto& [a, b, c] = object.triangles[i];
    const std::array<std::uint32_t, 3> corner{a, snapper.mirrors() ? c : b, snapper.mirrors() ? b : c};
    const std::array<Point3*, 3> point{&out.a, &out.b, &out.c};
    for (std::size_t k = 0; k < 3; ++k) {
      if (corner[k] >= object.vertices.size()) return Snapped::kNotFinite;
      const auto& v = object.vertices[corner[k]];
      const Snapped snapped = snapper.snap(v[0], v[1], v[2], *point[k]);
      if (snapped != Snapped::kYes) return snapped;
    }
    return Snapped::kYes;
  };
  const Worst worst = tbb::parallel_reduce(
      tbb::blocked_range<std::size_t>(0, count, 1 << 13), Worst{},
      [&](const tbb::blocked_range<std::size_t>& range, Worst so_far) {
        for (std::size_t i = range.begin(); i != range.end(); ++i) {
          Triangle& t = facets.triangles[i];
          if (snap(i, t) != Snapped::kYes) {
            so_far.bad = std::min(so_far.bad, i);
            continue;
          }
          so_far.bounds.add(t.a), so_far.bounds.add(t.b), so_far.bounds.add(t.c);
        }
        return so_far;
      },
      [](Worst one, const Worst& other) {
        one.bounds.add(other.bounds);
        one.bad = std::min(one.bad, other.bad);
        return one;
      });
  facets.bounds = worst.bounds;
  if (worst.bad == SIZE_MAX) return facets;
  std::size_t kept = 0;
  for (std::size_t i = 0; i < count; ++i) {
    Triangle t{};
    const Snapped snapped = snap(i, t);
    if (snapped == Snapped::kYes) {
      facets.triangles[kept++] = t;
    } else if (snapped == Snapped::kBeyondReach || !options.drop_bad) {
      return source.error(fmt::format("{}, triangle {}: {}", label(object), i + 1, what_is_wrong(snapped)));
    }
  }
  facets.triangles.resize(kept);
  facets.notes.push_back({true, fmt::format("{} triangles with coordinates that are not finite dropped", count - kept)});
  return facets;
}

/// Whether two meshes are the same but for a translation, and which. Copies on a plate mostly are; where the
/// snapping of a single coordinate came out differently, they are not and keep their own mesh.
bool is_moved_copy(const Facets& original, const Facets& copy, Point3& offset) {
  if (original.triangles.size() != copy.triangles.size() || original.bounds.empty()) return false;
  const std::int64_t x = std::int64_t{copy.bounds.lo.x} - original.bounds.lo.x,
                     y = std::int64_t{copy.bounds.lo.y} - original.bounds.lo.y,
                     z = std::int64_t{copy.bounds.lo.z} - original.bounds.lo.z;
  if (std::max({std::abs(x), std::abs(y), std::abs(z)}) > kNmReach) return false;
  offset = {static_cast<Nm>(x), static_cast<Nm>(y), static_cast<Nm>(z)};
  const auto moved = [&](const Point3& p, const Point3& q) { return p.x + x == q.x && p.y + y == q.y && p.z + z == q.z; };
  return std::equal(
      original.triangles.begin(), original.triangles.end(), copy.triangles.begin(),
      [&](const Triangle& p, const Triangle& q) { return moved(p.a, q.a) && moved(p.b, q.b) && moved(p.c, q.c); });
}

}  // namespace

std::vector<Leaf> expand(const ModelFile& model, std::vector<Note>& notes) {
  Expansion expansion{model, {}, 0};
  std::uint64_t other = 0;
  for (std::uint32_t i = 0; i < model.items.size(); ++i) {
    const auto& item = model.items[i];
    if (model.objects[item.object].type == ModelObject::Type::kOther) {
      ++other;
      continue;
    }
    expansion.add(item.object, item.transform, i);
  }
  if (expansion.supports > 0)
    notes.push_back({false, fmt::format("{} objects are supports or surfaces and are not planned", expansion.supports)});
  if (other > 0) notes.push_back({false, fmt::format("{} build items are of type \"other\" and are not planned", other)});
  return std::move(expansion.leaves);
}

Result<Package> read_3mf(const Source& source, const LoadOptions& options) {
  if (const Status whole = check_package(source, options); !whole) return whole.error();
  const Result<ModelFile> model = read_model(source);
  if (!model) return model.error();
  Package package;
  for (const std::string& warning : model->warnings) package.notes.push_back({false, "lib3mf warns: " + warning});
  if (model->items.empty()) return source.error("has no build items: nothing is to be printed; export it again");
  const std::vector<Leaf> leaves = expand(*model, package.notes);
  if (leaves.empty()) return source.error("its build items hold no triangles to print");

  std::vector<std::size_t> first_of_object(model->objects.size(), SIZE_MAX);  // index in package.objects
  std::vector<const Leaf*> leaf_of_package;
  for (const Leaf& leaf : leaves) {
    const ModelObject& object = model->objects[leaf.object];
    std::size_t& first = first_of_object[leaf.object];
    const bool shares_turn = first != SIZE_MAX && leaf_of_package[first]->transform.linear == leaf.transform.linear;
    if (shares_turn && leaf_of_package[first]->transform.translation == leaf.transform.translation) {
      package.objects[first].offsets.push_back(package.objects[first].offsets.front());
      continue;
    }
    Result<Facets> facets = snap_leaf(source, object, leaf, model->unit_mm, options);
    if (!facets) return facets.error();
    Point3 offset{};
    if (shares_turn && is_moved_copy(package.objects[first].facets, *facets, offset)) {
      package.objects[first].offsets.push_back(offset);
      continue;
    }
    if (first == SIZE_MAX) first = package.objects.size();
    package.objects.push_back({label(object), std::move(*facets), {{0, 0, 0}}});
    leaf_of_package.push_back(&leaf);
  }
  return package;
}

}  // namespace lamina::load
