#include "pipeline/machine/import/import_profile.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <optional>
#include <utility>

#include "pipeline/job/errors.h"
#include "pipeline/job/profiles/extruder.h"
#include "pipeline/machine/import/bed_outline.h"
#include "pipeline/machine/import/orca_config.h"
#include "pipeline/machine/import/slicer_code.h"
#include "pipeline/machine/profiles.h"
#include "stages/support/io/file_reader.h"
#include "stages/support/text/json_text.h"
#include "stages/support/text/number_text.h"
#include "stages/support/text/readable.h"

namespace lamina::pipeline {
namespace {

/// A key of lamina and those of other slicers, in the order in which they count. A percentage is relative to `whole`.
struct ImportedKey {
  std::string_view key;
  std::array<std::string_view, 4> from;
  std::string_view whole = {};
  bool zero_is_unset = false;
};

// PrusaSlicer's key first (src/libslic3r/PrintConfig.cpp), then Orca's (the same file there).
constexpr ImportedKey kMaterialKeys[] = {
    {"material.filament_mm", {"filament_diameter"}},
    {"material.density_g_cm3", {"filament_density"}, {}, true},
    {"material.price_kg", {"filament_cost"}},
    {"material.max_melt_mm3_s", {"filament_max_volumetric_speed"}},
    {"material.nozzle_degc", {"temperature", "nozzle_temperature"}},
    {"material.first_nozzle_degc", {"first_layer_temperature", "nozzle_temperature_initial_layer"}},
    {"material.bed_degc", {"bed_temperature", "hot_plate_temp"}},
    {"material.first_bed_degc", {"first_layer_bed_temperature", "hot_plate_temp_initial_layer"}},
    {"fan.from_layer", {"disable_fan_first_layers", "close_fan_the_first_x_layers"}},
    {"fan.min_layer_s", {"slowdown_below_layer_time", "slow_down_layer_time"}},
    {"fan.min_print_mm_s", {"min_print_speed", "slow_down_min_speed"}, {}, true}};
/// Of all layers, and of the first.
constexpr std::pair<const char*, const char*> kTemperatures[] = {{"material.nozzle_degc", "material.first_nozzle_degc"},
                                                                 {"material.bed_degc", "material.first_bed_degc"}};
constexpr ImportedKey kPrinterKeys[] = {
    {"bed.build_height_mm", {"max_print_height", "printable_height"}},
    {"material.nozzle_mm", {"nozzle_diameter"}},
    {"material.flow", {"extrusion_multiplier", "filament_flow_ratio"}},
    {"retraction.length_mm", {"filament_retract_length", "filament_retraction_length", "retract_length", "retraction_length"}},
    {"retraction.speed_mm_s",
     {"filament_retract_speed", "filament_retraction_speed", "retract_speed", "retraction_speed"},
     {},
     true},
    {"retraction.min_travel_mm",
     {"filament_retract_before_travel", "filament_retraction_minimum_travel", "retract_before_travel",
      "retraction_minimum_travel"}},
    {"retraction.lift_mm", {"filament_retract_lift", "filament_z_hop", "retract_lift", "z_hop"}},
    {"speed.print_mm_s", {"infill_speed", "sparse_infill_speed"}, {}, true},
    {"speed.inner_wall_mm_s", {"perimeter_speed", "inner_wall_speed"}, {}, true},
    {"speed.wall_mm_s", {"external_perimeter_speed", "outer_wall_speed"}, "speed.inner_wall_mm_s", true},
    {"speed.first_layer_mm_s", {"first_layer_speed", "initial_layer_speed"}, "speed.inner_wall_mm_s", true},
    {"speed.travel_mm_s", {"travel_speed"}, {}, true},
    {"speed.lift_mm_s", {"travel_speed_z", "machine_max_feedrate_z", "machine_max_speed_z"}, {}, true},
    {"speed.acceleration_mm_s2", {"default_acceleration", "machine_max_acceleration_extruding"}, {}, true},
    {"speed.corner_mm_s", {"machine_max_jerk_x"}, {}, true},
    {"skirt.loops", {"skirts", "skirt_loops"}},
    {"skirt.distance_mm", {"skirt_distance"}},
    {"skirt.min_mm", {"min_skirt_length"}}};

constexpr std::pair<std::string_view, std::string_view> kFirmwares[] = {{"marlin", "Marlin"},         {"marlin2", "Marlin"},
                                                                        {"reprapfirmware", "RepRap"}, {"reprap", "RepRap"},
                                                                        {"repetier", "Repetier"},     {"klipper", "Klipper"}};

class ProfileImporter {
 public:
  ProfileImporter(PrusaConfig config, const std::string& path, const ImportRequest& request)
      : config_(std::move(config)), settings_(config_.settings), path_(path), request_(request) {
    profile_.machine.speed.states_acceleration = false;
  }

