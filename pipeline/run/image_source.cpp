#include "pipeline/run/image_source.h"

#include <mutex>
#include <optional>
#include <utility>

#include "pipeline/run/image_maker.h"

namespace lamina::pipeline {

struct ImageSource::State {
  Plan plan;
  std::optional<LayerImager> imager;
  std::mutex mutex;
  std::vector<std::unique_ptr<ImageWork>> idle;

  std::unique_ptr<ImageWork> take() {
    const std::lock_guard lock(mutex);
    if (idle.empty()) return std::make_unique<ImageWork>();
    std::unique_ptr<ImageWork> work = std::move(idle.back());
    idle.pop_back();
    return work;
  }
  void give_back(std::unique_ptr<ImageWork> work) {
    const std::lock_guard lock(mutex);
    idle.push_back(std::move(work));
  }
};

ImageSource::ImageSource() : state_(std::make_unique<State>()) {}
ImageSource::ImageSource(ImageSource&&) noexcept = default;
ImageSource& ImageSource::operator=(ImageSource&&) noexcept = default;
ImageSource::~ImageSource() = default;

Result<ImageSource> ImageSource::make(const Job& asked) {
  Job job = asked;
  job.dry_run = true;  // there is nothing to write into
  if (Status status = check_job(job); !status) return status.error();
  auto resolved = resolve(job, Product::kImages);
  if (!resolved) return resolved.error();
  auto plan = make_plan(std::move(*resolved), [](const ProgressEvent&) {});
  if (!plan) return plan.error();
  ImageSource source;
  source.state_->plan = std::move(*plan);
  source.state_->imager.emplace(source.state_->plan);
  return source;
}

const Plan& ImageSource::plan() const { return state_->plan; }

std::vector<std::string> ImageSource::materials() const {
  std::vector<std::string> names;
  for (const JobMaterial& material : state_->plan.images->materials.used) {
    if (!material.name.empty()) names.push_back(material.name);
  }
  return names;
}

Result<PlannedImages> ImageSource::images(std::uint32_t layer) const {
  std::unique_ptr<ImageWork> work = state_->take();
  LayerRecord record;
  ImageNotes notes;
  const Status status = state_->imager->make(state_->plan.layer(layer), *work, record, notes);
  PlannedImages images{work->runs, {}};  // of their own sizes; the scratch stays warm
  if (state_->plan.images->materials.several()) images.material = work->materials.image;
  state_->give_back(std::move(work));
  if (!status) return status.error();
  return images;
}

}  // namespace lamina::pipeline
