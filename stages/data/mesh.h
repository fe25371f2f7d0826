// stages/data/mesh.h: triangles in integer nanometres, as the loader hands them to every later stage.
#pragma once

#include <algorithm>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "stages/data/buffer.h"
#include "stages/data/units.h"

namespace lamina {

struct Point3 {
  Nm x, y, z;
  friend bool operator==(const Point3&, const Point3&) = default;
  friend auto operator<=>(const Point3&, const Point3&) = default;
};

/// Corners in counter-clockwise order viewed from outside. 36 bytes; corners are stored, not indexed, because only diagnosis
/// needs topology and all else streams triangles.
struct Triangle {
  Point3 a, b, c;
  friend bool operator==(const Triangle&, const Triangle&) = default;
};
static_assert(sizeof(Triangle) == 36);

/// Closed axis-parallel box. The empty box has lo > hi and grows to contain all that is added.
struct Box {
  Point3 lo{INT32_MAX, INT32_MAX, INT32_MAX};
  Point3 hi{INT32_MIN, INT32_MIN, INT32_MIN};

  bool empty() const { return lo.x > hi.x; }
  void add(const Point3& p) {
    lo = {std::min(lo.x, p.x), std::min(lo.y, p.y), std::min(lo.z, p.z)};
    hi = {std::max(hi.x, p.x), std::max(hi.y, p.y), std::max(hi.z, p.z)};
  }
  void add(const Box& other) {
    if (other.empty()) return;
    add(other.lo);
    add(other.hi);
  }
  std::int64_t width() const { return std::int64_t{hi.x} - lo.x; }
  std::int64_t depth() const { return std::int64_t{hi.y} - lo.y; }
  std::int64_t height() const { return std::int64_t{hi.z} - lo.z; }
  Point3 middle() const {
    const auto half = [](Nm low, Nm high) { return static_cast<Nm>((std::int64_t{low} + high) / 2); };
    return {half(lo.x, hi.x), half(lo.y, hi.y), half(lo.z, hi.z)};
  }
};

/// Room that a loader leaves behind a list of triangles, so that later stages can pad it without moving it.
inline constexpr std::size_t kTriangleSlack = 32;

// --- a vertex and a sampling plane: the one rule of every section (bitmaps, contours, the areas of sections).
//
// File formats hold 24 bits of a coordinate, and rotations round: vertices of one horizontal face differ by some nanometres, so
// a plane through them would meet half of its triangles. A vertex up to kPlaneReach above a plane therefore counts as in the
// plane, for this plane alone and in all triangles at once: the mesh stays closed, and no surface moves by more than that.

constexpr bool is_above_plane(std::int64_t z, std::int64_t plane) { return z > plane + kPlaneReach; }

/// The height at which a vertex counts, nm: above the plane, or at most in it.
constexpr Nm height_for_plane(Nm z, std::int64_t plane) {
  return is_above_plane(z, plane) || z <= plane ? z : static_cast<Nm>(plane);
}

class MeshBlocks;  // stages/geometry/blocks/mesh_blocks.h

/// One solid. Triangles T from `repaired_from` on were added by repair (caps over openings).
struct Mesh {
  std::string name;  // file, and the object in it where a file holds several
  Buffer<Triangle> triangles;
  std::uint32_t repaired_from = UINT32_MAX;  // >= triangles.size() when nothing was added
  bool closed =
      true;  // every edge is walked as often one way as the other, on which slicing relies; false where repair was off
  Box bounds;
  std::uint64_t fingerprint = 0;  // of the triangles in any order (load/diagnose.h)
  /// Volume of the triangles, caps included. Shells that overlap count as often as they overlap, hollows count
  /// negative, so the union of a part's shells has less; never negative for a closed mesh, because a mesh that is inside
  /// out as a whole is turned over. An estimate where the mesh is not closed.
  double volume_mm3 = 0;
  /// Area of the triangles that repair added over the area of all, 0 to 1: how much of the surface is a guess.
  double capped_share = 0;
  /// Where the reader of the file requested blocks (load::LoadOptions::blocks), the triangles may be here in place of the list,
  /// which is empty then. Copies share them.
  std::shared_ptr<MeshBlocks> blocks;
};

/// A mesh put somewhere by an integer translation: what copies share.
struct Instance {
  std::uint32_t mesh;  // index into Part::meshes
  Point3 offset;       // nm, added to every vertex
};

/// What was noticed while a file was read and what was done about it; one line each, for a person.
struct Note {
  bool repair = false;  // geometry was changed or guessed, not only remarked on
  std::string text;
};

/// A file as loaded: its meshes, where it puts them relative to each other, and the box around all.
struct Part {
  std::string path;
  std::vector<Mesh> meshes;
  std::vector<Instance> instances;
  Box bounds;
  std::vector<Note> notes;
};

/// What the manifest and the summary say of one [[part]].
struct PartSummary {
  std::string path;
  std::uint32_t copies = 1;
  std::uint64_t triangles = 0;  // of the file, once
  std::uint64_t fingerprint = 0;
  Box bounds;  // nm, of the first copy, on the bed
  std::vector<Note> notes;
};

}  // namespace lamina
