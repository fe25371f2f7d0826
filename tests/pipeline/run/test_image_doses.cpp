// Grey images as parts next to parts of other materials and doses, whose voxels they share.
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "pipeline/manifest/manifest.h"
#include "tests/commands/program.h"

namespace lamina {
namespace {

/// 20 x 12 mm at 254 dpi, two powders; 4.7 drops of 85 pl in the voids of 400 pl of a layer of 0.1 mm.
constexpr const char* kTwoPowderPrinter = R"([machine]
name = "printer"
dialect = "planes"
[bed]
size_mm = [20, 12]
build_height_mm = 50
[head]
nozzles = 120
pitch_um = 100
drop_pl = 85
[powder]
vats = 2
vat_rule = "majority"
packing = 0.6
[cost]
binder_price_l = 10000
)";

class ImageDoses : public testing::Test {
 protected:
  ImageDoses() {
    test::write_text(folder_ / "printer.toml", kTwoPowderPrinter);
    test::write_box(folder_ / "box.stl", {0, 0, 0}, {3.03f, 4.06f, 0.53f});
    test::write_box(folder_ / "other.stl", {0, 0, 0}, {5.02f, 4.51f, 0.47f});
  }
  void done(const std::string& line) const {
    const test::Outcome outcome = test::run_lamina(test::words_of(line + " --quiet"), folder_.path());
    ASSERT_EQ(outcome.code, 0) << line << "\n" << outcome.err;
  }
  std::string files(const std::string& output, const std::string& folder) const {
    return test::tree_text(folder_.path() / output / folder);
  }
  /// A job of a mesh and, over it, of another one or of its images.
  void write_job(const std::string& name, bool images, const std::string& dose, const std::string& first,
                 const std::string& second) const {
    test::write_text(folder_ / name, "[machine]\nprofile = \"printer.toml\"\n[layers]\nthickness_mm = 0.1\n" + dose +
                                         "[[part]]\npath = \"box.stl\"\nat_mm = [2, 2]\n" + first +
                                         (images ? "[[part]]\npath = \"grey\"\nat_mm = [0, 0]\n"
                                                 : "[[part]]\npath = \"other.stl\"\nat_mm = [5, 2]\n") +
                                         second);
  }
  test::Directory folder_;
};

// The images of a mesh are its drops, regardless of parts that share its voxels.
TEST_F(ImageDoses, AreThoseOfTheMeshesThatTheyWereMadeOf) {
  struct Case {
    const char *dose, *first, *second;
  };
  const Case cases[] = {
      {"[dose]\nsaturation_percent = 55\n", "material = \"steel\"\n", "material = \"bronze\"\n"},
      {"[dose]\nsaturation_percent = 16\n", "", "saturation_percent = 13\n"},
      {"[dose]\nsaturation_percent = 55\nbleed_um = [60, 60]\nshell_mm = 0.5\n", "material = \"steel\"\n",
       "material = \"bronze\"\nsaturation_percent = 75\ncore_saturation_percent = 20\n"},
      {"[image]\nmirror = \"y\"\n[dose]\nsaturation_percent = 75\ncore_saturation_percent = 20\nshell_mm = 0.5\n", "",
       "saturation_percent = 55\n"},
      {"[dose]\n", "material = \"steel\"\n", "material = \"bronze\"\n"},
      {"[dose]\nsaturation_percent = \"20+4*x\"\n", "", "saturation_percent = 55\n"},
  };
  for (const char* levels : {"4", "16"}) {
    done("jet other.stl --at 5,2 --layer 0.1 --bed 20x12 --dpi 254 --format tiff-8 --overwrite -o grey --levels " +
         std::string(levels));
    for (const auto& [dose, first, second] : cases) {
      const std::string text = std::string(dose) + "levels = " + levels + "\n";
      write_job("mesh.toml", false, text, first, second);
      write_job("images.toml", true, text, first, second);
      done("jet --job mesh.toml --overwrite -o mesh");
      done("jet --job images.toml --overwrite -o images");
      done("verify images");
      EXPECT_TRUE(files("images", "layers") == files("mesh", "layers")) << text << second;
      EXPECT_TRUE(files("images", "program") == files("mesh", "program")) << text << second;
      done("jet --job images.toml --overwrite -o other --threads 1 --engine contours --memory 64K");
      EXPECT_TRUE(test::tree_text(folder_.path() / "other") == test::tree_text(folder_.path() / "images")) << text << second;
    }
  }
}

// An image alone, with a dose of its own, is the job of that dose.
TEST_F(ImageDoses, OfOnePartAloneAreThoseOfTheJob) {
  done("jet other.stl --at 5,2 --layer 0.1 --bed 20x12 --dpi 254 --format tiff-8 -o grey --levels 16");
  const std::string head = "[machine]\nprofile = \"printer.toml\"\n[dose]\nlevels = 16\nsaturation_percent = ",
                    part = "[[part]]\npath = \"grey\"\nat_mm = [0, 0]\n";
  test::write_text(folder_ / "own.toml", head + "90\n" + part + "saturation_percent = 55\n");
  test::write_text(folder_ / "job.toml", head + "55\n" + part);
  done("jet --job own.toml -o own");
  done("jet --job job.toml -o job");
  done("verify own");
  for (const char* file : {"layers/000001-drop1.tif", "layers/000004-drop2.tif", "program/000002.planes.zst"})
    EXPECT_TRUE(test::read_text(folder_ / ("own/" + std::string(file))) ==
                test::read_text(folder_ / ("job/" + std::string(file))))
        << file;
}

// Next to a mesh of its own kind the larger share counts, so the mesh with its images is the mesh.
TEST_F(ImageDoses, AddNothingToTheMeshOfTheirKind) {
  done("jet other.stl --at 5,2 --layer 0.1 --bed 20x12 --dpi 254 --format tiff-8 -o grey --levels 16");
  const std::string head =
      "[machine]\nprofile = \"printer.toml\"\n[layers]\nthickness_mm = 0.1\n[dose]\nlevels = 16\nsaturation_percent = 55\n"
      "[[part]]\npath = \"box.stl\"\nat_mm = [2, 2]\nmaterial = \"steel\"\n[[part]]\npath = \"other.stl\"\nat_mm = [5, 2]\n"
      "material = \"bronze\"\n";
  test::write_text(folder_ / "mesh.toml", head);
  test::write_text(folder_ / "both.toml", head + "[[part]]\npath = \"grey\"\nat_mm = [0, 0]\nmaterial = \"bronze\"\n");
  done("jet --job mesh.toml -o mesh");
  done("jet --job both.toml -o both");
  EXPECT_TRUE(files("both", "layers") == files("mesh", "layers"));
}

// What parts pay for adds up to the drops of the layer.
TEST_F(ImageDoses, AreSharedOutAmongParts) {
  done("jet other.stl --at 5,2 --layer 0.1 --bed 20x12 --dpi 254 --format tiff-8 -o grey --levels 16");
  write_job("images.toml", true, "[dose]\nlevels = 16\nsaturation_percent = 20\n", "material = \"steel\"\n",
            "material = \"bronze\"\nsaturation_percent = 75\n");
  done("jet --job images.toml -o images");
  done("verify images");
  const auto manifest = read_manifest(folder_ / "images/manifest.json");
  ASSERT_TRUE(manifest.ok()) << manifest.error().message;
  for (const LayerRecord& record : manifest->layers) {
    ASSERT_EQ(record.part_drops.size(), 2u);
    EXPECT_EQ(record.part_drops[0] + record.part_drops[1], record.drops);
    for (std::size_t part = 0; part < 2; ++part) {
      const auto drops = static_cast<double>(record.drops_of(part, 2));
      EXPECT_NEAR(static_cast<double>(record.part_drops[part]), drops, 0.04 * drops + 60) << record.layer.index;
    }
  }
}

}  // namespace
}  // namespace lamina
