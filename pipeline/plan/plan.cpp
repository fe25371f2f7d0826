#include "pipeline/plan/plan.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <future>
#include <set>

#include "pipeline/job/errors.h"
#include "pipeline/plan/layers.h"
#include "pipeline/plan/raft.h"
#include "pipeline/plan/repeated.h"
#include "pipeline/plan/scene.h"
#include "stages/checks/layer_warnings.h"
#include "stages/formats/extrusion_format.h"
#include "stages/formats/image_format.h"
#include "stages/formats/slice_format.h"
#include "stages/geometry/bead_section.h"
#include "stages/geometry/blocks/mesh_blocks.h"
#include "stages/heights/heights.h"
#include "stages/raster/beams.h"
#include "stages/support/clocks.h"
#include "stages/support/text/number_text.h"
#include "stages/support/text/readable.h"

namespace lamina::pipeline {
namespace {

/// Whether layer images are those before the dose, where there is one.
bool has_images_of_geometry(const Job& job, bool machine) {
  return machine && drops_follow_image(job) && job.image_content != ImageContent::kDrops &&
         formats::find_level_format(job.format) == nullptr;
}

/// Builds a plan step by step.
class Planner {
 public:
  Planner(Resolved resolved, const ProgressCallback& progress) : progress_(progress) {
    plan_.job = std::move(resolved.job);
    plan_.product = resolved.product;
    plan_.bed = resolved.bed;
    streams_layers_ = resolved.streams_layers;
    if (resolved.printer) printer_ = std::move(*resolved.printer);
    if (resolved.extruder) plan_.moves.emplace(MovePlan{std::move(*resolved.extruder)});
  }

  Result<Plan> make() {
    for (const auto step : {&Planner::read_fillings, &Planner::load, &Planner::decide_layers, &Planner::check_machine,
                            &Planner::index_sections, &Planner::index_images, &Planner::foresee_beads}) {
      if (Status status = (this->*step)(); !status) return status.error();
    }
    return std::move(plan_);
  }

 private:
  Job& job() { return plan_.job; }
  bool images() const { return plan_.product == Product::kImages; }
  /// The powder printer, or null.
  const Machine* machine() const { return printer_.machine ? &printer_.machine->machine : nullptr; }
  bool moves() const { return plan_.product == Product::kMoves; }

  /// Plans segmentations first, because they decide the line distances of fillings.
  Status read_fillings() {
    FillRequest fill = job().fill;
    if (images()) {
      auto materials = materials_of(job(), machine());
      if (!materials) return materials.error();
      materials_ = std::move(*materials);
      // No layer of one powder mixes: the rule has no effect, and the kept profile names one value.
      if (printer_.machine && !materials_.several()) printer_.machine->machine.powder.vat_rule = VatRule::kMajority;
      beads_ = job().segment.any();
    }
    if (beads_ || moves()) {
      if (Status status = segment(fill); !status) return status;
    }
    const auto fills = read_parts(fill);
    if (!fills) return fills.error();
    if (!images() || beads_ || !*fills) return {};
    beads_ = true;
    return segment(fill);
  }

  Status segment(FillRequest& fill) {
    auto segments = images() ? plan_bead_segments(job(), fill, plan_.warnings)
                             : plan_segments(job().segment, plan_.moves->profile.calibration, fill);
    if (!segments) return segments.error();
    plan_.segments = std::make_unique<SegmentPlan>(std::move(*segments));
    return {};
  }

  /// The filling of each part. returns  whether any part has walls or lines
  Result<bool> read_parts(const FillRequest& fill) {
    bool any = false;
    const auto heights = heights_options(job());
    if (!heights) return heights.error();
    const Nm nominal = heights->set.maximum();
    // Beads of powder are as high as the layer at their full width.
    const BeadShape shape = moves()    ? plan_.moves->profile.machine.material.shape()
                            : images() ? BeadShape::kRectangle
                                       : BeadShape::kStadium;
    for (const PartRequest& part : job().parts) {
      auto filling = plan_filling(fill, part.fill);
      if (!filling) return filling.error();
      any |= filling->fills();
      filling->set_beads(shape, nominal, !moves() || plan_.moves->profile.machine.format != "sml");
      fillings_.push_back(std::move(*filling));
    }
    return any;
  }

  /// Contours, and images of layers of one thickness, need no list of triangles.
  MeshForm form() {
    if (plan_.product == Product::kContours || beads_) return MeshForm::kOrderedBlocks;
    const auto options = heights_options(job());
    if (!options || options->mode != heights::Mode::kUniform || job().heights.per_part) return MeshForm::kLists;
    return images() ? MeshForm::kBlocks : MeshForm::kLists;
  }

