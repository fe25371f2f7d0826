#include "pipeline/run/image_maker.h"

#include <numeric>
#include <optional>

#include "pipeline/report/image_observers.h"
#include "pipeline/run/inspector.h"
#include "pipeline/run/layer_imager.h"
#include "pipeline/run/part_counter.h"
#include "pipeline/run/powders.h"

namespace lamina::pipeline {
namespace {

class ImageMaker : public Maker {
 public:
  ImageMaker(const Plan& plan, JobChecks& checks, const FlowLimits& limits)
      : plan_(plan), checks_(checks), imager_(plan), files_(plan), work_(limits.max_in_flight), made_(limits.record_slots) {
    if (plan.images->machine) parts_.emplace(plan);
    observe_pixels(plan, observers_);
    inspector_ = &observers_.add<Inspector>(plan);
    observe_images(plan, refills_, observers_);
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
    if (Status status = inspector_->check_file(); !status) return status.error();
    if (Status status = files_.open(); !status) return status.error();
    return files_.take_todo();
  }
  Status start() override { return files_.start(); }
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
      add("inspect", [this](const Layer&, Work& work, Made&) {
        inspector_->inspection().prepare(work.images.runs, work.layer_inspection);
        return Status();
      });
      steps.back().needs = [this](std::uint32_t, const Ticket& ticket) -> Result<std::uint64_t> {
        return inspector_->inspection().bytes_needed(work_[ticket.work].images.runs);
      };
    }
    const auto dose_needs = [this](std::uint32_t layer, const Ticket& ticket) -> Result<std::uint64_t> {
      const ImageWork& work = work_[ticket.work].images;
      const Layer of = plan_.layer(layer);
      return bytes_of(of, plan_.images->dose.parted_pixels(work.runs, work.drops)) - bytes_of(of, 0) +
             work_[ticket.work].layer_inspection.bytes();
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
    add("store",
        [this](const Layer&, Work& work, Made& made) { return files_.store(images_of(work), work.files, made.record); });
    return steps;
  }
  bool records_from_work() const override { return inspector_->on(); }

  Status record(std::uint32_t, const Ticket& ticket) override {
    const Made& made = made_[ticket.record];
    if (!plan_.job.dry_run) {
      if (Status status = files_.record(made.record); !status) return status;
    }
    if (inspector_->on()) inspector_->record(made.record.layer, work_[ticket.work].layer_inspection);
    observers_.layer(made.record, &made.notes);
    checks_.record(made.record.layer.index, made.record.set_pixels > 0);
    crossings_ += made.notes.report.crossings;
    bytes_written_ += made.record.bytes + made.record.program.bytes;
    return {};
  }
  void add_kept(const LayerRecord& record) override {
    observers_.layer(record, nullptr);
    checks_.keep(record.layer.index, record.set_pixels > 0);
  }

  std::uint64_t bytes_held(std::uint32_t work) const override {
    return work_[work].images.bytes() + work_[work].files.bytes() + work_[work].layer_inspection.bytes();
  }
  std::uint64_t extra_bytes() const override { return inspector_->bytes(); }
  void let_go(std::uint32_t work) override { work_[work] = Work(); }

  std::uint64_t crossings() const override { return crossings_; }
  bool times_dry_runs() const override { return plan_.images->machine.has_value() || inspector_->on(); }
  bool keeps() const override { return files_.started(); }
  Status finish() override {
    if (plan_.job.dry_run) return {};
    const Status status = files_.finish();
    return status ? inspector_->write(files_.head()) : status;
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
    checks::LayerInspection layer_inspection;
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

  const Plan& plan_;
  JobChecks& checks_;
  LayerImager imager_;
  ImageFiles files_;
  std::vector<Work> work_;
  std::vector<Made> made_;
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
