// Every kind of warning: a job that has it, the word for it on the page about warnings, and the page of lamina report.
#include <gtest/gtest.h>

#include <cstdint>
#include <fstream>
#include <nlohmann/json.hpp>
#include <regex>
#include <set>
#include <string>
#include <vector>

#include "tests/commands/program.h"

namespace lamina::test {
namespace {

namespace fs = std::filesystem;
using KindJson = nlohmann::json;
using KindSet = std::set<std::string>;

enum class Page { kHasIt, kNone, kHasItNot };  // kNone: of lamina slice; kHasItNot: the run alone sees it

struct WarningKind {
  std::string code, job;  // without its output
  Page page = Page::kHasIt;
};

const std::string kBed = " --bed 40x40 --dpi 254 --layer 0.1 ", kInspected = kBed + "--inspect ",
                  kExtruded = " --machine anet-a8 --layer 0.25 ",
                  kSegmented = " --machine anet-a8 --layer 0.3 --fill segmented --angle-step 90 ";

/// `inspection` is a warning of the page itself, in test_inspected_reports.cpp.
const std::vector<WarningKind> kKinds = {
    {"volume", "jet part.stl --layer 0.5 --dpi 1"},
    {"part-lost", "jet --job lost.toml"},
    {"bleed", "jet thin.stl part.stl --bed 60x40 --dpi 300 --layer 0.1 --bleed 300"},
    {"layers-empty", "jet neck.obj --layer 1 --dpi 20"},
    {"tolerance", "extrude part.stl --tolerance 900" + kExtruded},
    {"offset", "slice peg.obj --layer 0.5 --offset -2", Page::kNone},
    {"no-bead", "extrude part.stl --bead 45 --skirt 1 --allow-empty" + kExtruded},
    {"voids", "extrude part.stl --fill raster --machine marlin --layer 0.2", Page::kHasItNot},
    {"thin-walls", "extrude thin.stl part.stl --bead 2" + kExtruded, Page::kHasItNot},
    {"not-written", "slice part.stl --layer 1 --format 3mf --pattern raster --bead 1", Page::kNone},
    {"above-bed", "extrude part.stl --bottom 5" + kExtruded},
    {"empty", "jet part.stl --layer 100 --dpi 60 --allow-empty"},
    {"horizontal-face", "jet level.obj --layer 0.1 --dpi 60", Page::kHasItNot},
    {"rows-capped", "jet open.obj" + kBed},
    {"rows-open", "jet open.obj part.stl --no-repair" + kBed, Page::kHasItNot},
    {"chains-open", "extrude open.obj part.stl --no-repair" + kExtruded},
    {"overhangs", "extrude neck.obj" + kExtruded},
    {"islands", "jet islands.obj" + kInspected},
    {"loose", "jet islands.obj" + kInspected},
    {"hollows", "jet hollow.obj" + kInspected},
    {"thin", "jet rib.obj --min-wall 1" + kInspected},
    {"drains", "jet drained.obj --fill-rule positive" + kInspected},
    {"roofs", "jet part.stl --min-wall 3" + kInspected},
    {"gaps", "jet gap.obj --min-wall 0.5" + kInspected},
    {"contacts", "jet edge.obj --min-wall 0.5" + kInspected},
    {"touching", "jet --job touching.toml" + kInspected},
    {"bed-edge", "jet part.stl --at 0,5" + kInspected},
    {"not-inspected", "jet --job noise.toml --memory 2M" + kInspected},
    {"lost-pixels", "jet part.stl --machine nuferbj --layer 0.1 --blocked 70"},
    {"cover-top", "jet odd.stl --dpi 254 --heights angle --cover-top --containment inside --thickness 0.2"},
    {"mixed-powders", "jet part.stl pin.stl --machine two.toml --material steel,bronze --vat-rule majority --layer 0.1"},
    {"maintenance", "jet part.stl --machine idle.toml --layer 0.1"},
    {"stitching", "jet part.stl --machine stitching.toml --layer 0.1"},
    {"vanished", "jet rib.obj --bleed 300" + kBed},
    {"build-steps", "jet part.stl --machine nuferbj --layer 0.201"},
    {"no-drop", "jet --job dry.toml"},
    {"saturation", "jet part.stl --machine nuferbj --layer 0.1 --saturation 900"},
    {"pores", "extrude part.stl --set segment.thin_speed_percent=90" + kSegmented},
    {"undivided", "extrude peg.obj --set segment.thin_mm=20" + kSegmented},
    {"calibration", "extrude part.stl --machine marlin --layer 0.3 --fill segmented"},
    {"acceleration", "extrude part.stl --machine marlin --layer 0.3 --fill segmented", Page::kHasItNot},
    {"melt-rate", "extrude part.stl --material tpu" + kSegmented, Page::kHasItNot},
    {"planned-again", "slice part.stl --layer 0.5 --resume --format 3mf", Page::kNone},
};

/// Boxes as OBJ; the last `hollow` of them inside out, all `open` at one side.
std::string boxes_text(const std::vector<std::array<double, 6>>& boxes, std::size_t hollow = 0, bool open = false) {
  std::string text;
  for (std::size_t b = 0; b < boxes.size(); ++b) {
    for (int corner = 0; corner < 8; ++corner) {
      text += "v";
      for (int axis = 0; axis < 3; ++axis)
        text += " " + std::to_string(boxes[b][static_cast<std::size_t>(axis + ((corner >> axis & 1) != 0 ? 3 : 0))]);
      text += "\n";
    }
    for (std::array<int, 4> face :
         std::vector<std::array<int, 4>>{{1, 3, 4, 2}, {1, 2, 6, 5}, {3, 7, 8, 4}, {1, 5, 7, 3}, {5, 6, 8, 7}, {2, 4, 8, 6}}) {
      if (open && face[0] == 2) continue;
      if (b >= boxes.size() - hollow) std::swap(face[1], face[3]);
      text += "f";
      for (const int corner : face) text += " " + std::to_string(corner + 8 * static_cast<int>(b));
      text += "\n";
    }
  }
  return text;
}

class WarningKinds : public ::testing::Test {
 protected:
  void SetUp() override {
    const auto file = [&](const char* name, const std::string& text) { write_text(in_ / name, text); };
    write_box(in_ / "part.stl", {0, 0, 0}, {20, 10, 2});
    write_box(in_ / "pin.stl", {0, 0, 0}, {0.3F, 0.3F, 2});
    write_box(in_ / "odd.stl", {0, 0, 0}, {4, 4, 1.05F});
    file("peg.obj", boxes_text({{0, 0, 0, 20, 20, 2}, {8, 8, 2, 11, 11, 4}}));
    file("open.obj", boxes_text({{0, 0, 0, 8, 8, 2}}, 0, true));
    write_box(in_ / "thin.stl", {0, 0, 0}, {8, 0.4F, 1});
    file("level.obj",  // the top is 500 nm above the plane of its last layer on one side, and as much below on the other
         "v 0 0 0\nv 9 0 0\nv 9 8 0\nv 0 8 0\nv 0 0 0.5505\nv 9 0 0.5495\nv 9 8 0.5495\nv 0 8 0.5505\n"
         "f 4 3 2 1\nf 5 6 7 8\nf 1 2 6 5\nf 2 3 7 6\nf 3 4 8 7\nf 4 1 5 8\n");
    file("islands.obj", boxes_text({{0, 0, 0, 8, 8, 2}, {10, 0, 1, 12, 2, 2}}));
    file("hollow.obj", boxes_text({{0, 0, 0, 8, 8, 2}, {2, 2, 0.5, 5, 5, 1.5}}, 1));
    file("drained.obj", boxes_text({{0, 0, 0, 8, 8, 3}, {2, 2, 0.5, 6, 6, 2.5}, {0, 4, 1, 2.5, 4.4, 1.4}}, 2));
    file("gap.obj", boxes_text({{0, 0, 0, 4, 8, 2}, {4.3, 0, 0, 8, 8, 2}}));
    file("edge.obj", boxes_text({{0, 0, 0, 4, 4, 2}, {4, 4, 0, 8, 8, 2}}));
    file("rib.obj", boxes_text({{0, 0, 0, 10, 10, 2}, {12, 0, 0, 12.5, 10, 1}}));
    file("neck.obj", boxes_text({{0, 0, 0, 10, 10, 2}, {4.9, 4.9, 2, 5.1, 5.1, 5}, {0, 0, 5, 10, 10, 7}}));
    file("lost.toml",
         "[layers]\nthickness_mm = 0.5\n[bed]\ndpi = 20\n[[part]]\npath = \"part.stl\"\nat_mm = [1, 1]\n"
         "[[part]]\npath = \"pin.stl\"\nat_mm = [30.5, 1.28]\n");
    file("touching.toml",
         "[[part]]\npath = \"part.stl\"\nat_mm = [5, 5]\n[[part]]\npath = \"part.stl\"\nat_mm = [10, 10]\nbottom_mm = 1\n");
    file("dry.toml",
         "[layers]\nthickness_mm = 0.1\n[machine]\nprofile = \"nuferbj\"\n[dose]\nsaturation_percent = 70\ndithered = false\n"
         "[run]\nallow_unbound = true\n[[part]]\npath = \"part.stl\"\n[[part]]\npath = \"thin.stl\"\nsaturation_percent = 1\n");
    const std::string machine = "inherits = \"nuferbj\"\n[machine]\nname = \"odd\"\n";
    file("two.toml", machine + "[powder]\nmaterials = [\"steel\", \"bronze\"]\n");
    file("idle.toml", machine + "[maintenance]\nspit_mm = [-40, 5]\n");
    file("stitching.toml", machine + "[mounting]\njoint_shift_lines = 128\n");
    fs::create_directories(in_ / "noise");
    std::uint32_t state = 1;
    for (const char* name : {"noise/0.pbm", "noise/1.pbm"}) {
      std::string bits(std::size_t{400} * 50, '\0');
      for (char& byte : bits) byte = static_cast<char>((state = state * 1664525 + 1013904223) >> 24);
      write_text(in_ / name, "P4\n400 400\n" + bits);
    }
    file("noise.toml", "[[part]]\npath = \"noise\"\ndpi = 254\nlayer_mm = 0.1\nat_mm = [0, 0]\n");
  }

