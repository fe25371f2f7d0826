// tests/segment/table.h: the tables of tests/reference/dinisio2022.
#pragma once

#include <cstdlib>
#include <fstream>
#include <map>
#include <sstream>
#include <string>
#include <vector>

namespace lamina::test {

using Row = std::map<std::string, std::string>;

inline std::vector<Row> read_table(const std::string& path) {
  std::ifstream file(path);
  std::vector<std::string> names;
  std::vector<Row> rows;
  for (std::string line; std::getline(file, line);) {
    if (line.empty() || line[0] == '#') continue;
    std::istringstream cells(line);
    std::vector<std::string> values;
    for (std::string cell; std::getline(cells, cell, '\t');) values.push_back(cell);
    if (names.empty()) {
      names = values;
      continue;
    }
    Row row;
    for (std::size_t i = 0; i < values.size(); ++i) row[names[i]] = values[i];
    rows.push_back(row);
  }
  if (rows.empty()) std::abort();  // the reference tables are part of the repository
  return rows;
}

inline std::vector<Row> table(int number) {
  const std::string digits = (number < 10 ? "0" : "") + std::to_string(number);
  return read_table(std::string(LAMINA_TEST_DIR) + "/reference/dinisio2022/table_" + digits + ".tsv");
}

inline double number(const Row& row, const std::string& name) { return std::stod(row.at(name)); }

}  // namespace lamina::test
