#include "stages/heights/heights.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numeric>

#include "stages/heights/greedy.h"
#include "stages/heights/optimal.h"

namespace lamina::heights {

Result<std::string> check_build_steps(const Machine& machine, const LayerTable& table) {
  const std::int64_t step = std::max<std::int64_t>(1, std::llround(machine.motion.layer_step_um * 1000));
  std::uint32_t off = 0, first = 0;
  std::int64_t maximum = 0;
  for (std::uint32_t i = 0; i < table.size(); ++i) {
    const Layer layer = table[i];
    if (layer.thickness < step) {
      return Error{Fault::kUsage, fmt::format("layer {}: {:g} mm is less than a step of {}, {:g} mm; use thicker layers", i,
                                              mm(layer.thickness), machine.name, mm(step))};
    }
    const std::int64_t over = (std::int64_t{layer.bottom} + layer.thickness) % step;
    if (over == 0) continue;
    if (off++ == 0) first = i;
    maximum = std::max(maximum, std::min(over, step - over));
  }
  if (off == 0) return std::string();
  return fmt::format(
      "{} of {} layers, first {}, end beside the {:g} mm steps of {}'s build vat, by up to {:g} mm, and cannot end "
      "there on the machine; thicknesses that are whole steps can",
      off, table.size(), first, mm(step), machine.name, mm(maximum));
}

Result<Options> options_of(const Settings& settings, double layer_mm) {
  Options options;
  options.mode = settings.mode;
  options.cusp = static_cast<Nm>(nm_of(settings.cusp_mm));
  options.adapt_angle_deg = settings.adapt_angle_deg;
  options.surface.peak_angle_deg = settings.peak_angle_deg;
  options.surface.normal_tolerance = settings.normal_tolerance;
  options.surface.flat_tolerance = static_cast<Nm>(nm_of(settings.flat_tolerance_um / 1000));
  options.surface.min_facet_mm2 = settings.min_facet_mm2;
  options.surface.nominal_cusps = settings.cusp_of == CuspOf::kNominal;
  options.peaks = settings.peaks;
  options.cover_top = settings.cover_top;
  options.facets = settings.facets;
  options.flats = settings.flats;
  options.min_flat_mm2 = settings.min_flat_mm2;
  options.time = {settings.time_model[0], settings.time_model[1]};
  if (!settings.thickness_mm.empty()) {
    Result<ThicknessSet> set = read_thicknesses(settings.thickness_mm);
    if (!set) return Error{Fault::kUsage, "heights.thickness_mm: " + set.error().message};
    options.set = std::move(*set);
  } else if (settings.mode == Mode::kUniform) {
    options.set.values = {static_cast<Nm>(nm_of(layer_mm))};
  } else {
    return Error{Fault::kUsage, fmt::format("--heights {}: needs thicknesses to choose from; add --thickness with a set as "
                                            "0.178,0.254 or a range as 0.05..0.3",
                                            mode_name(settings.mode))};
  }
  if (Status status = check_options(options); !status) return status.error();
  return options;
}

Status check_options(const Options& options) {
  const auto wrong = [](std::string text) { return Error{Fault::kUsage, std::move(text)}; };
  if (options.set.values.empty()) {
    return wrong("heights.thickness: holds no thickness; give a set as 0.178,0.254 or a range as 0.05..0.30:0.01");
  }
  Nm before = 0;
  for (const Nm value : options.set.values) {
    if (value <= before) return wrong("heights.thickness: thicknesses have to be above 0 and to differ");
    before = value;
  }
  if (options.mode == Mode::kUniform && options.set.size() > 1) {
    return wrong(
        fmt::format("heights.thickness: uniform layers have one thickness, here are {}; give one, or another "
                    "--heights",
                    options.set.size()));
  }
  const bool by_cusp = options.mode == Mode::kCusp || options.mode == Mode::kStepwise || options.mode == Mode::kOptimal;
  if (by_cusp && options.cusp <= 0) {
    return wrong("heights.cusp_mm: 0 is a limit that no slope can keep; give a height above 0, as 0.1");
  }
  return {};
}

Result<Plan> plan_heights(const SurfaceIndex& index, const Options& options) {
  if (Status status = check_options(options); !status) return status.error();
  if (options.mode == Mode::kUniform) {
    Plan plan;
    plan.table = LayerTable::uniform(index.top, options.set.minimum());
    return plan;
  }
  Result<CandidateHeights> candidate_heights =
      CandidateHeights::reachable(options.set, std::int64_t{index.top} + options.set.maximum());
  if (!candidate_heights) return candidate_heights.error();
  if (options.mode == Mode::kOptimal) return plan_optimal(index, options, *candidate_heights);
  Plan plan;
  GreedyLayers layers(index, options, std::move(*candidate_heights), plan);
  while (layers.advance(plan)) {
  }
  return plan;
}

std::int64_t slab_height(const ThicknessSet& set) {
  const std::int64_t minimum = set.minimum(), maximum = set.maximum();
  return set.is_contiguous() ? ceil_div(maximum, minimum) * minimum : std::lcm(minimum, maximum);
}

Status check_slab(const ThicknessSet& set) {
  constexpr std::int64_t kMaxSlab = 16;  // times the greatest thickness: above, parts have hardly a boundary in common
  const std::int64_t slab = slab_height(set);
  if (slab <= kMaxSlab * set.maximum()) return {};
  return Error{Fault::kUsage,
               fmt::format("heights.per_part: {} and {} mm meet only every {} mm; give thicknesses with a smaller "
                           "common multiple, or a range",
                           mm(set.minimum()), mm(set.maximum()), mm(slab))};
}

Result<PerPartPlan> plan_per_part(SurfaceIndex index, const Options& options) {
  if (Status status = check_slab(options.set); !status) return status.error();
  PerPartPlan result;
  result.slab = slab_height(options.set);
  Options own = options;
  own.mode = Mode::kOptimal;
  own.slab = result.slab;
  const std::vector<PartSurface> parts = std::exchange(index.parts, {});
  for (const PartSurface& part : parts) {
    index.parts = {part};
    index.top = part.top;
    Result<Plan> plan = plan_heights(index, own);
    if (!plan) return plan.error();
    result.parts.push_back(std::move(*plan));
  }
  return result;
}

Status OnRecord::check(const Layer& layer) {
  const bool uniform = options_ && options_->mode == Mode::kUniform;
  if (layer.index == 0) begins_ = 0;
  if (uniform) begins_ = std::int64_t{layer.index} * options_->set.minimum();
  const auto begins = std::exchange(begins_, std::int64_t{layer.bottom} + layer.thickness);
  const Status thick = options_ ? check_thickness(layer) : Status();
  if (begins && layer.bottom != *begins) {
    return Error{Fault::kVerification,
                 fmt::format("layer {}: begins {} nm above the bed, the manifest says {}", layer.index, *begins, layer.bottom)};
  }
  return thick;
}

Status OnRecord::check_thickness(const Layer& layer) {
  const ThicknessSet& set = options_->set;
  const auto wrong = [&](const std::string& what) {
    return Error{Fault::kVerification, fmt::format("layer {}: {}", layer.index, what)};
  };
  if (options_->mode == Mode::kStepwise) {
    if (divides_slab(layer)) return {};
    return wrong(fmt::format("divides no slab of {} nm evenly, from {} to {} nm", set.maximum(), layer.bottom,
                             std::int64_t{layer.bottom} + layer.thickness));
  }
  if (std::ranges::binary_search(set.values, layer.thickness)) return {};
  if (options_->mode == Mode::kUniform) {
    return wrong(fmt::format("is {} nm thick as all of the job, the manifest says {}", set.minimum(), layer.thickness));
  }
  return wrong(fmt::format("is {} nm thick, by the manifest, which is none of the job's thicknesses", layer.thickness));
}

bool OnRecord::divides_slab(const Layer& layer) {
  const std::int64_t slab = options_->set.maximum(), low = layer.bottom % slab, high = low + layer.thickness;
  if (low == 0) {
    count_ = 0;
    fewest_ = 1;
    max_ = slab / options_->set.minimum();
  }
  if (count_ < 0) return high <= slab;
  // Boundary i of n divisions lies at floor(slab * i / n).
  const auto meet = [&](std::int64_t i, std::int64_t position) {
    fewest_ = std::max(fewest_, slab * i / (position + 1) + 1);
    if (position > 0) max_ = std::min(max_, slab * i / position);
  };
  meet(count_, low);
  meet(++count_, high);
  if (high <= slab && fewest_ <= max_) return true;
  count_ = -1;
  return false;
}

}  // namespace lamina::heights
