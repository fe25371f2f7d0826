#include "pipeline/report/image_observers.h"

#include <fmt/format.h>

#include <algorithm>
#include <string>
#include <string_view>

#include "pipeline/machine/materials.h"
#include "pipeline/report/image_text.h"
#include "pipeline/report/job_cost.h"
#include "pipeline/report/machine_text.h"
#include "pipeline/report/replay_text.h"
#include "stages/checks/layer_warnings.h"
#include "stages/dose/budget.h"
#include "stages/dose/shares.h"
#include "stages/geometry/blocks/mesh_blocks.h"
#include "stages/geometry/isa.h"
#include "stages/support/text/number_text.h"
#include "stages/support/text/readable.h"

namespace lamina::pipeline {
namespace {

/// Set pixels, their volume, and how fast they were made.
class PixelObserver : public ImageObserver {
 public:
  explicit PixelObserver(const Plan& plan) : plan_(plan) {}
  void layer(const LayerRecord& record, const ImageNotes*) override {
    const PixelGrid& grid = plan_.images->grid;
    set_pixels_ += record.set_pixels;
    const double pixel_mm2 = 25.4 * 25.4 / (grid.x.dpi() * grid.y.dpi());
    volume_mm3_ += static_cast<double>(record.filled_pixels()) * pixel_mm2 * mm(record.layer.thickness);
  }
  void report(Summary& summary) const override {
    const PixelGrid& grid = plan_.images->grid;
    const double seconds = summary.layer_seconds;
    const double pixels = static_cast<double>(grid.columns()) * grid.rows() * summary.layers_planned;
    const double pixels_a_second = seconds > 0 ? pixels / seconds : 0;
    const std::string_view isa = isa_name(*usable_isa(plan_.job.isa));
    summary.volume_mm3 = volume_mm3_;
    summary.results.emplace_back(
        "pixels", fmt::format("{} set, {:.3f} cm3 of binder-filled volume", readable_count(set_pixels_), volume_mm3_ / 1000));
    if (!summary.dry_run) {
      const double layers_a_second = seconds > 0 ? summary.layers_planned / seconds : 0;
      summary.end.emplace_back("rate",
                               fmt::format("{:.2f} Gpx/s, {:.1f} layers/s ({})", pixels_a_second / 1e9, layers_a_second, isa));
    }
    summary.facts["set_pixels"] = set_pixels_;
    summary.facts["pixels_per_second"] = pixels_a_second;
    summary.facts["isa"] = isa;
  }

 private:
  const Plan& plan_;
  std::uint64_t set_pixels_ = 0;
  double volume_mm3_ = 0;
};

/// Pieces that the bleed removes.
class VanishObserver : public ImageObserver {
 public:
  explicit VanishObserver(const Plan& plan) : plan_(plan) {}
  void layer(const LayerRecord& record, const ImageNotes* made) override {
    if (made != nullptr) count_.add(record.layer, made->vanished);
  }
  void warn(const Summary&, std::vector<Warning>& warnings) override {
    count_.report(plan_.images->grid, mirrors_x(plan_.job.mirror), mirrors_y(plan_.job.mirror), warnings);
  }

 private:
  const Plan& plan_;
  checks::VanishCount count_;
};

/// Pixels of blocked nozzles.
class NozzleObserver : public ImageObserver {
 public:
  explicit NozzleObserver(const Plan& plan) : plan_(plan) {}
  void layer(const LayerRecord& record, const ImageNotes*) override {
    moved_ += record.program.moved;
    lost_ += record.program.lost;
  }
  void warn(const Summary&, std::vector<Warning>& warnings) override { checks::warn_of_lost_pixels(lost_, warnings); }
  void report(Summary& summary) const override {
    if (moved_ > 0) {
      summary.end.emplace_back(
          "blocked", fmt::format("{} pixels of blocked nozzles are fired by their neighbours", readable_count(moved_)));
    }
    if (!plan_.images->machine) return;
    summary.facts["moved_pixels"] = moved_;
    summary.facts["lost_pixels"] = lost_;
  }

 private:
  const Plan& plan_;
  std::uint64_t moved_ = 0, lost_ = 0;
};

/// Full voxels of a job of grey levels.
class VoxelObserver : public ImageObserver {
 public:
  explicit VoxelObserver(const Plan& plan) : plan_(plan) {}
  void layer(const LayerRecord& record, const ImageNotes*) override {
    count_.add(record.dosed_pixels, record.half_differs, record.half_far);
  }
  void report(Summary& summary) const override {
    const bool drops = plan_.images->dose.saturates();
    const std::string_view as = !drops ? "grey" : plan_.job.dose.dithered ? "dithered drops" : "whole drops";
    summary.results.emplace_back("voxels", voxels_text(count_, plan_.job.levels, as));
    summary.facts["voxels"] = voxels_json(count_, plan_.job.levels, as);
  }

