#include "pipeline/nest/add_to_build.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <functional>
#include <map>
#include <optional>
#include <sstream>

#include "pipeline/job/errors.h"
#include "pipeline/job/file.h"
#include "pipeline/nest/csv_rows.h"
#include "pipeline/nest/nest_files.h"
#include "pipeline/report/job_cost.h"
#include "stages/support/io/file.h"
#include "stages/support/text/readable.h"

namespace lamina::pipeline {
namespace {

namespace fs = std::filesystem;

fs::path orders_of(const std::string& folder) { return fs::path(whole_path(folder)).parent_path() / "orders.csv"; }

/// "" for a column that the table does not have.
std::string cell_of(const CsvTable& table, std::size_t row, std::string_view column) {
  const auto found = std::ranges::find(table[0], column);
  const auto at = static_cast<std::size_t>(found - table[0].begin());
  return found == table[0].end() || at >= table[row].size() ? std::string() : table[row][at];
}

std::vector<std::string> words_in(const std::string& text) {
  std::istringstream words(text);
  std::vector<std::string> list;
  for (std::string word; words >> word;) list.push_back(word);
  return list;
}

/// A part of a build as a row with its position.
OrderRow row_of(const PartRequest& part, const CsvTable& parts, std::size_t number) {
  OrderRow row;
  row.path = part.path;
  row.fixed_mm = part.at_mm;
  row.rest_deg = {part.rotate_deg[0], part.rotate_deg[1]};
  row.turns = {std::llround(part.rotate_deg[2] * 1e6)};
  row.order = cell_of(parts, number, "order");
  row.customer = cell_of(parts, number, "customer");
  row.note = cell_of(parts, number, "note");
  row.serials = {cell_of(parts, number, "serial")};
  const std::string apart = cell_of(parts, number, "keep_apart_mm"), due = cell_of(parts, number, "due");
  std::from_chars(apart.data(), apart.data() + apart.size(), row.keep_apart_mm);
  row.due = days_of(due);
  row.material = cell_of(parts, number, "material");
  return row;
}

/// errors  kInput: the line is not that of the part
Status check_line(const std::string& list, const PartRequest& part, const CsvTable& parts, std::size_t number) {
  const auto is_at = [&](const char* column, double mm) {
    const std::string text = cell_of(parts, number, column);
    double value = 0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
    return error == std::errc() && std::abs(value - mm) < 1e-6;
  };
  const bool same =
      parts[number].size() == parts[0].size() && cell_of(parts, number, "file") == fs::path(part.path).filename().string() &&
      is_at("x_mm", (*part.at_mm)[0]) && is_at("y_mm", (*part.at_mm)[1]) && !cell_of(parts, number, "serial").empty();
  if (same) return {};
  return Error{Fault::kInput, fmt::format("{}:{}: is not part {} of plate.toml; undo the changes, or make the build anew", list,
                                          number + 1, number)};
}

/// The settings of a part apart from its file, position and rotation.
PartRequest settings_in(const PartRequest& part) {
  PartRequest settings = part;
  settings.path.clear();
  settings.named_at.clear();
  settings.at_mm.reset();
  settings.rotate_deg = {0, 0, 0};
  return settings;
}

std::string text_of_settings(const PartRequest& settings) {
  Job job;
  job.parts = {settings};
  return job_text(job, "");
}

}  // namespace

std::string whole_path(const std::string& folder) {
  std::error_code error;
  return fs::weakly_canonical(folder, error).string();
}

Result<WrittenBuild> read_build(const std::string& folder) {
  WrittenBuild build;
  const std::string plate = (fs::path(folder) / "plate.toml").string(), list = (fs::path(folder) / "parts.csv").string();
  std::error_code error;
  if (!fs::is_regular_file(plate, error))
    return usage("--into {}: has no plate.toml; name a directory that lamina nest has written, as week/build-1", folder);
  if (Status status = read_job(plate, build.job); !status) return status.error();
  const auto parts = read_csv(list);
  if (!parts) return parts.error();
  if (parts->size() != build.job.parts.size() + 1)
    return Error{Fault::kInput, fmt::format("{}: has {} parts, and plate.toml {}; make the build anew", list,
                                            parts->empty() ? 0 : parts->size() - 1, build.job.parts.size())};
  std::vector<PartRequest> settings;
  std::map<std::string, std::uint32_t> number;  // of each, by its text
  for (std::size_t i = 0; i < build.job.parts.size(); ++i) {
    const PartRequest& part = build.job.parts[i];
    if (!part.at_mm || part.copies != 1)
      return Error{Fault::kInput, fmt::format("{}: part {} has no position of its own; make the build anew", plate, i + 1)};
    if (Status status = check_line(list, part, *parts, i + 1); !status) return status.error();
    OrderRow row = row_of(part, *parts, i + 1);
    const PartRequest own = settings_in(part);
    const auto [known, fresh] = number.try_emplace(text_of_settings(own), static_cast<std::uint32_t>(settings.size()));
    if (fresh) settings.push_back(own);
    row.request = known->second;
    build.table.rows.push_back(std::move(row));
  }
  build.job.parts = std::move(settings);
  if (!build.table.rows.empty()) build.material = build.table.rows[0].material;
  std::ifstream keep_outs(fs::path(folder) / kKeepOutFile);
  for (std::string line; std::getline(keep_outs, line);) build.keep_outs.push_back(line);
  if (!fs::is_regular_file(orders_of(folder), error)) return build;
  const auto orders = read_csv(orders_of(folder).string());
  if (!orders) return orders.error();
  if (orders->empty() || std::ranges::find((*orders)[0], "serials") == (*orders)[0].end())
    return Error{Fault::kInput, fmt::format("{}: has no column serials; undo the changes", orders_of(folder).string())};
  for (std::size_t i = 1; i < orders->size(); ++i)
    for (std::string& serial : words_in(cell_of(*orders, i, "serials"))) build.table.serials.push_back(std::move(serial));
  return build;
}

namespace {

/// The orders of a folder with a build as it is now. orders  not empty
void add_to_orders(const std::string& folder, const OrderTable& table, std::size_t rows, const SerialNumbers& serials,
                   const NestPlan& plan, CsvTable& orders) {
  const std::string build = fs::path(whole_path(folder)).filename().string();
  const std::string number = build.starts_with("build-") ? build.substr(6) : build;
  const CsvTable made = orders_table(plan, table, serials);
  // Serial numbers to prices, of the build as it is now.
  std::map<std::string, std::string> price;
  std::string currency;
  for (const std::string& column : made[0])
    if (column.starts_with("price_each_")) currency = column.substr(11);
  for (std::size_t i = 1; i < made.size(); ++i) {
    const auto numbers = words_in(cell_of(made, i, "serials")), each = words_in(cell_of(made, i, "price_each_" + currency));
    for (std::size_t k = 0; k < numbers.size() && !each.empty(); ++k) price[numbers[k]] = each[std::min(k, each.size() - 1)];
  }
  const auto set = [&](std::size_t row, const std::string& column, const std::string& text) {
    const auto found = std::ranges::find(orders[0], column);
    const auto at = static_cast<std::size_t>(found - orders[0].begin());
    if (at < orders[row].size()) orders[row][at] = text;
  };
  for (std::size_t i = 1; i < orders.size(); ++i) {
    if (cell_of(orders, i, "build") != number || currency.empty()) continue;
    std::vector<std::int64_t> cents;
    for (const std::string& serial : words_in(cell_of(orders, i, "serials")))
      if (price.contains(serial)) cents.push_back(std::llround(std::stod(price[serial]) * 100));
    set(i, "price_" + currency, sum_price(cents));
    set(i, "price_each_" + currency, each_price(cents));
  }
  std::size_t line = 1 + rows;  // of the build's parts, each a row before the new ones
  for (; line < made.size(); ++line) {
    orders.emplace_back(orders[0].size());
    for (const std::string& column : made[0]) set(orders.size() - 1, column, cell_of(made, line, column));
    if (!cell_of(made, line, "build").empty()) set(orders.size() - 1, "build", number);
  }
}

}  // namespace

Status write_added(const NestOutput& output, const OrderTable& table, std::size_t rows, const Job& options, NestPlan& plan) {
  const fs::path whole = whole_path(output.directory), begun = whole / ".lamina-nest";
  const std::string title = whole.parent_path().filename().string() + ", " + whole.filename().string();
  const SerialNumbers serials = serial_numbers(table);
  std::error_code error;
  fs::remove_all(begun, error);  // of a killed run
  Status status = write_build(begun.string(), output, table, serials, options, title, plan, plan.builds[0]);
  std::optional<File> file;
  if (status && fs::is_regular_file(orders_of(output.directory), error)) {
    auto orders = read_csv(orders_of(output.directory).string());
    auto opened = orders ? File::open(orders_of(output.directory).string()) : Result<File>(orders.error());
    if (opened) {
      add_to_orders(output.directory, table, rows, serials, plan, *orders);
      file.emplace(std::move(*opened));
      status = file->append(cost::csv_text(*orders));
      if (status) status = file->flush();
    } else {
      status = opened.error();
    }
  }
  if (status) {
    error = replace_build(begun.string(), whole.string());
    if (error) status = Error{Fault::kOutput, fmt::format("{}: {}", output.directory, error.message())};
  }
  fs::remove_all(begun, error);
  if (!status || !file) return status;
  const auto written = file->finish();
  return written ? Status() : Status(written.error());
}

}  // namespace lamina::pipeline