  static KindSet codes_of(const KindJson& warnings) {
    KindSet codes;
    for (const KindJson& warning : warnings) codes.insert(warning["code"].get<std::string>());
    return codes;
  }
  static std::string output_of(const WarningKind& kind) {
    return "out-" + kind.code + (kind.job.starts_with("extrude") ? ".gcode" : "");
  }
  KindSet predicted_lines(const WarningKind& kind) const {
    const Outcome outcome = run_lamina(words_of(kind.job + " --json --quiet -o " + output_of(kind)), in_.path());
    EXPECT_EQ(outcome.code, 0) << kind.job << "\n" << outcome.err;
    const KindJson json = KindJson::parse(outcome.out, nullptr, false);
    return json.is_object() ? codes_of(json["warnings"]) : KindSet();
  }
  KindSet on_page(const WarningKind& kind) const {
    const Outcome outcome = run_lamina(words_of("report " + output_of(kind) + " -o page.html --quiet --overwrite"), in_.path());
    EXPECT_EQ(outcome.code, 0) << kind.job << "\n" << outcome.err;
    const std::string text = read_text(in_ / "page.html"), begin = "<script id=\"head\" type=\"application/json\">";
    const std::size_t at = text.find(begin);
    if (at == std::string::npos) return {};
    const std::size_t json = at + begin.size();
    return codes_of(KindJson::parse(text.substr(json, text.find("</script>", json) - json))["warnings"]);
  }

