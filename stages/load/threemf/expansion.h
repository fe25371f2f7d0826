// stages/load/threemf/expansion.h: build items are followed down to meshes; internal to load.
#pragma once

#include <cstdint>
#include <vector>

#include "stages/load/reader.h"
#include "stages/load/threemf/model.h"

namespace lamina::load {

inline constexpr std::uint64_t kMaxObjects = 1u << 20;
inline constexpr std::uint32_t kDeepestComponents = 1000;

/// A mesh that is printed, and what happens to it: from its file's numbers, in the file's unit, to mm.
struct Leaf {
  std::uint32_t object;
  Transform transform;
  std::uint32_t item = 0;            // of the build, from 0
  std::uint32_t container = kSolid;  // the leaf in which it is a void
  static constexpr std::uint32_t kSolid = UINT32_MAX;
};

/// Finds the objects that build items and components name, and what all of it comes to, before anything is expanded.
///
/// errors  kInput: a name that leads to nothing; an object that contains itself; components nested more than
///         kDeepestComponents deep; more than kMaxObjects objects, or more triangles than the limit, in the build or in one
///         object
/// cost    linear in components
Status resolve_references(const Source& source, ModelPackage& package, std::uint64_t triangle_limit);

/// The meshes of the build in its order, at least one. Supports, surfaces, modifiers, objects of type "other" and items that
/// are marked as not printable are left out, with a note.
///
/// errors  kInput: nothing is left, and why; a build item of type "other"; what only an extension could make a solid of; what
/// takes material away
Result<std::vector<Leaf>> expand_build(const Source& source, const ModelPackage& package, std::vector<Note>& notes);

}  // namespace lamina::load
