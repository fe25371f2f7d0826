#include "pipeline/run/layer_imager.h"

#include <fmt/core.h>

#include <algorithm>
#include <functional>
#include <numbers>
#include <utility>

#include "stages/dose/edges.h"
#include "stages/formats/image_format.h"
#include "stages/formats/images/placed.h"
#include "stages/geometry/combine.h"
#include "stages/program/bed.h"

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
  for (const std::optional<BitImage>* image : {&bits, &section_bits}) total += *image ? (*image)->bytes() : 0;
  return total;
}

/// Whether images of parts are only placed and written: then large ones stay bits.
bool LayerImager::takes_bits() const {
  const ImagePlan& images = *plan_.images;
  return plan_.job.levels == 0 && !plan_.job.inspect && !images.beads && !images.dose.any() && !images.materials.several() &&
         !images.dose.zones().several() && formats::find_image_format(plan_.job.format) != nullptr;
}

Status LayerImager::raster(const Layer& layer, ImageWork& work, LayerRecord& record, ImageNotes& notes) const {
  const ImagePlan& images = *plan_.images;
  const bool several = images.materials.several(), zones = images.dose.zones().several();
  work.bits.reset();
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
    if (several) work.materials.deposit(solid.material.at(plane(layer)), image, work.runs);
    if (zones) work.zones.deposit(solid.zone, image, work.runs, plan_.job.fill_rule == FillRule::kEvenOdd);
  }
  return {};
}

Status LayerImager::position(const Layer& layer, const PlacedImages& part, ImageWork& work, std::uint64_t& filled) const {
  const ImagePlan& images = *plan_.images;
  const std::uint32_t number = *part.image_at(plane(layer));
  if (const std::uint8_t full = images.dose.full(); full > 0) {
    const auto levels = part.images->levels(number, full);
    if (!levels) return levels.error();
    formats::position(*levels, part.position, work.drops.zones);
    threshold_levels(work.drops.zones, 1, work.section);
    filled = sum_of_levels(work.drops.zones);
  } else {
    const auto read = part.images->read(number, keeps_bits_ ? Keep::kSmaller : Keep::kRuns);
    if (!read) return read.error();
    work.section_bits.reset();
    if (read->bits) {
      RunsBuilder builder(images.grid.columns(), images.grid.rows(), Keep::kSmaller);
      formats::position(*read->bits, part.position, builder);
      work.section = builder.finish();
      work.section_bits = builder.take_bits();
    } else {
      formats::position(read->runs, part.position, work.section);
    }
    filled = work.section_bits ? work.section_bits->set_pixels() : set_pixels(work.section);
  }
  const RowRuns placed = work.section_bits ? RowRuns(*work.section_bits) : RowRuns(work.section);
  const auto outside = images.machine ? program::first_outside(images.machine->machine, images.grid, placed) : std::nullopt;
  if (!outside) return {};
  return Error{Fault::kUsage,
               fmt::format("{}: layer {} sets a pixel at x {:.3f}, y {:.3f} mm, {:.3f} mm outside of the bed of {}; "
                           "move the images",
                           plan_.scene->parts[part.part].path, layer.index, mm(outside->position.x), mm(outside->position.y),
                           outside->beyond_mm, images.machine->machine.name)};
}

Status LayerImager::images(const Layer& layer, ImageWork& work, ImageNotes& notes) const {
  const ImagePlan& images = *plan_.images;
  for (const PlacedImages& part : plan_.scene->images) {
    if (!part.image_at(plane(layer))) continue;
    std::uint64_t filled = 0;
    if (Status status = position(layer, part, work, filled); !status) return status;
    if (!notes.part_pixels.empty()) notes.part_pixels[part.part] += filled;
    if (shares_voxels()) {
      add_shares(layer, part.part, work);
      continue;
    }
    if (const std::uint8_t full = images.dose.full(); full > 0) {
      larger(work.drops.shares, work.drops.zones, work.drops.levels);
      std::swap(work.drops.shares, work.drops.levels);
      threshold_levels(work.drops.zones, dose::half_of(full), work.section);
    }
    const DoseZones& zones = images.dose.zones();
    if (zones.several()) work.zones.deposit(zones.of_part(part.part), work.section, work.runs);
    if (images.materials.several()) {
      work.materials.deposit(images.materials.part[part.part].at(plane(layer)), work.section, work.runs);
    } else if (zones.several()) {
      continue;
    } else {
      merge_section(work);
    }
  }
  if (!shares_voxels() || plan_.scene->images.empty()) return {};
  dose::share_out(images.dose.full(), images.grid.columns(), images.grid.rows(), work.drops);
  threshold_levels(work.drops.shares, dose::half_of(images.dose.full()), work.runs);
  own_voxels(work);
  return {};
}

