#include "pipeline/run/powders.h"

#include <fmt/format.h>
#include <tbb/enumerable_thread_specific.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <atomic>

#include "pipeline/plan/layers.h"
#include "pipeline/report/image_text.h"
#include "stages/checks/layer_warnings.h"
#include "stages/program/vats.h"

namespace lamina::pipeline {
namespace {

/// The heights of a part by material, one after the other.
void add_intervals(const PartMaterial& part, std::int64_t bottom, std::int64_t top,
                   std::vector<checks::PowderInterval>& intervals) {
  std::vector<std::int64_t> ends{bottom, top};
  for (const PartMaterial::MaterialInterval& range : part.ranges) {
    for (const std::int64_t end : {range.from, range.to}) {
      if (end > bottom && end < top) ends.push_back(end);
    }
  }
  std::ranges::sort(ends);
  for (std::size_t i = 0; i + 1 < ends.size(); ++i) {
    intervals.push_back({ends[i], ends[i + 1], part.at(static_cast<Nm>(ends[i]))});
  }
}

/// How far a section is taken from the plane of its layer: with steps outside of a part, layers hold what begins above it, and
/// so they do of shares of voxels.
std::int64_t reach_of_layers(const Plan& plan) {
  if (plan.job.heights.containment == Containment::kAcross && plan.job.levels == 0) return 0;
  std::int64_t maximum = 0;
  for (std::uint32_t i = plan.range[0]; i < plan.range[1]; ++i)
    maximum = std::max<std::int64_t>(maximum, plan.layer(i).thickness);
  return maximum;
}

/// Layers of the job that can hold several materials.
std::vector<checks::LayerRange> layers_in_question(const Plan& plan) {
  const Scene& scene = *plan.scene;
  const std::int64_t beyond = reach_of_layers(plan);
  std::vector<checks::PowderInterval> intervals;
  for (std::size_t i = 0; i < scene.instances.size(); ++i) {
    const PartMaterial& part = plan.images->materials.part[scene.part_of_instance[i]];
    const Box box = box_of(scene, scene.instances[i]);
    add_intervals(part, box.lo.z - beyond, box.hi.z + beyond, intervals);
  }
  for (const PlacedImages& images : scene.images) {
    add_intervals(plan.images->materials.part[images.part], images.bottom,
                  images.bottom + std::int64_t{images.thickness} * images.images->layers(), intervals);
  }
  std::vector<Nm> planes;
  for (std::uint32_t i = plan.range[0]; i < plan.range[1]; ++i)
    planes.push_back(plane_of(plan.job, plan.layer(i), scene.height));
  const auto materials = static_cast<std::uint32_t>(plan.images->materials.used.size());
  std::vector<checks::LayerRange> ranges = checks::mixed_layers(std::move(intervals), materials, planes);
  for (checks::LayerRange& range : ranges) range = {range[0] + plan.range[0], range[1] + plan.range[0]};
  return ranges;
}

/// The vats that feed a layer, from its image, a bit each. errors  of the image; kUsage: of vats_of_layer
Result<std::uint32_t> vats_made(const Plan& plan, const LayerImager& imager, const Layer& layer, ImageWork& work) {
  LayerRecord record;
  ImageNotes notes;
  if (Status status = imager.make(layer, work, record, notes); !status) return status.error();
  const std::vector<std::uint64_t> pixels = record.pixels_of_materials(plan.images->materials.used.size());
  const auto vats = vats_of_layer(plan.images->machine->machine, plan.images->materials, pixels);
  return vats ? Result<std::uint32_t>(vats->size() > 1 ? 3 : 1u << vats->front()) : vats.error();
}

}  // namespace

Status refuse_mixed_powders(const Plan& plan, const LayerImager& imager) {
  const ImagePlan& images = *plan.images;
  if (!images.machine || !images.materials.several()) return {};
  const Machine& machine = images.machine->machine;
  if (machine.powder.vat_rule != VatRule::kRefuse) return {};
  const auto ranges = layers_in_question(plan);
  ImageWork work;
  for (const auto& [first, last] : ranges) {
    for (std::uint32_t i = first; i <= last; ++i) {
      const Layer layer = plan.layer(i);
      const auto feeds = vats_made(plan, imager, layer, work);
      if (feeds) continue;
      if (feeds.error().fault != Fault::kUsage) return feeds.error();
      return Error{Fault::kUsage, fmt::format("{} mix powders, by the heights of their parts; layer {} (z {:.3f} mm) has {}",
                                              ranges_text(ranges), i, mm(layer.plane()), feeds.error().message)};
    }
  }
  return {};
}

Status refuse_faulty_formulas(const Plan& plan, const LayerImager& imager) {
  const auto& budget = plan.images->dose.budget();
  if (!budget || !budget->is_uncertain(plan.job.allow_unbound)) return {};
  tbb::enumerable_thread_specific<ImageWork> works;
  std::atomic<std::uint32_t> lowest{UINT32_MAX};
  const auto prepare = [&](std::uint32_t i, ImageWork& work) {
    LayerRecord record;
    ImageNotes notes;
    return imager.make(plan.layer(i), work, record, notes);
  };
  tbb::parallel_for(plan.range[0], plan.range[1], [&](std::uint32_t i) {
    if (i > lowest || prepare(i, works.local())) return;
    for (std::uint32_t known = lowest; i < known && !lowest.compare_exchange_weak(known, i);) {
    }
  });
  return lowest == UINT32_MAX ? Status() : prepare(lowest, works.local());
}

Result<std::vector<std::uint32_t>> plan_refills(const Plan& plan, const LayerImager& imager) {
  const ImagePlan& images = *plan.images;
  if (!images.machine || !program::VatPlan::has_depths(images.machine->machine)) return std::vector<std::uint32_t>();
  std::vector<std::uint32_t> feeds(plan.layer_count, images.materials.several() ? 0 : 1u << images.materials.used[0].vat);
  tbb::enumerable_thread_specific<ImageWork> works;
  tbb::parallel_for(0u, images.materials.several() ? plan.layer_count : 0, [&](std::uint32_t i) {
    if (const auto vats = vats_made(plan, imager, plan.layer(i), works.local())) feeds[i] = *vats;
  });
  program::VatPlan vats(images.machine->machine);
  for (std::uint32_t i = 0; i < plan.layer_count; ++i) {
    if (feeds[i] == 0) return vats_made(plan, imager, plan.layer(i), works.local()).error();
    vats.add(plan.layer(i), feeds[i]);
  }
  if (Status status = vats.status(); !status) return status.error();
  std::vector<std::uint32_t> refills = vats.refills();
  std::erase_if(refills, [&](std::uint32_t i) { return i < plan.range[0] || i >= plan.range[1]; });
  return refills;
}

}  // namespace lamina::pipeline
