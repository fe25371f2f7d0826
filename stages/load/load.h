// stages/load/load.h: part files become meshes in integer nanometres.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <string_view>

#include "stages/data/choices.h"
#include "stages/data/mesh.h"
#include "stages/data/status.h"

namespace lamina::load {

/// Where a part file's numbers are turned into nanometres, before snapping and in double precision:
/// point_nm = llround(1e6 * (linear * point + translation)), applied per coordinate.
struct Transform {
  std::array<double, 9> linear{1, 0, 0, 0, 1, 0, 0, 0, 1};  // row-major
  std::array<double, 3> translation{0, 0, 0};               // mm
  bool mirrors() const;                                     // negative determinant: facets must be turned over
};

/// scale (per axis), then rotation about x, y, z in that order (degrees), then shrink factors (per axis of the bed).
/// Rotations by multiples of 90 degrees are exact.
Transform make_transform(const std::array<double, 3>& scale, const std::array<double, 3>& rotate_deg,
                         const std::array<double, 3>& shrink);

/// The distance that repair doubles until openings stop falling; any other is used as it is.
inline constexpr std::int64_t kWeldByItself = 5'000;

/// Memory that readers work in, 700 KB a thread, of which small files touch little. Who reads many files keeps it from one to
/// the next: taken anew for each, it would leave holes between the meshes that stay, larger than these. One file at a time.
struct Scratch;
std::shared_ptr<Scratch> make_scratch(Isa isa = Isa::kAuto);

class PartStore;  // stages/load/part_store.h

struct LoadOptions {
  Transform transform;
  double unit_mm = 1.0;              // mm per unit of files that carry none (STL, OBJ); 3MF states its own
  bool drop_bad = false;             // drop facets with coordinates that are not finite instead of refusing the file
  bool repair = true;                // orient, remove duplicates, weld and cap a mesh that is not closed (repair.h)
  bool blocks = false;               // closed meshes may come as Mesh::blocks, which are read in one pass, not as lists
  bool shown_only = false;           // blocks are shown instead of being kept: a mesh that would come so has no triangles
  bool order = false;                // blocks know the order of the file, 2 bytes a triangle
  Isa isa = Isa::kAuto;              // widest instructions of the loops that make blocks; no mesh depends on it
  std::shared_ptr<Scratch> scratch;  // none: each file takes its own
  bool turn_shells = true;           // shells that are inside out and overlap others are turned over (shells.h), with a note
  bool winding = false;              // close such a mesh by its winding number instead of caps: approximate
  std::int64_t weld_nm = kWeldByItself;       // repair joins open edges that are at most this far apart
  std::uint64_t triangle_limit = 1ull << 30;  // refused above; a header can lie, so sizes are checked against the file first
  std::uint64_t expanded_limit = 8ull << 30;  // bytes a compressed file may expand to
  std::shared_ptr<PartStore> store;           // parts and unpacked files of other jobs; none: each call reads the file
};

/// Is shown the triangles of a file in pieces, each in the order of the file, by any thread.
/// first    the number of the first
/// returns  false: the mesh is needed as a list
using SeeTriangles = std::function<bool(std::uint32_t first, std::span<const Triangle>)>;

/// Reads a part file; the format follows from its content first, then from its name: STL (binary, ASCII), OBJ, 3MF,
/// and gzip of STL or OBJ.
///
/// returns  meshes with repaired, closed triangle lists (unless options.repair is off), one instance per mesh object of
///          each build item (a single one for STL and OBJ); coordinates as in the file after the transform, not yet
///          placed on a bed. Copies in a 3MF file share a mesh where every vertex snaps to the same place but for a
///          whole translation. Numbers in text (STL, OBJ, 3MF) are read in double precision. A closed object of a 3MF file
///          whose volume is negative is turned over, with a note, and so are shells of any closed mesh (options.turn_shells).
/// errors   kInput, one line: the file, the place in it (facet and byte, or line), what to do
/// cost     two passes over the triangles, parallel; 36 bytes a triangle, 150 more while a mesh is repaired, and the
///          inflated bytes while a compressed file is read. A binary STL with options.blocks: one pass, 13 to 38 bytes a
///          triangle, if it is sound; else it is read a second time for its list
/// see      is shown all triangles of a mesh that comes as blocks, while they are in a core's cache; with options.shown_only it
///          is `see` that says whether the mesh is sound
Result<Part> load(const std::string& path, const LoadOptions& options, const SeeTriangles& see = {});

/// What load() would take the file for, in words: "binary STL", "ASCII STL, gzip", "OBJ", "3MF".
/// errors  kInput as load()
Result<std::string> format_of(const std::string& path, const LoadOptions& options);

/// Whether a file of this name is taken for a part: .stl, .obj or .3mf, gzipped (.gz) too, in any case.
bool is_part_name(std::string_view path);

/// Memory in bytes that a part file of this name and size may take while it is loaded and planned; a file of another kind
/// its own size.
std::uint64_t part_bytes(std::string_view path, std::uint64_t file_bytes);

}  // namespace lamina::load
