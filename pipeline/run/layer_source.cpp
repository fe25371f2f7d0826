#include "pipeline/run/layer_source.h"

#include <tbb/task_arena.h>

#include <mutex>
#include <optional>
#include <utility>

#include "pipeline/plan/layers.h"
#include "pipeline/run/layer_imager.h"
#include "stages/geometry/drop_rows.h"
#include "stages/load/load.h"
#include "stages/support/io/file.h"

namespace lamina::pipeline {
namespace {

/// bed  that the parts stand on, if it is decided already
Result<Plan> plan_of(const Job& job, Product product, const Bed* bed = nullptr) {
  auto resolved = resolve(job, product);
  if (!resolved) return resolved.error();
  if (bed != nullptr) resolved->bed = *bed;
  return make_plan(std::move(*resolved), [](const ProgressEvent&) {});
}

}  // namespace

struct LayerSource::State {
  Plan plan;
  std::optional<LayerImager> imager;
  std::mutex idle_mutex;
  std::vector<std::unique_ptr<ImageWork>> idle;
  std::mutex contour_mutex;
  std::optional<Plan> contour_plan;  // made by the first call of contours()

  std::unique_ptr<ImageWork> take() {
    const std::lock_guard lock(idle_mutex);
    if (idle.empty()) return std::make_unique<ImageWork>();
    std::unique_ptr<ImageWork> work = std::move(idle.back());
    idle.pop_back();
    return work;
  }
  void give_back(std::unique_ptr<ImageWork> work) {
    const std::lock_guard lock(idle_mutex);
    idle.push_back(std::move(work));
  }
  Result<const Sections*> sections() {
    const std::lock_guard lock(contour_mutex);
    if (contour_plan) return contour_plan->sections.get();
    Job job = plan.job;
    job.shard.reset();
    // Isolated: while it waits, this thread takes no work of the caller's, which may request contours too.
    auto made = tbb::this_task_arena::isolate([&] { return plan_of(job, Product::kContours, &plan.bed); });
    if (!made) return made.error();
    contour_plan.emplace(std::move(*made));
    return contour_plan->sections.get();
  }
};

LayerSource::LayerSource() : state_(std::make_unique<State>()) {}
LayerSource::LayerSource(LayerSource&&) noexcept = default;
LayerSource& LayerSource::operator=(LayerSource&&) noexcept = default;
LayerSource::~LayerSource() = default;

Result<LayerSource> LayerSource::make(const Job& requested) {
  Job job = requested;
  job.dry_run = true;  // nothing is written
  if (Status status = check_job(job); !status) return status.error();
  auto plan = plan_of(job, Product::kImages);
  if (!plan) return plan.error();
  LayerSource source;
  source.state_->plan = std::move(*plan);
  source.state_->imager.emplace(source.state_->plan);
  return source;
}

const Job& LayerSource::job() const { return state_->plan.job; }
std::array<double, 2> LayerSource::bed_mm() const { return state_->plan.bed.size_mm; }
const PixelGrid& LayerSource::grid() const { return state_->plan.images->grid; }
const std::vector<PartSummary>& LayerSource::parts() const { return state_->plan.scene->parts; }
std::uint32_t LayerSource::layer_count() const { return state_->plan.layer_count; }
Layer LayerSource::layer(std::uint32_t index) const { return state_->plan.layer(index); }

std::vector<std::string> LayerSource::materials() const {
  std::vector<std::string> names;
  for (const JobMaterial& material : state_->plan.images->materials.used) {
    if (!material.name.empty()) names.push_back(material.name);
  }
  return names;
}

Result<PlannedImages> LayerSource::images(std::uint32_t index) const {
  std::unique_ptr<ImageWork> work = state_->take();
  LayerRecord record;
  ImageNotes notes;
  const Status status = state_->imager->make(state_->plan.layer(index), *work, record, notes);
  PlannedImages images;
  const std::vector<DropImageView>& drops = work->drops.drops;
  const bool several = state_->plan.images->materials.several();
  if (drops.empty()) {
    images.whole = work->runs;  // exact-size copies; the scratch keeps its capacity
    if (several) images.material = work->materials.image;
  } else if (status) {
    runs_of(drops[0], 0, images.whole);
    for (std::size_t m = 1; several && m < drops.size(); ++m) runs_of(drops[m], 0, images.material.emplace_back());
  }
  state_->give_back(std::move(work));
  if (!status) return status.error();
  return images;
}

formats::LayerTags LayerSource::tags(std::uint32_t index) const { return tags_of(state_->plan, layer(index)); }

Result<Contours> LayerSource::contours(std::uint32_t index) const {
  const auto sections = state_->sections();
  if (!sections) return sections.error();
  slice::SectionScratch scratch;
  slice::LayerContours contours;
  const auto report = (*sections)->slicer().layer(index, scratch, contours);
  if (!report) return report.error();
  return std::move(contours.contours);
}

Result<std::vector<Layer>> layers_of(const Job& job) {
  if (Status status = check_job(job); !status) return status.error();
  const auto scene = load_scene(job, kLargestBed);
  if (!scene) return scene.error();
  heights::Plan plan;
  if (!job.heights.per_part) {
    auto decided = decide_heights(job, *scene);
    if (!decided) return decided.error();
    plan = std::move(*decided);
  }
  const auto schedule = schedule_layers(job, *scene, plan.table);
  if (!schedule) return schedule.error();
  std::vector<Layer> layers;
  for (const ScheduledLayer& scheduled : schedule->layers) layers.push_back(scheduled.layer);
  return layers;
}

Result<Part> load_part(const Job& job, const PartRequest& part) { return load::load(part.path, load_options(job, part)); }

Status save_image(const std::string& path, const RunsView& image, double dpi_x, double dpi_y,
                  const formats::ImageFormat& format, const formats::LayerTags& tags) {
  formats::Bytes file;
  const auto encoder = format.make_encoder();
  encoder->tag(tags);
  if (Status status = encoder->encode(image, dpi_x, dpi_y, file); !status) return status;
  return write_file(path, file);
}

}  // namespace lamina::pipeline
