// tests/pipeline/run/test_toolpath_defaults.cpp: what lamina extrude does by default: points left out, a skirt, the firmware's
// name.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <numbers>
#include <sstream>

#include "pipeline/job/file.h"
#include "pipeline/plan/plan.h"
#include "tests/commands/program.h"
#include "tests/segment/gcode_reader.h"

namespace lamina::test {
namespace {

const std::string kToothFile = std::string(LAMINA_TEST_DIR) + "/corpus/dental_crown.stl";

struct Extruded {
  std::string text;
  nlohmann::json summary;
  GcodeFile file;
};

Extruded extruded(const Directory& directory, const std::string& options) {
  const Outcome outcome =
      run_lamina(words_of("extrude " + options + " --overwrite --quiet --json -o a.gcode"), directory.path());
  EXPECT_EQ(outcome.code, 0) << outcome.err;
  Extruded made{read_text(directory / "a.gcode"), nlohmann::json::parse(outcome.out, nullptr, false), {}};
  made.file = read_gcode(made.text);
  EXPECT_EQ(made.file.error, "");
  return made;
}

double filament_of(const std::vector<GcodeBead>& beads) {
  double sum = 0;
  for (const GcodeBead& bead : beads) sum += bead.filament;
  return sum;
}

/// The layers, from 0, before which a line of the file comes, and those that lie on the bed.
struct LayersOfText {
  std::vector<int> on_bed, fan, cooler;
};
LayersOfText layers_of_text(const std::string& text) {
  LayersOfText found;
  std::istringstream lines(text);
  int layer = -1;
  double top = 0;
  for (std::string line; std::getline(lines, line);) {
    if (line == ";LAYER_CHANGE") ++layer;
    if (line.rfind(";Z:", 0) == 0) top = std::stod(line.substr(3));
    if (line.rfind(";HEIGHT:", 0) == 0 && std::abs(top - std::stod(line.substr(8))) < 1e-6) found.on_bed.push_back(layer);
    if (layer >= 0 && line.rfind("M106 S", 0) == 0 && line != "M106 S0") found.fan.push_back(layer);
    if (layer >= 0 && line == "M104 S190") found.cooler.push_back(layer);
  }
  return found;
}

TEST(ToolpathDefaults, PartsWithOwnLayersKeepTheSettingsOfFirstLayersUntilAllLieOnTheBed) {
  const Directory directory;
  write_box(directory / "a.stl", {0, 0, 0}, {5, 5, 1});
  write_box(directory / "b.stl", {0, 0, 0}, {6, 6, 1});
  const std::string job =
      "a.stl b.stl --layer 0.2 --walls 1 --machine-set "
      "material.nozzle_degc=190;material.first_nozzle_degc=205";
  const LayersOfText together = layers_of_text(extruded(directory, job).text);
  EXPECT_EQ(together.on_bed, std::vector<int>({0}));
  EXPECT_EQ(together.fan, std::vector<int>({1}));
  EXPECT_EQ(together.cooler, std::vector<int>({1}));
  const LayersOfText own = layers_of_text(extruded(directory, job + " --per-part").text);
  EXPECT_EQ(own.on_bed, std::vector<int>({0, 1}));
  EXPECT_EQ(own.fan, std::vector<int>({2}));
  EXPECT_EQ(own.cooler, std::vector<int>({2}));
}

TEST(ToolpathDefaults, AFileThatBeginsAboveTheFirstLayersHasLaterSettingsFromItsFirstOne) {
  const Directory directory;
  write_box(directory / "a.stl", {0, 0, 0}, {5, 5, 2});
  write_box(directory / "b.stl", {0, 0, 0}, {6, 6, 2});
  const std::string job =
      "a.stl b.stl --layer 0.2 --walls 1 --machine-set "
      "material.nozzle_degc=190;material.first_nozzle_degc=205;fan.from_layer=3 ";
  for (const char* layers : {"--layers 5:9", "--layers 7:9 --per-part"}) {
    const LayersOfText above = layers_of_text(extruded(directory, job + layers).text);
    EXPECT_EQ(above.fan, std::vector<int>({0})) << layers;
    EXPECT_EQ(above.cooler, std::vector<int>({0})) << layers;
  }
  const LayersOfText between = layers_of_text(extruded(directory, job + "--layers 2:6").text);
  EXPECT_EQ(between.fan, std::vector<int>({1}));  // layer 3 of the part
  EXPECT_EQ(between.cooler, std::vector<int>({0}));
}

TEST(ToolpathDefaults, ASkirtFillsTheNozzleThoughTheFirstLayerHoldsNoBead) {
  const Directory directory;
  std::string tip = "solid tip\n";  // a tetrahedron on its tip
  for (const char* facet : {"0 0 8|10 0 8|5 10 8", "5 5 0|10 0 8|0 0 8", "5 5 0|5 10 8|10 0 8", "5 5 0|0 0 8|5 10 8"}) {
    tip += "facet normal 0 0 0\nouter loop\nvertex ";
    for (const char* c = facet; *c != 0; ++c) tip += *c == '|' ? std::string("\nvertex ") : std::string(1, *c);
    tip += "\nendloop\nendfacet\n";
  }
  write_text(directory / "tip.stl", tip + "endsolid tip\n");
  const Extruded made = extruded(directory, "tip.stl --layer 0.2 --walls 1 --fill raster");
  ASSERT_GT(made.file.layers.size(), 30u);
  EXPECT_TRUE(made.file.layers[0].beads.empty());
  EXPECT_EQ(made.file.skirt.size(), made.summary["skirt"]["moves"]);
  EXPECT_EQ(made.file.skirt.front().z, 0.2);
  EXPECT_GT(made.summary["skirt"]["bead_mm"], 40) << "a loop 5 mm around the widest layer";
  write_box(directory / "needle.stl", {0, 0, 0}, {0.1f, 0.1f, 1});  // no bead fits into it
  write_box(directory / "head.stl", {0, 0, 0}, {4, 4, 1});
  const Extruded needle = extruded(directory, "needle.stl --layer 0.2 --walls 1 --fill raster --allow-empty");
  EXPECT_EQ(needle.summary["moves"], 0);
  EXPECT_GT(needle.summary["skirt"]["bead_mm"], 0);
  const auto reported = [&](const std::string& options) {
    return run_lamina(words_of("extrude " + options + " --layer 0.2 --walls 1 --overwrite -o a.gcode"), directory.path()).err;
  };
  EXPECT_NE(reported("head.stl --layers 1:3").find("--layers leaves the first layer out"), std::string::npos);
  write_box(directory / "bed.stl", {0, 0, 0}, {220, 220, 0.4f});
  EXPECT_NE(reported("bed.stl").find("none: no space on the bed"), std::string::npos);
}

TEST(ToolpathDefaults, LeaveOutPointsUnlessRequestedAndTheSameInAJobFile) {
  const Directory directory;
  const std::string job = kToothFile + " --layer 0.2 --walls 2 --fill raster --bead-gap 1 --skirt 0";
  const Extruded unrequested = extruded(directory, job), requested = extruded(directory, job + " --tolerance 10");
  const Extruded all = extruded(directory, job + " --tolerance 0");
  EXPECT_EQ(unrequested.summary["tolerance_um"], 10);
  EXPECT_EQ(all.summary["tolerance_um"], 0);
  EXPECT_TRUE(unrequested.text == requested.text);
  EXPECT_LT(unrequested.summary["moves"].get<double>(), 0.5 * all.summary["moves"].get<double>());
  EXPECT_NEAR(unrequested.summary["volume_mm3"].get<double>() / all.summary["volume_mm3"].get<double>(), 1, 0.01);
  // The saved job does it again, and states the request.
  const Outcome saved = run_lamina(words_of("extrude " + job + " --save-job job.toml --quiet -o b.gcode"), directory.path());
  ASSERT_EQ(saved.code, 0) << saved.err;
  EXPECT_EQ(read_text(directory / "job.toml").find("\ntolerance_um"), std::string::npos);
  EXPECT_NE(read_text(directory / "job.toml").find("lamina extrude --job FILE\n"), std::string::npos);
  const Outcome again = run_lamina(words_of("extrude --job job.toml --quiet -o c.gcode"), directory.path());
  ASSERT_EQ(again.code, 0) << again.err;
  EXPECT_TRUE(read_text(directory / "c.gcode") == unrequested.text);
  // Contours keep their points.
  const Outcome sliced = run_lamina(words_of("slice " + kToothFile + " --layer 1 --quiet -o out"), directory.path());
  ASSERT_EQ(sliced.code, 0) << sliced.err;
  EXPECT_NE(read_text(directory / "out/job.toml").find("lamina slice --job FILE\n"), std::string::npos);
  EXPECT_EQ(read_text(directory / "out/job.toml").find("\ntolerance_um"), std::string::npos);
  // A job means in each command that command's defaults; requested values stay.
  EXPECT_EQ(extruded(directory, "--job out/job.toml --layer 0.2 --walls 1").summary["tolerance_um"], 10);
  for (const auto& [requested_um, kept] : {std::pair{"0", "\ntolerance_um = 0\n"}, {"25", "\ntolerance_um = 25\n"}}) {
    const std::string save =
        std::string(" --layer 1 --overwrite --save-job kept.toml --quiet -o out --tolerance ") + requested_um;
    const Outcome outcome = run_lamina(words_of("slice " + kToothFile + save), directory.path());
    ASSERT_EQ(outcome.code, 0) << outcome.err;
    EXPECT_NE(read_text(directory / "kept.toml").find(kept), std::string::npos);
    EXPECT_NE(read_text(directory / "out/job.toml").find(kept), std::string::npos);
  }
}

/// mm from a point to the nearest bead of a type.
double to_nearest_bead(const GcodeLayer& layer, const std::string& type, double x, double y) {
  double nearest = 1e9;
  for (const GcodeBead& bead : layer.beads) {
    if (bead.type != type) continue;
    const double ux = bead.x1 - bead.x0, uy = bead.y1 - bead.y0, length2 = ux * ux + uy * uy;
    const double share = length2 > 0 ? std::clamp(((x - bead.x0) * ux + (y - bead.y0) * uy) / length2, 0.0, 1.0) : 0;
    nearest = std::min(nearest, std::hypot(x - bead.x0 - share * ux, y - bead.y0 - share * uy));
  }
  return nearest;
}

TEST(ToolpathDefaults, WallsKeepTheirDepthWithinTheToleranceReported) {
  const Directory directory;
  const std::string job = kToothFile + " --layer 0.4 --walls 2 --fill none --skirt 0";
  const Extruded less = extruded(directory, job), all = extruded(directory, job + " --tolerance 0");
  ASSERT_EQ(less.file.layers.size(), all.file.layers.size());
  const double maximum = less.summary["tolerance_um"].get<double>() / 1000 + 0.0015;  // files have three decimals
  std::size_t positions = 0, beyond = 0;
  for (std::size_t k = 0; k < less.file.layers.size(); ++k) {
    const GcodeLayer& full = all.file.layers[k];
    for (const GcodeBead& bead : less.file.layers[k].beads) {
      for (const double share : {0.0, 0.5}) {
        const double x = bead.x0 + share * (bead.x1 - bead.x0), y = bead.y0 + share * (bead.y1 - bead.y0);
        ++positions;
        beyond += to_nearest_bead(full, bead.type, x, y) > maximum ? 1 : 0;
        if (bead.type != "Perimeter") continue;
        EXPECT_GE(to_nearest_bead(full, "External perimeter", x, y), bead.width - maximum) << "layer " << k;
      }
    }
  }
  EXPECT_GT(positions, 1000u);
  EXPECT_LT(beyond, positions / 200) << "tips, which move along themselves";
}

TEST(ToolpathDefaults, AJobFileIsGivenWhatItLeavesToThePrinter) {
  const Directory directory;
  write_text(directory / "job.toml", "[[part]]\npath = '" + kToothFile + "'\n");
  const auto said = [&](const std::string& more) {
    const Outcome outcome =
        run_lamina(words_of("extrude --job job.toml --machine marlin --dry-run -o a.gcode" + more), directory.path());
    EXPECT_EQ(outcome.code, 0) << outcome.err;
    return outcome.err + outcome.out;
  };
  const std::string walls = "job.toml names no fill.walls: the default is 2",
                    layers = "names no layers.thickness_mm: layers are 0.2 mm";
  EXPECT_NE(said("").find(walls), std::string::npos);
  EXPECT_NE(said("").find(layers), std::string::npos);
  const std::string named = said(" --set fill.walls=2 --layer 0.3");
  EXPECT_EQ(named.find("job.toml names no"), std::string::npos) << named;
}

TEST(ToolpathDefaults, OfALibrariesJobAreThePrintersOnlyIfItLeavesThem) {
  pipeline::Job job;
  job.layer_mm = 0.3;
  job.machine.profile = "marlin";
  EXPECT_EQ(pipeline::resolve(job, Product::kMoves)->job.layer_mm, 0.3);
  job.leave_to_machine = job.dry_run = true;
  job.parts.emplace_back();
  job.parts[0].path = kToothFile;
  ASSERT_TRUE(pipeline::set_key(job, "fill.walls=0").ok());
  const auto resolved = pipeline::resolve(job, Product::kMoves);
  ASSERT_TRUE(resolved.ok());
  EXPECT_EQ(resolved->job.layer_mm, 0.2);
  EXPECT_EQ(resolved->job.fill.all.walls, 0u);
}

TEST(ToolpathDefaults, APartOrARangeThatNamesNoSpacingKeepsTheGrid) {
  const auto density = [](const std::vector<std::string>& keys) {
    pipeline::Job job;
    job.machine.profile = "marlin";
    job.leave_to_machine = job.dry_run = true;
    job.parts.emplace_back().path = kToothFile;
    for (const std::string& key : keys) EXPECT_TRUE(pipeline::set_key(job, key).ok()) << key;
    const auto resolved = pipeline::resolve(job, Product::kMoves);
    EXPECT_TRUE(resolved.ok());
    return resolved ? resolved->job.fill.all.density_percent : std::nullopt;
  };
  EXPECT_EQ(density({}), 20);
  EXPECT_EQ(density({"part.1.fill={ width_mm = 0.6 }"}), 20);
  EXPECT_EQ(density({"part.1.fill={ density_percent = 50 }"}), 20);
  EXPECT_EQ(density({"fill.range=[{ from_mm = 2, to_mm = 4, density_percent = 50 }]"}), 20);
  EXPECT_EQ(density({"part.1.fill={ gap_mm = 1 }"}), std::nullopt);
  EXPECT_EQ(density({"fill.range=[{ from_mm = 2, to_mm = 4, pattern = 'raster' }]"}), std::nullopt);
  EXPECT_EQ(density({"fill.gap_mm=1"}), std::nullopt);
}

TEST(ToolpathDefaults, SkirtComesFirstAndIsDistinguished) {
  for (const std::string machine : {"anet-a8", "marlin"}) {  // absolute and relative extrusion
    SCOPED_TRACE(machine);
    const Directory directory;
    const std::string job = kToothFile + " --machine " + machine + " --layer 0.3 --fill raster --bead-gap 1";
    const Extruded with = extruded(directory, job), without = extruded(directory, job + " --skirt 0");
    EXPECT_EQ(without.file.skirt.size(), 0u);
    ASSERT_EQ(with.file.skirt.size(), 8u) << "two loops: one is shorter than 100 mm";
    const auto type = with.text.find(";TYPE:"), wall = with.text.find(";TYPE:External perimeter");
    EXPECT_EQ(with.text.compare(type, 17, ";TYPE:Skirt/Brim\n"), 0);
    EXPECT_LT(type, wall);
    double lowest = 1e9, length = 0;
    for (const GcodeBead& bead : with.file.skirt) {
      EXPECT_NEAR(bead.z, 0.3, 1e-9);
      length += std::hypot(bead.x1 - bead.x0, bead.y1 - bead.y0);
      lowest = std::min(lowest, bead.x0);
    }
    EXPECT_GE(lowest, 0);
    const nlohmann::json& reported = with.summary["skirt"];
    EXPECT_EQ(reported["moves"], with.file.skirt.size());
    EXPECT_NEAR(reported["bead_mm"].get<double>(), length, 0.01);
    EXPECT_NEAR(reported["filament_mm"].get<double>(), filament_of(with.file.skirt), 1e-4);
    EXPECT_EQ(without.summary["skirt"]["moves"], 0);
    // Of the parts nothing changes; the filament of the file holds both.
    EXPECT_EQ(with.summary["moves"], without.summary["moves"]);
    EXPECT_EQ(with.summary["porosity"], without.summary["porosity"]);
    for (const char* name : {"bead_mm", "volume_mm3"}) {
      EXPECT_NEAR(with.summary[name].get<double>() / without.summary[name].get<double>(), 1, 1e-9) << name;
    }
    EXPECT_NEAR(with.summary["filament_mm"].get<double>() - without.summary["filament_mm"].get<double>(),
                reported["filament_mm"].get<double>(), 1e-6);
    double fed = filament_of(with.file.skirt);
    for (const GcodeLayer& layer : with.file.layers) fed += filament_of(layer.beads);
    EXPECT_NEAR(fed, with.summary["filament_mm"].get<double>(), 1e-5 * static_cast<double>(with.file.layers.size()));
    EXPECT_EQ(extruded(directory, job + " --layers 2:4").file.skirt.size(), 0u) << "not in the air";
  }
}

TEST(ToolpathDefaults, FlavorIsTheFirmwareOfTheProfile) {
  const Directory directory;
  for (const auto& [machine, flavor] : {std::pair<std::string, std::string>{"anet-a8", "Marlin"},
                                        {"marlin", "Marlin"},
                                        {"klipper", "Klipper"},
                                        {"reprapfirmware", "RepRap"}}) {
    const Extruded made = extruded(directory, kToothFile + " --machine " + machine + " --layer 0.3");
    EXPECT_NE(made.text.find("\n;FLAVOR:" + flavor + "\n"), std::string::npos) << machine;
  }
}

}  // namespace
}  // namespace lamina::test
