// tests/commands/nesting.h: runs of lamina nest on two small parts, and the cells of its tables.
#pragma once

#include <gtest/gtest.h>

#include <sstream>
#include <string>
#include <vector>

#include "tests/commands/program.h"

namespace lamina::test {

using CsvCells = std::vector<std::vector<std::string>>;

/// Of files without quotes.
inline CsvCells cells_of(const std::string& text) {
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

}  // namespace lamina::test