  Result<ImportedProfile> import() {
    const bool printer = settings_.has("bed_shape") || settings_.has("printable_area");
    if (!printer && !settings_.has("temperature") && !settings_.has("nozzle_temperature"))
      return usage(
          "{}: has neither a bed nor temperatures; name a configuration of PrusaSlicer, or a preset of Orca or BambuStudio",
          path_);
    if (Status status = printer ? set_printer() : Status(); !status) return status.error();
    if (Status status = set_material(); !status) return status.error();
    const auto of_material = [](const std::string& key) { return key.starts_with("material."); };
    if (!printer && std::ranges::none_of(set_, of_material))
      return usage("{}: has no value of a material; export the filament's settings again", path_);
    ImportedProfile imported;
    std::string source = std::filesystem::path(path_).filename().string();
    if (!request_.choice.printer.empty()) source += ", " + request_.choice.printer;
    if (!is_utf8(source)) source = "a file";  // TOML is UTF-8
    imported.text = fmt::format("{} from {}\n\n{}", kImportMark, one_line(source),
                                printer ? extruder_text(profile_) : material_text(profile_, set_));
    imported.notes = std::move(config_.notes);
    imported.unused = settings_.unused();
    return imported;
  }

 private:
  Error wrong(std::string_view key, std::string_view value, std::string_view what) const {
    return failure(Fault::kInput, "{}: {} = {}: {}", path_, key, one_line(value.substr(0, 60)), what);
  }

  /// Sets a key of the profile. from  the setting, for messages
  Status set(std::string_view key, const std::string& value, std::string_view from) {
    const std::string what = set_extruder_key(key, value, profile_);
    if (!what.empty()) return wrong(from, value, what);
    set_.emplace_back(key);
    return {};
  }

  /// The number of a setting; a percentage of `whole`. Nothing if it is absent, or 0 and that means absent.
  Result<std::optional<double>> number(const ImportedKey& row, std::string_view from, double whole) {
    const auto text = settings_.element(from);
    if (!text) return std::optional<double>();
    const bool percent = text->ends_with('%');
    double value = 0;
    const std::string what =
        read_number(std::string_view(*text).substr(0, text->size() - (percent ? 1 : 0)), -1e9, 1e9, "", value);
    if (!what.empty()) return wrong(from, *text, what);
    if (percent && row.whole.empty()) return wrong(from, *text, "is no number");
    if (percent) value *= whole / 100;
    return value == 0 && row.zero_is_unset ? std::optional<double>() : std::optional(value);
  }

  template <std::size_t N>
  Status set_all(const ImportedKey (&rows)[N]) {
    for (const ImportedKey& row : rows) {
      for (const std::string_view from : row.from) {
        if (from.empty()) break;
        const auto value = number(row, from, profile_.machine.speed.inner_wall_mm_s);
        if (!value) return value.error();
        if (!*value) continue;
        if (Status status = set(row.key, number_text(**value), from); !status) return status;
        break;
      }
    }
    return {};
  }

