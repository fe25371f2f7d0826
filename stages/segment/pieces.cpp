#include "stages/segment/pieces.h"

#include <fmt/format.h>

#include <cmath>

#include "stages/segment/measured.h"
#include "stages/support/text/number_text.h"

namespace lamina::segment {
namespace {

constexpr double kLineGap = 2;  // between the lines that are measured, edge to edge

/// A block that so many segmented lines fit into, each beside a continuous one: lines one distance from the wall's centre
/// and from each other, and two thirds of a distance to spare (62 and 48 mm for the document's 12 and 9).
double width_for(std::size_t lines, double bead) {
  return std::round((2 * static_cast<double>(lines) + 1 + 2.0 / 3) * (bead + kLineGap) + bead);
}

/// Lines beside each other that are measured one by one.
TestPiece lines_to_measure(std::string name, std::string task, std::array<double, 3> size_mm) {
  TestPiece piece{std::move(name), std::move(task), size_mm};
  piece.gap_mm = kLineGap;
  piece.thick_speed = 100;
  return piece;
}

/// Such lines of one thin stretch between two thick ones.
TestPiece thin_intervals(std::string name, std::string task, std::array<double, 3> size_mm) {
  TestPiece piece = lines_to_measure(std::move(name), std::move(task), size_mm);
  piece.thick_mm = 10;
  piece.thin_mm = 30;
  return piece;
}

void add_flow_and_level(const PieceRequest& request, std::vector<TestPiece>& pieces) {
  TestPiece flow{"2-flow",
                 fmt::format("two walls and nothing else; measure the wall in several places (wall_mm): it should be {} mm",
                             number_text(2 * request.width_mm)),
                 {20, 20, std::ceil(10 / request.height_mm) * request.height_mm}};
  flow.walls = 2;
  flow.lines = flow.segmented = false;
  TestPiece level{"3-level",
                  fmt::format("lines 5 mm apart on 100 x 100 mm; level the bed until all of them are {} +- 0.01 mm wide",
                              number_text(request.width_mm)),
                  {100, 100, request.height_mm}};
  level.walls = 0;
  level.distance_mm = 5;
  level.segmented = false;
  pieces.push_back(std::move(flow));
  pieces.push_back(std::move(level));
}

void add_lines(const PieceRequest& request, std::vector<TestPiece>& pieces) {
  const std::vector<double>&speeds = request.thin_speeds, &extrusions = request.thin_extrusions;
  TestPiece speed = thin_intervals(
      "4-speed",
      fmt::format(
          "{} segmented lines, 10 + 30 + 10 mm, thin at {} to {} % of the speed from right to left; on each measure the narrowest place of "
          "the thin stretch (thin_mm), the widest one after it (thick_mm), and how far from the start of the thin stretch the bead is as wide as "
          "before (stable_mm)",
          speeds.size(), number_text(speeds.front()), number_text(speeds.back())),
      {width_for(speeds.size(), request.width_mm), 50, request.height_mm});
  speed.thin_speed_sweep = speeds;
  TestPiece extrusion = thin_intervals(
      "4-extrusion",
      fmt::format(
          "{} segmented lines, 10 + 30 + 10 mm, thin with {} to {} % of the extrusion from right to left; measure the narrowest place (thin_mm)",
          extrusions.size(), number_text(extrusions.front()), number_text(extrusions.back())),
      {width_for(extrusions.size(), request.width_mm), 50, request.height_mm});
  extrusion.thin_speed = 100;
  extrusion.thin_extrusion_sweep = extrusions;
  pieces.push_back(std::move(speed));
  pieces.push_back(std::move(extrusion));
  for (const double percent : request.extrusions) {
    pieces.push_back(lines_to_measure(
        fmt::format("4-repeated-{}", number_text(percent)),
        fmt::format(
            "short stretches at {} % extrusion; measure thick, thin and continuous lines in the initial, the central and the final region. If they differ by "
            "more than {} mm, plan it again with `lamina extrude --job FILE --thick-speed PERCENT`, lower, and add rows for that speed",
            number_text(percent), kAcceptedDeviation),
        {50, 28, request.height_mm}));
    pieces.back().thick_extrusion = percent;
  }
}

void add_layers(const PieceRequest& request, std::vector<TestPiece>& pieces) {
  for (const int layers : {1, 5, 10}) {
    for (const double percent : request.extrusions) {
      pieces.push_back(
          {fmt::format("{}-{}-{}", layers == 1 ? "6-layer" : "7-layers", layers, number_text(percent)),
           layers == 1
               ? fmt::format(
                     "one layer at {} % extrusion with the spacing that follows from the widths; closed pores: larger spacing, beads apart: smaller",
                     number_text(percent))
               : fmt::format("{} layers at {} % extrusion", layers, number_text(percent)),
           {50, 28, layers * request.height_mm}});
      pieces.back().thick_extrusion = percent;
    }
  }
}

}  // namespace

PieceRequest preset_pieces() {
  PieceRequest request;
  for (int percent = 125; percent <= 400; percent += 25) request.thin_speeds.push_back(percent);
  for (int percent = 90; percent >= 10; percent -= 10) request.thin_extrusions.push_back(percent);
  request.extrusions = {75, 100, 125};
  return request;
}

std::vector<TestPiece> test_pieces(const PieceRequest& request) {
  std::vector<TestPiece> pieces;
  add_flow_and_level(request, pieces);
  add_lines(request, pieces);
  add_layers(request, pieces);
  return pieces;
}

}  // namespace lamina::segment
