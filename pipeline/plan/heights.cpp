#include "pipeline/plan/heights.h"

#include <fmt/format.h>

#include "pipeline/job/keys.h"
#include "pipeline/text/number_text.h"

namespace lamina::pipeline {

Result<heights::Options> heights_options(const Job& job) {
  const HeightsRequest& request = job.heights;
  heights::Options options;
  options.mode = request.mode;
  if (!request.thickness_mm.empty()) {
    if (const std::string wrong = read_thicknesses(request.thickness_mm, options.set); !wrong.empty()) {
      return Error{Fault::kUsage, "heights.thickness_mm: " + wrong};
    }
  } else if (request.mode == heights::Mode::kUniform) {
    options.set.values = {static_cast<Nm>(nm_of(job.layer_mm))};
  } else {
    return Error{Fault::kUsage, fmt::format("--heights {}: needs thicknesses to choose from; add --thickness with a set as "
                                            "0.178,0.254 or a range as 0.05..0.3",
                                            mode_name(request.mode))};
  }
  options.cusp = static_cast<Nm>(nm_of(request.cusp_mm));
  options.adapt_angle_deg = request.adapt_angle_deg;
  options.surface.peak_angle_deg = request.peak_angle_deg;
  options.surface.normal_tolerance = request.normal_tolerance;
  options.surface.flat_tolerance = static_cast<Nm>(nm_of(request.flat_tolerance_um / 1000));
  options.surface.least_facet_mm2 = request.least_facet_mm2;
  options.facets = request.facets;
  options.flats = request.flats;
  options.least_flat_mm2 = request.least_flat_mm2;
  options.time = {request.time_model[0], request.time_model[1]};
  if (Status status = heights::check_options(options); !status) return status.error();
  return options;
}

heights::SurfaceIndex index_scene(const Scene& scene, const heights::Options& options) {
  return heights::index_surface(scene.meshes, scene.instances, scene.part_of_instance,
                                static_cast<std::uint32_t>(scene.parts.size()), options.surface);
}

Result<heights::LayerTable> layer_table(const Job& job, const Scene& scene) {
  const Result<heights::Options> options = heights_options(job);
  if (!options) return options.error();
  if (options->mode == heights::Mode::kUniform) return heights::LayerTable::uniform(scene.height, options->set.least());
  Result<heights::Plan> plan = heights::plan_heights(index_scene(scene, *options), *options);
  if (!plan) return plan.error();
  return std::move(plan->table);
}

std::string heights_text(const Job& job) {
  const HeightsRequest& request = job.heights;
  const std::string thickness = request.thickness_mm.empty() ? number_text(job.layer_mm) : request.thickness_mm;
  std::string text = fmt::format("of {} mm", thickness);
  if (request.mode == heights::Mode::kUniform) return text;
  text += ", " + mode_name(request.mode);
  if (request.mode == heights::Mode::kAngle)
    return text + fmt::format(", from {} degrees", number_text(request.adapt_angle_deg));
  return text + fmt::format(", steps up to {} mm", number_text(request.cusp_mm));
}

std::string mode_name(heights::Mode mode) {
  Job job;
  job.heights.mode = mode;
  return heights_keys().front().write(job);
}

}  // namespace lamina::pipeline
