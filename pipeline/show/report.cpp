#include "pipeline/show/report.h"

#include <fmt/format.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <span>

#include "pipeline/check/replay_job.h"
#include "pipeline/output/manifest.h"
#include "pipeline/show/report_cast.h"
#include "pipeline/show/title.h"
#include "stages/data/hash.h"
#include "stages/raster/materials.h"
#include "stages/read/image.h"
#include "stages/view/depth.h"
#include "stages/write/report/page.h"
#include "stages/write/report/run_code.h"

namespace lamina::pipeline {
namespace {

namespace fs = std::filesystem;
using write::report::PageData;
using Json = nlohmann::ordered_json;

constexpr std::uint32_t kChunk = 64;  // layers that are read together

Result<Manifest> finished_manifest(const std::string& directory) {
  std::error_code ignored;
  const std::string path = directory + "/manifest.json";
  if (!fs::exists(path, ignored) && fs::exists(path + ".part", ignored)) {
    return Error{Fault::kVerification, fmt::format("{}: the job is not finished; end it with --resume, then ask for the "
                                                   "report",
                                                   directory)};
  }
  if (!fs::exists(path, ignored)) {
    return Error{Fault::kVerification, fmt::format("{}: no manifest.json; name a finished directory of lamina jet (shards: "
                                                   "run lamina merge first)",
                                                   directory)};
  }
  if (product_of_manifest(directory + "/manifest.json") == Product::kContours) {
    return Error{Fault::kVerification, fmt::format("{}: is a job of lamina slice, and reports are of lamina jet's jobs; "
                                                   "lamina preview draws its layers",
                                                   directory)};
  }
  Result<Manifest> manifest = read_manifest(path);
  if (!manifest) return manifest;
  if (manifest->head.extension.empty()) {
    return Error{Fault::kVerification, fmt::format("{}: the job wrote no images (format {}); plan it with another format, "
                                                   "as tiff-g4",
                                                   directory, manifest->head.format)};
  }
  if (manifest->layers.empty()) return Error{Fault::kVerification, directory + ": the job has no layers"};
  return manifest;
}

/// A layer's files into runs, if they are those of the manifest; several materials are drawn as one.
Result<Runs> read_layer(const std::string& directory, const ManifestHead& head, const LayerRecord& record) {
  Runs whole;
  for (const LayerImageFile& file : layer_images(head, record)) {
    const std::string path = directory + "/" + file.name;
    const Result<FileDigest> digest = digest_file(path);
    if (!digest) return digest.error();
    const Error changed{Fault::kVerification,
                        fmt::format("{}: is not the file of the manifest; lamina verify tells more", path)};
    if (digest->bytes != file.record.bytes || digest->hash != file.record.hash) return changed;
    Result<read::Image> image = read::image(path);
    if (!image) return image.error();
    if (image->runs.columns != head.grid.columns() || image->runs.view().rows() != head.grid.rows()) return changed;
    if (!raster::add_image(std::move(image->runs), whole)) return changed;
  }
  return whole;
}

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

/// Calls `work(place, runs, slot)` for every layer on all processors, and then `gather(place, slot)` in order. The
/// first layer whose work fails ends it.
template <class Slot, class Work, class Gather>
Status each_layer(const std::string& directory, const Manifest& manifest, Work work, Gather gather) {
  const auto count = static_cast<std::uint32_t>(manifest.layers.size());
  for (std::uint32_t first = 0; first < count; first += kChunk) {
    const std::uint32_t end = std::min(first + kChunk, count);
    std::vector<Slot> slots(end - first);
    std::vector<Status> states(end - first);
    tbb::parallel_for(first, end, [&](std::uint32_t place) {
      const Result<Runs> runs = read_layer(directory, manifest.head, manifest.layers[place]);
      states[place - first] = runs ? work(place, runs->view(), slots[place - first]) : Status(runs.error());
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

/// How long the machine takes for a layer, by its program; replayed as lamina verify does.
Result<double> seconds_of_layer(const std::string& directory, const ManifestHead& head, const replay::VirtualMachine& machine,
                                const LayerRecord& record, const RunsView& image) {
  const std::string program = program_of_layer(directory, head, record.layer.index);
  if (hash_bytes(std::as_bytes(std::span(program))) == record.program.hash) {
    const auto replay = machine.replay(program, record.layer, image, record.program.moved, record.program.lost);
    if (replay) return replay->seconds;
    return Error{Fault::kVerification, fmt::format("{}: {}", directory, replay.error().message)};
  }
  return Error{Fault::kVerification, fmt::format("{}/{}: is not the file of the manifest; lamina verify tells more", directory,
                                                 program_file_name(record.layer.index, head.program_extension))};
}

/// The parts themselves, if their files can be found and are still those that were planned.
Result<std::vector<ShownView>> views_of_parts(const std::string& directory, const ManifestHead& head,
                                              const ReportOptions& options) {
  std::vector<std::string> folders = options.parts;
  const fs::path place = fs::absolute(directory).lexically_normal();
  folders.insert(folders.end(), {".", directory, (place.has_filename() ? place : place.parent_path()).parent_path().string()});
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

/// The layers' numbers, a list for each column.
Json layers_json(const Manifest& manifest, const std::vector<double>& seconds) {
  Json columns;
  const auto column = [&](const char* name, auto value) {
    Json& list = columns[name] = Json::array();
    for (const LayerRecord& record : manifest.layers) list.push_back(value(record));
  };
  column("bottom", [](const LayerRecord& r) { return r.layer.bottom; });
  column("thickness", [](const LayerRecord& r) { return r.layer.thickness; });
  column("reason", [](const LayerRecord& r) { return static_cast<int>(r.layer.reason); });
  column("set", [](const LayerRecord& r) { return r.set_pixels; });
  column("bytes", [](const LayerRecord& r) { return r.bytes; });
  column("capped", [](const LayerRecord& r) { return r.capped_rows; });
  column("hash", [](const LayerRecord& r) { return hex(r.hash); });
  if (manifest.head.machine.empty()) return columns;
  column("sweeps", [](const LayerRecord& r) { return r.program.sweeps; });
  columns["seconds"] = Json::array();
  for (const double time : seconds) columns["seconds"].push_back(std::round(time * 1e6) / 1e6);
  return columns;
}

/// What the page's script reads.
Json head_json(const Manifest& manifest, const FileDigest& file, const PixelWindow& window, HeldLayers& held,
               const std::vector<ShownView>& views, const std::vector<double>& seconds) {
  const ManifestHead& head = manifest.head;
  const double dpi_x = head.grid.x.dpi(), dpi_y = head.grid.y.dpi();
  Json json = {{"title", title_of(head)},
               {"version", head.version},
               {"format", head.format},
               {"machine", head.machine},
               {"columns", head.grid.columns()},
               {"rows", head.grid.rows()},
               {"dpi", {dpi_x, dpi_y}},
               {"pixel_mm", {25.4 / dpi_x, 25.4 / dpi_y}},
               {"window", {window.left, window.top, window.right, window.bottom}},
               {"layer_count", head.layer_count},
               {"first_layer", head.first_layer},
               {"stride", held.stride()},
               {"job", head.job_toml},
               {"manifest", {{"bytes", file.bytes}, {"hash", hex(file.hash)}}},
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
  json["layers"] = layers_json(manifest, seconds);
  return json;
}

/// What one pass over all layers gives.
struct LayersSeen {
  PixelWindow window;
  std::vector<double> seconds;  // of each, with a machine
};

/// Reads every layer; codes that fit the page go to `held`.
Result<LayersSeen> see_layers(const std::string& directory, const Manifest& manifest, const replay::VirtualMachine* machine,
                              HeldLayers& held) {
  struct First {
    PixelWindow window;
    Buffer<std::byte> code;
    double seconds = 0;
  };
  LayersSeen seen;
  const Status status = each_layer<First>(
      directory, manifest,
      [&](std::uint32_t place, const RunsView& runs, First& first) -> Status {
        first.window = window_of(runs);
        if (held.wants(place)) first.code = write::report::pack_runs(runs);
        if (machine == nullptr) return {};
        const auto time = seconds_of_layer(directory, manifest.head, *machine, manifest.layers[place], runs);
        if (!time) return time.error();
        first.seconds = *time;
        return {};
      },
      [&](std::uint32_t place, First& first) {
        seen.window = joined(seen.window, first.window);
        held.add(place, std::move(first.code));
        if (machine != nullptr) seen.seconds.push_back(first.seconds);
      });
  if (!status) return status.error();
  const PixelGrid& grid = manifest.head.grid;
  if (seen.window.empty()) seen.window = {0, grid.columns(), 0, grid.rows()};
  return seen;
}

/// The parts as their layers build them up, where their files are not at hand: a second pass over all layers.
Result<std::vector<ShownView>> build_up(const std::string& directory, const Manifest& manifest, const PixelWindow& window) {
  const std::vector<LayerRecord>& layers = manifest.layers;
  const Layer &lowest = layers.front().layer, &highest = layers.back().layer;
  view::ThreeViews built(manifest.head.grid, window, lowest.bottom, highest.bottom + highest.thickness);
  const Status status = each_layer<std::vector<std::uint8_t>>(
      directory, manifest,
      [&](std::uint32_t, const RunsView& runs, std::vector<std::uint8_t>& cells) -> Status {
        built.look(runs, cells);
        return {};
      },
      [&](std::uint32_t place, const std::vector<std::uint8_t>& cells) { built.add(layers[place].layer, cells); });
  if (!status) return status.error();
  return views_of_layers(built);
}

}  // namespace

Result<Report> make_report(const std::string& directory, const ReportOptions& options) {
  const Result<Manifest> manifest = finished_manifest(directory);
  if (!manifest) return manifest.error();
  const Result<FileDigest> file = digest_file(directory + "/manifest.json");
  if (!file) return file.error();
  std::optional<replay::VirtualMachine> machine;
  if (!manifest->head.machine.empty()) {
    auto built = machine_of_job(directory, manifest->head);
    if (!built) return Error{built.error().fault, fmt::format("{}/{}", directory, built.error().message)};
    machine.emplace(std::move(*built));
  }
  Report report;
  std::vector<ShownView> views;
  if (auto shown = views_of_parts(directory, manifest->head, options)) {
    views = std::move(*shown);
  } else if (!options.parts.empty()) {
    return Error{Fault::kInput, shown.error().message};
  } else {
    report.without_parts = shown.error().message;
  }

  // What a layer's line and the rest of the page take is not the layers' own.
  std::uint64_t taken = (views.empty() ? 150'000 : 50'000) + 150 * manifest->layers.size();
  for (const ShownView& view : views) taken += view.deflated.size() / 3 * 4;
  HeldLayers held(options.size_limit > taken ? options.size_limit - taken : 0);
  const auto seen = see_layers(directory, *manifest, machine ? &*machine : nullptr, held);
  if (!seen) return seen.error();
  if (views.empty()) {
    auto built = build_up(directory, *manifest, seen->window);
    if (!built) return built.error();
    views = std::move(*built);
  }
  const std::string head = head_json(*manifest, *file, seen->window, held, views, seen->seconds)
                               .dump(-1, ' ', false, Json::error_handler_t::replace);
  std::vector<PageData> data;
  for (ShownView& view : views) data.push_back({"v-" + view.name, std::move(view.deflated)});
  for (auto& [place, code] : held.layers()) data.push_back({fmt::format("r{}", place), std::move(code)});
  report.layers = static_cast<std::uint32_t>(manifest->layers.size());
  report.held = static_cast<std::uint32_t>(held.layers().size());
  report.stride = held.stride();
  report.page = write::report::make_page("lamina: " + title_of(manifest->head), head, data);
  return report;
}

}  // namespace lamina::pipeline
