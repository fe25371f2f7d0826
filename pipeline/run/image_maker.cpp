#include "pipeline/run/image_maker.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <optional>
#include <vector>

#include "pipeline/manifest/manifest.h"
#include "pipeline/report/image_observers.h"
#include "pipeline/report/job_cost.h"
#include "pipeline/run/inspector.h"
#include "pipeline/run/layer_imager.h"
#include "pipeline/run/powders.h"
#include "stages/cost/part_pixels.h"
#include "stages/slice/bodies.h"

namespace lamina::pipeline {
namespace {

/// Counts nothing unless costs of parts are reported one by one (reported_parts). Usable from many threads at once.
class PartCounter {
 public:
  /// The plan has a machine and must outlive this object.
  explicit PartCounter(const Plan& plan);

  /// Of a job with parts that are images, before these are added to its meshes: the pixels that each mesh sets.
  void weigh(const Layer& layer, const ImageWork& work, ImageNotes& notes) const;
  /// Counts the pixels of each part in a layer, and its drops where a saturation decides them. Next to images they are
  /// divided in proportion to what each part sets by itself: exact where no pixel is of two parts.
  void count(const ImageWork& work, const ImageNotes& notes, LayerRecord& record) const;

 private:
  void share_out(const ImageWork& work, const std::vector<std::uint64_t>& weights, LayerRecord& record) const;

  const Plan& plan_;
  std::optional<cost::PartPixels> windows_;
  bool saturates_ = false;  // drops are decided
  std::uint8_t full_ = 0;   // level of a full voxel; 0: pixels are set or not
};

PartCounter::PartCounter(const Plan& plan) : plan_(plan) {
  const std::size_t parts = reported_parts(plan);
  if (parts < 2) return;
  saturates_ = plan.images->dose.saturates();
  full_ = plan.images->dose.full();
  const std::vector<checks::Solid> solids = solids_from_above(*plan.scene);
  std::vector<Box> boxes;
  for (const checks::Solid& solid : solids) {
    Box box = full_ > 0 ? cost::box_of_voxels(solid.box, plan.images->grid) : solid.box;
    const auto [by_x, by_y] = plan.images->dose.zones().grows_nm(plan.images->dose.zones().of_part(solid.part));
    box.lo.x -= static_cast<Nm>(by_x), box.hi.x += static_cast<Nm>(by_x);
    box.lo.y -= static_cast<Nm>(by_y), box.hi.y += static_cast<Nm>(by_y);
    boxes.push_back(box);
  }
  const std::vector<std::uint32_t> group = slice::group_from_above(boxes);  // anew, for boxes have grown
  std::vector<cost::Body> bodies;
  for (std::size_t i = 0; i < solids.size(); ++i) bodies.push_back({boxes[i], solids[i].part, group[i]});
  const Mirror mirror = plan.job.mirror;
  // Pixels set by images belong to no window: with images, windows are of the meshes alone, before anything is mirrored.
  const bool mirrored = mirror != Mirror::kNone && plan.scene->images.empty();
  windows_.emplace(bodies, parts, plan.images->grid, mirrored && mirror != Mirror::kY, mirrored && mirror != Mirror::kX);
}

void PartCounter::weigh(const Layer& layer, const ImageWork& work, ImageNotes& notes) const {
  if (!windows_) return;
  notes.part_pixels = full_ > 0 ? windows_->sum(layer, work.drops.shares) : windows_->count(layer, work.runs);
}

void PartCounter::count(const ImageWork& work, const ImageNotes& notes, LayerRecord& record) const {
  if (!windows_) return;
  if (!plan_.scene->images.empty()) return share_out(work, notes.part_pixels, record);
  const dose::DropWork& drops = work.drops;
  if (full_ > 0) {
    const Levels& voxels = saturates_ ? drops.zones : drops.shares;
    record.part_pixels = windows_->share(record.layer, voxels, full_, record.dosed_pixels);
  } else if (drops.dosed() && !saturates_) {
    record.part_pixels = windows_->drops(record.layer, drops.drops[0], drops.counter);
  } else {
    record.part_pixels = saturates_ ? windows_->count(record.layer, drops.zones) : windows_->count(record.layer, work.runs);
  }
  if (saturates_) record.part_drops = windows_->drops(record.layer, drops.drops[0], drops.counter);
}

void PartCounter::share_out(const ImageWork& work, const std::vector<std::uint64_t>& weights, LayerRecord& record) const {
  const auto shared = [](std::uint64_t all, const std::vector<std::uint64_t>& by) {
    const auto whole = cost::shares(static_cast<std::int64_t>(all), by);
    return std::vector<std::uint64_t>(whole.begin(), whole.end());
  };
  record.part_pixels = shared(record.filled_pixels(), weights);
  const DoseZones& zones = plan_.images->dose.zones();
  if (!saturates_ || !zones.several()) return;  // drops are as pixels
  record.part_drops.assign(weights.size(), 0);
  std::vector<std::uint64_t> drops(zones.count(), 0);  // those of shared voxels count for all of theirs
  Levels of_pixels;
  const auto drops_in = [&](const Runs& pixels) {
    const DropImageView& all = work.drops.drops[0];
    dose::within(all.zones, pixels, of_pixels);
    return DropTotals({of_pixels, all.patterns}, work.drops.counter).drops();
  };
  for (std::uint32_t zone = 0; full_ == 0 && zone < zones.count(); ++zone) drops[zone] = drops_in(work.zones.image[zone]);
  for (std::size_t i = 0; full_ > 0 && i < work.drops.deposited.size(); ++i) {
    Runs voxels;
    threshold_levels(work.drops.deposited[i].shares, 1, voxels);
    drops[work.drops.deposited[i].zone] += drops_in(voxels);
  }
  drops = shared(record.drops, drops);
  for (std::uint32_t zone = 0; zone < zones.count(); ++zone) {
    std::vector<std::uint64_t> within(weights.size(), 0);
    for (std::uint32_t part = 0; part < weights.size(); ++part) {
      if (zones.of_part(part) == zone) within[part] = weights[part];
    }
    if (drops[zone] == 0) continue;
    const std::vector<std::uint64_t> own = shared(drops[zone], within);
    for (std::size_t part = 0; part < own.size(); ++part) record.part_drops[part] += own[part];
  }
}

class ImageMaker : public Maker {
 public:
  ImageMaker(const Plan& plan, JobChecks& checks, const FlowLimits& limits)
      : plan_(plan),
        checks_(checks),
        imager_(plan, true),
        files_(plan),
        work_(limits.max_in_flight),
        made_(limits.record_slots) {
    if (plan.images->machine) parts_.emplace(plan);
    observe_pixels(plan, observers_);
    inspector_ = &observers_.add<Inspector>(plan);
    observe_images(plan, refills_, observers_);
  }

