// Jobs of two powders: their images, the vats that feed each layer, and what is refused.
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <map>
#include <regex>

#include "pipeline/check/verify.h"
#include "pipeline/job/keys.h"
#include "pipeline/job/profiles/printer.h"
#include "pipeline/machine/materials.h"
#include "pipeline/manifest/manifest.h"
#include "pipeline/run/merge.h"
#include "pipeline/run/run.h"
#include "stages/formats/images/image.h"
#include "stages/raster/images.h"
#include "stages/support/text/readable.h"
#include "stages/support/text/toml.h"

namespace lamina::pipeline {
namespace {

namespace fs = std::filesystem;

/// The set pixels of a summary, all of them or of one material.
std::uint64_t set_pixels_of(const Summary& summary) { return summary.facts["set_pixels"].get<std::uint64_t>(); }
std::uint64_t set_pixels_of(const Summary& summary, std::size_t i) {
  return summary.facts["materials"][i]["set_pixels"].get<std::uint64_t>();
}

class TwoPowders : public ::testing::Test {
 protected:
  void SetUp() override {
    std::string name = (fs::temp_directory_path() / "lamina_powders_XXXXXX").string();
    ASSERT_NE(::mkdtemp(name.data()), nullptr);
    directory_ = name;
  }
  void TearDown() override { fs::remove_all(directory_); }

