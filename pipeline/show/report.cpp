#include "pipeline/show/report.h"
#include "pipeline/check/job_files.h"

#include <fmt/format.h>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <span>

#include "pipeline/job/file.h"
#include "pipeline/report/job_cost.h"
#include "pipeline/show/report_head.h"
#include "pipeline/show/report_overhangs.h"
#include "pipeline/show/report_source.h"
#include "pipeline/show/report_warnings.h"
#include "stages/geometry/coverage.h"
#include "stages/support/hash/hash.h"
#include "stages/support/memory_gate.h"
#include "stages/view/depth.h"
#include "stages/view/report/page.h"
#include "stages/view/report/run_code.h"

namespace lamina::pipeline {
namespace {

namespace fs = std::filesystem;
using view::report::HeldLayers;
using view::report::PageData;

constexpr std::uint32_t kChunk = 64;  // layers read in parallel

/// Calls `work(place, layer, slot)` for every layer on all processors, then `gather(place, slot)` in order. Stops at the
/// first unreadable layer.
template <class Slot, class Work, class Gather>
Status each_layer(const ReportSource& source, bool timed, std::uint64_t memory, Work work, Gather gather) {
  MemoryGate gate(memory);
  const auto count = static_cast<std::uint32_t>(source.manifest.layers.size());
  for (std::uint32_t first = 0; first < count; first += kChunk) {
    const std::uint32_t end = std::min(first + kChunk, count);
    std::vector<Slot> slots(end - first);
    std::vector<Status> states(end - first);
    tbb::parallel_for(first, end, [&](std::uint32_t position) {
      const auto pass = gate.enter(source.bytes(position, timed));
      // Isolated: a thread that waits within has a pass, and must not begin another layer.
      tbb::this_task_arena::isolate([&] {
        const Result<ReportLayer> layer = source.layer(position, timed);
        if (layer) {
          work(position, *layer, slots[position - first]);
        } else {
          states[position - first] = layer.error();
        }
      });
    });
    for (std::uint32_t position = first; position < end; ++position) {
      if (!states[position - first]) return states[position - first];
      gather(position, slots[position - first]);
    }
  }
  return {};
}

/// The parts from their files, if found and unchanged.
Result<Scene> parts_of(const fs::path& folder, const ManifestHead& head, const Job& job, const Machine* machine,
                       const ReportOptions& options) {
  std::vector<std::string> folders = options.parts;
  folders.insert(folders.end(), {".", folder.string(), folder.parent_path().string()});
  return find_parts(head, job, machine, folders);
}

Result<std::vector<ShownView>> views_of_parts(const Scene& scene) {
  const auto pictures = cast_parts(scene, 360);
  if (!pictures) return pictures.error();
  std::vector<ShownView> views;
  for (const auto& [name, picture] :
       {std::pair{"top", &(*pictures)[0]}, {"front", &(*pictures)[1]}, {"side", &(*pictures)[2]}}) {
    views.push_back({name, picture->width, picture->height, 0, picture->width_mm, picture->height_mm,
                     view::report::deflate_bytes(std::as_bytes(std::span(picture->light_cover)))});
  }
  return views;
}

std::vector<ShownView> views_of_layers(const view::ThreeViews& views) {
  std::vector<ShownView> shown;
  for (const view::DepthView& view : views.views()) {
    shown.push_back({view.name, view.width, view.height, view.maximum, view.width_mm, view.height_mm,
                     view::report::deflate_bytes(std::as_bytes(std::span(view.depth)))});
  }
  return shown;
}

/// Reads every layer; codes that fit the page go to `held`.
Result<ReportLayers> see_layers(const ReportSource& source, std::uint64_t memory, ReportWarnings& report_warnings,
                                view::report::HeldLayers& held) {
  struct First {
    PixelWindow window;
    Buffer<std::byte> code;
    std::uint64_t set = 0;
    double seconds = 0;
  };
  ReportLayers detected;
  const Status status = each_layer<First>(
      source, true, memory,
      [&](std::uint32_t position, const ReportLayer& layer, First& first) {
        report_warnings.inspect(source.manifest.layers[position].layer, layer.rows());
        first.window = window_of(layer.rows());
        if (held.wants(position)) first.code = view::report::pack_runs(layer.rows());
        first.set = layer.bits ? layer.bits->set_pixels() : set_pixels(layer.runs);
        first.seconds = layer.seconds;
      },
      [&](std::uint32_t position, First& first) {
        detected.window = joined(detected.window, first.window);
        held.add(position, std::move(first.code));
        detected.set.push_back(first.set);
        detected.seconds.push_back(first.seconds);
      });
  if (!status) return status.error();
  detected.warnings = report_warnings.report(detected.set);
  if (detected.window.empty()) detected.window = {0, source.grid.columns(), 0, source.grid.rows()};
  return detected;
}

/// Views of the parts from their layers, for missing part files: a second pass over all layers.
Result<std::vector<ShownView>> build_up(const ReportSource& source, std::uint64_t memory, const PixelWindow& window) {
  const std::vector<LayerRecord>& layers = source.manifest.layers;
  const Layer &lowest = layers.front().layer, &highest = layers.back().layer;
  view::ThreeViews built(source.grid, window, lowest.bottom, highest.bottom + highest.thickness);
  const Status status = each_layer<std::vector<std::uint8_t>>(
      source, false, memory,
      [&](std::uint32_t, const ReportLayer& layer, std::vector<std::uint8_t>& cells) { built.inspect(layer.rows(), cells); },
      [&](std::uint32_t position, const std::vector<std::uint8_t>& cells) { built.add(layers[position].layer, cells); });
  if (!status) return status.error();
  return views_of_layers(built);
}

}  // namespace

Result<Report> make_report(const std::string& path, const ReportOptions& options) {
  const Result<ReportSource> source = report_source(path);
  if (!source) return source.error();
  const Result<FileDigest> file = digest_file(source->manifest_path);
  if (!file) return file.error();
  const Manifest& manifest = source->manifest;
  Report report;
  std::vector<ShownView> views;
  Job job;
  const Status read = read_job_text(manifest.head.job_toml, "manifest.json", job);
  const fs::path folder = fs::absolute(source->manifest_path).lexically_normal().parent_path();
  const Machine* const machine = source->machine ? &*source->machine : nullptr;
  const auto parts = read ? parts_of(folder, manifest.head, job, machine, options) : read.error();
  auto shown = parts ? views_of_parts(*parts) : parts.error();
  if (shown) {
    views = std::move(*shown);
  } else if (!options.parts.empty() &&
             std::ranges::none_of(manifest.head.parts, [](const auto& part) { return part.triangles == 0; })) {
    return Error{Fault::kInput, shown.error().message};
  } else {
    report.without_parts = shown.error().message;
  }
  ReportWarnings report_warnings(manifest, job, machine, parts ? &*parts : nullptr);

  // Reserves room for the layers' lines and the rest of the page.
  std::uint64_t taken = (views.empty() ? 150'000 : 50'000) + 150 * manifest.layers.size();
  taken += options.deposited_svg.size() / 3 * 4;
  for (const ShownView& view : views) taken += view.deflated.size() / 3 * 4;
  HeldLayers held(options.size_limit > taken ? options.size_limit - taken : 0);
  auto detected = see_layers(*source, options.memory_bytes, report_warnings, held);
  if (!detected) return detected.error();
  if (parts && manifest.head.product == Product::kMoves) {
    auto overhangs = overhangs_of_job(manifest, job, *parts, source->box);
    if (!overhangs) return overhangs.error();
    overhangs->tally.warn(job.support_angle_deg, detected->warnings);
    detected->overhang_mm2 = std::move(overhangs->area_mm2);
    detected->positions = std::move(overhangs->positions);
  }
  add_inspection(folder.string(), manifest.head, mirrors_x(job.mirror), mirrors_y(job.mirror), *detected);
  detected->deposited = options.deposited;
  detected->deposited_svg = options.deposited_svg;
  if (source->machine) {
    JobCost cost(*source->machine, manifest);
    for (std::size_t i = 0; i < manifest.layers.size(); ++i)
      cost.add(manifest.layers[i], manifest.layers[i].program.drops + manifest.layers[i].program.spat,
               std::llround(1e6 * detected->seconds[i]));
    detected->quote = cost.rows();
    detected->sweeps = sweeps_of_job(folder.string(), manifest);
  }
  if (views.empty()) {
    auto built = build_up(*source, options.memory_bytes, detected->window);
    if (!built) return built.error();
    views = std::move(*built);
  }
  const std::string head =
      head_json(manifest, {fs::path(source->manifest_path).filename().string(), *file}, source->grid, *detected, held, views);
  std::vector<PageData> data;
  for (ShownView& view : views) data.push_back({"v-" + view.name, std::move(view.deflated)});
  for (auto& [position, code] : held.layers()) data.push_back({fmt::format("r{}", position), std::move(code)});
  report.layers = static_cast<std::uint32_t>(manifest.layers.size());
  report.held = static_cast<std::uint32_t>(held.layers().size());
  report.stride = held.stride();
  report.page = view::report::make_page("lamina: " + page_title(manifest.head), head, data);
  return report;
}

}  // namespace lamina::pipeline