  Status load() { return read_parts_as(form()); }
  Status read_parts_as(MeshForm form) {
    const Stopwatch loading;
    progress_({ProgressEvent::Stage::kLoading});
    std::future<void> neighbour;  // without a thread to spare it is never run, and the index does it
    if (images() && job().engine != Engine::kContours) neighbour = std::async(raster::BeamIndex::prepare);
    auto scene = load_scene(job(), plan_.bed, form, images() ? &printer_.grid : nullptr);
    if (!scene) return scene.error();
    drop_repeated(job().fill_rule, *scene);
    plan_.scene = std::make_unique<Scene>(std::move(*scene));
    for (const PlacedImages& images : plan_.scene->images) {
      // Their manifest may put them higher than the job.
      const std::int64_t by = images.bottom - nm_of(job().parts[images.part].bottom_mm.value_or(0));
      if (materials_.part.empty() || raised_.contains(images.part)) continue;
      raised_.insert(images.part);
      for (PartMaterial::MaterialInterval& range : materials_.part[images.part].ranges) range.from += by, range.to += by;
    }
    plan_.triangles = 0;
    for (const Instance& instance : plan_.scene->instances) {
      plan_.triangles += triangle_count(plan_.scene->meshes[instance.mesh]);
    }
    if (Status status = fit_layers(*plan_.scene, beads_, job()); !status) return status;
    const Elapsed took = loading.elapsed();
    plan_.load_seconds = took.wall;
    plan_.load_processor_seconds = took.processor;
    return {};
  }

  Status decide_layers() {
    indexing_ = Stopwatch();
    progress_({ProgressEvent::Stage::kIndexing});
    if (machine() != nullptr) {
      Status status = check_reach(*machine(), *plan_.scene);
      if (!status && form() != MeshForm::kLists) {  // the order of the file decides which of equal positions is reported
        if (Status listed = read_parts_as(MeshForm::kLists); !listed) return listed;
        status = check_reach(*machine(), *plan_.scene);
      }
      if (!status) return status;
    }
    if (Status status = check_layer_count(); !status) return status;
    if (streams_layers()) {
      auto begun = begin_heights(job(), *plan_.scene, plan_.heights);
      if (!begun) return begun.error();
      plan_.undecided = std::move(*begun);
      return {};
    }
    if (!job().heights.per_part) {
      auto heights = decide_heights(job(), *plan_.scene);
      if (!heights) return heights.error();
      plan_.heights = std::move(*heights);
    }
    if (!images() || beads_) {
      auto schedule = schedule_layers(job(), *plan_.scene, plan_.heights.table);
      if (!schedule) return schedule.error();
      schedule_ = std::move(*schedule);
    }
    warn_of_open_top();
    if (moves()) plan_.moves->left_out = drop_empty_top(*plan_.scene, job().heights.containment, schedule_);
    plan_.layer_count =
        job().heights.per_part || moves() ? static_cast<std::uint32_t>(schedule_.layers.size()) : plan_.heights.table.size();
    return {};
  }

  bool streams_layers() const {
    const Job& job = plan_.job;
    const bool counts_first = beads_ || machine() != nullptr || job.inspect || job.resume || job.dry_run || !job.title.empty();
    const bool whole = !job.layers && !job.shard;
    const bool warns_of_top = covers_top(job) && job.heights.containment == Containment::kInside;
    return streams_layers_ && images() && whole && !counts_first && !warns_of_top && plan_.scene->images.empty() &&
           decides_in_order(job);
  }

  /// Steps inside of a part and a layer that ends above it exclude each other.
  void warn_of_open_top() {
    if (!covers_top(job()) || job().heights.containment != Containment::kInside) return;
    const heights::LayerTable& table = plan_.heights.table;
    const Layer last = job().heights.per_part ? schedule_.layers.back().layer : table[table.size() - 1];
    checks::warn_of_open_top(last, plan_.scene->height, plan_.warnings);
  }

