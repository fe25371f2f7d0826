#include "stages/segment/pieces.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <utility>

#include "stages/support/io/file_reader.h"
#include "stages/support/text/number_text.h"
#include "stages/support/text/readable.h"
#include "stages/support/text/value.h"

namespace lamina::segment {
namespace {

constexpr double kLineGap = 2;  // between the lines that are measured, edge to edge

/// A block that so many segmented lines fit into, each next to a continuous one: lines one distance from the wall's centre
/// and from each other, and two thirds of a distance to spare (62 and 48 mm for the document's 12 and 9).
double width_for(std::size_t lines, double bead) {
  return std::round((2 * static_cast<double>(lines) + 1 + 2.0 / 3) * (bead + kLineGap) + bead);
}

/// Adjacent lines that are measured one by one.
TestPiece lines_to_measure(std::string name, std::string task, std::array<double, 3> size_mm) {
  TestPiece piece{std::move(name), std::move(task), size_mm};
  piece.gap_mm = kLineGap;
  piece.thick_speed = 100;
  return piece;
}

/// Such lines of one thin segment between two thick ones.
TestPiece thin_intervals(std::string name, std::string task, std::array<double, 3> size_mm) {
  TestPiece piece = lines_to_measure(std::move(name), std::move(task), size_mm);
  piece.thick_mm = 10;
  piece.thin_mm = 30;
  return piece;
}

void add_flow_and_level(const PieceRequest& request, std::vector<TestPiece>& pieces) {
  TestPiece& flow = pieces.emplace_back(
      TestPiece{"2-flow",
                fmt::format("two walls and nothing else; measure the wall in several places (wall_mm): it should be {} mm",
                            number_text(2 * request.width_mm)),
                {20, 20, std::ceil(10 / request.height_mm) * request.height_mm}});
  flow.walls = 2;
  flow.lines = flow.segmented = false;
  TestPiece& level = pieces.emplace_back(
      TestPiece{"3-level",
                fmt::format("lines 5 mm apart on 100 x 100 mm; level the bed until all of them are {} +- 0.01 mm wide",
                            number_text(request.width_mm)),
                {100, 100, request.height_mm}});
  level.walls = 0;
  level.distance_mm = 5;
  level.segmented = false;
}

void add_lines(const PieceRequest& request, std::vector<TestPiece>& pieces) {
  const std::vector<double>&speeds = request.thin_speeds, &extrusions = request.thin_extrusions;
  TestPiece& speed = pieces.emplace_back(thin_intervals(
      "4-speed",
      fmt::format(
          "{} segmented lines, 10 + 30 + 10 mm, thin at {} to {} % of the speed from right to left; on each measure the narrowest place of "
          "the thin segment (thin_mm), the widest one after it (thick_mm), and how far from the start of the thin segment the bead is as wide as "
          "before (stable_mm)",
          speeds.size(), number_text(speeds.front()), number_text(speeds.back())),
      {width_for(speeds.size(), request.width_mm), 50, request.height_mm}));
  speed.thin_speed_sweep = speeds;
  TestPiece& extrusion = pieces.emplace_back(thin_intervals(
      "4-extrusion",
      fmt::format(
          "{} segmented lines, 10 + 30 + 10 mm, thin with {} to {} % of the extrusion from right to left; measure the narrowest place (thin_mm)",
          extrusions.size(), number_text(extrusions.front()), number_text(extrusions.back())),
      {width_for(extrusions.size(), request.width_mm), 50, request.height_mm}));
  extrusion.thin_speed = 100;
  extrusion.thin_extrusion_sweep = extrusions;
  for (const double percent : request.extrusions) {
    pieces.push_back(lines_to_measure(
        fmt::format("4-repeated-{}", number_text(percent)),
        fmt::format(
            "short segments at {} % extrusion; measure thick, thin and continuous lines in the initial, the central and the final region. If they differ by "
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

Error at_row(const Measured& row, const std::string& what) { return {Fault::kInput, fmt::format("row {}: {}", row.row, what)}; }

struct Mean {
  double sum = 0;
  int count = 0;
  void add(double value) {
    sum += value;
    ++count;
  }
  double value() const { return sum / count; }
};

/// The widths of one thick speed: means of the regions, then of all regions alike.
struct Tried {
  std::map<std::string, std::array<Mean, 3>> regions;  // thick, thin, continuous

  std::array<double, 3> means() const {
    std::array<double, 3> of{};
    for (const auto& [name, widths] : regions) {
      for (std::size_t i = 0; i < 3; ++i) of[i] += widths[i].value() / static_cast<double>(regions.size());
    }
    return of;
  }
  double deviation() const {
    double maximum = 0;
    for (std::size_t i = 0; i < 3; ++i) {
      double low = INFINITY, high = 0;
      for (const auto& [name, widths] : regions) {
        low = std::min(low, widths[i].value());
        high = std::max(high, widths[i].value());
      }
      maximum = std::max(maximum, high - low);
    }
    return maximum;
  }
};

std::string percent_text(double percent) { return fmt::format("{:g} %", percent); }

Spacing spacing_of(const Calibration::Repeated& widths, const MeasuringSettings& settings) {
  if (settings.exact_spacing) return spacing_for(widths.thick_mm, widths.continuous_mm, settings.gap_mm);
  return {published_spacing(widths.thick_mm, settings.width_mm) + settings.gap_mm, settings.width_mm + settings.gap_mm};
}

constexpr Word<Measured::Test> kTests[] = {{"flow", Measured::Test::kFlow},
                                           {"speed", Measured::Test::kSpeed},
                                           {"extrusion", Measured::Test::kExtrusion},
                                           {"repeated", Measured::Test::kRepeated}};

constexpr std::string_view kColumns[] = {"test",     "percent", "thick_speed_percent", "region",   "wall_mm",
                                         "thick_mm", "thin_mm", "continuous_mm",       "stable_mm"};

/// Sets one cell. returns "" or what is wrong
std::string set_cell(std::string_view column, const std::string& text, Measured& row) {
  if (column == "test") return read_word(kTests, text, row.test);
  if (column == "region") {
    row.region = text;
    return {};
  }
  if (text.empty()) return {};
  if (column == "percent") return read_number(text, 0.001, 10'000, " %", row.percent);
  if (column == "thick_speed_percent") return read_number(text, 0.001, 10'000, " %", row.thick_speed_percent);
  double value = 0;
  auto wrong = read_number(text, 0.001, 100, " mm", value);
  if (!wrong.empty()) return wrong;
  (column == "wall_mm"         ? row.wall
   : column == "thick_mm"      ? row.thick
   : column == "thin_mm"       ? row.thin
   : column == "continuous_mm" ? row.continuous
                               : row.stable) = value;
  return {};
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

Result<MeasuredMachine> calibrate(const std::vector<Measured>& rows, const MeasuringSettings& settings,
                                  const std::string& source) {
  MeasuredMachine machine;
  Calibration& calibration = machine.calibration;
  calibration = {source, settings.width_mm, settings.height_mm, settings.speed_mm_s, {}, {}, {}, {}};
  Mean walls;
  std::map<double, const Measured*> speeds, extrusions;
  std::map<double, std::map<double, Tried>> repeated;  // by extrusion, then by thick speed
  for (const Measured& row : rows) {
    switch (row.test) {
      case Measured::Test::kFlow:
        if (row.wall) walls.add(*row.wall);
        break;
      case Measured::Test::kSpeed:
        if (!row.thin && !row.stable && !row.thick) break;  // not measured
        if (!row.thin) return at_row(row, "thin_mm is empty; measure the narrowest point of the thin segment");
        if (!row.stable)
          return at_row(
              row, "stable_mm is empty; measure from the start of the thin segment to where the bead is as wide as before");
        if (!row.thick) return at_row(row, "thick_mm is empty; measure the widest point after the thin segment");
        if (row.percent <= 100)
          return at_row(row, fmt::format("percent is {:g}; speeds of thin segments are above 100", row.percent));
        if (!speeds.emplace(row.percent, &row).second)
          return at_row(row, fmt::format("{} is duplicated", percent_text(row.percent)));
        break;
      case Measured::Test::kExtrusion:
        if (!row.thin) break;
        if (row.percent <= 0 || row.percent >= 100)
          return at_row(row, fmt::format("percent is {:g}; extrusions of thin segments are between 0 and 100", row.percent));
        if (!extrusions.emplace(row.percent, &row).second)
          return at_row(row, fmt::format("{} is duplicated", percent_text(row.percent)));
        break;
      case Measured::Test::kRepeated: {
        if (!row.thick && !row.thin && !row.continuous) break;
        const std::array<std::pair<const char*, std::optional<double>>, 3> widths{
            {{"thick_mm", row.thick}, {"thin_mm", row.thin}, {"continuous_mm", row.continuous}}};
        auto& region = repeated[row.percent][row.thick_speed_percent].regions[row.region];
        for (std::size_t i = 0; i < 3; ++i) {
          if (!widths[i].second)
            return at_row(row, fmt::format("{} is empty; measure all three widths of a region", widths[i].first));
          region[i].add(*widths[i].second);
        }
        break;
      }
    }
  }
  if (walls.count == 0 && speeds.empty() && extrusions.empty() && repeated.empty()) {
    return Error{Fault::kInput, "contains no widths; fill in the measurements"};
  }
  if (walls.count > 0) machine.flow = settings.flow * 2 * settings.width_mm / walls.value();
  for (const auto& [percent, row] : speeds) calibration.by_speed.push_back({percent, *row->thin, *row->stable, *row->thick});
  for (const auto& [percent, row] : extrusions)
    calibration.by_extrusion.insert(calibration.by_extrusion.begin(), {percent, *row->thin});
  for (const auto& [extrusion, by_speed] : repeated) {
    const auto best = std::ranges::min_element(by_speed, {}, [](const auto& tried) { return tried.second.deviation(); });
    const auto means = best->second.means();
    Settled settled{{extrusion, settings.thin_speed_percent, best->first, means[0], means[1], means[2]},
                    {},
                    best->second.deviation(),
                    by_speed.size()};
    settled.spacing = spacing_of(settled.widths, settings);
    calibration.repeated.push_back(settled.widths);
    calibration.spacing.push_back({extrusion, settled.spacing.segmented, settled.spacing.continuous});
    if (best->second.regions.size() < 2) {
      machine.advice.push_back(
          fmt::format("extrusion {}: widths of one region only; measure an initial, a central and a final one to see "
                      "whether they change along the part",
                      percent_text(extrusion)));
    } else if (settled.deviation_mm > kAcceptedDeviation + 1e-9) {
      machine.advice.push_back(fmt::format(
          "extrusion {}: widths change by {:.3f} mm along the part at {} of the speed, more than {} mm; print its "
          "piece again with a lower thick speed",
          percent_text(extrusion), settled.deviation_mm, percent_text(by_speed.begin()->first), kAcceptedDeviation));
    }
    machine.settled.push_back(settled);
  }
  if (speeds.empty()) machine.advice.push_back("no widths by speed: the maximum length of a thin segment is unknown");
  if (repeated.empty()) machine.advice.push_back("no widths of repeated segments: spacings cannot follow from them");
  return machine;
}

Result<std::vector<Measured>> read_widths(const std::string& path) {
  auto file = FileReader::open(path, {.fault = Fault::kInput, .max_bytes = kMaxTableBytes, .streams = true});
  if (!file) return file.error();
  const auto wrong = [&](std::size_t line, const std::string& what) {
    return Error{Fault::kInput, line == 0 ? fmt::format("{}: {}", path, what) : fmt::format("{}:{}: {}", path, line, what)};
  };
  std::vector<std::string> names;
  std::vector<Measured> rows;
  char separator = ',';
  for (std::string_view line; file->next(line);) {
    const std::uint64_t number = file->line_number();
    if (line.empty() || line[0] == '#' || line == "\r") continue;
    if (names.empty()) {
      separator = separator_of(line);
      names = cells_of(line, separator);
      for (std::size_t i = 0; i < names.size(); ++i) {
        if (std::ranges::find(kColumns, names[i]) == std::end(kColumns)) {
          return wrong(number, fmt::format("unknown column '{}'; use {}{}", one_line(names[i]), fmt::join(kColumns, ", "),
                                           suggest(names[i], kColumns)));
        }
        if (std::ranges::find(names, names[i]) < names.begin() + static_cast<std::ptrdiff_t>(i))
          return wrong(number, fmt::format("column {} is duplicated", names[i]));
      }
      if (std::ranges::find(names, "test") == names.end())
        return wrong(number, fmt::format("no column test; the header is {}", fmt::join(kColumns, ",")));
      continue;
    }
    const auto cells = cells_of(line, separator);
    if (cells.size() != names.size())
      return wrong(number, fmt::format("{} columns where the header has {}", cells.size(), names.size()));
    Measured row{};
    row.row = number;
    for (std::size_t i = 0; i < cells.size(); ++i) {
      if (const std::string what = set_cell(names[i], cells[i], row); !what.empty())
        return wrong(number, fmt::format("{}: {}", names[i], what));
    }
    rows.push_back(std::move(row));
  }
  if (!file->status()) return file->status().error();
  if (rows.empty()) return wrong(0, "contains no rows; lamina calibrate -o DIR writes a table to fill in");
  return rows;
}

}  // namespace lamina::segment
