#include "pipeline/job/profiles/extruder.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <vector>

#include "pipeline/job/errors.h"
#include "stages/support/text/number_text.h"
#include "stages/support/text/readable.h"

namespace lamina::pipeline {
namespace {

using Text = std::string_view;
using Profile = ExtruderProfile;

constexpr Text kFormats[] = {"gcode", "sml"}, kUses[] = {"raster", "contour", "support"},
               kFlavors[] = {"Marlin", "RepRap", "Repetier", "Klipper"}, kObjects[] = {"none", "m486", "klipper"};

std::string check_format(Text text) { return text == "gcode" || text == "sml" ? std::string() : not_one_of(text, kFormats); }
std::string check_flavor(Text text) {
  return std::ranges::find(kFlavors, text) != std::end(kFlavors) ? std::string() : not_one_of(text, kFlavors);
}
std::string check_objects(Text text) {
  return std::ranges::find(kObjects, text) != std::end(kObjects) ? std::string() : not_one_of(text, kObjects);
}
std::string check_nothing(Text) { return {}; }
std::string read_source(Text text, Profile& profile) {
  profile.own_calibration = true;
  profile.calibration.source = one_line(text);
  return {};
}
std::string read_acceleration(Text text, Profile& profile) {
  Extruder::Speed& speed = profile.machine.speed;
  std::string wrong = read_value(text, Limits{1, 1e6, " mm/s2"}, speed.acceleration_mm_s2);
  if (wrong.empty()) speed.states_acceleration = true;
  return wrong;
}
std::string write_acceleration(const Profile& profile) { return number_text(profile.machine.speed.acceleration_mm_s2); }
std::string write_source(const Profile& profile) { return profile.calibration.source; }

constexpr Word<BeadShape> kShapes[] = {
    {"stadium", BeadShape::kStadium}, {"rectangle", BeadShape::kRectangle}, {"ellipse", BeadShape::kEllipse}};
std::string read_shape(Text text, std::optional<BeadShape>& shape) {
  BeadShape read{};
  std::string wrong = read_word(kShapes, text, read);
  if (wrong.empty()) shape = read;
  return wrong;
}
std::string write_shape(const std::optional<BeadShape>& shape) { return shape ? write_word(kShapes, *shape) : std::string(); }

/// A list with an entry a line, as files of many rows are written.
std::string lines_text(const std::vector<std::string>& entries) {
  std::string text = "[\n";
  for (const std::string& entry : entries) text += "  " + entry + ",\n";
  return text + "]";
}

/// Rows of so many numbers: { percent, thin_mm, ... } of a calibration.
template <class Row, double Row::*... Columns>
std::string read_rows(const TomlValue& list, std::vector<Row>& rows, TextPosition& at) {
  if (!list.is_list()) return "is a list of rows, as in [[100, 0.4], [50, 0.3]]";
  std::vector<Row> read;
  for (const TomlValue& cells : list.value) {
    at = cells.position;
    if (cells.value.size() != sizeof...(Columns)) {
      return fmt::format("row {} holds {} numbers; give {}", read.size() + 1, cells.value.size(), sizeof...(Columns));
    }
    Row& row = read.emplace_back();
    std::string wrong;
    std::size_t i = 0;
    const auto cell = [&](double& value) {
      if (wrong.empty()) wrong = read_number(cells.value[i++].text, 0, 1e6, "", value);
    };
    (cell(row.*Columns), ...);
    if (!wrong.empty()) return fmt::format("row {}: {}", read.size(), wrong);
  }
  rows = std::move(read);
  return {};
}
template <class Row, double Row::*... Columns>
std::string write_rows(const std::vector<Row>& rows) {
  std::vector<std::string> lines;
  for (const Row& row : rows) lines.push_back(fmt::format("[{}]", fmt::join(std::array{number_text(row.*Columns)...}, ", ")));
  return lines_text(lines);
}
template <auto Member, class Row, double Row::*... Columns>
constexpr Key<Profile> table(Text name) {
  return structure<read_rows<Row, Columns...>, write_rows<Row, Columns...>, &Profile::calibration, Member>(
      {"calibration", name});
}

/// "THICKNESS_MM USE COMMAND" a line.
std::string read_commands(const TomlValue& list, std::vector<Extruder::Sml::Pd>& commands, TextPosition& at) {
  if (!list.is_list()) return "is a list of \"THICKNESS_MM USE COMMAND\"";
  std::vector<Extruder::Sml::Pd> read;
  for (const TomlValue& line : list.value) {
    at = line.position;
    const auto words = split(line.text, " ");
    Extruder::Sml::Pd& command = read.emplace_back();
    if (words.size() != 3) return fmt::format("'{}' is not \"THICKNESS_MM USE COMMAND\"", one_line(line.text));
    if (auto wrong = read_number(words[0], kMinMm, 10, " mm", command.thickness_mm); !wrong.empty()) return wrong;
    if (std::ranges::find(kUses, words[1]) == std::end(kUses)) return not_one_of(one_line(words[1]), kUses);
    command.use = words[1];
    command.line = words[2];
  }
  commands = std::move(read);
  return {};
}
std::string write_commands(const std::vector<Extruder::Sml::Pd>& commands) {
  std::vector<std::string> lines;
  for (const auto& [thickness, use, line] : commands) {
    lines.push_back(toml_string(fmt::format("{} {} {}", number_text(thickness), use, line)));
  }
  return lines_text(lines);
}

constexpr auto kMachine = &Profile::machine;
constexpr auto kCalibration = &Profile::calibration;
using Bed = decltype(Extruder::bed);
using Material = decltype(Extruder::material);
using Speed = decltype(Extruder::speed);
using Retraction = decltype(Extruder::retraction);
using Skirt = decltype(Extruder::skirt);
using Fan = decltype(Extruder::fan);
using Code = decltype(Extruder::code);
using Sml = decltype(Extruder::sml);

constexpr Limits kSpeed{0.1, 2000, " mm/s"}, kNozzle{0, 600, " degrees"}, kPlate{0, 300, " degrees"};

template <auto... Path>
constexpr Key<Profile> code(Text section, Text name) {
  return text<check_nothing, kMachine, Path...>({section, name});
}

constexpr Key<Profile> kKeys[] = {
    custom<Profile, read_name, same_text, kMachine, &Extruder::name>({"machine", "name"}, Form::kString),
    custom<Profile, read_line, same_text, kMachine, &Extruder::description>({"machine", "description"}, Form::kString),
    text<check_format, kMachine, &Extruder::format>({"machine", "format"}),
    field<kMachine, &Extruder::max_nozzle_degc>({"machine", "max_nozzle_degc"}, kNozzle).unsaid_at("0"),
    field<kMachine, &Extruder::max_bed_degc>({"machine", "max_bed_degc"}, kPlate).unsaid_at("0"),

    field<kMachine, &Extruder::bed, &Bed::size_mm>({"bed", "size_mm"}, {1, kMaxMm, " mm"}),
    field<kMachine, &Extruder::bed, &Bed::build_height_mm>({"bed", "build_height_mm"}, {1, kMaxMm, " mm"}),
    field<kMachine, &Extruder::bed, &Bed::margin_mm>({"bed", "margin_mm"}, {0, kMaxMm, " mm"}).unsaid_at("0"),
    field<kMachine, &Extruder::bed, &Bed::corner_mm>({"bed", "corner_mm"}, {-kMaxMm, kMaxMm, " mm"}),

    field<kMachine, &Extruder::material, &Material::nozzle_mm>({"material", "nozzle_mm"}, {0.01, 20, " mm"}),
    field<kMachine, &Extruder::material, &Material::filament_mm>({"material", "filament_mm"}, {0.1, 20, " mm"}),
    field<kMachine, &Extruder::material, &Material::density_g_cm3>({"material", "density_g_cm3"}, {0.01, 30, " g/cm3"}),
    custom<Profile, read_shape, write_shape, kMachine, &Extruder::material, &Material::bead_area>({"material", "bead_area"},
                                                                                                  Form::kString),
    field<kMachine, &Extruder::material, &Material::flow>({"material", "flow"}, {0.01, 10}),
    field<kMachine, &Extruder::material, &Material::feed_ratio>({"material", "feed_ratio"}, {0.1, 10}),
    field<kMachine, &Extruder::material, &Material::lag_s>({"material", "lag_s"}, {0, 10, " s"}),
    field<kMachine, &Extruder::material, &Material::nozzle_degc>({"material", "nozzle_degc"}, kNozzle),
    field<kMachine, &Extruder::material, &Material::bed_degc>({"material", "bed_degc"}, kPlate),
    field<kMachine, &Extruder::material, &Material::first_nozzle_degc>({"material", "first_nozzle_degc"}, kNozzle),
    field<kMachine, &Extruder::material, &Material::first_bed_degc>({"material", "first_bed_degc"}, kPlate),
    custom<Profile, read_line, same_text, kMachine, &Extruder::material, &Material::name>({"material", "name"}, Form::kString)
        .unsaid_at(""),
    field<kMachine, &Extruder::material, &Material::price_kg>({"material", "price_kg"}, {0, 1e6}).unsaid_at("0"),
    text<check_currency, kMachine, &Extruder::material, &Material::currency>({"material", "currency"}).unsaid_at("EUR"),
    field<kMachine, &Extruder::material, &Material::max_melt_mm3_s>({"material", "max_melt_mm3_s"}, {0, 1000, " mm3/s"})
        .unsaid_at("0"),

    field<kMachine, &Extruder::speed, &Speed::print_mm_s>({"speed", "print_mm_s"}, kSpeed),
    field<kMachine, &Extruder::speed, &Speed::wall_mm_s>({"speed", "wall_mm_s"}, kSpeed),
    field<kMachine, &Extruder::speed, &Speed::inner_wall_mm_s>({"speed", "inner_wall_mm_s"}, kSpeed),
    field<kMachine, &Extruder::speed, &Speed::first_layer_mm_s>({"speed", "first_layer_mm_s"}, kSpeed),
    field<kMachine, &Extruder::speed, &Speed::travel_mm_s>({"speed", "travel_mm_s"}, kSpeed),
    field<kMachine, &Extruder::speed, &Speed::lift_mm_s>({"speed", "lift_mm_s"}, kSpeed),
    custom<Profile, read_acceleration, write_acceleration>({"speed", "acceleration_mm_s2"}, Form::kBare),
    field<kMachine, &Extruder::speed, &Speed::corner_mm_s>({"speed", "corner_mm_s"}, {0.1, 1000, " mm/s"}),

    field<kMachine, &Extruder::retraction, &Retraction::length_mm>({"retraction", "length_mm"}, {0, 50, " mm"}),
    field<kMachine, &Extruder::retraction, &Retraction::speed_mm_s>({"retraction", "speed_mm_s"}, {0.1, 1000, " mm/s"}),
    field<kMachine, &Extruder::retraction, &Retraction::min_travel_mm>({"retraction", "min_travel_mm"}, {0, 1000, " mm"}),
    field<kMachine, &Extruder::retraction, &Retraction::inside>({"retraction", "inside"}).unsaid_at("false"),
    field<kMachine, &Extruder::retraction, &Retraction::detour_mm>({"retraction", "detour_mm"}, {0, 1000, " mm"})
        .unsaid_at("0"),
    field<kMachine, &Extruder::retraction, &Retraction::wipe_mm>({"retraction", "wipe_mm"}, {0, 50, " mm"}).unsaid_at("0"),
    field<kMachine, &Extruder::retraction, &Retraction::lift_mm>({"retraction", "lift_mm"}, {0, 50, " mm"}).unsaid_at("0"),

    field<kMachine, &Extruder::skirt, &Skirt::loops>({"skirt", "loops"}, {0, 100}),
    field<kMachine, &Extruder::skirt, &Skirt::distance_mm>({"skirt", "distance_mm"}, {0, 100, " mm"}),
    field<kMachine, &Extruder::skirt, &Skirt::min_mm>({"skirt", "min_mm"}, {0, 10'000, " mm"}),

    field<kMachine, &Extruder::fan, &Fan::percent>({"fan", "percent"}, {0, 100, " %"}),
    field<kMachine, &Extruder::fan, &Fan::from_layer>({"fan", "from_layer"}, {0, 1'000'000}),
    field<kMachine, &Extruder::fan, &Fan::full_layer>({"fan", "full_layer"}, {0, 1'000'000}).unsaid_at("0"),
    field<kMachine, &Extruder::fan, &Fan::min_layer_s>({"fan", "min_layer_s"}, {0, 600, " s"}).unsaid_at("0"),
    field<kMachine, &Extruder::fan, &Fan::min_print_mm_s>({"fan", "min_print_mm_s"}, kSpeed).unsaid_at("10"),

    text<check_flavor, kMachine, &Extruder::code, &Code::flavor>({"code", "flavor"}),
    field<kMachine, &Extruder::code, &Code::relative_extrusion>({"code", "relative_extrusion"}),
    field<kMachine, &Extruder::code, &Code::progress>({"code", "progress"}).unsaid_at("false"),
    text<check_objects, kMachine, &Extruder::code, &Code::objects>({"code", "objects"}).unsaid_at("none"),
    field<kMachine, &Extruder::code, &Code::thumbnail_px>({"code", "thumbnail_px"}, {0, 1000, " pixels"}).unsaid_at("0,0"),
    code<&Extruder::code, &Code::start>("code", "start"),
    code<&Extruder::code, &Code::end>("code", "end"),
    code<&Extruder::code, &Code::layer>("code", "layer"),
    code<&Extruder::code, &Code::plain_pressure>("code", "plain_pressure"),

    structure<read_commands, write_commands, kMachine, &Extruder::sml, &Sml::pd>({"sml", "pd"}),
    code<&Extruder::sml, &Sml::header>("sml", "header"),
    code<&Extruder::sml, &Sml::footer>("sml", "footer"),
    code<&Extruder::sml, &Sml::height>("sml", "height"),
    code<&Extruder::sml, &Sml::travel>("sml", "travel"),
    code<&Extruder::sml, &Sml::draw>("sml", "draw"),

    custom<Profile, read_source, write_source>({"calibration", "source"}, Form::kString),
    field<kCalibration, &Calibration::width_mm>({"calibration", "width_mm"}, {0.01, 20, " mm"}),
    field<kCalibration, &Calibration::height_mm>({"calibration", "height_mm"}, {0.01, 20, " mm"}),
    field<kCalibration, &Calibration::speed_mm_s>({"calibration", "speed_mm_s"}, {0.01, 2000, " mm/s"}),
    table<&Calibration::by_speed, Calibration::BySpeed, &Calibration::BySpeed::percent, &Calibration::BySpeed::thin_mm,
          &Calibration::BySpeed::stable_mm, &Calibration::BySpeed::swell_mm>("by_speed"),
    table<&Calibration::by_extrusion, Calibration::ByExtrusion, &Calibration::ByExtrusion::percent,
          &Calibration::ByExtrusion::thin_mm>("by_extrusion"),
    table<&Calibration::repeated, Calibration::Repeated, &Calibration::Repeated::extrusion_percent,
          &Calibration::Repeated::thin_speed_percent, &Calibration::Repeated::thick_speed_percent,
          &Calibration::Repeated::thick_mm, &Calibration::Repeated::thin_mm, &Calibration::Repeated::continuous_mm>("repeated"),
    table<&Calibration::spacing, Calibration::Spaced, &Calibration::Spaced::extrusion_percent,
          &Calibration::Spaced::segmented_mm, &Calibration::Spaced::continuous_mm>("spacing"),
};

}  // namespace

Result<ExtruderProfile> read_extruder(const ProfileFiles& files, ExtruderProfile profile) {
  if (have_section(files, "head") || have_section(files, "powder"))
    return usage("{}: is the profile of a powder printer; lamina jet takes it", files.back().where);
  if (Status status = read_sections<Profile>(files, kKeys, profile, profile.machine.name); !status) return status.error();
  return profile;
}

std::string set_extruder_key(std::string_view name, std::string_view value, ExtruderProfile& profile) {
  const std::size_t dot = std::min(name.find('.'), name.size());
  const Text section = name.substr(0, dot), key_name = name.substr(std::min(dot + 1, name.size()));
  const auto sections = section_names<Profile>(kKeys);
  if (std::ranges::find(sections, section) == sections.end()) {
    return fmt::format("{}: {}", one_line(section), no_such_section(section, sections));
  }
  std::string wrong;
  const auto* key = find_key<Profile>(kKeys, section, key_name, wrong);
  if (key != nullptr) wrong = key->read(value, profile);
  return wrong.empty() ? wrong : fmt::format("{}: {}", one_line(name), wrong);
}

std::string extruder_text(const ExtruderProfile& profile) {
  return sections_text<Profile>(kKeys, profile, [&](const Key<Profile>& key, const std::string& value) {
    if (key.name == "bead_area" && value.empty()) return false;
    if (key.name == "acceleration_mm_s2" && !profile.machine.speed.states_acceleration) return false;
    // Older keys are always written: the manifest of a job has the hash of this text.
    if (key.unsaid == value && key.section != "bed") return false;
    return key.section != "calibration" || profile.own_calibration;
  });
}

std::string material_text(const ExtruderProfile& profile, const std::vector<std::string>& keys) {
  constexpr Text kOfMachine[] = {"nozzle_mm", "bead_area", "flow", "feed_ratio", "lag_s"};
  return sections_text<Profile>(kKeys, profile, [&](const Key<Profile>& key, const std::string&) {
    if (std::ranges::find(keys, fmt::format("{}.{}", key.section, key.name)) == keys.end()) return false;
    return key.section == "fan" ||
           (key.section == "material" && std::ranges::find(kOfMachine, key.name) == std::end(kOfMachine));
  });
}

namespace {

/// Whether a name is section.key, spelt as keys of profiles are: others could not be written and read again.
bool is_name(std::string_view name) {
  const std::size_t dot = name.find('.');
  const auto is_bare = [](std::string_view key) {
    return !key.empty() && std::ranges::all_of(key, [](char c) {
      return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_';
    });
  };
  return dot != std::string_view::npos && is_bare(name.substr(0, dot)) && is_bare(name.substr(dot + 1));
}

}  // namespace

std::string read_changes(const TomlValue& table, ProfileChanges& changes, TextPosition& at) {
  if (!table.is_table()) return "is a table of keys of the machine's profile, as in fan.from_layer = 2";
  ProfileChanges read;
  for (std::size_t s = 0; s < table.value.size(); ++s) {
    at = table.value[s].position;
    if (!table.value[s].is_table()) return fmt::format("{}: is not section.key, as in fan.from_layer = 2", table.name[s]);
    for (std::size_t i = 0; i < table.value[s].value.size(); ++i) {
      at = table.value[s].value[i].position;
      const std::string name = fmt::format("{}.{}", table.name[s], table.value[s].name[i]);
      if (!is_name(name)) return fmt::format("'{}' is not section.key, as in fan.from_layer", name);
      const auto text = flat_text(table.value[s].value[i]);
      if (!text) return fmt::format("{}: is not a single value or a list of them", name);
      read.emplace_back(name, *text);
    }
  }
  changes = std::move(read);
  return {};
}

std::string read_changes(std::string_view text, ProfileChanges& changes) {
  if (text.starts_with('{')) {
    TextPosition unused;
    const auto table = read_toml_value(text);
    return table ? read_changes(*table, changes, unused) : "is no table";
  }
  ProfileChanges read;
  for (std::string_view change : split(text, ";")) {
    change = trimmed(change);
    if (change.empty()) continue;
    const std::size_t equals = change.find('=');
    const std::string_view name = trimmed(change.substr(0, equals));
    if (equals == std::string_view::npos || !is_name(name)) return fmt::format("'{}' is not section.key=value", change);
    read.emplace_back(name, change.substr(equals + 1));
  }
  std::ranges::stable_sort(read, {}, &ProfileChanges::value_type::first);  // as a table is read: the same job is the same text
  const auto twice = std::ranges::adjacent_find(read, {}, &ProfileChanges::value_type::first);
  if (twice != read.end()) return fmt::format("{} is set twice", twice->first);
  changes = std::move(read);
  return {};
}

std::string changes_text(const ProfileChanges& changes) {
  std::string text;
  for (const auto& [name, value] : changes) text += fmt::format("{}{} = {}", text.empty() ? "" : ", ", name, toml_text(value));
  return text.empty() ? text : fmt::format("{{ {} }}", text);
}

}  // namespace lamina::pipeline
