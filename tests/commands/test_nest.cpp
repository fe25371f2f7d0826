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

#include "tests/commands/program.h"

namespace lamina::test {
namespace {

using CsvCells = std::vector<std::vector<std::string>>;

/// Of files without quotes.
CsvCells cells_of(const std::string& text) {
  CsvCells rows;
  std::istringstream lines(text);
  for (std::string line; std::getline(lines, line);) {
    if (!line.empty() && line.back() == '\r') line.pop_back();
    std::istringstream cells(line + ",");
    rows.emplace_back();
    for (std::string cell; std::getline(cells, cell, ',');) rows.back().push_back(cell);
  }
  return rows;
}

class Nesting : public ::testing::Test {
 protected:
  void SetUp() override {
    write_box(folder_ / "bar.stl", {0, 0, 0}, {30, 6, 4});
    write_box(folder_ / "cube.stl", {5, 5, 5}, {15, 15, 15});
  }
  Outcome run(const std::string& line) const { return run_lamina(words_of(line), folder_.path()); }
  std::string text(const std::string& name) const { return read_text(folder_ / name); }
  Directory folder_;
};

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

TEST_F(Nesting, WhatDoesNotFitIsNamedWithTheReason) {
  write_box(folder_ / "beam.stl", {0, 0, 0}, {200, 6, 4});
  write_box(folder_ / "tower.stl", {0, 0, 0}, {5, 5, 150});
  write_text(folder_ / "orders.csv", "file,copies,group\nbeam.stl,2,\ntower.stl,1,\nbar.stl,99,g\ncube.stl,1,\n");
  const Outcome made = run("nest orders.csv --machine nuferbj -o week --json");
  ASSERT_EQ(made.code, 0) << made.err;
  const auto left = nlohmann::json::parse(made.out).at("left_out");
  ASSERT_EQ(left.size(), 3u);
  EXPECT_NE(left[0].at("reason").get<std::string>().find("fit the free bed in none of 4 turns"), std::string::npos);
  EXPECT_NE(left[1].at("reason").get<std::string>().find("is 150 mm high, and the machine builds 100 mm"), std::string::npos);
  EXPECT_NE(left[2].at("reason").get<std::string>().find("its group 'g' does not fit one build"), std::string::npos);
  const Outcome one = run("nest cube.stl --copies 90 --machine nuferbj --builds 1 --dry-run --json --quiet");
  EXPECT_NE(one.out.find("the 1 build requested are full"), std::string::npos) << one.out;
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
  expect_refused("nest orders.csv --bed 100x100 -o week", 2, "overlaps another fixed part", folder_);
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