  /// Layers of one thickness are counted before there is a table of them. errors  kUsage: it does not fit into the memory
  Status check_layer_count() {
    const auto options = heights_options(job());
    if (!options) return options.error();
    const double bytes_of_layer = images() && !beads_ ? 32 : 96;  // in the table, the schedule, the planes and their index
    const double count = static_cast<double>(plan_.scene->height) / static_cast<double>(options->set.minimum());
    if (options->mode != heights::Mode::kUniform || count * bytes_of_layer <= static_cast<double>(job().memory_bytes))
      return {};
    return usage(
        "{:.0f} layers of {} mm take {} for their table alone, --memory is {}; give thicker layers or more "
        "memory",
        std::ceil(count), number_text(mm(options->set.minimum())),
        readable_bytes(static_cast<std::uint64_t>(count * bytes_of_layer)), readable_bytes(job().memory_bytes));
  }

  Status check_machine() {
    if (machine() != nullptr) {
      Result<std::string> steps = heights::check_build_steps(*machine(), plan_.heights.table);
      if (!steps) return steps.error();
      if (!steps->empty()) plan_.warnings.push_back({"build-steps", std::move(*steps)});
      warn_of_machine(*machine(), printer_.machine->grid, plan_.warnings);
    }
    const auto range = layer_range(job(), plan_.layer_count);
    if (!range) return range.error();
    plan_.range = *range;
    if (!moves()) return {};
    const Extruder& machine = plan_.moves->profile.machine;
    const RaftPlan raft = plan_raft(job().extrude, schedule_.layers.front().layer.thickness);
    if (mm(std::int64_t{plan_.scene->height} + raft.lift) > machine.bed.build_height_mm) {
      return usage("the parts are {:.3f} mm high{}, {} builds {:.3f} mm; turn or scale them", mm(plan_.scene->height),
                   raft.lift > 0 ? fmt::format(" on a raft of {:.3f} mm", mm(raft.lift)) : "", machine.name,
                   machine.bed.build_height_mm);
    }
    const auto bottom = [](const PartSummary& part) { return part.bounds.lo.z; };
    if (const Nm lowest = std::ranges::min(plan_.scene->parts, {}, bottom).bounds.lo.z; raft.lift > 0 && lowest > 0)
      return usage("extrude.raft_layers (--raft): the parts begin {:g} mm above the bed; move one of them down to it", mm(lowest));
    const auto format = formats::make_extrusion_format(machine);
    for (const Layer& layer : raft.layers) {
      if (Status status = format->check(layer); !status) return status;
    }
    for (std::uint32_t i = plan_.range[0]; i < plan_.range[1]; ++i) {
      if (Status status = format->check(schedule_.layers[i].layer); !status) return status;
    }
    return {};
  }

  void end_indexing() {
    const Elapsed took = indexing_.elapsed();
    plan_.index_seconds = took.wall;
    plan_.index_processor_seconds = took.processor;
  }

  Status index_sections() {
    if (images() && !beads_) return {};
    Job cut = job();                           // job() stays as requested: its file means the same in another command
    if (images()) cut.slice = SliceRequest();  // of contours and toolpaths
    cut.slice.tolerance_um = tolerance_um_of(cut, plan_.product);
    auto sections = Sections::make(cut, *plan_.scene, std::move(schedule_), std::move(fillings_));
    if (!sections) return sections.error();
    plan_.sections = std::make_unique<Sections>(std::move(*sections));
    if (plan_.segments) {
      if (Status status = check_thin_intervals(*plan_.segments, *plan_.sections); !status) return status;
    }
    end_indexing();
    return {};
  }

  /// errors  kUsage: what doses of parts exclude, and edges that grow beyond the bed
  Status check_zones(const DoseZones& zones) {
    constexpr std::uint32_t kMaxZones = 100;
    if (zones.count() > kMaxZones) {
      return usage(
          "part.bleed_um, part.saturation_percent: the parts have {} different doses, at most {} are "
          "planned together; plan them as several jobs",
          zones.count(), kMaxZones);
    }
    if (zones.several() && job().fill_rule == FillRule::kEvenOdd && (materials_.several() || job().levels > 0)) {
      return usage(
          "--fill-rule: evenodd combines all parts, but parts have different doses and {}; "
          "choose nonzero",
          job().levels > 0 ? "grey levels" : "several materials");
    }
    if (!zones.bleeds().grows()) return {};
    if (materials_.several())
      return usage("dose.bleed_um: edges that grow have no material where there are several; plan them as several jobs");
    for (std::size_t i = 0; i < plan_.scene->instances.size(); ++i) {
      const std::uint32_t part = plan_.scene->part_of_instance[i];
      const Box box = box_of(*plan_.scene, plan_.scene->instances[i]);
      const auto [by_x, by_y] = zones.grows_nm(zones.of_part(part));
      const PixelGrid& grid = printer_.grid;
      const std::int64_t beyond =
          std::max({by_x - box.lo.x, box.hi.x + by_x - grid.x.length, by_y - box.lo.y, box.hi.y + by_y - grid.y.length});
      if (beyond <= 0) continue;
      return usage("dose.bleed_um: edges of {} grow {:.3f} mm beyond the bed; move it away from its edge",
                   one_line(plan_.scene->parts[part].path), mm(beyond));
    }
    return {};
  }