  std::uint64_t bytes_of(std::uint32_t layer) const override {
    // What is to be dosed is reported before the dose, unless no layer is made.
    return bytes_of(plan_.layer(layer), plan_.job.dry_run && !times_dry_runs() ? LayerImager::kUnknown : 0);
  }

  Result<std::vector<std::uint32_t>> open() override {
    if (Status status = refuse_mixed_powders(plan_, imager_); !status) return status.error();
    if (Status status = refuse_faulty_formulas(plan_, imager_); !status) return status.error();
    auto refills = plan_refills(plan_, imager_);
    if (!refills) return refills.error();
    files_.pause_before(refills_ = std::move(*refills));
    std::vector<std::uint32_t> all(plan_.range[1] - plan_.range[0]);
    std::iota(all.begin(), all.end(), plan_.range[0]);
    if (plan_.job.dry_run) return all;
    const bool has_directory = !files_.is_one_file();
    if (Status status = has_directory ? inspector_->check_file() : Status(); !status) return status.error();
    if (Status status = files_.open(); !status) return status.error();
    if (Status status = has_directory ? inspector_->open(files_.head()) : Status(); !status) return status.error();
    if (!inspector_->on()) return files_.take_todo();
    // An inspection needs all layers: the sections of kept ones are made again, without their files.
    is_kept_.assign(all.size(), 0);
    for (const LayerRecord& record : files_.kept()) is_kept_[record.layer.index - plan_.range[0]] = 1;
    return all;
  }
  Status start() override { return files_.start(); }
  std::vector<LayerRecord> kept() const override { return files_.kept(); }

