#include "pipeline/machine/extruder.h"

#include <fmt/format.h>

#include <cmath>
#include <fstream>
#include <iterator>
#include <vector>

#include "pipeline/text/json_text.h"
#include "pipeline/text/key_text.h"
#include "pipeline/text/toml_values.h"

namespace lamina::pipeline {
namespace {

using Text = std::string_view;
using Profile = ExtruderProfile;

enum class Form { kBare, kString, kList, kTable, kLines };

struct ExtruderKey {
  Text section, name;
  std::string (*read)(Text text, Profile& profile);
  std::string (*write)(const Profile& profile);
  Form form;
};

std::string read_count(Text text, std::uint32_t& value) {
  std::int64_t whole = 0;
  auto wrong = read_whole(text, 0, 1'000'000, whole);
  if (wrong.empty()) value = static_cast<std::uint32_t>(whole);
  return wrong;
}

/// Rows "a,b;c,d" of so many numbers.
std::string read_rows(Text text, std::size_t columns, std::vector<std::vector<double>>& rows) {
  rows.clear();
  if (text.empty()) return {};
  for (const Text row : split(text, ";")) {
    const auto cells = split(row, ",");
    if (cells.size() != columns) return fmt::format("row {} holds {} numbers; give {}", rows.size() + 1, cells.size(), columns);
    rows.emplace_back();
    for (const Text cell : cells) {
      if (auto wrong = read_number(cell, 0, 1e6, "", rows.back().emplace_back()); !wrong.empty()) {
        return fmt::format("row {}: {}", rows.size(), wrong);
      }
    }
  }
  return {};
}

std::string write_rows(const std::vector<std::vector<double>>& rows) {
  std::string text;
  for (const auto& row : rows) {
    std::vector<std::string> cells;
    for (const double value : row) cells.push_back(number_text(value));
    text += fmt::format("{}{}", text.empty() ? "" : ";", fmt::join(cells, ","));
  }
  return text;
}

// clang-format off
#define NUMBER_KEY(section, key, low, high, unit)                                                                      \
  {#section, #key, [](Text t, Profile& p) { return read_number(t, low, high, unit, p.machine.section.key); },          \
   [](const Profile& p) { return number_text(p.machine.section.key); }, Form::kBare}
#define TEXT_KEY(section, key)                                                                                          \
  {#section, #key, [](Text t, Profile& p) { return p.machine.section.key = t, std::string(); },                        \
   [](const Profile& p) { return p.machine.section.key; }, Form::kString}
#define PAIR_KEY(section, key, low)                                                                                     \
  {#section, #key, [](Text t, Profile& p) { return read_pair(t, low, kMostMm, " mm", p.machine.section.key); },        \
   [](const Profile& p) { return write_list(p.machine.section.key); }, Form::kList}
// clang-format on

constexpr Word<int> kFormats[] = {{"gcode", 0}, {"sml", 1}};

// clang-format off
const ExtruderKey kKeys[] = {
    {"machine", "name",
     [](Text t, Profile& p) {
       p.machine.name = one_line(t);
       return std::string(p.machine.name.empty() ? "is empty; name the machine" : "");
     },
     [](const Profile& p) { return p.machine.name; }, Form::kString},
    {"machine", "description", [](Text t, Profile& p) { return p.machine.description = one_line(t), std::string(); },
     [](const Profile& p) { return p.machine.description; }, Form::kString},
    {"machine", "format",
     [](Text t, Profile& p) {
       int ignored = 0;
       auto wrong = read_word(kFormats, t, ignored);
       if (wrong.empty()) p.machine.format = t;
       return wrong;
     },
     [](const Profile& p) { return p.machine.format; }, Form::kString},
    PAIR_KEY(bed, size_mm, 1),
    NUMBER_KEY(bed, build_height_mm, 1, kMostMm, " mm"),
    PAIR_KEY(bed, corner_mm, -kMostMm),
    NUMBER_KEY(material, nozzle_mm, 0.01, 20, " mm"),
    NUMBER_KEY(material, filament_mm, 0.1, 20, " mm"),
    NUMBER_KEY(material, density_g_cm3, 0.01, 30, " g/cm3"),
    NUMBER_KEY(material, flow, 0.01, 10, ""),
    NUMBER_KEY(material, nozzle_degc, 0, 600, " degrees"),
    NUMBER_KEY(material, bed_degc, 0, 300, " degrees"),
    NUMBER_KEY(material, first_nozzle_degc, 0, 600, " degrees"),
    NUMBER_KEY(material, first_bed_degc, 0, 300, " degrees"),
    NUMBER_KEY(speed, print_mm_s, 0.1, 2000, " mm/s"),
    NUMBER_KEY(speed, wall_mm_s, 0.1, 2000, " mm/s"),
    NUMBER_KEY(speed, inner_wall_mm_s, 0.1, 2000, " mm/s"),
    NUMBER_KEY(speed, first_layer_mm_s, 0.1, 2000, " mm/s"),
    NUMBER_KEY(speed, travel_mm_s, 0.1, 2000, " mm/s"),
    NUMBER_KEY(speed, lift_mm_s, 0.1, 2000, " mm/s"),
    NUMBER_KEY(speed, acceleration_mm_s2, 1, 1e6, " mm/s2"),
    NUMBER_KEY(speed, corner_mm_s, 0.1, 1000, " mm/s"),
    NUMBER_KEY(retraction, length_mm, 0, 50, " mm"),
    NUMBER_KEY(retraction, speed_mm_s, 0.1, 1000, " mm/s"),
    NUMBER_KEY(retraction, least_travel_mm, 0, 1000, " mm"),
    NUMBER_KEY(fan, percent, 0, 100, " %"),
    {"fan", "from_layer", [](Text t, Profile& p) { return read_count(t, p.machine.fan.from_layer); },
     [](const Profile& p) { return fmt::format("{}", p.machine.fan.from_layer); }, Form::kBare},
    {"code", "relative_extrusion", [](Text t, Profile& p) { return read_switch(t, p.machine.code.relative_extrusion); },
     [](const Profile& p) { return write_switch(p.machine.code.relative_extrusion); }, Form::kBare},
    TEXT_KEY(code, start),
    TEXT_KEY(code, end),
    TEXT_KEY(code, layer),
    TEXT_KEY(code, plain_pressure),
    {"sml", "pd",
     [](Text t, Profile& p) {
       p.machine.sml.pd.clear();
       if (t.empty()) return std::string();
       for (const Text line : split(t, "\n")) {
         const auto words = split(line, " ");
         Extruder::Sml::Pd pd;
         if (words.size() != 3) return fmt::format("'{}' is not \"THICKNESS_MM USE COMMAND\"", one_line(line));
         if (auto wrong = read_number(words[0], kLeastMm, 10, " mm", pd.thickness_mm); !wrong.empty()) return wrong;
         if (words[1] != "raster" && words[1] != "contour" && words[1] != "support") {
           return fmt::format("'{}' is none of raster, contour, support", one_line(words[1]));
         }
         pd.use = words[1];
         pd.line = words[2];
         p.machine.sml.pd.push_back(pd);
       }
       return std::string();
     },
     [](const Profile& p) {
       std::string text;
       for (const auto& pd : p.machine.sml.pd) {
         text += fmt::format("{}{} {} {}", text.empty() ? "" : "\n", number_text(pd.thickness_mm), pd.use, pd.line);
       }
       return text;
     },
     Form::kLines},
    TEXT_KEY(sml, header),
    TEXT_KEY(sml, footer),
    TEXT_KEY(sml, height),
    TEXT_KEY(sml, travel),
    TEXT_KEY(sml, draw),
    {"calibration", "source",
     [](Text t, Profile& p) {
       p.own_calibration = true;
       return p.calibration.source = one_line(t), std::string();
     },
     [](const Profile& p) { return p.calibration.source; }, Form::kString},
    {"calibration", "width_mm", [](Text t, Profile& p) { return read_number(t, 0.01, 20, " mm", p.calibration.width_mm); },
     [](const Profile& p) { return number_text(p.calibration.width_mm); }, Form::kBare},
    {"calibration", "height_mm", [](Text t, Profile& p) { return read_number(t, 0.01, 20, " mm", p.calibration.height_mm); },
     [](const Profile& p) { return number_text(p.calibration.height_mm); }, Form::kBare},
    {"calibration", "speed_mm_s", [](Text t, Profile& p) { return read_number(t, 0.01, 2000, " mm/s", p.calibration.speed_mm_s); },
     [](const Profile& p) { return number_text(p.calibration.speed_mm_s); }, Form::kBare},
    {"calibration", "by_speed",
     [](Text t, Profile& p) {
       std::vector<std::vector<double>> rows;
       if (auto wrong = read_rows(t, 4, rows); !wrong.empty()) return wrong;
       p.calibration.by_speed.clear();
       for (const auto& row : rows) p.calibration.by_speed.push_back({row[0], row[1], row[2], row[3]});
       return std::string();
     },
     [](const Profile& p) {
       std::vector<std::vector<double>> rows;
       for (const auto& r : p.calibration.by_speed) rows.push_back({r.percent, r.thin_mm, r.stable_mm, r.swell_mm});
       return write_rows(rows);
     },
     Form::kTable},
    {"calibration", "by_extrusion",
     [](Text t, Profile& p) {
       std::vector<std::vector<double>> rows;
       if (auto wrong = read_rows(t, 2, rows); !wrong.empty()) return wrong;
       p.calibration.by_extrusion.clear();
       for (const auto& row : rows) p.calibration.by_extrusion.push_back({row[0], row[1]});
       return std::string();
     },
     [](const Profile& p) {
       std::vector<std::vector<double>> rows;
       for (const auto& r : p.calibration.by_extrusion) rows.push_back({r.percent, r.thin_mm});
       return write_rows(rows);
     },
     Form::kTable},
    {"calibration", "repeated",
     [](Text t, Profile& p) {
       std::vector<std::vector<double>> rows;
       if (auto wrong = read_rows(t, 6, rows); !wrong.empty()) return wrong;
       p.calibration.repeated.clear();
       for (const auto& row : rows) p.calibration.repeated.push_back({row[0], row[1], row[2], row[3], row[4], row[5]});
       return std::string();
     },
     [](const Profile& p) {
       std::vector<std::vector<double>> rows;
       for (const auto& r : p.calibration.repeated) {
         rows.push_back({r.extrusion_percent, r.thin_speed_percent, r.thick_speed_percent, r.thick_mm, r.thin_mm, r.continuous_mm});
       }
       return write_rows(rows);
     },
     Form::kTable},
    {"calibration", "spacing",
     [](Text t, Profile& p) {
       std::vector<std::vector<double>> rows;
       if (auto wrong = read_rows(t, 3, rows); !wrong.empty()) return wrong;
       p.calibration.spacing.clear();
       for (const auto& row : rows) p.calibration.spacing.push_back({row[0], row[1], row[2]});
       return std::string();
     },
     [](const Profile& p) {
       std::vector<std::vector<double>> rows;
       for (const auto& r : p.calibration.spacing) rows.push_back({r.extrusion_percent, r.segmented_mm, r.continuous_mm});
       return write_rows(rows);
     },
     Form::kTable},
};
// clang-format on

#undef NUMBER_KEY
#undef TEXT_KEY
#undef PAIR_KEY

std::vector<Text> sections() {
  std::vector<Text> names;
  for (const ExtruderKey& key : kKeys) {
    if (names.empty() || names.back() != key.section) names.push_back(key.section);
  }
  return names;
}

std::vector<Text> names_of(Text section) {
  std::vector<Text> names;
  for (const ExtruderKey& key : kKeys) {
    if (key.section == section) names.push_back(key.name);
  }
  return names;
}

/// The key, or what is wrong with its name.
const ExtruderKey* find_key(Text section, Text name, std::string& wrong) {
  for (const ExtruderKey& key : kKeys) {
    if (key.section == section && key.name == name) return &key;
  }
  const auto all = sections();
  const auto own = names_of(section);
  wrong = own.empty() ? fmt::format("{}: no such section{}; there are {}", one_line(section), suggest(section, all),
                                    fmt::join(all, ", "))
                      : fmt::format("{}.{}: no such key{}; [{}] has {}", section, one_line(name), suggest(name, own), section,
                                    fmt::join(own, ", "));
  return nullptr;
}

}  // namespace

Result<ExtruderProfile> read_extruder(std::string_view text, const std::string& where) {
  const auto values = read_toml_values(text, where, TomlLists::kRows);
  if (!values) return values.error();
  for (const TomlValue& value : *values) {
    if (value.section != "head" && value.section != "powder") continue;
    return Error{Fault::kUsage, fmt::format("{}: is the profile of a powder printer; lamina jet takes it", where)};
  }
  ExtruderProfile profile;
  for (const TomlValue& value : *values) {
    const auto wrong = [&](const std::string& what) {
      return Error{Fault::kUsage, fmt::format("{}:{}: {}", where, value.line, what)};
    };
    if (value.kind == TomlValue::Kind::kNoSection) return wrong(fmt::format("{}: is not a section", value.section));
    if (value.kind == TomlValue::Kind::kSection) continue;
    std::string what;
    const ExtruderKey* key = find_key(value.section, value.name, what);
    if (key == nullptr) return wrong(what);
    if (value.kind == TomlValue::Kind::kNoValue) {
      return wrong(fmt::format("{}.{}: is not a value or a list of them", value.section, value.name));
    }
    if (what = key->read(value.text, profile); !what.empty())
      return wrong(fmt::format("{}.{}: {}", value.section, value.name, what));
  }
  if (profile.machine.name.empty()) {
    return Error{Fault::kUsage, fmt::format("{}: machine.name is missing; name the machine", where)};
  }
  if (const Status status = segment::check(profile.calibration); !status) {
    return Error{Fault::kUsage, fmt::format("{}: calibration.{}", where, status.error().message)};
  }
  return profile;
}

Result<ExtruderProfile> find_extruder(const std::string& name_or_file) {
  if (name_or_file.find('/') == std::string::npos && !name_or_file.ends_with(".toml")) {
    std::vector<Text> names;
    for (const ShippedExtruder& shipped : shipped_extruders()) {
      if (shipped.name == name_or_file) return read_extruder(shipped.text, std::string(shipped.name) + ".toml");
      names.push_back(shipped.name);
    }
    return Error{Fault::kUsage,
                 fmt::format("no extrusion printer '{}'{}; name a profile (a file that ends in .toml) or one of {}",
                             one_line(name_or_file), suggest(name_or_file, names), fmt::join(names, ", "))};
  }
  std::ifstream file(name_or_file, std::ios::binary);
  if (!file) return Error{Fault::kUsage, fmt::format("{}: no such machine profile", name_or_file)};
  const std::string text{std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
  return read_extruder(text, name_or_file);
}

std::string set_extruder_key(std::string_view assignment, ExtruderProfile& profile) {
  const std::size_t dot = assignment.find('.'), equals = assignment.find('=');
  if (dot == Text::npos || equals == Text::npos || dot > equals)
    return fmt::format("'{}' is not section.key=value", one_line(assignment));
  std::string wrong;
  const ExtruderKey* key = find_key(assignment.substr(0, dot), assignment.substr(dot + 1, equals - dot - 1), wrong);
  if (key == nullptr) return wrong;
  wrong = key->read(assignment.substr(equals + 1), profile);
  return wrong.empty() ? wrong : fmt::format("{}.{}: {}", key->section, key->name, wrong);
}

std::string extruder_text(const ExtruderProfile& profile) {
  std::string text;
  Text section;
  for (const ExtruderKey& key : kKeys) {
    if (key.section == "calibration" && !profile.own_calibration) continue;
    if (section != key.section) text += fmt::format("{}[{}]\n", section.empty() ? "" : "\n", key.section);
    section = key.section;
    const std::string value = key.write(profile);
    switch (key.form) {
      case Form::kBare: text += fmt::format("{} = {}\n", key.name, value); break;
      case Form::kString: text += fmt::format("{} = {}\n", key.name, json_string(value)); break;
      case Form::kList: text += fmt::format("{} = [{}]\n", key.name, value); break;
      case Form::kTable:
      case Form::kLines:
        text += fmt::format("{} = [\n", key.name);
        if (!value.empty()) {
          for (const Text row : split(value, key.form == Form::kTable ? ";" : "\n")) {
            text += key.form == Form::kTable ? fmt::format("  [{}],\n", row) : fmt::format("  {},\n", json_string(row));
          }
        }
        text += "]\n";
    }
  }
  return text;
}

Result<ExtruderProfile> resolve_extruder(const Job& job) {
  auto found = find_extruder(job.machine.profile.empty() ? "marlin" : job.machine.profile);
  if (!found) return Error{found.error().fault, "--machine: " + found.error().message};
  ExtruderProfile& profile = *found;
  for (std::string_view change : split(job.extrude.set, ";")) {
    while (change.starts_with(' ')) change.remove_prefix(1);
    if (change.empty()) continue;
    if (const std::string wrong = set_extruder_key(change, profile); !wrong.empty()) {
      return Error{Fault::kUsage, fmt::format("extrude.set: {}", wrong)};
    }
  }
  const ExtrudeRequest& r = job.extrude;
  Extruder& m = profile.machine;
  if (r.flow) m.material.flow = *r.flow;
  if (r.nozzle_degc) m.material.nozzle_degc = m.material.first_nozzle_degc = *r.nozzle_degc;
  if (r.bed_degc) m.material.bed_degc = m.material.first_bed_degc = *r.bed_degc;
  if (r.print_mm_s) m.speed.print_mm_s = *r.print_mm_s;
  if (r.wall_mm_s) m.speed.wall_mm_s = m.speed.inner_wall_mm_s = *r.wall_mm_s;
  if (r.first_layer_mm_s) m.speed.first_layer_mm_s = *r.first_layer_mm_s;
  if (r.travel_mm_s) m.speed.travel_mm_s = *r.travel_mm_s;
  if (r.retraction_mm) m.retraction.length_mm = *r.retraction_mm;
  if (r.fan_percent) m.fan.percent = *r.fan_percent;
  if (r.relative_extrusion) m.code.relative_extrusion = *r.relative_extrusion;
  return found;
}

}  // namespace lamina::pipeline
