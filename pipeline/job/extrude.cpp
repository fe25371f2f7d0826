// Sections [extrude] and [segment].
#include <fmt/format.h>

#include <array>
#include <cstdlib>
#include <utility>

#include "pipeline/job/keys.h"
#include "pipeline/text/key_text.h"

namespace lamina::pipeline {
namespace {

using Form = KeyForm;
using Text = std::string_view;
using Settings = SegmentSettings;
using segment::CutRule;

constexpr Word<CutRule> kRules[] = {
    {"aligned", CutRule::kAligned}, {"fukuda", CutRule::kGrid}, {"thick-ends", CutRule::kThickEnds}};

std::string read_optional(Text text, double low, double high, Text unit, std::optional<double>& value) {
  double number = 0;
  auto wrong = read_number(text, low, high, unit, number);
  if (wrong.empty()) value = number;
  return wrong;
}
std::string write_optional(const std::optional<double>& value) { return value ? number_text(*value) : std::string(); }

// Lengths and percentages may be anything here: what can be laid is decided by segment::check, with reasons.
constexpr double kAny = 1e6;

// clang-format off
#define NUMBER_KEY(name, flag, unit, member, meaning)                                                       \
  {name, flag, unit, meaning, [](Text t, Settings& s) { return read_number(t, -kAny, kAny, "", s.member); }, \
   [](const Settings& s) { return number_text(s.member); }, Form::kBare, {}}
#define OPTIONAL_KEY(name, flag, unit, member, meaning)                                                       \
  {name, flag, unit, meaning, [](Text t, Settings& s) { return read_optional(t, -kAny, kAny, "", s.member); }, \
   [](const Settings& s) { return write_optional(s.member); }, Form::kBare, {}}
// clang-format on

std::string read_percentages(Text text, std::vector<double>& list) {
  std::vector<double> values;
  for (const Text piece : text.empty() ? std::vector<Text>() : split(text, ",")) {
    if (auto wrong = read_number(piece, -kAny, kAny, " %", values.emplace_back()); !wrong.empty()) return wrong;
  }
  list = values;
  return {};
}
std::string list_text(const std::vector<double>& list) {
  std::vector<std::string> texts;
  for (const double value : list) texts.push_back(number_text(value));
  return fmt::format("{}", fmt::join(texts, ","));
}

// clang-format off
#define LIST_KEY(name, member, meaning)                                                              \
  {name, "", "%,%,...", meaning, [](Text t, Settings& s) { return read_percentages(t, s.member); },   \
   [](const Settings& s) { return list_text(s.member); }, Form::kList, {}}

const SegmentKey kSegmentKeys[] = {
    {"on", "", "", "lines are segmented", [](Text t, Settings& s) { return read_switch(t, s.on); },
     [](const Settings& s) { return write_switch(s.on); }, Form::kBare, {}},
    {"rule", "--segment-rule", "RULE",
     "aligned: a grid fixed to the part, ends thick; fukuda: the grid as it falls; thick-ends: each line on its own",
     [](Text t, Settings& s) { return read_word(kRules, t, s.rule); }, [](const Settings& s) { return write_word(kRules, s.rule); },
     Form::kString, {}},
    NUMBER_KEY("thick_mm", "--thick", "MM", thick_mm, "length of a thick stretch"),
    NUMBER_KEY("thin_mm", "--thin", "MM", thin_mm, "length of a thin stretch"),
    OPTIONAL_KEY("least_end_mm", "", "MM", least_end_mm, "thick ends are at least so long; half of thick_mm if absent"),
    {"continuous_lines", "--continuous", "N", "continuous lines between two segmented ones",
     [](Text t, Settings& s) {
       std::int64_t count = 0;
       auto wrong = read_whole(t, 1, 1000, count);
       if (wrong.empty()) s.continuous = static_cast<std::uint32_t>(count);
       return wrong;
     },
     [](const Settings& s) { return fmt::format("{}", s.continuous); }, Form::kBare, {}},
    {"first_line", "", "N", "number of a segmented line",
     [](Text t, Settings& s) {
       std::int64_t number = 0;
       auto wrong = read_whole(t, -1000, 1000, number);
       if (wrong.empty()) s.first = static_cast<std::int32_t>(number);
       return wrong;
     },
     [](const Settings& s) { return fmt::format("{}", s.first); }, Form::kBare, {}},
    OPTIONAL_KEY("spacing_sc_mm", "--spacing-sc", "MM", spacing_sc_mm,
                 "from a segmented line to the continuous one beside it, centre to centre; from the widths if absent"),
    OPTIONAL_KEY("spacing_cc_mm", "--spacing-cc", "MM", spacing_cc_mm, "the same between continuous lines"),
    NUMBER_KEY("gap_mm", "--segment-gap", "MM", gap_mm, "wanted between thick beads and their neighbours, for spacings from the widths"),
    NUMBER_KEY("thick_extrusion_percent", "--extrusion", "%", thick_extrusion, "extrusion of thick stretches, and of thin ones if theirs is absent"),
    OPTIONAL_KEY("thin_extrusion_percent", "", "%", thin_extrusion, "extrusion of thin stretches"),
    OPTIONAL_KEY("thick_speed_percent", "--thick-speed", "%", thick_speed, "speed of thick stretches; by the extrusion if absent"),
    NUMBER_KEY("thin_speed_percent", "--thin-speed", "%", thin_speed, "speed of thin stretches"),
    LIST_KEY("thin_speed_sweep", thin_speed_sweep, "speeds of thin stretches, from one segmented line to the next: a test piece"),
    LIST_KEY("thin_extrusion_sweep", thin_extrusion_sweep, "the same of their extrusion"),
    OPTIONAL_KEY("thick_width_mm", "--thick-width", "MM", thick_width_mm, "width that thick stretches will have; by the calibration if absent"),
    OPTIONAL_KEY("thin_width_mm", "--thin-width", "MM", thin_width_mm, "the same of thin ones"),
    OPTIONAL_KEY("continuous_width_mm", "", "MM", continuous_width_mm, "the same of continuous lines"),
    {"one_direction", "", "", "all segmented lines are laid the same way", [](Text t, Settings& s) { return read_switch(t, s.one_direction); },
     [](const Settings& s) { return write_switch(s.one_direction); }, Form::kBare, {}},
    {"shift_mm", "--pore-shift", "MM[,MM...]", "pores are moved along the lines by these, layer by layer in turn",
     [](Text t, Settings& s) {
       std::vector<double> shifts;
       for (const Text piece : split(t, ",")) {
         if (auto wrong = read_number(piece, -1000, 1000, " mm", shifts.emplace_back()); !wrong.empty()) return wrong;
       }
       s.shift_mm = shifts;
       return std::string();
     },
     [](const Settings& s) { return list_text(s.shift_mm); },
     Form::kList, {}},
    {"across", "", "", "pores of layers turned by 90 degrees lie over each other (thick_mm + thin_mm twice the spacing)",
     [](Text t, Settings& s) { return read_switch(t, s.across); }, [](const Settings& s) { return write_switch(s.across); }, Form::kBare, {}},
};
// clang-format on
#undef NUMBER_KEY
#undef OPTIONAL_KEY
#undef LIST_KEY

constexpr std::size_t kCount = std::size(kSegmentKeys);

template <std::size_t Index>
JobKey segment_key() {
  const SegmentKey& key = kSegmentKeys[Index];
  return {"segment",
          key.name,
          key.flag,
          key.value,
          key.meaning,
          false,
          [](Text text, Job& job) { return kSegmentKeys[Index].read(text, job.segment.all); },
          [](const Job& job) { return kSegmentKeys[Index].write(job.segment.all); },
          key.form,
          key.switch_text};
}

template <std::size_t... Index>
std::vector<JobKey> segment_keys_of(std::index_sequence<Index...>) {
  return {segment_key<Index>()...};
}

// clang-format off
#define EXTRUDE_KEY(name, flag, unit, low, high, meaning)                                                                  \
  {"extrude", #name, flag, unit, meaning, false,                                                                           \
   [](Text t, Job& j) { return read_optional(t, low, high, "", j.extrude.name); },                                         \
   [](const Job& j) { return write_optional(j.extrude.name); }, Form::kBare}

std::string set_fill_rule(Text text, Job& job) {
  for (const JobKey& key : image_keys()) {
    if (key.name == "fill") return key.read(text, job);
  }
  return {};
}

std::vector<JobKey> all_keys() {
  std::vector<JobKey> keys{
      EXTRUDE_KEY(flow, "--flow", "FACTOR", 0.01, 10, "factor on all that is extruded"),
      EXTRUDE_KEY(nozzle_degc, "--nozzle-temperature", "DEGC", 0, 600, "of all layers"),
      EXTRUDE_KEY(bed_degc, "--bed-temperature", "DEGC", 0, 300, "of all layers"),
      EXTRUDE_KEY(print_mm_s, "--print-speed", "MM/S", 0.1, 2000, "of filling lines; 100 % of segmented ones"),
      EXTRUDE_KEY(wall_mm_s, "--wall-speed", "MM/S", 0.1, 2000, "of walls"),
      EXTRUDE_KEY(first_layer_mm_s, "--first-layer-speed", "MM/S", 0.1, 2000, "nothing of the first layer is laid faster"),
      EXTRUDE_KEY(travel_mm_s, "--travel-speed", "MM/S", 0.1, 2000, "of moves without a bead"),
      EXTRUDE_KEY(retraction_mm, "--retraction", "MM", 0, 50, "of filament, before long travels"),
      EXTRUDE_KEY(fan_percent, "--fan", "%", 0, 100, "of the part's fan"),
      {"extrude", "relative_extrusion", "--relative-extrusion", "true|false", "count filament from move to move", false,
       [](Text t, Job& j) {
         bool value = false;
         auto wrong = read_switch(t, value);
         if (wrong.empty()) j.extrude.relative_extrusion = value;
         return wrong;
       },
       [](const Job& j) { return j.extrude.relative_extrusion ? write_switch(*j.extrude.relative_extrusion) : std::string(); },
       Form::kBare},
      {"extrude", "set", "--machine-set", "KEY=VALUE;...", "other keys of the machine's profile, as in fan.from_layer=2", false,
       [](Text t, Job& j) {
         j.extrude.set = t;
         return std::string();
       },
       [](const Job& j) { return j.extrude.set; }, Form::kString},
  };
  const std::vector<JobKey> segments = segment_keys_of(std::make_index_sequence<kCount>());
  keys.insert(keys.end(), segments.begin(), segments.end());
  keys.push_back({"segment", "by_height", "", "RANGES", "other keys between two heights: \"0:2.7 thin_mm=2; 2.7:3 on=false\"", false,
                  [](Text t, Job& j) {
                    j.segment.by_height = t;
                    return std::string();
                  },
                  [](const Job& j) { return j.segment.by_height; }, Form::kString});
  // The way to ask for a filling with one word; files hold fill.pattern and segment.on.
  keys.push_back({"segment", "fill", "--fill", "FILLING",
                  "segmented, or a pattern: none, raster, contour, contour+raster, honeycomb, quatrefoil; or image.fill: nonzero, positive, evenodd",
                  false,
                  [](Text t, Job& j) {
                    if (t == "segmented") {
                      j.segment.all.on = true;
                      return std::string();
                    }
                    if (t == "nonzero" || t == "positive" || t == "evenodd") return set_fill_rule(t, j);
                    const std::string wrong = fill_settings_keys().front().read(t, j.fill.all);
                    return wrong.empty() || wrong.find("none of ") == std::string::npos ? wrong : wrong + "; or segmented";
                  },
                  [](const Job&) { return std::string(); }, Form::kString});
  return keys;
}
// clang-format on
#undef EXTRUDE_KEY

}  // namespace

std::span<const SegmentKey> segment_settings_keys() { return kSegmentKeys; }

std::span<const JobKey> extrude_keys() {
  static const std::vector<JobKey> keys = all_keys();
  return keys;
}

}  // namespace lamina::pipeline
