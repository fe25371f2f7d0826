// stages/load/planned.h: the volume of what is solid in a part, where its shells or objects overlap too.
#pragma once

#include <functional>
#include <span>
#include <vector>

#include "stages/data/mesh.h"
#include "stages/data/status.h"
#include "stages/load/repair/diagnose.h"

namespace lamina::load {

/// For each plane, mm2: what is solid less the sum of winding numbers, of all instances together (stages/slice/slice.h).
using SurplusAreas =
    std::function<Result<std::vector<double>>(std::span<const Mesh>, std::span<const Instance>, std::span<const Nm> planes)>;

enum class Known {
  kExactly,
  kAbout,   // integrated over some 256 planes, or as many as shells require; less than a hundredth off as a rule
  kSummed,  // overlaps count as often as they overlap: nothing to slice with, an open mesh, or more than can be sliced soon
};

struct PlannedVolume {
  double mm3 = 0;
  Known known = Known::kExactly;
};

struct PlannedVolumes {
  PlannedVolume all;                   // where objects stand: the union of those that overlap
  std::vector<PlannedVolume> of_mesh;  // each alone
};

/// How much may be sliced for one volume.
struct Effort {
  double max_crossed = 1.5e7;  // facets that all planes together may cross: some seconds
  double fewest_planes = 16;   // with less than these it is not integrated
};

/// Volume by the rule `nonzero`. Shells that lie apart add up, exactly. What overlaps, or may, is the signed volume and the
/// integral of the surplus over the height, by Gauss's rule of two points between the heights at which shells begin and end;
/// where these are too many for `effort`, only some of them bound its stretches.
///
/// instances  where meshes stand
/// diagnosis  of each mesh that does
/// surplus    may be empty: then overlaps count as often as they overlap
/// errors     of surplus
/// cost       nothing where shells and objects lie apart; else that of slicing some 256 planes, more where many shells begin
///            and end, fewer for large meshes: a mesh, or objects that overlap, take `effort` at most
Result<PlannedVolumes> planned_volumes(std::span<const Mesh> meshes, std::span<const Instance> instances,
                                       std::span<const Diagnosis> diagnosis, const SurplusAreas& surplus,
                                       const Effort& effort = {});

/// The same for meshes without a diagnosis. returns  mm3; 0 if it is not known
/// cost  a diagnosis of each mesh, and slicing for about a second
double union_mm3(std::span<const Mesh> meshes, std::span<const Instance> instances, const SurplusAreas& surplus);

}  // namespace lamina::load