 private:
  const Plan& plan_;
  dose::ShareCount count_;
};

/// Pixels of parts that beads leave empty.
class PorosityObserver : public ImageObserver {
 public:
  void layer(const LayerRecord&, const ImageNotes* made) override {
    if (made == nullptr) return;
    solid_pixels_ += made->solid_pixels;
    bead_pixels_ += made->bead_pixels;
  }
  void report(Summary& summary) const override {
    if (solid_pixels_ == 0) return;
    const double porosity = 1 - static_cast<double>(bead_pixels_) / static_cast<double>(solid_pixels_);
    summary.results.emplace_back("porosity", fmt::format("{:.2f} % of the parts' {} pixels are left empty", 100 * porosity,
                                                         readable_count(solid_pixels_)));
    summary.facts["solid_pixels"] = solid_pixels_;
    summary.facts["bead_pixels"] = bead_pixels_;
    summary.facts["porosity"] = porosity;
  }

 private:
  std::uint64_t solid_pixels_ = 0, bead_pixels_ = 0;
};

/// Pixels and drops of each material, and those in the powder of another vat.
class MaterialObserver : public ImageObserver {
 public:
  explicit MaterialObserver(const Plan& plan) : plan_(plan) {
    for (const JobMaterial& material : plan.images->materials.used) {
      drops_.push_back({material.name});
      unfed_.push_back({material.name});
    }
  }
  void layer(const LayerRecord& record, const ImageNotes*) override {
    for (std::size_t m = 0; m < drops_.size(); ++m) {
      const ImageRecord& image = record.image_of(m, drops_.size());
      if (plan_.images->machine) unfed_[m].add(record.layer, image.unfed_pixels);
      drops_[m].add(image.set_pixels, record.drops_of(m, drops_.size()));
    }
  }
  void warn(const Summary&, std::vector<Warning>& warnings) override {
    for (const UnfedPowder& powder : unfed_) checks::warn_of_unfed(powder, warnings);
  }
  void report(Summary& summary) const override {
    const auto& budget = plan_.images->dose.budget();
    const double drop_pl = budget && plan_.images->dose.saturates() ? budget->binder().drop_pl : 0;
    for (std::size_t m = 0; m < drops_.size(); ++m) {
      summary.results.emplace_back("", powder_text(drops_[m], drop_pl));
      Json& fact = summary.facts["materials"].emplace_back(powder_json(drops_[m], drop_pl));
      if (!plan_.images->machine) continue;
      fact["unfed_pixels"] = unfed_[m].pixels;
      fact["unfed_layers"] = unfed_[m].layers;
    }
  }

 private:
  const Plan& plan_;
  std::vector<PowderDrops> drops_;
  std::vector<UnfedPowder> unfed_;
};

/// Binder of a job with a saturation.
class BinderObserver : public ImageObserver {
 public:
  explicit BinderObserver(const dose::Budget& budget) : budget_(budget) {}
  void layer(const LayerRecord& record, const ImageNotes*) override {
    count_.add(budget_, record.layer, record.dosed_pixels, record.drops, record.requested_drops, record.program.lost,
               record.max_drops);
  }
  void report(Summary& summary) const override {
    summary.results.emplace_back("binder", binder_text(budget_, count_));
    summary.facts["saturation"] = binder_json(budget_, count_);
  }

 private:
  const dose::Budget& budget_;
  dose::BinderCount count_;
};

/// Sweeps of a head that fires several drops of a pixel in one of them.
class SweepObserver : public ImageObserver {
 public:
  explicit SweepObserver(const Plan& plan) : plan_(plan) {}
  void layer(const LayerRecord& record, const ImageNotes*) override {
    added_ += record.program.added_sweeps;
    added_microseconds_ += record.program.added_microseconds;
  }
  void report(Summary& summary) const override {
    const HeadGrid& grid = plan_.images->machine->grid;
    const program::DropSweeps sweeps{std::max(1u, plan_.images->dose.max_drops()), added_,
                                     static_cast<double>(added_microseconds_) / 1e6};
    summary.results.emplace_back("sweeps", program::sweeps_text(plan_.images->machine->machine, grid, sweeps));
    summary.facts["jetting"] = {{"head_drops", grid.head_drops},   {"sweep_drops", grid.sweep_drops},
                                {"pixel_drops", sweeps.max_drops}, {"sweeps_per_position", grid.sweeps_for(sweeps.max_drops)},
                                {"added_sweeps", sweeps.added},    {"added_seconds", sweeps.added_seconds}};
  }

