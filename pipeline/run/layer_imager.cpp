// The steps of a layer's images.
#include <fmt/core.h>

#include <algorithm>
#include <numbers>

#include "pipeline/run/image_maker.h"
#include "stages/program/reach.h"
#include "stages/raster/combine.h"
#include "stages/raster/mirror.h"
#include "stages/read/placed.h"
#include "stages/write/levels/level_format.h"

namespace lamina::pipeline {
namespace {

/// The first difference between two engines.
Error disagreement(const Layer& layer, const PixelGrid& grid, const RunsView& rays, const RunsView& contours) {
  std::uint32_t row = 0;
  while (row + 1 < rays.rows() && std::ranges::equal(rays.row(row), contours.row(row))) ++row;
  const auto a = rays.row(row), b = contours.row(row);
  const auto place = static_cast<std::size_t>(std::ranges::mismatch(a, b).in1 - a.begin());
  const std::uint32_t column = std::min(place < a.size() ? a[place] : rays.columns, place < b.size() ? b[place] : rays.columns);
  return {Fault::kVerification,
          fmt::format("layer {}: engines disagree first in image row {}, column {} (x {:.4f} mm, y {:.4f} mm, z {:.4f} "
                      "mm); this is a fault of lamina, please report it with the part",
                      layer.index, row, column, mm(grid.x.centre(column)), mm(grid.y.centre(grid.rows() - 1 - row)),
                      mm(layer.plane()))};
}

/// Sums over a layer's solids; places come from the first solid that has any.
void add(const raster::LayerReport& solid, raster::LayerReport& all) {
  if (all.capped_rows == 0) {
    all.first_capped_row = solid.first_capped_row;
    all.first_capped_instance = solid.first_capped_instance;
  }
  if (all.open_rows == 0) all.first_open_row = solid.first_open_row;
  all.crossings += solid.crossings;
  all.capped_rows += solid.capped_rows;
  all.open_rows += solid.open_rows;
}

}  // namespace

std::uint64_t ImageWork::bytes() const {
  std::uint64_t total = scratch.bytes() + materials.bytes() + zones.bytes() + bleed.bytes() + drops.bytes() + coverage.bytes() +
                        vanish.bytes() + (beads ? beads->bytes() : 0);
  for (const Runs* image : {&runs, &second, &third, &lowest, &highest, &section}) {
    total += bytes_held(image->row_offset) + bytes_held(image->change);
  }
  return total;
}

Status LayerImager::raster(const Layer& layer, ImageWork& work, LayerRecord& record, ImageNotes& notes) const {
  const ImagePlan& images = *plan_.images;
  const bool several = images.materials.several(), zones = images.dose.zones().several();
  if (zones) work.zones.start(images.dose.zones().count(), images.grid.columns(), images.grid.rows());
  if (several) work.materials.start(images.materials.used.size(), images.grid.columns(), images.grid.rows());
  if (several || zones) {
    work.runs.columns = images.grid.columns();
    work.runs.row_offset.assign(std::size_t{images.grid.rows()} + 1, 0);
    work.runs.change.clear();
  }
  for (const Solid& solid : images.solids.all()) {
    Runs& image = several || zones ? work.section : work.runs;
    if (Status status = section_of(solid, layer, work, image, record, notes); !status) return status;
    if (several) work.materials.lay(solid.material.at(plane(layer)), image, work.runs);
    if (zones) work.zones.lay(solid.zone, image, work.runs, plan_.job.fill_rule == FillRule::kEvenOdd);
  }
  return {};
}

Status LayerImager::place(const Layer& layer, const PlacedImages& part, ImageWork& work, std::uint64_t& filled) const {
  const ImagePlan& images = *plan_.images;
  const std::uint32_t number = *part.image_at(plane(layer));
  if (const std::uint8_t full = images.dose.full(); full > 0) {
    const auto levels = part.images->levels(number, full);
    if (!levels) return levels.error();
    read::place(*levels, part.place, work.drops.zones);
    at_least(work.drops.zones, 1, work.section);
    filled = sum_of_levels(work.drops.zones);
  } else {
    const auto read = part.images->read(number);
    if (!read) return read.error();
    read::place(*read, part.place, work.section);
    filled = set_pixels(work.section);
  }
  const auto outside =
      images.machine ? program::first_outside(images.machine->machine, images.grid, work.section) : std::nullopt;
  if (!outside) return {};
  return Error{Fault::kUsage,
               fmt::format("{}: layer {} sets a pixel at x {:.3f}, y {:.3f} mm, {:.3f} mm outside of the bed of {}; "
                           "move the images",
                           plan_.scene->parts[part.part].path, layer.index, mm(outside->place.x), mm(outside->place.y),
                           outside->beyond_mm, images.machine->machine.name)};
}

Status LayerImager::images(const Layer& layer, ImageWork& work, ImageNotes& notes) const {
  const ImagePlan& images = *plan_.images;
  for (const PlacedImages& part : plan_.scene->images) {
    if (!part.image_at(plane(layer))) continue;
    std::uint64_t filled = 0;
    if (Status status = place(layer, part, work, filled); !status) return status;
    if (!notes.part_pixels.empty()) notes.part_pixels[part.part] += filled;
    if (const std::uint8_t full = images.dose.full(); full > 0) {
      raster::larger(work.drops.shares, work.drops.zones, work.drops.levels);
      std::swap(work.drops.shares, work.drops.levels);
      at_least(work.drops.zones, dose::half_of(full), work.section);
    }
    const DoseZones& zones = images.dose.zones();
    if (zones.several()) work.zones.lay(zones.of_part(part.part), work.section, work.runs);
    if (images.materials.several()) {
      work.materials.lay(images.materials.part[part.part].at(plane(layer)), work.section, work.runs);
    } else if (zones.several()) {
      continue;
    } else if (work.runs.change.empty()) {
      std::swap(work.runs, work.section);
    } else {
      raster::combine(work.runs, work.section, raster::SetOperation::kUnion, work.second);
      std::swap(work.runs, work.second);
    }
  }
  return {};
}

std::uint64_t LayerImager::changes_of_images(Nm plane) const {
  std::uint64_t changes = 0;
  for (const PlacedImages& part : plan_.scene->images) {
    if (const auto number = part.image_at(plane)) changes += part.images->expected_changes(*number);
  }
  return changes;
}

Status LayerImager::contours(const Layer& layer, ImageWork& work) const {
  if (!work.beads) work.beads = std::make_unique<BeadWork>(plan_.images->grid);
  return plan_.sections->contours(layer.index, work.beads->sections);
}

Status LayerImager::fill(const Layer& layer, ImageWork& work) const {
  return plan_.sections->fill(layer.index, work.beads->sections);
}

Status LayerImager::beads(const Layer& layer, ImageWork& work, ImageNotes& notes) const {
  if (Status status = plan_.images->beads->lay(layer, *work.beads); !status) return status;
  notes.solid_pixels = set_pixels(work.runs);
  plan_.images->beads->apply(work.runs, work.second, *work.beads);
  notes.bead_pixels = set_pixels(work.runs);
  return {};
}

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
  if (!zones.bleeds()) return {};
  if (zones.several() && images.beads) work.zones.keep(work.runs);
  for (std::uint32_t zone = 0; zone < zones.count(); ++zone) {
    const RunsView own = zones.several() ? work.zones.image[zone].view() : work.runs.view();
    const Bleed& bleed = zones.bleed(zone, layer);
    if (!bleed.outside.grows || !dose::grows_beyond(own, bleed.outside.reach)) continue;
    return Error{Fault::kUsage,
                 fmt::format("dose.bleed_um: in layer {} (z {:.3f} mm) edges would grow beyond the bed; move the "
                             "parts away from its edge",
                             layer.index, mm(layer.plane()))};
  }
  const std::uint64_t least = least_vanished();
  if (shares || least > 0) work.third = work.runs;
  zones.remove_bleed(layer, work.runs, work.zones.image, work.bleed);
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
  raster::combine(before, work.runs, raster::SetOperation::kDifference, work.second);
  const dose::Reach beside{{1, 1}};
  dose::dilate(work.second, beside, work.section);
  raster::combine(work.section, work.runs, raster::SetOperation::kDifference, work.second);
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
  if (!images.machine || !images.dose.zones().grows()) return {};
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
    share_out(layer, work);
  } else {
    levels(layer, work.coverage, work.drops.shares);
  }
  const auto differs = dose::take_half(images.dose.full(), work.runs, work.second, work.drops);
  record.half_differs = differs.pixels;
  record.half_far = differs.far;
  if (!shares_voxels()) return;
  // Voxels half full or more are those of the solid that has most of them.
  const std::uint32_t columns = images.grid.columns(), rows = images.grid.rows();
  const bool several = images.materials.several(), zones = images.dose.zones().several();
  if (several) work.materials.start(images.materials.used.size(), columns, rows);
  if (zones) work.zones.start(images.dose.zones().count(), columns, rows);
  for (std::size_t i = 0; i < work.drops.laid.size(); ++i) {
    const dose::LaidPart& part = work.drops.laid[i];
    const auto unite = [&](Runs& image) {
      raster::combine(image, work.drops.shared.owner[i], raster::SetOperation::kUnion, work.section);
      std::swap(image, work.section);
    };
    if (several) unite(work.materials.image[part.material]);
    if (zones) unite(work.zones.image[part.zone]);
  }
}