  Status index_images() {
    if (!images()) return {};
    const PixelGrid grid = printer_.grid;
    // The slicer refers to the scene's meshes, the rasterizer takes those it is given.
    std::optional<Scene> copy;
    if (beads_) copy.emplace(*plan_.scene);
    DosePlan dose(job(), grid);
    if (Status status = check_zones(dose.zones()); !status) return status;
    auto solids = Solids::build(copy ? *copy : *plan_.scene, job(), grid, materials_, dose.zones());
    if (!solids) return solids.error();
    std::optional<Beads> beads;
    if (beads_) beads.emplace(job(), grid, *plan_.sections, *plan_.segments);
    const auto layer = [this](std::uint32_t i) { return plan_.layer(i); };
    const std::uint32_t sweep_drops = printer_.machine ? printer_.machine->grid.sweep_drops : 1;
    if (Status status =
            dose.decide(job(), machine(), sweep_drops, *plan_.scene, plan_.layer_count, plan_.range, layer, plan_.warnings);
        !status)
      return status;
    if (Status status = dose.check_images(job().format); !status) return status;
    const bool geometry = has_images_of_geometry(job(), machine() != nullptr) && dose.changes_image() && job().format != "null";
    plan_.images.emplace(ImagePlan{std::move(printer_.machine), grid, std::move(materials_), std::move(*solids),
                                   std::move(dose), std::move(beads), geometry});
    end_indexing();
    return {};
  }

  /// What can be reported about the beads before any is deposited.
  Status foresee_beads() {
    if (plan_.product == Product::kContours && job().slice.format == "3mf" && plan_.sections->fills()) {
      plan_.warnings.push_back(
          {"not-written",
           "--format 3mf: slices of 3MF contain contours only, the filling is not in the file; choose svg or cli"});
    }
    if (!moves()) return {};
    warn_of_touching_lines();
    warn_of_segments(*plan_.segments, plan_.moves->profile, plan_.sections->fills(), plan_.warnings);
    return {};
  }

  /// Lines at gap 0 touch, but their round sides leave a void.
  void warn_of_touching_lines() {
    if (plan_.segments->any()) return;
    const auto& layers = plan_.sections->layers();  // the first one may have a thickness of its own
    const double height = mm(layers[std::min<std::size_t>(1, layers.size() - 1)].layer.thickness);
    double largest = 0.05;
    const auto consider = [&](const infill::FillParameters& fill) {
      const auto distance = infill::touching_distance(fill);
      if (!distance) return;
      const double area = bead_area(mm(fill.width), height, plan_.moves->profile.machine.material.shape());
      largest = std::max(largest, 1 - area / (*distance * 1e-6 * height));
    };
    for (const FillPlan& plan : plan_.sections->fillings()) {
      consider(plan.base);
      for (const FillPlan::FillInterval& range : plan.ranges) consider(range.parameters);
    }
    if (largest <= 0.05) return;
    plan_.warnings.push_back(
        {"voids", fmt::format("lines at gap 0 touch and leave {:.1f} % of their volume void, because their "
                              "sides are round; --density 100 has none",
                              100 * largest)});
  }

