// The whole program: parts in, G-code out, read back by a reader of its own.
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <numbers>
#include <span>

#include "tests/commands/program.h"
#include "tests/segment/gcode_reader.h"

namespace lamina {
namespace {

namespace fs = std::filesystem;

struct Outcome {
  int code = -1;
  std::string out, err;
  nlohmann::json json() const { return nlohmann::json::parse(out, nullptr, false); }
};

class ExtrudeProgram : public testing::Test {
 protected:
  void SetUp() override {
    folder = fs::temp_directory_path() / ("lamina_extrude_" + std::to_string(::getpid()) + "_" +
                                          testing::UnitTest::GetInstance()->current_test_info()->name());
    fs::create_directories(folder);
  }
  void TearDown() override { fs::remove_all(folder); }

  Outcome run(const std::string& arguments) const {
    const std::string command = std::string(LAMINA_PROGRAM) + " " + arguments + " 2>" + (folder / "err").string();
    Outcome result;
    FILE* pipe = popen(command.c_str(), "r");
    char buffer[4096];
    for (std::size_t n; (n = fread(buffer, 1, sizeof buffer, pipe)) > 0;) result.out.append(buffer, n);
    result.code = WEXITSTATUS(pclose(pipe));
    result.err = text_of(folder / "err");
    return result;
  }
  static std::string text_of(const fs::path& path) {
    std::ifstream file(path, std::ios::binary);
    return {std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
  }

  /// A block, with a hole through its middle if the radius is above 0.
  std::string block(double x, double y, double z, double radius) const {
    std::vector<std::array<double, 2>> outer, inner;
    std::vector<double> angles;
    for (int i = 0; i < 360; ++i) angles.push_back((i + 0.5) * std::numbers::pi / 180);
    for (const double sx : {-1.0, 1.0}) {
      for (const double sy : {-1.0, 1.0})
        angles.push_back(std::fmod(std::atan2(sy * y, sx * x) + 2 * std::numbers::pi, 2 * std::numbers::pi));
    }
    std::sort(angles.begin(), angles.end());
    for (const double a : angles) {
      const double c = std::cos(a), s = std::sin(a);
      const double reach =
          std::min(std::abs(c) > 1e-12 ? x / 2 / std::abs(c) : 1e9, std::abs(s) > 1e-12 ? y / 2 / std::abs(s) : 1e9);
      outer.push_back({reach * c, reach * s});
      inner.push_back({radius * c, radius * s});
    }
    const fs::path path = folder / "block.stl";
    std::ofstream file(path);
    file.precision(12);
    file << "solid block\n";
    const auto facet = [&](std::initializer_list<std::array<double, 3>> corners) {
      file << "facet normal 0 0 0\nouter loop\n";
      for (const auto& p : corners) file << "vertex " << p[0] << ' ' << p[1] << ' ' << p[2] << '\n';
      file << "endloop\nendfacet\n";
    };
    for (std::size_t i = 0; i < angles.size(); ++i) {
      const std::size_t j = (i + 1) % angles.size();
      const auto at = [&](const std::array<double, 2>& p, double height) { return std::array<double, 3>{p[0], p[1], height}; };
      facet({at(outer[i], 0), at(outer[j], 0), at(outer[j], z)});
      facet({at(outer[i], 0), at(outer[j], z), at(outer[i], z)});
      facet({at(outer[i], z), at(outer[j], z), at(inner[j], z)});
      facet({at(outer[i], 0), at(inner[j], 0), at(outer[j], 0)});
      if (radius <= 0) continue;
      facet({at(outer[i], z), at(inner[j], z), at(inner[i], z)});
      facet({at(outer[i], 0), at(inner[i], 0), at(inner[j], 0)});
      facet({at(inner[i], 0), at(inner[j], z), at(inner[j], 0)});
      facet({at(inner[i], 0), at(inner[i], z), at(inner[j], z)});
    }
    file << "endsolid block\n";
    return path.string();
  }
  /// A block whose sides are cut into 60,000 bands by height, 480,004 facets in all: a large mesh whose layers are four lines.
  std::string stepped_block(double x, double y, double z) const {
    constexpr int kBands = 60000;
    std::string bytes(80, '\0');
    const std::uint32_t facets = 8 * kBands + 4;
    bytes.append(reinterpret_cast<const char*>(&facets), 4);
    const auto corner = [&](int i, int band) {
      return std::array<float, 3>{static_cast<float>(i == 1 || i == 2 ? x : 0), static_cast<float>(i >= 2 ? y : 0),
                                  static_cast<float>(z * band / kBands)};
    };
    const auto facet = [&](const std::array<float, 3>& a, const std::array<float, 3>& b, const std::array<float, 3>& c) {
      bytes.append(12, '\0');
      for (const auto* p : {&a, &b, &c}) bytes.append(reinterpret_cast<const char*>(p->data()), 12);
      bytes.append(2, '\0');
    };
    for (int band = 0; band < kBands; ++band) {
      for (int i = 0; i < 4; ++i) {
        const int j = (i + 1) % 4;
        facet(corner(i, band), corner(j, band), corner(j, band + 1));
        facet(corner(i, band), corner(j, band + 1), corner(i, band + 1));
      }
    }
    for (const int i : {1, 2}) {
      facet(corner(0, 0), corner(i + 1, 0), corner(i, 0));
      facet(corner(0, kBands), corner(i, kBands), corner(i + 1, kBands));
    }
    const fs::path path = folder / "stepped.stl";
    std::ofstream(path, std::ios::binary) << bytes;
    return path.string();
  }
  std::string file(const std::string& name) const { return (folder / name).string(); }

  fs::path folder;
};

TEST_F(ExtrudeProgram, PointsOfFukudaAre346InEachOf79Layers) {
  const std::string part = block(74, 100, 20, 12.5);
  const Outcome result =
      run("extrude --overwrite " + part +
          " --machine marlin --layer 0.254 --walls 0 --fill segmented --segment-rule fukuda --thin 5 --thick 3 "
          "--bead 0.508 --bead-gap 2.4 --angle 0 --angle-step 0 --set fill.first_line_mm=0.508 --set fill.end_inset_mm=0.254 "
          "--quiet --json -o " +
          file("a.gcode"));
  ASSERT_EQ(result.code, 0) << result.err;
  const auto json = result.json();
  EXPECT_EQ(json["layers_planned"], 79);
  EXPECT_EQ(json["segments"]["points_first_layer"], 346);
  EXPECT_EQ(json["segments"]["points"], 27334);
  EXPECT_EQ(json["segments"]["intervals"], 79 * 324);
}

TEST_F(ExtrudeProgram, PeakMemoryThatIsReportedIsThatOfTheProgramNotOfItsCaller) {
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
  GTEST_SKIP() << "a sanitizer's shadow is counted too";
#endif
  const std::vector<char> held(200'000'000, 'x');  // the caller's
  const Outcome result =
      run("extrude --overwrite " + block(10, 10, 1, 0) + " --machine marlin --quiet --json -o " + file("a.gcode"));
  ASSERT_EQ(result.code, 0) << result.err;
  EXPECT_LT(result.json()["peak_resident_bytes"], held.size() / 2);
  EXPECT_GT(result.json()["peak_resident_bytes"], 1'000'000);
}

TEST_F(ExtrudeProgram, MemoryOfASegmentedJobIsThatOfThePlainOne) {
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
  GTEST_SKIP() << "a sanitizer keeps freed memory: peaks were NOT compared";
#endif
  // The system's count of a process's pages errs by some hundred kilobytes, as much as 2 % of a program that holds ten
  // megabytes: the parts have sides of many facets, so that jobs hold three times that. The middle of each, of runs in turn.
  const auto share = [&](const std::string& job, const std::string& segments, double min_text) {
    std::vector<double> plain, segmented;
    for (int turn = 0; turn < 5; ++turn) {
      for (auto* peaks : {&plain, &segmented}) {
        const Outcome result =
            run("extrude --overwrite " + job + (peaks == &plain ? " --fill raster" : " --fill segmented " + segments) +
                " --threads 1 --quiet --json -o " + file(peaks == &plain ? "plain.gcode" : "segmented.gcode"));
        EXPECT_EQ(result.code, 0) << result.err;
        peaks->push_back(result.json()["peak_resident_bytes"].get<double>());
      }
    }
    EXPECT_GE(static_cast<double>(fs::file_size(file("segmented.gcode"))),
              min_text * static_cast<double>(fs::file_size(file("plain.gcode"))));
    for (auto* peaks : {&plain, &segmented}) std::nth_element(peaks->begin(), peaks->begin() + 2, peaks->end());
    EXPECT_GE(plain[2], 24e6);
    return segmented[2] / plain[2];
  };
  const std::string fukuda = stepped_block(74, 100, 20) +
                             " --machine marlin --layer 0.254 --walls 0 --bead 0.508 --bead-gap 2.4 --angle 0 --angle-step 0 "
                             "--set fill.first_line_mm=0.508 --set fill.end_inset_mm=0.254";
  EXPECT_LE(share(fukuda, "--segment-rule fukuda --thin 5 --thick 3", 2), 1.02);
  // Two megabytes of text a layer: it does not wait until the layers before it are written.
  const std::string wide = stepped_block(180, 180, 0.8) + " --machine marlin --layer 0.2 --bead 0.4";
  EXPECT_LE(share(wide, "--thin 0.5 --thick 0.5", 40), 1.02);
}

TEST_F(ExtrudeProgram, TestPiecesOfDiNisioHaveTwelveAndNineSegmentedLines) {
  for (const auto& [width, lines] : {std::pair{62, 12}, {48, 9}}) {
    const Outcome result =
        run("extrude --overwrite " + block(width, 50, 0.3, 0) +
            " --machine anet-a8 --layer 0.3 --walls 1 --fill segmented --segment-rule thick-ends "
            "--thin 30 --thick 10 --thick-speed 100 --bead-gap 2 --angle 90 --angle-step 0 --quiet --json -o " +
            file("a.gcode"));
    ASSERT_EQ(result.code, 0) << result.err;
    const auto json = result.json();
    EXPECT_EQ(json["layers_planned"], 1);
    EXPECT_EQ(json["segments"]["lines"], lines);
    EXPECT_EQ(json["segments"]["thin"], lines);
    EXPECT_EQ(json["segments"]["intervals"], 3 * lines);
    EXPECT_NE(json["warnings"].dump().find("at most 4.45 mm"), std::string::npos);
    // Thick, thin, thick at 15 and 30 mm/s, all in one direction.
    const test::GcodeFile gcode = test::read_gcode(text_of(file("a.gcode")));
    ASSERT_EQ(gcode.error, "");
    int fast = 0;
    for (const auto& bead : gcode.layers[0].beads) {
      if (bead.feed != 1800) continue;
      ++fast;
      EXPECT_NEAR(std::abs(bead.y1 - bead.y0), 30, 0.0011);
      EXPECT_GT(bead.y1, bead.y0);
    }
    EXPECT_EQ(fast, lines);
  }
}

TEST_F(ExtrudeProgram, VolumesPositionsAndLayersOfAFileAreThoseOfThePlan) {
  const std::string part = block(30, 20, 2.4, 6);
  for (const std::string machine : {"anet-a8", "marlin", "klipper", "reprapfirmware"}) {
    const Outcome result = run("extrude --overwrite " + part + " --machine " + machine +
                               " --layer 0.3 --walls 2 --fill segmented --quiet --json -o " + file("a.gcode"));
    ASSERT_EQ(result.code, 0) << result.err;
    const auto json = result.json();
    const test::GcodeFile gcode = test::read_gcode(text_of(file("a.gcode")));
    ASSERT_EQ(gcode.error, "") << machine;
    ASSERT_EQ(gcode.layers.size(), 8);
    double filament = 0, last_z = 0;
    std::size_t beads = 0;
    for (const auto& layer : gcode.layers) {
      EXPECT_NEAR(layer.z - last_z, 0.3, 1e-9);
      last_z = layer.z;
      for (const auto& bead : layer.beads) {
        EXPECT_NEAR(bead.z, layer.z, 1e-9);
        filament += bead.filament;
        // Within the part, and not in its hole: centres keep half a bead from the surface.
        for (const auto& [x, y] : {std::pair{bead.x0 - 110, bead.y0 - 110}, {bead.x1 - 110, bead.y1 - 110}}) {
          EXPECT_LE(std::abs(x), 14.8011);
          EXPECT_LE(std::abs(y), 9.8011);
          EXPECT_GE(std::hypot(x, y), 6.19);
        }
      }
      beads += layer.beads.size();
    }
    EXPECT_EQ(json["moves"], beads);
    EXPECT_GE(gcode.lo_x, 0);
    EXPECT_LE(gcode.hi_x, 220);
    const double volume = filament * std::numbers::pi / 4 * 1.75 * 1.75;
    EXPECT_NEAR(volume / json["volume_mm3"].get<double>(), 1, 1e-5);
    EXPECT_GT(json["print_seconds"].get<double>(), 0);
  }
}

TEST_F(ExtrudeProgram, ADryRunReportsTheTimeAndTheMaterialOfTheRunAndWritesNothing) {
  const std::string call = "extrude " + block(12, 9, 1.2, 2) + " --machine marlin --layer 0.3 --quiet --json";
  const auto dry = run(call + " --dry-run"), real = run(call + " -o " + file("a.gcode"));
  ASSERT_EQ(dry.code, 0) << dry.err;
  ASSERT_EQ(real.code, 0) << real.err;
  for (const char* key : {"print_seconds", "filament_mm", "moves", "travel_mm", "volume_mm3"}) {
    EXPECT_EQ(dry.json()[key], real.json()[key]) << key;
  }
  EXPECT_GT(dry.json()["print_seconds"].get<double>(), 10);
  EXPECT_EQ(dry.json()["bytes_written"], 0);
  EXPECT_EQ(run(call + " --dry-run -o " + file("b.gcode")).code, 0);
  EXPECT_FALSE(fs::exists(file("b.gcode")));
}

// The travel from the last bead of a layer to the first of the next one, which the writer of a layer does not know.
TEST_F(ExtrudeProgram, TravelsBetweenLayersAreInTheSumsAndInTheManifest) {
  const auto result = run("extrude " + block(12, 9, 1.2, 2) + " --machine marlin --layer 0.3 --quiet --json -o " + file("a.gcode"));
  ASSERT_EQ(result.code, 0) << result.err;
  double x = 0, y = 0, mm = 0;
  bool placed = false;
  std::istringstream lines(text_of(file("a.gcode")));
  for (std::string line; std::getline(lines, line);) {
    double to_x = 0, to_y = 0;
    const bool travels = line.starts_with("G0 ");
    if (std::sscanf(line.c_str(), "G%*1d X%lf Y%lf", &to_x, &to_y) != 2) continue;
    if (travels && placed) mm += std::hypot(to_x - x, to_y - y);
    placed = true;
    x = to_x;
    y = to_y;
  }
  EXPECT_NEAR(result.json()["travel_mm"].get<double>(), mm, 0.05);
  const std::string manifest = text_of(file("a.gcode.json"));
  const std::size_t last = manifest.rfind("\"last_x_nm\": ");
  ASSERT_NE(last, std::string::npos);
  EXPECT_NEAR(std::stod(manifest.substr(last + 13)) * 1e-6, x, 0.001);
}

TEST_F(ExtrudeProgram, ADryRunCountsThePoresOfTheRunAndReportsThemOnce) {
  const std::string call = "extrude " + block(12, 9, 1.2, 2) + " --machine anet-a8 --layer 0.3 --fill segmented";
  const auto reported_pores = [&](const Outcome& outcome) {
    std::vector<std::string> reported;
    for (std::size_t at = outcome.err.find("pores "); at != std::string::npos; at = outcome.err.find("pores ", at + 1)) {
      if (at == 0 || outcome.err[at - 1] == '\n') reported.push_back(outcome.err.substr(at, outcome.err.find('\n', at) - at));
    }
    return reported;
  };
  const auto dry = reported_pores(run(call + " --dry-run"));
  EXPECT_EQ(dry.size(), 1u);
  EXPECT_EQ(dry, reported_pores(run(call + " -o " + file("a.gcode"))));
}

TEST_F(ExtrudeProgram, PoresAreCountedByRangeAlsoWherePartsAreAtDifferentHeights) {
  const std::string part = "[[part]]\npath = \"" + block(20, 20, 6, 0) + "\"\nbottom_mm = ";
  const auto pores = [&](const std::string& parts) {
    std::ofstream(file("job.toml")) << "[layers]\nthickness_mm = 0.3\n[machine]\nprofile = \"anet-a8\"\n[fill]\nangle_deg = 0\n"
                                       "[segment]\non = true\n[[segment.range]]\nfrom_mm = 0\nto_mm = 3\nthin_mm = 3\n"
                                    << parts;
    return run("extrude --dry-run --quiet --json --job " + file("job.toml")).json()["pores"];
  };
  const auto alone = pores(part + "0\n");
  ASSERT_EQ(alone.size(), 2u);
  EXPECT_EQ(pores(part + "0\n" + part + "0\n").size(), 2u);
  const auto staggered = pores(part + "0\n" + part + "3\n");
  ASSERT_EQ(staggered.size(), 2u);
  for (std::size_t i = 0; i < 2; ++i) {
    EXPECT_EQ(staggered[i]["heights"], alone[i]["heights"]);
    EXPECT_GT(alone[i]["closed"], 0);
    EXPECT_EQ(staggered[i]["closed"], 2 * alone[i]["closed"].get<int>()) << i;
    EXPECT_NEAR(staggered[i]["closed_per_mm2"].get<double>(), alone[i]["closed_per_mm2"].get<double>(), 1e-9) << i;
  }
}

TEST_F(ExtrudeProgram, ClosedCurvesAreSegmentedFromTheOutsideInWithThickSeams) {
  const std::string part = block(30, 20, 1.2, 4);
  const Outcome result = run("extrude --overwrite " + part +
                             " --machine anet-a8 --layer 0.3 --walls 1 --fill segmented --pattern contour --continuous 2 "
                             "--quiet --json -o " +
                             file("a.gcode"));
  ASSERT_EQ(result.code, 0) << result.err;
  const auto json = result.json();
  const test::GcodeFile gcode = test::read_gcode(text_of(file("a.gcode")));
  ASSERT_EQ(gcode.error, "");
  ASSERT_EQ(gcode.layers.size(), 4);
  double filament = 0;
  std::uint64_t thin_intervals = 0, segmented = 0;
  for (const auto& layer : gcode.layers) {
    for (const auto& bead : layer.beads) filament += bead.filament;
    const bool first = &layer == &gcode.layers.front();  // all as fast as the first layer may be, or slower
    for (std::size_t i = 0; i < layer.beads.size();) {
      std::size_t end = i + 1;
      const auto& start = layer.beads[i];
      while (end < layer.beads.size() && layer.beads[end].x0 == layer.beads[end - 1].x1 &&
             layer.beads[end].y0 == layer.beads[end - 1].y1 && layer.beads[end].type == start.type)
        ++end;
      const auto beads = std::span(layer.beads).subspan(i, end - i);
      i = end;
      if (start.type.find("perimeter") != std::string::npos || start.type.find("wall") != std::string::npos) continue;
      EXPECT_NEAR(beads.back().x1, start.x0, 1e-9);
      EXPECT_NEAR(beads.back().y1, start.y0, 1e-9);
      std::vector<std::pair<double, double>> intervals;  // speed, length
      double depth = 1e9;
      for (const auto& bead : beads) {
        if (intervals.empty() || intervals.back().first != bead.feed) intervals.push_back({bead.feed, 0});
        intervals.back().second += std::hypot(bead.x1 - bead.x0, bead.y1 - bead.y0);
        depth = std::min(
            {depth, 15 - std::abs(bead.x0 - 110), 10 - std::abs(bead.y0 - 110), std::hypot(bead.x0 - 110, bead.y0 - 110) - 4});
      }
      if (intervals.size() == 1) continue;
      ++segmented;
      const double thick = intervals.front().first, fast = intervals[1].first;
      EXPECT_NEAR(fast / thick, 200. / 75, 1e-6);
      ASSERT_EQ(intervals.size() % 2, 1) << "begins and ends thick";
      for (std::size_t k = 0; k < intervals.size(); ++k) {
        ASSERT_EQ(intervals[k].first, k % 2 == 0 ? thick : fast);
        if (k % 2 == 1) {
          ++thin_intervals;
          ASSERT_NEAR(intervals[k].second, 1.5, 0.01);  // coordinates are rounded to 1 um
        } else {
          ASSERT_GE(intervals[k].second, (k == 0 || k + 1 == intervals.size() ? 0.75 : 1.5) - 0.01);
        }
      }
      if (!first) {
        EXPECT_NEAR(thick, 675, 1e-9);
      }
    }
  }
  EXPECT_EQ(json["segments"]["thin"], thin_intervals);
  EXPECT_EQ(json["segments"]["pieces"], segmented);
  EXPECT_GE(segmented, 4 * 2 * 3);
  const double volume = filament * std::numbers::pi / 4 * 1.75 * 1.75;
  EXPECT_NEAR(volume / json["volume_mm3"].get<double>(), 1, 1e-5);
}

TEST_F(ExtrudeProgram, AFileIsNotReplacedUnrequestedItsManifestVouchesForItAndWhatIsInterruptedContinues) {
  const std::string job = block(20, 20, 3, 0) + " --machine anet-a8 --layer 0.3 --walls 1 --quiet -o ";
  ASSERT_EQ(run("extrude " + job + file("a.gcode")).code, 0);
  const std::string whole = test::read_text(file("a.gcode")), manifest = test::read_text(file("a.gcode.json"));
  EXPECT_NE(manifest.find("\"kind\": \"toolpaths\""), std::string::npos);
  EXPECT_EQ(run("verify " + file("a.gcode")).code, 0);
  const Outcome again = run("extrude " + job + file("a.gcode"));
  EXPECT_EQ(again.code, 2);
  EXPECT_NE(again.err.find("--overwrite"), std::string::npos) << again.err;
  EXPECT_EQ(test::read_text(file("a.gcode")), whole);

  // A run that was killed: the manifest's lines are ahead of the file, whose last layer is torn.
  const std::size_t half = whole.size() / 2;
  test::write_text(file("a.gcode.part"), whole.substr(0, half));
  test::write_text(file("a.gcode.json.part"), manifest.substr(0, manifest.find("\n],\n")));
  fs::remove(file("a.gcode"));
  fs::remove(file("a.gcode.json"));
  EXPECT_EQ(run("extrude " + job + file("a.gcode")).code, 2) << "an interrupted job is neither lost nor taken for granted";
  const Outcome resumed = run("extrude " + job + file("a.gcode") + " --resume --json");
  ASSERT_EQ(resumed.code, 0) << resumed.err;
  EXPECT_GT(resumed.json()["layers_kept"], 2);
  EXPECT_GT(resumed.json()["layers_planned"], 2);
  EXPECT_EQ(test::read_text(file("a.gcode")), whole);
  EXPECT_EQ(test::read_text(file("a.gcode.json")), manifest);
  EXPECT_FALSE(fs::exists(file("a.gcode.part")) || fs::exists(file("a.gcode.json.part")));

  // A changed byte is reported with its layer.
  std::string changed = whole;
  changed[half] = changed[half] == '1' ? '2' : '1';
  test::write_text(file("a.gcode"), changed);
  const Outcome verified = run("verify " + file("a.gcode"));
  EXPECT_EQ(verified.code, 5);
  EXPECT_NE(verified.err.find("is not what was written"), std::string::npos) << verified.err;
}

TEST_F(ExtrudeProgram, SameBytesForAnyThreads) {
  const std::string part = block(30, 20, 3, 6);
  const std::string arguments =
      "extrude --overwrite " + part + " --machine anet-a8 --layer 0.2 --fill segmented --angle 30 --angle-step 60 --quiet ";
  ASSERT_EQ(run(arguments + "--threads 1 -o " + file("a.gcode")).code, 0);
  ASSERT_EQ(run(arguments + "--threads 4 --memory 1M -o " + file("b.gcode")).code, 0);
  EXPECT_EQ(text_of(file("a.gcode")), text_of(file("b.gcode")));
  // Layers of so many stretches that they are written a piece at a time.
  const std::string wide = "extrude --overwrite " + block(60, 60, 0.6, 6) +
                           " --machine klipper --layer 0.2 --fill segmented --thin 0.2 --thick 0.2 --quiet --json ";
  const Outcome one = run(wide + "--threads 1 -o " + file("a.gcode")), many = run(wide + "--threads 4 -o " + file("b.gcode"));
  ASSERT_EQ(one.code, 0) << one.err;
  ASSERT_EQ(many.code, 0) << many.err;
  const std::string text = text_of(file("a.gcode"));
  EXPECT_GT(text.size(), 3u << 17);
  EXPECT_TRUE(text == text_of(file("b.gcode")));
  const test::GcodeFile gcode = test::read_gcode(text);
  ASSERT_EQ(gcode.error, "");
  std::size_t beads = 0;
  for (const auto& layer : gcode.layers) beads += layer.beads.size();
  EXPECT_EQ(one.json()["moves"], beads);
}

TEST_F(ExtrudeProgram, WrongInputIsOneLineAndTheCodeOfUsage) {
  const std::string part = block(10, 10, 1, 0);
  const auto message = [&](const std::string& arguments) {
    const Outcome result = run("extrude --overwrite " + part + " --quiet -o " + file("a.gcode") + " " + arguments);
    EXPECT_EQ(result.code, 2) << arguments;
    EXPECT_EQ(std::count(result.err.begin(), result.err.end(), '\n'), 1) << result.err;
    EXPECT_FALSE(fs::exists(file("a.gcode")));
    return result.err;
  };
  EXPECT_NE(message("--fill segmented --thin 0").find("segment.thin_mm: 0 mm; a thin segment has to be longer than 0"),
            std::string::npos);
  EXPECT_NE(message("--fill segmented --thin -2").find("segment.thin_mm: -2 mm"), std::string::npos);
  EXPECT_NE(message("--fill segmented --thin-speed 0").find("segment.thin_speed_percent: 0 %"), std::string::npos);
  EXPECT_NE(message("--fill segmented --spacing-sc 0.2").find("segment.spacing_sc_mm: 0.2 mm is below"), std::string::npos);
  EXPECT_NE(message("--fill segmented --thin 15").find("segment.thin_mm: 15 mm is longer than any line in the parts"),
            std::string::npos);
  EXPECT_NE(message("--machine anet-a9").find("no extrusion printer 'anet-a9'; did you mean 'anet-a8'?"), std::string::npos);
  EXPECT_NE(message("--fill segmentd").find("segmented"), std::string::npos);
  EXPECT_NE(message("--fill raster --thin 2").find("--thin: applies to segmented lines"), std::string::npos);
  EXPECT_NE(message("--fill segmented --bead-gap 2 --spacing-sc 0.6").find("segment.spacing_sc_mm: fill.gap_mm sets"),
            std::string::npos);
  EXPECT_NE(message("--fill raster --shard 1/2").find("--shard: shards are of images"), std::string::npos);
  EXPECT_NE(message("--fill raster --set run.shard=1/2").find("run.shard: shards are of images"), std::string::npos);
}

TEST_F(ExtrudeProgram, SmlHasItsReportNextToItWithTheLayersThatItDeposits) {
  const Outcome result = run("extrude --overwrite " + block(20, 20, 2.54, 0) +
                             " --machine fdm-2000 --layer 0.254 --bead 0.508 --fill raster --quiet --json -o " + file("a.sml"));
  ASSERT_EQ(result.code, 0) << result.err;
  const std::string report = text_of(file("a.rp3"));
  EXPECT_EQ(result.json()["layers_planned"], 10);
  EXPECT_NE(report.find("\n10\t0.508\t0.508\t0.254\t"), std::string::npos) << report;
  EXPECT_EQ(report.find("\n11\t"), std::string::npos);
  EXPECT_TRUE(report.ends_with("----- fim do arquivo -----\n"));
}

TEST_F(ExtrudeProgram, PermeabilityOfTable18IsThatOfTable25WithAWarningAboutItsDensity) {
  const Outcome result = run("permeability " + std::string(LAMINA_TEST_DIR) +
                             "/reference/dinisio2022/table_18.tsv --convention dinisio2022 --json");
  ASSERT_EQ(result.code, 0) << result.err;
  const auto fit = result.json()["fits"][0];
  EXPECT_NEAR(fit["k1_darcy"].get<double>(), 100.09, 0.01);
  EXPECT_NEAR(fit["k2_m"].get<double>() * 1e3, 14.22, 0.01);
  EXPECT_EQ(fit["points"], 90);
  EXPECT_NE(result.err.find("density is that of water"), std::string::npos);
  const Outcome plot = run("permeability " + std::string(LAMINA_TEST_DIR) +
                           "/reference/dinisio2022/table_18.tsv --convention dinisio2022 --plot " + file("fit.svg"));
  EXPECT_EQ(plot.code, 0) << plot.err;
  for (const char* part :
       {"k1 100.09 D, k2 0.01422 m", ">superficial velocity (m/s)<", ">pressure drop / length (kPa/m)<", ">0<"}) {
    EXPECT_NE(text_of(file("fit.svg")).find(part), std::string::npos) << part << "\n" << text_of(file("fit.svg"));
  }
  std::ofstream(file("bad.csv")) << "flow_l_min,drop_pa\n4,12\n8,much\n";
  const Outcome bad = run("permeability " + file("bad.csv") + " --length 25 --diameter 25");
  EXPECT_EQ(bad.code, 3);
  EXPECT_NE(bad.err.find("bad.csv:3: drop_pa: "), std::string::npos) << bad.err;
}

TEST_F(ExtrudeProgram, PreviewDrawsThePlotOfAPermeability) {
  const Outcome plot = run("permeability " + std::string(LAMINA_TEST_DIR) +
                           "/reference/dinisio2022/table_18.tsv --convention dinisio2022 --plot " + file("fit.png"));
  ASSERT_EQ(plot.code, 0) << plot.err;
  EXPECT_EQ(text_of(file("fit.png")).substr(1, 3), "PNG");
}

}  // namespace
}  // namespace lamina
