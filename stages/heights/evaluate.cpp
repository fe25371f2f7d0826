#include "stages/heights/evaluate.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "stages/support/clocks.h"
#include "stages/support/io/file_reader.h"
#include "stages/support/text/number_text.h"

namespace lamina::heights {

std::vector<std::int64_t> boundaries_of(const LayerTable& table) {
  std::vector<std::int64_t> boundaries(table.size() + 1);
  for (std::uint32_t i = 0; i < table.size(); ++i) boundaries[i] = table[i].bottom;
  boundaries.back() = table.top();
  return boundaries;
}

Evaluation evaluate(const SurfaceIndex& index, std::span<const std::int64_t> boundaries, const Options& options) {
  Evaluation result;
  const std::size_t count = boundaries.size() - 1;
  const CandidateHeights candidate_heights = CandidateHeights::listed({boundaries.begin(), boundaries.end()});
  const Nm tolerance = options.surface.flat_tolerance;
  result.layers.resize(count);
  const bool nominal = index.has_nominal();
  Buffer<Steepness> of_steps(count, 0);
  for (std::uint32_t part = 0; part < index.parts.size(); ++part) {
    const auto own = std::span(index.parts).subspan(part, 1);
    const Buffer<Steepness> cells = steepest_in_cells(index, own, candidate_heights);
    const Buffer<Steepness> angles =
        nominal ? steepest_in_cells(index, own, candidate_heights, Slope::kAngles) : Buffer<Steepness>();
    for (std::size_t i = 0; i < count; ++i) {
      of_steps[i] = std::max(of_steps[i], cells[i]);
      const Steepness slope = nominal ? angles[i] : cells[i];
      if (slope <= result.layers[i].flattest) continue;
      result.layers[i].flattest = slope;
      result.layers[i].part = part;
    }
  }
  const Buffer<double> below = projected_below(index, index.parts, candidate_heights, Sign::kBoth);
  const bool timed = options.time.on() || options.estimates_time;
  const TimeModel& time = options.time.on() ? options.time : kPlainTime;
  const Buffer<double> section = timed ? section_at_candidates(index, candidate_heights, tolerance) : Buffer<double>();
  double steps = 0;
  for (std::uint32_t i = 0; i < count; ++i) {
    LayerFacts& layer = result.layers[i];
    const std::int64_t thickness = boundaries[i + 1] - boundaries[i];
    layer.cusp = cusp_of(thickness, of_steps[i]);
    if (layer.cusp > result.largest_cusp) {
      result.largest_cusp = layer.cusp;
      result.largest_cusp_layer = i;
    }
    result.above_limit += layer.cusp > options.cusp;
    steps += static_cast<double>(thickness) * (below[i + 1] - below[i]);
    if (timed) result.seconds += time.seconds(section[i]);
  }
  if (index.area_mm2 > 0) result.mean_cusp = steps / index.area_mm2;

  for (const Flat& flat : find_flats(index, tolerance, options.min_flat_mm2)) {
    const std::int64_t miss = distance_to_nearest(boundaries, flat.height);
    result.flats.push_back({flat, miss});
    if (miss > tolerance) {
      ++result.flats_missed;
      result.largest_miss = std::max(result.largest_miss, miss);
    } else {
      const auto above = std::ranges::lower_bound(boundaries, flat.height - tolerance);
      if (above != boundaries.begin()) result.layers[static_cast<std::size_t>(above - boundaries.begin()) - 1].hits_flat = true;
    }
  }
  result.top_miss = boundaries.back() - index.top;
  return result;
}

namespace {

Study study_of(const SurfaceIndex& index, const Options& options, Plan plan) {
  Study study;
  study.options = options;
  study.boundaries = boundaries_of(plan.table);
  for (std::uint32_t i = 0; i < plan.table.size(); ++i) study.reasons.push_back(plan.table[i].reason);
  const Stopwatch watch;
  study.evaluation = evaluate(index, study.boundaries, options);
  study.evaluate_seconds = watch.elapsed().wall;
  study.plan = std::move(plan);
  return study;
}

}  // namespace

Result<Study> study(const SurfaceIndex& index, const Options& options) {
  const Stopwatch watch;
  Result<Plan> plan = plan_heights(index, options);
  if (!plan) return plan.error();
  const double seconds = watch.elapsed().wall;
  Study study = study_of(index, options, std::move(*plan));
  study.plan_seconds = seconds;
  study.name = mode_name(options.mode);
  if (options.mode == Mode::kUniform) study.name += fmt::format(" {} mm", number_text(mm(options.set.minimum())));
  return study;
}

Result<Study> study_table(const SurfaceIndex& index, const Options& options, const std::string& path) {
  auto file = FileReader::open(path, {.fault = Fault::kInput,
                                      .missing = "no such file; name a file of heights",
                                      .max_bytes = kMaxTableBytes,
                                      .streams = true});
  if (!file) return file.error();
  Study study;
  study.name = "from " + path;
  study.options = options;
  study.boundaries.push_back(0);
  for (std::string_view line; file->next(line);) {
    const std::uint64_t number = file->line_number();
    line = line.substr(0, line.find('#'));
    while (!line.empty() && (line.back() == ' ' || line.back() == '\r' || line.back() == '\t')) line.remove_suffix(1);
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
  if (!file->status()) return file->status().error();
  if (study.boundaries.size() < 2) return Error{Fault::kInput, fmt::format("{}: holds no layer; list their tops in mm", path)};
  study.evaluation = evaluate(index, study.boundaries, options);
  return study;
}

Result<std::vector<Study>> study_all_modes(const SurfaceIndex& index, const Options& options) {
  std::vector<std::pair<Mode, ThicknessSet>> paths = {{Mode::kUniform, {{options.set.minimum()}}}};
  if (options.set.size() > 1) paths.push_back({Mode::kUniform, {{options.set.maximum()}}});
  for (const Mode mode : {Mode::kAngle, Mode::kStepwise, Mode::kCusp, Mode::kOptimal}) paths.push_back({mode, options.set});
  std::vector<Study> studies;
  Options way = options;
  for (auto& [mode, set] : paths) {
    way.mode = mode;
    way.set = std::move(set);
    Result<Study> made = study(index, way);
    if (!made) return made.error();
    studies.push_back(std::move(*made));
  }
  return studies;
}

Result<std::vector<Study>> study_per_part(SurfaceIndex index, Options options) {
  options.mode = Mode::kOptimal;
  if (Status status = check_slab(options.set); !status) return status.error();
  Result<Study> common = study(index, options);
  if (!common) return common.error();
  common->name = "all parts in one table";
  std::vector<Study> studies;
  studies.push_back(std::move(*common));
  Result<PerPartPlan> plan = plan_per_part(index, options);
  if (!plan) return plan.error();
  const std::vector<PartSurface> parts = std::exchange(index.parts, {});
  for (std::uint32_t part = 0; part < parts.size(); ++part) {
    index.parts = {parts[part]};
    index.top = parts[part].top;
    index.area_mm2 = 0;
    for (const PlacedSurface& placed : parts[part].placed) {
      index.area_mm2 += index.meshes[placed.mesh].area_mm2 * placed.copies;
    }
    Study study = study_of(index, options, std::move(plan->parts[part]));
    for (LayerFacts& layer : study.evaluation.layers) layer.part = layer.part == kNoPart ? layer.part : part;
    study.name = fmt::format("part {}, slabs of {} mm", part + 1, number_text(mm(plan->slab)));
    studies.push_back(std::move(study));
  }
  return studies;
}

}  // namespace lamina::heights
