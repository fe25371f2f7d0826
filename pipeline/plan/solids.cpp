#include "pipeline/plan/solids.h"

#include <fmt/format.h>

#include <algorithm>
#include <string_view>
#include <utility>

#include "stages/formats/image_format.h"
#include "stages/geometry/blocks/block_maker.h"

namespace lamina::pipeline {
namespace {

bool overlap(const Box& a, const Box& b) {
  return a.lo.x < b.hi.x && b.lo.x < a.hi.x && a.lo.y < b.hi.y && b.lo.y < a.hi.y && a.lo.z < b.hi.z && b.lo.z < a.hi.z;
}

/// The number of stacked solids of other materials below each part, which gives the order of overwriting. Computed from
/// the boxes of all copies of a part, so it may be too large.
std::vector<std::uint32_t> levels_of(const Scene& scene, const Job& job, const Materials& materials, const DoseZones& zones) {
  std::vector<std::uint32_t> level(job.parts.size(), 0);
  if (std::ranges::none_of(job.parts, [](const PartRequest& part) { return part.at_mm.has_value(); })) return level;
  std::vector<Box> box(job.parts.size());
  for (std::size_t i = 0; i < scene.instances.size(); ++i) {
    const Box& own = scene.meshes[scene.instances[i].mesh].bounds;
    const Point3& by = scene.instances[i].offset;
    const auto moved = [&](const Point3& p) { return Point3{p.x + by.x, p.y + by.y, p.z + by.z}; };
    box[scene.part_of_instance[i]].add(Box{moved(own.lo), moved(own.hi)});
  }
  for (std::size_t later = 0; later < box.size(); ++later) {
    for (std::size_t earlier = 0; earlier < later; ++earlier) {
      const bool same = materials.part[later] == materials.part[earlier] && zones.of_part(later) == zones.of_part(earlier);
      if (same || !overlap(box[later], box[earlier])) continue;
      level[later] = std::max(level[later], level[earlier] + 1);
    }
  }
  return level;
}

/// What keeps a job from levels, and what to do; empty if nothing does.
std::string_view against_shares(const Job& job, const Materials& materials, const DoseZones& zones) {
  if (materials.several() && job.machine.profile.empty() && formats::find_level_format(job.format) != nullptr)
    return "one material as grey, as several would share one voxel; choose a 1-bit format or name a machine";
  if (zones.bleeds().grows()) return "edges that stay or shrink; leave out a negative bleed";
  if (fills(job)) return "whole parts; leave out walls, fillings and segments";
  if (job.dose.core < 1) return "whole parts; give --core-saturation instead of --core";
  if (job.heights.containment != Containment::kAcross) return "the layer as it is; leave out --containment";
  return {};
}

struct SolidGroup {
  std::uint32_t level;
  PartMaterial material;
  std::uint32_t zone;
  std::vector<Mesh> meshes;
  std::vector<Instance> instances;
  std::vector<std::uint32_t> instance;
  std::vector<std::uint32_t> own_mesh;  // by mesh of the scene; UINT32_MAX: not here yet
};

/// Moves meshes into the groups; two that use the same share its blocks.
std::vector<SolidGroup> groups_of(Scene& scene, const Job& job, const Materials& materials, const DoseZones& zones) {
  const std::vector<std::uint32_t> level = levels_of(scene, job, materials, zones);
  std::vector<SolidGroup> groups;
  std::vector<std::uint32_t> home(scene.meshes.size(), UINT32_MAX);
  for (std::uint32_t i = 0; i < scene.instances.size(); ++i) {
    const std::uint32_t part = scene.part_of_instance[i], mesh = scene.instances[i].mesh;
    const auto found = std::ranges::find_if(groups, [&](const SolidGroup& group) {
      return group.level == level[part] && group.material == materials.part[part] && group.zone == zones.of_part(part);
    });
    const auto number = static_cast<std::uint32_t>(found - groups.begin());
    if (found == groups.end()) {
      groups.push_back({level[part], materials.part[part], zones.of_part(part), {}, {}, {}, {}});
      groups.back().own_mesh.assign(scene.meshes.size(), UINT32_MAX);
    }
    SolidGroup& group = groups[number];
    if (group.own_mesh[mesh] == UINT32_MAX) {
      group.own_mesh[mesh] = static_cast<std::uint32_t>(group.meshes.size());
      if (home[mesh] == UINT32_MAX) {
        group.meshes.push_back(std::move(scene.meshes[mesh]));  // its box stays
        home[mesh] = number;
      } else {
        group.meshes.push_back(groups[home[mesh]].meshes[groups[home[mesh]].own_mesh[mesh]]);
      }
    }
    group.instances.push_back({group.own_mesh[mesh], scene.instances[i].offset});
    group.instance.push_back(i);
  }
  std::ranges::stable_sort(groups, {}, &SolidGroup::level);
  return groups;
}

}  // namespace

Result<Solids> Solids::build(Scene& scene, const Job& job, const PixelGrid& grid, const Materials& materials,
                             const DoseZones& zones) {
  Solids result;
  const bool rays = job.engine != Engine::kContours, contours = job.engine != Engine::kRays;
  if (job.levels > 0) {
    if (const auto what = against_shares(job, materials, zones); !what.empty()) {
      return Error{Fault::kUsage, fmt::format("--levels: fill fractions of voxels need {}, or leave out --levels", what)};
    }
  }
  const auto add = [&](std::span<Mesh> meshes, std::span<const Instance> instances, PartMaterial material, std::uint32_t zone,
                       std::vector<std::uint32_t> instance) -> Status {
    std::optional<coverage::Coverage> coverage;
    if (job.levels > 0 && !instances.empty()) {
      auto covered = coverage::Coverage::build(meshes, instances, grid, job.fill_rule, job.levels, job.isa);
      if (!covered) return covered.error();
      coverage = std::move(*covered);
    }
    auto built = raster::Rasterizer::build(meshes, instances, grid, job.fill_rule, rays, contours, job.isa);
    if (!built) return built.error();
    result.solids_.push_back({std::move(material), zone, std::move(*built), std::move(instance), std::move(coverage)});
    return {};
  };
  // Made here, so that a mesh in two groups is there once.
  std::vector<std::shared_ptr<MeshBlocks>> blocks = take_blocks(scene.meshes, job.isa);
  for (std::size_t i = 0; i < blocks.size(); ++i) {
    result.mesh_bytes_ += blocks[i]->bytes();
    scene.meshes[i].blocks = std::move(blocks[i]);
  }
  if (!materials.several() && !zones.several()) {
    if (Status status = add(scene.meshes, scene.instances, {}, 0, {}); !status) return status.error();
    return result;
  }
  for (SolidGroup& group : groups_of(scene, job, materials, zones)) {
    if (Status status = add(group.meshes, group.instances, std::move(group.material), group.zone, std::move(group.instance));
        !status) {
      return status.error();
    }
  }
  return result;
}

std::uint64_t Solids::layer_bytes_bound(Nm plane) const {
  std::uint64_t total = 0;
  for (const Solid& solid : solids_) total += solid.rasterizer.layer_bytes_bound(plane);
  return total;
}

std::uint64_t Solids::crossings_bound(Nm plane) const {
  std::uint64_t total = 0;
  for (const Solid& solid : solids_) total += solid.rasterizer.crossings_bound(plane);
  return total;
}

std::uint64_t Solids::index_bytes() const {
  std::uint64_t total = 0;
  for (const Solid& solid : solids_) {
    total += solid.rasterizer.index_bytes() + (solid.coverage ? solid.coverage->index_bytes() : 0);
  }
  return total;
}

}  // namespace lamina::pipeline
