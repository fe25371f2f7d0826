// Profiles of other slicers: values that were read from the files by hand or by bench/imports.py, and what is refused.
#include <gtest/gtest.h>

#include "pipeline/machine/import/bed_outline.h"
#include "pipeline/machine/import/import_profile.h"
#include "pipeline/machine/import/slicer_code.h"
#include "pipeline/machine/profiles.h"
#include "tests/commands/program.h"

namespace lamina::pipeline {
namespace {

constexpr std::string_view kBundle = R"([vendor]
name = Acme

[printer:*common*]
bed_shape = 0x0,200x0,200x180,0x180
max_print_height = 210
nozzle_diameter = 0.4
gcode_flavor = marlin
retract_length = 1,2
retract_before_travel = 2
retract_speed = 0
use_relative_e_distances = 1
default_print_profile = 0.2mm
default_filament_profile = "Acme PLA";"Acme ABS"
start_gcode = G28 ; home\nM104 S[first_layer_temperature]\nM190 S{first_layer_bed_temperature[0]}\nM109 S{temperature[initial_extruder]}
end_gcode = "M104 S0\nM117 \"Done\"\n"
thumbnails = 16x16

[printer:*long*]
retract_length = 4
max_print_height = 300

[printer:One]
inherits = *common*

[printer:Two]
inherits = *common*; *long*
max_print_height = 290
end_gcode = {if layer_z < 20}G1 Z30{endif}

[print:0.2mm]
infill_speed = 80
perimeter_speed = 50
external_perimeter_speed = 50%
first_layer_speed = 20
travel_speed = 150
default_acceleration = 900
skirts = 2

[filament:*base*]
filament_diameter = 1.75
filament_density = 1.24
temperature = 210
first_layer_temperature = 215
bed_temperature = 60
first_layer_bed_temperature = 65
filament_cost = 20.5
filament_retract_length = nil
fan_always_on = 1
min_fan_speed = 80
disable_fan_first_layers = 2
filament_type = PLA

[filament:Acme PLA]
inherits = *base*

[filament:Acme ABS]
inherits = *base*
temperature = 250
filament_retract_length = 0.7
filament_max_volumetric_speed = 11
fan_always_on = 0

[printer:Round]
inherits = *common*; Ring

[printer:Ring]
inherits = Round
)";

Result<ImportedProfile> from_bundle(const std::string& printer, const std::string& filament = {}, bool plain_code = false) {
  return import_profile(kBundle, "acme.ini", {{printer, filament}, plain_code});
}

ExtruderProfile profile_of(const Result<ImportedProfile>& imported) {
  EXPECT_TRUE(imported.ok()) << imported.error().message;
  if (!imported) return {};
  const auto profile = read_extruder(imported->text, "imported.toml");
  EXPECT_TRUE(profile.ok()) << profile.error().message;
  return profile ? *profile : ExtruderProfile();
}

void expect_refused_as(const Result<ImportedProfile>& imported, Fault fault, std::string_view words) {
  ASSERT_FALSE(imported.ok()) << words;
  EXPECT_EQ(imported.error().fault, fault) << imported.error().message;
  EXPECT_NE(imported.error().message.find(words), std::string::npos) << imported.error().message;
  EXPECT_EQ(imported.error().message.find('\n'), std::string::npos);
}

TEST(ImportedProfiles, OfABundleHaveWhatTheirSectionsInherit) {
  const auto imported = from_bundle("One");
  const Extruder one = profile_of(imported).machine;
  EXPECT_EQ(one.name, "One");
  EXPECT_EQ(one.bed.size_mm, (std::array<double, 2>{200, 180}));
  EXPECT_EQ(one.bed.build_height_mm, 210);
  EXPECT_EQ(one.material.name, "PLA");
  EXPECT_EQ(one.material.nozzle_degc, 210);
  EXPECT_EQ(one.material.first_nozzle_degc, 215);
  EXPECT_EQ(one.material.bed_degc, 60);
  EXPECT_EQ(one.material.first_bed_degc, 65);
  EXPECT_EQ(one.material.price_kg, 20.5);
  EXPECT_EQ(one.retraction.length_mm, 1) << "of the first extruder; nil is no value";
  EXPECT_EQ(one.retraction.speed_mm_s, Extruder().retraction.speed_mm_s) << "0 is unset";
  EXPECT_EQ(one.speed.print_mm_s, 80);
  EXPECT_EQ(one.speed.wall_mm_s, 25) << "50 % of inner walls";
  EXPECT_EQ(one.speed.acceleration_mm_s2, 900);
  EXPECT_TRUE(one.speed.states_acceleration);
  EXPECT_EQ(one.skirt.loops, 2u);
  EXPECT_EQ(one.fan.percent, 80);
  EXPECT_EQ(one.fan.from_layer, 2u);
  EXPECT_EQ(one.code.start, "G28 ; home\nM104 S{first_nozzle_degc}\nM190 S{first_bed_degc}\nM109 S{nozzle_degc}\n");
  EXPECT_EQ(one.code.end, "M104 S0\nM117 \"Done\"\n");
  EXPECT_EQ(imported->unused, std::vector<std::string>{"thumbnails"});
  EXPECT_TRUE(imported->text.starts_with(kImportMark));

  const Extruder two = profile_of(from_bundle("Two", "Acme ABS", true)).machine;
  EXPECT_EQ(two.bed.build_height_mm, 290) << "its own value, not that of a base";
  EXPECT_EQ(two.retraction.length_mm, 0.7) << "the filament's, not the printer's";
  EXPECT_EQ(two.material.nozzle_degc, 250);
  EXPECT_EQ(two.material.max_melt_mm3_s, 11);
  EXPECT_EQ(two.fan.percent, 0);
  EXPECT_EQ(two.code.end, find_extruder("marlin")->machine.code.end) << "a condition";
  EXPECT_TRUE(two.code.start.starts_with("G28 ; home\n")) << "translated as without --plain-code";
}

TEST(ImportedProfiles, AreRefusedInOneLineThatSaysWhy) {
  expect_refused_as(from_bundle(""), Fault::kUsage, "name one with --printer: 'One', 'Ring', 'Round', 'Two'");
  expect_refused_as(from_bundle("Onw"), Fault::kUsage, "did you mean 'One'?");
  expect_refused_as(from_bundle("*common*"), Fault::kUsage, "no such section");
  expect_refused_as(from_bundle("One", "Acme PVA"), Fault::kUsage, "--filament 'Acme PVA'");
  expect_refused_as(from_bundle("Round"), Fault::kUsage, "goes round in a circle: Round > Ring > Round");
  expect_refused_as(from_bundle("Two"), Fault::kUsage, "end_gcode: 'if layer_z < 20' is a condition");
  const auto text = [](std::string_view config) { return import_profile(config, "a.ini", {}); };
  expect_refused_as(text(""), Fault::kUsage, "neither a bed nor temperatures");
  expect_refused_as(text("temperature = \n"), Fault::kUsage, "has no value of a material");
  expect_refused_as(text("solid cube\n facet\n"), Fault::kInput, "a.ini:1: 'solid cube' is not key = value");
  expect_refused_as(text(std::string_view("bed_shape = 0x0\0", 16)), Fault::kUsage, "no text");
  expect_refused_as(text("[machine]\nname = \"x\"\n"), Fault::kUsage, "has no section [printer:NAME]");
  expect_refused_as(text("bed_shape = 0x0,1e9x0,1x1\n"), Fault::kInput, "bed_shape = 0x0,1e9x0,1x1: is no list of points");
  expect_refused_as(text("bed_shape = 0x0,9x0,9x9,0x9\ntemperature = hot\n"), Fault::kInput, "temperature = hot");
  expect_refused_as(text("bed_shape = 0x0,9x0,9x9,0x9\ntemperature = 9000\n"), Fault::kInput, "9000 is out of range");
  expect_refused_as(text("bed_shape = 0x0,9x0,9x9,0x9\ngcode_flavor = sailfish\n"), Fault::kUsage, "gcode_flavor = sailfish");
  expect_refused_as(text("{\"type\": \"machine\""), Fault::kInput, "is no JSON");
  expect_refused_as(text(std::string(100'000, '[').insert(0, "{\"a\":")), Fault::kInput, "nests deeper");
  expect_refused_as(text("{\"type\": \"machine_model\"}"), Fault::kUsage, "the type 'machine_model'");
  expect_refused_as(text("{}"), Fault::kUsage, "which has a type");
  expect_refused_as(import_profile("/nowhere/a.ini", {}), Fault::kUsage, "no such file");
}

// 2^40 visits of sections, if each base were read as often as it is named.
TEST(ImportedProfiles, OfSectionsThatMultiplyAreRefusedInTime) {
  std::string bundle = "[printer:s0]\nbed_shape = 0x0,9x0,9x9,0x9\n";
  for (int i = 1; i < 31; ++i)
    bundle += fmt::format("[printer:s{}]\ninherits = s{};s{};s{};s{}\n", i, i - 1, i - 1, i - 1, i - 1);
  expect_refused_as(import_profile(bundle, "a.ini", {{"s30", ""}, false}), Fault::kUsage, "inherits more than");
  for (int i = 31; i < 40; ++i) bundle += fmt::format("[printer:s{}]\ninherits = s{}\n", i, i - 1);
  expect_refused_as(import_profile(bundle, "a.ini", {{"s39", ""}, false}), Fault::kUsage, "over more than 32 sections");
}

TEST(ImportedProfiles, TakeTravelsAndLayerTimes) {
  const std::string bed = "bed_shape = 0x0,9x0,9x9,0x9\ntemperature = 200\n";
  const auto machine_of = [&](const std::string& settings) {
    return profile_of(import_profile(bed + settings, "a.ini", {})).machine;
  };
  const Extruder all = machine_of(
      "retract_lift = 0.3\nonly_retract_when_crossing_perimeters = 1\ncooling = 1\nslowdown_below_layer_time = 7\n"
      "min_print_speed = 15\n");
  EXPECT_EQ(all.retraction.lift_mm, 0.3);
  EXPECT_TRUE(all.retraction.inside);
  EXPECT_EQ(all.fan.min_layer_s, 7);
  EXPECT_EQ(all.fan.min_print_mm_s, 15);
  const Extruder off = machine_of(
      "only_retract_when_crossing_perimeters = 0\ncooling = 0\nslowdown_below_layer_time = 7\nmin_print_speed = 0\n");
  EXPECT_FALSE(off.retraction.inside);
  EXPECT_EQ(off.fan.min_layer_s, 0);
  EXPECT_EQ(off.fan.min_print_mm_s, 10) << "0 is unset";
}

TEST(ImportedProfiles, OfAFilamentAreAMaterial) {
  const auto imported = import_profile(
      "temperature = 240\nfirst_layer_temperature = 230\nfilament_type = PETG\nfilament_cost = 25\n", "f.ini", {});
  ASSERT_TRUE(imported.ok()) << imported.error().message;
  EXPECT_EQ(imported->text.find("[bed]"), std::string::npos);
  test::Directory directory;
  test::write_text(directory / "petg.toml", imported->text);
  const auto profile = find_extruder("marlin", directory / "petg.toml");
  ASSERT_TRUE(profile.ok()) << profile.error().message;
  EXPECT_EQ(profile->machine.name, "Marlin");
  EXPECT_EQ(profile->machine.material.nozzle_degc, 240);
  EXPECT_EQ(profile->machine.material.name, "PETG");
  EXPECT_EQ(profile->machine.material.price_kg, 25);
}

// Of a printer with other filament, a material changes only what its file states.
TEST(ImportedProfiles, OfAFilamentStateWhatTheirFileStates) {
  const auto imported = import_profile("temperature = 240\nfilament_type = \"PET, glycol\";PLA\n", "f.ini", {});
  ASSERT_TRUE(imported.ok()) << imported.error().message;
  EXPECT_NE(imported->text.find("name = \"PET, glycol\""), std::string::npos) << imported->text;
  EXPECT_NE(imported->text.find("first_nozzle_degc = 240"), std::string::npos) << imported->text;
  EXPECT_EQ(imported->notes,
            std::vector<std::string>{"material.first_nozzle_degc is not in the file; it is material.nozzle_degc, 240"});
  for (const char* absent : {"filament_mm", "density", "bed_degc", "price", "[fan]"})
    EXPECT_EQ(imported->text.find(absent), std::string::npos) << absent << imported->text;
}

TEST(ImportedProfiles, OfOrcaFollowTheirBasesAndDefaults) {
  const std::string folder = std::string(LAMINA_TEST_DIR) + "/corpus/orca/";
  const auto of = [&](const std::string& file) { return import_profile(folder + file, {}); };
  const Extruder one = profile_of(of("machine/Acme_One_0.6.json")).machine;
  EXPECT_EQ(one.bed.size_mm, (std::array<double, 2>{235, 235}));
  EXPECT_EQ(one.material.nozzle_mm, 0.6);
  EXPECT_EQ(one.retraction.length_mm, 1.1) << "of its default filament";
  EXPECT_EQ(one.material.name, "PETG");
  EXPECT_EQ(one.material.flow, 0.98);
  EXPECT_EQ(one.material.first_nozzle_degc, 250);
  EXPECT_EQ(one.material.bed_degc, 75);
  EXPECT_EQ(one.speed.wall_mm_s, 60);
  EXPECT_EQ(one.speed.acceleration_mm_s2, 3000);
  EXPECT_EQ(one.speed.lift_mm_s, 12);
  EXPECT_EQ(one.fan.from_layer, 3u);
  EXPECT_EQ(one.code.layer, ";LAYER:{layer}\n");
  EXPECT_EQ(one.code.start,
            "M140 S{first_bed_degc}\nM104 S210\nG28\nM190 S{first_bed_degc}\nM109 S{first_nozzle_degc}\nG1 X215 F18000\n");
  const auto round = of("machine/Acme_Delta_0.4.json");
  const Extruder delta = profile_of(round).machine;
  EXPECT_EQ(delta.code.flavor, "Klipper");
  EXPECT_EQ(delta.bed.size_mm, (std::array<double, 2>{141.4, 141.4}));
  EXPECT_EQ(delta.bed.corner_mm, (std::array<double, 2>{-70.7, -70.7}));
  EXPECT_EQ(delta.code.start,
            "M190 S{first_bed_degc}\nM104 S{first_nozzle_degc}\nPRINT_START EXTRUDER={first_nozzle_degc} BED={first_bed_degc}\n"
            "M109 S{first_nozzle_degc}\n");
  const auto filament = of("filament/Acme_PLA.json");
  ASSERT_TRUE(filament.ok());
  EXPECT_NE(filament->text.find("max_melt_mm3_s = 16"), std::string::npos) << filament->text;
  const auto chosen = import_profile(folder + "machine/Acme_One_0.4.json", {{"", "Acme_PETG"}, false});
  EXPECT_EQ(profile_of(chosen).machine.material.nozzle_degc, 245);
  const auto unknown = import_profile(folder + "machine/Acme_One_0.4.json", {{"", "Acme_PVA"}, false});
  expect_refused_as(unknown, Fault::kUsage, "--filament: no file 'Acme_PVA.json'");
  expect_refused_as(of("broken/circle.json"), Fault::kUsage, "goes round in a circle");
  expect_refused_as(of("broken/no_base.json"), Fault::kUsage, "no file 'nowhere.json'");
  expect_refused_as(of("process/0.20mm_Acme.json"), Fault::kUsage, "the type 'process'");
}

TEST(ImportedProfiles, HaveCodeWithTheirValues) {
  SlicerSettings settings;
  settings.set("temperature", "210,220");
  settings.set("travel_speed", "150");
  settings.set("printer_model", "Acme");
  std::vector<std::string> notes;
  const auto translated = [&](const std::string& code, std::string_view key = "start_gcode") {
    const auto text = translate_code(key, code, settings, notes);
    return text ? *text : "refused: " + text.error().message;
  };
  EXPECT_EQ(translated("S[temperature] S{temperature[0]} S[temperature_0]"), "S{nozzle_degc} S{nozzle_degc} S{nozzle_degc}");
  EXPECT_EQ(translated("S{temperature[1]}"), "S220") << "another extruder's is a number";
  EXPECT_EQ(translated("F{travel_speed*60} ; {printer_model} T[initial_tool]"), "F9000 ; Acme T0");
  EXPECT_TRUE(notes.empty());
  EXPECT_EQ(translated("S{temperature[0]-(5+max(1, 2))}"), "S203");
  EXPECT_EQ(notes.size(), 1u);
  EXPECT_EQ(translated("[1] M117 a]b"), "[1] M117 a]b");
  EXPECT_EQ(translated("{layer_num}", "layer_gcode"), "{layer}");
  for (const char* code : {"{layer_z}", "{", "[a", "{travel_speed*}", "{system(1)}", "{if 1}", "{max_layer_z+2}",
                           "{temperature[x]}", "{}", "{1/0}", "{elsif a}", "[unknown]"}) {
    EXPECT_TRUE(translated(code).starts_with("refused: start_gcode: '")) << code << translated(code);
  }
}

TEST(BedOutlines, AreRectanglesOrTheRectangleWithin) {
  const auto square = read_bed_outline("-10x-20, 10x-20,10x20,-10x20");
  ASSERT_TRUE(square.ok());
  EXPECT_TRUE(square->rectangular);
  EXPECT_EQ(square->corner_mm, (std::array<double, 2>{-10, -20}));
  EXPECT_EQ(square->size_mm, (std::array<double, 2>{20, 40}));
  std::string circle;
  for (int i = 0; i < 360; ++i)
    circle += fmt::format("{}{:.4f}x{:.4f}", i == 0 ? "" : ",", 100 * std::cos(i * 3.14159265358979 / 180),
                          100 * std::sin(i * 3.14159265358979 / 180));
  const auto round = read_bed_outline(circle);
  ASSERT_TRUE(round.ok());
  EXPECT_FALSE(round->rectangular);
  EXPECT_NEAR(round->size_mm[0], 200 / std::sqrt(2.0), 0.11);
  for (const char* wrong : {"", "1", "0x0,1x1", "0x0,0x5,0x9", "0x0,nanx1,1x1", "0x0x0,1x1,2x2"})
    EXPECT_FALSE(read_bed_outline(wrong).ok()) << wrong;
}

}  // namespace
}  // namespace lamina::pipeline
