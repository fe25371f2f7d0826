#include "pipeline/job/keys.h"

namespace lamina::pipeline {

// Section [fill]: the keys of one filling, then the keys of the whole section.

namespace {

using infill::Pattern;
using infill::Seam;

constexpr Word<Pattern> kPatterns[] = {{"none", Pattern::kNone},           {"raster", Pattern::kRaster},
                                       {"contour", Pattern::kContour},     {"contour+raster", Pattern::kContourRaster},
                                       {"honeycomb", Pattern::kHoneycomb}, {"quatrefoil", Pattern::kQuatrefoil},
                                       {"lines", Pattern::kLines},         {"grid", Pattern::kGrid},
                                       {"gyroid", Pattern::kGyroid}};
constexpr Word<bool> kTurns[] = {{"angle", false}, {"layer", true}};

constexpr Limits kFillLength{0, kMaxMm, " mm"}, kWidth{kMinMm, 100, " mm"}, kAngle{-36000, 36000, " degrees"},
    kCount{0, 1'000'000}, kOneAndMore{1, 1'000'000};

/// A list of one to a thousand lengths.
constexpr Limits list_of(double low, double high, std::size_t minimum = 1) { return {low, high, " mm", false, minimum, 1000}; }

std::string check_nothing(std::string_view) { return {}; }

std::string read_gaps_by_height(const TomlValue& list, std::vector<std::array<double, 2>>& gaps, TextPosition& at) {
  if (!list.is_list()) return "is a list of heights and gaps, as in [[0, 0.75], [6, 0.1]]";
  std::vector<std::array<double, 2>> read;
  for (const TomlValue& entry : list.value) {
    at = entry.position;
    if (!entry.is_list() || entry.value.size() != 2) return "holds what is not a height and a gap, as in [[0, 0.75], [6, 0.1]]";
    auto& [z, gap] = read.emplace_back();
    if (auto wrong = read_number(entry.value[0].text, 0, kMaxMm, " mm", z); !wrong.empty()) return wrong;
    if (auto wrong = read_number(entry.value[1].text, -100, 1000, " mm", gap); !wrong.empty()) return wrong;
    if (read.size() > 1 && nm_of(z) <= nm_of(read[read.size() - 2][0])) {
      return fmt::format("[{}, {}]: heights have to increase", number_text(z), number_text(gap));
    }
  }
  gaps = std::move(read);
  return {};
}
std::string gaps_by_height_text(const std::vector<std::array<double, 2>>& gaps) {
  std::string text;
  for (const auto& [z, gap] : gaps) {
    text += fmt::format("{}[{}, {}]", text.empty() ? "" : ", ", number_text(z), number_text(gap));
  }
  return text.empty() ? text : fmt::format("[{}]", text);
}

constexpr Word<Seam> kSeams[] = {
    {"contour", Seam::kContour}, {"aligned", Seam::kAligned}, {"rear", Seam::kRear}, {"nearest", Seam::kNearest}};

constexpr Key<FillSettings> kFillKeys[] = {
    word<kPatterns, &FillSettings::pattern>(
        {"fill", "pattern", "--pattern", "PATTERN",
         "fill pattern: none, raster, contour, contour+raster, honeycomb, quatrefoil; lines, grid, gyroid of a density"}),
    field<&FillSettings::width_mm>({"fill", "width_mm", "--bead", "MM", "bead width in mm"}, kWidth),
    field<&FillSettings::wall_width_mm>({"fill", "wall_width_mm", "", "MM", "width of a wall's bead; 0 for that of the others"},
                                        {0, 100, " mm"}),
    field<&FillSettings::walls>({"fill", "walls", "--walls", "N", "number of wall beads along the surface"}, kCount),
    word<kSeams, &FillSettings::seam>({"fill", "seam", "--seam", "contour|aligned|rear|nearest", "where walls begin and end"})
        .unsaid_at("contour"),
    field<&FillSettings::loops>({"fill", "loops", "", "N", "contour+raster: closed curves before the raster"}, kCount),
    field<&FillSettings::angle_deg>(
        {"fill", "angle_deg", "--angle", "DEG", "line direction of the first layer in degrees from x"}, kAngle),
    field<&FillSettings::angle_step_deg>(
        {"fill", "angle_step_deg", "--angle-step", "DEG", "rotation of lines between layers in degrees"}, kAngle),
    field<&FillSettings::build_layers>({"fill", "build_layers", "", "M", "layers in a row with one direction"}, kOneAndMore),
    field<&FillSettings::gap_mm>(
        {"fill", "gap_mm", "--bead-gap", "MM[,MM...]", "gaps between bead edges in mm, cyclic; negative: overlap"},
        list_of(-100, 1000)),
    field<&FillSettings::distance_mm>({"fill", "distance_mm", "--line-distance", "MM[,MM...]",
                                       "spacing of line centres in mm, cyclic; instead of --bead-gap"},
                                      list_of(kMinMm, 1000, 0)),
    field<&FillSettings::group>({"fill", "group", "", "N", "beads in contact before each gap"}, kOneAndMore),
    structure<read_gaps_by_height, gaps_by_height_text, &FillSettings::gap_by_height>(
        {"fill", "gap_by_height", "", "[[Z,MM],...]", "gaps at heights above the part's bottom, in proportion between them"}),
    text<check_nothing, &FillSettings::gap_formula>({"fill", "gap_formula", "--gap-formula", "FORMULA",
                                                     "gap in mm, formula of z, h, n, i, s, u, a (docs/reference/filling.md)"}),
    field<&FillSettings::stagger_mm>(
        {"fill", "stagger_mm", "--stagger", "MM[,MM...]", "sideways shifts of lines in mm, cyclic over layers"},
        list_of(-1000, 1000)),
    word<kTurns, &FillSettings::stagger_every_layer>(
        {"fill", "stagger_by", "", "angle|layer", "the stagger continues when the direction comes back, or with every layer"}),
    field<&FillSettings::first_line_mm>(
        {"fill", "first_line_mm", "", "MM", "from the part's side to the first line; else one distance from the wall's centre"},
        kFillLength),
    field<&FillSettings::end_inset_mm>(
        {"fill", "end_inset_mm", "", "MM", "from the wall's centre to the ends of lines; else beads touch the wall"},
        kFillLength),
    field<&FillSettings::link_mm>(
        {"fill", "link_mm", "", "MM", "longest way from a line to the next along the edge; 0 for none; else three distances"},
        kFillLength),
    field<&FillSettings::shortest_mm>({"fill", "shortest_mm", "", "MM", "shorter lines are left out"}, kFillLength),
    field<&FillSettings::cell_mm>(
        {"fill", "cell_mm", "", "MM", "honeycomb and quatrefoil: cells across flats, centre to centre"}, {0.01, 1000, " mm"}),
    field<&FillSettings::density_percent>(
        {"fill", "density_percent", "--density", "%", "bead volume in % of the volume inside the walls"}, {0, 100, " %"}),
    field<&FillSettings::top_mm>({"fill", "top_mm", "", "MM", "with a density: thickness of solid skins below top faces"},
                                 {0, 1000, " mm"})
        .unsaid_at("0.8"),
    field<&FillSettings::bottom_mm>(
        {"fill", "bottom_mm", "", "MM", "with a density: thickness of solid skins above bottom faces"}, {0, 1000, " mm"})
        .unsaid_at("0.6"),
    field<&FillSettings::top_layers>(
        {"fill", "top_layers", "--top-layers", "N", "number of solid layers below top faces; default: 0.8 mm"}, {0, 10'000}),
    field<&FillSettings::bottom_layers>(
        {"fill", "bottom_layers", "--bottom-layers", "N", "number of solid layers above bottom faces; default: 0.6 mm"},
        {0, 10'000}),
};

constexpr std::string_view kDistanceKeys[] = {"distance_mm", "gap_formula", "gap_by_height", "gap_mm", "density_percent"};

/// Without effect on lines that follow from a density (check() in stages/infill/fill.h refuses them).
constexpr std::string_view kOfGaps[] = {"group", "stagger_mm", "first_line_mm", "end_inset_mm", "link_mm"};

/// Two mutually exclusive keys of one table.
std::string check_distances(const FillChanges& changes) {
  const auto keys = distance_keys(changes);
  if (keys.size() < 2) return {};
  return fmt::format("{} and {} both say how far lines lie from each other; give one of them", keys[0], keys[1]);
}

std::string read_fill_ranges(const TomlValue& list, std::vector<FillRange>& ranges, TextPosition& at) {
  std::vector<FillRange> read;
  if (auto wrong = read_ranges<FillSettings>(list, kFillKeys, read, at); !wrong.empty()) return wrong;
  for (const FillRange& range : read) {
    if (auto wrong = check_distances(range.changes); !wrong.empty()) {
      return fmt::format("{}: {}", range_name(range.from_mm, range.to_mm), wrong);
    }
  }
  ranges = std::move(read);
  return {};
}
std::string fill_ranges_text(const std::vector<FillRange>& ranges) { return ranges_text<FillSettings>(kFillKeys, ranges); }

}  // namespace

std::span<const Key<FillSettings>> fill_settings_keys() { return kFillKeys; }

std::span<const JobKey> fill_keys() {
  static const std::vector<JobKey> keys = [] {
    std::vector<JobKey> all;
    for (const auto& key : kFillKeys) {
      all.push_back(inside<&Job::fill, &FillRequest::all>(key, "fill", decides::contours | decides::moves));
    }
    all.push_back(structure<read_fill_ranges, fill_ranges_text, &Job::fill, &FillRequest::ranges>(
        {"fill", "range", "", "[{...}]", "other keys between two heights: from_mm, to_mm and the keys that differ",
         decides::contours | decides::moves}));
    return all;
  }();
  return keys;
}

std::string read_fill_changes(const TomlValue& table, FillChanges& changes, TextPosition& at) {
  FillChanges read;
  if (auto wrong = read_changes<FillSettings>(table, kFillKeys, read, at); !wrong.empty()) return wrong;
  if (auto wrong = check_distances(read); !wrong.empty()) return wrong;
  changes = std::move(read);
  return {};
}

std::string fill_changes_text(const FillChanges& changes) {
  return changes.empty() ? std::string() : fmt::format("{{ {} }}", changes_text<FillSettings>(kFillKeys, changes));
}

void apply(const FillChanges& changes, FillSettings& settings) {
  const auto reset = [&](std::span<const std::string_view> names) {
    const FillSettings plain;
    for (const auto& key : kFillKeys) {
      if (std::ranges::find(names, key.name) != names.end()) key.copy(plain, settings);
    }
  };
  if (!distance_keys(changes).empty()) reset(kDistanceKeys);
  if (names_key(changes, "density_percent")) reset(kOfGaps);
  const bool takes_gaps =
      names_key(changes, "pattern") && !needs_density(changes.values.pattern) && changes.values.pattern != Pattern::kRaster;
  if (takes_gaps) settings.density_percent.reset();  // of the job
  apply<FillSettings>(kFillKeys, changes, settings);
}

bool names_key(const FillChanges& changes, std::string_view name) {
  return std::ranges::any_of(changes.keys, [&](std::size_t key) { return kFillKeys[key].name == name; });
}

bool names_spacing(const FillChanges& changes) {
  const auto keys = distance_keys(changes);
  const bool gaps = std::ranges::any_of(keys, [](std::string_view key) { return key != "density_percent"; });
  return gaps || names_key(changes, "pattern") || names_key(changes, "group");
}

void set_distances(const std::vector<double>& distance_mm, FillChanges& changes) {
  changes.values.distance_mm = distance_mm;
  for (std::size_t i = 0; i < std::size(kFillKeys); ++i) {
    if (kFillKeys[i].name == "distance_mm") changes.keys.push_back(i);
  }
}

bool fills(const FillSettings& settings) { return settings.walls > 0 || settings.pattern != Pattern::kNone; }

std::vector<std::string_view> distance_keys(const FillSettings& settings) {
  std::vector<std::string_view> names;
  if (!settings.distance_mm.empty()) names.push_back("distance_mm");
  if (!settings.gap_formula.empty()) names.push_back("gap_formula");
  if (!settings.gap_by_height.empty()) names.push_back("gap_by_height");
  if (settings.gap_mm != std::vector<double>{0}) names.push_back("gap_mm");
  if (settings.density_percent) names.push_back("density_percent");
  return names;
}

std::vector<std::string_view> distance_keys(const FillChanges& changes) {
  std::vector<std::string_view> names;
  for (const std::size_t key : changes.keys) {
    if (std::ranges::find(kDistanceKeys, kFillKeys[key].name) != std::end(kDistanceKeys)) names.push_back(kFillKeys[key].name);
  }
  return names;
}

// Section [segment].

namespace {

using segment::CutRule;

constexpr Word<CutRule> kRules[] = {
    {"aligned", CutRule::kAligned}, {"fukuda", CutRule::kGrid}, {"thick-ends", CutRule::kThickEnds}};

// Wide limits for lengths and percentages: segment::check refuses invalid ones with a reason.
constexpr Limits kAny{-1e6, 1e6};

constexpr Key<SegmentSettings> kSegmentKeys[] = {
    field<&SegmentSettings::on>({"segment", "on", "", "", "lines are segmented"}),
    word<kRules, &SegmentSettings::rule>(
        {"segment", "rule", "--segment-rule", "RULE", "division of lines into segments: aligned, fukuda or thick-ends"}),
    field<&SegmentSettings::thick_mm>({"segment", "thick_mm", "--thick", "MM", "length of thick segments in mm"}, kAny),
    field<&SegmentSettings::thin_mm>({"segment", "thin_mm", "--thin", "MM", "length of thin segments in mm"}, kAny),
    field<&SegmentSettings::min_end_mm>(
        {"segment", "min_end_mm", "", "MM", "thick ends are at least so long; half of thick_mm if absent"}, kAny),
    field<&SegmentSettings::continuous>(
        {"segment", "continuous_lines", "--continuous", "N", "number of continuous lines between segmented lines"}, {1, 1000}),
    field<&SegmentSettings::first>({"segment", "first_line", "", "N", "number of a segmented line"}, {-1000, 1000}),
    field<&SegmentSettings::spacing_sc_mm>(
        {"segment", "spacing_sc_mm", "--spacing-sc", "MM", "segmented to continuous line spacing in mm; default: from widths"},
        kAny),
    field<&SegmentSettings::spacing_cc_mm>(
        {"segment", "spacing_cc_mm", "--spacing-cc", "MM", "spacing of adjacent continuous lines in mm"}, kAny),
    field<&SegmentSettings::gap_mm>(
        {"segment", "gap_mm", "--segment-gap", "MM", "target gap in mm between thick segments and adjacent lines"}, kAny),
    field<&SegmentSettings::thick_extrusion>({"segment", "thick_extrusion_percent", "--extrusion", "%",
                                              "extrusion of thick segments in %, and of thin ones by default"},
                                             kAny),
    field<&SegmentSettings::thin_extrusion>({"segment", "thin_extrusion_percent", "", "%", "extrusion of thin segments"}, kAny),
    field<&SegmentSettings::thick_speed>(
        {"segment", "thick_speed_percent", "--thick-speed", "%", "speed of thick segments in %; default: from the extrusion"},
        kAny),
    field<&SegmentSettings::thin_speed>({"segment", "thin_speed_percent", "--thin-speed", "%", "speed of thin segments in %"},
                                        kAny),
    field<&SegmentSettings::thin_speed_sweep>({"segment", "thin_speed_sweep", "", "%,%,...",
                                               "speeds of thin segments, from one segmented line to the next: a test piece"},
                                              kAny),
    field<&SegmentSettings::thin_extrusion_sweep>(
        {"segment", "thin_extrusion_sweep", "", "%,%,...", "extrusion of thin segments, line by line"}, kAny),
    field<&SegmentSettings::thick_width_mm>(
        {"segment", "thick_width_mm", "--thick-width", "MM", "width of thick segments in mm; default: from the calibration"},
        kAny),
    field<&SegmentSettings::thin_width_mm>({"segment", "thin_width_mm", "--thin-width", "MM", "width of thin segments in mm"},
                                           kAny),
    field<&SegmentSettings::continuous_width_mm>({"segment", "continuous_width_mm", "", "MM", "width of continuous lines"},
                                                 kAny),
    field<&SegmentSettings::one_direction>({"segment", "one_direction", "", "", "extrude all lines in one direction"}),
    field<&SegmentSettings::even_starts>(
        {"segment", "even_starts", "", "", "lines begin with the flow they keep, where the machine's material.lag_s is known"}),
    field<&SegmentSettings::shift_mm>(
        {"segment", "shift_mm", "--pore-shift", "MM[,MM...]", "pore shifts along lines in mm, cyclic over layers"},
        {-1000, 1000, " mm", false, 1}),
    field<&SegmentSettings::across>(
        {"segment", "across", "", "",
         "thin segments have their middles on the segmented lines of the turned layer (thick_mm + thin_mm a multiple of their distance)"}),
};

std::string read_segment_ranges(const TomlValue& list, std::vector<Range<SegmentSettings>>& ranges, TextPosition& at) {
  return read_ranges<SegmentSettings>(list, kSegmentKeys, ranges, at);
}
std::string segment_ranges_text(const std::vector<Range<SegmentSettings>>& ranges) {
  return ranges_text<SegmentSettings>(kSegmentKeys, ranges);
}

// Option --fill sets the filling with one word; files use fill.pattern and segment.on.
std::string read_filling(std::string_view word, Job& job) {
  if (word == "segmented") {
    job.segment.all.on = true;
    return {};
  }
  if (FillRule rule{}; read_fill_rule(word, rule).empty()) {
    return fmt::format("'{}' is a rule for shells that overlap; give --fill-rule {} (image.fill in a file)", word, word);
  }
  if (!word.empty() && word.front() >= '0' && word.front() <= '9') {
    return fmt::format("'{}' is no pattern; a density is --density {}", word, word.substr(0, word.find('%')));
  }
  const std::string wrong = fill_settings_keys().front().read(word, job.fill.all);
  if (wrong.empty()) job.segment.all.on = false;  // a pattern instead of the segmented lines of a file
  return wrong.empty() ? wrong : wrong + "; or segmented";
}
std::vector<std::string_view> fillings() {
  auto words = fill_settings_keys().front().words();
  words.push_back("segmented");
  return words;
}
std::string write_no_filling(const Job&) { return {}; }

}  // namespace

std::span<const Key<SegmentSettings>> segment_settings_keys() { return kSegmentKeys; }

std::span<const JobKey> segment_keys() {
  static const std::vector<JobKey> keys = [] {
    std::vector<JobKey> all;
    for (const auto& key : kSegmentKeys)
      all.push_back(inside<&Job::segment, &SegmentRequest::all>(key, "segment", decides::moves));
    all.push_back(structure<read_segment_ranges, segment_ranges_text, &Job::segment, &SegmentRequest::ranges>(
        {"segment", "range", "", "[{...}]", "other keys between two heights: from_mm, to_mm and the keys that differ",
         decides::moves}));
    all.push_back(custom<Job, read_filling, write_no_filling>(
                      {"segment", "fill", "--fill", "FILLING",
                       "filling: segmented, none, raster, contour, contour+raster, honeycomb, quatrefoil; lines, grid, gyroid"},
                      Form::kString)
                      .with_words(fillings));
    return all;
  }();
  return keys;
}

}  // namespace lamina::pipeline