 private:
  const Plan& plan_;
  std::uint64_t added_ = 0;
  std::int64_t added_microseconds_ = 0;
};

/// Time of the machine, its pauses to fill vats, and what the job uses up and costs.
class PrintObserver : public ImageObserver {
 public:
  PrintObserver(const Plan& plan, const std::vector<std::uint32_t>& refills)
      : machine_(plan.images->machine->machine), refills_(refills), cost_(plan) {}
  void layer(const LayerRecord& record, const ImageNotes*) override {
    microseconds_ += record.program.microseconds;
    timed_ = timed_ && (record.program.bytes == 0 || record.program.microseconds > 0);
    cost_.add(record, record.program.drops + record.program.spat, record.program.microseconds);
  }
  void report(Summary& summary) const override {
    const double seconds = timed_ ? static_cast<double>(microseconds_) / 1e6 : 0;
    if (seconds > 0) summary.results.emplace_back("printing", replay::time_text(seconds, machine_.name));
    if (!refills_.empty()) summary.results.emplace_back("vats", refills_text(refills_));
    if (timed_) {
      cost_.report(summary);
      summary.facts["print_seconds"] = seconds;
    }
    summary.facts["refills"] = refills_;
  }

 private:
  const Machine& machine_;
  const std::vector<std::uint32_t>& refills_;
  JobCost cost_;
  std::int64_t microseconds_ = 0;
  bool timed_ = true;  // layers that an earlier build made are not
};

/// Rows that are closed only thanks to repair, or stay open.
class RowObserver : public ImageObserver {
 public:
  explicit RowObserver(const Plan& plan) : plan_(plan) {}
  void layer(const LayerRecord& record, const ImageNotes* made) override {
    if (made == nullptr) return;
    const raster::LayerReport& found = made->report;
    const PixelGrid& grid = plan_.images->grid;
    rows_.add_capped(record.layer, found.capped_rows, found.first_capped_row, found.first_capped_instance, grid);
    rows_.add_open(record.layer, found.open_rows, found.first_open_row, grid);
    capped_ += found.capped_rows;
    level_.add(record.layer, found.level);
  }
  void warn(const Summary&, std::vector<Warning>& warnings) override {
    const std::vector<std::uint32_t>& part = plan_.scene->part_of_instance;
    const auto name = [&](std::uint32_t instance) {
      return part.empty() ? std::string() : plan_.scene->parts[part[instance]].path;
    };
    rows_.report(name(rows_.first_capped()), warnings);
    level_.report(name(level_.owner()), warnings);
  }
  void report(Summary& summary) const override {
    if (capped_ > 0)
      summary.end.emplace_back("repaired", fmt::format("{} rows are closed only thanks to repair", readable_count(capped_)));
    summary.facts["capped_rows"] = capped_;
  }

 private:
  const Plan& plan_;
  checks::RowWarnings rows_;
  checks::LevelWarnings level_;
  std::uint64_t capped_ = 0;
};

/// Names of the facts of a powder job, in their order.
constexpr std::string_view kFacts[] = {"columns",           "rows",    "dpi",          "voxels",      "saturation",
                                       "jetting",           "use",     "inspection",   "set_pixels",  "capped_rows",
                                       "pixels_per_second", "isa",     "solid_pixels", "bead_pixels", "porosity",
                                       "print_seconds",     "refills", "moved_pixels", "lost_pixels", "materials",
                                       "images_of"};

/// What the pixels of layer images are; "geometry" too if each set pixel gets one drop.
std::string_view images_of(const Plan& plan) {
  const DosePlan& dose = plan.images->dose;
  if (plan.images->geometry) return "geometry";
  if (dose.changes_image()) return "drops";
  return plan.job.levels > 0 ? "levels" : "geometry";
}

}  // namespace

void observe_pixels(const Plan& plan, Observers<ImageNotes>& observers) { observers.add<PixelObserver>(plan); }

void observe_images(const Plan& plan, const std::vector<std::uint32_t>& refills, Observers<ImageNotes>& observers) {
  const ImagePlan& images = *plan.images;
  observers.add<VanishObserver>(plan);
  observers.add<NozzleObserver>(plan);
  if (plan.job.levels > 0) observers.add<VoxelObserver>(plan);
  observers.add<PorosityObserver>();
  if (images.materials.several()) observers.add<MaterialObserver>(plan);
  if (images.dose.budget()) observers.add<BinderObserver>(*images.dose.budget());
  if (images.machine && images.machine->grid.head_drops > 1) observers.add<SweepObserver>(plan);
  if (images.machine) observers.add<PrintObserver>(plan, refills);
  observers.add<RowObserver>(plan);
}

void report_image_plan(const Plan& plan, Summary& summary) {
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
  summary.facts["columns"] = grid.columns();
  summary.facts["rows"] = grid.rows();
  summary.facts["dpi"] = {grid.x.dpi(), grid.y.dpi()};
  if (plan.job.format != "null") summary.facts["images_of"] = images_of(plan);
}

void sort_image_facts(Summary& summary) {
  Json sorted = Json::object();
  for (const std::string_view name : kFacts) {
    if (const Json* fact = summary.facts.find(name)) sorted[name] = *fact;
  }
  sorted.update(summary.facts);
  summary.facts = std::move(sorted);
}

}  // namespace lamina::pipeline
