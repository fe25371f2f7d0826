#include "stages/segment/widths_table.h"

#include <fmt/format.h>

#include <algorithm>

#include "stages/support/io/file_reader.h"
#include "stages/support/text/number_text.h"
#include "stages/support/text/readable.h"
#include "stages/support/text/value.h"

namespace lamina::segment {
namespace {

constexpr Word<Measured::Test> kTests[] = {{"flow", Measured::Test::kFlow},
                                           {"speed", Measured::Test::kSpeed},
                                           {"extrusion", Measured::Test::kExtrusion},
                                           {"repeated", Measured::Test::kRepeated}};

constexpr std::string_view kColumns[] = {"test",     "percent", "thick_speed_percent", "region",   "wall_mm",
                                         "thick_mm", "thin_mm", "continuous_mm",       "stable_mm"};

/// Sets one cell. returns "" or what is wrong
std::string set_cell(std::string_view column, const std::string& text, Measured& row) {
  if (column == "test") return read_word(kTests, text, row.test);
  if (column == "region") {
    row.region = text;
    return {};
  }
  if (text.empty()) return {};
  if (column == "percent") return read_number(text, 0.001, 10'000, " %", row.percent);
  if (column == "thick_speed_percent") return read_number(text, 0.001, 10'000, " %", row.thick_speed_percent);
  double value = 0;
  auto wrong = read_number(text, 0.001, 100, " mm", value);
  if (!wrong.empty()) return wrong;
  (column == "wall_mm"         ? row.wall
   : column == "thick_mm"      ? row.thick
   : column == "thin_mm"       ? row.thin
   : column == "continuous_mm" ? row.continuous
                               : row.stable) = value;
  return {};
}

}  // namespace

Result<std::vector<Measured>> read_widths(const std::string& path) {
  auto file = FileReader::open(path, {.fault = Fault::kInput, .max_bytes = kMaxTableBytes, .streams = true});
  return file ? read_widths(*file) : Result<std::vector<Measured>>(file.error());
}

Result<std::vector<Measured>> read_widths(FileReader& file) {
  const std::string& path = file.path();
  const auto wrong = [&](std::size_t line, const std::string& what) {
    return Error{Fault::kInput, line == 0 ? fmt::format("{}: {}", path, what) : fmt::format("{}:{}: {}", path, line, what)};
  };
  std::vector<std::string> names;
  std::vector<Measured> rows;
  char separator = ',';
  for (std::string_view line; file.next(line);) {
    const std::uint64_t number = file.line_number();
    if (line.empty() || line[0] == '#' || line == "\r") continue;
    if (names.empty()) {
      separator = separator_of(line);
      names = cells_of(line, separator);
      for (std::size_t i = 0; i < names.size(); ++i) {
        if (std::ranges::find(kColumns, names[i]) == std::end(kColumns)) {
          return wrong(number, fmt::format("column '{}' is none of {}{}", one_line(names[i]), fmt::join(kColumns, ", "),
                                           suggest(names[i], kColumns)));
        }
        if (std::find(names.begin(), names.begin() + static_cast<std::ptrdiff_t>(i), names[i]) !=
            names.begin() + static_cast<std::ptrdiff_t>(i)) {
          return wrong(number, fmt::format("column {} stands twice", names[i]));
        }
      }
      if (std::ranges::find(names, "test") == names.end())
        return wrong(number, fmt::format("no column test; the header is {}", fmt::join(kColumns, ",")));
      continue;
    }
    const auto cells = cells_of(line, separator);
    if (cells.size() != names.size())
      return wrong(number, fmt::format("{} columns where the header has {}", cells.size(), names.size()));
    Measured row{};
    row.row = number;
    for (std::size_t i = 0; i < cells.size(); ++i) {
      if (const std::string what = set_cell(names[i], cells[i], row); !what.empty())
        return wrong(number, fmt::format("{}: {}", names[i], what));
    }
    rows.push_back(std::move(row));
  }
  if (!file.status()) return file.status().error();
  if (rows.empty()) return wrong(0, "holds no rows; lamina calibrate -o DIR writes a table to be filled in");
  return rows;
}

}  // namespace lamina::segment