  Status set_printer() {
    Extruder& machine = profile_.machine;
    machine.name = config_.name.empty() ? one_line(std::filesystem::path(path_).stem().string()) : one_line(config_.name);
    const std::string key = settings_.has("bed_shape") ? "bed_shape" : "printable_area";
    const std::string shape = settings_.text(key).value_or("");
    const auto bed = read_bed_outline(shape);
    if (!bed) return wrong(key, shape, bed.error().message);
    if (!bed->rectangular)
      config_.notes.push_back(
          fmt::format("{}: is no rectangle; the bed is the largest part of its box that is on it, {:.1f} x {:.1f} mm", key,
                      bed->size_mm[0], bed->size_mm[1]));
    const auto pair_text = [](const std::array<double, 2>& pair) {
      return fmt::format("{},{}", number_text(pair[0]), number_text(pair[1]));
    };
    if (Status status = set("bed.size_mm", pair_text(bed->size_mm), key); !status) return status;
    if (Status status = set("bed.corner_mm", pair_text(bed->corner_mm), key); !status) return status;
    if (Status status = set_all(kPrinterKeys); !status) return status;
    machine.retraction.inside =
        is_on("only_retract_when_crossing_perimeters", false) || is_on("reduce_infill_retraction", false);
    if (Status status = set_firmware(); !status) return status;
    const std::array<double, 2> end{bed->corner_mm[0] + bed->size_mm[0], bed->corner_mm[1] + bed->size_mm[1]};
    settings_.set("print_bed_min", pair_text(bed->corner_mm));  // names that code may use
    settings_.set("print_bed_max", pair_text(end));
    settings_.set("print_bed_size", pair_text(bed->size_mm));
    if (Status status = set_code(); !status) return status;
    for (const char* name : {"print_bed_min", "print_bed_max", "print_bed_size"}) static_cast<void>(settings_.text(name));
    machine.description = fmt::format("{}; {:g} x {:g} x {:g} mm; {:g} mm nozzle", machine.code.flavor, machine.bed.size_mm[0],
                                      machine.bed.size_mm[1], machine.bed.build_height_mm, machine.material.nozzle_mm);
    return {};
  }

  /// The value of a switch; `unset` if it is absent.
  bool is_on(std::string_view from, bool unset) {
    const auto value = settings_.element(from);
    return value ? *value == "1" || *value == "true" : unset;
  }

  Status set_firmware() {
    const std::string flavor = settings_.element("gcode_flavor").value_or("marlin");
    const auto found = std::ranges::find(kFirmwares, flavor, &std::pair<std::string_view, std::string_view>::first);
    if (found == std::end(kFirmwares))
      return usage("{}: gcode_flavor = {}: lamina writes G-code for Marlin, RepRapFirmware, Repetier and Klipper", path_,
                   one_line(flavor));
    profile_.machine.code.flavor = found->second;
    // Absent: absolute in PrusaSlicer, relative in Orca (PrintConfig.cpp of both).
    const auto relative = settings_.element("use_relative_e_distances").value_or(settings_.has("bed_shape") ? "0" : "1");
    profile_.machine.code.relative_extrusion = relative != "0" && relative != "false";
    return {};
  }

  /// Adds the code of settings to `target`; `own` replaces what cannot be translated if that was requested.
  Status add_code(std::initializer_list<const char*> keys, const std::string& own, std::string& target) {
    for (const char* key : keys) {
      const auto text = settings_.text(key);
      if (!text || trimmed(*text).empty()) continue;
      const auto translation = translate_code(key, *text, settings_, config_.notes);
      if (!translation && request_.plain_code) {
        config_.notes.push_back(
            fmt::format("{}: {} (--plain-code)", key, own.empty() ? "is left out" : "is replaced by lamina's"));
        target = own;
        return {};
      }
      if (!translation) return Error{translation.error().fault, path_ + ": " + translation.error().message};
      target += *translation;
      if (target.back() != '\n') target += '\n';
    }
    return {};
  }

