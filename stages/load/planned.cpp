#include "stages/load/planned.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include "stages/geometry/boxes.h"

namespace lamina::load {
namespace {

constexpr double kPlanes = 256;
/// To see whether a volume is far off, few planes will do.
constexpr Effort kBrief = {4e6, 4};
/// Less than this of a volume is the rounding of unions.
constexpr double kRounding = 1e-6;

/// Facets that all planes together cross.
double crossed_by(std::span<const Mesh> meshes, std::span<const Instance> instances, std::span<const Nm> planes) {
  std::map<std::pair<std::uint32_t, Nm>, double> copies;
  for (const Instance& instance : instances) ++copies[{instance.mesh, instance.offset.z}];
  double crossed = 0;
  for (const auto& [where, count] : copies) {
    const std::int64_t z = where.second;
    const auto below = [&](Nm height) { return std::ranges::lower_bound(planes, height + z) - planes.begin(); };
    std::int64_t once = 0;
    for (const Triangle& t : meshes[where.first].triangles)
      once += below(std::max({t.a.z, t.b.z, t.c.z})) - below(std::min({t.a.z, t.b.z, t.c.z}));
    crossed += count * static_cast<double>(once);
  }
  return crossed;
}

/// Facets that a plane crosses on average.
double crossed_by_a_plane(std::span<const Mesh> meshes, std::span<const Instance> instances, double height) {
  std::vector<double> heights(meshes.size(), -1);
  double sum = 0;
  for (const Instance& instance : instances) {
    double& of_mesh = heights[instance.mesh];
    if (of_mesh < 0) {
      of_mesh = 0;
      for (const Triangle& t : meshes[instance.mesh].triangles)
        of_mesh += static_cast<double>(std::int64_t{std::max({t.a.z, t.b.z, t.c.z})} - std::min({t.a.z, t.b.z, t.c.z}));
    }
    sum += of_mesh;
  }
  return height > 0 ? sum / height : 0;
}

/// Gauss's two points of each of `count` stretches or more, cut at the ends.
struct Rule {
  std::vector<Nm> planes;
  std::vector<double> weight_mm;
};
Rule gauss_rule(std::span<const Nm> ends, double planes) {
  Rule rule;
  const double height = static_cast<double>(std::int64_t{ends.back()} - ends.front());
  for (std::size_t i = 1; i < ends.size(); ++i) {
    const double length = static_cast<double>(std::int64_t{ends[i]} - ends[i - 1]);
    const double parts = std::max(1.0, std::round(planes / 2 * length / height)), step = length / parts;
    if (step < 16) continue;  // nm: the points would be one
    for (double part = 0; part < parts; ++part) {
      const double middle = ends[i - 1] + (part + 0.5) * step, off = step / (2 * std::sqrt(3.0));
      for (const double z : {middle - off, middle + off}) {
        rule.planes.push_back(static_cast<Nm>(std::floor(z)));
        rule.weight_mm.push_back(step / 2 * 1e-6);
      }
    }
  }
  return rule;
}

/// Ends of at most so many stretches; the outermost stay.
std::vector<Nm> thinned(std::span<const Nm> ends, double intervals) {
  const std::size_t all = ends.size() - 1, count = std::min(all, static_cast<std::size_t>(std::max(1.0, intervals)));
  std::vector<Nm> kept;
  for (std::size_t i = 0; i <= count; ++i) kept.push_back(ends[i * all / count]);
  return kept;
}

/// A rule whose planes cross no more facets than may be; false: there is none. Many ends are made fewer for it, `exact` is
/// false then.
bool find_rule(std::span<const Mesh> meshes, std::span<const Instance> instances, std::span<const Nm> ends,
               const Effort& effort, Rule& rule, bool& exact) {
  const double height = static_cast<double>(std::int64_t{ends.back()} - ends.front());
  double planes = std::min(kPlanes, effort.max_crossed / std::max(1.0, crossed_by_a_plane(meshes, instances, height)));
  if (planes < effort.fewest_planes) return false;
  exact = true;
  rule = gauss_rule(ends, planes);
  for (double crossed = 0; (crossed = crossed_by(meshes, instances, rule.planes)) > effort.max_crossed;) {
    exact = false;
    // A quarter of them as stretches and half as planes of even stretches are not more than all of them.
    const double fewer = 0.9 * static_cast<double>(rule.planes.size()) * effort.max_crossed / crossed;
    planes = std::min(planes, fewer / 2);
    if (planes < effort.fewest_planes) return false;
    rule = gauss_rule(thinned(ends, fewer / 4), planes);
  }
  return true;
}

/// Of instances that stand together, the signed sum of whose volumes is known.
Result<PlannedVolume> merged(std::span<const Mesh> meshes, std::span<const Instance> instances, std::vector<Nm> ends,
                             double signed_mm3, const SurplusAreas& surplus, const Effort& effort) {
  std::ranges::sort(ends);
  ends.erase(std::unique(ends.begin(), ends.end()), ends.end());
  if (!surplus || ends.size() < 2) return PlannedVolume{std::fabs(signed_mm3), Known::kSummed};
  Rule rule;
  bool exact = false;
  if (!find_rule(meshes, instances, ends, effort, rule, exact)) return PlannedVolume{std::fabs(signed_mm3), Known::kSummed};
  const Result<std::vector<double>> areas = surplus(meshes, instances, rule.planes);
  if (!areas && areas.error().fault == Fault::kInput) return PlannedVolume{std::fabs(signed_mm3), Known::kSummed};
  if (!areas) return areas.error();
  double more = 0;
  for (std::size_t p = 0; p < areas->size(); ++p) more += (*areas)[p] * rule.weight_mm[p];
  if (exact && std::fabs(more) <= kRounding * std::fabs(signed_mm3)) return PlannedVolume{signed_mm3, Known::kExactly};
  return PlannedVolume{signed_mm3 + more, Known::kAbout};
}

/// Instances whose boxes overlap, directly or through others, one list after the other.
std::vector<std::vector<std::uint32_t>> find_bodies(std::span<const Mesh> meshes, std::span<const Instance> instances) {
  std::vector<Box> boxes;
  for (const Instance& instance : instances) {
    Box box = meshes[instance.mesh].bounds;
    if (!box.empty()) {
      for (Point3* corner : {&box.lo, &box.hi})
        corner->x += instance.offset.x, corner->y += instance.offset.y, corner->z += instance.offset.z;
      box.hi = {box.hi.x - 1, box.hi.y - 1, box.hi.z - 1};  // boxes that merely touch do not overlap
    }
    boxes.push_back(box);
  }
  const std::vector<std::uint32_t> group = group_touching(boxes);
  std::vector<std::vector<std::uint32_t>> bodies(boxes.size());
  for (std::uint32_t i = 0; i < boxes.size(); ++i) bodies[group[i]].push_back(i);
  std::erase_if(bodies, [](const auto& members) { return members.size() < 2; });
  return bodies;
}

/// Of a mesh alone.
Result<PlannedVolume> volume_of(std::span<const Mesh> meshes, std::uint32_t m, const Diagnosis& found,
                                const SurplusAreas& surplus, const Effort& effort) {
  if (!meshes[m].closed) return PlannedVolume{meshes[m].volume_mm3, Known::kSummed};
  if (found.shells_apart) return PlannedVolume{found.outward_mm3, Known::kExactly};
  const Instance alone{m, {0, 0, 0}};
  return merged(meshes, std::span(&alone, 1), found.shell_ends, found.volume_mm3, surplus, effort);
}

/// Of instances whose boxes overlap. of_mesh: what each holds alone
Result<PlannedVolume> volume_of(std::span<const Mesh> meshes, std::span<const Instance> together,
                                std::span<const Diagnosis> diagnosis, std::span<const PlannedVolume> of_mesh,
                                const SurplusAreas& surplus, const Effort& effort) {
  std::vector<Nm> ends;
  double signed_mm3 = 0, alone_mm3 = 0;
  bool closed = true;
  for (const Instance& instance : together) {
    const Diagnosis& found = diagnosis[instance.mesh];
    for (const Nm end : found.shell_ends) ends.push_back(end + instance.offset.z);
    signed_mm3 += found.volume_mm3;
    alone_mm3 += of_mesh[instance.mesh].mm3;
    closed = closed && meshes[instance.mesh].closed;
  }
  if (!closed) return PlannedVolume{alone_mm3, Known::kSummed};
  Result<PlannedVolume> volume = merged(meshes, together, std::move(ends), signed_mm3, surplus, effort);
  if (volume && volume->known == Known::kSummed) volume->mm3 = alone_mm3;
  return volume;
}

}  // namespace

Result<PlannedVolumes> planned_volumes(std::span<const Mesh> meshes, std::span<const Instance> instances,
                                       std::span<const Diagnosis> diagnosis, const SurplusAreas& surplus,
                                       const Effort& effort) {
  PlannedVolumes volumes;
  volumes.of_mesh.resize(meshes.size());
  std::vector<std::uint8_t> known(meshes.size(), 0), in_body(instances.size(), 0);
  for (const Instance& instance : instances) {
    if (std::exchange(known[instance.mesh], 1) != 0) continue;
    const Result<PlannedVolume> volume = volume_of(meshes, instance.mesh, diagnosis[instance.mesh], surplus, effort);
    if (!volume) return volume.error();
    volumes.of_mesh[instance.mesh] = *volume;
  }
  const auto add = [&](const PlannedVolume& volume) {
    volumes.all.mm3 += volume.mm3;
    volumes.all.known = std::max(volumes.all.known, volume.known);
  };
  for (const std::vector<std::uint32_t>& members : find_bodies(meshes, instances)) {
    std::vector<Instance> together;
    for (const std::uint32_t i : members) {
      together.push_back(instances[i]);
      in_body[i] = 1;
    }
    const Result<PlannedVolume> volume = volume_of(meshes, together, diagnosis, volumes.of_mesh, surplus, effort);
    if (!volume) return volume.error();
    add(*volume);
  }
  for (std::uint32_t i = 0; i < instances.size(); ++i)
    if (in_body[i] == 0) add(volumes.of_mesh[instances[i].mesh]);
  return volumes;
}

double union_mm3(std::span<const Mesh> meshes, std::span<const Instance> instances, const SurplusAreas& surplus) {
  std::vector<Diagnosis> diagnosis(meshes.size());
  for (const Instance& instance : instances)
    if (diagnosis[instance.mesh].triangles == 0) diagnosis[instance.mesh] = diagnose(meshes[instance.mesh], 0);
  const Result<PlannedVolumes> volumes = planned_volumes(meshes, instances, diagnosis, surplus, kBrief);
  return volumes && volumes->all.known != Known::kSummed ? volumes->all.mm3 : 0;
}

}  // namespace lamina::load
