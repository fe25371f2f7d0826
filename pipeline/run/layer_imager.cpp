// The steps of a layer's images; those that give binder are in layer_dose.cpp.
#include <fmt/core.h>

#include <algorithm>

#include "pipeline/run/image_maker.h"
#include "stages/formats/images/placed.h"
#include "stages/geometry/combine.h"
#include "stages/program/reach.h"
#include "stages/raster/mirror.h"

namespace lamina::pipeline {
namespace {

/// The first difference between two engines.
Error disagreement(const Layer& layer, const PixelGrid& grid, const RunsView& rays, const RunsView& contours) {
  const auto [column, row] = first_difference(rays, contours);
  return {Fault::kVerification,
          fmt::format("layer {}: engines disagree first in image row {}, column {} (x {:.4f} mm, y {:.4f} mm, z {:.4f} "
                      "mm); this is a fault of lamina, please report it with the part",
                      layer.index, row, column, mm(grid.x.centre(column)), mm(grid.y.centre(grid.rows() - 1 - row)),
                      mm(layer.plane()))};
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
    if (shares_voxels()) {
      lay_shares(layer, part.part, work);
      continue;
    }
    if (const std::uint8_t full = images.dose.full(); full > 0) {
      larger(work.drops.shares, work.drops.zones, work.drops.levels);
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
      combine(work.runs, work.section, SetOperation::kUnion, work.second);
      std::swap(work.runs, work.second);
    }
  }
  if (!shares_voxels() || plan_.scene->images.empty()) return {};
  dose::share_out(images.dose.full(), images.grid.columns(), images.grid.rows(), work.drops);
  at_least(work.drops.shares, dose::half_of(images.dose.full()), work.runs);
  own_voxels(work);
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
  notes.report.add_solid(report);
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
  combine(work.lowest, work.highest, inside ? SetOperation::kIntersection : SetOperation::kUnion, image);
  return low.open_rows + low.capped_rows >= high.open_rows + high.capped_rows ? low : high;
}

std::array<Nm, 2> LayerImager::planes(const Layer& layer) const {
  if (plan_.job.heights.containment == Containment::kAcross) return {plane(layer), plane(layer)};
  return {layer.lowest_plane(), layer.highest_plane()};
}

dose::DropSizes LayerImager::sizes_of(const Layer& layer, std::uint64_t pixels) const {
  const ImagePlan& images = *plan_.images;
  const auto [low, high] = planes(layer);
  const std::uint64_t of_images = changes_of_images(plane(layer));
  std::uint64_t changes =
      images.solids.crossings_bound(low) + (high == low ? 0 : images.solids.crossings_bound(high)) + of_images;
  dose::DropSizes sizes{images.grid.rows(), images.grid.columns(), images.dose.edges_bound(changes)};
  if (images.beads) sizes.edges += 2 * images.beads->expected(layer.index).spans;
  sizes.pixels = std::min(pixels, sizes.rows * sizes.columns);
  sizes.zones = images.dose.zones().several() || images.dose.bleeds() || plan_.job.mirror != Mirror::kNone || of_images > 0;
  sizes.materials = static_cast<std::uint32_t>(std::max<std::size_t>(1, images.materials.used.size()));
  if (images.dose.has_copies()) sizes.parts = images.dose.zones().count();
  if (plan_.job.levels == 0) return sizes;
  std::uint64_t voxels = of_images;
  sizes.runs = of_images;
  for (const Solid& solid : images.solids.all()) {
    if (!solid.coverage) continue;
    const cover::LayerBound bound = solid.coverage->bound(layer);
    sizes.runs += bound.runs, sizes.edges += bound.edges;
    voxels += bound.voxels;
  }
  // Full voxels get whole drops without a saturation, which is a machine's.
  if (pixels == kUnknown && !images.machine) sizes.pixels = std::min(sizes.pixels, voxels);
  if (shares_voxels()) sizes.parts = static_cast<std::uint32_t>(images.solids.all().size() + plan_.scene->images.size());
  return sizes;
}

std::uint64_t LayerImager::bytes_of(const Layer& layer, std::uint64_t pixels) const {
  const ImagePlan& images = *plan_.images;
  const dose::DropSizes sizes = sizes_of(layer, pixels);
  const dose::DropBound drops = images.dose.bound(sizes);
  const std::uint64_t rows = sizes.rows, edges = sizes.edges, zones = images.dose.zones().count();
  const auto image = [rows](std::uint64_t changes) { return 8 * changes + 4 * rows; };
  const auto [low, high] = planes(layer);
  std::uint64_t total = drops.bytes + images.solids.layer_bytes_bound(low);
  if (high != low) total += images.solids.layer_bytes_bound(high);
  // The image, and one more; those of bleed, with what it took away.
  total += image(edges) * (2 + (images.dose.bleeds() ? 6 : 0));
  if (plan_.job.dose.core < 1) total += image(edges) + 2 * image(drops.changes);
  // Images of each material, of all, of one solid, and one intermediate.
  if (images.materials.several()) total += (images.materials.used.size() + 3) * image(std::max(edges, drops.changes));
  // Images of each dose, before and after they grow, with shells and cores; the whole before it is moved, and scratch.
  if (images.dose.zones().several()) total += (2 * zones + 6) * image(edges);
  // An image as read and as placed; where levels are, 9 bytes a run of those and of both together.
  const std::uint64_t of_images = changes_of_images(plane(layer));
  if (!plan_.scene->images.empty())
    total += image(of_images) + 4 * rows + (plan_.job.levels > 0 ? 18 * of_images + 12 * rows : 0);
  std::uint64_t scratch = 0;
  for (const Solid& solid : images.solids.all()) {
    if (solid.coverage) scratch = std::max(scratch, solid.coverage->bound(layer).scratch_bytes);
  }
  return total + scratch + (images.beads ? images.beads->bytes_expected(layer.index) : 0);
}

}  // namespace lamina::pipeline
