// The steps of a layer's images that give binder: shares of voxels, bleed, drops.
#include <fmt/core.h>

#include <algorithm>
#include <numbers>

#include "pipeline/run/image_maker.h"
#include "stages/dose/edges/dilate.h"
#include "stages/formats/image_format.h"
#include "stages/geometry/combine.h"
#include "stages/program/reach.h"

namespace lamina::pipeline {

bool LayerImager::shares_voxels() const {
  return plan_.job.levels > 0 && (plan_.images->materials.several() || plan_.images->dose.zones().several());
}

cover::LayerReport LayerImager::levels(const Layer& layer, cover::LayerScratch& scratch, Levels& image) const {
  const Solid& solid = plan_.images->solids.all().front();
  if (solid.coverage) return solid.coverage->layer(layer, scratch, image);
  image.start(plan_.images->grid.columns());  // no mesh
  image.row_offset.assign(std::size_t{plan_.images->grid.rows()} + 1, 0);
  return {};
}

Status LayerImager::bleed(const Layer& layer, ImageWork& work, ImageNotes& notes) const {
  const ImagePlan& images = *plan_.images;
  const DoseZones& zones = images.dose.zones();
  const bool shares = plan_.job.levels > 0;
  if (const Mirror axes = plan_.job.mirror; axes != Mirror::kNone) {
    mirror(work.runs, work.second);
    for (Runs& image : work.materials.image) mirror(image, work.second);
    for (Runs& image : work.zones.image) mirror(image, work.second);
    if (shares) dose::mirror(work.drops.shares, axes != Mirror::kY, axes != Mirror::kX, work.drops.zones);
    if (shares) std::swap(work.drops.shares, work.drops.zones);
    if (shares_voxels()) {
      for (dose::LaidPart& part : work.drops.laid) {
        dose::mirror(part.shares, axes != Mirror::kY, axes != Mirror::kX, part.zones);
        std::swap(part.shares, part.zones);
      }
    }
  }
  if (!images.dose.bleeds()) return {};
  if (zones.several() && images.beads) work.zones.keep(work.runs);
  for (std::uint32_t zone = 0; zone < zones.count(); ++zone) {
    const RunsView own = zones.several() ? work.zones.image[zone].view() : work.runs.view();
    const dose::Bleed& bleed = zones.bleeds().of(zone, layer);
    if (!bleed.outside.grows || !dose::grows_beyond(own, bleed.outside.reach)) continue;
    return Error{Fault::kUsage,
                 fmt::format("dose.bleed_um: in layer {} (z {:.3f} mm) edges would grow beyond the bed; move the "
                             "parts away from its edge",
                             layer.index, mm(layer.plane()))};
  }
  const std::uint64_t least = least_vanished();
  if (shares || least > 0) work.third = work.runs;
  zones.bleeds().remove(layer, work.runs, work.zones.image, work.bleed);
  if (least > 0) notes.vanished = inspect::vanished_pieces(work.third, work.runs, least, work.vanish);
  if (shares) empty_removed(work.third, shares_voxels(), work);
  return check_grown(layer, work);
}

/// Pixels of four discs of the widest bleed inwards; 0: there is none, or beads fill the parts.
std::uint64_t LayerImager::least_vanished() const {
  if (plan_.images->beads) return 0;
  double widest = 0;
  for (const auto& [x, y] : bleeds_of(plan_.job)) widest = std::max(widest, std::max(x, 0.0) * std::max(y, 0.0));
  const PixelGrid& grid = plan_.images->grid;
  const double pixels = 4 * std::numbers::pi * widest * 1e6 * grid.x.pixels_per_nm() * grid.y.pixels_per_nm();
  return widest > 0 ? std::max<std::uint64_t>(1, static_cast<std::uint64_t>(pixels)) : 0;
}

/// Where an edge moved inwards, the voxels that it left and those beside them that are less than half full are emptied.
void LayerImager::empty_removed(const Runs& before, bool laid, ImageWork& work) {
  combine(before, work.runs, SetOperation::kDifference, work.second);
  const dose::Reach beside{{1, 1}};
  dose::dilate(work.second, beside, work.section);
  combine(work.section, work.runs, SetOperation::kDifference, work.second);
  dose::without(work.drops.shares, work.second, work.drops.zones);
  std::swap(work.drops.shares, work.drops.zones);
  if (!laid) return;
  for (dose::LaidPart& part : work.drops.laid) {
    dose::without(part.shares, work.second, part.zones);
    std::swap(part.shares, part.zones);
  }
}

/// Parts stay on a bed that is not a rectangle as far as they were checked; what grew does too.
Status LayerImager::check_grown(const Layer& layer, const ImageWork& work) const {
  const ImagePlan& images = *plan_.images;
  if (!images.machine || !images.dose.zones().bleeds().grows()) return {};
  const auto outside = program::first_outside(images.machine->machine, images.grid, work.runs);
  if (!outside) return {};
  return Error{
      Fault::kUsage,
      fmt::format("dose.bleed_um: layer {} grows to x {:.3f}, y {:.3f} mm, {:.3f} mm outside of the bed "
                  "of {}; move the parts away from its edge",
                  layer.index, mm(outside->place.x), mm(outside->place.y), outside->beyond_mm, images.machine->machine.name)};
}

void LayerImager::shares(const Layer& layer, ImageWork& work, LayerRecord& record) const {
  const ImagePlan& images = *plan_.images;
  if (shares_voxels()) {
    cover(layer, work);
    dose::share_out(images.dose.full(), images.grid.columns(), images.grid.rows(), work.drops);
  } else {
    // What was dosed in the layer before took its buffer with it.
    if (work.drops.zones.bytes() > work.drops.shares.bytes()) std::swap(work.drops.shares, work.drops.zones);
    levels(layer, work.coverage, work.drops.shares);
  }
  const auto differs = dose::take_half(images.dose.full(), work.runs, work.second, work.drops);
  record.half_differs = differs.pixels;
  record.half_far = differs.far;
  if (shares_voxels()) own_voxels(work);
}

/// Voxels half full or more are those of the part that has most of them.
void LayerImager::own_voxels(ImageWork& work) const {
  const ImagePlan& images = *plan_.images;
  const std::uint32_t columns = images.grid.columns(), rows = images.grid.rows();
  const bool several = images.materials.several(), zones = images.dose.zones().several();
  if (several) work.materials.start(images.materials.used.size(), columns, rows);
  if (zones) work.zones.start(images.dose.zones().count(), columns, rows);
  for (std::size_t i = 0; i < work.drops.laid.size(); ++i) {
    const dose::LaidPart& part = work.drops.laid[i];
    const auto unite = [&](Runs& image) {
      combine(image, work.drops.shared.owner[i], SetOperation::kUnion, work.section);
      std::swap(image, work.section);
    };
    if (several) unite(work.materials.image[part.material]);
    if (zones) unite(work.zones.image[part.zone]);
  }
}

/// How full each solid makes the voxels.
void LayerImager::cover(const Layer& layer, ImageWork& work) const {
  const std::span<const Solid> solids = plan_.images->solids.all();
  work.drops.laid.resize(solids.size());
  for (std::size_t i = 0; i < solids.size(); ++i) {
    dose::LaidPart& part = work.drops.laid[i];
    solids[i].coverage->layer(layer, work.coverage, part.shares);
    part.zone = solids[i].zone;
    part.material = plan_.images->materials.several() ? solids[i].material.at(plane(layer)) : 0;
  }
}

/// Those of an image, as placed in work.drops.zones, lie over the parts before: of the same kind as the last one, the larger
/// share counts.
void LayerImager::lay_shares(const Layer& layer, std::uint32_t part, ImageWork& work) const {
  std::vector<dose::LaidPart>& laid = work.drops.laid;
  const std::uint32_t zone = plan_.images->dose.zones().of_part(part);
  const std::uint32_t material = plan_.images->materials.several() ? plan_.images->materials.part[part].at(plane(layer)) : 0;
  if (laid.empty() || laid.back().zone != zone || laid.back().material != material) {
    laid.push_back({work.drops.zones, {}, zone, material});
  } else {
    larger(laid.back().shares, work.drops.zones, work.drops.levels);
    std::swap(laid.back().shares, work.drops.levels);
  }
}

Status LayerImager::dose(const Layer& layer, ImageWork& work, LayerRecord& record) const {
  const ImagePlan& images = *plan_.images;
  if (images.dose.zones().several() && images.beads) work.zones.keep(work.runs);
  images.dose.thin(layer.index, work.runs, work.second, work.third);
  if (images.dose.saturates()) {
    const auto materials = static_cast<std::uint32_t>(std::max<std::size_t>(1, images.materials.used.size()));
    const auto sums =
        images.dose.saturate(layer, shares_voxels(), materials, work.runs, work.zones.image, work.second, work.drops);
    if (!sums) return sums.error();
    record.dosed_pixels = sums->full_voxels;
    record.asked_drops = sums->asked_drops;
    record.drops = images.dose.most_drops() > 1 ? sum_of_levels(work.drops.levels) : set_pixels(work.runs);
    record.most_drops = images.dose.most_drops() > 1 ? highest(work.drops.levels) : record.drops > 0 ? 1 : 0;
    // Of one drop a pixel the image alone was made.
    const bool levels = write::find_level_format(plan_.job.format) != nullptr || !plan_.scene->images.empty();
    if (levels && images.dose.most_drops() == 1) levels_of(work.runs, 1, work.drops.levels);
  } else if (plan_.job.levels > 0) {
    at_least(work.drops.shares, 1, work.runs);
    record.dosed_pixels = dose::sums_of(work.drops.shares, images.dose.full(), dose::one_drop()).full_voxels;
  }
  if (images.materials.several() && (images.beads || images.dose.any())) work.materials.keep(work.runs);
  const bool grey = write::find_level_format(plan_.job.format) != nullptr, drops = images.dose.most_drops() > 1;
  if (images.materials.several() && (shares_voxels() || drops || grey))
    dose::drops_of_materials(images.dose.most_drops(), shares_voxels(), work.materials.image, work.drops);
  const bool counted = images.dose.saturates() && images.dose.most_drops() <= 1;
  record.set_pixels = counted ? record.drops : set_pixels(work.runs);
  for (const Runs& image : several(work)) record.images.emplace_back().set_pixels = set_pixels(image);
  for (std::size_t m = 0; grey && m < record.images.size(); ++m)
    record.images[m].drops = sum_of_levels(work.drops.of_material[m]);
  return {};
}

std::span<const Runs> LayerImager::several(const ImageWork& work) const {
  const bool drops = plan_.images->dose.most_drops() > 1 && write::find_level_format(plan_.job.format) == nullptr;
  if (!drops) return work.materials.image;
  return plan_.images->materials.several() ? work.drops.material_planes : work.drops.planes;
}

std::span<const Levels> LayerImager::levels(const ImageWork& work) const {
  if (plan_.images->materials.several()) return work.drops.of_material;
  return {plan_.images->dose.saturates() ? &work.drops.levels : &work.drops.shares, 1};
}

}  // namespace lamina::pipeline
