#include "pipeline/calibrate/chart_job.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <functional>
#include <optional>
#include <set>

#include "pipeline/run/run.h"
#include "stages/calibration/chart/layout.h"
#include "stages/calibration/chart/rows.h"
#include "stages/calibration/robust.h"
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

using calibration::Located;

std::string list_of(const std::vector<std::uint32_t>& nozzles) {
  return nozzles.empty() ? "none" : fmt::format("{}", fmt::join(nozzles, ", "));
}

/// Nozzles that were read along the scan or across it.
std::vector<std::optional<Located>> read_nozzles(const Json& nozzles, const char* um, const char* error, const char* within) {
  std::vector<std::optional<Located>> read(nozzles.size());
  for (std::size_t n = 0; n < nozzles.size(); ++n) {
    if (nozzles[n].is_null() || nozzles[n].at(um).is_null()) continue;
    read[n] = Located{nozzles[n].at(um).get<double>(), nozzles[n].at(error).get<double>(), nozzles[n].at(within).get<double>()};
  }
  return read;
}

/// A nozzle of a later row that lands too far along the scan stands less far behind than the profile says. Rows whose offset
/// may be chance keep what the profile says.
std::string correct_rows(const std::vector<std::optional<Located>>& along, Machine& machine) {
  std::vector<double>& rows = machine.head.row_offset_um;
  if (rows.size() < 2) return "";
  const auto detected = calibration::rows_of(along, static_cast<std::uint32_t>(rows.size()));
  std::string line;
  for (std::size_t r = 1; r < rows.size(); ++r) {
    line += line.empty() ? "rows      against the first one, change of " : ", ";
    if (!detected[r]) {
      line += "unreadable";
      continue;
    }
    const double late = std::round(10 * detected[r]->um) / 10;
    const bool certain = std::abs(late) > detected[r]->within_um;
    if (certain) rows[r] -= late;
    line += fmt::format("{:+g} um (within {:.1f}{})", 0 - late, detected[r]->within_um, certain ? "" : "; profile unchanged");
  }
  return line;
}

/// How far nozzles lie off, of all that were read.
std::string positions_line(const std::vector<std::optional<Located>>& along,
                           const std::vector<std::optional<Located>>& across) {
  const auto maximum = [](const std::vector<std::optional<Located>>& nozzles) {
    double um = 0;
    for (const auto& one : nozzles) um = std::max(um, one ? std::abs(one->um) : 0);
    return um;
  };
  const auto limit = [](const std::vector<std::optional<Located>>& nozzles) {
    std::vector<double> um;
    for (const auto& one : nozzles) {
      if (one) um.push_back(one->within_um);
    }
    return calibration::median_of(std::move(um));
  };
  const auto read = std::ranges::count_if(along, [](const auto& one) { return one.has_value(); });
  return fmt::format(
      "nozzles   {} read, within {:.0f} um along the scan and {:.0f} across it of the head's line; median 99 % "
      "limits {:.1f} and {:.1f} um",
      read, maximum(along), maximum(across), limit(along), limit(across));
}

/// A length, or that it cannot be determined.
std::string reported(const Json& json, const char* key) {
  return json.at(key).is_null() ? "unreadable" : fmt::format("{:+.0f} um", json.at(key).get<double>());
}
std::string reported_within(const Json& json, const char* key, const char* within) {
  if (json.at(key).is_null()) return "unreadable";
  return fmt::format("{:+.1f} um (within {:.1f})", json.at(key).get<double>(), json.at(within).get<double>());
}

std::vector<std::string> swath_lines(const Json& swaths) {
  std::vector<std::string> lines;
  for (std::size_t s = 0; s < swaths.size(); ++s) {
    const Json& swath = swaths[s];
    if (swath.is_null()) {
      lines.push_back(fmt::format("swath {}   was not printed", s));
    } else if (s > 0) {
      lines.push_back(fmt::format("swath {}   {} across, {} along the scan against the first one", s,
                                  reported_within(swath, "across_um", "across_within_um"),
                                  reported_within(swath, "along_um", "along_within_um")));
    }
  }
  return lines;
}