  const ProgressCallback& progress_;
  Plan plan_;
  PowderPrinter printer_;  // of images, until they are indexed
  Materials materials_;
  std::set<std::uint32_t> raised_;  // parts that are images, whose materials are counted from where they begin
  std::vector<FillPlan> fillings_;
  LayerSchedule schedule_;
  bool beads_ = false;  // fill the parts of an image
  bool streams_layers_ = false;
  Stopwatch indexing_;
};

}  // namespace

namespace {

/// G4 is for areas. A dithered image gets another format, unless the job names one. Content that is the default one anyway
/// makes the same job, stated or not.
Status choose_images(bool machine, Job& job) {
  const bool geometry = has_images_of_geometry(job, machine);
  if (job.image_content == ImageContent::kGeometry && !geometry) {
    return usage(
        "--images geometry: {}; use --images drops",
        machine
            ? "the drops do not follow from one 1-bit image a layer (several materials or doses, formulas, levels, a grey format)"
            : "without a machine no other file has the drops");
  }
  const bool dithers = job.dose.core < 1 || (job.dose.dithered && (job.levels > 0 || job.dose.saturation_percent));
  const bool named = std::ranges::find(job.named, "image.format") != job.named.end();
  if (job.format == Job().format && !named && dithers && !geometry) job.format = "tiff-deflate";
  const bool dosed = job.dose.core < 1 || job.dose.saturation_percent;
  const bool drops = dosed && job.image_content == ImageContent::kDrops;
  job.image_content = ImageContent::kAuto;
  if (drops && has_images_of_geometry(job, machine)) job.image_content = ImageContent::kDrops;
  return {};
}

/// errors  kUsage: a first layer of its own where layers differ, or lines are segmented
Status check_first_layer(const Job& job) {
  const ExtrudeRequest& request = job.extrude;
  const bool uniform = job.heights.mode == heights::Mode::kUniform && !job.heights.per_part;
  if (request.first_thickness_mm && !uniform)
    return usage("extrude.first_thickness_mm: applies to layers of one thickness; leave it out, or --heights and --per-part");
  if (request.brim_mm > 0 && job.heights.per_part)
    return usage(
        "extrude.brim_mm: with --per-part the first layers of parts are deposited one after the other; leave one of them out");
  if (request.first_bead_mm && job.segment.any())
    return usage("extrude.first_bead_mm: segmented lines have one width; leave it out");
  return {};
}

}  // namespace

Result<Resolved> resolve(const Job& job, Product product) {
  Resolved resolved{job, product, bare_bed(job), std::nullopt, std::nullopt};
  if (product == Product::kMoves) {
    if (Status status = check_first_layer(job); !status) return status.error();
  } else {
    resolved.job.extrude.first_thickness_mm.reset();
  }
  if (product == Product::kImages) {
    if (job.heights.per_part) {
      return usage("--per-part: a powder bed has one table of layers for all parts; leave it out");
    }
    auto printer = resolve_powder_printer(job);
    if (!printer) return printer.error();
    resolved.bed = printer->bed;
    resolved.printer = std::move(*printer);
    if (!formats::extension_of(job.format)) return usage("{}", formats::unknown_format(job.format));
    const bool dosed = job.levels > 0 || (resolved.printer->machine && job.dose.saturation_percent);
    if (formats::find_level_format(job.format) != nullptr && !dosed) {
      return usage(
          "--format {}: stores grey levels or drops per pixel, and the job has neither; add "
          "--levels 2, 4 or 16, or --machine and --saturation",
          job.format);
    }
    if (Status status = choose_images(resolved.printer->machine.has_value(), resolved.job); !status) return status.error();
    return resolved;
  }
  if (job.shard) return usage("run.shard: {}", kNoShards);
  if (product == Product::kContours) {
    const auto* format = formats::find_slice_format(job.slice.format);
    if (format == nullptr) return usage("unknown format '{}'", job.slice.format);
    if (!format->paths && fills(job)) {
      return usage("--format {}: contains contours only; leave out the filling, or choose svg", format->id);
    }
    if (job.slice.format == "3mf" && job.slice.file_a_layer) {
      return usage("--file-a-layer: a 3MF package contains all slices; choose svg or cli, or leave it out");
    }
    if (job.heights.per_part) {
      return usage("--per-part: a file of slices has one table of layers for all parts; leave it out");
    }
    return resolved;
  }
  auto profile = resolve_extruder(job);
  if (!profile) return profile.error();
  if (job.extrude.first_bead_mm && profile->machine.format == "sml")
    return usage("extrude.first_bead_mm: widths of SML follow from the nozzle; leave it out");
  if (Status status = check_raft(job, profile->machine); !status) return status.error();
  if (job.margin_mm) profile->machine.bed.margin_mm = *job.margin_mm;
  resolved.bed = {profile->machine.bed.size_mm, true, profile->machine.bed.margin_mm};
  resolved.extruder = std::move(*profile);
  if (job.leave_to_machine) {
    leave_to_machine(resolved.extruder->machine, resolved.job);
    if (Status status = check_job(resolved.job); !status) return status.error();
  }
  predict_calibration(resolved.job, *resolved.extruder);
  return resolved;
}

Result<Plan> make_plan(Resolved resolved, const ProgressCallback& progress) {
  return Planner(std::move(resolved), progress).make();
}

}  // namespace lamina::pipeline
