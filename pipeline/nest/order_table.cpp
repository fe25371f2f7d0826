#include "pipeline/nest/order_table.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <map>
#include <numeric>
#include <set>
#include <string_view>
#include <tuple>
#include <utility>

#include "pipeline/nest/csv_rows.h"
#include "stages/support/text/json_text.h"
#include "stages/support/text/readable.h"

namespace lamina::pipeline {
namespace {

namespace fs = std::filesystem;

constexpr std::uint32_t kMaxCopies = 1'000'000;

// --- values; each returns "" or what is wrong

std::string read_whole(const std::string& text, std::int64_t low, std::int64_t high, std::int64_t& value) {
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error == std::errc() && end == text.data() + text.size() && value >= low && value <= high) return {};
  return fmt::format("'{}' is not a whole number from {} to {}", one_line(text), low, high);
}

std::string read_decimal(const std::string& text, double low, double high, double& value) {
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error == std::errc() && end == text.data() + text.size() && value >= low && value <= high) return {};
  std::string wrong = fmt::format("'{}' is not a number from {:g} to {:g}", one_line(text), low, high);
  if (std::ranges::count(text, ',') == 1 && text.find('.') == std::string::npos) wrong += "; decimals have a point";
  return wrong;
}

std::vector<std::string> words_of_cell(const std::string& text) {
  std::vector<std::string> words;
  for (std::size_t at = 0; at < text.size();) {
    const std::size_t from = text.find_first_not_of(' ', at);
    if (from == std::string::npos) break;
    at = std::min(text.find(' ', from), text.size());
    words.push_back(text.substr(from, at - from));
  }
  return words;
}

std::string read_due(const std::string& text, OrderRow& row) {
  row.due = days_of(text);
  return row.due ? std::string() : fmt::format("'{}' is not a date as 2026-12-24", one_line(text));
}

std::string read_fixed(const std::string& text, OrderRow& row) {
  const auto words = words_of_cell(text);
  std::array<double, 2> at{};
  if (words.size() != 2) return fmt::format("'{}' is not \"X Y\" in mm", one_line(text));
  for (std::size_t i = 0; i < 2; ++i) {
    if (auto wrong = read_decimal(words[i], 0, 1e4, at[i]); !wrong.empty()) return wrong;
  }
  row.fixed_mm = at;
  return {};
}

std::string read_turns(const std::string& text, OrderRow& row) {
  if (text == "any") {
    for (MicroDegrees turn = 0; turn < kTurn; turn += kTurn / 24) row.turns.push_back(turn);
    return {};
  }
  for (const std::string& word : words_of_cell(text)) {
    double degrees = 0;
    if (auto wrong = read_decimal(word, 0, 359.999, degrees); !wrong.empty()) return wrong + ", nor any";
    row.turns.push_back(std::llround(degrees * 1e6));
  }
  return {};
}

std::string read_down(const std::string& text, OrderRow& row) {
  const bool sign = text.size() == 2 && (text[0] == '+' || text[0] == '-');
  if (!sign || text[1] < 'x' || text[1] > 'z') return fmt::format("'{}' must be one of -x, +x, -y, +y, -z, +z", one_line(text));
  const double side = text[0] == '+' ? 90 : -90;
  if (text == "+z") row.rest_deg = {180, 0};
  if (text[1] == 'x') row.rest_deg = {0, side};
  if (text[1] == 'y') row.rest_deg = {-side, 0};
  return {};
}

using ReadCell = std::string (*)(const std::string& text, OrderRow& row);

std::string read_copies(const std::string& text, OrderRow& row) {
  std::int64_t value = 0;
  auto wrong = read_whole(text, 1, kMaxCopies, value);
  row.copies = static_cast<std::uint32_t>(value);
  return wrong;
}
std::string read_priority(const std::string& text, OrderRow& row) {
  std::int64_t value = 0;
  auto wrong = read_whole(text, -1000, 1000, value);
  row.priority = static_cast<std::int32_t>(value);
  return wrong;
}
template <std::string OrderRow::*Member>
std::string read_text(const std::string& text, OrderRow& row) {
  row.*Member = text;
  return {};
}

constexpr std::pair<std::string_view, ReadCell> kColumns[] = {
    {"file", read_text<&OrderRow::path>},
    {"copies", read_copies},
    {"order", read_text<&OrderRow::order>},
    {"customer", read_text<&OrderRow::customer>},
    {"due", read_due},
    {"priority", read_priority},
    {"group", read_text<&OrderRow::group>},
    {"fixed", read_fixed},
    {"turns", read_turns},
    {"down", read_down},
    {"keep_apart_mm", [](const std::string& text, OrderRow& row) { return read_decimal(text, 0, 1000, row.keep_apart_mm); }},
    {"material", read_text<&OrderRow::material>},
    {"note", read_text<&OrderRow::note>}};

