// A part of lamina-preview: it needs the libraries of pictures.
#include "pipeline/show/preview_swath.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <map>

#include "pipeline/check/replay_job.h"
#include "stages/raster/materials.h"
#include "stages/read/image.h"
#include "stages/write/picture/swath_view.h"

namespace lamina::pipeline {
namespace {

struct SweepSeen {
  std::int64_t first_line;
  std::uint32_t first_step, last_step;
  bool backward;
};

Runs runs_of(std::vector<replay::VirtualMachine::Drop>& drops, std::uint32_t columns, std::uint32_t rows) {
  std::ranges::sort(drops,
                    [](const auto& a, const auto& b) { return std::pair(a.row, a.column) < std::pair(b.row, b.column); });
  Runs runs;
  runs.columns = columns;
  std::size_t next = 0;
  for (std::uint32_t row = 0; row < rows; ++row) {
    runs.row_offset.push_back(static_cast<std::uint32_t>(runs.change.size()));
    for (; next < drops.size() && drops[next].row == row; ++next) {
      const std::uint32_t column = drops[next].column;
      if (runs.change.size() > runs.row_offset.back() && runs.change.back() == column) {
        ++runs.change.back();
      } else {
        runs.change.insert(runs.change.end(), {column, column + 1});
      }
    }
  }
  runs.row_offset.push_back(static_cast<std::uint32_t>(runs.change.size()));
  return runs;
}

}  // namespace

Result<Buffer<std::byte>> draw_swath(const std::string& directory, const Manifest& manifest, const SwathChoice& choice) {
  const ManifestHead& head = manifest.head;
  if (head.machine.empty()) {
    return Error{Fault::kUsage, fmt::format("{}: the job has no print program; plan it with --machine", directory)};
  }
  const auto path = [&](const std::string& name) { return (std::filesystem::path(directory) / name).string(); };
  if (std::ranges::none_of(manifest.layers, [&](const LayerRecord& one) { return one.layer.index == choice.layer; })) {
    return Error{Fault::kUsage, fmt::format("--layer {}: the job has layers {} to {}", choice.layer,
                                            manifest.layers.front().layer.index, manifest.layers.back().layer.index)};
  }
  const auto built = machine_of_job(directory, head);
  if (!built) return built.error();
  const Machine& machine = built->profile();
  Runs whole;
  LayerRecord record;
  record.layer.index = choice.layer;
  for (const LayerImageFile& file : layer_images(head, record)) {
    auto image = read::image(path(file.name));
    if (!image) return image.error();
    if (!raster::add_image(std::move(image->runs), whole)) {
      return Error{Fault::kVerification, fmt::format("{}: sets pixels of another material", file.name)};
    }
  }

  std::vector<replay::VirtualMachine::Drop> drops;
  std::map<std::uint32_t, SweepSeen> sweeps;
  std::vector<std::uint32_t> order;
  const auto replayed =
      built->run(program_of_layer(directory, head, choice.layer), choice.layer, [&](const replay::VirtualMachine::Drop& drop) {
        drops.push_back(drop);
        const auto [found, fresh] = sweeps.try_emplace(drop.sweep, SweepSeen{drop.first_line, drop.step, drop.step, false});
        if (fresh) order.push_back(drop.sweep);
        found->second.first_step = std::min(found->second.first_step, drop.step);
        found->second.last_step = std::max(found->second.last_step, drop.step);
        if (drop.step < found->second.last_step) found->second.backward = true;
      });
  if (!replayed) return replayed.error();
  if (order.empty())
    return Error{Fault::kUsage, fmt::format("layer {}: its program fires nothing; choose another --layer", choice.layer)};
  const std::uint32_t swath = choice.swath.value_or(order[order.size() / 2]);
  if (!sweeps.contains(swath)) {
    return Error{Fault::kUsage, fmt::format("--swath {}: fires nothing in layer {}; those that do are {} to {}", swath,
                                            choice.layer, sweeps.begin()->first, sweeps.rbegin()->first)};
  }
  const SweepSeen& present = sweeps.at(swath);
  if (choice.step && (*choice.step < present.first_step || *choice.step > present.last_step)) {
    return Error{Fault::kUsage, fmt::format("--step {}: swath {} of layer {} fires at steps {} to {}", *choice.step, swath,
                                            choice.layer, present.first_step, present.last_step)};
  }
  const std::uint32_t step = choice.step.value_or(present.first_step + (present.last_step - present.first_step) / 2);

  write::picture::SwathView view;
  view.grid = head.grid;
  view.width = choice.width;
  view.image = whole;
  const bool x = machine.mounting.scan_axis == ScanAxis::kX;
  const std::uint32_t nozzles = machine.head.nozzles;
  for (const auto& [number, sweep] : sweeps) {
    // From the line of the first to that of the last nozzle, wherever they lie on the bed.
    const auto one = built->nozzle_at(sweep.first_line, 0, 0), other = built->nozzle_at(sweep.first_line, 0, nozzles - 1);
    const double lo = std::min(one[x ? 1 : 0], other[x ? 1 : 0]), hi = std::max(one[x ? 1 : 0], other[x ? 1 : 0]) + 1;
    view.bands.push_back(x ? write::picture::SwathView::Band{0, double(head.grid.columns()), lo, hi, number == swath}
                           : write::picture::SwathView::Band{lo, hi, 0, double(head.grid.rows()), number == swath});
  }
  // Drops of earlier sweeps, and of this one up to the step, in the order of the program.
  std::vector<replay::VirtualMachine::Drop> fired;
  std::vector<bool> fires(nozzles, false);
  for (const replay::VirtualMachine::Drop& drop : drops) {
    if (drop.sweep == swath && drop.step == step) fires[drop.nozzle] = true;
  }
  const bool backward = present.backward;
  bool here = false;
  for (const replay::VirtualMachine::Drop& drop : drops) {
    here = here || drop.sweep == swath;
    if (here && (drop.sweep != swath || (backward ? drop.step < step : drop.step > step))) break;
    fired.push_back(drop);
  }
  std::size_t firing = 0;
  for (std::uint32_t i = 0; i < nozzles; ++i) {
    const auto at = built->nozzle_at(present.first_line, step, i);
    view.nozzles.push_back({at[0], at[1], fires[i]});
    firing += fires[i];
  }
  const auto place = std::ranges::find(order, swath) - order.begin() + 1;
  view.title = fmt::format("{}, layer {}, swath {} ({} of {} that fire), step {}", head.machine, choice.layer, swath, place,
                           order.size(), step);
  view.caption = fmt::format("{} of {} drops fired; {} of {} nozzles fire at this step (red)", fired.size(), drops.size(),
                             firing, nozzles);
  const Runs runs = runs_of(fired, head.grid.columns(), head.grid.rows());
  view.fired = runs;
  return write::picture::swath_picture(view);
}

}  // namespace lamina::pipeline
