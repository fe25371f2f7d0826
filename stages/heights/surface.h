// stages/heights/surface.h: what layer heights need to know of a part: its slopes and its horizontal faces by height.
//
// One pass over the facets of every mesh. Later questions are answered from these arrays; no layer reads all facets.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "stages/data/buffer.h"
#include "stages/data/mesh.h"
#include "stages/geometry/blocks/mesh_blocks.h"
#include "stages/heights/candidate_heights.h"

namespace lamina::heights {

/// |n_z| of a facet's unit normal in units of 2^-30, rounded up: 0 is a vertical wall, kHorizontal a horizontal face.
/// A layer of thickness t leaves a step (cusp) of t * |n_z| on the facet (Dolenc and Makela, "Slicing procedures for
/// layered manufacturing techniques", 1994).
using Steepness = std::uint32_t;
inline constexpr Steepness kHorizontal = 1u << 30;

/// Elevation of the normal above the horizontal, in degrees: 0 a wall, 90 a horizontal face.
double angle_of(Steepness steepness);
/// Height of the step, nm, rounded up.
constexpr std::int64_t cusp_of(std::int64_t thickness, Steepness steepness) {
  return (thickness * steepness + kHorizontal - 1) / kHorizontal;
}

/// mm2 of a facet projected along z, negative where it faces down. Exact before the last rounding.
inline double projected_mm2(const Triangle& t) {
  const std::int64_t ux = std::int64_t{t.b.x} - t.a.x, uy = std::int64_t{t.b.y} - t.a.y;
  const std::int64_t vx = std::int64_t{t.c.x} - t.a.x, vy = std::int64_t{t.c.y} - t.a.y;
  const auto small = [](std::int64_t v) { return v == static_cast<std::int32_t>(v); };  // a part below 2 m
  if (small(ux) && small(uy) && small(vx) && small(vy)) return static_cast<double>(ux * vy - uy * vx) * 0.5e-12;
  return static_cast<double>(static_cast<__int128>(ux) * vy - static_cast<__int128>(uy) * vx) * 0.5e-12;
}

struct SurfaceOptions {
  double peak_angle_deg = 90;      // facets at least as flat as this are horizontal
  double normal_tolerance = 1e-3;  // of |n_z|, for all comparisons of angles
  Nm flat_tolerance = 1000;        // nm: a horizontal facet may be that much out of level
  double min_facet_mm2 = 0;        // smaller facets have no effect
  bool nominal_cusps = false;      // steps as they are left on the part once it has shrunk, not as printed
};

/// Factors per axis of the bed by which a mesh was stretched to make up for shrinkage.
using ScaleFactors = std::array<double, 3>;

/// A horizontal facet, or several at the same height that face the same way.
struct FlatFacet {
  Nm height;  // nm, the middle of its corners
  bool up;    // its outside is above
  double mm2;
};

/// Which steepness of a facet is requested.
enum class Slope { kSteps, kAngles };

/// Which facets are slopes of one mesh, and how steep they are.
struct SlopeRule {
  double horizontal = 1;  // |n_z| from which a facet is horizontal
  Nm tolerance = 0;       // nm: a horizontal facet may be that much out of level
  double min_mm2 = 0;
  ScaleFactors scale{1, 1, 1};
  bool shrunk_steps = false;  // steps as they are left once the mesh has shrunk by `scale`

  bool is_scaled() const { return scale != ScaleFactors{1, 1, 1}; }
};

/// The facets of one mesh, in its own coordinates. Those that are vertical, horizontal, degenerate or too small have
/// steepness 0 and are to be passed over. 4 bytes a facet of a list, 8 where the mesh is stretched: heights and areas are read
/// from the mesh again, which costs less than memory for them. Of blocks nothing is kept, and each pass measures their facets.
struct MeshSlopes {
  const Mesh* mesh;  // which has to outlive the index; blocks keep the order of the file
  SlopeRule rule;
  Buffer<Steepness> steepness;   // of each facet of a list; a layer's thickness times it is its step
  Buffer<Steepness> nominal;     // of each facet before the stretch, for angles; empty where that is the same
  std::vector<FlatFacet> flats;  // in no order; the same for any number of threads
  double area_mm2 = 0;           // of all facets that are not horizontal, where steps are considered
  double step_share = 1;         // of a facet's projected area in sums of steps; 1 but for steps of a part that has shrunk

  std::uint64_t facets() const { return triangle_count(*mesh); }
};

/// A mesh at a height; copies that stand on the same level count as one with a larger area.
struct PlacedSurface {
  std::uint32_t mesh;
  Nm raise;  // nm, added to every height
  std::uint32_t copies;
};

/// One part of the job.
struct PartSurface {
  std::vector<PlacedSurface> placed;
  Nm bottom = 0, top = 0;  // nm above the bed
};

struct SurfaceIndex {
  std::vector<MeshSlopes> meshes;
  std::vector<PartSurface> parts;
  double area_mm2 = 0;  // of all copies, horizontal facets left out
  Nm top = 0;           // of all parts

