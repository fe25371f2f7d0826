// pipeline/job/fill.cpp: the keys of one filling: names, how they are read and written.
#include <fmt/format.h>

#include <algorithm>
#include <iterator>

#include "pipeline/job/fill.h"
#include "pipeline/text/key_text.h"

namespace lamina::pipeline {
namespace {

using Form = KeyForm;
using Text = std::string_view;
using Settings = FillSettings;
using infill::Pattern;

constexpr std::size_t kMostInAList = 1000;

constexpr Word<Pattern> kPatterns[] = {{"none", Pattern::kNone},           {"raster", Pattern::kRaster},
                                       {"contour", Pattern::kContour},     {"contour+raster", Pattern::kContourRaster},
                                       {"honeycomb", Pattern::kHoneycomb}, {"quatrefoil", Pattern::kQuatrefoil}};
constexpr Word<bool> kTurns[] = {{"angle", false}, {"layer", true}};

std::string read_list(Text text, double low, double high, std::vector<double>& values) {
  std::vector<double> read;
  for (Text piece : split(text, ",")) {
    while (piece.starts_with(' ')) piece.remove_prefix(1);
    while (piece.ends_with(' ')) piece.remove_suffix(1);
    double value = 0;
    if (auto wrong = read_number(piece, low, high, " mm", value); !wrong.empty()) return wrong;
    read.push_back(value);
  }
  if (read.size() > kMostInAList) return fmt::format("holds {} numbers; give at most {}", read.size(), kMostInAList);
  values = std::move(read);
  return {};
}

std::string write_numbers(const std::vector<double>& values) {
  std::vector<std::string> texts;
  for (const double value : values) texts.push_back(number_text(value));
  return fmt::format("{}", fmt::join(texts, ","));
}

std::string read_count(Text text, std::int64_t low, std::uint32_t& value) {
  std::int64_t count = 0;
  auto wrong = read_whole(text, low, 1'000'000, count);
  if (wrong.empty()) value = static_cast<std::uint32_t>(count);
  return wrong;
}

std::string read_optional(Text text, double low, std::optional<double>& value) {
  double number = 0;
  auto wrong = read_number(text, low, kMostMm, " mm", number);
  if (wrong.empty()) value = number;
  return wrong;
}
std::string write_optional(const std::optional<double>& value) { return value ? number_text(*value) : std::string(); }

const FillKey kKeys[] = {
    {"pattern", "--pattern", "PATTERN", "none, raster, contour, contour+raster, honeycomb or quatrefoil",
     [](Text t, Settings& s) { return read_word(kPatterns, t, s.pattern); },
     [](const Settings& s) { return write_word(kPatterns, s.pattern); }, Form::kString},
    {"width_mm", "--bead", "MM", "width of a bead",
     [](Text t, Settings& s) { return read_number(t, kLeastMm, 100, " mm", s.width_mm); },
     [](const Settings& s) { return number_text(s.width_mm); }, Form::kBare},
    {"wall_width_mm", "", "MM", "width of a wall's bead; 0 for that of the others",
     [](Text t, Settings& s) { return read_number(t, 0, 100, " mm", s.wall_width_mm); },
     [](const Settings& s) { return number_text(s.wall_width_mm); }, Form::kBare},
    {"walls", "--walls", "N", "number of beads along the surface",
     [](Text t, Settings& s) { return read_count(t, 0, s.walls); },
     [](const Settings& s) { return fmt::format("{}", s.walls); }, Form::kBare},
    {"loops", "", "N", "contour+raster: closed curves before the raster",
     [](Text t, Settings& s) { return read_count(t, 0, s.loops); },
     [](const Settings& s) { return fmt::format("{}", s.loops); }, Form::kBare},
    {"angle_deg", "--angle", "DEG", "direction of the lines of the first layer",
     [](Text t, Settings& s) { return read_number(t, -36000, 36000, " degrees", s.angle_deg); },
     [](const Settings& s) { return number_text(s.angle_deg); }, Form::kBare},
    {"angle_step_deg", "--angle-step", "DEG", "how much the direction turns from layer to layer",
     [](Text t, Settings& s) { return read_number(t, -36000, 36000, " degrees", s.angle_step_deg); },
     [](const Settings& s) { return number_text(s.angle_step_deg); }, Form::kBare},
    {"build_layers", "", "M", "layers in a row with one direction",
     [](Text t, Settings& s) { return read_count(t, 1, s.build_layers); },
     [](const Settings& s) { return fmt::format("{}", s.build_layers); }, Form::kBare},
    {"gap_mm", "--bead-gap", "MM[,MM...]", "from edge to edge of neighbouring beads, may be negative; several in turn",
     [](Text t, Settings& s) { return read_list(t, -100, 1000, s.gap_mm); },
     [](const Settings& s) { return write_numbers(s.gap_mm); }, Form::kList},
    {"distance_mm", "--line-distance", "MM[,MM...]", "from centre to centre of neighbouring lines, in place of gaps",
     [](Text t, Settings& s) { return read_list(t, kLeastMm, 1000, s.distance_mm); },
     [](const Settings& s) { return write_numbers(s.distance_mm); }, Form::kList},
    {"group", "", "N", "beads in contact before each gap", [](Text t, Settings& s) { return read_count(t, 1, s.group); },
     [](const Settings& s) { return fmt::format("{}", s.group); }, Form::kBare},
    {"gap_by_height", "", "Z:MM,Z:MM,...", "gaps at heights above the part's bottom, in proportion between them",
     [](Text t, Settings& s) {
       std::int64_t before = -1;
       for (Text entry : split(t, ",")) {
         while (entry.starts_with(' ')) entry.remove_prefix(1);
         while (entry.ends_with(' ')) entry.remove_suffix(1);
         const auto pair = split(entry, ":");
         double z = 0, gap = 0;
         if (pair.size() != 2) return fmt::format("'{}' is not height:gap, as in 0:0.75,6:0.1", entry);
         if (auto wrong = read_number(pair[0], 0, kMostMm, " mm", z); !wrong.empty()) return wrong;
         if (auto wrong = read_number(pair[1], -100, 1000, " mm", gap); !wrong.empty()) return wrong;
         const auto nm = static_cast<std::int64_t>(z * static_cast<double>(kNmPerMm) + 0.5);
         if (nm <= before) return fmt::format("'{}': heights have to increase", entry);
         before = nm;
       }
       s.gap_by_height = t;
       return std::string();
     },
     [](const Settings& s) { return s.gap_by_height; }, Form::kString},
    {"gap_formula", "--gap-formula", "FORMULA",
     "gap in mm by z, h (height in mm, 0..1), n (layer), i (line), s, u (place across in mm, 0..1), a (degrees)",
     [](Text t, Settings& s) {
       s.gap_formula = t;
       return std::string();
     },
     [](const Settings& s) { return s.gap_formula; }, Form::kString},
    {"stagger_mm", "--stagger", "MM[,MM...]", "lines are moved sideways by these in turn, layer by layer of one direction",
     [](Text t, Settings& s) { return read_list(t, -1000, 1000, s.stagger_mm); },
     [](const Settings& s) { return write_numbers(s.stagger_mm); }, Form::kList},
    {"stagger_by", "", "angle|layer", "the stagger goes on when the direction comes back, or with every layer",
     [](Text t, Settings& s) { return read_word(kTurns, t, s.stagger_every_layer); },
     [](const Settings& s) { return write_word(kTurns, s.stagger_every_layer); }, Form::kString},
    {"first_line_mm", "", "MM", "from the part's side to the first line; else one distance from the wall's centre",
     [](Text t, Settings& s) { return read_optional(t, 0, s.first_line_mm); },
     [](const Settings& s) { return write_optional(s.first_line_mm); }, Form::kBare},
    {"end_inset_mm", "", "MM", "from the wall's centre to the ends of lines; else beads touch the wall",
     [](Text t, Settings& s) { return read_optional(t, 0, s.end_inset_mm); },
     [](const Settings& s) { return write_optional(s.end_inset_mm); }, Form::kBare},
    {"link_mm", "", "MM", "longest way from a line to the next along the edge; 0 for none; else three distances",
     [](Text t, Settings& s) { return read_optional(t, 0, s.link_mm); },
     [](const Settings& s) { return write_optional(s.link_mm); }, Form::kBare},
    {"shortest_mm", "", "MM", "shorter lines are left out",
     [](Text t, Settings& s) { return read_number(t, 0, kMostMm, " mm", s.shortest_mm); },
     [](const Settings& s) { return number_text(s.shortest_mm); }, Form::kBare},
    {"cell_mm", "", "MM", "honeycomb and quatrefoil: cells across flats, centre to centre",
     [](Text t, Settings& s) { return read_number(t, 0.01, 1000, " mm", s.cell_mm); },
     [](const Settings& s) { return number_text(s.cell_mm); }, Form::kBare},
};

constexpr Text kDistanceKeys[] = {"distance_mm", "gap_formula", "gap_by_height", "gap_mm"};

}  // namespace

std::span<const FillKey> fill_settings_keys() { return kKeys; }

std::vector<std::string_view> distance_keys(const FillSettings& settings) {
  std::vector<std::string_view> names;
  if (!settings.distance_mm.empty()) names.push_back("distance_mm");
  if (!settings.gap_formula.empty()) names.push_back("gap_formula");
  if (!settings.gap_by_height.empty()) names.push_back("gap_by_height");
  if (settings.gap_mm != std::vector<double>{0}) names.push_back("gap_mm");
  return names;
}

std::string read_fill_changes(std::string_view text, FillSettings& settings) {
  std::vector<std::string_view> distances;
  for (const std::string_view change : split(text, " ")) {
    if (change.empty()) continue;
    const std::size_t equals = change.find('=');
    if (equals == std::string_view::npos) return fmt::format("'{}' is not key=value, as in gap_mm=0.2", change);
    const std::string_view name = change.substr(0, equals);
    std::vector<std::string_view> names;
    const FillKey* found = nullptr;
    for (const FillKey& key : kKeys) {
      names.push_back(key.name);
      if (key.name == name) found = &key;
    }
    if (found == nullptr) return fmt::format("'{}' is no key of a filling{}", name, suggest(name, names));
    if (const std::string wrong = found->read(change.substr(equals + 1), settings); !wrong.empty()) {
      return fmt::format("{}: {}", name, wrong);
    }
    if (std::ranges::find(kDistanceKeys, name) != std::end(kDistanceKeys)) distances.push_back(name);
  }
  if (distances.empty()) return {};
  for (const std::string_view other : distances) {
    if (other == distances[0]) continue;
    return fmt::format("{} and {} both say how far lines lie from each other; give one of them", distances[0], other);
  }
  if (distances[0] != "distance_mm") settings.distance_mm.clear();
  if (distances[0] != "gap_formula") settings.gap_formula.clear();
  if (distances[0] != "gap_by_height") settings.gap_by_height.clear();
  if (distances[0] != "gap_mm") settings.gap_mm = {0};
  return {};
}

}  // namespace lamina::pipeline
