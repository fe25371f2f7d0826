#include "pipeline/show/report.h"

#include <fmt/format.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <span>

#include "pipeline/show/report_cast.h"
#include "pipeline/show/report_source.h"
#include "pipeline/show/title.h"
#include "stages/data/hash.h"
#include "stages/geometry/coverage.h"
#include "stages/view/depth.h"
#include "stages/write/report/page.h"
#include "stages/write/report/run_code.h"

namespace lamina::pipeline {
namespace {

namespace fs = std::filesystem;
using write::report::PageData;
using Json = nlohmann::ordered_json;

constexpr std::uint32_t kChunk = 64;  // layers that are read together

/// The layers' codes that fit the page: when they get too many, every second one is let go.
class HeldLayers {
 public:
  explicit HeldLayers(std::uint64_t limit) : limit_(limit) {}

  bool wants(std::uint32_t place) const { return place % stride_ == 0; }
  void add(std::uint32_t place, Buffer<std::byte> code) {
    if (!wants(place)) return;
    bytes_ += cost(code);
    layers_.push_back({place, std::move(code)});
    while (bytes_ > limit_ && layers_.size() > 1) {
      stride_ *= 2;
      std::erase_if(layers_, [&](const auto& layer) { return layer.first % stride_ != 0; });
      bytes_ = 0;
      for (const auto& layer : layers_) bytes_ += cost(layer.second);
    }
  }
  std::uint32_t stride() const { return stride_; }
  std::vector<std::pair<std::uint32_t, Buffer<std::byte>>>& layers() { return layers_; }