/// Adds the section to the image of the layer; both may be bits.
void LayerImager::merge_section(ImageWork& work) const {
  if (work.section_bits && work.bits) {
    for (std::uint32_t r = 0; r < work.bits->rows(); ++r)
      std::ranges::transform(work.bits->row(r), std::as_const(*work.section_bits).row(r), work.bits->row(r).begin(), std::bit_or());
    work.section_bits.reset();
  } else if (work.section_bits || work.bits) {
    const Runs& others = work.section_bits ? work.runs : work.section;
    if (work.section_bits) work.bits = std::exchange(work.section_bits, std::nullopt);
    for (std::uint32_t r = 0; r < others.view().rows(); ++r) add_runs(others.view().row(r), work.bits->row(r));
    work.runs.change.clear();
    work.runs.row_offset.assign(std::size_t{work.bits->rows()} + 1, 0);
  } else if (work.runs.change.empty()) {
    std::swap(work.runs, work.section);
  } else {
    combine(work.runs, work.section, SetOperation::kUnion, work.second);
    std::swap(work.runs, work.second);
  }
}

bool LayerImager::samples() const {
  const PixelGrid& grid = plan_.images->grid;
  const auto inside = [](Nm low, Nm high, const PixelAxis& axis) {
    const auto pixel = static_cast<std::int64_t>(1 / axis.pixels_per_nm()) + 1;
    return low >= pixel && high <= axis.length - pixel;
  };
  const Scene& scene = *plan_.scene;
  return plan_.job.heights.containment == Containment::kAcross && plan_.job.levels == 0 && scene.images.empty() &&
         !plan_.images->beads && std::ranges::all_of(scene.instances, [&](const Instance& instance) {
           const Box box = box_of(scene, instance);
           return inside(box.lo.x, box.hi.x, grid.x) && inside(box.lo.y, box.hi.y, grid.y);
         });
}

void LayerImager::sample(const Layer& layer, std::uint32_t number, ImageWork& work) const {
  constexpr std::array<std::array<int, 3>, kSamples> kQuarters{{{-1, 1, 2}, {1, 2, -1}, {2, -1, 1}}};
  const auto& [x, y, z] = kQuarters[number];
  const PixelGrid& grid = plan_.images->grid;
  const auto quarters = [](int of, const PixelAxis& axis) { return static_cast<Nm>(of * axis.span / (4 * axis.dots)); };
  const std::array<Nm, 2> shift{quarters(x, grid.x), quarters(y, grid.y)};
  const Nm height = plane(layer) + z * (layer.thickness / 4);
  const auto engine = plan_.job.engine == Engine::kContours ? raster::Engine::kContours : raster::Engine::kRays;
  bool first = true;
  for (const Solid& solid : plan_.images->solids.all()) {
    solid.rasterizer.layer(engine, height, work.scratch, first ? work.second : work.section, shift);
    if (!first) {
      combine(work.second, work.section, SetOperation::kUnion, work.lowest);
      std::swap(work.second, work.lowest);
    }
    first = false;
  }
}

std::uint64_t LayerImager::changes_of_images(Nm plane) const {
  std::uint64_t changes = 0;
  for (const PlacedImages& part : plan_.scene->images) {
    if (const auto number = part.image_at(plane)) changes += part.images->expected_changes(*number);
  }
  return changes;
}