/// Joints whose verniers and blocks show something else than the swaths' dashes: one of the two was read wrong.
std::vector<std::string> joint_lines(const Json& stitches) {
  std::vector<std::string> lines;
  for (const Json& joint : stitches) {
    if (joint.at("agrees").get<bool>()) continue;
    const auto swath = joint.at("swath").get<std::uint32_t>();
    lines.push_back(fmt::format(
        "stitch {}  shows {} across, {} along the scan from swath {} to {}, unlike its dashes: check it in the photograph",
        swath, reported(joint, "across_um"), reported(joint, "along_um"), swath - 1, swath));
  }
  return lines;
}

std::vector<std::string> take(const Json& json, const Chart& chart, Machine& machine) {
  const auto blocked_nozzles = json.at("blocked").get<std::vector<std::uint32_t>>();
  const auto weak = json.at("weak").get<std::vector<std::uint32_t>>(),
             unreadable = json.at("unreadable").get<std::vector<std::uint32_t>>();
  const Json& nozzles = json.at("nozzles");
  // Nozzles that were not on the chart, or of which nothing was detected, stay blocked.
  std::set<std::uint32_t> blocked(blocked_nozzles.begin(), blocked_nozzles.end());
  for (const std::uint32_t n : machine.head.blocked) {
    if (n < nozzles.size() && nozzles[n].is_null()) blocked.insert(n);
  }
  std::vector<std::string> lines;
  lines.push_back(fmt::format("photo     {:.1f} pixels a mm, half of the dashes within {:.0f} um of their nozzle's position",
                              json.at("pixels_per_mm").get<double>(), json.at("scatter_um").get<double>()));
  const auto read_along = read_nozzles(nozzles, "along_um", "along_error_um", "along_within_um"),
             read_across = read_nozzles(nozzles, "across_um", "across_error_um", "across_within_um");
  lines.push_back(positions_line(read_along, read_across));
  machine.head.blocked.assign(blocked.begin(), blocked.end());
  lines.push_back("blocked   " + list_of(machine.head.blocked));
  if (!weak.empty()) lines.push_back(fmt::format("weak      {}: some dashes missing, not counted as blocked", list_of(weak)));
  if (!unreadable.empty()) lines.push_back("unknown   " + list_of(unreadable) + ": all of their dashes are hidden");
  if (auto rows = correct_rows(read_along, machine); !rows.empty()) lines.push_back(std::move(rows));
  for (std::string& line : swath_lines(json.at("swaths"))) lines.push_back(std::move(line));
  for (std::string& line : joint_lines(json.at("stitches"))) lines.push_back(std::move(line));
  if (const Json* gain = json.find("dot_gain_um")) {
    const double along = gain->at("along").get<double>(), across = gain->at("across").get<double>();
    const bool along_x = machine.mounting.scan_axis == ScanAxis::kX;
    const std::array<double, 2> um{std::round(along_x ? along : across), std::round(along_x ? across : along)};
    lines.push_back(fmt::format("gain      dot gain of {:g} um along x, {:g} um along y: compensate with --bleed {:g}x{:g}",
                                um[0], um[1], std::max(um[0], 0.0), std::max(um[1], 0.0)));
    machine.head.dot_gain_um = um;
  }
  for (const Json& wedge : json.at("wedges")) {
    const double percent = wedge.at("pixels_percent").get<double>(), saturation = saturation_of(percent, chart, machine);
    lines.push_back(fmt::format("wedge     {:g} % of the pixels{}: {:.0f} % of full ink", percent,
                                saturation > 0 ? fmt::format(", {:.1f} % saturation", saturation) : "",
                                wedge.at("detected_percent").get<double>()));
  }
  return lines;
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
    return Error{Fault::kInput, "the measured values give no valid profile: " + (again ? why : why.substr(why.find(": ") + 2))};
  }
  return toml;
}

Result<std::vector<std::string>> take_over(std::string_view reading, const Chart& chart, Machine& machine) {
  try {
    return take(parse_json(reading), chart, machine);
  } catch (const std::exception& error) {
    return Error{Fault::kInternal, std::string("lamina-scan returned an invalid reading: ") + error.what()};
  }
}

double saturation_of(double pixels_percent, const Chart& chart, const Machine& machine) {
  const double stays = 1 - machine.powder.evaporates_percent / 100, drop_um3 = machine.head.drop_pl * 1000 * stays;
  const double voids_um3 =
      chart.pixel_x_nm * 1e-3 * chart.pixel_y_nm * 1e-3 * chart.layer_mm * 1e3 * (1 - machine.powder.packing);
  return voids_um3 > 0 ? pixels_percent * drop_um3 / voids_um3 : 0;
}

}  // namespace lamina::pipeline
