// Part of lamina-preview, which links the picture libraries.
#include "pipeline/show/swath.h"

#include <fmt/format.h>

#include <algorithm>

#include "pipeline/check/job_files.h"
#include "stages/geometry/combine.h"
#include "stages/view/picture/swath_view.h"

namespace lamina::pipeline {

Result<Buffer<std::byte>> draw_swath(const std::string& directory, const Manifest& manifest, const replay::StepChoice& choice,
                                     std::uint32_t width) {
  const ManifestHead& head = manifest.head;
  if (head.machine.empty()) {
    return Error{Fault::kUsage, fmt::format("{}: the job has no print program; plan it with --machine", directory)};
  }
  const auto record =
      std::ranges::find_if(manifest.layers, [&](const LayerRecord& one) { return one.layer.index == choice.layer; });
  if (record == manifest.layers.end()) {
    return Error{Fault::kUsage, fmt::format("--layer {}: the job has layers {} to {}", choice.layer,
                                            manifest.layers.front().layer.index, manifest.layers.back().layer.index)};
  }
  const auto machine = machine_of_job(directory, head);
  if (!machine) return machine.error();
  const auto image = picture_of_layer(directory, head, *record);
  if (!image) return image.error();
  replay::StepChoice step = choice;
  step.planes = std::max(1u, head.max_drops);
  const auto jetting = replay::jet_until(*machine, program_of_layer(directory, head, choice.layer), step, head.grid);
  if (!jetting) return jetting.error();
  view::picture::SwathView view;
  view.grid = head.grid;
  view.width = width;
  const Levels requested = times_set(*image);
  view.image = requested;
  view.fired = jetting->printed;
  view.maximum = head.max_of_pixel();
  view.bands = jetting->bands;
  view.nozzles = jetting->nozzles;
  view.title = fmt::format("{}, layer {}, swath {} ({} of {} that fire), step {}", head.machine, choice.layer, jetting->swath,
                           jetting->position, jetting->sweeps, jetting->step);
  view.caption = fmt::format("{} of {} drops fired; {} of {} nozzles fire at this step (red)", jetting->fired, jetting->drops,
                             jetting->firing, jetting->nozzles.size());
  if (view.maximum > 1) view.caption += fmt::format("; darkest {} drops", view.maximum);
  return view::picture::swath_picture(view);
}

}  // namespace lamina::pipeline