/// How full each solid makes the voxels, and all of them together.
void LayerImager::share_out(const Layer& layer, ImageWork& work) const {
  const std::span<const Solid> solids = plan_.images->solids.all();
  work.drops.laid.resize(solids.size());
  std::vector<Levels*> parts;
  for (std::size_t i = 0; i < solids.size(); ++i) {
    dose::LaidPart& part = work.drops.laid[i];
    solids[i].coverage->layer(layer, work.coverage, part.shares);
    part.zone = solids[i].zone;
    part.material = plan_.images->materials.several() ? solids[i].material.at(plane(layer)) : 0;
    parts.push_back(&part.shares);
  }
  dose::share_out(parts, plan_.images->dose.full(), work.drops.shared, work.drops.shares);
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
  if (images.materials.several() && shares_voxels()) split_materials(work);
  const bool counted = images.dose.saturates() && images.dose.most_drops() <= 1;
  record.set_pixels = counted ? record.drops : set_pixels(work.runs);
  const auto add_image = [&](const Runs& image) {
    record.images.push_back({.bytes = 0, .set_pixels = set_pixels(image), .unfed_pixels = 0, .hash = {}});
  };
  const bool grey = write::find_level_format(plan_.job.format) != nullptr;
  if (images.dose.most_drops() > 1 && !grey) std::ranges::for_each(work.drops.planes, add_image);
  std::ranges::for_each(work.materials.image, add_image);
  return {};
}

