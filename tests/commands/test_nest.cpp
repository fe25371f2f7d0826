// tests/commands/test_nest.cpp: orders become builds.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <nlohmann/json.hpp>
#include <set>
#include <sstream>
#include <string>
#include <vector>

#include "stages/support/hash/hash.h"
#include "tests/commands/nesting.h"

namespace lamina::test {
namespace {

struct PlacedBox {
  double x, y, width, depth;
};

TEST_F(Nesting, EveryPartIsInOneBuildOrReported) {
  write_text(
      folder_ / "orders.csv",
      "file,copies,order,due,priority,material\nbar.stl,30,1001,2026-12-24,,\ncube.stl,40,1002,,5,\nbar.stl,4,1003,,,\n");
  const Outcome made = run("nest orders.csv --bed 100x80 --margin 4 --gap 3 -o week --json --quiet");
  ASSERT_EQ(made.code, 0) << made.err;
  const auto json = nlohmann::json::parse(made.out);
  EXPECT_EQ(json.at("copies"), 74);
  EXPECT_EQ(json.at("kinds"), 2);
  std::set<std::string> serials;
  const std::size_t builds = json.at("builds").size();
  ASSERT_GT(builds, 1u);
  for (std::size_t b = 1; b <= builds; ++b) {
    const CsvCells parts = cells_of(text("week/build-" + std::to_string(b) + "/parts.csv"));
    std::vector<PlacedBox> boxes;
    for (std::size_t i = 1; i < parts.size(); ++i) {
      EXPECT_TRUE(serials.insert(parts[i][1]).second) << parts[i][1];
      const auto number = [&](std::size_t column) { return std::stod(parts[i][column]); };
      boxes.push_back({number(5), number(6), number(8), number(9)});
    }
    EXPECT_EQ(boxes.size(), json.at("builds")[b - 1].at("parts"));
    if (b == 1) {
      EXPECT_EQ(parts[1][1], "1002-001") << "the higher priority first";
    }
    for (std::size_t i = 0; i < boxes.size(); ++i) {
      const PlacedBox& a = boxes[i];
      EXPECT_GE(std::min(a.x, a.y), 4 - 1e-6);
      EXPECT_LE(a.x + a.width, 96 + 1e-6);
      EXPECT_LE(a.y + a.depth, 76 + 1e-6);
      for (std::size_t k = 0; k < i; ++k) {
        const PlacedBox& c = boxes[k];
        const double dx = std::max({0.0, c.x - a.x - a.width, a.x - c.x - c.width});
        const double dy = std::max({0.0, c.y - a.y - a.depth, a.y - c.y - c.depth});
        EXPECT_GE(std::hypot(dx, dy), 3 - 1e-6) << i << " " << k;
      }
    }
    // The job is that of another command.
    const std::string folder = "week/build-" + std::to_string(b);
    const Outcome images =
        run("jet --job " + folder + "/plate.toml --dpi 100 --layer 1 -o out" + std::to_string(b) + " --json --quiet");
    ASSERT_EQ(images.code, 0) << images.err;
  }
  EXPECT_EQ(serials.size(), 74u);
  std::map<std::string, int> copies;
  for (const auto& row : cells_of(text("week/orders.csv"))) copies[row[0]] += row[0] == "order" ? 1 : std::stoi(row[3]);
  EXPECT_EQ(copies["1001"], 30);
  EXPECT_EQ(copies["1002"], 40);
  EXPECT_EQ(copies["1003"], 4);
}

/// What parts cover in any layer of a job, as a picture of bytes with the number of each connected piece.
class CoveredPixels {
 public:
  explicit CoveredPixels(const std::string& folder) {
    for (const auto& entry : std::filesystem::directory_iterator(folder)) add(read_text(entry.path()));
    std::uint32_t number = 0;
    for (std::size_t at = 0; at < piece.size(); ++at)
      if (piece[at] == kSet) flood(at, ++number);
    boundaries.resize(number);
    for (std::size_t at = 0; at < piece.size(); ++at) {
      const std::size_t x = at % width, y = at / width;
      if (piece[at] == 0) continue;
      EXPECT_TRUE(x > 0 && y > 0 && x + 1 < width && y + 1 < height);
      if (piece[at - 1] && piece[at + 1] && piece[at - width] && piece[at + width]) continue;
      boundaries[piece[at] - 1].push_back({static_cast<double>(x), static_cast<double>(y)});
    }
  }
  std::size_t width = 0, height = 0;
  std::vector<std::uint32_t> piece;
  std::vector<std::vector<std::pair<double, double>>> boundaries;  // pixels

