// stages/load/reader.h: what each format's reader gives back; internal to load.
#pragma once

#include <functional>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "stages/data/mesh.h"
#include "stages/data/status.h"
#include "stages/load/load.h"
#include "stages/load/snap.h"
#include "stages/load/source.h"

namespace lamina::load {

/// The file's length contradicts what it says about itself. If its facets close, the statement was wrong and the
/// facets are right; if not, some of them are missing.
struct Doubt {
  std::string note;                // if the mesh is balanced
  std::string error;               // if it is not, and `claimed` is 0
  std::uint64_t claimed = 0;       // facets that the file says it holds where it holds more: the others may be rubbish
  std::string rest_left_out = {};  // note if only those are taken
};

/// A closed mesh whose volume is at most this share of its box may enclose nothing: its pieces are looked at (enclosed.h).
inline constexpr double kHardlyAny = 1e-6;

/// The triangles of a file in its order, turned over if the transform mirrors.
struct Facets {
  Buffer<Triangle> triangles;
  Box bounds;
  std::vector<Note> notes;
  std::optional<Doubt> doubt;
};

enum class Format { kBinaryStl, kAsciiStl, kObj, k3mf, kGzip };

/// Tells the format from the content, and from the name where the content is text that could be anything.
/// errors  kInput: empty, or nothing that is known
Result<Format> detect(const Source& source);

/// Facets of 50 bytes behind a header of 84: normal (12), three corners of three floats (36), attributes (2).
/// cost    one pass, parallel; 256 KiB a thread besides the triangles
/// source  3D Systems, "StereoLithography Interface Specification" (1989)
Result<Facets> read_binary_stl(const Source& source, const Snapper& snapper, const LoadOptions& options);

/// Is shown the triangles of a file in pieces, each in the order of the file, by any thread. first  the number of the first
using SeeTriangles = std::function<void(std::uint32_t first, std::span<const Triangle>)>;

/// The same in one pass, where the mesh is sound: closed, as long as its header says, and enclosing something. As blocks, with
/// what load() has to say of it. returns  nothing where the list of triangles is needed to judge, to repair or to refuse
/// see  may be empty; is shown triangles, all of them where a mesh is returned. For who looks, nothing is returned either where
///      neighbours are far apart in the file
std::optional<Mesh> read_sound_stl(const Source& source, const Snapper& snapper, const LoadOptions& options,
                                   const SeeTriangles& see, std::vector<Note>& notes);

/// As load(), and `see` is shown all triangles of a mesh that comes as blocks, while they are in a core's cache.
Result<Part> load_and_see(const std::string& path, const LoadOptions& options, const SeeTriangles& see);

/// Text, a word after the other; see stl_ascii.cpp for what is tolerated.
/// cost    one pass, parallel over blocks of 1 MiB; 32 MiB of text at a time
Result<Facets> read_ascii_stl(const Source& source, const Snapper& snapper, const LoadOptions& options);

/// Vertices and polygons; see obj.cpp for what is understood.
/// cost    one pass; 12 bytes a vertex and a corner besides the triangles
Result<Facets> read_obj(const Source& source, const Snapper& snapper, const LoadOptions& options);

/// A mesh of a 3MF file with one transform, before census and repair.
struct PlacedObject {
  std::string name;  // in the file, for notes
  Facets facets;
  std::vector<Point3> offsets;  // where it stands, at least once
};
struct Package {
  std::vector<PlacedObject> objects;
  std::vector<Note> notes;
};

/// 3MF: core specification, production extension, components; see threemf/. Numbers are read in double precision, the unit is
/// the file's own.
///
/// errors  kInput: no whole package, or no model that may be planned as what it holds; what it is, and what to do
/// cost    0.3 us a vertex and a triangle; 24 bytes a vertex and 12 a triangle besides the facets
Result<Package> read_3mf(const Source& source, const LoadOptions& options);

}  // namespace lamina::load