/// Of voxels that materials share, each drop is one material's.
void LayerImager::split_materials(ImageWork& work) {
  std::vector<Runs>& image = work.materials.image;
  for (std::size_t m = 0; m < image.size(); ++m) {
    if (m == 0) {
      image[m] = work.drops.up_to[m].front();
    } else {
      raster::combine(work.drops.up_to[m].front(), work.drops.up_to[m - 1].front(), raster::SetOperation::kDifference,
                      image[m]);
    }
  }
}

Status LayerImager::make(const Layer& layer, ImageWork& work, LayerRecord& record, ImageNotes& notes) const {
  if (Status status = raster(layer, work, record, notes); !status) return status;
  if (plan_.job.levels > 0) shares(layer, work, record);
  if (Status status = images(layer, work, notes); !status) return status;
  if (plan_.images->beads) {
    if (Status status = contours(layer, work); !status) return status;
    if (Status status = fill(layer, work); !status) return status;
    if (Status status = beads(layer, work, notes); !status) return status;
  }
  if (Status status = bleed(layer, work, notes); !status) return status;
  return dose(layer, work, record);
}

/// The section of one solid; observations go to the record and the notes.
Status LayerImager::section_of(const Solid& solid, const Layer& layer, ImageWork& work, Runs& image, LayerRecord& record,
                               ImageNotes& notes) const {
  const Engine engine = plan_.job.engine;
  const auto first = engine != Engine::kContours ? raster::Engine::kRays : raster::Engine::kContours;
  raster::LayerReport report = section(solid, first, layer, work, image);
  if (engine == Engine::kBoth) {
    section(solid, raster::Engine::kContours, layer, work, work.second);
    if (image.row_offset != work.second.row_offset || image.change != work.second.change) {
      return disagreement(layer, plan_.images->grid, image, work.second);
    }
  }
  if (!solid.instance.empty() && report.capped_rows > 0) {
    report.first_capped_instance = solid.instance[report.first_capped_instance];
  }
  record.capped_rows += report.capped_rows;
  add(report, notes.report);
  return {};
}

void LayerImager::mirror(Runs& image, Runs& scratch) const {
  raster::mirror(image, plan_.job.mirror != Mirror::kY, plan_.job.mirror != Mirror::kX, scratch);
  std::swap(image, scratch);
}

