#include "pipeline/run/image_maker.h"

#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <numeric>

#include "pipeline/machine/materials.h"
#include "pipeline/run/inspector.h"
#include "pipeline/run/job_cost.h"
#include "pipeline/run/powders.h"
#include "stages/cost/powder_drops.h"
#include "stages/data/text/number_text.h"
#include "stages/data/text/readable.h"
#include "stages/dose/share_count.h"
#include "stages/geometry/isa.h"
#include "stages/program/explain.h"
#include "stages/program/vats.h"
#include "stages/replay/time/totals.h"
#include "stages/sanity/records.h"
#include "stages/sanity/rows.h"

namespace lamina::pipeline {
namespace {

class ImageMaker : public Maker {
 public:
  ImageMaker(const Plan& plan, Sanity& sanity, const FlowLimits& limits)
      : plan_(plan),
        sanity_(sanity),
        imager_(plan),
        inspector_(plan),
        files_(plan),
        work_(limits.max_in_flight),
        made_(limits.record_slots) {
    if (plan.images->machine) cost_.emplace(plan);
    for (const JobMaterial& material : plan.images->materials.used) {
      materials_.push_back({material.name});
      unfed_.push_back({material.name});
    }
  }

  std::uint64_t bytes_of(std::uint32_t layer) const override {
    // What is to be dosed is told before the dose, unless no layer is made.
    return bytes_of(plan_.layer(layer), plan_.job.dry_run && !times_dry_runs() ? LayerImager::kUnknown : 0);
  }

  Result<std::vector<std::uint32_t>> open() override {
    if (Status status = refuse_mixed_powders(plan_, imager_); !status) return status.error();
    if (Status status = refuse_faulty_formulas(plan_, imager_); !status) return status.error();
    auto refills = plan_refills(plan_, imager_);
    if (!refills) return refills.error();
    files_.pause_before(refills_ = std::move(*refills));
    if (plan_.job.dry_run) {
      std::vector<std::uint32_t> all(plan_.range[1] - plan_.range[0]);
      std::iota(all.begin(), all.end(), plan_.range[0]);
      return all;
    }
    if (Status status = inspector_.check_file(); !status) return status.error();
    if (Status status = files_.open(); !status) return status.error();
    return files_.take_todo();
  }
  std::vector<LayerRecord> kept() const override { return files_.kept(); }

