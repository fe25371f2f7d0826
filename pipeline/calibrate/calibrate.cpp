#include "pipeline/calibrate/calibrate.h"

#include <fmt/format.h>

#include <cmath>
#include <filesystem>

#include "pipeline/job/file.h"
#include "pipeline/run/run.h"
#include "stages/formats/stl/mesh_stl.h"
#include "stages/segment/pieces.h"
#include "stages/support/io/file.h"
#include "stages/support/io/temporary.h"
#include "stages/support/text/number_text.h"
#include "stages/support/text/readable.h"

namespace lamina::pipeline {
namespace {

/// What to do with the pieces, step by step, as Markdown. extension  of the pieces' toolpaths
std::string steps_text(const std::vector<segment::TestPiece>& pieces, const segment::PieceRequest& request,
                       std::string_view extension) {
  std::string text = fmt::format(
      "# Calibrating segmented lines\n\n1. Parameters: beads of {} mm, layers of {} mm, the speeds and temperatures of the machine's profile; keep them for all "
      "pieces.\n",
      number_text(request.width_mm), number_text(request.height_mm));
  char step = '1';
  for (const segment::TestPiece& piece : pieces) {
    if (piece.name[0] == '6' && step < '5') {
      text +=
          "5. Spacing: fill in widths.csv, then `lamina calibrate --measured widths.csv --machine MACHINE -o machine.toml`; plan the pieces of steps 6 and 7 "
          "again with `lamina extrude --job FILE --machine machine.toml`.\n";
    }
    text += fmt::format("{}. `{}{}`: {}\n", piece.name[0], piece.name, extension, piece.task);
    step = piece.name[0];
  }
  return text;
}

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
  job.overwrite = request.overwrite;
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

/// What this call has written; removed unless all of it is done.
class Written {
 public:
  explicit Written(bool overwrite) : options_{.replace = overwrite} {}
  Written(const Written&) = delete;
  Written& operator=(const Written&) = delete;
  ~Written() {
    for (const std::string& path : paths_) remove_or_note(path);
  }
  Status write(const std::string& path, std::string_view text) {
    const Status status = write_file(path, text, options_);
    if (status) paths_.push_back(path);
    return status;
  }
  void add(const std::string& path) { paths_.push_back(path); }
  void keep() { paths_.clear(); }

 private:
  FileOptions options_;
  std::vector<std::string> paths_;
};

Status write_piece(const segment::TestPiece& piece, const CalibrationRequest& request, std::string_view extension,
                   Written& written) {
  const fs::path directory = request.directory;
  const std::string stem = (directory / piece.name).string();
  if (Status status = written.write(stem + ".stl", formats::stl::block(piece.size_mm)); !status) return status;
  const Job job = job_of(piece, request, stem, extension);
  const std::string text =
      fmt::format("# {}\n# lamina extrude --job {}.toml\n\n{}", piece.task, piece.name, job_text(job, directory.string()));
  if (Status status = written.write(stem + ".toml", text); !status) return status;
  const std::atomic<bool> never{false};  // a piece takes milliseconds
  const auto summary = run(
      job, Product::kMoves, [](const ProgressEvent&) {}, never);
  if (!summary) return Error{summary.error().fault, fmt::format("{}: {}", piece.name, summary.error().message)};
  for (const std::string& path : {job.output, job.output + ".json", stem + ".rp3"}) written.add(path);
  return {};
}

/// errors  kUsage: a file is there
Status check_absent(const std::vector<segment::TestPiece>& pieces, const fs::path& directory, std::string_view extension) {
  std::vector<std::string> names{"STEPS.md"};
  for (const segment::TestPiece& piece : pieces) {
    for (const std::string& end : {std::string(".stl"), std::string(".toml"), std::string(extension)})
      names.push_back(piece.name + end);
  }
  for (const std::string& name : names) {
    std::error_code ignored;
    if (!fs::exists(fs::symlink_status(directory / name, ignored))) continue;
    return Error{Fault::kUsage, fmt::format("{}: is there already; replace it with --overwrite, or name another directory",
                                            (directory / name).string())};
  }
  return {};
}

}  // namespace

std::string widths_text(const segment::PieceRequest& request) {
  std::string text =
      "# Widths in mm; leave cells empty where nothing was measured, add rows for further thick speeds or repeated measurements.\n"
      "test,percent,thick_speed_percent,region,wall_mm,thick_mm,thin_mm,continuous_mm,stable_mm\n"
      "flow,,,,,,,,\n";
  for (const double percent : request.thin_speeds) text += fmt::format("speed,{},,,,,,,\n", number_text(percent));
  for (const double percent : request.thin_extrusions) text += fmt::format("extrusion,{},,,,,,,\n", number_text(percent));
  for (const double percent : request.extrusions) {
    for (const char* region : {"initial", "central", "final"})
      text += fmt::format("repeated,{},100,{},,,,,\n", number_text(percent), region);
  }
  return text;
}

Result<std::vector<std::string>> write_test_pieces(CalibrationRequest request, const std::atomic<bool>& cancel) {
  const auto profile = machine_of(request);
  if (!profile) return profile.error();
  const fs::path directory = request.directory, widths_path = directory / "widths.csv";
  const std::vector<segment::TestPiece> pieces = segment::test_pieces(request.pieces);
  const std::string extension = profile->machine.format == "sml" ? ".sml" : ".gcode";
  std::error_code failed;
  fs::create_directories(directory, failed);
  if (failed) return Error{Fault::kOutput, fmt::format("{}: {}", request.directory, failed.message())};
  // Begun first and finished last: another run is refused meanwhile.
  auto widths = File::open(widths_path.string(), {.replace = false});
  if (!widths) return widths.error();
  if (fs::exists(fs::symlink_status(widths_path, failed))) {
    return Error{
        Fault::kUsage,
        fmt::format("{}: has a widths.csv already, which may contain measurements; name another directory", request.directory)};
  }
  if (!request.overwrite) {
    if (Status status = check_absent(pieces, directory, extension); !status) return status.error();
  }
  Written written(request.overwrite);
  std::vector<std::string> names;
  for (const segment::TestPiece& piece : pieces) {
    if (cancel) return Error{Fault::kInterrupted, "interrupted; nothing was written"};
    if (Status status = write_piece(piece, request, extension, written); !status) return status.error();
    names.push_back(piece.name);
  }
  const std::string steps = steps_text(pieces, request.pieces, extension);
  if (Status status = written.write((directory / "STEPS.md").string(), steps); !status) return status.error();
  if (Status status = widths->append(widths_text(request.pieces)); !status) return status.error();
  if (const auto whole = widths->finish(); !whole) return whole.error();
  written.keep();
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
                                 one_line(profile->machine.name), pipeline::extruder_text(*profile));
  if (const auto again = read_extruder(toml, "the profile"); !again)
    return Error{Fault::kInput, fmt::format("{}: {}", widths, again.error().message)};
  return CalibratedProfile{std::move(*profile), std::move(toml), std::move(*found)};
}

}  // namespace lamina::pipeline
