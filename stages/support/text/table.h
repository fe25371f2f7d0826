// stages/support/text/table.h: lines of user-edited tables, separated by commas, semicolons or tabs.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "stages/support/text/number_text.h"

namespace lamina {

/// The column separator of a table, detected from its first line.
inline char separator_of(std::string_view header) {
  return header.find('\t') != std::string_view::npos ? '\t' : header.find(';') != std::string_view::npos ? ';' : ',';
}

/// The cells of a line without surrounding blanks and quotes.
inline std::vector<std::string> cells_of(std::string_view line, char separator) {
  if (line.ends_with('\r')) line.remove_suffix(1);
  std::vector<std::string> cells;
  for (std::string_view cell : split(line, std::string_view(&separator, 1))) {
    while (!cell.empty() && (cell.front() == ' ' || cell.front() == '"')) cell.remove_prefix(1);
    while (!cell.empty() && (cell.back() == ' ' || cell.back() == '"')) cell.remove_suffix(1);
    cells.emplace_back(cell);
  }
  return cells;
}

}  // namespace lamina