  std::vector<MakerStep> steps() override {
    std::vector<MakerStep> steps;
    const auto add = [&](std::string_view name, auto step) {
      steps.push_back({name, [this, step](std::uint32_t layer, const Ticket& ticket) {
                         return step(plan_.layer(layer), work_[ticket.work], made_[ticket.record]);
                       }});
    };
    add("raster", [this](const Layer& layer, Work& work, Made& made) {
      made = {};
      made.record.layer = layer;
      const Status status = imager_.raster(layer, work.images, made.record, made.notes);
      if (status) sanity_.add_image(layer, work.images.runs);
      return status;
    });
    if (plan_.job.levels > 0) {
      add("shares", [this](const Layer& layer, Work& work, Made& made) {
        imager_.shares(layer, work.images, made.record);
        return Status();
      });
    }
    if (!plan_.scene->images.empty()) {
      add("images", [this](const Layer& layer, Work& work, Made& made) {
        if (cost_) cost_->weigh(layer, work.images, made.notes);
        return imager_.images(layer, work.images, made.notes);
      });
    }
    if (plan_.images->beads) {
      add("contours", [this](const Layer& layer, Work& work, Made&) { return imager_.contours(layer, work.images); });
      add("fill", [this](const Layer& layer, Work& work, Made&) { return imager_.fill(layer, work.images); });
      add("beads",
          [this](const Layer& layer, Work& work, Made& made) { return imager_.beads(layer, work.images, made.notes); });
    }
    if (inspector_.on()) {
      add("inspect", [this](const Layer&, Work& work, Made&) {
        inspector_.looks().look(work.images.runs, work.look);
        return Status();
      });
      steps.back().needs = [this](std::uint32_t, const Ticket& ticket) -> Result<std::uint64_t> {
        return inspector_.looks().look_needs(work_[ticket.work].images.runs);
      };
    }
    const auto dose_needs = [this](std::uint32_t layer, const Ticket& ticket) -> Result<std::uint64_t> {
      const ImageWork& work = work_[ticket.work].images;
      const Layer of = plan_.layer(layer);
      return bytes_of(of, plan_.images->dose.parted_pixels(work.runs, work.drops)) - bytes_of(of, 0) +
             work_[ticket.work].look.bytes();
    };
    add("dose", [this](const Layer& layer, Work& work, Made& made) {
      if (Status status = imager_.bleed(layer, work.images, made.notes); !status) return status;
      // What walls and fillings left out is no bleed.
      if (plan_.images->dose.bleeds() && !plan_.images->beads) sanity_.add_left(layer, work.images.runs);
      if (Status status = imager_.dose(layer, work.images, made.record); !status) return status;
      if (cost_) cost_->count(work.images, made.notes, made.record);
      return Status();
    });
    if (plan_.images->dose.parts_pixels()) steps.back().needs = dose_needs;
    if (plan_.job.dry_run) {
      add("program",
          [this](const Layer&, Work& work, Made& made) { return files_.program(images_of(work), work.files, made.record); });
      return steps;
    }
    add("encode",
        [this](const Layer&, Work& work, Made& made) { return files_.encode(images_of(work), work.files, made.record); });
    add("store",
        [this](const Layer&, Work& work, Made& made) { return files_.store(images_of(work), work.files, made.record); });
    return steps;
  }
  bool records_from_work() const override { return inspector_.on(); }

  Status record(std::uint32_t, const Ticket& ticket) override {
    const Made& made = made_[ticket.record];
    if (!plan_.job.dry_run) {
      if (Status status = files_.record(made.record); !status) return status;
    }
    add(made.record);
    sanity_.record(made.record.layer.index, made.record.set_pixels > 0);
    if (inspector_.on()) inspector_.record(made.record.layer, work_[ticket.work].look);
    vanished_.add(made.record.layer, made.notes.vanished);
    const raster::LayerReport& report = made.notes.report;
    rows_.add_capped(made.record.layer, report.capped_rows, report.first_capped_row, report.first_capped_instance,
                     plan_.images->grid);
    rows_.add_open(made.record.layer, report.open_rows, report.first_open_row, plan_.images->grid);
    crossings_ += report.crossings;
    capped_rows_ += made.notes.report.capped_rows;
    solid_pixels_ += made.notes.solid_pixels;
    bead_pixels_ += made.notes.bead_pixels;
    bytes_written_ += made.record.bytes + made.record.program.bytes;
    return {};
  }
  void add_kept(const LayerRecord& record) override {
    add(record);
    inspector_.keep();
    sanity_.keep(record.layer.index, record.set_pixels > 0);
  }

  std::uint64_t bytes_held(std::uint32_t work) const override {
    return work_[work].images.bytes() + work_[work].files.bytes() + work_[work].look.bytes();
  }
  std::uint64_t bytes_beside() const override { return inspector_.bytes(); }
  void let_go(std::uint32_t work) override { work_[work] = Work(); }

  std::uint64_t crossings() const override { return crossings_; }
  bool times_dry_runs() const override { return plan_.images->machine.has_value() || inspector_.on(); }
  bool keeps() const override { return !plan_.job.dry_run; }
  Status finish() override {
    if (plan_.job.dry_run) return {};
    const Status status = files_.finish();
    return status ? inspector_.write(files_.head()) : status;
  }
  Status stop(bool keep) override {
    if (!plan_.job.dry_run && keep) return files_.keep();
    discard();
    return {};
  }
  void discard() override {
    if (!plan_.job.dry_run) files_.discard();
  }

