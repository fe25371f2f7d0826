#include "pipeline/show/heights_study.h"

#include <fmt/format.h>

#include <chrono>
#include <fstream>
#include <utility>

#include "pipeline/plan/heights.h"
#include "pipeline/text/number_text.h"
#include "stages/heights/per_part.h"

namespace lamina::pipeline {
namespace {

using Clock = std::chrono::steady_clock;

double seconds_since(Clock::time_point start) { return std::chrono::duration<double>(Clock::now() - start).count(); }

HeightsStudy study_of(const heights::SurfaceIndex& index, const heights::Options& options, heights::Plan plan) {
  HeightsStudy study;
  study.options = options;
  study.boundaries = heights::boundaries_of(plan.table);
  for (std::uint32_t i = 0; i < plan.table.size(); ++i) study.reasons.push_back(plan.table[i].reason);
  const auto start = Clock::now();
  study.evaluation = heights::evaluate(index, study.boundaries, options);
  study.evaluate_seconds = seconds_since(start);
  study.plan = std::move(plan);
  return study;
}

Result<HeightsStudy> decide(const heights::SurfaceIndex& index, const heights::Options& options) {
  const auto start = Clock::now();
  Result<heights::Plan> plan = heights::plan_heights(index, options);
  if (!plan) return plan.error();
  const double seconds = seconds_since(start);
  HeightsStudy study = study_of(index, options, std::move(*plan));
  study.plan_seconds = seconds;
  study.name = mode_name(options.mode);
  if (options.mode == heights::Mode::kUniform) study.name += fmt::format(" {} mm", number_text(mm(options.set.least())));
  return study;
}

}  // namespace

Result<HeightsStudy> study_heights(const Job& job, const Scene& scene) {
  const Result<heights::Options> options = heights_options(job);
  if (!options) return options.error();
  const auto start = Clock::now();
  const heights::SurfaceIndex index = index_scene(scene, *options);
  const double seconds = seconds_since(start);
  Result<HeightsStudy> study = decide(index, *options);
  if (study) study->index_seconds = seconds;
  return study;
}

Result<HeightsStudy> study_table(const Job& job, const Scene& scene, const std::string& path) {
  Job as_asked = job;
  if (job.heights.thickness_mm.empty()) as_asked.heights.mode = heights::Mode::kUniform;
  const Result<heights::Options> options = heights_options(as_asked);
  if (!options) return options.error();
  std::ifstream file(path);
  if (!file) return Error{Fault::kInput, fmt::format("{}: cannot be read; name a file of heights", path)};
  HeightsStudy study;
  study.name = "from " + path;
  study.options = *options;
  study.boundaries.push_back(0);
  std::string line;
  for (int number = 1; std::getline(file, line); ++number) {
    line = line.substr(0, line.find('#'));
    while (!line.empty() && (line.back() == ' ' || line.back() == '\r' || line.back() == '\t')) line.pop_back();
    if (line.empty()) continue;
    double millimetres = 0;
    if (const std::string wrong = read_number(line, 0, 2147, " mm", millimetres); !wrong.empty()) {
      return Error{Fault::kInput, fmt::format("{}:{}: {}", path, number, wrong)};
    }
    const std::int64_t height = nm_of(millimetres);
    if (height == 0 && study.boundaries.size() == 1) continue;
    if (height <= study.boundaries.back()) {
      return Error{Fault::kInput, fmt::format("{}:{}: {} mm is not above the height before it; list the tops of the layers "
                                              "from the bottom up",
                                              path, number, line)};
    }
    study.boundaries.push_back(height);
  }
  if (study.boundaries.size() < 2) return Error{Fault::kInput, fmt::format("{}: holds no layer; list their tops in mm", path)};
  study.evaluation = heights::evaluate(index_scene(scene, *options), study.boundaries, *options);
  return study;
}

Result<std::vector<HeightsStudy>> study_all_ways(const Job& job, const Scene& scene) {
  const Result<heights::Options> asked = heights_options(job);
  if (!asked) return asked.error();
  const heights::SurfaceIndex index = index_scene(scene, *asked);
  std::vector<HeightsStudy> studies;
  const auto add = [&](heights::Mode mode, heights::ThicknessSet set) -> Status {
    heights::Options options = *asked;
    options.mode = mode;
    options.set = std::move(set);
    Result<HeightsStudy> study = decide(index, options);
    if (!study) return study.error();
    studies.push_back(std::move(*study));
    return {};
  };
  using heights::Mode;
  if (Status status = add(Mode::kUniform, {{asked->set.least()}}); !status) return status.error();
  if (asked->set.size() > 1) {
    if (Status status = add(Mode::kUniform, {{asked->set.most()}}); !status) return status.error();
  }
  for (const Mode mode : {Mode::kAngle, Mode::kStepwise, Mode::kCusp, Mode::kOptimal}) {
    if (Status status = add(mode, asked->set); !status) return status.error();
  }
  return studies;
}

Result<std::vector<HeightsStudy>> study_per_part(const Job& job, const Scene& scene) {
  Result<heights::Options> options = heights_options(job);
  if (!options) return options.error();
  options->mode = heights::Mode::kOptimal;
  if (Status status = heights::check_slab(options->set); !status) return status.error();
  heights::SurfaceIndex index = index_scene(scene, *options);
  Result<HeightsStudy> common = decide(index, *options);
  if (!common) return common.error();
  common->name = "all parts in one table";
  std::vector<HeightsStudy> studies;
  studies.push_back(std::move(*common));
  Result<heights::PerPartPlan> plan = heights::plan_per_part(index, *options);
  if (!plan) return plan.error();
  const std::vector<heights::PartSurface> parts = std::exchange(index.parts, {});
  for (std::uint32_t part = 0; part < parts.size(); ++part) {
    index.parts = {parts[part]};
    index.top = parts[part].top;
    index.area_mm2 = 0;
    for (const heights::Standing& standing : parts[part].standing) {
      index.area_mm2 += index.meshes[standing.mesh].area_mm2 * standing.copies;
    }
    HeightsStudy study = study_of(index, *options, std::move(plan->parts[part]));
    for (heights::LayerFacts& layer : study.evaluation.layers) layer.part = layer.part == heights::kNoPart ? layer.part : part;
    study.name = fmt::format("part {}, slabs of {} mm", part + 1, number_text(mm(plan->slab)));
    studies.push_back(std::move(study));
  }
  return studies;
}

}  // namespace lamina::pipeline
