// Grey images as parts: what lamina jet writes as shares of voxels and takes again gives the same bytes; what they cost; and
// what other commands say of them.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "pipeline/manifest/manifest.h"
#include "stages/data/levels.h"
#include "stages/formats/images/image.h"
#include "tests/commands/program.h"

namespace lamina {
namespace {

namespace fs = std::filesystem;

// 100 x 50 mm at 254 dpi; an hour costs 36, so a second costs one hundredth.
constexpr const char* kPrinter = R"([machine]
name = "printer"
[bed]
size_mm = [100, 50]
build_height_mm = 50
[head]
drop_pl = 80
max_drop_sweeps = 8
[mounting]
dpi = 254
[powder]
dose = 1.5
packing = 0.6
[cost]
hour_price = 36
binder_price_l = 10000
)";

class ImageLevels : public testing::Test {
 protected:
  test::Outcome run(const std::string& line) const {
    return test::run_lamina(test::words_of(line + " --quiet"), folder_.path());
  }
  void done(const std::string& line) const {
    const test::Outcome outcome = run(line);
    ASSERT_EQ(outcome.code, 0) << line << "\n" << outcome.err;
  }
  std::string layers(const std::string& output) const { return test::tree_text(folder_.path() / output / "layers"); }
  Manifest manifest(const std::string& output) const {
    auto manifest = read_manifest(folder_ / (output + "/manifest.json"));
    EXPECT_TRUE(manifest.ok()) << manifest.error().message;
    return manifest ? std::move(*manifest) : Manifest();
  }
  Levels levels(const std::string& file, std::uint8_t full) const {
    Levels levels;
    const auto image = formats::levels(folder_ / file, full, levels);
    EXPECT_TRUE(image.ok()) << image.error().message;
    return levels;
  }
  void forget(std::initializer_list<const char*> names) const {
    for (const char* name : names) fs::remove_all(folder_.path() / name);
  }