  void warn(const Summary&, std::vector<Warning>& warnings) const override;
  void tell(Summary& summary) const override;
  void tell_binder(const dose::Budget& budget, Summary& summary) const;
  void tell_jetting(const ResolvedMachine& resolved, Summary& summary) const;

 private:
  struct Work {
    ImageWork images;
    ImageFiles::Work files;
    inspect::LayerLook look;
  };
  struct Made {
    LayerRecord record;
    ImageNotes notes;
  };

  std::uint64_t bytes_of(const Layer& layer, std::uint64_t pixels) const {
    return imager_.bytes_of(layer, pixels) + files_.bytes_bound(imager_.drops_bound(layer, pixels));
  }
  LayerImages images_of(const Work& work) const {
    const ImageWork& images = work.images;
    return {images.runs, images.drops.planes, imager_.several(images), imager_.levels(images)};
  }

  /// Counts what lies in the powder of another vat.
  void add_unfed(const LayerRecord& record) {
    for (std::size_t m = 0; m < unfed_.size(); ++m) unfed_[m].add(record.layer, record.image_of(m, unfed_.size()).unfed_pixels);
  }

  void add(const LayerRecord& record) {
    if (plan_.images->machine && plan_.images->materials.several()) add_unfed(record);
    if (const auto& budget = plan_.images->dose.budget()) {
      binder_.add(*budget, record.layer, record.dosed_pixels, record.drops, record.asked_drops, record.program.lost,
                  record.most_drops);
    }
    if (plan_.job.levels > 0) shares_.add(record.dosed_pixels, record.half_differs, record.half_far);
    if (cost_) cost_->add(record, record.program.drops + record.program.spat, record.program.microseconds);
    const PixelGrid& grid = plan_.images->grid;
    set_pixels_ += record.set_pixels;
    moved_pixels_ += record.program.moved;
    lost_pixels_ += record.program.lost;
    microseconds_ += record.program.microseconds;
    added_sweeps_ += record.program.added_sweeps;
    added_microseconds_ += record.program.added_microseconds;
    timed_ = timed_ && (record.program.bytes == 0 || record.program.microseconds > 0);
    const std::size_t materials = plan_.images->materials.several() ? materials_.size() : 0;
    for (std::size_t m = 0; m < materials; ++m)
      materials_[m].add(record.image_of(m, materials).set_pixels, record.drops_of(m, materials));
    const double pixel_mm2 = 25.4 * 25.4 / (grid.x.dpi() * grid.y.dpi());
    volume_mm3_ += static_cast<double>(record.filled_pixels()) * pixel_mm2 * mm(record.layer.thickness);
  }

  const Plan& plan_;
  Sanity& sanity_;
  LayerImager imager_;
  mutable Inspector inspector_;
  ImageFiles files_;
  std::vector<Work> work_;
  std::vector<Made> made_;
  std::optional<JobCost> cost_;  // of a job with a machine