  /// Whether angles differ from the slopes that leave steps.
  bool has_nominal() const {
    return std::ranges::any_of(meshes, [](const MeshSlopes& mesh) { return mesh.rule.is_scaled(); });
  }
};

/// Reads every facet once, in parallel; the result does not depend on the number of threads.
///
/// instances, part_of_instance  of equal length; the offset's z is the height above the bed
/// angles come from the corners of the facets, never from the normals that a file may hold
/// meshes       are referred to by the index; lists, or blocks that keep the order of their files
/// stretch      of each mesh, or empty if none is stretched. Angles, and whether a facet is horizontal, are those of the mesh
///              before it; heights and areas of flats are those of the mesh as it stands there
/// source  M. V. A. de Lima (2009), Appendix B: the angles of a job with factors 1.007, 1.007, 1 are those of the STL file
/// cost  O(facets); 4 bytes a facet of a list, 8 of a stretched one
SurfaceIndex index_surface(std::span<const Mesh> meshes, std::span<const Instance> instances,
                           std::span<const std::uint32_t> part_of_instance, std::uint32_t part_count,
                           const SurfaceOptions& options, std::span<const ScaleFactors> scale = {});

/// Into how many shares a pass over the sloped facets of these parts may be cut whose every share fills `entries` numbers
/// of its own: 1 where filling them would cost more than the facets. The same for any number of threads.
std::uint32_t worthwhile_shares(const SurfaceIndex& index, std::span<const PartSurface> parts, std::size_t entries);

/// The steepness of each facet, in `out`. returns  its elements. cost  O(facets): a root and a quotient each
const Steepness* measure_slopes(std::span<const Triangle> facets, const SlopeRule& rule, Slope slope, Buffer<Steepness>& out);

/// Calls visit(lo, hi, steepness, projected) for each sloped facet of one of `shares` shares of a mesh that stands
/// somewhere: heights in nm above the bed, mm2 of all copies, negative where the facet faces down.
template <class Visit>
void for_each_slope(const MeshSlopes& mesh, const PlacedSurface& placed, std::uint32_t share, std::uint32_t shares,
                    const Visit& visit, Slope slope = Slope::kSteps) {
  const std::uint64_t count = mesh.facets(), first = count * share / shares, end = count * (share + 1) / shares;
  const Steepness* listed = (slope == Slope::kAngles && mesh.rule.is_scaled() ? mesh.nominal : mesh.steepness).data() + first;
  Buffer<Triangle> list;
  Buffer<Steepness> measured;
  each_listed(*mesh.mesh, first, end, list, [&](std::span<const Triangle> facets) {
    const Steepness* const steepness = mesh.mesh->blocks ? measure_slopes(facets, mesh.rule, slope, measured) : listed;
    for (std::size_t i = 0; i < facets.size(); ++i) {
      if (steepness[i] == 0) continue;
      const Triangle& t = facets[i];
      const Nm lo = std::min(std::min(t.a.z, t.b.z), t.c.z), hi = std::max(std::max(t.a.z, t.b.z), t.c.z);
      visit(lo + placed.raise, hi + placed.raise, steepness[i], projected_mm2(t) * placed.copies);
    }
  });
}

/// The same for all meshes of a part.
template <class Visit>
void for_each_slope(const SurfaceIndex& index, const PartSurface& part, std::uint32_t share, std::uint32_t shares,
                    const Visit& visit, Slope slope = Slope::kSteps) {
  for (const PlacedSurface& placed : part.placed) {
    for_each_slope(index.meshes[placed.mesh], placed, share, shares, visit, slope);
  }
}

/// Horizontal faces at one height, or the top or bottom of a part.
struct Flat {
  Nm height;                        // nm above the bed, > 0
  double up_mm2 = 0, down_mm2 = 0;  // of one copy of each part
  bool end = false;                 // top or bottom of a part
  std::uint32_t part = 0;           // the one with the largest area here
};

/// The flats of these parts, in increasing height, none at the bed itself.
///
/// Horizontal facets whose heights lie within `tolerance` count as one flat, at the height that half of their area lies
/// at or below: real meshes wobble. Flats smaller than `min_mm2` are left out. Tops and bottoms of parts belong to the
/// flat within `tolerance` of them, which is then at their very height, or are flats of their own.
///
/// cost  O(f log f) for f horizontal facets
std::vector<Flat> find_flats(const SurfaceIndex& index, Nm tolerance, double min_mm2);

/// How far the nearest of these boundaries is from a height. Boundaries increase; at least one.
std::int64_t distance_to_nearest(std::span<const std::int64_t> boundaries, std::int64_t height);

// --- the flattest slope between any two candidate heights, and the area of the sections there.

/// For each cell of the candidates, the largest |n_z| of the sloped facets of these parts that reach into it; so the largest
/// over any layer that ends on candidates is the largest of its cells, exactly.
/// slope  whether steps or angles follow from it
/// cost  O(facets + cells); about 32 bytes a cell while it runs, 4 after
Buffer<Steepness> steepest_in_cells(const SurfaceIndex& index, std::span<const PartSurface> parts,
                                    const CandidateHeights& candidate_heights, Slope slope = Slope::kSteps);

/// For each candidate, the largest |n_z| of the sloped facets that a plane there cuts: lowest corner below it, highest corner
/// at or above it.
Buffer<Steepness> steepest_at_candidates(const SurfaceIndex& index, std::span<const PartSurface> parts,
                                         const CandidateHeights& candidate_heights, Slope slope = Slope::kSteps);

/// Whether areas that face up and down add up or cancel out.
enum class Sign { kBoth, kUpMinusDown };

/// For each candidate, the mm2 of the sloped facets below it, projected along z; a facet's area counts as evenly spread over
/// its height. With kBoth, differences times the thickness add up to the mean cusp; areas are weighed by their step_share.
Buffer<double> projected_below(const SurfaceIndex& index, std::span<const PartSurface> parts,
                               const CandidateHeights& candidate_heights, Sign sign);

/// mm2 of the section just above each candidate, of all copies: downward facets below it minus upward ones. Horizontal
/// facets up to `tolerance` above a candidate count as below it. Right for closed meshes, but that a facet's area counts as
/// evenly spread over its height; never below 0.
Buffer<double> section_at_candidates(const SurfaceIndex& index, const CandidateHeights& candidate_heights, Nm tolerance);

}  // namespace lamina::heights
