// Jobs whose parts are of two materials and whose pixels get several drops: an image a material and drop.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "pipeline/manifest/manifest.h"
#include "stages/data/levels.h"
#include "stages/formats/images/image.h"
#include "tests/commands/job_folder.h"

namespace lamina::pipeline {
namespace {

/// Pixels and layers of 100 um, of which half are voids: 500 pl, 5 drops of 100 pl.
constexpr const char* kTwoVats = R"([machine]
name = "twins"
dialect = "planes"
[bed]
size_mm = [16, 10]
[head]
nozzles = 64
pitch_um = 100
highest_frequency_hz = 350
drop_pl = 100
max_drops = 3
[motion]
scan_speed_mm_s = 10
travel_speed_mm_s = 200
ramp_mm = 5
[powder]
vats = 2
vat_rule = "majority"
packing = 0.5
)";

/// Drops a pixel, row by row.
using DropPixels = std::vector<int>;

class MaterialDrops : public test::JobFolder {
 protected:
  MaterialDrops() {
    test::write_text(folder_ / "twins.toml", kTwoVats);
    test::write_box(folder_ / "low.stl", {0, 0, 0}, {3, 4, 0.8f});
    test::write_box(folder_ / "high.stl", {0, 0, 0}, {3, 4, 1.2f});
  }

  /// A fault of a finished job.
  std::string fault(const std::string& output) const {
    const test::Outcome outcome = lamina("verify --quiet " + output);
    EXPECT_EQ(outcome.code, 5) << output;
    return outcome.err;
  }
  Manifest manifest(const std::string& output) const {
    auto read = read_manifest(folder_ / (output + "/manifest.json"));
    EXPECT_TRUE(read.ok()) << read.error().message;
    return read.ok() ? std::move(*read) : Manifest();
  }