/// The image of a layer: its middle section, or the intersection or union of its lowest and highest sections.
raster::LayerReport LayerImager::section(const Solid& solid, raster::Engine engine, const Layer& layer, ImageWork& work,
                                         Runs& image) const {
  const raster::Rasterizer& rasterizer = solid.rasterizer;
  const Containment containment = plan_.job.heights.containment;
  if (containment == Containment::kAcross) return rasterizer.layer(engine, plane(layer), work.scratch, image);
  const raster::LayerReport low = rasterizer.layer(engine, layer.lowest_plane(), work.scratch, work.lowest);
  const raster::LayerReport high = rasterizer.layer(engine, layer.highest_plane(), work.scratch, work.highest);
  const bool inside = containment == Containment::kInside;
  raster::combine(work.lowest, work.highest, inside ? raster::SetOperation::kIntersection : raster::SetOperation::kUnion,
                  image);
  return low.open_rows + low.capped_rows >= high.open_rows + high.capped_rows ? low : high;
}

std::uint64_t LayerImager::changes_of_section(const Layer& layer, Nm plane, std::uint64_t bead_changes) const {
  const ImagePlan& images = *plan_.images;
  const std::uint64_t covered = images.covered.pixels(layer.bottom, std::int64_t{layer.bottom} + layer.thickness);
  return images.dose.changes_bound(images.solids.crossings_bound(plane) + changes_of_images(plane), covered) + bead_changes;
}

std::uint64_t LayerImager::changes_bound(const Layer& layer) const {
  if (plan_.job.heights.containment != Containment::kAcross) {
    return changes_of_section(layer, layer.lowest_plane(), 0) + changes_of_section(layer, layer.highest_plane(), 0);
  }
  return changes_of_section(layer, plane(layer),
                            plan_.images->beads ? 2 * plan_.images->beads->expected(layer.index).spans : 0);
}

std::uint64_t LayerImager::bytes_of(const Layer& layer) const {
  if (plan_.job.heights.containment != Containment::kAcross) {
    // Both sections, and an image with up to the crossings of both; doubled for a second engine or a mirror.
    return 2 * (bytes_of_section(layer.lowest_plane(), changes_of_section(layer, layer.lowest_plane(), 0)) +
                bytes_of_section(layer.highest_plane(), changes_of_section(layer, layer.highest_plane(), 0)));
  }
  const std::uint64_t of_section = bytes_of_section(plane(layer), changes_bound(layer));
  std::uint64_t of_shares = 0, scratch = 0;
  for (const Solid& solid : plan_.images->solids.all()) {
    if (!solid.coverage) continue;
    scratch = std::max(scratch, solid.coverage->scratch_bytes_bound(layer));
    of_shares += 9 * changes_bound(layer) + 4 * plan_.images->grid.rows();
  }
  // Of solids that share voxels, their shares twice, with their cores, and together; their drops for each material.
  if (shares_voxels()) of_shares *= 3 + plan_.images->materials.used.size();
  of_shares += scratch;
  return of_section + of_shares + (plan_.images->beads ? plan_.images->beads->bytes_expected(layer.index) : 0);
}

std::uint64_t LayerImager::bytes_of_section(Nm plane, std::uint64_t changes) const {
  const ImagePlan& images = *plan_.images;
  const std::uint64_t rows = images.grid.rows();
  const bool dosed = images.dose.any();
  const bool second = images.beads || plan_.job.engine == Engine::kBoth || plan_.job.mirror != Mirror::kNone || dosed;
  const std::uint64_t second_image = (second ? 8 * changes + 4 * rows : 0) * (dosed ? 5 : 1);
  // Images of each material, of all, of one solid, and one intermediate.
  const std::uint64_t materials = images.materials.several() ? images.materials.used.size() : 0;
  const std::uint64_t material_images = materials == 0 ? 0 : (materials + 3) * 2 * (4 * changes + 4 * rows);
  // Images of each dose, before and after they grow, with shells and cores; the whole before it is moved, and scratch.
  const std::uint64_t zones = images.dose.zones().several() ? images.dose.zones().count() : 0;
  const std::uint64_t edges = images.dose.edges_bound(images.solids.crossings_bound(plane) + changes_of_images(plane));
  const std::uint64_t zone_images = zones == 0 ? 0 : (2 * zones + 6) * 2 * (4 * edges + 4 * rows);
  // Zones and levels, and the image of each drop.
  const std::uint64_t drops = images.dose.saturates() ? 18 * changes + images.dose.most_drops() * 4 * (changes + rows) : 0;
  // An image as read and as placed; where levels are, 9 bytes a run of those and of both together.
  const std::uint64_t of_images = changes_of_images(plane), levels = plan_.job.levels > 0 ? 18 * of_images + 12 * rows : 0;
  const std::uint64_t read = plan_.scene->images.empty() ? 0 : 8 * (of_images + rows) + levels;
  return images.solids.layer_bytes_bound(plane) + read + second_image + material_images + zone_images + drops;
}

}  // namespace lamina::pipeline
