// lamina extrude --material, and lamina machines --import, as a user types them.
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <regex>

#include "tests/commands/program.h"

namespace lamina::test {
namespace {

using MaterialJson = nlohmann::json;

class MaterialCommands : public ::testing::Test {
 protected:
  MaterialCommands() { write_box(directory_ / "part.stl", {0, 0, 0}, {12, 10, 2}); }
  Outcome run(const std::string& line) { return run_lamina(words_of(line), directory_.path()); }
  Outcome done(const std::string& line) {
    Outcome outcome = run(line);
    EXPECT_EQ(outcome.code, 0) << line << outcome.err;
    return outcome;
  }
  void refused(const std::string& line, const std::string& words) { expect_refused(line, 2, words, directory_); }
  std::string extruded(const std::string& words) {
    done("extrude part.stl --layer 0.2 --fill raster --overwrite --quiet -o part.gcode " + words);
    return read_text(directory_ / "part.gcode");
  }
  Directory directory_;
};

TEST_F(MaterialCommands, AMaterialSetsTemperaturesFanAndCost) {
  const std::string code = extruded("--machine marlin --material petg");
  for (const char* line : {"\nM190 S85\n", "\nM109 S230\n", "S240", "S90", "; filament_density = 1.27\n"})
    EXPECT_NE(code.find(line), std::string::npos) << line;
  const auto json = MaterialJson::parse(done("extrude part.stl --layer 0.2 --material petg --dry-run --json").out);
  EXPECT_EQ(json["material"], "PETG");
  EXPECT_EQ(json["currency"], "EUR");
  EXPECT_NEAR(json["filament_cost"].get<double>(), json["filament_g"].get<double>() * 27.82 / 1000, 1e-9);
  const Outcome reported = done("extrude part.stl --layer 0.2 --material petg --dry-run");
  EXPECT_NE(reported.err.find(" of PETG\n"), std::string::npos) << reported.err;
  EXPECT_NE(reported.err.find(" EUR of filament, 27.82 per kg\n"), std::string::npos) << reported.err;
  const auto plain = MaterialJson::parse(done("extrude part.stl --layer 0.2 --dry-run --json").out);
  EXPECT_FALSE(plain.contains("material") || plain.contains("filament_cost"));
  EXPECT_NE(extruded("--material petg --nozzle-temperature 251").find("M109 S251"), std::string::npos) << "options come last";
}

/// The greatest volume per second of moves in a straight line, mm3/s.
double greatest_rate(const std::string& code) {
  double rate = 0, feed = 0, x = 0, y = 0;
  const std::regex rate_word("F([0-9.]+)"), move("G[01] X([-0-9.]+) Y([-0-9.]+)(?: E([-0-9.]+))?(?: F([0-9.]+))?");
  std::istringstream lines(code);
  for (std::string line; std::getline(lines, line);) {
    std::smatch word;
    if (std::regex_search(line, word, rate_word)) feed = std::stod(word[1]) / 60;
    if (!std::regex_search(line, word, move)) continue;
    const double to_x = std::stod(word[1]), to_y = std::stod(word[2]), length = std::hypot(to_x - x, to_y - y);
    x = to_x, y = to_y;
    if (word[3].matched && length > 0.5) rate = std::max(rate, std::stod(word[3]) / length * feed * 2.405281875);
  }
  return rate;
}

TEST_F(MaterialCommands, TheMeltRateLimitsTheSpeedOfBeadsAndOfNothingElse) {
  const std::string limited = extruded("--material tpu --print-speed 90 --wall-speed 90 --machine-set fan.min_layer_s=0");
  EXPECT_NEAR(greatest_rate(limited), 2.5, 0.02);
  const std::string without =
      extruded("--material tpu --print-speed 90 --wall-speed 90 --machine-set fan.min_layer_s=0;material.max_melt_mm3_s=0");
  EXPECT_GT(greatest_rate(without), 5);
  EXPECT_EQ(extruded("--machine-set material.max_melt_mm3_s=1000"), extruded("")) << "a limit that no bead reaches";
}

TEST_F(MaterialCommands, WhatIsNoMaterialOrTooHotIsRefused) {
  refused("extrude part.stl --material plastic --dry-run",
          "--material: no material 'plastic'; name a profile (a file that ends in .toml) or one of abs, asa, petg, pla, tpu");
  refused("extrude part.stl --material petgg --dry-run", "did you mean 'petg'?");
  refused("extrude part.stl --material marlin --dry-run", "no material 'marlin'");
  refused("extrude part.stl --material ./none.toml --dry-run", "none.toml: no such profile");
  write_text(directory_ / "speed.toml", "[speed]\nprint_mm_s = 3\n");
  refused("extrude part.stl --material ./speed.toml --dry-run", "speed.toml: [speed] is no section of a material");
  write_text(directory_ / "own.toml", "inherits = \"abs\"\n[material]\nname = \"Own\"\nnozzle_degc = 281\n");
  write_text(directory_ / "cool.toml",
             "inherits = \"marlin\"\n[machine]\nname = \"Cool\"\nmax_nozzle_degc = 260\nmax_bed_degc = 100\n");
  refused("extrude part.stl --machine ./cool.toml --material ./own.toml --dry-run",
          "Own: nozzle of 281 degrees: Cool reaches 260 (machine.max_nozzle_degc)");
  refused("extrude part.stl --machine ./cool.toml --material abs --dry-run", "ABS: bed of 110 degrees: Cool reaches 100");
  done("extrude part.stl --machine ./cool.toml --material abs --bed-temperature 100 --dry-run");
  refused("extrude part.stl --machine marlin --material abs --nozzle-temperature 261 --dry-run",
          "ABS: nozzle of 261 degrees: Marlin reaches 260 (machine.max_nozzle_degc)");
  write_text(directory_ / "self.toml", "inherits = \"self.toml\"\n");
  refused("extrude part.stl --material ./self.toml --dry-run", "self.toml:1:12: inherits: goes round in a circle");
}

TEST_F(MaterialCommands, AJobFileNamesAMaterialNextToIt) {
  std::filesystem::create_directory(directory_ / "jobs");
  write_text(directory_ / "jobs/own.toml", "inherits = \"pla\"\n[material]\nfirst_nozzle_degc = 233\n");
  write_text(directory_ / "jobs/job.toml", "[extrude]\nmaterial = \"own.toml\"\n[[part]]\npath = \"../part.stl\"\n");
  done("extrude --job jobs/job.toml --quiet -o out.gcode --save-job saved.toml");
  EXPECT_NE(read_text(directory_ / "out.gcode").find("M109 S233"), std::string::npos);
  EXPECT_NE(read_text(directory_ / "saved.toml").find("material = \"jobs/own.toml\""), std::string::npos);
  write_text(directory_ / "jobs/job.toml", "[extrude]\nmaterial = \"gone.toml\"\n[[part]]\npath = \"../part.stl\"\n");
  refused("extrude --job jobs/job.toml --dry-run", "jobs/job.toml:2:12: extrude.material: jobs/gone.toml: no such");
}

TEST_F(MaterialCommands, NozzlesOfTheFdm2000HaveTheirThicknesses) {
  for (const auto& [machine, layer] :
       {std::pair{"fdm-2000", "0.178"}, {"fdm-2000-t10", "0.254"}, {"fdm-2000-t16", "0.305"}, {"fdm-2000-t16", "0.356"}})
    done(std::string("extrude part.stl --bead 0.508 --dry-run --machine ") + machine + " --layer " + layer);
  refused("extrude part.stl --bead 0.508 --dry-run --machine fdm-2000-t16 --layer 0.178", "0.254, 0.305, 0.356");
  refused("extrude part.stl --dry-run --machine fdm-2000 --material abs", "--material: is not in SML");
  EXPECT_NE(done("machines --check fdm-2000-t10").out.find("nozzle    0.254 mm"), std::string::npos);
}

TEST_F(MaterialCommands, AnImportedPrinterPrints) {
  write_text(
      directory_ / "mine.ini",
      "bed_shape = 10x0,130x0,130x110,10x110\nmax_print_height = 90\nnozzle_diameter = 0.5\nfirst_layer_temperature = 222\n"
      "start_gcode = G28\\nM109 S[first_layer_temperature]\nend_gcode = {if 1}M84{endif}\nthumbnails = \n");
  refused("machines --import mine.ini", "mine.ini: end_gcode: 'if 1' is a condition");
  const Outcome imported = done("machines --import mine.ini --plain-code -o mine.toml");
  EXPECT_NE(imported.err.find("mine.ini: 1 settings were not used\nnot used: thumbnails\n"), std::string::npos) << imported.err;
  EXPECT_NE(imported.err.find("note: end_gcode: is replaced by lamina's (--plain-code)\n"), std::string::npos) << imported.err;
  EXPECT_EQ(done("machines --import mine.ini --plain-code").out, read_text(directory_ / "mine.toml"));
  const std::string code = extruded("--machine ./mine.toml");
  EXPECT_NE(code.find("\nM190 S60\nG28\nM109 S222\n"), std::string::npos) << code.substr(0, 500);
  EXPECT_NE(done("machines --check ./mine.toml").out.find("120 x 110 mm, 90 mm high"), std::string::npos);
  refused("machines --printer x", "--printer: applies to --import");
  refused("machines --import mine.ini --check marlin", "is done alone");
  refused("machines --import mine.ini --printer x", "--printer: mine.ini has the settings of one printer");
  refused("machines --import none.ini", "none.ini: no such file");
  refused("machines --import .", "is a directory");
  write_text(directory_ / "huge.ini", "temperature = 200\n");
  std::filesystem::resize_file(directory_ / "huge.ini", std::uintmax_t{1} << 34);
  EXPECT_EQ(run("machines --import huge.ini").code, 2);
  std::filesystem::remove(directory_ / "huge.ini");
  EXPECT_NE(done("machines --show petg").out.find("name = \"PETG\""), std::string::npos);
  EXPECT_NE(done("machines").out.find("\nlamina extrude --material:\nabs\nasa\npetg\npla\ntpu\n"), std::string::npos);
}

// run_lamina gives no input: the shell does.
TEST_F(MaterialCommands, ANewPrinterIsMadeFromAnswers) {
  const auto with_input = [&](const std::string& answers, const std::string& words, int code) {
    write_text(directory_ / "answers", answers);
    const std::string line = "cd " + directory_.path().string() + " && " + LAMINA_PROGRAM + " " + words + " < answers 2> said";
    EXPECT_EQ(WEXITSTATUS(std::system(line.c_str())), code) << read_text(directory_ / "said");
    return read_text(directory_ / "said");
  };
  const std::string said = with_input("marlin\nKlipper\nMine\n300\n 300x200 \n\n-5,-5\n0.6\r\n\n280\n\n700\n240\n230\n\n\n",
                                      "machines --new -o new.toml", 0);
  EXPECT_NE(said.find("unknown value 'marlin'"), std::string::npos) << said;
  EXPECT_NE(said.find("'300' is not"), std::string::npos) << said;
  EXPECT_NE(said.find("700 is out of range"), std::string::npos) << said;
  const std::string profile = read_text(directory_ / "new.toml");
  for (const char* line :
       {"name = \"Mine\"", "size_mm = [300, 200]", "build_height_mm = 250", "corner_mm = [-5, -5]", "nozzle_mm = 0.6",
        "max_nozzle_degc = 280", "first_nozzle_degc = 240", "\nnozzle_degc = 230", "flavor = \"Klipper\""})
    EXPECT_NE(profile.find(line), std::string::npos) << line << "\n" << profile;
  EXPECT_NE(extruded("--machine ./new.toml").find("M109 S240"), std::string::npos);
  const std::string ended = with_input("Marlin\nMine\n", "machines --new -o other.toml", 2);
  EXPECT_NE(ended.find("--new: the input ends before the answer to 'width and depth of the bed in mm'"), std::string::npos)
      << ended;
  EXPECT_FALSE(std::filesystem::exists(directory_ / "other.toml"));
  refused("machines --new --check marlin", "--new: is done alone");
  refused("machines --new --printer x", "applies to --import");
}

}  // namespace
}  // namespace lamina::test
