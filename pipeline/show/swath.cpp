// A part of lamina-preview: it needs the libraries of pictures.
#include "pipeline/show/swath.h"

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

using write::picture::SwathView;

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

/// All materials of a layer as one image.
Result<Runs> image_of_layer(const std::string& directory, const ManifestHead& head, std::uint32_t layer) {
  Runs whole;
  LayerRecord record;
  record.layer.index = layer;
  for (const LayerImageFile& file : layer_images(head, record)) {
    auto image = read::image((std::filesystem::path(directory) / file.name).string());
    if (!image) return image.error();
    if (!raster::add_image(std::move(image->runs), whole)) {
      return Error{Fault::kVerification, fmt::format("{}: sets pixels of another material", file.name)};
    }
  }
  return whole;
}

/// A layer's program carried out, and what is looked at.
struct Jetting {
  std::vector<replay::VirtualMachine::Drop> drops;  // in the order of the program
  std::map<std::uint32_t, SweepSeen> sweeps;
  std::vector<std::uint32_t> order;   // of the sweeps that fire
  std::uint32_t swath = 0, step = 0;  // what is chosen of them

  const SweepSeen& present() const { return sweeps.at(swath); }
  /// Those of earlier sweeps, and of this one up to the step.
  std::vector<replay::VirtualMachine::Drop> fired() const {
    std::vector<replay::VirtualMachine::Drop> so_far;
    bool here = false;
    for (const replay::VirtualMachine::Drop& drop : drops) {
      here = here || drop.sweep == swath;
      if (here && (drop.sweep != swath || (present().backward ? drop.step < step : drop.step > step))) break;
      so_far.push_back(drop);
    }
    return so_far;
  }
};

Result<Jetting> jet_layer(const std::string& program, const replay::VirtualMachine& machine, const SwathChoice& choice) {
  Jetting jetting;
  const auto replayed = machine.run(program, choice.layer, [&](const replay::VirtualMachine::Drop& drop) {
    jetting.drops.push_back(drop);
    const auto [found, fresh] = jetting.sweeps.try_emplace(drop.sweep, SweepSeen{drop.first_line, drop.step, drop.step, false});
    if (fresh) jetting.order.push_back(drop.sweep);
    found->second.first_step = std::min(found->second.first_step, drop.step);
    found->second.last_step = std::max(found->second.last_step, drop.step);
    if (drop.step < found->second.last_step) found->second.backward = true;
  });
  if (!replayed) return replayed.error();
  if (jetting.order.empty())
    return Error{Fault::kUsage, fmt::format("layer {}: its program fires nothing; choose another --layer", choice.layer)};
  const std::uint32_t swath = jetting.swath = choice.swath.value_or(jetting.order[jetting.order.size() / 2]);
  if (!jetting.sweeps.contains(swath)) {
    return Error{Fault::kUsage, fmt::format("--swath {}: fires nothing in layer {}; those that do are {} to {}", swath,
                                            choice.layer, jetting.sweeps.begin()->first, jetting.sweeps.rbegin()->first)};
  }
  const auto [line, first, last, backward] = jetting.present();
  if (choice.step && (*choice.step < first || *choice.step > last)) {
    return Error{Fault::kUsage, fmt::format("--step {}: swath {} of layer {} fires at steps {} to {}", *choice.step, swath,
                                            choice.layer, first, last)};
  }
  jetting.step = choice.step.value_or(first + (last - first) / 2);
  return jetting;
}

/// Where the sweeps pass: from the line of the first to that of the last nozzle, wherever they lie on the bed.
std::vector<SwathView::Band> bands_of(const Jetting& jetting, const replay::VirtualMachine& machine, const PixelGrid& grid) {
  const bool x = machine.profile().mounting.scan_axis == ScanAxis::kX;
  const std::uint32_t last = machine.profile().head.nozzles - 1;
  std::vector<SwathView::Band> bands;
  for (const auto& [number, sweep] : jetting.sweeps) {
    const auto one = machine.nozzle_at(sweep.first_line, 0, 0), other = machine.nozzle_at(sweep.first_line, 0, last);
    const double lo = std::min(one[x ? 1 : 0], other[x ? 1 : 0]), hi = std::max(one[x ? 1 : 0], other[x ? 1 : 0]) + 1;
    bands.push_back(x ? SwathView::Band{0, double(grid.columns()), lo, hi, number == jetting.swath}
                      : SwathView::Band{lo, hi, 0, double(grid.rows()), number == jetting.swath});
  }
  return bands;
}

}  // namespace

Result<Buffer<std::byte>> draw_swath(const std::string& directory, const Manifest& manifest, const SwathChoice& choice) {
  const ManifestHead& head = manifest.head;
  if (head.machine.empty()) {
    return Error{Fault::kUsage, fmt::format("{}: the job has no print program; plan it with --machine", directory)};
  }
  if (std::ranges::none_of(manifest.layers, [&](const LayerRecord& one) { return one.layer.index == choice.layer; })) {
    return Error{Fault::kUsage, fmt::format("--layer {}: the job has layers {} to {}", choice.layer,
                                            manifest.layers.front().layer.index, manifest.layers.back().layer.index)};
  }
  const auto machine = machine_of_job(directory, head);
  if (!machine) return machine.error();
  const auto image = image_of_layer(directory, head, choice.layer);
  if (!image) return image.error();
  const auto jetting = jet_layer(program_of_layer(directory, head, choice.layer), *machine, choice);
  if (!jetting) return jetting.error();

  const auto& [drops, sweeps, order, swath, step] = *jetting;
  std::vector<replay::VirtualMachine::Drop> fired = jetting->fired();
  SwathView view;
  view.grid = head.grid;
  view.width = choice.width;
  view.image = *image;
  view.bands = bands_of(*jetting, *machine, head.grid);
  std::vector<bool> fires(machine->profile().head.nozzles, false);
  for (const replay::VirtualMachine::Drop& drop : drops) {
    if (drop.sweep == swath && drop.step == step) fires[drop.nozzle] = true;
  }
  for (std::uint32_t i = 0; i < fires.size(); ++i) {
    const auto at = machine->nozzle_at(jetting->present().first_line, step, i);
    view.nozzles.push_back({at[0], at[1], fires[i]});
  }
  view.title = fmt::format("{}, layer {}, swath {} ({} of {} that fire), step {}", head.machine, choice.layer, swath,
                           std::ranges::find(order, swath) - order.begin() + 1, order.size(), step);
  view.caption = fmt::format("{} of {} drops fired; {} of {} nozzles fire at this step (red)", fired.size(), drops.size(),
                             std::ranges::count(fires, true), fires.size());
  const Runs runs = runs_of(fired, head.grid.columns(), head.grid.rows());
  view.fired = runs;
  return write::picture::swath_picture(view);
}

}  // namespace lamina::pipeline
