// The page about a job: what it shows is what the files hold, in the bytes and in a browser.
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <zlib.h>

#include <array>
#include <cstdio>
#include <nlohmann/json.hpp>
#include <numbers>
#include <random>

#include "stages/formats/images/image.h"
#include "stages/support/text/escape.h"
#include "stages/view/report/run_code.h"
#include "tests/commands/program.h"
#include "tests/commands/unpack_runs.h"

namespace lamina::test {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::json;
using Words = std::vector<std::string>;

bool equal(const RunsView& a, const RunsView& b) {
  return a.columns == b.columns && std::ranges::equal(a.row_offset, b.row_offset) && std::ranges::equal(a.change, b.change);
}

Runs random_runs(std::mt19937& random, std::uint32_t columns, std::uint32_t rows) {
  Runs runs;
  runs.columns = columns;
  runs.row_offset.push_back(0);
  std::vector<std::uint32_t> row;
  for (std::uint32_t r = 0; r < rows; ++r) {
    const auto kind = random() % 4;
    if (kind == 0) {  // else like the row before, moved, or the same
      row.clear();
      for (std::uint32_t column = static_cast<std::uint32_t>(random() % columns); column < columns;
           column += 1 + static_cast<std::uint32_t>(random() % 50))
        row.push_back(column);
      if (row.size() % 2 != 0) row.push_back(columns);
    } else if (kind == 1 && !row.empty() && row.front() > 0) {
      for (std::uint32_t& column : row) --column;
    }
    runs.change.insert(runs.change.end(), row.begin(), row.end());
    runs.row_offset.push_back(static_cast<std::uint32_t>(runs.change.size()));
  }
  return runs;
}

TEST(RunCode, GivesTheRunsBackAndRefusesWhatIsNone) {
  std::mt19937 random(7);
  for (int i = 0; i < 60; ++i) {
    const auto columns = static_cast<std::uint32_t>(1 + random() % 3000), rows = static_cast<std::uint32_t>(1 + random() % 60);
    const Runs runs = random_runs(random, columns, rows);
    Buffer<std::byte> packed = view::report::pack_runs(runs);
    const Result<Runs> back = unpack_runs(packed, columns, rows);
    ASSERT_TRUE(back.ok());
    ASSERT_TRUE(equal(runs, *back));
    EXPECT_FALSE(unpack_runs(packed, columns, rows + 1).ok());
    EXPECT_FALSE(unpack_runs(std::span(packed).first(packed.size() - 1), columns, rows).ok());
    for (int k = 0; k < 20; ++k) {
      Buffer<std::byte> code(1 + random() % 40);  // any code, within a whole zlib stream
      for (std::byte& byte : code) byte = static_cast<std::byte>(random() % (k < 10 ? 256 : 5));
      const Result<Runs> any = unpack_runs(view::report::deflate_bytes(code), columns, rows);
      if (!any) continue;
      for (const std::uint32_t change : any->change) EXPECT_LE(change, columns);
    }
  }
  const Runs empty = {9, {0, 0, 0}, {}};
  EXPECT_TRUE(equal(empty, *unpack_runs(view::report::pack_runs(empty), 9, 2)));
}

TEST(RunCode, Base64IsThatOfRfc4648) {
  const auto text = [](std::string_view bytes) { return lamina::base64(std::as_bytes(std::span(bytes))); };
  EXPECT_EQ(text(""), "");
  EXPECT_EQ(text("f"), "Zg==");
  EXPECT_EQ(text("fo"), "Zm8=");
  EXPECT_EQ(text("foo"), "Zm9v");
  EXPECT_EQ(text("foobar"), "Zm9vYmFy");
}

class JobsReported : public ::testing::Test {
 protected:
  Outcome lamina(const Words& arguments) { return run_lamina(arguments, directory_.path()); }

  void jet(const std::string& part, Words more) {
    more.insert(more.begin(), {"jet", part, "--quiet", "-o", "out"});
    const Outcome outcome = lamina(more);
    ASSERT_EQ(outcome.code, 0) << outcome.err;
  }

  // The data of a piece of the page; nothing if it is not there.
  Buffer<std::byte> piece(const std::string& page, const std::string& id) {
    const std::string begin = "<script type=\"text/plain\" id=\"" + id + "\">";
    const std::size_t at = page.find(begin);
    Buffer<std::byte> bytes;
    if (at == std::string::npos) return bytes;
    std::uint32_t group = 0, have = 0;
    for (std::size_t i = at + begin.size(); page[i] != '<' && page[i] != '='; ++i) {
      const std::string_view digits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
      group = group << 6 | static_cast<std::uint32_t>(digits.find(page[i]));
      have += 6;
      if (have >= 8) bytes.push_back(static_cast<std::byte>(group >> (have -= 8) & 255));
    }
    return bytes;
  }