  /// What the images of one material, or of a job without any, come to. They are nested, or the test fails.
  DropPixels drops_of(const std::string& output, std::uint32_t layer, const std::string& material,
                      std::uint32_t maximum) const {
    DropPixels drops;
    for (std::uint32_t k = 1; k <= maximum; ++k) {
      const std::string drop = maximum > 1 ? "drop" + std::to_string(k) : "";
      const std::string name = material + (material.empty() || drop.empty() ? "" : "-") + drop;
      const auto image = formats::image(folder_ / (output + "/" + layer_file_name(layer, ".tif", name)));
      EXPECT_TRUE(image.ok()) << (image.ok() ? "" : image.error().message);
      if (!image.ok()) return drops;
      const RunsView runs = image->runs.view();
      drops.resize(std::size_t{runs.columns} * runs.rows());
      std::size_t beyond = 0;
      for (std::uint32_t r = 0; r < runs.rows(); ++r) {
        const auto row = runs.row(r);
        for (std::size_t i = 0; i + 1 < row.size(); i += 2) {
          for (std::uint32_t c = row[i]; c < row[i + 1]; ++c) {
            int& here = drops[std::size_t{r} * runs.columns + c];
            beyond += here + 1 == static_cast<int>(k) ? 0 : 1;
            here = static_cast<int>(k);
          }
        }
      }
      EXPECT_EQ(beyond, 0u) << "of drop " << k << " of " << material << " in layer " << layer;
    }
    return drops;
  }
};

std::uint64_t sum_of_drops(const DropPixels& drops) {
  std::uint64_t sum = 0;
  for (const int of : drops) sum += static_cast<std::uint64_t>(of);
  return sum;
}

const std::string kTwoMaterials = "jet low.stl high.stl --machine twins.toml --layer 0.1 --material steel,bronze ";
const std::string kNoMaterials = "jet low.stl high.stl --machine twins.toml --layer 0.1 ";

/// A job file of two parts side by side or over each other; keys of the job and of the second part.
std::string text_of_two_parts(const std::string& keys, const std::string& second, double at, bool materials) {
  const auto name = [&](const char* material) { return materials ? std::string("material = \"") + material + "\"\n" : ""; };
  return "[machine]\nprofile = \"twins.toml\"\n[layers]\nthickness_mm = 0.1\n" + keys +
         "[[part]]\npath = \"low.stl\"\nat_mm = [1, 1]\n" + name("steel") + "[[part]]\npath = \"high.stl\"\nat_mm = [" +
         std::to_string(at) + ", 1]\n" + name("bronze") + second;
}

// Drops are as they are without materials, each of one material; a program fires all of them.
TEST_F(MaterialDrops, AddUpToThoseOfTheJobWithoutMaterials) {
  struct Case {
    std::string keys, second;
    double at;
    bool shared;  // voxels may get drops of both
  };
  const std::vector<Case> cases = {
      {"[dose]\nsaturation_percent = 46\n", "", 4, false},
      {"[dose]\nsaturation_percent = 52\ndithered = false\n", "", 2.5, false},
      {"[dose]\nsaturation_percent = 70\ncore_saturation_percent = 33\nshell_mm = 0.5\nbleed_um = [120, 120]\n",
       "saturation_percent = 25\n", 2.5, false},
      {"[image]\nmirror = \"x\"\n[dose]\nsaturation_percent = \"30+5*x\"\n", "", 4, false},
      {"[dose]\nsaturation_percent = 70\nlevels = 16\n", "saturation_percent = 69\n", 3.97, true},
      {"[dose]\nsaturation_percent = 55\nlevels = 4\ndithered = false\n", "saturation_percent = 70\n", 3.93, true},
      {"[image]\nmirror = \"xy\"\n[dose]\nlevels = 4\ndithered = false\n", "bleed_um = [20, 20]\n", 3.93, true},
  };
  std::uint32_t both = 0;
  for (std::size_t i = 0; i < cases.size(); ++i) {
    const auto& [keys, second, at, shared] = cases[i];
    const std::string two = "two" + std::to_string(i), one = "one" + std::to_string(i);
    test::write_text(folder_ / "two.toml", text_of_two_parts(keys, second, at, true));
    test::write_text(folder_ / "one.toml", text_of_two_parts(keys, second, at, false));
    done("jet --job two.toml --quiet -o " + two);
    done("jet --job one.toml --images drops --quiet -o " + one);
    done("verify --quiet " + two);
    const Manifest of_two = manifest(two), of_one = manifest(one);
    const std::uint32_t maximum = of_one.head.max_drops;
    ASSERT_GT(maximum, 1u);
    ASSERT_EQ(of_two.head.max_drops, maximum);
    ASSERT_EQ(of_two.layers.size(), of_one.layers.size());
    for (std::uint32_t layer = 0; layer < of_one.layers.size(); ++layer) {
      const DropPixels steel = drops_of(two, layer, "steel", maximum), bronze = drops_of(two, layer, "bronze", maximum),
                       all = drops_of(one, layer, "", maximum);
      DropPixels sum = steel;
      std::uint32_t met = 0;
      for (std::size_t p = 0; p < sum.size(); ++p) sum[p] += bronze[p], met += steel[p] > 0 && bronze[p] > 0 ? 1 : 0;
      EXPECT_TRUE(sum == all) << i << " layer " << layer;
      EXPECT_TRUE(shared || met == 0) << i << " layer " << layer;
      both += met;
      const LayerRecord &record = of_two.layers[layer], &plain = of_one.layers[layer];
      EXPECT_EQ(record.drops, plain.drops);
      EXPECT_EQ(record.requested_drops, plain.requested_drops);
      EXPECT_EQ(record.set_pixels, plain.set_pixels) << i << " layer " << layer;
      EXPECT_EQ(record.max_drops, plain.max_drops);
      EXPECT_EQ(record.drops_of(0, 2), sum_of_drops(steel));
      EXPECT_EQ(record.drops_of(1, 2), sum_of_drops(bronze));
      EXPECT_EQ(record.program.drops, plain.program.drops);
      EXPECT_EQ(record.program.sweeps, plain.program.sweeps);
    }
  }
  EXPECT_GT(both, 0u) << "no voxel has drops of both materials";
}

// Each material gets the target of its parts: 40 % are 2 drops of 5, and 66 % are 3.3.
TEST_F(MaterialDrops, OfEachMaterialAreThoseOfItsTarget) {
  test::write_text(folder_ / "target.toml",
                   text_of_two_parts("[dose]\nsaturation_percent = 40\n", "saturation_percent = 66\n", 4, true));
  for (const char* how : {"--dry-run", "-o out"}) {
    const auto json = facts("jet --job target.toml " + std::string(how));
    ASSERT_EQ(json["materials"].size(), 2u);
    const double pixels[] = {30 * 40 * 8, 30 * 40 * 12}, goal[] = {2, 3.3};
    double drops = 0;
    for (std::size_t m = 0; m < 2; ++m) {
      const auto& material = json["materials"][m];
      EXPECT_EQ(material["set_pixels"].get<double>(), pixels[m]);
      EXPECT_NEAR(material["drops"].get<double>(), pixels[m] * goal[m], 0.001 * pixels[m] * goal[m]) << m;
      EXPECT_NEAR(material["binder_mm3"].get<double>(), material["drops"].get<double>() * 100e-6, 1e-9);
      drops += material["drops"].get<double>();
    }
    EXPECT_EQ(json["saturation"]["drops"].get<double>(), drops);
  }
  const test::Outcome verified = lamina("verify out --json --quiet");
  ASSERT_EQ(verified.code, 0) << verified.err;
  const auto detected = nlohmann::json::parse(verified.out)["use"]["materials"];
  ASSERT_EQ(detected.size(), 2u);
  const auto reported = facts("jet --job target.toml --dry-run")["materials"];
  for (std::size_t m = 0; m < 2; ++m) {
    for (const char* key : {"name", "set_pixels", "drops", "binder_mm3"}) EXPECT_EQ(detected[m][key], reported[m][key]) << key;
  }
  EXPECT_NE(lamina("jet --job target.toml --dry-run").err.find(" of steel: 19 200 drops, 0.002 ml of binder"),
            std::string::npos);
}

// A voxel at the seam is three tenths of steel and seven tenths of bronze, and so are its drops over many voxels.
TEST_F(MaterialDrops, OfSharedVoxelsFollowTheShares) {
  test::write_text(folder_ / "seam.toml", text_of_two_parts("[dose]\nsaturation_percent = 66\nlevels = 16\n",
                                                            "saturation_percent = 66.0001\n", 4.03, true));
  test::write_box(folder_ / "low.stl", {0, 0, 0}, {3.03f, 4, 1.2f});
  done("jet --job seam.toml --quiet -o seam");
  done("verify --quiet seam");
  const std::uint32_t maximum = manifest("seam").head.max_drops;
  ASSERT_EQ(maximum, 4u);
  std::uint64_t steel = 0, bronze = 0;
  for (std::uint32_t layer = 0; layer < 12; ++layer) {
    const DropPixels of_steel = drops_of("seam", layer, "steel", maximum),
                     of_bronze = drops_of("seam", layer, "bronze", maximum);
    for (std::size_t r = 0; r < 100; ++r) steel += of_steel[r * 160 + 40], bronze += of_bronze[r * 160 + 40];
  }
  const double voxels = 40 * 12, share = 4.0 / 15;  // level 4 of 15 (0.3 is a tie that float edges end), 11 are left
  EXPECT_NEAR(static_cast<double>(steel + bronze), voxels * 3.3, 0.01 * voxels * 3.3);
  const double got = static_cast<double>(steel) / static_cast<double>(steel + bronze);
  EXPECT_TRUE(std::abs(got - share) < 0.01 || std::abs(got - 5.0 / 15) < 0.01) << got;
}

// Of one material a job is the job without any.
TEST_F(MaterialDrops, OfOneMaterialAreTheJobOfNone) {
  done("jet low.stl high.stl --machine twins.toml --layer 0.1 --saturation 46 --material steel --quiet -o steel");
  done(kNoMaterials + "--saturation 46 --quiet -o none");
  for (const char* name : {"layers/000003-drop1.tif", "layers/000003-drop3.tif", "program/000003.planes.zst"})
    EXPECT_TRUE(test::read_text(folder_ / ("steel/" + std::string(name))) ==
                test::read_text(folder_ / ("none/" + std::string(name))))
        << name;
}

TEST_F(MaterialDrops, GiveTheSameBytesHoweverTheyAreMade) {
  for (const std::string dose :
       {"--saturation 46", "--saturation 66 --levels 16 --no-dither", "--saturation 46 --format tiff-4"}) {
    const auto resumed = expect_same_however_made(kTwoMaterials + dose), whole = facts(kTwoMaterials + dose + " --dry-run");
    EXPECT_EQ(resumed["materials"], whole["materials"]);
    EXPECT_EQ(resumed["saturation"], whole["saturation"]);
    for (const char* output : {"one", "other", "shards"}) std::filesystem::remove_all(folder_.path() / output);
  }
}

// A grey image a material states the same drops as its images of one bit.
TEST_F(MaterialDrops, AreGreyImagesToo) {
  for (const std::string dose : {"--saturation 46", "--saturation 66 --levels 16", "--saturation 17"}) {
    done(kTwoMaterials + dose + " --quiet -o bits --overwrite");
    const Manifest bits = manifest("bits");
    for (const char* format : {"tiff-4", "tiff-8"}) {
      done(kTwoMaterials + dose + " --quiet -o grey --overwrite --format " + std::string(format));
      done("verify --quiet grey");
      const Manifest grey = manifest("grey");
      const std::uint32_t maximum = grey.head.max_drops;
      ASSERT_EQ(maximum, bits.head.max_drops);
      for (std::uint32_t layer = 0; layer < grey.layers.size(); ++layer) {
        for (std::size_t m = 0; m < 2; ++m) {
          const std::string name = m == 0 ? "steel" : "bronze";
          Levels levels;
          const auto image =
              formats::levels(folder_ / ("grey/" + layer_file_name(layer, ".tif", name)), grey_level_of(maximum), levels);
          ASSERT_TRUE(image.ok()) << image.error().message;
          EXPECT_EQ(sum_of_levels(levels), sum_of_drops(drops_of("bits", layer, name, maximum))) << name << layer;
          EXPECT_EQ(grey.layers[layer].drops_of(m, 2), sum_of_levels(levels));
        }
        EXPECT_EQ(grey.layers[layer].set_pixels, bits.layers[layer].set_pixels);
        EXPECT_EQ(grey.layers[layer].max_drops, bits.layers[layer].max_drops);
        EXPECT_EQ(grey.layers[layer].program.hash, bits.layers[layer].program.hash);
      }
    }
  }
  test::expect_refused(
      "jet low.stl high.stl --material a,b --dpi 254 --bed 20x20 --layer 0.1 --levels 4 --format tiff-8 -o none", 2,
      "need one material as grey", folder_);
}

// A file that is another one, and one whose manifest was made to agree.
TEST_F(MaterialDrops, ThatWereChangedAreFound) {
  done(kTwoMaterials + "--saturation 46 --quiet -o out");
  const std::string first = folder_ / "out/layers/000005-steel-drop1.tif",
                    third = folder_ / "out/layers/000005-steel-drop3.tif",
                    other = folder_ / "out/layers/000005-bronze-drop1.tif", path = folder_ / "out/manifest.json";
  const std::string text = test::read_text(path), kept = test::read_text(third);
  const Manifest was = manifest("out");
  const auto swapped = [&](std::size_t put, std::size_t from) {  // the record of one image becomes that of another
    std::string changed = text;
    const std::size_t line = changed.find("\n{\"index\": 5,");
    const auto span = [&](std::size_t image) {
      const std::string name = was.head.image_name(image);
      const std::size_t begin = changed.find("\"bytes\"", changed.find("000005-" + name + ".tif", line));
      return std::array{begin, changed.find('}', begin) - begin};
    };
    const auto [source, length] = span(from);
    const std::string record = changed.substr(source, length);
    const auto [target, old] = span(put);
    return changed.replace(target, old, record);
  };
  // steel: 0 to 2, bronze: 3 to 5
  ASSERT_EQ(was.head.named_images(), 6u);
  std::filesystem::copy_file(first, third, std::filesystem::copy_options::overwrite_existing);
  EXPECT_NE(fault("out").find("layers/000005-steel-drop3.tif"), std::string::npos);
  test::write_text(path, swapped(2, 0));
  EXPECT_NE(fault("out").find("layer 5: its images have "), std::string::npos) << fault("out");
  std::filesystem::copy_file(other, third, std::filesystem::copy_options::overwrite_existing);
  test::write_text(path, swapped(2, 3));
  EXPECT_NE(fault("out").find("000005-steel-drop3.tif: sets pixels that get no drop before"), std::string::npos)
      << fault("out");
  test::write_text(third, kept);
  std::filesystem::copy_file(first, other, std::filesystem::copy_options::overwrite_existing);
  test::write_text(path, swapped(3, 0));
  EXPECT_NE(fault("out").find("000005-bronze-drop1.tif: sets pixels that another material's image sets as well"),
            std::string::npos)
      << fault("out");
}

// What a program fires is held against the drops of both materials.
TEST_F(MaterialDrops, AreReplayedPlaneByPlane) {
  done(kTwoMaterials + "--saturation 46 --set program.compress=false --quiet -o out");
  const std::string program = folder_ / "out/program/000005.planes";
  std::string text = test::read_text(program);
  std::uint32_t found = 0;
  for (std::size_t at = text.size() / 3; at < text.size() && found < 5; at += 97) {
    std::string changed = text;
    changed[at] = static_cast<char>(changed[at] ^ 1);
    test::write_text(program, changed);
    EXPECT_NE(fault("out").find("program/000005.planes"), std::string::npos);
    ++found;
  }
  test::write_text(program, text);
  done("verify --quiet out");
}

TEST_F(MaterialDrops, HaveNumbersOfTheirLayerThatAreVerified) {
  done(kTwoMaterials + "--saturation 66 --levels 16 --quiet -o out");
  const std::string path = folder_ / "out/manifest.json", text = test::read_text(path);
  for (const char* key : {"\"max_drops\": ", "\"set_pixels\": ", "\"unfed_pixels\": "}) {
    std::string changed = text;
    std::size_t at = changed.find(key, changed.find("\n{\"index\": 3,")) + std::string(key).size();
    changed[at] = changed[at] == '9' ? '8' : static_cast<char>(changed[at] + 1);
    test::write_text(path, changed);
    EXPECT_NE(fault("out").find("layer 3: "), std::string::npos) << key << fault("out");
  }
}

// Which parts pay for which drops.
TEST_F(MaterialDrops, AreSharedOutAmongParts) {
  test::write_text(folder_ / "target.toml",
                   text_of_two_parts("[dose]\nsaturation_percent = 40\n", "saturation_percent = 66\n", 4.5, true));
  done("jet --job target.toml --quote quote.csv --quiet -o out");
  done("verify --quiet out");
  for (const LayerRecord& record : manifest("out").layers) {
    ASSERT_EQ(record.part_drops.size(), 2u);
    for (std::size_t m = 0; m < 2; ++m) EXPECT_EQ(record.part_drops[m], record.drops_of(m, 2));
  }
}

// A sweep for each drop, regardless of what is under it; a head of one vat gets its commands.
TEST_F(MaterialDrops, AreCarriedByTheProgramsOfMachinesWithTwoVats) {
  const std::string parts = "jet low.stl high.stl --material steel,bronze --layer 0.1 --saturation 46 --quiet ";
  done(parts + "--machine nuferbj --vat-rule both -o gcode");
  done("verify --quiet gcode");
  EXPECT_GT(manifest("gcode").head.max_drops, 2u);
  for (const char* dialect : {"raw", "planes"}) {
    std::string text = kTwoVats;
    text.replace(text.find("\"planes\""), 8, "\"" + std::string(dialect) + "\"");
    test::write_text(folder_ / "mine.toml", text);
    done(parts + "--machine mine.toml -o " + dialect);
    done("verify --quiet " + std::string(dialect));
  }
  for (const char* machine : {"oasis", "jet1000-grey"})
    test::expect_refused(parts + "--machine " + machine + " -o none", 2, "has one vat; plan them as several jobs", folder_);
}

// Pixels decide which vat feeds, however many drops they get: 20 x 40 of steel, 50 x 40 of bronze.
TEST_F(MaterialDrops, AreFedByTheVatOfMorePixels) {
  test::write_box(folder_ / "low.stl", {0, 0, 0}, {2, 4, 0.8f});
  test::write_box(folder_ / "high.stl", {0, 0, 0}, {5, 4, 0.8f});
  test::write_text(folder_ / "nuferbj.toml",
                   "[machine]\nprofile = \"nuferbj\"\nvat_rule = \"majority\"\n[layers]\nthickness_mm = 0.1\n[dose]\n"
                   "saturation_percent = 60\n[[part]]\npath = \"low.stl\"\nmaterial = \"steel\"\n[[part]]\n"
                   "path = \"high.stl\"\nmaterial = \"bronze\"\nsaturation_percent = 15\n");
  const auto json = facts("jet --job nuferbj.toml -o out");
  done("verify --quiet out");
  EXPECT_EQ(json["materials"][0]["unfed_pixels"], json["materials"][0]["set_pixels"]);
  EXPECT_EQ(json["materials"][0]["unfed_layers"], 8);
  EXPECT_EQ(json["materials"][1]["unfed_pixels"], 0);
  EXPECT_GT(json["materials"][0]["drops"], json["materials"][1]["drops"]);
  const std::string program = test::read_text(folder_ / "out/program/000003.gcode");
  EXPECT_EQ(program.find("\nG1 A"), std::string::npos);
  EXPECT_NE(program.find("\nG1 B"), std::string::npos);
}

}  // namespace
}  // namespace lamina::pipeline
