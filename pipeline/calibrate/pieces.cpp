#include "pipeline/calibrate/pieces.h"

#include <fmt/format.h>

#include <array>
#include <cmath>
#include <filesystem>
#include <span>

#include "pipeline/job/file.h"
#include "pipeline/machine/extruder.h"
#include "pipeline/run/run.h"
#include "pipeline/text/number_text.h"
#include "stages/segment/measured.h"
#include "stages/write/file.h"
#include "stages/write/stl/block.h"

namespace lamina::pipeline {
namespace {

namespace fs = std::filesystem;

constexpr double kLineGap = 2;  // between the lines that are measured, edge to edge

/// A block that so many segmented lines fit into, each beside a continuous one: lines one distance from the wall's centre
/// and from each other, and two thirds of a distance to spare (62 and 48 mm for the document's 12 and 9).
double width_for(std::size_t lines, double bead) {
  return std::round((2 * static_cast<double>(lines) + 1 + 2.0 / 3) * (bead + kLineGap) + bead);
}

std::string steps_text(const std::vector<TestPiece>& pieces, const CalibrationRequest& request, std::string_view extension) {
  std::string text = fmt::format(
      "# Calibrating segmented lines\n\n1. Parameters: beads of {} mm, layers of {} mm, the speeds and temperatures of the machine's profile; keep them for all "
      "pieces.\n",
      number_text(request.width_mm), number_text(request.height_mm));
  char step = '1';
  for (const TestPiece& piece : pieces) {
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

std::string widths_text(const CalibrationRequest& request) {
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

/// The pieces of a calibration, in the order of its steps.
class PieceList {
 public:
  PieceList(const CalibrationRequest& request, Job base)
      : request_(request), base_(std::move(base)), bead_(request.width_mm), height_(request.height_mm) {}

  std::vector<TestPiece> take() {
    add_flow_and_level();
    add_lines();
    add_layers();
    return std::move(pieces_);
  }

 private:
  template <class Change>
  void add(std::string name, std::string task, std::array<double, 3> size, const Change& change) {
    TestPiece& piece = pieces_.emplace_back(TestPiece{std::move(name), std::move(task), size, base_});
    change(piece.job.fill.all, piece.job.segment.all);
  }

  static void set_line(FillSettings& fill, SegmentSettings& segment) {
    fill.pattern = infill::Pattern::kRaster;
    fill.gap_mm = {kLineGap};
    segment.on = true;
    segment.thick_speed = 100;
  }

  /// Lines of one thin stretch between two thick ones.
  static void set_thin_stretch(FillSettings& fill, SegmentSettings& segment) {
    set_line(fill, segment);
    segment.rule = segment::CutRule::kThickEnds;
    segment.thick_mm = 10;
    segment.thin_mm = 30;
  }

  void add_flow_and_level() {
    add("2-flow",
        fmt::format("two walls and nothing else; measure the wall in several places (wall_mm): it should be {} mm",
                    number_text(2 * bead_)),
        {20, 20, std::ceil(10 / height_) * height_}, [](FillSettings& fill, SegmentSettings&) { fill.walls = 2; });
    add("3-level",
        fmt::format("lines 5 mm apart on 100 x 100 mm; level the bed until all of them are {} +- 0.01 mm wide",
                    number_text(bead_)),
        {100, 100, height_}, [&](FillSettings& fill, SegmentSettings&) {
          fill.walls = 0;
          fill.pattern = infill::Pattern::kRaster;
          fill.distance_mm = {5};
          fill.first_line_mm = 2.5;
        });
  }

  void add_lines() {
    add("4-speed",
        fmt::format(
            "{} segmented lines, 10 + 30 + 10 mm, thin at {} to {} % of the speed from right to left; on each measure the narrowest place of "
            "the thin stretch (thin_mm), the widest one after it (thick_mm), and how far from the start of the thin stretch the bead is as wide as "
            "before (stable_mm)",
            request_.thin_speeds.size(), number_text(request_.thin_speeds.front()), number_text(request_.thin_speeds.back())),
        {width_for(request_.thin_speeds.size(), bead_), 50, height_}, [&](FillSettings& fill, SegmentSettings& segment) {
          set_thin_stretch(fill, segment);
          segment.thin_speed_sweep = request_.thin_speeds;
        });
    add("4-extrusion",
        fmt::format(
            "{} segmented lines, 10 + 30 + 10 mm, thin with {} to {} % of the extrusion from right to left; measure the narrowest place (thin_mm)",
            request_.thin_extrusions.size(), number_text(request_.thin_extrusions.front()),
            number_text(request_.thin_extrusions.back())),
        {width_for(request_.thin_extrusions.size(), bead_), 50, height_}, [&](FillSettings& fill, SegmentSettings& segment) {
          set_thin_stretch(fill, segment);
          segment.thin_speed = 100;
          segment.thin_extrusion_sweep = request_.thin_extrusions;
        });
    for (const double extrusion : request_.extrusions) {
      add(fmt::format("4-repeated-{}", number_text(extrusion)),
          fmt::format(
              "short stretches at {} % extrusion; measure thick, thin and continuous lines in the initial, the central and the final region. If they differ by "
              "more than {} mm, plan it again with `lamina extrude --job FILE --thick-speed PERCENT`, lower, and add rows for that speed",
              number_text(extrusion), segment::kAcceptedDeviation),
          {50, 28, height_}, [&](FillSettings& fill, SegmentSettings& segment) {
            set_line(fill, segment);
            segment.thick_extrusion = extrusion;
          });
    }
  }

  void add_layers() {
    for (const int layers : {1, 5, 10}) {
      for (const double extrusion : request_.extrusions) {
        add(fmt::format("{}-{}-{}", layers == 1 ? "6-layer" : "7-layers", layers == 1 ? "1" : fmt::format("{}", layers),
                        number_text(extrusion)),
            layers == 1
                ? fmt::format(
                      "one layer at {} % extrusion with the spacing that follows from the widths; closed pores: larger spacing, beads apart: smaller",
                      number_text(extrusion))
                : fmt::format("{} layers at {} % extrusion", layers, number_text(extrusion)),
            {50, 28, layers * height_}, [&](FillSettings& fill, SegmentSettings& segment) {
              fill.pattern = infill::Pattern::kRaster;
              segment.on = true;
              segment.thick_extrusion = extrusion;
            });
      }
    }
  }

  const CalibrationRequest& request_;
  const Job base_;
  const double bead_, height_;
  std::vector<TestPiece> pieces_;
};

}  // namespace

CalibrationRequest preset_calibration() {
  CalibrationRequest request;
  for (int percent = 125; percent <= 400; percent += 25) request.thin_speeds.push_back(percent);
  for (int percent = 90; percent >= 10; percent -= 10) request.thin_extrusions.push_back(percent);
  request.extrusions = {75, 100, 125};
  return request;
}

void resolve_bead(CalibrationRequest& request, const ExtruderProfile& profile) {
  if (request.width_mm <= 0) request.width_mm = profile.machine.material.nozzle_mm;
  if (request.height_mm <= 0) request.height_mm = std::round(request.width_mm * 750) / 1000;
}

std::vector<TestPiece> test_pieces(const CalibrationRequest& request) {
  Job base;
  base.machine.profile = request.machine;
  if (request.machine.ends_with(".toml") || request.machine.find('/') != std::string::npos)
    base.machine.profile = fs::absolute(request.machine).string();
  base.layer_mm = request.height_mm;
  base.quiet = true;
  base.fill.all.width_mm = request.width_mm;
  base.fill.all.walls = 1;
  base.fill.all.angle_deg = 90;
  base.fill.all.angle_step_deg = 0;
  return PieceList(request, std::move(base)).take();
}

Result<std::vector<std::string>> write_test_pieces(const CalibrationRequest& asked, const std::atomic<bool>& cancel) {
  CalibrationRequest request = asked;
  const auto profile = find_extruder(request.machine);
  if (!profile) return Error{profile.error().fault, "--machine: " + profile.error().message};
  const fs::path directory = request.directory;
  std::error_code failed;
  if (fs::exists(directory / "widths.csv", failed)) {
    return Error{Fault::kUsage, fmt::format("{}: has a widths.csv already, which may hold measurements; name another directory",
                                            request.directory)};
  }
  fs::create_directories(directory, failed);
  if (failed) return Error{Fault::kOutput, fmt::format("{}: {}", request.directory, failed.message())};
  resolve_bead(request, *profile);
  std::vector<TestPiece> pieces = test_pieces(request);
  const std::string extension = profile->machine.format == "sml" ? ".sml" : ".gcode";
  std::vector<std::string> names;
  for (TestPiece& piece : pieces) {
    const fs::path stem = directory / piece.name;
    if (Status status = write::write_file(stem.string() + ".stl", write::stl::block(piece.size_mm)); !status)
      return status.error();
    piece.job.parts = {{.path = stem.string() + ".stl"}};
    piece.job.output = stem.string() + extension;
    piece.job.overwrite = true;  // the pieces of an earlier call in this directory
    const std::string job = fmt::format("# {}\n# lamina extrude --job {}.toml\n\n{}", piece.task, piece.name,
                                        job_text(piece.job, directory.string()));
    if (Status status = write::write_file(stem.string() + ".toml", job); !status) return status.error();
    const auto summary = run(
        piece.job, Product::kMoves, [](const ProgressEvent&) {}, cancel);
    if (!summary) return Error{summary.error().fault, fmt::format("{}: {}", piece.name, summary.error().message)};
    names.push_back(piece.name);
  }
  if (Status status = write::write_file((directory / "STEPS.md").string(), steps_text(pieces, request, extension)); !status)
    return status.error();
  if (Status status = write::write_file((directory / "widths.csv").string(), widths_text(request)); !status)
    return status.error();
  return names;
}

}  // namespace lamina::pipeline
