#include "stages/slice/surplus.h"

#include <tbb/enumerable_thread_specific.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <map>
#include <utility>

#include "stages/geometry/contours/contact.h"
#include "stages/geometry/contours/nest.h"
#include "stages/geometry/contours/simplify.h"
#include "stages/slice/chain.h"
#include "stages/slice/cut.h"

namespace lamina::slice {
namespace {

/// A mesh at a height, and where its copies stand.
struct SharedMesh {
  std::span<const Triangle> triangles;
  std::int64_t z;
  PlaneIndex index;
  std::vector<Point2> by;
};

std::vector<SharedMesh> sources_of(std::span<const Mesh> meshes, std::span<const Instance> instances,
                                   std::span<const Nm> planes) {
  std::vector<SharedMesh> sources;
  std::map<std::pair<std::uint32_t, Nm>, std::size_t> known;
  std::vector<std::int64_t> own_planes(planes.size());
  for (const Instance& instance : instances) {
    const std::int64_t z = instance.offset.z;
    const auto [found, is_new] = known.emplace(std::pair(instance.mesh, instance.offset.z), sources.size());
    if (is_new) {
      std::ranges::transform(planes, own_planes.begin(), [&](Nm plane) { return plane - z; });
      const std::span<const Triangle> triangles = meshes[instance.mesh].triangles;
      sources.push_back({triangles, z, index_crossings(triangles, own_planes), {}});
    }
    sources[found->second].by.push_back({instance.offset.x, instance.offset.y});
  }
  return sources;
}

struct Scratch {
  Buffer<std::uint32_t> facets, group;
  Cuts cuts;
  ChainScratch chain;
  ContactScratch contact;
  Contours own, open, all;
};

Result<double> surplus_area(std::span<const SharedMesh> sources, std::span<const Nm> planes, std::uint32_t plane,
                            Scratch& scratch) {
  scratch.all.clear();
  for (const SharedMesh& source : sources) {
    scratch.facets.clear(), scratch.own.clear(), scratch.open.clear();
    source.index.append(plane, scratch.facets);
    const std::int64_t z = planes[plane] - source.z;
    cut(source.triangles, scratch.facets, z, scratch.cuts);
    chain(scratch.cuts, z, scratch.chain, scratch.own, scratch.open);
    for (const Point2 by : source.by) {
      for (std::uint32_t c = 0; c < scratch.own.size(); ++c) {
        for (const Point2 p : scratch.own[c]) scratch.all.point.push_back({p.x + by.x, p.y + by.y});
        scratch.all.close();
      }
    }
  }
  const __int128 wound = doubled_area(scratch.all);
  tidy(scratch.all);
  if (!find_contacts(scratch.all, scratch.contact, scratch.group)) scratch.group.clear();
  if (const auto merged = nest(scratch.all, FillRule::kNonzero, scratch.group); !merged) return merged.error();
  return square_mm(doubled_area(scratch.all) - wound);
}

}  // namespace

Result<std::vector<double>> surplus_areas(std::span<const Mesh> meshes, std::span<const Instance> instances,
                                          std::span<const Nm> planes) {
  const std::vector<SharedMesh> sources = sources_of(meshes, instances, planes);
  std::vector<double> areas(planes.size());
  std::vector<Status> status(planes.size());
  tbb::enumerable_thread_specific<Scratch> scratches;
  tbb::parallel_for(std::uint32_t{0}, static_cast<std::uint32_t>(planes.size()), [&](std::uint32_t plane) {
    const Result<double> area = surplus_area(sources, planes, plane, scratches.local());
    area ? void(areas[plane] = *area) : void(status[plane] = area.error());
  });
  for (const Status& each : status)
    if (!each) return each.error();
  return areas;
}

}  // namespace lamina::slice