  test::Directory folder_;
};

/// Real parts: those of the corpus, and others where LAMINA_MODELS names them.
std::vector<std::string> real_parts() {
  std::vector<std::string> parts{test::corpus_file("parameter_quality_nut.stl"), test::corpus_file("dental_crown.stl")};
  if (const char* const models = std::getenv("LAMINA_MODELS")) {
    for (const char* name : {"stanford_bunny.stl", "cube_gears_17_items.3mf", "quad_knot.obj", "screw_cap_insert_threads.stl"})
      parts.push_back(std::string(models) + "/" + name);
  }
  return parts;
}

TEST_F(ImageLevels, GiveTheBytesOfTheMeshesThatTheyWereMadeOf) {
  int jobs = 0;
  for (const std::string& part : real_parts()) {
    for (const char* format : {"tiff-4", "tiff-8", "png-8"}) {
      for (const char* levels : {"2", "4", "16"}) {
        const std::string rest =
            std::string(" --layer 1.7 --dpi 90x70 --bed 260x240.3 --format ") + format + " --levels " + levels;
        done("jet " + part + rest + " -o first");
        done("jet first" + rest + " -o again");
        ASSERT_EQ(layers("again"), layers("first")) << part << rest;
        EXPECT_GT(manifest("first").layers.front().dosed_pixels + manifest("first").layers[1].dosed_pixels, 0u);
        forget({"first", "again"});
        ++jobs;
      }
    }
  }
  RecordProperty("jobs", jobs);
}

// Of levels become drops what of the mesh does, on a printer and however the work is shared out.
TEST_F(ImageLevels, BecomeTheDropsOfTheMesh) {
  const std::string part = test::corpus_file("dental_crown.stl");
  test::write_text(folder_.path() / "printer.toml", kPrinter);
  const std::string rest = " --layer 0.5 --machine printer.toml --levels 16";
  done("jet " + part + " --layer 0.5 --bed 100x50 --dpi 254 --levels 16 --format tiff-4 -o grey --at 10,10");
  done("jet " + part + rest + " --saturation 4 --at 10,10 -o mesh");
  done("jet grey" + rest + " --saturation 4 --at 0,0 -o shares");
  const Manifest mesh = manifest("mesh"), shares = manifest("shares");
  ASSERT_EQ(mesh.layers.size(), shares.layers.size());
  EXPECT_EQ(layers("shares"), layers("mesh"));
  EXPECT_EQ(test::tree_text(folder_.path() / "shares/program"), test::tree_text(folder_.path() / "mesh/program"));
  done("verify shares");
  done("jet grey" + rest + " --saturation 4 --at 0,0 -o shards --shard 1/2");
  done("jet grey" + rest + " --saturation 4 --at 0,0 -o shards --shard 2/2 --threads 1");
  done("merge shards -o merged");
  EXPECT_EQ(layers("merged"), layers("mesh"));
}

// Next to a mesh the larger share counts: with itself, nothing changes; with another one, both are there.
TEST_F(ImageLevels, AreMergedWithMeshesByTheLargerShare) {
  const std::string part = test::corpus_file("dental_crown.stl");
  const std::string rest = " --layer 0.7 --dpi 120 --bed 40x20 --levels 16 --format tiff-8";
  done("jet " + part + rest + " --at 1,1 -o one");
  const auto job = [&](const std::string& name, const std::string& parts) {
    test::write_text(folder_.path() / (name + ".toml"), parts);
    done("jet --job " + name + ".toml" + rest + " -o " + name);
  };
  const std::string mesh = "[[part]]\npath = \"" + part + "\"\nat_mm = ", images = "[[part]]\npath = \"one\"\nat_mm = [0, 0]\n";
  job("same", mesh + "[1, 1]\n" + images);
  EXPECT_EQ(layers("same"), layers("one"));
  job("both", mesh + "[20, 1]\n" + images);
  job("meshes", mesh + "[20, 1]\n" + mesh + "[1, 1]\n");
  EXPECT_EQ(layers("both"), layers("meshes"));
  // With a small offset from itself: each pixel has the larger one.
  job("moved", mesh + "[2.3, 1.4]\n");
  job("overlap", mesh + "[2.3, 1.4]\n" + images);
  std::uint64_t more = 0;
  for (const LayerRecord& record : manifest("one").layers) {
    const std::string file = layer_file_name(record.layer.index, ".tif");
    const Levels a = levels("one/" + file, 15), b = levels("moved/" + file, 15), c = levels("overlap/" + file, 15);
    for (std::uint8_t minimum = 1; minimum <= 15; ++minimum) {
      Runs in_a, in_b, in_c;
      threshold_levels(a, minimum, in_a), threshold_levels(b, minimum, in_b), threshold_levels(c, minimum, in_c);
      std::vector<bool> expected(in_a.columns);
      for (std::uint32_t r = 0; r < in_a.view().rows(); ++r) {
        expected.assign(in_a.columns, false);
        for (const Runs* image : {&in_a, &in_b}) {
          const auto row = image->view().row(r);
          for (std::size_t i = 0; i + 1 < row.size(); i += 2)
            for (std::uint32_t p = row[i]; p < row[i + 1]; ++p) expected[p] = true;
        }
        const auto row = in_c.view().row(r);
        for (std::uint32_t p = 0, i = 0; p < in_c.columns; ++p) {
          while (i < row.size() && row[i] <= p) ++i;
          ASSERT_EQ(i % 2 == 1, expected[p]) << record.layer.index << " " << r << " " << p;
          more += expected[p];
        }
      }
    }
  }
  EXPECT_GT(more, 1000u);
}

TEST_F(ImageLevels, AreMirroredCroppedResampledAndThresholded) {
  const std::string part = test::corpus_file("dental_crown.stl");
  const std::string rest = " --layer 1 --levels 4 --format png-8";
  done("jet " + part + rest + " --dpi 100 --bed 30x20 --at 2,3 -o grey");
  done("jet " + part + rest + " --dpi 100 --bed 30x20 --at 2,3 --mirror xy -o turned");
  done("jet grey" + rest + " --dpi 100 --bed 30x20 --mirror xy -o again");
  EXPECT_EQ(layers("again"), layers("turned"));
  done("jet turned" + rest + " --dpi 100 --bed 30x20 --mirror xy -o back");
  EXPECT_EQ(layers("back"), layers("grey"));
  // What sticks out is empty here, so that the mesh on the smaller bed is the same.
  done("jet " + part + rest + " --dpi 100 --bed 17x18 --at 2,3 -o small");
  done("jet grey" + rest + " --dpi 100 --bed 17x18 --at 0,0 --set part.crop=true -o cropped");
  EXPECT_EQ(layers("cropped"), layers("small"));
  // Twice as many dots: each pixel four times.
  done("jet grey" + rest + " --dpi 200 --bed 30x20 --at 0,0 --set part.resample=true -o fine");
  const Manifest grey = manifest("grey"), fine = manifest("fine");
  for (std::size_t l = 0; l < grey.layers.size(); ++l) {
    const std::string file = layer_file_name(static_cast<std::uint32_t>(l), ".png");
    EXPECT_NEAR(static_cast<double>(sum_of_levels(levels("fine/" + file, 3))),
                4.0 * static_cast<double>(sum_of_levels(levels("grey/" + file, 3))), 1)
        << l;
  }
  // Without --levels, half and more is set, in every format of grey; of two of them, half is a tie that goes up.
  for (const char* format : {"tiff-4", "tiff-8", "png-8"}) {
    for (const char* levels : {"2", "4", "16"}) {
      done("jet " + part + " --layer 1 --dpi 100 --bed 30x20 -o shares --format " + format + " --levels " + levels);
      done("jet shares --layer 1 --dpi 100 --bed 30x20 -o half");
      done("jet " + part + " --layer 1 --dpi 100 --bed 30x20 -o rounded --no-dither --levels " + levels);
      if (levels[0] == '2') {
        EXPECT_EQ(layers("half"), layers("rounded")) << format;
      }
      const Manifest shares = manifest("shares"), half = manifest("half");
      for (const LayerRecord& record : shares.layers) {
        const auto full = static_cast<std::uint8_t>(std::stoi(levels) - 1);
        Runs set;
        threshold_levels(
            this->levels("shares/" + layer_file_name(record.layer.index, format[0] == 't' ? ".tif" : ".png"), full),
            static_cast<std::uint8_t>((full + 1) / 2), set);
        EXPECT_EQ(half.layers[record.layer.index].set_pixels, set_pixels(set));
      }
      forget({"shares", "half", "rounded"});
    }
  }
}

TEST_F(ImageLevels, ConvertToTheirFormatsAndBack) {
  const std::string part = test::corpus_file("dental_crown.stl");
  done("jet " + part + " --layer 1 --dpi 100 --bed 30x20 --levels 16 --format tiff-4 -o grey");
  done("convert grey/layers -o as8 --format tiff-8 --mirror x");
  done("convert as8 -o aspng --format png-8");
  done("convert aspng -o as4 --format tiff-4 --mirror x");
  const auto files = [&](const std::string& name) { return test::files_below(folder_.path() / name); };
  ASSERT_EQ(files("as4").size(), files("grey/layers").size());
  for (const std::string& file : test::files_below(folder_.path() / "grey/layers")) {
    const std::string name = fs::path(file).filename().string();
    const Levels a = levels("grey/layers/" + name, 15), b = levels("as4/" + name, 15);
    EXPECT_TRUE(a.change == b.change && a.level == b.level && a.row_offset == b.row_offset) << name;
  }
  done("convert as4 -o two --format tiff-8 --levels 2");
  done("convert as4 -o bits --format bmp");
  for (const std::string& file : test::files_below(folder_.path() / "bits")) {
    const std::string stem = fs::path(file).stem().string();
    Runs full;
    threshold_levels(levels("two/" + stem + ".tif", 1), 1, full);
    EXPECT_EQ(set_pixels(full), set_pixels(formats::image(folder_ / ("bits/" + stem + ".bmp"))->runs));
  }
  test::expect_refused("convert as4 -o no --format tiff-g4 --levels 4", 2, "--levels: is of grey formats", folder_);
  test::expect_refused("convert as4 -o no --format tiff-4 --levels 256", 2, "give 2, 4 or 16", folder_);
  test::expect_refused("convert as4 -o no --format tiff-8 --threshold 5", 2, "--threshold: is of 1-bit formats", folder_);
}

TEST_F(ImageLevels, ThatDoNotFitAreOneLineEach) {
  test::write_box(folder_ / "box.stl", {0, 0, 0}, {2, 3, 0.3f});
  const std::string rest = " --layer 0.1 --dpi 254 --bed 9x9";
  done("jet box.stl --at 1,1 --levels 16 --format tiff-4 -o grey" + rest);
  const auto refused = [&](const std::string& line, const std::string& words) {
    test::expect_refused(line + rest + " -o no", 2, words, folder_);
  };
  refused("jet grey --levels 4 --set part.threshold=90", "part.threshold applies to 1-bit images");
  refused("jet grey --levels 4 --containment inside", "--containment");
}

// Grey of another program, whose files state no resolution: (255 - v) 3 / 255 is 3, 2.51, 2 and 1, 0.49, 0.
TEST_F(ImageLevels, TakeGreyOfOtherPrograms) {
  fs::create_directory(folder_.path() / "grey");
  std::string pixels = "P5 3 2 255\n";
  for (const int value : {0, 42, 85, 170, 213, 255}) pixels += static_cast<char>(value);
  test::write_text(folder_.path() / "grey/slice-001.PGM", pixels);
  const std::string rest = " --layer 0.1 --dpi 254 --bed 0.3x0.2 --levels 4 --format tiff-8 -o out";
  test::expect_refused("jet grey" + rest, 3, "add part.dpi", folder_);
  done("jet grey --set part.dpi=254" + rest);
  const Levels image = levels("out/" + layer_file_name(0, ".tif"), 3);
  EXPECT_EQ(std::vector<std::uint32_t>(image.change.begin(), image.change.end()),
            (std::vector<std::uint32_t>{0, 2, 2, 3, 0, 1}));
  EXPECT_EQ(std::vector<std::uint8_t>(image.level.begin(), image.level.end()), (std::vector<std::uint8_t>{3, 2, 1}));
}

// Where images begin: their manifest says 0.4 mm, unless the job says otherwise, also that it is 0.
TEST_F(ImageLevels, BeginWhereTheJobSays) {
  test::write_box(folder_ / "box.stl", {0, 0, 0}, {2, 3, 0.3f});
  const std::string rest = " --layer 0.1 --dpi 254 --bed 9x9";
  done("jet box.stl --bottom 0.4 --layers 4:7 -o slices" + rest);
  const auto empty_below = [&](const std::string& name) {
    std::size_t empty = 0;
    for (const LayerRecord& record : manifest(name).layers) empty += record.set_pixels == 0;
    return empty;
  };
  done("jet slices -o there" + rest);
  EXPECT_EQ(empty_below("there"), 4u);
  done("jet slices --bottom 0 -o zero --save-job zero.toml" + rest);
  EXPECT_EQ(empty_below("zero"), 0u);
  done("jet --job zero.toml -o saved");
  EXPECT_EQ(empty_below("saved"), 0u);
  done("jet slices -o kept --save-job there.toml" + rest);
  done("jet --job there.toml -o saved_there");
  EXPECT_EQ(empty_below("saved_there"), 4u);
}

class ImageCosts : public ImageLevels {
 protected:
  ImageCosts() {
    test::write_text(folder_.path() / "printer.toml", kPrinter);
    test::write_box(folder_ / "high.stl", {0, 0, 0}, {10, 10, 0.6f});
    test::write_box(folder_ / "low.stl", {0, 0, 0}, {20, 10, 0.2f});
  }
  nlohmann::json use(const std::string& parts, const std::string& more = {}) const {
    test::write_text(folder_.path() / "job.toml", parts);
    const test::Outcome outcome = test::run_lamina(
        test::words_of("jet --job job.toml --layer 0.1 --machine printer.toml --dry-run --json --quiet" + more),
        folder_.path());
    EXPECT_EQ(outcome.code, 0) << outcome.err;
    return outcome.code == 0 ? nlohmann::json::parse(outcome.out)["use"] : nlohmann::json();
  }
  static std::string part(const std::string& path, const std::string& rest) {
    return "[[part]]\npath = \"" + path + "\"\n" + rest + "\n";
  }
};

// 100 x 100 pixels in six layers, and 200 x 100 in two: 60,000 and 40,000 drops; in the lower two layers the wide one has two
// thirds of the pixels.
TEST_F(ImageCosts, AreSharedByPixelsAndHeightsAsThoseOfMeshes) {
  const std::string bed = " --layer 0.1 --dpi 254 --bed 100x50";
  done("jet high.stl --at 5,5 -o images" + bed);
  const std::string low = part("low.stl", "at_mm = [40, 5]");
  const auto meshes = use(part("high.stl", "at_mm = [5, 5]") + low), mixed = use(part("images", "at_mm = [0, 0]") + low);
  ASSERT_EQ(mixed["parts"].size(), 2u) << mixed.dump();
  EXPECT_EQ(mixed["parts"][0]["drops"], 60'000);
  EXPECT_EQ(mixed["parts"][1]["drops"], 40'000);
  for (const auto& [key, value] : meshes.items()) {
    if (key != "parts") {
      EXPECT_EQ(mixed[key], value) << key;
    }
  }
  for (int p = 0; p < 2; ++p) {
    auto a = meshes["parts"][p], b = mixed["parts"][p];
    a.erase("path"), b.erase("path");
    EXPECT_EQ(a, b) << p;
  }
  // Mirrored, and as shares of voxels, the same.
  for (const char* more : {" --mirror xy", " --levels 16"}) {
    const auto turned = use(part("images", "at_mm = [0, 0]") + low, more);
    EXPECT_EQ(turned["parts"][0]["drops"], 60'000) << more;
    EXPECT_EQ(turned["parts"][1]["drops"], 40'000) << more;
  }
}

// The images cover the whole bed and so the box of the mesh, but none of its pixels: nothing of the one is the other's.
TEST_F(ImageCosts, OfImagesAroundAMeshAreNotThoseOfTheMesh) {
  const std::string bed = " --layer 0.1 --dpi 254 --bed 100x50";
  test::write_text(folder_.path() / "ring.toml", part("low.stl", "at_mm = [5, 5]") + part("low.stl", "at_mm = [70, 35]"));
  done("jet --job ring.toml -o ring" + bed);
  const auto mixed = use(part("ring", "at_mm = [0, 0]") + part("high.stl", "at_mm = [45, 20]"));
  ASSERT_EQ(mixed["parts"].size(), 2u);
  EXPECT_EQ(mixed["parts"][0]["drops"], 80'000);
  EXPECT_EQ(mixed["parts"][1]["drops"], 60'000);
}

// Two drops a pixel for the mesh alone: of 60,000 and 40,000 pixels come 120,000 and 40,000 drops.
TEST_F(ImageCosts, FollowTheDropsOfEachPart) {
  const std::string bed = " --layer 0.1 --dpi 254 --bed 100x50";
  done("jet low.stl --at 40,5 -o images" + bed);
  const auto use = this->use(part("images", "at_mm = [0, 0]") + part("high.stl", "at_mm = [5, 5]\nsaturation_percent = 40"),
                             " --saturation 20");
  ASSERT_EQ(use["parts"].size(), 2u);
  EXPECT_EQ(use["parts"][0]["drops"], 40'000);
  EXPECT_EQ(use["parts"][1]["drops"], 120'000);
}

TEST_F(ImageLevels, AreReportedByInfo) {
  test::write_box(folder_ / "box.stl", {0, 0, 0}, {2, 3, 0.25f});
  done(
      "jet box.stl --layer 0.1 --dpi 254x127 --bed 9x8 --at 1,1 --bottom 0.4 --layers 4:7 --levels 16 --format tiff-8 -o grey");
  const test::Outcome reported = test::run_lamina({"info", "--json", "grey"}, folder_.path());
  ASSERT_EQ(reported.code, 0) << reported.err;
  const auto json = nlohmann::json::parse(reported.out);
  EXPECT_EQ(json["images"], 3);
  EXPECT_EQ(json["bits"], 8);
  EXPECT_EQ(json["format"], "TIFF");
  EXPECT_EQ(json["columns"], 90);
  EXPECT_EQ(json["rows"], 40);
  EXPECT_EQ(json["dpi"], nlohmann::json({254.0, 127.0}));
  EXPECT_EQ(json["layers"]["thickness_mm"], 0.1);
  EXPECT_EQ(json["layers"]["bottom_mm"], 0.4);
  EXPECT_EQ(json["layers"]["levels"], 16);
  EXPECT_EQ(json["set_pixels"], 900);  // 20 x 15, half of a voxel is level 8 of 15
  EXPECT_EQ(json["grey_pixels"], 300);
  EXPECT_NEAR(json["filled_pixels"], 600 + 300 * 8 / 15.0, 1e-6);
  EXPECT_EQ(json["numbers"]["first"], 4);
  const test::Outcome text = test::run_lamina({"info", "grey/layers/000004.tif"}, folder_.path());
  EXPECT_EQ(text.code, 0);
  EXPECT_NE(text.out.find("90 x 40 pixels of 254 x 127 dpi"), std::string::npos) << text.out;
  test::expect_refused("info grey --scale 2", 2, "--scale: is of parts", folder_);
  test::expect_refused("info box.stl --threshold 2", 2, "--threshold: is of layer images", folder_);
  test::write_text(folder_.path() / "grey/layers/000005.tif", "II*");
  const test::Outcome broken = test::run_lamina({"info", "grey"}, folder_.path());
  EXPECT_EQ(broken.code, 3);
  EXPECT_NE(broken.out.find("000005.tif"), std::string::npos) << broken.out;
}

// What gets no drop because drops are few is no pore.
TEST_F(ImageLevels, WithoutDropsAreNoPores) {
  test::write_box(folder_ / "box.stl", {0, 0, 0}, {2, 2, 2});
  test::write_text(folder_.path() / "printer.toml", kPrinter);
  const std::string rest = " --layer 0.1 --at 1,1 ";
  done("jet box.stl --machine printer.toml --saturation 10 --images drops -o few" + rest);
  done("jet box.stl --machine printer.toml --levels 16 -o dithered" + rest);
  done("jet box.stl --machine printer.toml --saturation 10 --format tiff-4 -o few-grey" + rest);
  done("jet box.stl --machine printer.toml --levels 16 --format png-8 -o dithered-grey" + rest);
  done("jet box.stl --bed 5x5 --dpi 254 --core 0.5 -o thin" + rest);
  for (const auto& [name, words] : {std::pair{"few", "get no drop (--saturation)"},
                                    {"dithered", "(--levels)"},
                                    {"few-grey", "get no drop (--saturation)"},
                                    {"dithered-grey", "(--levels)"},
                                    {"thin", "(--core)"}})
    test::expect_refused(std::string("permeability --no-flow ") + name, 3, words, folder_);
  done("jet box.stl --machine printer.toml --saturation 60 -o enough" + rest);
  done("jet box.stl --bed 5x5 --dpi 254 --levels 16 --format tiff-4 -o grey" + rest);
  for (const char* name : {"enough", "grey"}) {
    const test::Outcome outcome = test::run_lamina({"permeability", "--no-flow", "--json", name}, folder_.path());
    ASSERT_EQ(outcome.code, 0) << outcome.err;
    EXPECT_EQ(nlohmann::json::parse(outcome.out)["porosity"], 0) << outcome.out;
  }
}

}  // namespace
}  // namespace lamina