  sanity::RowWarnings rows_;
  inspect::VanishCount vanished_;
  std::uint64_t set_pixels_ = 0, moved_pixels_ = 0, lost_pixels_ = 0, solid_pixels_ = 0, bead_pixels_ = 0, capped_rows_ = 0;
  std::uint64_t bytes_written_ = 0, crossings_ = 0;
  std::int64_t microseconds_ = 0, added_microseconds_ = 0;  // of the machine
  std::uint64_t added_sweeps_ = 0;
  bool timed_ = true;  // layers that an earlier build left are not
  double volume_mm3_ = 0;
  std::vector<std::uint32_t> refills_;  // layers before which vats are filled
  dose::BinderCount binder_;
  dose::ShareCount shares_;
  std::vector<cost::PowderDrops> materials_;
  std::vector<UnfedPowder> unfed_;  // by material
};

void ImageMaker::warn(const Summary&, std::vector<Warning>& warnings) const {
  inspector_.warn(warnings);
  vanished_.tell(plan_.images->grid, mirrors_x(plan_.job.mirror), mirrors_y(plan_.job.mirror), warnings);
  sanity::warn_of_lost_pixels(lost_pixels_, warnings);
  for (const UnfedPowder& powder : unfed_) sanity::warn_of_unfed(powder, warnings);
  const std::vector<std::uint32_t>& part = plan_.scene->part_of_instance;
  rows_.tell(part.empty() ? std::string() : plan_.scene->parts[part[rows_.first_capped()]].path, warnings);
}

void ImageMaker::tell_binder(const dose::Budget& budget, Summary& summary) const {
  summary.results.emplace_back("binder", dose::told(budget, binder_));
  nlohmann::ordered_json& facts = (*summary.facts)["saturation"];
  facts["asked"] = budget.has_wish();
  if (!budget.has_wish()) {
    facts["least_percent"] = budget.gets().first;
    facts["most_percent"] = budget.gets().second;
    return;
  }
  facts["asked_percent"] = binder_.asked_percent(budget);
  facts["reached_percent"] = binder_.reached_percent(budget);
  facts["drops"] = binder_.drops();
  facts["most_drops"] = budget.most_drops();
  facts["most_jetted_drops"] = binder_.most_drops();
  facts["binder_ml"] = binder_.binder_ml(budget);
}

// Of a head that fires several drops of a pixel in one sweep.
void ImageMaker::tell_jetting(const ResolvedMachine& resolved, Summary& summary) const {
  const HeadGrid& grid = resolved.grid;
  if (grid.head_drops < 2) return;
  const program::DropSweeps sweeps{std::max(1u, plan_.images->dose.most_drops()), added_sweeps_,
                                   static_cast<double>(added_microseconds_) * 1e-6};
  summary.results.emplace_back("sweeps", program::sweeps_text(resolved.machine, grid, sweeps));
  (*summary.facts)["jetting"] = {{"head_drops", grid.head_drops},    {"sweep_drops", grid.sweep_drops},
                                 {"pixel_drops", sweeps.most_drops}, {"sweeps_a_place", grid.sweeps_for(sweeps.most_drops)},
                                 {"added_sweeps", sweeps.added},     {"added_seconds", sweeps.added_seconds}};
}

void ImageMaker::tell(Summary& summary) const {
  const PixelGrid& grid = plan_.images->grid;
  const double porosity = 1 - static_cast<double>(bead_pixels_) / static_cast<double>(solid_pixels_);
  const double pixels = static_cast<double>(grid.columns()) * grid.rows() * summary.layers_planned;
  const double pixels_a_second = summary.layer_seconds > 0 ? pixels / summary.layer_seconds : 0;
  const bool several = plan_.images->materials.several();
  const auto& budget = plan_.images->dose.budget();
  const double drop_pl = budget && plan_.images->dose.saturates() ? budget->binder().drop_pl : 0;
  const std::string_view isa = isa_name(*usable_isa(plan_.job.isa));
  const double print_seconds = timed_ ? static_cast<double>(microseconds_) * 1e-6 : 0;
  summary.bytes_written = bytes_written_;
  summary.volume_mm3 = volume_mm3_;

  const auto result = [&](std::string_view name, std::string text) { summary.results.emplace_back(name, std::move(text)); };
  const auto end = [&](std::string_view name, std::string text) { summary.end.emplace_back(name, std::move(text)); };
  result("pixels", fmt::format("{} set, {:.3f} cm3 of binder-filled volume", readable_count(set_pixels_), volume_mm3_ / 1000));
  if (const std::uint32_t levels = plan_.job.levels; levels > 0) {
    const bool drops = plan_.images->dose.saturates();
    const std::string_view as = !drops ? "grey" : plan_.job.dose.dithered ? "dithered drops" : "whole drops";
    result("voxels", shares_.told(levels, as));
    (*summary.facts)["voxels"] = shares_.json(levels, as);
  }
  if (solid_pixels_ > 0) {
    result("porosity",
           fmt::format("{:.2f} % of the parts' {} pixels are left empty", 100 * porosity, readable_count(solid_pixels_)));
  }
  if (several) {
    for (const cost::PowderDrops& powder : materials_) result("", powder.told(drop_pl));
  }
  if (budget) tell_binder(*budget, summary);
  if (const auto& machine = plan_.images->machine) tell_jetting(*machine, summary);
  if (print_seconds > 0) result("printing", replay::time_text(print_seconds, plan_.images->machine->machine.name));
  if (!refills_.empty()) result("vats", program::refills_text(refills_));
  if (timed_ && cost_) cost_->account().tell(summary.results, (*summary.facts)["use"], summary.quote);
  if (!summary.dry_run) {
    end("rate", fmt::format("{:.2f} Gpx/s, {:.1f} layers/s ({})", pixels_a_second / 1e9,
                            summary.layer_seconds > 0 ? summary.layers_planned / summary.layer_seconds : 0, isa));
  }
  if (moved_pixels_ > 0)
    end("blocked", fmt::format("{} pixels of blocked nozzles are fired by their neighbours", readable_count(moved_pixels_)));
  if (capped_rows_ > 0) end("repaired", fmt::format("{} rows are closed only thanks to repair", readable_count(capped_rows_)));

  inspector_.tell(summary);
  nlohmann::ordered_json& facts = *summary.facts;
  facts["set_pixels"] = set_pixels_;
  facts["capped_rows"] = capped_rows_;
  facts["pixels_per_second"] = pixels_a_second;
  facts["isa"] = isa;
  if (solid_pixels_ > 0) {
    facts["solid_pixels"] = solid_pixels_;
    facts["bead_pixels"] = bead_pixels_;
    facts["porosity"] = porosity;
  }
  if (plan_.images->machine) {
    if (timed_) facts["print_seconds"] = print_seconds;
    facts["refills"] = refills_;
    facts["moved_pixels"] = moved_pixels_;
    facts["lost_pixels"] = lost_pixels_;
  }
  if (!several) return;
  for (std::size_t m = 0; m < materials_.size(); ++m) {
    nlohmann::ordered_json& fact = facts["materials"].emplace_back(materials_[m].json(drop_pl));
    if (!plan_.images->machine) continue;
    fact["unfed_pixels"] = unfed_[m].pixels;
    fact["unfed_layers"] = unfed_[m].layers;
  }
}

}  // namespace

void tell_images(const Plan& plan, Summary& summary) {
  const PixelGrid& grid = plan.images->grid;
  summary.output = plan.job.output;
  summary.format = plan.job.format;
  if (plan.images->machine) summary.machine = plan.images->machine->machine.name;
  summary.mesh_bytes = plan.images->solids.mesh_bytes();
  summary.index_bytes = plan.images->solids.index_bytes();
  if (plan.sections) {
    for (const Mesh& mesh : plan.scene->meshes) summary.mesh_bytes += mesh.triangles.size() * sizeof(Triangle);
    summary.index_bytes += plan.sections->slicer().index_bytes();
  }
  summary.head.emplace_back(
      "image", fmt::format("{} x {} pixels of {:g} x {:g} dpi on {} x {} mm, {}", grid.columns(), grid.rows(), grid.x.dpi(),
                           grid.y.dpi(), number_text(plan.bed.size_mm[0]), number_text(plan.bed.size_mm[1]), plan.job.format));
  nlohmann::ordered_json& facts = *summary.facts;
  facts["columns"] = grid.columns();
  facts["rows"] = grid.rows();
  facts["dpi"] = {grid.x.dpi(), grid.y.dpi()};
}

std::unique_ptr<Maker> make_image_maker(const Plan& plan, Sanity& sanity, const FlowLimits& limits) {
  return std::make_unique<ImageMaker>(plan, sanity, limits);
}

}  // namespace lamina::pipeline
