#include "pipeline/calibrate/calibrate.h"

#include <fmt/format.h>

#include <cmath>
#include <filesystem>

#include "pipeline/job/file.h"
#include "pipeline/run/run.h"
#include "stages/data/text/readable.h"
#include "stages/segment/widths_table.h"
#include "stages/write/file.h"
#include "stages/write/stl/block.h"

namespace lamina::pipeline {
namespace {

namespace fs = std::filesystem;

/// Finds the printer and sets the request's default bead from it.
Result<ExtruderProfile> machine_of(CalibrationRequest& request) {
  auto profile = find_extruder(request.machine);
  if (!profile) return Error{profile.error().fault, "--machine: " + profile.error().message};
  segment::PieceRequest& bead = request.pieces;
  if (bead.width_mm <= 0) bead.width_mm = profile->machine.material.nozzle_mm;
  if (bead.height_mm <= 0) bead.height_mm = std::round(bead.width_mm * 750) / 1000;
  return profile;
}

/// The job of a piece; `stem` begins the names of its files.
Job job_of(const segment::TestPiece& piece, const CalibrationRequest& request, const std::string& stem,
           std::string_view extension) {
  Job job;
  job.machine.profile = request.machine;
  if (request.machine.ends_with(".toml") || request.machine.find('/') != std::string::npos)
    job.machine.profile = fs::absolute(request.machine).string();
  job.layer_mm = request.pieces.height_mm;
  job.quiet = true;
  job.parts = {{.path = stem + ".stl"}};
  job.output = fmt::format("{}{}", stem, extension);
  job.overwrite = true;  // replaces pieces of an earlier call
  FillSettings& fill = job.fill.all;
  fill.width_mm = request.pieces.width_mm;
  fill.walls = piece.walls;
  fill.angle_deg = 90;
  fill.angle_step_deg = 0;
  if (piece.lines) fill.pattern = infill::Pattern::kRaster;
  if (piece.gap_mm) fill.gap_mm = {*piece.gap_mm};
  if (piece.distance_mm) {
    fill.distance_mm = {*piece.distance_mm};
    fill.first_line_mm = *piece.distance_mm / 2;
  }
  SegmentSettings& segment = job.segment.all;
  segment.on = piece.segmented;
  if (piece.thin_mm) {
    segment.rule = segment::CutRule::kThickEnds;
    segment.thick_mm = *piece.thick_mm;
    segment.thin_mm = *piece.thin_mm;
  }
  segment.thick_extrusion = piece.thick_extrusion;
  segment.thick_speed = piece.thick_speed;
  segment.thin_speed = piece.thin_speed.value_or(segment.thin_speed);
  segment.thin_speed_sweep = piece.thin_speed_sweep;
  segment.thin_extrusion_sweep = piece.thin_extrusion_sweep;
  return job;
}

}  // namespace

Result<std::vector<std::string>> write_test_pieces(CalibrationRequest request, const std::atomic<bool>& cancel) {
  const auto profile = machine_of(request);
  if (!profile) return profile.error();
  const fs::path directory = request.directory;
  std::error_code failed;
  if (fs::exists(directory / "widths.csv", failed)) {
    return Error{Fault::kUsage, fmt::format("{}: has a widths.csv already, which may hold measurements; name another directory",
                                            request.directory)};
  }
  fs::create_directories(directory, failed);
  if (failed) return Error{Fault::kOutput, fmt::format("{}: {}", request.directory, failed.message())};
  const std::vector<segment::TestPiece> pieces = segment::test_pieces(request.pieces);
  const std::string extension = profile->machine.format == "sml" ? ".sml" : ".gcode";
  std::vector<std::string> names;
  for (const segment::TestPiece& piece : pieces) {
    const std::string stem = (directory / piece.name).string();
    if (Status status = write::write_file(stem + ".stl", write::stl::block(piece.size_mm)); !status) return status.error();
    const Job job = job_of(piece, request, stem, extension);
    const std::string text =
        fmt::format("# {}\n# lamina extrude --job {}.toml\n\n{}", piece.task, piece.name, job_text(job, directory.string()));
    if (Status status = write::write_file(stem + ".toml", text); !status) return status.error();
    const auto summary = run(
        job, Product::kMoves, [](const ProgressEvent&) {}, cancel);
    if (!summary) return Error{summary.error().fault, fmt::format("{}: {}", piece.name, summary.error().message)};
    names.push_back(piece.name);
  }
  for (const auto& [name, text] : {std::pair{"STEPS.md", segment::steps_text(pieces, request.pieces, extension)},
                                   {"widths.csv", segment::widths_text(request.pieces)}}) {
    if (Status status = write::write_file((directory / name).string(), text); !status) return status.error();
  }
  return names;
}

Result<CalibratedProfile> calibrate_profile(CalibrationRequest request, const std::string& widths, double gap_mm, bool exact) {
  auto profile = machine_of(request);
  if (!profile) return Error{Fault::kUsage, profile.error().message};
  const auto rows = segment::read_widths(widths);
  if (!rows) return rows.error();
  segment::MeasuringSettings settings;
  settings.width_mm = request.pieces.width_mm;
  settings.height_mm = request.pieces.height_mm;
  settings.speed_mm_s = profile->machine.speed.print_mm_s;
  settings.flow = profile->machine.material.flow;
  settings.gap_mm = gap_mm;
  settings.exact_spacing = exact;
  auto found = segment::calibrate(*rows, settings, fmt::format("measured on {}", profile->machine.name));
  if (!found) return Error{found.error().fault, fmt::format("{}: {}", widths, found.error().message)};
  profile->calibration = found->calibration;
  profile->own_calibration = true;
  if (found->flow) profile->machine.material.flow = std::round(*found->flow * 1000) / 1000;
  std::string toml = fmt::format("# {} with what was measured on it. Made by lamina calibrate.\n\n{}",
                                 one_line(profile->machine.name), read::extruder_text(*profile));
  if (const auto again = read_extruder(toml, "the profile"); !again)
    return Error{Fault::kInput, fmt::format("{}: {}", widths, again.error().message)};
  return CalibratedProfile{std::move(*profile), std::move(toml), std::move(*found)};
}

}  // namespace lamina::pipeline
