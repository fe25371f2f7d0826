#include "pipeline/plan/jet_plan.h"

#include <mutex>
#include <optional>
#include <utility>

#include "pipeline/machine/materials.h"
#include "pipeline/machine/powder_printer.h"
#include "pipeline/plan/heights.h"
#include "pipeline/plan/porous_plan.h"
#include "pipeline/plan/reach.h"
#include "pipeline/plan/solids.h"
#include "pipeline/run/layer_workshop.h"
#include "stages/write/image_format.h"

namespace lamina::pipeline {

struct JetPlan::State {
  Job job;
  std::optional<PorousPlan> porous;
  Scene scene;
  heights::LayerTable table;
  Materials materials;
  ManifestHead head;
  std::optional<Solids> solids;
  std::optional<LayerWorkshop> workshop;

  std::mutex mutex;
  std::vector<std::unique_ptr<LayerWork>> idle;

  std::unique_ptr<LayerWork> take() {
    const std::lock_guard lock(mutex);
    if (idle.empty()) return std::make_unique<LayerWork>();
    std::unique_ptr<LayerWork> work = std::move(idle.back());
    idle.pop_back();
    return work;
  }
  void give_back(std::unique_ptr<LayerWork> work) {
    const std::lock_guard lock(mutex);
    idle.push_back(std::move(work));
  }
};

JetPlan::JetPlan() : state_(std::make_unique<State>()) {}
JetPlan::JetPlan(JetPlan&&) noexcept = default;
JetPlan& JetPlan::operator=(JetPlan&&) noexcept = default;
JetPlan::~JetPlan() = default;

Result<JetPlan> JetPlan::make(const Job& job) {
  JetPlan plan;
  State& state = *plan.state_;
  state.job = job;
  state.job.dry_run = true;  // there is nothing to write into
  if (Status status = check_job(state.job); !status) return status.error();
  if (Status status = resolve_machine(state.job); !status) return status.error();
  if (job.heights.per_part) {
    return Error{Fault::kUsage, "heights.per_part: a powder bed has one table of layers for all parts; leave it out"};
  }
  const Result<bool> filled = PorousPlan::asked(state.job);
  if (!filled) return filled.error();
  if (*filled) {
    auto porous = PorousPlan::make(state.job, grid_of(state.job), [](const ProgressEvent&) {});
    if (!porous) return porous.error();
    state.porous.emplace(std::move(*porous));
  }
  // The slicer points into its own meshes, the rasterizer takes those it is given.
  Result<Scene> scene = state.porous ? Result<Scene>(state.porous->slices().scene()) : load_scene(state.job);
  if (!scene) return scene.error();
  state.scene = std::move(*scene);
  if (Status status = check_reach(state.job, state.scene); !status) return status.error();
  Result<heights::LayerTable> table = layer_table(state.job, state.scene);
  if (!table) return table.error();
  state.table = std::move(*table);
  if (const Result<std::string> steps = check_build_steps(state.job, state.table); !steps) return steps.error();
  Result<Materials> materials = materials_of(state.job);
  if (!materials) return materials.error();
  state.materials = std::move(*materials);
  const write::ImageFormat* format = write::find_image_format(state.job.format);
  if (format == nullptr) return Error{Fault::kUsage, "image.format: no such format"};
  state.head = make_head(state.job, state.scene.parts, state.table.size(), {0, state.table.size()}, state.materials);
  Result<Solids> solids = Solids::build(state.scene, state.job, grid_of(state.job), state.materials);
  if (!solids) return solids.error();
  state.solids.emplace(std::move(*solids));
  state.workshop.emplace(state.job, *state.solids, state.materials, state.head, *format, nullptr,
                         state.porous ? &*state.porous : nullptr, 0);
  return plan;
}

const Job& JetPlan::job() const { return state_->job; }
const PixelGrid& JetPlan::grid() const { return state_->head.grid; }
const heights::LayerTable& JetPlan::layers() const { return state_->table; }
const std::vector<PartSummary>& JetPlan::parts() const { return state_->scene.parts; }

std::vector<std::string> JetPlan::materials() const {
  std::vector<std::string> names;
  for (const JobMaterial& material : state_->materials.used) {
    if (!material.name.empty()) names.push_back(material.name);
  }
  return names;
}

Result<Runs> JetPlan::layer(std::uint32_t index) const {
  Result<PlannedImages> images = this->images(index);
  if (!images) return images.error();
  return std::move(images->whole);
}

Result<PlannedImages> JetPlan::images(std::uint32_t index) const {
  std::unique_ptr<LayerWork> work = state_->take();
  LayerOutcome outcome;
  outcome.record.layer = state_->table[index];
  const Status status = state_->workshop->raster(*work, outcome);
  PlannedImages images{work->runs, {}};  // of their own sizes; the scratch stays warm
  if (state_->materials.several()) images.material = work->materials.image;
  state_->give_back(std::move(work));
  if (!status) return status.error();
  return images;
}

}  // namespace lamina::pipeline