/// What they become as runs or bits, in changes whose runs take as much memory.
std::uint64_t LayerImager::kept_changes(Nm plane) const {
  const PixelGrid& grid = plan_.images->grid;
  const std::uint64_t changes = changes_of_images(plane);
  return keeps_bits_ ? std::min(changes, bytes_of_bits(grid.columns(), grid.rows()) / 8) : changes;
}

Status LayerImager::contours(const Layer& layer, ImageWork& work) const {
  if (!work.beads) work.beads = std::make_unique<BeadWork>(plan_.images->grid, plan_.job.isa);
  return plan_.sections->contours(layer.index, work.beads->sections);
}

Status LayerImager::fill(const Layer& layer, ImageWork& work) const {
  return plan_.sections->fill(layer.index, work.beads->sections);
}

Status LayerImager::beads(const Layer& layer, ImageWork& work, ImageNotes& notes) const {
  if (Status status = plan_.images->beads->deposit(layer, *work.beads); !status) return status;
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
  if (!solid.instance.empty() && report.level.area_um2 > 0) report.level.owner = solid.instance[report.level.owner];
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
  raster::LayerReport report = low.open_rows + low.capped_rows >= high.open_rows + high.capped_rows ? low : high;
  report.level = low.level;
  report.level.keep_larger(high.level);
  return report;
}

std::array<Nm, 2> LayerImager::planes(const Layer& layer) const {
  if (plan_.job.heights.containment == Containment::kAcross) return {plane(layer), plane(layer)};
  return {layer.lowest_plane(), layer.highest_plane()};
}