  std::vector<MakerStep> steps() override {
    std::vector<MakerStep> steps;
    bool of_kept = true;
    const auto add = [&](std::string_view name, auto step) {
      steps.push_back({name, [this, step, of_kept](std::uint32_t layer, const Ticket& ticket) {
                         if (!of_kept && is_kept(layer)) return Status();
                         return step(plan_.layer(layer), work_[ticket.work], made_[ticket.record]);
                       }});
    };
    add("raster", [this](const Layer& layer, Work& work, Made& made) {
      made = {};
      made.record.layer = layer;
      const Status status = imager_.raster(layer, work.images, made.record, made.notes);
      if (status) checks_.add_image(layer, work.images.runs);
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
        if (parts_) parts_->weigh(layer, work.images, made.notes);
        return imager_.images(layer, work.images, made.notes);
      });
    }
    if (plan_.images->beads) {
      add("contours", [this](const Layer& layer, Work& work, Made&) { return imager_.contours(layer, work.images); });
      add("fill", [this](const Layer& layer, Work& work, Made&) { return imager_.fill(layer, work.images); });
      add("beads",
          [this](const Layer& layer, Work& work, Made& made) { return imager_.beads(layer, work.images, made.notes); });
    }
    if (inspector_->on()) {
      add("inspect", [this, samples = imager_.samples()](const Layer& layer, Work& work, Made&) {
        inspector_->prepare(work.images.runs, work.inspected);
        for (std::uint32_t i = 0; samples && i < LayerImager::kSamples; ++i) {
          imager_.sample(layer, i, work.images);
          inspector_->add_sample(work.images.second, work.inspected);
        }
        inspector_->end(work.inspected);
        return Status();
      });
      steps.back().needs = [this](std::uint32_t, const Ticket& ticket) -> Result<std::uint64_t> {
        return inspector_->bytes_needed(work_[ticket.work].images.runs);
      };
    }
    of_kept = false;
    const auto dose_needs = [this](std::uint32_t layer, const Ticket& ticket) -> Result<std::uint64_t> {
      const ImageWork& work = work_[ticket.work].images;
      const Layer of = plan_.layer(layer);
      return bytes_of(of, plan_.images->dose.parted_pixels(work.runs, work.drops)) - bytes_of(of, 0) +
             work_[ticket.work].inspected.bytes();
    };
    add("dose", [this](const Layer& layer, Work& work, Made& made) {
      if (Status status = imager_.bleed(layer, work.images, made.notes); !status) return status;
      // What walls and fillings left out is no bleed.
      if (plan_.images->dose.bleeds() && !plan_.images->beads) checks_.add_left(layer, work.images.runs);
      if (Status status = imager_.dose(layer, work.images, made.record); !status) return status;
      if (parts_) parts_->count(work.images, made.notes, made.record);
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
    add(kStoreStep,
        [this](const Layer&, Work& work, Made& made) { return files_.store(images_of(work), work.files, made.record); });
    return steps;
  }
  bool records_from_work() const override { return inspector_->on() || files_.records_from_work(); }

  Status record(std::uint32_t layer, const Ticket& ticket) override {
    const Made& made = made_[ticket.record];
    if (inspector_->on()) {
      if (Status status = inspector_->record(made.record.layer, work_[ticket.work].inspected); !status) return status;
    }
    if (is_kept(layer)) return {};
    if (!plan_.job.dry_run) {
      if (Status status = files_.record(made.record, work_[ticket.work].files); !status) return status;
    }
    observers_.layer(made.record, &made.notes);
    checks_.record(made.record.layer.index, made.record.set_pixels > 0);
    crossings_ += made.notes.report.crossings;
    bytes_written_ += made.record.bytes + made.record.program.stored;
    return {};
  }
  void add_kept(const LayerRecord& record) override {
    observers_.layer(record, nullptr);
    checks_.keep(record.layer.index, record.set_pixels > 0);
  }

  std::uint64_t bytes_held(std::uint32_t work) const override {
    return work_[work].images.bytes() + work_[work].files.bytes() + work_[work].inspected.bytes();
  }
  std::uint64_t extra_bytes() const override { return inspector_->bytes(); }
  void let_go(std::uint32_t work) override { work_[work] = Work(); }

  std::uint64_t crossings() const override { return crossings_; }
  bool times_dry_runs() const override { return plan_.images->machine.has_value() || inspector_->on(); }
  bool keeps() const override { return files_.started(); }
  Status finish() override {
    if (plan_.job.dry_run) return {};
    if (Status status = inspector_->finish(); !status) return status;
    if (files_.is_one_file() && inspector_->on()) files_.set_inspection(inspector_->text(files_.head()));
    const Status status = files_.finish();
    return status && !files_.is_one_file() ? inspector_->write(files_.head()) : status;
  }
  Status stop(bool keep) override {
    if (!plan_.job.dry_run && keep) return files_.keep();
    discard();
    return {};
  }
  void discard() override {
    if (!plan_.job.dry_run) files_.discard();
  }

  void warn(const Summary& summary, std::vector<Warning>& warnings) const override { observers_.warn(summary, warnings); }
  void report(Summary& summary) const override {
    summary.bytes_written = bytes_written_;
    observers_.report(summary);
    sort_image_facts(summary);
  }

 private:
  struct Work {
    ImageWork images;
    ImageFiles::FileWork files;
    Inspector::SectionWork inspected;
  };
  struct Made {
    LayerRecord record;
    ImageNotes notes;
  };

  bool is_kept(std::uint32_t layer) const { return !is_kept_.empty() && is_kept_[layer - plan_.range[0]] != 0; }
  std::uint64_t bytes_of(const Layer& layer, std::uint64_t pixels) const {
    return imager_.bytes_of(layer, pixels) + files_.bytes_bound(imager_.drops_bound(layer, pixels), imager_.edges_bound(layer));
  }
  LayerImages images_of(const Work& work) const {
    const ImageWork& images = work.images;
    return {images.runs, images.materials.image, images.drops.drops, images.drops.shares,
            images.bits ? &*images.bits : nullptr};
  }

  const Plan& plan_;
  JobChecks& checks_;
  LayerImager imager_;
  ImageFiles files_;
  std::vector<Work> work_;
  std::vector<Made> made_;
  std::vector<std::uint8_t> is_kept_;   // by layer of the range
  std::optional<PartCounter> parts_;    // of a job with a machine
  std::vector<std::uint32_t> refills_;  // layers before which vats are filled
  Observers<ImageNotes> observers_;
  Inspector* inspector_ = nullptr;  // one of them
  std::uint64_t bytes_written_ = 0, crossings_ = 0;
};

}  // namespace

std::unique_ptr<Maker> make_image_maker(const Plan& plan, JobChecks& checks, const FlowLimits& limits) {
  return std::make_unique<ImageMaker>(plan, checks, limits);
}

}  // namespace lamina::pipeline