  Status set_code() {
    Extruder::Code& code = profile_.machine.code;
    const auto own = find_extruder(code.flavor == "Klipper"  ? "klipper"
                                   : code.flavor == "RepRap" ? "reprapfirmware"
                                                             : "marlin");
    if (!own) return own.error();
    const Extruder::Code& plain = own->machine.code;
    code.plain_pressure = plain.plain_pressure;
    if (Status status = add_code({"start_gcode", "machine_start_gcode"}, plain.start, code.start); !status) return status;
    if (Status status = add_code({"end_gcode", "machine_end_gcode"}, plain.end, code.end); !status) return status;
    const auto layer_keys = {"before_layer_gcode", "before_layer_change_gcode", "layer_gcode", "layer_change_gcode"};
    if (Status status = add_code(layer_keys, "", code.layer); !status) return status;
    if (settings_.element("autoemit_temperature_commands").value_or("1") != "0") code.start = with_heating(code.start);
    return {};
  }

  Status set_material() {
    if (Status status = set_all(kMaterialKeys); !status) return status;
    if (!is_on("cooling", true) || !is_on("slow_down_for_layer_cooling", true)) {
      if (Status status = set("fan.min_layer_s", "0", "cooling"); !status) return status;
    }
    for (const auto& [one, other] : kTemperatures) {
      if (Status status = copy_temperature(one, other); !status) return status;
      if (Status status = copy_temperature(other, one); !status) return status;
    }
    if (const auto name = settings_.element("filament_type"); name && !one_line(*name).empty()) {
      profile_.machine.material.name = one_line(*name);
      set_.emplace_back("material.name");
    }
    return set_fan();
  }

  bool is_set(std::string_view key) const { return std::ranges::find(set_, key) != set_.end(); }

  /// A temperature of the first or of the other layers that the file lacks is that of the others or of the first.
  Status copy_temperature(const char* from, const char* to) {
    if (!is_set(from) || is_set(to)) return {};
    const auto& m = profile_.machine.material;
    const bool nozzle = std::string_view(to).find("nozzle") != std::string_view::npos;
    const bool of_first = std::string_view(from).find("first") != std::string_view::npos;
    const double degc = nozzle ? (of_first ? m.first_nozzle_degc : m.nozzle_degc) : (of_first ? m.first_bed_degc : m.bed_degc);
    config_.notes.push_back(fmt::format("{} is not in the file; it is {}, {:g}", to, from, degc));
    return set(to, number_text(degc), from);
  }

  /// The speed of layers that take long: the fan is faster in short layers, which lamina's is not.
  Status set_fan() {
    const bool orca = settings_.has("fan_min_speed");
    const char* lowest = orca ? "fan_min_speed" : "min_fan_speed";
    if (!settings_.has(lowest)) return {};
    const std::string always = settings_.element(orca ? "reduce_fan_stop_start_freq" : "fan_always_on").value_or("0");
    const std::string speed = settings_.element(lowest).value_or("0");
    return set("fan.percent", always == "1" || always == "true" ? speed : "0", lowest);
  }

  PrusaConfig config_;
  SlicerSettings& settings_;
  const std::string& path_;
  const ImportRequest& request_;
  ExtruderProfile profile_;
  std::vector<std::string> set_;  // keys of the profile
};

}  // namespace

Result<ImportedProfile> import_profile(std::string_view text, const std::string& path, const ImportRequest& request) {
  const std::size_t first = text.find_first_not_of(" \t\r\n\xef\xbb\xbf");
  const bool json = first != std::string_view::npos && text[first] == '{';
  if (json && !request.choice.printer.empty()) return usage("--printer: {} is one preset; leave it out", path);
  auto config = json ? read_orca_config(text.substr(first), path, request.choice.filament)
                     : read_prusa_config(text, path, request.choice);
  return config ? ProfileImporter(std::move(*config), path, request).import() : config.error();
}

Result<ImportedProfile> import_profile(const std::string& path, const ImportRequest& request) {
  const auto text = read_file(path, {.fault = Fault::kUsage, .missing = "no such file", .max_bytes = kMaxTomlBytes});
  return text ? import_profile(*text, path, request) : text.error();
}

}  // namespace lamina::pipeline