 private:
  static std::uint64_t cost(const Buffer<std::byte>& code) { return code.size() / 3 * 4 + 60; }
  std::uint64_t limit_, bytes_ = 0;
  std::uint32_t stride_ = 1;
  std::vector<std::pair<std::uint32_t, Buffer<std::byte>>> layers_;
};

/// Calls `work(place, layer, slot)` for every layer on all processors, and then `gather(place, slot)` in order. The
/// first layer that cannot be read ends it.
template <class Slot, class Work, class Gather>
Status each_layer(const ReportSource& source, bool timed, Work work, Gather gather) {
  const auto count = static_cast<std::uint32_t>(source.manifest.layers.size());
  for (std::uint32_t first = 0; first < count; first += kChunk) {
    const std::uint32_t end = std::min(first + kChunk, count);
    std::vector<Slot> slots(end - first);
    std::vector<Status> states(end - first);
    tbb::parallel_for(first, end, [&](std::uint32_t place) {
      const Result<LayerSeen> layer = source.layer(place, timed);
      if (layer) {
        work(place, *layer, slots[place - first]);
      } else {
        states[place - first] = layer.error();
      }
    });
    for (std::uint32_t place = first; place < end; ++place) {
      if (!states[place - first]) return states[place - first];
      gather(place, slots[place - first]);
    }
  }
  return {};
}

Json part_json(const PartSummary& part) {
  const auto point = [](const Point3& p) { return Json{mm(p.x), mm(p.y), mm(p.z)}; };
  Json json = {{"path", part.path},
               {"copies", part.copies},
               {"triangles", part.triangles},
               {"low_mm", point(part.bounds.lo)},
               {"high_mm", point(part.bounds.hi)},
               {"notes", Json::array()}};
  for (const Note& note : part.notes) json["notes"].push_back((note.repair ? "repair: " : "") + note.text);
  return json;
}

std::string title_of(const ManifestHead& head) { return head.parts.empty() ? "a job" : title_of(head.parts); }

/// A view of the page: what its head says of it, and its pixels.
struct ShownView {
  std::string name;
  std::uint32_t width = 0, height = 0, most = 0;  // most: of a depth; 0 for light and cover
  double width_mm = 0, height_mm = 0;
  Buffer<std::byte> deflated;
};

/// The parts themselves, if their files can be found and are still those that were planned.
Result<std::vector<ShownView>> views_of_parts(const fs::path& folder, const ManifestHead& head, const ReportOptions& options) {
  std::vector<std::string> folders = options.parts;
  folders.insert(folders.end(), {".", folder.string(), folder.parent_path().string()});
  const auto pictures = cast_parts(head, folders, 360);
  if (!pictures) return pictures.error();
  std::vector<ShownView> views;
  for (const auto& [name, picture] :
       {std::pair{"top", &(*pictures)[0]}, {"front", &(*pictures)[1]}, {"side", &(*pictures)[2]}}) {
    views.push_back({name, picture->width, picture->height, 0, picture->width_mm, picture->height_mm,
                     write::report::deflate_bytes(std::as_bytes(std::span(picture->light_cover)))});
  }
  return views;
}

std::vector<ShownView> views_of_layers(const view::ThreeViews& views) {
  std::vector<ShownView> shown;
  for (const view::DepthView& view : views.views()) {
    shown.push_back({view.name, view.width, view.height, view.most, view.width_mm, view.height_mm,
                     write::report::deflate_bytes(std::as_bytes(std::span(view.depth)))});
  }
  return shown;
}

/// What one pass over all layers gives.
struct LayersSeen {
  PixelWindow window;
  std::vector<std::uint64_t> set;  // pixels of each
  std::vector<double> seconds;     // of each, with a machine
};

/// The layers' numbers, a list for each column.
Json layers_json(const Manifest& manifest, const LayersSeen& seen) {
  const ManifestHead& head = manifest.head;
  Json columns;
  const auto column = [&](const char* name, auto value) {
    Json& list = columns[name] = Json::array();
    for (const LayerRecord& record : manifest.layers) list.push_back(value(record));
  };
  const auto rounded = [](double value) { return std::round(value * 1e6) / 1e6; };
  column("bottom", [](const LayerRecord& r) { return r.layer.bottom; });
  column("thickness", [](const LayerRecord& r) { return r.layer.thickness; });
  column("reason", [](const LayerRecord& r) { return static_cast<int>(r.layer.reason); });
  columns["set"] = seen.set;
  column("bytes", [](const LayerRecord& r) { return r.bytes; });
  column("capped", [](const LayerRecord& r) { return r.capped_rows; });
  column("hash", [](const LayerRecord& r) { return hex(r.hash); });
  if (head.product == Product::kMoves) {
    column("volume", [&](const LayerRecord& r) { return r.paths ? rounded(r.paths->totals.volume_mm3) : 0; });
    column("filament", [&](const LayerRecord& r) { return r.paths ? rounded(r.paths->totals.filament_mm) : 0; });
  } else if (!head.machine.empty()) {
    column("sweeps", [](const LayerRecord& r) { return r.program.sweeps; });
  }
  if (head.machine.empty()) return columns;
  columns["seconds"] = Json::array();
  for (const double time : seen.seconds) columns["seconds"].push_back(rounded(time));
  return columns;
}

/// What the page's script reads.
Json head_json(const ReportSource& source, const FileDigest& file, const LayersSeen& seen, HeldLayers& held,
               const std::vector<ShownView>& views) {
  const ManifestHead& head = source.manifest.head;
  const double dpi_x = source.grid.x.dpi(), dpi_y = source.grid.y.dpi();
  Json json = {
      {"title", title_of(head)},
      {"version", head.version},
      {"images", head.product == Product::kImages},
      {"format", head.format},
      {"machine", head.machine},
      {"columns", source.grid.columns()},
      {"rows", source.grid.rows()},
      {"dpi", {dpi_x, dpi_y}},
      {"pixel_mm", {25.4 / dpi_x, 25.4 / dpi_y}},
      {"window", {seen.window.left, seen.window.top, seen.window.right, seen.window.bottom}},
      {"layer_count", head.layer_count},
      {"first_layer", head.first_layer},
      {"stride", held.stride()},
      {"job", head.job_toml},
      {"manifest",
       {{"name", fs::path(source.manifest_path).filename().string()}, {"bytes", file.bytes}, {"hash", hex(file.hash)}}},
      {"parts", Json::array()},
      {"views", Json::object()},
      {"reasons", Json::array()},
      {"embedded", Json::array()}};
  for (const PartSummary& part : head.parts) json["parts"].push_back(part_json(part));
  for (const ShownView& view : views)
    json["views"][view.name] = {view.width, view.height, view.most, view.width_mm, view.height_mm};
  for (int reason = 0; reason <= static_cast<int>(LayerReason::kFlat); ++reason)
    json["reasons"].push_back(reason_name(static_cast<LayerReason>(reason)));
  for (const auto& [place, code] : held.layers()) json["embedded"].push_back(place);
  json["layers"] = layers_json(source.manifest, seen);
  return json;
}

/// Reads every layer; codes that fit the page go to `held`.
Result<LayersSeen> see_layers(const ReportSource& source, HeldLayers& held) {
  struct First {
    PixelWindow window;
    Buffer<std::byte> code;
    std::uint64_t set = 0;
    double seconds = 0;
  };
  LayersSeen seen;
  const Status status = each_layer<First>(
      source, true,
      [&](std::uint32_t place, const LayerSeen& layer, First& first) {
        const RunsView runs = layer.runs.view();
        first.window = window_of(runs);
        if (held.wants(place)) first.code = write::report::pack_runs(runs);
        for (std::size_t i = 0; i < runs.change.size(); i += 2) first.set += runs.change[i + 1] - runs.change[i];
        first.seconds = layer.seconds;
      },
      [&](std::uint32_t place, First& first) {
        seen.window = joined(seen.window, first.window);
        held.add(place, std::move(first.code));
        seen.set.push_back(first.set);
        seen.seconds.push_back(first.seconds);
      });
  if (!status) return status.error();
  if (seen.window.empty()) seen.window = {0, source.grid.columns(), 0, source.grid.rows()};
  return seen;
}

/// The parts as their layers build them up, where their files are not at hand: a second pass over all layers.
Result<std::vector<ShownView>> build_up(const ReportSource& source, const PixelWindow& window) {
  const std::vector<LayerRecord>& layers = source.manifest.layers;
  const Layer &lowest = layers.front().layer, &highest = layers.back().layer;
  view::ThreeViews built(source.grid, window, lowest.bottom, highest.bottom + highest.thickness);
  const Status status = each_layer<std::vector<std::uint8_t>>(
      source, false,
      [&](std::uint32_t, const LayerSeen& layer, std::vector<std::uint8_t>& cells) { built.look(layer.runs.view(), cells); },
      [&](std::uint32_t place, const std::vector<std::uint8_t>& cells) { built.add(layers[place].layer, cells); });
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
  if (auto shown =
          views_of_parts(fs::absolute(source->manifest_path).lexically_normal().parent_path(), manifest.head, options)) {
    views = std::move(*shown);
  } else if (!options.parts.empty()) {
    return Error{Fault::kInput, shown.error().message};
  } else {
    report.without_parts = shown.error().message;
  }

  // What a layer's line and the rest of the page take is not the layers' own.
  std::uint64_t taken = (views.empty() ? 150'000 : 50'000) + 150 * manifest.layers.size();
  for (const ShownView& view : views) taken += view.deflated.size() / 3 * 4;
  HeldLayers held(options.size_limit > taken ? options.size_limit - taken : 0);
  const auto seen = see_layers(*source, held);
  if (!seen) return seen.error();
  if (views.empty()) {
    auto built = build_up(*source, seen->window);
    if (!built) return built.error();
    views = std::move(*built);
  }
  const std::string head = head_json(*source, *file, *seen, held, views).dump(-1, ' ', false, Json::error_handler_t::replace);
  std::vector<PageData> data;
  for (ShownView& view : views) data.push_back({"v-" + view.name, std::move(view.deflated)});
  for (auto& [place, code] : held.layers()) data.push_back({fmt::format("r{}", place), std::move(code)});
  report.layers = static_cast<std::uint32_t>(manifest.layers.size());
  report.held = static_cast<std::uint32_t>(held.layers().size());
  report.stride = held.stride();
  report.page = write::report::make_page("lamina: " + title_of(manifest.head), head, data);
  return report;
}

}  // namespace lamina::pipeline
