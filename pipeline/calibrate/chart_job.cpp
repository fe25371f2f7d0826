#include "pipeline/calibrate/chart_job.h"

#include <fmt/format.h>

#include <filesystem>
#include <functional>
#include <vector>

#include "pipeline/machine/profiles.h"
#include "pipeline/run/run.h"
#include "stages/calibration/chart/layout.h"
#include "stages/formats/chart/chart.h"
#include "stages/formats/image_format.h"
#include "stages/support/io/file.h"
#include "stages/support/io/temporary.h"
#include "stages/support/text/json_value.h"
#include "stages/support/text/readable.h"

namespace lamina::pipeline {
namespace {

namespace fs = std::filesystem;

/// The files of one call; removed again unless all of it is done.
struct ChartFiles {
  fs::path directory;
  FileOptions options;
  std::vector<std::string> paths = {};
  ~ChartFiles() {
    for (const std::string& path : paths) remove_or_note(path);
  }
  Status add(const std::string& name, std::span<const std::byte> bytes) {
    paths.push_back((directory / name).string());
    const Status status = write_file(paths.back(), bytes, options);
    if (!status) paths.pop_back();
    return status;
  }
};

Status write_images(const HeadGrid& grid, std::uint32_t count, const std::function<Runs(std::uint32_t)>& image,
                    ChartFiles& files) {
  const auto encoder = formats::find_image_format("tiff-g4")->make_encoder();
  formats::Bytes bytes;
  for (std::uint32_t i = 0; i < count; ++i) {
    if (Status status = encoder->encode(image(i), grid.image.x.dpi(), grid.image.y.dpi(), bytes); !status) return status;
    if (Status status = files.add(fmt::format("images/{:06}.tif", i), bytes); !status) return status;
  }
  return {};
}

/// drops.json: the layers that a call with --drops wrote.
std::string drops_text(const calibration::DropLayers& wanted) {
  return json_line(
      {{"kind", "lamina drops 1"}, {"drops", wanted.drops}, {"drops_a_layer", wanted.a_layer}, {"layers", wanted.layers}});
}

}  // namespace

Result<Summary> write_chart_job(const ChartRequest& request, const std::atomic<bool>& cancel) {
  auto machine = find_machine(request.machine);
  if (!machine) return Error{machine.error().fault, "--machine: " + machine.error().message};
  const auto all = resolve_profile(calibration::chart_machine(*machine, request.drops > 0));
  // A controller that cannot fire some nozzles insists on them being blocked.
  const auto printer = all || machine->head.blocked.empty() ? all : resolve_profile(calibration::chart_machine(*machine, true));
  if (!printer) return printer.error();
  const auto drops = calibration::layout_drops(printer->machine, printer->grid, std::max<std::uint64_t>(request.drops, 1));
  auto deposited = request.drops > 0 ? Result<Chart>(Chart()) : calibration::layout_chart(printer->machine, printer->grid);
  if (!drops || !deposited) return drops ? deposited.error() : drops.error();
  deposited->layer_mm = request.layer_mm;
  const fs::path directory = request.directory;
  std::error_code failed;
  fs::create_directories(directory / "images", failed);
  if (failed) return Error{Fault::kOutput, fmt::format("{}: {}", one_line(request.directory), failed.message())};
  // Begun first and finished last: another run is refused meanwhile.
  const std::string record = (directory / (request.drops > 0 ? "drops.json" : "chart.json")).string();
  auto text = File::open(record, {.replace = request.overwrite});
  if (!text) return text.error();
  if (!request.overwrite && fs::exists(fs::symlink_status(record, failed)))
    return Error{Fault::kUsage, fmt::format("{}: is there already; name another directory, or add --overwrite", record)};
  ChartFiles files{directory, {.replace = request.overwrite}};
  const std::string profile = pipeline::machine_text(printer->machine);
  Status status = files.add("machine.toml", std::as_bytes(std::span(profile)));
  const auto image = [&](std::uint32_t i) {
    return request.drops > 0 ? calibration::draw_drops(*drops, printer->grid, i) : calibration::draw(*deposited);
  };
  if (status) status = write_images(printer->grid, request.drops > 0 ? drops->layers : 1, image, files);
  if (!status) return status.error();
  Job job;
  job.machine.profile = (directory / "machine.toml").string();
  job.parts = {{.path = (directory / "images").string(), .at_mm = std::array{0.0, 0.0}}};
  job.layer_mm = request.layer_mm;
  job.named = {"layers.thickness_mm"};
  job.output = (directory / "print").string();
  job.overwrite = request.overwrite;
  job.allow_unbound = true;
  auto summary = run(
      job, Product::kImages, [](const ProgressEvent&) {}, cancel);
  if (!summary) return summary.error();
  const std::string json = request.drops > 0 ? drops_text(*drops) : chart_text(*deposited);
  if (status = text->append(json); !status) return status.error();
  if (const auto whole = text->finish(); !whole) return whole.error();
  files.paths.clear();
  return summary;
}

Result<std::string> measured_profile(const Machine& machine) {
  std::string toml = fmt::format("# {} with what was measured on it. Made by lamina calibrate.\n\n{}", one_line(machine.name),
                                 pipeline::machine_text(machine));
  const auto again = read_machine(toml, "the profile");
  const auto grid = again ? resolve_profile(*again) : again.error();
  if (!grid) {  // without a place in a file that is not there
    const std::string& why = grid.error().message;
    return Error{Fault::kInput, "what was measured gives no valid profile: " + (again ? why : why.substr(why.find(": ") + 2))};
  }
  return toml;
}

}  // namespace lamina::pipeline
