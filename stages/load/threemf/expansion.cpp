#include "stages/load/threemf/expansion.h"

#include <fmt/core.h>

#include <algorithm>
#include <utility>

#include "stages/load/matrix.h"
#include "stages/load/messages.h"
#include "stages/load/text.h"
#include "stages/load/threemf/cavities.h"
#include "stages/load/threemf/extensions.h"

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
    return source.error(fmt::format("line {} names object {} of {}, which does not hold it; export it again", reference.line,
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
    for (const ObjectReference& component : package.objects[i].components) {
      if (component.file == package.objects[i].file && component.object > i) return true;
    }
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
                                    extension_label(space), extension_remedy(space)));
  };
  const bool has_mesh = !object.triangles.empty();
  if (object.beams > 0 && (package.needs_beams || !has_mesh))
    return refused(kBeamNamespace, fmt::format("has {} beams of", object.beams));
  if (object.low_resolution || (object.sliced && object.components.empty() && (!has_mesh || is_box(object))))
    return refused(kSliceNamespace, "has slices that say what it is, beside a mesh that only stands for it, of");
  if (!has_mesh && object.components.empty() && !object.content.empty())
    return refused(object.content, "consists of geometry of");
  return {};
}

struct Expansion {
  const Source& source;
  const ModelPackage& package;
  std::vector<Leaf> leaves;
  std::uint64_t supports = 0, others = 0, modifiers = 0;
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
      ++(object.type == ModelObject::Type::kSupport ? supports : others);
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
    for (const ObjectReference& component : object.components) {
      if (const Status added = add(component, after(transform, component.transform), notes); !added) return added;
    }
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

}  // namespace

Status resolve_references(const Source& source, ModelPackage& package, std::uint64_t triangle_limit) {
  for (ModelObject& object : package.objects) {
    for (ObjectReference& component : object.components) {
      if (const Status found = resolve(source, package, component); !found) return found;
    }
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
  Expansion expansion{source, package, {}, 0, 0, 0, 0, std::vector<bool>(package.objects.size())};
  for (const ObjectReference& item : package.items) {
    const ModelObject& object = package.objects[item.object];
    if (object.type == ModelObject::Type::kOther && object.components.empty())
      return source.error(fmt::format("the build names {}, which is of type \"other\", as 3MF forbids; export it again",
                                      label(package, object)));
    if (const Status added = expansion.add(item, item.transform, notes); !added) return added.error();
    ++expansion.item;
  }
  const auto left_out = [&](std::uint64_t count, const char* what) {
    if (count > 0) notes.push_back({false, fmt::format("{} objects are {} and are not planned", count, what)});
  };
  left_out(expansion.supports, "supports or surfaces");
  left_out(expansion.modifiers, "modifiers or support blockers of the program that wrote them");
  left_out(expansion.others, "of type \"other\" (modifiers, say)");
  find_cavities(package, expansion.leaves, notes);
  return std::move(expansion.leaves);
}

}  // namespace lamina::load