 private:
  static constexpr std::uint32_t kSet = UINT32_MAX;
  void add(const std::string& pbm) {
    const std::size_t comment = pbm.find('#'), after = comment < 8 ? pbm.find('\n', comment) : 2;
    std::istringstream head(pbm.substr(after, 64));
    head >> width >> height;
    const std::size_t row = (width + 7) / 8, begin = pbm.size() - row * height;
    piece.resize(width * height);
    for (std::size_t y = 0; y < height; ++y) {
      for (std::size_t b = 0; b < row; ++b) {
        const auto byte = static_cast<unsigned char>(pbm[begin + y * row + b]);
        for (std::size_t x = 8 * b; byte != 0 && x < std::min(width, 8 * b + 8); ++x)
          if ((byte >> (7 - x % 8) & 1) != 0) piece[y * width + x] = kSet;
      }
    }
  }
  void flood(std::size_t from, std::uint32_t number) {
    std::vector<std::size_t> open{from};
    piece[from] = number;
    while (!open.empty()) {
      const std::size_t at = open.back();
      open.pop_back();
      for (const std::size_t next : {at - 1, at + 1, at - width, at + width}) {
        if (piece[next] != kSet) continue;
        piece[next] = number;
        open.push_back(next);
      }
    }
  }
};

// Distances between the pixels that two parts cover, at 600 dpi, on the round bed.
TEST_F(Nesting, NoTwoPartsAreNearerThanTheGap) {
  const std::string crown = corpus_file("dental_crown.stl");
  ASSERT_EQ(
      run("nest " + crown + " --copies 99 --machine nuferbj --margin 2 --gap 5 --turns 0,25,90,200 --builds 1 -o week").code,
      0);
  ASSERT_EQ(run("jet " + crown + " --machine nuferbj --copies 18 --layer 0.3 --dry-run").code, 0) << "so many fit in rows";
  const std::size_t count = cells_of(text("week/build-1/parts.csv")).size() - 1;
  EXPECT_GE(count, 24u);
  // As on a bare bed, whose pixels have 600 dpi.
  std::string job = text("week/build-1/plate.toml");
  job.erase(job.find("profile = "), job.find('\n', job.find("profile = ")) - job.find("profile = "));
  write_text(folder_ / "bare.toml", job);
  const Outcome made = run("jet --job bare.toml --bed 98x98 --dpi 600 --layer 0.4 --format pbm -o out --quiet");
  ASSERT_EQ(made.code, 0) << made.err;
  const CoveredPixels pixels(folder_ / "out/layers");
  ASSERT_EQ(pixels.boundaries.size(), count) << "each part is one piece";
  const double pixel_mm = 25.4 / 600, middle = 49 / pixel_mm;
  double nearest = 1e9;
  for (std::size_t i = 0; i < count; ++i) {
    for (const auto& [x, y] : pixels.boundaries[i])
      EXPECT_LE(std::hypot(x + 0.5 - middle, y + 0.5 - middle) * pixel_mm, 47 + pixel_mm) << "the margin";
    for (std::size_t k = 0; k < i; ++k) {
      const auto &a = pixels.boundaries[i], &b = pixels.boundaries[k];
      if (std::hypot(a[0].first - b[0].first, a[0].second - b[0].second) * pixel_mm > 35) continue;
      for (const auto& [x, y] : a)
        for (const auto& [u, v] : b) nearest = std::min(nearest, (x - u) * (x - u) + (y - v) * (y - v));
    }
  }
  EXPECT_GE(std::sqrt(nearest) * pixel_mm, 5 - pixel_mm);
  EXPECT_LE(std::sqrt(nearest) * pixel_mm, 5.5) << "and they are not much further away";
}

TEST_F(Nesting, IsTheSameForAnyNumberOfThreads) {
  const std::string job = "nest bar.stl cube.stl --copies 20,25 --bed 90x90 --turns 0,30,90 ";
  ASSERT_EQ(run(job + "--threads 1 -o one").code, 0);
  ASSERT_EQ(run(job + "--threads 4 -o four").code, 0);
  ASSERT_EQ(run(job + "-o again").code, 0);
  for (const char* name : {"orders.csv", "build-1/parts.csv", "build-1/plate.toml"}) {
    EXPECT_EQ(text(std::string("one/") + name), text(std::string("four/") + name));
    EXPECT_EQ(text(std::string("one/") + name), text(std::string("again/") + name));
  }
}

TEST_F(Nesting, SheetsHaveEveryPartItsPositionAndTheHashOfTheJob) {
  write_text(folder_ / "orders.csv", "file,copies,order,customer\nbar.stl,3,1001,Kunze & <Sohn>\ncube.stl,2,1002,\n");
  ASSERT_EQ(run("nest orders.csv --machine nuferbj -o week").code, 0);
  const std::string sheet = text("week/build-1/sheet.html");
  EXPECT_NE(sheet.find(hex(hash_text(text("week/build-1/plate.toml")))), std::string::npos);
  EXPECT_NE(sheet.find("Kunze &amp; &lt;Sohn&gt;"), std::string::npos);
  const CsvCells parts = cells_of(text("week/build-1/parts.csv"));
  ASSERT_EQ(parts.size(), 6u);
  for (std::size_t i = 1; i < parts.size(); ++i) {
    char row[80];
    std::snprintf(row, sizeof row, "<span>%.1f, %.1f</span><span>%.1f</span>", std::stod(parts[i][5]), std::stod(parts[i][6]),
                  std::stod(parts[i][10]));
    const std::size_t at = sheet.find(parts[i][1]);
    ASSERT_NE(at, std::string::npos) << parts[i][1];
    EXPECT_LT(sheet.find(row, at), sheet.find("</div>", at)) << row;
    EXPECT_NE(sheet.rfind("<b>" + parts[i][0] + "</b>", at), std::string::npos);
  }
  // The cubes are 10 mm high, the bars 4: they appear first.
  EXPECT_LT(sheet.find("(10.0 mm)"), sheet.find("(4.0 mm)"));
  EXPECT_EQ(sheet.find("<script"), std::string::npos);
}

TEST_F(Nesting, WhatDoesNotFitIsNamedWithTheReason) {
  write_box(folder_ / "beam.stl", {0, 0, 0}, {200, 6, 4});
  write_box(folder_ / "tower.stl", {0, 0, 0}, {5, 5, 150});
  write_text(folder_ / "orders.csv", "file,copies,group\nbeam.stl,2,\ntower.stl,1,\nbar.stl,99,g\ncube.stl,1,\n");
  const Outcome made = run("nest orders.csv --machine nuferbj -o week --json");
  ASSERT_EQ(made.code, 0) << made.err;
  const auto left = nlohmann::json::parse(made.out).at("left_out");
  ASSERT_EQ(left.size(), 3u);
  EXPECT_NE(left[0].at("reason").get<std::string>().find("do not fit the free bed in any of 4 turns"), std::string::npos);
  EXPECT_NE(left[1].at("reason").get<std::string>().find("is 150 mm high, and the machine builds 100 mm"), std::string::npos);
  EXPECT_NE(left[2].at("reason").get<std::string>().find("its group 'g' does not fit one build"), std::string::npos);
  const Outcome one = run("nest cube.stl --copies 90 --machine nuferbj --builds 1 --dry-run --json --quiet");
  EXPECT_NE(one.out.find("no space in 1 build (--builds)"), std::string::npos) << one.out;
}

// Two materials need two builds, and there is one: what has no build is reported, at a fixed position or not.
TEST_F(Nesting, FixedPartsWithoutABuildAreReported) {
  write_text(folder_ / "orders.csv",
             "file,fixed,material,keep_apart_mm\ncube.stl,,bronze,\ncube.stl,10 10,steel,\nbar.stl,,bronze,70\n");
  const Outcome made = run("nest orders.csv --bed 100x100 --builds 1 -o week --json --quiet");
  ASSERT_EQ(made.code, 0) << made.err;
  const auto json = nlohmann::json::parse(made.out);
  EXPECT_EQ(json.at("builds")[0].at("parts"), 1);
  const auto& left = json.at("left_out");
  ASSERT_EQ(left.size(), 2u);
  EXPECT_EQ(left[0].at("row"), 1) << "the part with a position has the build";
  EXPECT_EQ(left[0].at("reason"), "no build of its material in 1 build (--builds)");
  EXPECT_NE(left[1].at("reason").get<std::string>().find("do not fit the free bed in any of 4 turns"), std::string::npos);
}

TEST_F(Nesting, ColumnsDecideWherePartsAre) {
  write_text(folder_ / "orders.csv",
             "file,copies,fixed,turns,down,keep_apart_mm\nbar.stl,1,40 50,90,,\ncube.stl,6,,,,12\nbar.stl,3,,0,+x,\n");
  ASSERT_EQ(run("nest orders.csv --bed 100x100 --gap 2 -o week").code, 0);
  const CsvCells parts = cells_of(text("week/build-1/parts.csv"));
  ASSERT_EQ(parts.size(), 11u);
  const auto number = [&](std::size_t row, std::size_t column) { return std::stod(parts[row][column]); };
  EXPECT_EQ(number(1, 5), 40);
  EXPECT_EQ(number(1, 6), 50);
  EXPECT_EQ(number(1, 8), 6) << "turned upright";
  for (std::size_t i = 1; i < parts.size(); ++i) {
    if (parts[i][4] == "bar.stl" && i > 1) {
      EXPECT_EQ(number(i, 10), 30) << "it stands on its end";
    }
    for (std::size_t k = 1; k < i; ++k) {
      if (parts[i][4] != "cube.stl" && parts[k][4] != "cube.stl") continue;
      const double dx = std::max({0.0, number(k, 5) - number(i, 5) - number(i, 8), number(i, 5) - number(k, 5) - number(k, 8)});
      const double dy = std::max({0.0, number(k, 6) - number(i, 6) - number(i, 9), number(i, 6) - number(k, 6) - number(k, 9)});
      EXPECT_GE(std::hypot(dx, dy), 12 - 1e-6) << i << " " << k;
    }
  }
}

TEST_F(Nesting, WrongUseIsOneLine) {
  write_text(folder_ / "orders.csv", "file,fixed\nbar.stl,10 10\nbar.stl,20 12\n");
  expect_refused("nest orders.csv --bed 100x100 -o week", 2, "nearer than the gap of 5 mm to another fixed part", folder_);
  expect_refused("nest bar.stl --bed 100x100 --margin 50 -o week", 2, "leave nothing of the bed", folder_);
  expect_refused("nest bar.stl --bed 100x100 --keep-out 0,0,100,100 -o week", 2, "leave nothing of the bed", folder_);
  expect_refused("nest bar.stl cube.stl --copies 1,2,3 -o week", 2, "--copies: has 3 numbers for 2 part files", folder_);
  expect_refused("nest -o week", 2, "no orders", folder_);
  expect_refused("nest bar.stl", 2, "-o DIR is missing", folder_);
  expect_refused("nest bar.stl --turns 0,400 -o week", 2, "--turns", folder_);
  EXPECT_FALSE(std::filesystem::exists(folder_ / "week"));
  ASSERT_EQ(run("nest cube_x2.stl -o week").code, 3) << "no such file";
  ASSERT_EQ(run("nest bar.stl -o week").code, 0);
  expect_refused("nest bar.stl -o week", 2, "has builds already", folder_);
  EXPECT_EQ(run("nest cube.stl -o week --overwrite").code, 0);
}

}  // namespace
}  // namespace lamina::test