/// of_images  changes of the images of parts
dose::DropSizes LayerImager::sizes_of(const Layer& layer, std::uint64_t pixels, std::uint64_t of_images) const {
  const ImagePlan& images = *plan_.images;
  const auto [low, high] = planes(layer);
  std::uint64_t changes =
      images.solids.crossings_bound(low) + (high == low ? 0 : images.solids.crossings_bound(high)) + of_images;
  dose::DropSizes sizes{images.grid.rows(), images.grid.columns(), images.dose.edges_bound(changes)};
  if (images.beads) sizes.edges += 2 * images.beads->expected(layer.index).spans;
  sizes.pixels = std::min(pixels, sizes.rows * sizes.columns);
  sizes.zones = images.dose.zones().several() || images.dose.bleeds() || plan_.job.mirror != Mirror::kNone || of_images > 0;
  sizes.materials = static_cast<std::uint32_t>(std::max<std::size_t>(1, images.materials.used.size()));
  sizes.doses = images.dose.zones().count();
  if (images.dose.has_copies()) sizes.parts = images.dose.zones().count();
  if (plan_.job.levels == 0) return sizes;
  std::uint64_t voxels = of_images;
  sizes.runs = of_images;
  for (const Solid& solid : images.solids.all()) {
    if (!solid.coverage) continue;
    const coverage::LayerBound bound = solid.coverage->bound(layer);
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
  const std::uint64_t of_images = kept_changes(plane(layer));
  const dose::DropSizes sizes = sizes_of(layer, pixels, of_images);
  const dose::DropBound drops = images.dose.bound(sizes);
  const std::uint64_t rows = sizes.rows, edges = sizes.edges, zones = images.dose.zones().count();
  const auto image = [rows](std::uint64_t changes) { return 8 * changes + 4 * rows; };
  const auto [low, high] = planes(layer);
  std::uint64_t total = drops.bytes + images.solids.layer_bytes_bound(low);
  if (high != low) total += images.solids.layer_bytes_bound(high);
  // The image, and one more; those of bleed, with what it took away.
  total += image(edges) * (2 + (images.dose.bleeds() ? 6 : 0));
  // Images of each material, of all, of one solid, and one intermediate.
  if (images.materials.several()) total += (images.materials.used.size() + 3) * image(edges);
  // Images of each dose, before and after they grow, with shells and cores; the whole before it is moved, and scratch.
  if (images.dose.zones().several()) total += (2 * zones + 6) * image(edges);
  // An image as read and as placed; where levels are, 9 bytes a run of those and of both together.
  if (!plan_.scene->images.empty())
    total += image(of_images) + 4 * rows + (plan_.job.levels > 0 ? 18 * of_images + 12 * rows : 0);
  std::uint64_t scratch = 0;
  for (const Solid& solid : images.solids.all()) {
    if (solid.coverage) scratch = std::max(scratch, solid.coverage->bound(layer).scratch_bytes);
  }
  return total + scratch + (images.beads ? images.beads->bytes_expected(layer.index) : 0);
}

// --- binder: shares of voxels, bleed, drops

bool LayerImager::shares_voxels() const {
  return plan_.job.levels > 0 && (plan_.images->materials.several() || plan_.images->dose.zones().several());
}

coverage::CoverageReport LayerImager::levels(const Layer& layer, coverage::CoverageScratch& scratch, Levels& image) const {
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
    if (work.bits) raster::mirror(*work.bits, axes != Mirror::kY, axes != Mirror::kX);
    mirror(work.runs, work.second);
    for (Runs& image : work.materials.image) mirror(image, work.second);
    for (Runs& image : work.zones.image) mirror(image, work.second);
    if (shares) dose::mirror(work.drops.shares, axes != Mirror::kY, axes != Mirror::kX, work.drops.zones);
    if (shares) std::swap(work.drops.shares, work.drops.zones);
    if (shares_voxels()) {
      for (dose::DepositedPart& part : work.drops.deposited) {
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
  const std::uint64_t minimum = min_vanished();
  if (shares || minimum > 0) work.third = work.runs;
  zones.bleeds().remove(layer, work.runs, work.zones.image, work.bleed);
  if (minimum > 0) notes.vanished = checks::vanished_pieces(work.third, work.runs, minimum, work.vanish);
  if (shares) empty_removed(work.third, shares_voxels(), work);
  return check_grown(layer, work);
}

/// Pixels of four discs of the widest bleed inwards; 0: there is none, or beads fill the parts.
std::uint64_t LayerImager::min_vanished() const {
  if (plan_.images->beads) return 0;
  double widest = 0;
  for (const auto& [x, y] : bleeds_of(plan_.job)) widest = std::max(widest, std::max(x, 0.0) * std::max(y, 0.0));
  const PixelGrid& grid = plan_.images->grid;
  const double pixels = 4 * std::numbers::pi * widest * 1e6 * grid.x.pixels_per_nm() * grid.y.pixels_per_nm();
  return widest > 0 ? std::max<std::uint64_t>(1, static_cast<std::uint64_t>(pixels)) : 0;
}

/// Where an edge moved inwards, the voxels that it left and adjacent ones that are less than half full are emptied.
void LayerImager::empty_removed(const Runs& before, bool deposited, ImageWork& work) {
  combine(before, work.runs, SetOperation::kDifference, work.second);
  const dose::Reach neighbour{{1, 1}};
  dose::dilate(work.second, neighbour, work.section);
  combine(work.section, work.runs, SetOperation::kDifference, work.second);
  dose::without(work.drops.shares, work.second, work.drops.zones);
  std::swap(work.drops.shares, work.drops.zones);
  if (!deposited) return;
  for (dose::DepositedPart& part : work.drops.deposited) {
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
  return Error{Fault::kUsage,
               fmt::format("dose.bleed_um: layer {} grows to x {:.3f}, y {:.3f} mm, {:.3f} mm outside of the bed "
                           "of {}; move the parts away from its edge",
                           layer.index, mm(outside->position.x), mm(outside->position.y), outside->beyond_mm,
                           images.machine->machine.name)};
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
  for (std::size_t i = 0; i < work.drops.deposited.size(); ++i) {
    const dose::DepositedPart& part = work.drops.deposited[i];
    const auto merge = [&](Runs& image) {
      combine(image, work.drops.shared.owner[i], SetOperation::kUnion, work.section);
      std::swap(image, work.section);
    };
    if (several) merge(work.materials.image[part.material]);
    if (zones) merge(work.zones.image[part.zone]);
  }
}

/// How full each solid makes the voxels.
void LayerImager::cover(const Layer& layer, ImageWork& work) const {
  const std::span<const Solid> solids = plan_.images->solids.all();
  work.drops.deposited.resize(solids.size());
  for (std::size_t i = 0; i < solids.size(); ++i) {
    dose::DepositedPart& part = work.drops.deposited[i];
    solids[i].coverage->layer(layer, work.coverage, part.shares);
    part.zone = solids[i].zone;
    part.material = plan_.images->materials.several() ? solids[i].material.at(plane(layer)) : 0;
  }
}

/// Those of an image, as placed in work.drops.zones, lie over the parts before: of the same kind as the last one, the larger
/// share counts.
void LayerImager::add_shares(const Layer& layer, std::uint32_t part, ImageWork& work) const {
  std::vector<dose::DepositedPart>& deposited = work.drops.deposited;
  const std::uint32_t zone = plan_.images->dose.zones().of_part(part);
  const std::uint32_t material = plan_.images->materials.several() ? plan_.images->materials.part[part].at(plane(layer)) : 0;
  if (deposited.empty() || deposited.back().zone != zone || deposited.back().material != material) {
    deposited.push_back({work.drops.zones, {}, zone, material});
  } else {
    larger(deposited.back().shares, work.drops.zones, work.drops.levels);
    std::swap(deposited.back().shares, work.drops.levels);
  }
}

Status LayerImager::dose(const Layer& layer, ImageWork& work, LayerRecord& record) const {
  const ImagePlan& images = *plan_.images;
  const bool several = images.materials.several();
  work.drops.drops.clear();
  if (images.dose.zones().several() && images.beads) work.zones.keep(work.runs);
  if (images.geometry) record.geometry_pixels = set_pixels(work.runs);
  if (images.dose.thins()) images.dose.thin(layer.index, work.runs, work.second, work.drops);
  if (images.dose.saturates()) {
    const auto materials = static_cast<std::uint32_t>(std::max<std::size_t>(1, images.materials.used.size()));
    const auto sums =
        images.dose.saturate(layer, shares_voxels(), materials, work.runs, work.zones.image, work.second, work.drops);
    if (!sums) return sums.error();
    record.dosed_pixels = sums->full_voxels;
    record.requested_drops = sums->requested_drops;
  } else if (plan_.job.levels > 0) {
    threshold_levels(work.drops.shares, 1, work.runs);
    record.dosed_pixels = dose::sums_of(work.drops.shares, images.dose.full(), dose::one_drop()).full_voxels;
  }
  if (several && !work.drops.dosed() && (images.beads || images.dose.bleeds())) work.materials.keep(work.runs);
  if (several && work.drops.dosed() && !shares_voxels()) dose::separate_materials(work.materials.image, work.drops);
  count(work, record);
  return {};
}

void LayerImager::count(ImageWork& work, LayerRecord& record) const {
  const DosePlan& dose = plan_.images->dose;
  if (!work.drops.dosed()) {
    record.set_pixels = work.bits ? work.bits->set_pixels() : set_pixels(work.runs);
    for (const Runs& image : work.materials.image) record.images.emplace_back().set_pixels = set_pixels(image);
    return;
  }
  const DropTotals totals(work.drops.drops[0], work.drops.counter);
  record.set_pixels = totals.pixels();
  if (dose.saturates()) {
    record.drops = totals.drops();
    record.max_drops = totals.maximum();
  }
  const bool grey = formats::find_level_format(plan_.job.format) != nullptr, several = plan_.images->materials.several();
  const std::uint32_t planes = grey || plan_.images->geometry ? 1 : std::max(1u, dose.max_drops());
  for (std::size_t m = several ? 1 : 0; m < work.drops.drops.size() && (several || planes > 1); ++m) {
    const DropTotals own = several ? DropTotals(work.drops.drops[m], work.drops.counter) : totals;
    for (std::uint32_t drop = 0; drop < planes; ++drop) record.images.emplace_back().set_pixels = own.pixels(drop);
    if (grey) record.images.back().drops = own.drops();
  }
}

}  // namespace lamina::pipeline
