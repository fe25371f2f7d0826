#include "pipeline/machine/printer_profile.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <iterator>

#include "pipeline/job/material.h"
#include "pipeline/text/json_text.h"
#include "pipeline/text/key_form.h"
#include "pipeline/text/key_text.h"
#include "pipeline/text/toml_values.h"
#include "stages/write/program/dialect.h"

namespace lamina::pipeline {
namespace {

using Text = std::string_view;
constexpr double kMost = 1e9;

constexpr Word<BedShape> kShapes[] = {{"rectangle", BedShape::kRectangle}, {"round", BedShape::kRound}};
constexpr Word<ScanAxis> kScans[] = {{"x", ScanAxis::kX}, {"y", ScanAxis::kY}};
constexpr Word<Side> kSides[] = {
    {"left", Side::kLeft}, {"right", Side::kRight}, {"front", Side::kFront}, {"back", Side::kBack}};
constexpr Word<BlockedRule> kBlocked[] = {
    {"report", BlockedRule::kReport}, {"neighbour", BlockedRule::kNeighbour}, {"second-pass", BlockedRule::kSecondPass}};
constexpr Word<LagUnit> kLags[] = {{"pixel", LagUnit::kPixel}, {"tick", LagUnit::kTick}};
constexpr Word<FirstSwath> kFirst[] = {{"bed", FirstSwath::kBed}, {"layer", FirstSwath::kLayer}};
constexpr Word<VatRule> kVats[] = {{"first", VatRule::kFirst},
                                   {"second", VatRule::kSecond},
                                   {"majority", VatRule::kMajority},
                                   {"both", VatRule::kBoth},
                                   {"refuse", VatRule::kRefuse}};

struct MachineKey {
  Text section, name;
  std::string (*read)(Text text, Machine& machine);
  std::string (*write)(const Machine& machine);
  KeyForm form;
  bool only_if_set = false;  // is left out of a profile's text while it is empty
};

std::string read_count(Text text, std::int64_t low, std::int64_t high, std::uint32_t& value) {
  std::int64_t whole = 0;
  auto wrong = read_whole(text, low, high, whole);
  if (wrong.empty()) value = static_cast<std::uint32_t>(whole);
  return wrong;
}

std::string read_two(Text text, std::array<double, 2>& values) { return read_pair(text, -kMost, kMost, "", values); }

std::string read_axis(Text text, std::string& axis) {
  if (text.size() == 1 && text[0] >= 'A' && text[0] <= 'Z') {
    axis = text;
    return {};
  }
  return fmt::format("'{}' is no axis; give one letter from A to Z", text);
}

std::string read_sign(Text text, double& sign) {
  std::int64_t whole = 0;
  if (auto wrong = read_whole(text, -1, 1, whole); !wrong.empty() || whole == 0) return "give 1 or -1";
  sign = static_cast<double>(whole);
  return {};
}

// clang-format off
#define NUMBER_KEY(section, key, low, high, unit)                                                                      \
  {#section, #key, [](Text t, Machine& m) { return read_number(t, low, high, unit, m.section.key); },                    \
   [](const Machine& m) { return number_text(m.section.key); }, KeyForm::kBare}
#define COUNT_KEY(section, key, low, high)                                                                              \
  {#section, #key, [](Text t, Machine& m) { return read_count(t, low, high, m.section.key); },                           \
   [](const Machine& m) { return fmt::format("{}", m.section.key); }, KeyForm::kBare}
#define WORD_KEY(section, key, words)                                                                                   \
  {#section, #key, [](Text t, Machine& m) { return read_word(words, t, m.section.key); },                               \
   [](const Machine& m) { return write_word(words, m.section.key); }, KeyForm::kString}
#define SWITCH_KEY(section, key)                                                                                        \
  {#section, #key, [](Text t, Machine& m) { return read_switch(t, m.section.key); },                                    \
   [](const Machine& m) { return write_switch(m.section.key); }, KeyForm::kBare}
#define PAIR_KEY(section, key)                                                                                          \
  {#section, #key, [](Text t, Machine& m) { return read_two(t, m.section.key); },                                       \
   [](const Machine& m) { return write_list(m.section.key); }, KeyForm::kList}
#define AXIS_KEY(section, key)                                                                                          \
  {#section, #key, [](Text t, Machine& m) { return read_axis(t, m.section.key); },                                      \
   [](const Machine& m) { return m.section.key; }, KeyForm::kString}

const MachineKey kKeys[] = {
    {"machine", "name",
     [](Text t, Machine& m) {
       m.name = one_line(t);
       return std::string(m.name.empty() ? "is empty; name the machine" : "");
     },
     [](const Machine& m) { return m.name; }, KeyForm::kString},
    {"machine", "description", [](Text t, Machine& m) { return m.description = one_line(t), std::string(); },
     [](const Machine& m) { return m.description; }, KeyForm::kString},
    {"machine", "dialect",
     [](Text t, Machine& m) {
       std::vector<Text> ids;
       for (const auto& dialect : write::dialects()) ids.push_back(dialect.id);
       if (write::find_dialect(t) == nullptr) return not_one_of(t, ids);
       m.dialect = t;
       return std::string();
     },
     [](const Machine& m) { return m.dialect; }, KeyForm::kString},

    WORD_KEY(bed, shape, kShapes),
    {"bed", "size_mm", [](Text t, Machine& m) { return read_pair(t, kLeastMm, kMostMm, " mm", m.bed.size_mm); },
     [](const Machine& m) { return write_list(m.bed.size_mm); }, KeyForm::kList},
    NUMBER_KEY(bed, build_height_mm, kLeastMm, kMostMm, " mm"),

    COUNT_KEY(head, nozzles, 1, 65'535),
    NUMBER_KEY(head, pitch_um, 0, 1e6, " um"),
    {"head", "row_offset_um",
     [](Text t, Machine& m) {
       std::vector<double> offsets;
       for (const Text piece : split(t, ",")) {
         if (auto wrong = read_number(piece, -1e6, 1e6, " um", offsets.emplace_back()); !wrong.empty()) return wrong;
       }
       m.head.row_offset_um = offsets;
       return std::string();
     },
     [](const Machine& m) {
       std::string text;
       for (const double offset : m.head.row_offset_um) text += (text.empty() ? "" : ",") + number_text(offset);
       return text;
     },
     KeyForm::kList},
    NUMBER_KEY(head, highest_frequency_hz, 1e-3, kMost, " Hz"),
    NUMBER_KEY(head, drop_pl, 0, kMost, " pl"),
    {"head", "blocked",
     [](Text t, Machine& m) {
       std::vector<std::uint32_t> nozzles;
       if (!t.empty()) {
         for (const Text piece : split(t, ",")) {
           if (auto wrong = read_count(piece, 0, 65'534, nozzles.emplace_back()); !wrong.empty()) return wrong;
         }
       }
       m.head.blocked = nozzles;
       return std::string();
     },
     [](const Machine& m) { return fmt::format("{}", fmt::join(m.head.blocked, ",")); }, KeyForm::kList},
    WORD_KEY(head, blocked_rule, kBlocked),

    NUMBER_KEY(mounting, tilt_deg, -360, 360, " degrees"),
    NUMBER_KEY(mounting, dpi, 0, 25'400, ""),
    NUMBER_KEY(mounting, along_dpi, 0, 25'400, ""),
    WORD_KEY(mounting, scan_axis, kScans),
    WORD_KEY(mounting, scan_from, kSides),
    WORD_KEY(mounting, nozzle_0, kSides),
    SWITCH_KEY(mounting, first_leads),
    COUNT_KEY(mounting, passes, 1, 64),
    COUNT_KEY(mounting, overlap_lines, 0, 65'535),
    WORD_KEY(mounting, first_swath, kFirst),
    PAIR_KEY(mounting, offset_mm),

    NUMBER_KEY(motion, encoder_dpi, 0, 25'400, ""),
    COUNT_KEY(motion, ticks_per_pixel, 0, 1000),
    WORD_KEY(motion, lag_unit, kLags),
    SWITCH_KEY(motion, both_directions),
    NUMBER_KEY(motion, scan_speed_mm_s, 1e-3, 1e6, " mm/s"),
    NUMBER_KEY(motion, travel_speed_mm_s, 1e-3, 1e6, " mm/s"),
    NUMBER_KEY(motion, ramp_mm, 0, 1e4, " mm"),
    NUMBER_KEY(motion, layer_step_um, 1e-3, 1e6, " um"),
    PAIR_KEY(motion, safe_mm),
    AXIS_KEY(motion, x_axis),
    AXIS_KEY(motion, y_axis),

    COUNT_KEY(powder, vats, 1, 2),
    {"powder", "materials",
     [](Text t, Machine& m) {
       std::vector<std::string> names;
       for (const Text piece : t.empty() ? std::vector<Text>() : split(t, ",")) {
         std::string name;
         if (auto wrong = read_material(piece, name); !wrong.empty()) return wrong;
         if (std::ranges::find(names, name) != names.end()) return fmt::format("'{}' is in two vats; name them apart", name);
         names.push_back(name);
       }
       m.powder.materials = names;
       return std::string();
     },
     [](const Machine& m) { return m.powder.materials.empty() ? "" : fmt::format("\"{}\"", fmt::join(m.powder.materials, "\",\"")); },
     KeyForm::kList, true},
    WORD_KEY(powder, vat_rule, kVats),
    AXIS_KEY(powder, build_axis),
    {"powder", "feed_axes",
     [](Text t, Machine& m) {
       std::vector<std::string> axes;
       for (const Text piece : split(t, ",")) {
         if (auto wrong = read_axis(piece, axes.emplace_back()); !wrong.empty()) return wrong;
       }
       if (axes.size() != 2) return std::string("give two axes, of the first and of the second vat");
       m.powder.feed_axes = axes;
       return std::string();
     },
     [](const Machine& m) { return fmt::format("\"{}\"", fmt::join(m.powder.feed_axes, "\",\"")); }, KeyForm::kList},
    AXIS_KEY(powder, roller_axis),
    {"powder", "build_sign", [](Text t, Machine& m) { return read_sign(t, m.powder.build_sign); },
     [](const Machine& m) { return number_text(m.powder.build_sign); }, KeyForm::kBare},
    {"powder", "feed_sign", [](Text t, Machine& m) { return read_sign(t, m.powder.feed_sign); },
     [](const Machine& m) { return number_text(m.powder.feed_sign); }, KeyForm::kBare},
    NUMBER_KEY(powder, dose, 0, 100, ""),
    PAIR_KEY(powder, roller_mm),
    NUMBER_KEY(powder, roller_speed_mm_s, 1e-3, 1e6, " mm/s"),
    NUMBER_KEY(powder, vat_speed_mm_s, 1e-3, 1e6, " mm/s"),
    NUMBER_KEY(powder, packing, 0.01, 1, ""),
};
// clang-format on

#undef NUMBER_KEY
#undef COUNT_KEY
#undef WORD_KEY
#undef SWITCH_KEY
#undef PAIR_KEY
#undef AXIS_KEY

std::string names_of(std::span<const MachineKey> keys, Text section) {
  std::string names;
  for (const MachineKey& key : keys) {
    if (key.section == section) names += (names.empty() ? "" : ", ") + std::string(key.name);
  }
  return names;
}

}  // namespace

Result<Machine> read_machine(std::string_view text, const std::string& where) {
  const auto values = read_toml_values(text, where, TomlLists::kFlat);
  if (!values) return values.error();
  Machine machine;
  for (const auto& [kind, section, name, written, line] : *values) {
    const std::uint32_t at = line;
    const auto wrong = [&](const std::string& what) { return Error{Fault::kUsage, fmt::format("{}:{}: {}", where, at, what)}; };
    if (kind == TomlValue::Kind::kNoSection || names_of(kKeys, section).empty()) {
      return wrong(fmt::format("{}: no such section; there are machine, bed, head, mounting, motion, powder", section));
    }
    if (kind == TomlValue::Kind::kSection) continue;
    const MachineKey* found = nullptr;
    for (const MachineKey& key : kKeys) {
      if (key.section == section && key.name == name) found = &key;
    }
    if (found == nullptr) {
      return wrong(fmt::format("{}.{}: no such key; [{}] has {}", section, name, section, names_of(kKeys, section)));
    }
    if (kind == TomlValue::Kind::kNoValue)
      return wrong(fmt::format("{}.{}: is not a single value or a list of them", section, name));
    if (const std::string what = found->read(written, machine); !what.empty()) {
      return wrong(fmt::format("{}.{}: {}", section, name, what));
    }
  }
  if (machine.name.empty()) {
    return Error{Fault::kUsage, fmt::format("{}: machine.name is missing; name the machine", where)};
  }
  return machine;
}

Result<Machine> find_machine(const std::string& name_or_file) {
  if (name_or_file.find('/') == std::string::npos && !name_or_file.ends_with(".toml")) {
    std::vector<Text> names;
    for (const ShippedMachine& shipped : shipped_machines()) {
      if (shipped.name == name_or_file) return read_machine(shipped.text, std::string(shipped.name) + ".toml");
      names.push_back(shipped.name);
    }
    return Error{Fault::kUsage, fmt::format("no machine {}; name a profile (a file that ends in .toml) or one of {}{}",
                                            not_one_of(name_or_file, names).substr(0, name_or_file.size() + 2),
                                            fmt::join(names, ", "), suggest(name_or_file, names))};
  }
  std::ifstream file(name_or_file, std::ios::binary);
  if (!file) return Error{Fault::kUsage, fmt::format("{}: no such machine profile", name_or_file)};
  const std::string text{std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
  return read_machine(text, name_or_file);
}

std::string machine_text(const Machine& machine) {
  std::string text;
  Text section;
  for (const MachineKey& key : kKeys) {
    if (key.only_if_set && key.write(machine).empty()) continue;
    if (section != key.section) text += fmt::format("{}[{}]\n", section.empty() ? "" : "\n", key.section);
    section = key.section;
    const std::string value = key.write(machine);
    if (key.form == KeyForm::kString) {
      text += fmt::format("{} = {}\n", key.name, json_string(value));
    } else if (key.form == KeyForm::kBare) {
      text += fmt::format("{} = {}\n", key.name, value);
    } else {
      text += fmt::format("{} = [{}]\n", key.name, value.empty() ? "" : fmt::format("{}", fmt::join(split(value, ","), ", ")));
    }
  }
  return text;
}

}  // namespace lamina::pipeline
