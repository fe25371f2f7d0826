#include "stages/heights/heights.h"

#include <fmt/format.h>

#include <utility>

#include "stages/heights/candidate_heights.h"
#include "stages/heights/greedy.h"
#include "stages/heights/optimal.h"

namespace lamina::heights {

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

}  // namespace lamina::heights