  static PartRequest part(const std::string& file, double scale, const std::string& material) {
    PartRequest made;
    made.path = std::string(LAMINA_TEST_DIR) + "/corpus/" + file;
    made.scale = {scale, scale, scale};
    made.material = material;
    return made;
  }
  Job job(std::vector<PartRequest> parts, const std::string& out, const std::string& machine = "nuferbj") const {
    Job made;
    made.parts = std::move(parts);
    made.machine.profile = machine;
    made.machine.vat_rule = VatRule::kMajority;
    made.layer_mm = 1.5;
    made.output = (directory_ / out).string();
    made.image_content = ImageContent::kDrops;
    return made;
  }
  /// A profile like a shipped one with other lines in [powder].
  std::string profile(const std::string& powder) const {
    std::ifstream shipped(fs::path(LAMINA_TEST_DIR).parent_path() / "pipeline/machine/shipped/printers/nuferbj.toml");
    std::string text{std::istreambuf_iterator<char>(shipped), std::istreambuf_iterator<char>()};
    const std::string path = (directory_ / "mine.toml").string();
    std::ofstream(path) << text << powder << "\n";
    return path;
  }
  static Result<Summary> run(const Job& job) {
    const std::atomic<bool> cancel{false};
    return pipeline::run(
        job, Product::kImages, [](const ProgressEvent&) {}, cancel);
  }
  static void expect_good(const Job& job) {
    const auto report = verify(job.output, {});
    ASSERT_TRUE(report.ok()) << report.error().message;
    EXPECT_TRUE(report->ok()) << (report->faults.empty() ? "" : report->faults[0]);
    EXPECT_EQ(report->replayed, report->layers);
  }
  static Runs image(const Job& job, std::uint32_t layer, const std::string& material = "") {
    auto read = formats::image(job.output + "/" + layer_file_name(layer, ".tif", material));
    EXPECT_TRUE(read.ok()) << (read.ok() ? "" : read.error().message);
    return read.ok() ? std::move(read->runs) : Runs();
  }
  static std::string text(const fs::path& path) {
    std::ifstream file(path, std::ios::binary);
    return {std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
  }
  static std::map<std::string, std::string> tree(const fs::path& path) {
    std::map<std::string, std::string> files;
    for (const auto& entry : fs::recursive_directory_iterator(path)) {
      if (entry.is_regular_file()) files[fs::relative(entry.path(), path).string()] = text(entry.path());
    }
    return files;
  }
  fs::path directory_;
};

void expect_same(const Runs& a, const Runs& b, const std::string& what) {
  EXPECT_EQ(a.row_offset, b.row_offset) << what;
  EXPECT_EQ(a.change, b.change) << what;
}

TEST_F(TwoPowders, ImagesAreDisjointAndTogetherThatOfOnePowderWhereverThePartsAre) {
  const std::array<std::array<double, 2>, 3> positions[] = {{{{20, 30}, {55, 40}, {30, 60}}},   // apart
                                                            {{{30, 30}, {35, 33}, {40, 36}}},   // all over each other
                                                            {{{30, 30}, {30, 30}, {30, 30}}}};  // inside of each other
  int variant = 0;
  for (const auto& position : positions) {
    std::vector<PartRequest> parts = {part("parameter_quality_nut.stl", 1, "steel"), part("dental_crown.stl", 2, "bronze"),
                                      part("rabbit_9_overlapping_shells.obj", 1, "steel")};
    for (std::size_t p = 0; p < parts.size(); ++p) parts[p].at_mm = position[p];
    const auto changed = [&](Job made) {
      made.mirror = variant == 1 ? Mirror::kX : Mirror::kNone;
      if (variant == 2) made.dose.bleed_um = {120, 80}, made.dose.shell_mm = 0.8, made.dose.core = 0.6;
      made.engine = variant == 0 ? Engine::kBoth : Engine::kRays;
      return made;
    };
    const Job both = changed(job(parts, fmt::format("both{}", variant)));
    for (PartRequest& one : parts) one.material.clear();
    const Job plain = changed(job(parts, fmt::format("plain{}", variant)));
    const std::vector<PartRequest> last_part = {parts[2]};
    const Job last = changed(job(last_part, fmt::format("last{}", variant)));
    const auto summary = run(both), one = run(plain), alone = run(last);
    ASSERT_TRUE(summary.ok()) << summary.error().message;
    ASSERT_TRUE(one.ok() && alone.ok());
    ASSERT_EQ(summary->layers_total, one->layers_total);
    EXPECT_EQ(set_pixels_of(*summary), set_pixels_of(*one));
    ASSERT_EQ(summary->facts["materials"].size(), 2u);
    EXPECT_EQ(set_pixels_of(*summary, 0) + set_pixels_of(*summary, 1), set_pixels_of(*summary));
    EXPECT_GT(set_pixels_of(*summary, 1), 0u);
    for (std::uint32_t layer = 0; layer < summary->layers_total; ++layer) {
      Runs whole;
      const Runs steel = image(both, layer, "steel"), bronze = image(both, layer, "bronze");
      ASSERT_TRUE(raster::add_image(Runs(steel), whole));
      ASSERT_TRUE(raster::add_image(Runs(bronze), whole)) << "a pixel of two materials in layer " << layer;
      expect_same(whole, image(plain, layer), fmt::format("variant {} layer {}", variant, layer));
      // The last part counts wherever it is: no pixel of it is of the other material.
      if (variant < 2 && layer < alone->layers_total) {
        Runs others = image(last, layer);
        EXPECT_TRUE(raster::add_image(Runs(bronze), others)) << layer;
      }
    }
    expect_good(both);
    ++variant;
  }
}

TEST_F(TwoPowders, TheVatsThatFeedALayerFollowTheRuleOfTheProfileAndAreChecked) {
  // The nut is low: layers of both materials below, of the second one above.
  const std::vector<PartRequest> parts = {part("parameter_quality_nut.stl", 0.8, "steel"),
                                          part("dental_crown.stl", 3, "bronze")};
  for (const std::string rule : {"first", "second", "majority", "both"}) {
    Job made = job(parts, rule, profile("materials = [\"bronze\", \"steel\"]\nvat_rule = \"" + rule + "\""));
    made.machine.vat_rule.reset();
    const auto summary = run(made);
    ASSERT_TRUE(summary.ok()) << summary.error().message;
    expect_good(made);
    std::uint32_t mixed = 0, single = 0;
    for (std::uint32_t layer = 0; layer < summary->layers_total; ++layer) {
      const std::uint64_t bronze = set_pixels(image(made, layer, "bronze")), steel = set_pixels(image(made, layer, "steel"));
      const std::string program = text(fmt::format("{}/program/{:06}.gcode", made.output, layer));
      const bool first = program.find("\nG1 A") != std::string::npos, second = program.find("\nG1 B") != std::string::npos;
      bool first_wanted = steel == 0, second_wanted = bronze == 0 && steel > 0;
      if (bronze > 0 && steel > 0) {
        first_wanted = rule == "first" || rule == "both" || (rule == "majority" && bronze >= steel);
        second_wanted = rule == "second" || rule == "both" || (rule == "majority" && bronze < steel);
      }
      ++(bronze > 0 && steel > 0 ? mixed : single);
      EXPECT_EQ(first, first_wanted) << rule << " " << layer;
      EXPECT_EQ(second, second_wanted) << rule << " " << layer;
    }
    EXPECT_GT(mixed, 0u);
    EXPECT_GT(single, 0u);
    // Warnings of parts whose binder falls into the other powder.
    const auto reported = std::ranges::find(summary->warnings, "mixed-powders", &Warning::code);
    EXPECT_EQ(reported == summary->warnings.end(), rule == "both") << rule;
    if (rule == "first" || rule == "second") {
      EXPECT_NE(reported->text.find(fmt::format(" in {} layers", mixed)), std::string::npos) << reported->text;
    }
  }
}

TEST_F(TwoPowders, AreRefusedBeforeAnythingIsWrittenUnlessARuleIsNamed) {
  std::vector<PartRequest> parts = {part("parameter_quality_nut.stl", 0.8, "steel"), part("dental_crown.stl", 3, "bronze")};
  const auto refused_job = [&](std::optional<std::array<std::uint32_t, 2>> layers = {}) {
    Job made = job(parts, "refused");
    made.machine.vat_rule.reset();  // the profile states none
    made.layers = layers;
    return made;
  };
  const Job printed = job(parts, "printed");
  ASSERT_TRUE(run(printed).ok());
  for (const bool dry : {false, true}) {
    Job made = refused_job();
    made.dry_run = dry;
    const auto summary = run(made);
    ASSERT_FALSE(summary.ok());
    EXPECT_EQ(summary.error().fault, Fault::kUsage);
    const std::string& message = summary.error().message;
    EXPECT_EQ(message.rfind("layers 0 to 11 mix powders", 0), 0u) << message;
    EXPECT_NE(message.find("layer 0 (z 0.750 mm) has "), std::string::npos) << message;
    EXPECT_NE(message.find(fmt::format("{} pixels of steel", readable_count(set_pixels(image(printed, 0, "steel"))))),
              std::string::npos)
        << message;
    EXPECT_NE(message.find(fmt::format("{} pixels of bronze", readable_count(set_pixels(image(printed, 0, "bronze"))))),
              std::string::npos)
        << message;
    EXPECT_NE(message.find("--vat-rule majority"), std::string::npos) << message;
    EXPECT_FALSE(fs::exists(made.output)) << message;
  }
  // Layers of one powder alone are planned, and so is the same job of parts that stand upon each other.
  const std::uint32_t above = 12;  // layers that hold the nut
  const auto some = run(refused_job({{above, above + 2}}));
  EXPECT_TRUE(some.ok()) << some.error().message;
  fs::remove_all(directory_ / "refused");
  parts[1].bottom_mm = 1.5 * above;
  const auto stacked = run(refused_job());
  ASSERT_TRUE(stacked.ok()) << stacked.error().message;
  EXPECT_EQ(std::ranges::find(stacked->warnings, "mixed-powders", &Warning::code), stacked->warnings.end());
}

TEST_F(TwoPowders, PixelsInTheOtherPowderAreInManifestAndVerify) {
  std::vector<PartRequest> parts = {part("parameter_quality_nut.stl", 0.8, "steel"), part("dental_crown.stl", 3, "bronze")};
  Job made = job(parts, "unfed");
  made.machine.vat_rule = VatRule::kFirst;
  const auto summary = run(made);
  ASSERT_TRUE(summary.ok()) << summary.error().message;
  const auto manifest = read_manifest(made.output + "/manifest.json");
  ASSERT_TRUE(manifest.ok());
  std::uint64_t unfed = 0;
  std::uint32_t layers = 0;
  for (const LayerRecord& record : manifest->layers) {
    const bool mixed = record.images[0].set_pixels > 0 && record.images[1].set_pixels > 0;
    EXPECT_EQ(record.images[0].unfed_pixels, 0u);
    EXPECT_EQ(record.images[1].unfed_pixels, mixed ? record.images[1].set_pixels : 0) << record.layer.index;
    unfed += record.images[1].unfed_pixels;
    layers += mixed;
  }
  EXPECT_GT(unfed, 0u);
  EXPECT_EQ(summary->facts["materials"][1]["unfed_pixels"], unfed);
  EXPECT_EQ(summary->facts["materials"][1]["unfed_layers"], layers);
  auto report = verify(made.output, {});
  ASSERT_TRUE(report.ok() && report->ok());
  ASSERT_EQ(report->unfed.size(), 2u);
  EXPECT_EQ(report->unfed[1].pixels, unfed);
  EXPECT_EQ(report->unfed[1].layers, layers);
  const std::string path = made.output + "/manifest.json", whole = text(path);
  std::ofstream(path) << std::regex_replace(whole, std::regex("(\"unfed_pixels\": [1-9][0-9]*)"), "$017");
  report = verify(made.output, {});
  ASSERT_TRUE(report.ok());
  EXPECT_EQ(report->fault_count, layers);
  EXPECT_NE(report->faults[0].find("lie in another powder, the manifest says"), std::string::npos) << report->faults[0];
}

TEST_F(TwoPowders, EveryDialectSaysWhichVatFeeds) {
  for (const std::string machine : {"nuferbj", "nuferbj-31", "nuferbj-360dpi", "xaar128-raw", "production-1200", "jet1000",
                                    "reprap-inkjet", "brundlefab"}) {
    std::vector<PartRequest> parts = {part("parameter_quality_nut.stl", 0.5, "steel"), part("dental_crown.stl", 2, "bronze")};
    Job made = job(parts, machine);
    // Shipped machines of one vat, with a second one.
    std::ifstream shipped(fs::path(LAMINA_TEST_DIR).parent_path() / ("pipeline/machine/shipped/printers/" + machine + ".toml"));
    std::string profile{std::istreambuf_iterator<char>(shipped), std::istreambuf_iterator<char>()};
    if (profile.find("vats = 2") == std::string::npos) {
      if (profile.find("[powder]") == std::string::npos) profile += "\n[powder]\n";
      profile += "vats = 2\n";
    }
    made.machine.profile = (directory_ / (machine + ".toml")).string();
    std::ofstream(made.machine.profile) << profile;
    made.layer_mm = 4;
    const auto summary = run(made);
    if (machine == "brundlefab") {  // its firmware has an axis for one feed bin
      ASSERT_FALSE(summary.ok());
      EXPECT_EQ(summary.error().message, "brundlefab: powder.vats: a BrundleFab has one feed bin");
      continue;
    }
    ASSERT_TRUE(summary.ok()) << machine << ": " << summary.error().message;
    expect_good(made);
  }
}

// A nut that stands on another powder is of a group of its own, which shares the mesh with the nut next to it.
TEST_F(TwoPowders, AMeshOfTwoGroupsIsThereOnce) {
  const auto at = [](PartRequest one, double x, double bottom) {
    one.at_mm = {{x, 50}};
    one.bottom_mm = bottom;
    return one;
  };
  const PartRequest nut = part("parameter_quality_nut.stl", 0.3, "steel"), crown = part("dental_crown.stl", 1, "bronze");
  const auto mesh_bytes = [&](std::vector<PartRequest> parts) {
    Job made = job(std::move(parts), "out");
    made.dry_run = true;
    const auto summary = run(made);
    EXPECT_TRUE(summary.ok()) << summary.error().message;
    return summary.ok() ? summary->mesh_bytes : 0;
  };
  const std::uint64_t once = mesh_bytes({at(nut, 40, 0), at(crown, 60, 0)});
  EXPECT_GT(once, 0u);
  EXPECT_EQ(mesh_bytes({at(nut, 40, 0), at(crown, 60, 0), at(nut, 60, 0)}), once);
}

TEST_F(TwoPowders, APartCanChangeItsPowderWithTheHeight) {
  PartRequest nut = part("dental_crown.stl", 3, "steel");
  nut.material_ranges = {{6, 12, "bronze"}, {9, 10.5, "steel"}};
  Job made = job({nut}, "graded");
  const auto summary = run(made);
  ASSERT_TRUE(summary.ok()) << summary.error().message;
  expect_good(made);
  nut.material_ranges.clear();
  nut.material.clear();
  Job plain = job({nut}, "plain");
  ASSERT_TRUE(run(plain).ok());
  for (std::uint32_t layer = 0; layer < summary->layers_total; ++layer) {
    const double z = layer * 1.5 + 0.75;
    const bool bronze = z >= 6 && z < 12 && !(z >= 9 && z < 10.5);
    expect_same(image(made, layer, bronze ? "bronze" : "steel"), image(plain, layer), fmt::format("layer {}", layer));
    EXPECT_EQ(set_pixels(image(made, layer, bronze ? "steel" : "bronze")), 0u);
  }
}

TEST_F(TwoPowders, ShardsMergedResumedAndDamagedLayersBehaveAsThoseOfOnePowder) {
  const Job whole = job({part("parameter_quality_nut.stl", 1, "steel"), part("dental_crown.stl", 2, "bronze")}, "whole");
  ASSERT_TRUE(run(whole).ok());
  Job shard = whole;
  shard.output = (directory_ / "shards").string();
  for (std::uint32_t i = 0; i < 2; ++i) {
    shard.shard = {{i, 2}};
    ASSERT_TRUE(run(shard).ok());
  }
  ASSERT_TRUE(merge({.directories = {shard.output}, .output = shard.output}).ok());
  const auto before = tree(whole.output);
  EXPECT_EQ(tree(shard.output), before);
  // Images whose materials are exchanged are whole files, and wrong ones.
  const fs::path layers = fs::path(whole.output) / "layers";
  fs::rename(layers / "000001-steel.tif", layers / "x");
  fs::rename(layers / "000001-bronze.tif", layers / "000001-steel.tif");
  fs::rename(layers / "x", layers / "000001-bronze.tif");
  auto report = verify(whole.output, {});
  ASSERT_TRUE(report.ok());
  EXPECT_EQ(report->fault_count, 1u);
  EXPECT_NE(report->faults[0].find("layers/000001-steel.tif"), std::string::npos) << report->faults[0];
  fs::remove(layers / "000002-bronze.tif");
  std::ofstream(layers / "000003-brass.tif") << "no material of the job";
  report = verify(whole.output, {});
  ASSERT_TRUE(report.ok());
  EXPECT_EQ(report->fault_count, 3u);
  fs::remove(layers / "000003-brass.tif");
  Job resumed = whole;
  resumed.resume = true;
  const auto summary = run(resumed);
  ASSERT_TRUE(summary.ok());
  EXPECT_EQ(summary->layers_planned, 2u);
  EXPECT_EQ(tree(whole.output), before);
}

TEST_F(TwoPowders, OnePowderOfTheJobIsAnOrdinaryJobFedByItsVat) {
  const Job plain = job({part("parameter_quality_nut.stl", 1, "")}, "plain");
  const Job second =
      job({part("parameter_quality_nut.stl", 1, "steel")}, "second", profile("materials = [\"bronze\", \"steel\"]"));
  ASSERT_TRUE(run(plain).ok());
  ASSERT_TRUE(run(second).ok());
  expect_good(second);
  const auto one = tree(plain.output), other = tree(second.output);
  EXPECT_EQ(one.at("layers/000001.tif"), other.at("layers/000001.tif"));
  EXPECT_NE(one.at("program/000001.gcode").find("\nG1 A"), std::string::npos);
  EXPECT_NE(other.at("program/000001.gcode").find("\nG1 B"), std::string::npos);
  EXPECT_EQ(one.at("program/machine.toml").find("materials"), std::string::npos);
}

TEST_F(TwoPowders, WhatTheVatsDoNotHoldIsRefusedInOneLine) {
  const std::string named = profile("materials = [\"bronze\", \"steel\"]");
  const auto refused = [&](const std::vector<std::string>& materials, const std::string& machine, const std::string& what) {
    std::vector<PartRequest> parts;
    for (const std::string& material : materials) parts.push_back(part("parameter_quality_nut.stl", 0.3, material));
    const auto summary = run(job(parts, "refused", machine));
    ASSERT_FALSE(summary.ok()) << what;
    EXPECT_EQ(summary.error().fault, Fault::kUsage);
    EXPECT_NE(summary.error().message.find(what), std::string::npos) << summary.error().message;
    EXPECT_EQ(summary.error().message.find('\n'), std::string::npos);
  };
  refused({"bronze", "stel"}, named,
          "no vat of nuferbj holds it: unknown value 'stel'; use one of bronze, steel; did you mean 'steel'?");
  refused({"a", "b", "c"}, "nuferbj", "the parts are of 3 materials (a, b, c), nuferbj has 2 vats");
  refused({"a", "b"}, "hp45", "the parts are of 2 materials (a, b), hp45 has one vat");
  refused({"a", ""}, "nuferbj", "has none; name that of every part, or of none");
  refused({"a"}, profile("materials = [\"bronze\"]"), "powder.materials: 1 names for 2 vats");
  EXPECT_NE(pipeline::check_material("a/b").find("is no name of a material"), std::string::npos);
  const auto wrong_ranges = [](const char* text) {
    std::vector<MaterialRange> ranges;
    TextPosition at;
    return read_material_ranges(*read_toml_value(text), ranges, at);
  };
  EXPECT_NE(wrong_ranges("[{ from_mm = 4, to_mm = 2, material = 'bronze' }]").find("ends at or below its start"),
            std::string::npos);
  EXPECT_NE(wrong_ranges("[{ from_mm = 2, material = 'bronze' }]").find("to_mm is missing"), std::string::npos);
  EXPECT_NE(wrong_ranges("[{ from_mm = 2, to_mm = 4 }]").find("material is missing"), std::string::npos);
}

// Images are next to each other as 000001-steel.tif, 000001-steel-drop2.tif.
TEST_F(TwoPowders, NamesWhoseFilesAreOneOrReadLikeADropAreRefused) {
  const auto refused = [&](const Job& job, const std::string& what) {
    const auto summary = run(job);
    ASSERT_FALSE(summary.ok()) << what;
    EXPECT_EQ(summary.error().fault, Fault::kUsage);
    EXPECT_TRUE(summary.error().message.starts_with(what)) << summary.error().message;
    EXPECT_EQ(summary.error().message.find('\n'), std::string::npos);
    EXPECT_FALSE(fs::exists(job.output));
  };
  const PartRequest steel = part("parameter_quality_nut.stl", 0.3, "steel"),
                    other = part("parameter_quality_nut.stl", 0.3, "Steel");
  const std::string in_part = "part.material: " + steel.path + ": ";
  for (const char* machine : {"", "nuferbj"}) {
    Job both = job({steel, other}, "refused", machine);
    if (*machine == 0) both.machine.vat_rule.reset();
    refused(both, in_part + "'steel' and 'Steel' differ in case alone");
    both.parts.pop_back();
    both.parts[0].material_ranges = {{1, 2, "sTEEL"}};
    refused(both, in_part + "'steel' and 'sTEEL' differ in case alone");
  }
  refused(job({steel}, "refused", profile("materials = [\"steel\", \"STEEL\"]")), (directory_ / "mine.toml").string());
  for (const char* name : {"drop1", "Drop12", "steel-drop2", "a-b-DROP0"}) {
    EXPECT_NE(pipeline::check_material(name).find(std::string("'") + name + "' reads like a drop"), std::string::npos) << name;
    Job named = job({steel}, "refused");
    EXPECT_EQ(set_materials(name, named).error().fault, Fault::kUsage) << name;
    named.parts[0].material = name;
    EXPECT_NE(check_job(named).error().message.find("part.material: '"), std::string::npos) << check_job(named).error().message;
  }
  for (const char* name : {"drop", "drops2", "raindrop1", "drop-1x", "drop1-steel", "drop_1", "steel-drop"}) {
    EXPECT_EQ(pipeline::check_material(name), "") << name;
  }
}

}  // namespace
}  // namespace lamina::pipeline