  Runs layer(int index) {
    char name[32];
    std::snprintf(name, sizeof name, "out/layers/%06d.tif", index);
    const auto image = formats::image(directory_ / name);
    EXPECT_TRUE(image.ok());
    return image->runs;
  }

  Directory directory_;
};

TEST_F(JobsReported, ToolpathsAreDrawnInTheirWidthsWithWhatTheirManifestSays) {
  const Outcome made =
      lamina({"extrude", corpus_file("parameter_quality_nut.stl"), "--layer", "0.3", "--walls", "1", "--fill", "none", "--quiet", "-o", "part.gcode"});
  ASSERT_EQ(made.code, 0) << made.err;
  ASSERT_EQ(lamina({"report", "part.gcode", "-o", "part.html"}).code, 0);
  const std::string page = read_text(directory_ / "part.html");
  const std::string begin = "<script id=\"head\" type=\"application/json\">";
  const std::size_t at = page.find(begin) + begin.size();
  const Json head = Json::parse(page.substr(at, page.find("</script>", at) - at));
  EXPECT_EQ(head["manifest"]["name"], "part.gcode.json");
  EXPECT_EQ(head["images"], false);
  const std::size_t layers = head["layers"]["volume"].size();
  EXPECT_EQ(layers, head["layer_count"]);
  const double pixel_mm2 = head["pixel_mm"][0].get<double>() * head["pixel_mm"][1].get<double>();
  // Beads 0.4 mm wide and 0.3 mm high have round sides; their projection along z covers their width.
  const double section = 0.4 * 0.3, rounded = section - (1 - std::numbers::pi / 4) * 0.3 * 0.3;
  double all_covered = 0, all_deposited = 0;
  for (std::size_t i = 0; i < layers; ++i) {
    const double covered =
        head["layers"]["set"][i].get<double>() * pixel_mm2 * head["layers"]["thickness"][i].get<double>() * 1e-6;
    const double volume = head["layers"]["volume"][i];
    all_covered += covered;
    all_deposited += volume;
    if (volume == 0) {
      EXPECT_EQ(covered, 0) << i;  // nothing fits into the highest layer
      continue;
    }
    EXPECT_NEAR(covered / volume, section / rounded, 0.08) << i;  // ends of beads are round, too
    EXPECT_GT(head["layers"]["seconds"][i], 0) << i;
  }
  EXPECT_NEAR(all_covered / all_deposited, section / rounded, 0.03);
  const auto drawn = unpack_runs(piece(page, "r3"), head["columns"], head["rows"]);
  ASSERT_TRUE(drawn.ok());
  EXPECT_GT(drawn->change.size(), 100u);

  write_text(directory_ / "part.gcode", read_text(directory_ / "part.gcode") + "G4 P1\n");
  const Outcome changed = lamina({"report", "part.gcode", "-o", "part.html"});
  EXPECT_EQ(changed.code, 5);
  EXPECT_NE(changed.err.find("part.gcode: is not the file of its manifest"), std::string::npos) << changed.err;
}

TEST_F(JobsReported, EveryLayerOfThePageIsItsFile) {
  jet(corpus_file("nist_am_test_artifact_v3b.stl"), {"--bed", "200x160", "--dpi", "300x200", "--layer", "0.5"});
  const Outcome outcome = lamina({"report", "out", "-o", "report.html"});
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  const std::string page = read_text(directory_ / "report.html");
  for (int i = 0; i < 34; ++i) {
    const Runs runs = layer(i);
    const auto back = unpack_runs(piece(page, "r" + std::to_string(i)), runs.columns, runs.view().rows());
    ASSERT_TRUE(back.ok()) << i;
    EXPECT_TRUE(equal(runs, *back)) << i;
  }
  EXPECT_EQ(page.find("http://"), std::string::npos);
  EXPECT_EQ(page.find("https://"), std::string::npos);
  EXPECT_EQ(page.find("{{"), std::string::npos);
  ASSERT_EQ(lamina({"report", "out", "-o", "again.html", "--quiet"}).code, 0);
  EXPECT_EQ(page, read_text(directory_ / "again.html"));

  ASSERT_EQ(lamina({"report", "out", "-o", "small.html", "--max-bytes", "165K"}).code, 0);
  const std::string small = read_text(directory_ / "small.html");
  EXPECT_LT(small.size(), 165u << 10);
  EXPECT_NE(small, page);
  EXPECT_FALSE(piece(small, "r0").empty());
  EXPECT_TRUE(piece(small, "r1").empty());
}

TEST_F(JobsReported, WhatIsNoFinishedJobIsRefusedInOneLine) {
  write_box(directory_ / "part.stl", {0, 0, 0}, {5, 5, 2});
  jet("part.stl", {"--bed", "20x20", "--dpi", "100"});
  const auto refused = [&](const std::string& directory, const std::string& said, int code) {
    const Outcome outcome = lamina({"report", directory, "-o", "report.html"});
    EXPECT_EQ(outcome.code, code) << outcome.err;
    EXPECT_EQ(outcome.error_lines(), 1u) << outcome.err;
    EXPECT_NE(outcome.err.find(said), std::string::npos) << outcome.err;
    EXPECT_FALSE(fs::exists(directory_ / "report.html"));
  };
  refused("nowhere", "no manifest.json", 5);
  fs::rename(directory_ / "out/manifest.json", directory_ / "out/manifest.json.part");
  refused("out", "not finished", 5);
  fs::rename(directory_ / "out/manifest.json.part", directory_ / "out/manifest.json");
  const std::string good = read_text(directory_ / "out/layers/000007.tif");
  write_text(directory_ / "out/layers/000007.tif", read_text(directory_ / "out/layers/000007.tif") + "x");
  refused("out", "000007.tif: is not the file of the manifest", 5);
  fs::remove(directory_ / "out/layers/000007.tif");
  refused("out", "000007.tif", 5);
  write_text(directory_ / "out/layers/000007.tif", good);
  ASSERT_EQ(lamina({"jet", "part.stl", "--bed", "20x20", "--format", "null", "--quiet", "-o", "none"}).code, 0);
  refused("none", "wrote no images", 5);
  ASSERT_EQ(lamina({"jet", "part.stl", "--machine", "nuferbj", "--layer", "1", "--quiet", "-o", "printed"}).code, 0);
  for (const char* frame : {"printed/program/start.gcode", "printed/program/end.gcode"}) {
    const std::string was = read_text(directory_ / frame);
    write_text(directory_ / frame, was + "G1 X0\n");
    refused("printed", std::string(frame) + ": its content is not what was written", 5);
    fs::remove(directory_ / frame);
    refused("printed", std::string(frame) + ": is missing", 5);
    write_text(directory_ / frame, was);
  }
  ASSERT_EQ(lamina({"slice", "part.stl", "--quiet", "-o", "sliced"}).code, 0);
  refused("sliced", "reports are of images and toolpaths", 5);
  EXPECT_EQ(lamina({"report", "out", "-o", "nowhere/report.html"}).code, 4);
  EXPECT_EQ(lamina({"report", "out"}).code, 2);
  EXPECT_EQ(lamina({"report", "-o", "x.html"}).code, 2);
}

TEST_F(JobsReported, APageHasTheNameOfOneAndReplacesNoFileOfTheJob) {
  write_box(directory_ / "part.stl", {0, 0, 0}, {5, 5, 2});
  jet("part.stl", {"--bed", "20x20", "--dpi", "100"});
  const std::string before = tree_text(directory_ / "out"), part = read_text(directory_ / "part.stl");
  const std::pair<const char*, const char*> refusals[] = {{"out/manifest.json", "which this call reads"},
                                                          {"out/layers/000000.tif", "which this call reads"},
                                                          {"part.stl", "no such file of lamina"},
                                                          {"page", "ends in .html"},
                                                          {".html", "ends in .html"},
                                                          {"html", "ends in .html"},
                                                          {"page.html/..", "ends in .html"}};
  for (const auto& [name, said] : refusals) {
    const Outcome outcome = lamina({"report", "out", "-o", name});
    EXPECT_EQ(outcome.code, 2) << name;
    EXPECT_EQ(outcome.error_lines(), 1u) << outcome.err;
    EXPECT_NE(outcome.err.find(said), std::string::npos) << outcome.err;
  }
  EXPECT_EQ(tree_text(directory_ / "out"), before);
  EXPECT_EQ(read_text(directory_ / "part.stl"), part);
  for (const char* name : {"page.htm", "PAGE.HTML"}) EXPECT_EQ(lamina({"report", "out", "-o", name}).code, 0) << name;
}

// The bytes of a piece of the page.
std::vector<std::uint8_t> inflated(const Buffer<std::byte>& packed, std::size_t size) {
  std::vector<std::uint8_t> bytes(size + 1);
  uLongf have = bytes.size();
  EXPECT_EQ(uncompress(bytes.data(), &have, reinterpret_cast<const Bytef*>(packed.data()), packed.size()), Z_OK);
  bytes.resize(have);
  return bytes;
}

Json head_of(const std::string& page) {
  const std::string begin = "<script id=\"head\" type=\"application/json\">";
  const std::size_t at = page.find(begin) + begin.size();
  return Json::parse(page.substr(at, page.find("</script>", at) - at));
}

TEST_F(JobsReported, ThreeSidesAreThePartsThemselvesIfTheyAreStillThose) {
  fs::create_directories(directory_ / "parts");
  write_box(directory_ / "parts/part.stl", {0, 0, 0}, {8, 4, 2});
  jet("parts/part.stl", {"--bed", "20x20", "--dpi", "100"});
  ASSERT_EQ(lamina({"report", "out", "-o", "report.html", "--parts", "parts", "--quiet"}).code, 0);
  const std::string page = read_text(directory_ / "report.html");
  const Json views = head_of(page)["views"];
  const std::array<std::array<double, 2>, 3> sizes = {{{8, 4}, {8, 2}, {4, 2}}};
  std::size_t i = 0;
  std::vector<std::uint8_t> lights;
  for (const char* name : {"top", "front", "side"}) {
    const Json& view = views[name];
    EXPECT_NEAR(view[3], sizes[i][0], 1e-5);
    EXPECT_NEAR(view[4], sizes[i][1], 1e-5);
    EXPECT_EQ(view[2], 0);
    const std::size_t pixels = view[0].get<std::size_t>() * view[1].get<std::size_t>();
    const std::vector<std::uint8_t> bytes = inflated(piece(page, std::string("v-") + name), 2 * pixels);
    ASSERT_EQ(bytes.size(), 2 * pixels) << name;
    for (std::size_t p = 0; p < pixels; ++p) {  // a box fills its views, and each side is lit evenly
      ASSERT_EQ(bytes[2 * p + 1], 255) << name << p;
      ASSERT_EQ(bytes[2 * p], bytes[0]) << name << p;
    }
    EXPECT_GT(bytes[0], 128);
    ++i;
  }
  // Not found, or no longer what was planned: the layers from three sides, or an error if the part was requested.
  ASSERT_EQ(lamina({"report", "out", "-o", "layers.html"}).code, 0);
  EXPECT_GT(head_of(read_text(directory_ / "layers.html"))["views"]["top"][2], 0);
  write_box(directory_ / "parts/part.stl", {0, 0, 0}, {8, 4.5, 2});
  const Outcome changed = lamina({"report", "out", "-o", "changed.html", "--parts", "parts"});
  EXPECT_EQ(changed.code, 3);
  EXPECT_EQ(changed.error_lines(), 1u) << changed.err;
  EXPECT_NE(changed.err.find("is not the part that was planned"), std::string::npos) << changed.err;
  EXPECT_EQ(lamina({"report", "out", "-o", "changed.html", "--parts", "nowhere"}).code, 3);
}

TEST_F(JobsReported, TimesOfLayersAddUpToThatOfTheReplayedProgram) {
  write_box(directory_ / "part.stl", {0, 0, 0}, {20, 20, 1});
  jet("part.stl", {"--machine", "nuferbj", "--layer", "0.1"});
  ASSERT_EQ(lamina({"report", "out", "-o", "report.html", "--quiet"}).code, 0);
  const Json seconds = head_of(read_text(directory_ / "report.html"))["layers"]["seconds"];
  const Outcome verified = lamina({"verify", "out", "--json", "--quiet"});
  double sum = 0;
  for (const Json& layer : seconds) sum += layer.get<double>();
  EXPECT_EQ(seconds.size(), 10u);
  EXPECT_NEAR(sum, Json::parse(verified.out)["replay"]["seconds"].get<double>(), 1e-9 * sum);
  const std::vector<std::string> words = {"jet", "part.stl", "--machine", "nuferbj", "--layer", "0.1", "--dry-run"};
  const auto reported = [&](const std::vector<std::string>& more) {
    std::vector<std::string> call = words;
    call.insert(call.end(), more.begin(), more.end());
    return lamina(call);
  };
  EXPECT_NEAR(sum, Json::parse(reported({"--json", "--quiet"}).out)["print_seconds"].get<double>(), 1e-9 * sum);
  const std::string text = fmt::format("({:.1f} s) on nuferbj", sum);
  for (const Outcome& outcome : {reported({}), lamina({"verify", "out"})}) {
    EXPECT_NE((outcome.out + outcome.err).find(text), std::string::npos) << outcome.out << outcome.err;
  }
  EXPECT_GT(sum, 1);
  const std::string program = read_text(directory_ / "out/program/000004.gcode");
  write_text(directory_ / "out/program/000004.gcode", program + "\n");
  const Outcome changed = lamina({"report", "out", "-o", "report.html"});
  EXPECT_EQ(changed.code, 5);
  EXPECT_NE(changed.err.find("program/000004.gcode"), std::string::npos) << changed.err;
}

TEST_F(JobsReported, NamesOfPartsCannotBecomeMarkup) {
  write_box(directory_ / "<img src=x onerror=alert(1)> & <script>.stl", {0, 0, 0}, {5, 5, 1});
  jet("<img src=x onerror=alert(1)> & <script>.stl", {"--bed", "20x20", "--dpi", "100"});
  ASSERT_EQ(lamina({"report", "out", "-o", "report.html", "--quiet"}).code, 0);
  const std::string page = read_text(directory_ / "report.html");
  EXPECT_EQ(page.find("<img"), std::string::npos);
  EXPECT_NE(page.find("&lt;img src=x onerror=alert(1)> &amp; &lt;script>.stl"), std::string::npos);
}

// A page about 1,000 layers of 22 million pixels is used in Chromium: keys, buttons, mouse, a phone's width; its layer 500 is
// the decoded TIFF.
TEST_F(JobsReported, InABrowserItShowsTheLayersAndCanBeUsed) {
  jet(corpus_file("nist_part_feature_open.stl"),
      {"--unit", "inch", "--bed", "160x64", "--dpi", "1200", "--layer", "0.0349", "--layers", "0:1000"});
  ASSERT_EQ(lamina({"report", "out", "-o", "report.html", "--quiet"}).code, 0);
  EXPECT_LT(fs::file_size(directory_ / "report.html"), 20'000'000u);
  const int index = 500, layers = 1000;
  const auto [status, text] = in_browser(directory_ / "report.html", index);
  if (status == kNoBrowser) GTEST_SKIP() << "NOT RUN: the report in a browser; install Debian's chromium";
  ASSERT_EQ(status, 0);
  const Json said = Json::parse(text);

  const Runs runs = layer(index);
  EXPECT_GE(std::uint64_t{runs.columns} * runs.view().rows(), 22'000'000u);
  EXPECT_FALSE(runs.change.empty());
  EXPECT_EQ(said["runs"][0], Json(std::vector<std::uint32_t>(runs.row_offset.begin(), runs.row_offset.end())));
  EXPECT_EQ(said["runs"][1], Json(std::vector<std::uint32_t>(runs.change.begin(), runs.change.end())));
  EXPECT_EQ(said["console"], Json::array());
  EXPECT_EQ(said["requests"], Json::array());
  EXPECT_GT(said["ink"], 1);
  const Json& step = said["steps"];
  EXPECT_EQ(step["start"]["layer"], index);
  EXPECT_EQ(step["page_up"]["layer"], index + 1);
  EXPECT_EQ(step["page_down"]["layer"], index);
  EXPECT_EQ(step["home"]["layer"], 0);
  EXPECT_EQ(step["end"]["layer"], layers - 1);
  EXPECT_EQ(step["next_at_end"]["layer"], layers - 1);
  EXPECT_EQ(step["previous"]["layer"], layers - 2);
  EXPECT_GT(step["closer"]["scale"], step["start"]["scale"]);
  EXPECT_EQ(step["pixels"]["scale"], 1);
  EXPECT_EQ(step["fit"]["scale"], step["start"]["scale"]);
  EXPECT_GT(step["arrow_right"]["x"], step["focus"]["x"]);
  EXPECT_GT(step["plus"]["scale"], step["arrow_right"]["scale"]);
  EXPECT_EQ(step["zero"], step["fit"]);
  EXPECT_LT(step["drag"]["x"], step["zero"]["x"]);
  EXPECT_GT(step["wheel"]["scale"], step["drag"]["scale"]);
  EXPECT_NEAR(step["plot"]["layer"].get<int>(), layers / 2, 3);
  EXPECT_EQ(said["file_rows"], layers + 1);
  for (const Json& scaled : said["scaled"]) EXPECT_NEAR(scaled.get<double>(), 1, 0.02) << said["scaled"];
  for (const char* label : {"the parts from above", "the parts from the front", "the parts from the right",
                            "area against height", "thickness against height"}) {
    EXPECT_NE(std::ranges::find(said["labels"], Json(label)), said["labels"].end()) << label;
  }
  EXPECT_NE(said["grounds"][0], said["grounds"][1]);
  EXPECT_LE(said["phone"][0], said["phone"][1]);
  EXPECT_NE(said["text"].get<std::string>().find("nist_part_feature_open.stl"), std::string::npos);
}

}  // namespace
}  // namespace lamina::test