  Directory in_;
};

TEST_F(WarningKinds, AreReportedByTheirJobsAndOnThePage) {
  for (const WarningKind& kind : kKinds) {
    SCOPED_TRACE(kind.code + ": lamina " + kind.job);
    const KindSet reported = predicted_lines(kind);
    EXPECT_TRUE(reported.contains(kind.code)) << ::testing::PrintToString(reported);
    if (kind.page == Page::kNone) continue;
    const KindSet page = on_page(kind);
    EXPECT_EQ(page.contains(kind.code), kind.page == Page::kHasIt) << ::testing::PrintToString(page);
  }
}

/// `low-space` depends on the disk: test_stored_jobs.cpp.
KindSet known_kinds() {
  KindSet codes{"inspection", "low-space"};
  for (const WarningKind& kind : kKinds) codes.insert(kind.code);
  return codes;
}

TEST_F(WarningKinds, AreThoseOfThePageAboutThem) {
  KindSet documented;
  std::ifstream page(fs::path(LAMINA_TEST_DIR).parent_path() / "docs/reference/warnings.md");
  const std::regex code("`([a-z]+(-[a-z]+)*)`");
  for (std::string line; std::getline(page, line);) {
    if (!line.starts_with("| `")) continue;
    const std::string first = line.substr(0, line.find('|', 1));
    for (std::sregex_iterator at(first.begin(), first.end(), code), end; at != end; ++at) documented.insert((*at)[1]);
  }
  EXPECT_EQ(documented, known_kinds());
}

TEST_F(WarningKinds, AreThoseOfTheSources) {
  KindSet made;
  const std::regex code(R"re((?:warnings_?|found)\.(?:push_back|emplace_back)\(\s*(?:Warning)?\{?\s*"([a-z]+(?:-[a-z]+)*)"|)re"
                        R"re((?:\bwarn|\bwarning)\(\s*"([a-z]+(?:-[a-z]+)*)")re");
  for (const char* folder : {"stages", "pipeline"}) {
    for (const auto& entry : fs::recursive_directory_iterator(fs::path(LAMINA_TEST_DIR).parent_path() / folder)) {
      if (entry.path().extension() != ".cpp") continue;
      const std::string text = read_text(entry.path());
      if (text.find("arning") == std::string::npos && text.find(".warn(") == std::string::npos) continue;
      for (std::sregex_iterator at(text.begin(), text.end(), code), end; at != end; ++at)
        made.insert((*at)[1].str() + (*at)[2].str());
    }
  }
  EXPECT_EQ(made, known_kinds());
}

}  // namespace
}  // namespace lamina::test