/// Whether a word begins like a name and differs from it by three letters at most.
bool is_misspelt(const std::string& word, std::string_view name) {
  const auto same = std::ranges::mismatch(word, name).in1 - word.begin();
  if (same < 3 || word.size() > name.size() + 2) return false;
  std::vector<std::size_t> above(name.size() + 1), row(name.size() + 1);  // letters to change, of what begins both
  std::iota(above.begin(), above.end(), std::size_t{0});
  for (std::size_t i = 0; i < word.size(); ++i) {
    row[0] = i + 1;
    for (std::size_t k = 0; k < name.size(); ++k)
      row[k + 1] = std::min({above[k] + (word[i] == name[k] ? 0 : 1), above[k + 1] + 1, row[k] + 1});
    std::swap(above, row);
  }
  return above[name.size()] <= 3;
}

class OrderReader {
 public:
  OrderReader(const std::string& path, std::string_view text) : path_(path), rows_(text, separator_of(text)) {}

  /// errors  kInput without a usable header
  Status read_header() {
    std::vector<CsvCell> cells;
    std::optional<CsvCell> open;
    if (!rows_.next(cells, open)) return Error{Fault::kInput, fmt::format("{}: is empty; its first line names columns", path_)};
    std::set<std::string> names;
    for (const CsvCell& cell : cells) {
      if (!cell.text.empty() && !names.insert(lower_case(cell.text)).second)
        fault(cell, fmt::format("column '{}' is there twice", one_line(cell.text)));
      const auto* known = std::ranges::find(kColumns, lower_case(cell.text), &std::pair<std::string_view, ReadCell>::first);
      if (known == std::end(kColumns)) table.more_columns.push_back(cell.text);
      columns_.push_back(known == std::end(kColumns) ? nullptr : known);
    }
    for (std::size_t i = 0; i < cells.size(); ++i) {
      if (columns_[i] != nullptr) continue;
      for (const auto& [name, read] : kColumns) {
        if (!names.contains(std::string(name)) && is_misspelt(lower_case(cells[i].text), name))
          fault(cells[i],
                fmt::format("column '{}': did you mean '{}'? Otherwise give it another name", one_line(cells[i].text), name));
      }
    }
    if (!names.contains("file") && table.faults.empty())
      return Error{Fault::kInput, fmt::format("{}:1:1: has no column 'file'; the first line names the columns", path_)};
    return {};
  }

  void read_rows() {
    std::vector<CsvCell> cells;
    std::optional<CsvCell> open;
    while (rows_.next(cells, open)) {
      const std::size_t faults = table.faults.size();
      if (open) {
        fault(*open, "a quote is not closed");
        return;
      }
      OrderRow row;
      row.line = cells[0].line;
      read_cells(cells, row);
      if (!row.path.empty()) check_file(row, cells);
      if (table.faults.size() == faults) check(row, cells);
      if (table.faults.size() == faults) table.rows.push_back(std::move(row));
    }
  }

  OrderTable table;

 private:
  /// The one that the first line has most of.
  static char separator_of(std::string_view text) {
    const std::string_view line = text.substr(0, text.find('\n'));
    char best = ',';
    for (const char each : {',', ';', '\t'})
      if (std::ranges::count(line, each) > std::ranges::count(line, best)) best = each;
    return best;
  }
  void fault(const CsvCell& cell, const std::string& what) {
    table.faults.push_back(fmt::format("{}:{}:{}: {}", path_, cell.line, cell.column, what));
  }
  void read_cells(const std::vector<CsvCell>& cells, OrderRow& row) {
    if (cells.size() != columns_.size()) {
      fault(cells[std::min(cells.size(), columns_.size()) - 1],
            fmt::format("the row has {} cells, the first line {}", cells.size(), columns_.size()));
      return;
    }
    for (std::size_t i = 0; i < cells.size(); ++i) {
      if (!is_utf8(cells[i].text)) {
        fault(cells[i], "is not UTF-8; save the table as \"CSV UTF-8\"");
      } else if (columns_[i] == nullptr) {
        row.more.push_back(cells[i].text);
      } else if (!cells[i].text.empty()) {
        if (auto wrong = columns_[i]->second(cells[i].text, row); !wrong.empty())
          fault(cells[i], fmt::format("{}: {}", columns_[i]->first, wrong));
      } else if (columns_[i]->first == "file") {
        fault(cells[i], "file: is missing");
      }
    }
  }
  const CsvCell& cell_of(const std::vector<CsvCell>& cells, std::string_view name) const {
    for (std::size_t i = 0; i < columns_.size(); ++i)
      if (columns_[i] != nullptr && columns_[i]->first == name) return cells[i];
    return cells[0];
  }
  void check_file(OrderRow& row, const std::vector<CsvCell>& cells) {
    row.path = (fs::path(path_).parent_path() / row.path).string();
    std::error_code error;
    if (!fs::is_regular_file(row.path, error))
      fault(cell_of(cells, "file"), fmt::format("{}: no such file", one_line(row.path)));
  }
  void check(OrderRow& row, const std::vector<CsvCell>& cells) {
    if (row.fixed_mm && row.copies > 1) fault(cell_of(cells, "fixed"), "one position is for one copy; give each its own row");
    if (row.fixed_mm && !row.group.empty())
      fault(cell_of(cells, "group"), "is of a part with a position, which is in the first build; leave out one of them");
    if (!row.order.empty()) {
      const auto [other, fresh] = lines_.try_emplace({row.order, row.path, row.fixed_mm.has_value() ? row.line : 0}, row.line);
      if (!fresh)
        fault(cell_of(cells, "order"), fmt::format("order '{}' has this file in line {} already; add the copies there",
                                                   one_line(row.order), other->second));
      const auto [first, single] = priority_.try_emplace(row.order, row.priority, row.line);
      if (!single && first->second.first != row.priority)
        fault(cell_of(cells, "priority"), fmt::format("order '{}' has priority {} in line {}", one_line(row.order),
                                                      first->second.first, first->second.second));
    }
    if (!row.group.empty()) {
      const auto [first, single] = material_.try_emplace(row.group, row.material, row.line);
      if (!single && first->second.first != row.material)
        fault(cell_of(cells, "group"), fmt::format("group '{}' is of material '{}' in line {}; a build has one",
                                                   one_line(row.group), one_line(first->second.first), first->second.second));
      const auto [rank, only] = group_priority_.try_emplace(row.group, row.priority, row.line);
      if (!only && rank->second.first != row.priority)
        fault(cell_of(cells, "priority"), fmt::format("group '{}' has priority {} in line {}", one_line(row.group),
                                                      rank->second.first, rank->second.second));
    }
  }

  const std::string& path_;
  CsvRows rows_;
  std::vector<const std::pair<std::string_view, ReadCell>*> columns_;
  std::map<std::tuple<std::string, std::string, std::uint32_t>, std::uint32_t> lines_;
  std::map<std::string, std::pair<std::int32_t, std::uint32_t>> priority_, group_priority_;
  std::map<std::string, std::pair<std::string, std::uint32_t>> material_;
};

}  // namespace

Result<OrderTable> read_orders(const std::string& path) {
  const auto text = csv_content(path);
  if (!text) return text.error();
  const std::string_view content = *text;
  if (content.starts_with("\xff\xfe") || content.starts_with("\xfe\xff") || content.find('\0') != std::string_view::npos)
    return Error{Fault::kInput, fmt::format("{}:1:1: is UTF-16; save the table as \"CSV UTF-8\"", path)};
  OrderReader reader(path, content);
  if (Status status = reader.read_header(); !status) return status.error();
  reader.read_rows();
  return std::move(reader.table);
}

std::string file_name(const OrderRow& row) { return fs::path(row.path).filename().string(); }

std::optional<std::int32_t> days_of(const std::string& text) {
  int year = 0, month = 0, day = 0;
  const auto number = [&](std::size_t from, std::size_t size, int& value) {
    const auto [end, error] = std::from_chars(text.data() + from, text.data() + from + size, value);
    return error == std::errc() && end == text.data() + from + size;
  };
  const bool shaped =
      text.size() == 10 && text[4] == '-' && text[7] == '-' && number(0, 4, year) && number(5, 2, month) && number(8, 2, day);
  if (!shaped) return std::nullopt;
  const std::chrono::year_month_day date{std::chrono::year(year), std::chrono::month(static_cast<unsigned>(month)),
                                         std::chrono::day(static_cast<unsigned>(day))};
  if (!date.ok()) return std::nullopt;
  return static_cast<std::int32_t>(std::chrono::sys_days(date).time_since_epoch().count());
}

std::string date_text(std::int32_t days) {
  const std::chrono::year_month_day date{std::chrono::sys_days(std::chrono::days(days))};
  return fmt::format("{:04}-{:02}-{:02}", static_cast<int>(date.year()), static_cast<unsigned>(date.month()),
                     static_cast<unsigned>(date.day()));
}

}  // namespace lamina::pipeline
