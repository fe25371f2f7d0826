#include "pipeline/nest/nest_tables.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <functional>
#include <numeric>
#include <set>

#include "pipeline/report/job_cost.h"
#include "stages/support/text/number_text.h"

namespace lamina::pipeline {
namespace {

namespace fs = std::filesystem;

using cost::money;

}  // namespace

std::string each_price(const std::vector<std::int64_t>& cents) {
  if (std::ranges::adjacent_find(cents, std::not_equal_to()) == cents.end()) return cents.empty() ? "" : money(cents[0]);
  std::string text;
  for (const std::int64_t each : cents) text += (text.empty() ? "" : " ") + money(each);
  return text;
}

std::string sum_price(const std::vector<std::int64_t>& cents) {
  return cents.empty() ? "" : money(std::accumulate(cents.begin(), cents.end(), std::int64_t{0}));
}

std::string currency_of(const NestPlan& plan) {
  for (const NestBuild& build : plan.builds)
    if (build.use && cost::has_prices(build.use->prices)) return build.use->prices.currency;
  return {};
}

std::map<std::pair<std::uint32_t, std::size_t>, RowInBuild> rows_in_builds(const NestPlan& plan) {
  std::map<std::pair<std::uint32_t, std::size_t>, RowInBuild> found;
  for (std::size_t b = 0; b < plan.builds.size(); ++b) {
    const NestBuild& build = plan.builds[b];
    for (std::size_t i = 0; i < build.copies.size(); ++i) {
      RowInBuild& row = found[{build.copies[i].row, b}];
      row.copies.push_back(build.copies[i].copy);
      if (build.use && cost::has_prices(build.use->prices)) row.cents.push_back(build.use->quote.parts[i].cents());
    }
  }
  return found;
}

SerialNumbers serial_numbers(const OrderTable& table) {
  std::set<std::string> used(table.serials.begin(), table.serials.end());
  for (const OrderRow& row : table.rows) used.insert(row.serials.begin(), row.serials.end());
  std::map<std::string, std::uint32_t> last;
  SerialNumbers serials;
  for (const OrderRow& row : table.rows) {
    serials.push_back(row.serials);
    std::string name = row.order.empty() ? fs::path(row.path).stem().string() : row.order;
    std::ranges::replace_if(
        name, [](unsigned char c) { return c <= ' '; }, '_');  // lists of serial numbers have spaces
    std::uint32_t& number = last[name];
    while (serials.back().size() < row.copies) {
      std::string serial = fmt::format("{}-{:03}", name, ++number);
      if (used.insert(serial).second) serials.back().push_back(std::move(serial));
    }
  }
  return serials;
}

CsvTable parts_table(const NestBuild& build, const OrderTable& table, const SerialNumbers& serials) {
  CsvTable csv{{"number", "serial", "order", "customer", "file", "x_mm", "y_mm", "turn_deg", "width_mm", "depth_mm",
                "height_mm", "due", "note", "material", "keep_apart_mm"}};
  const bool priced = build.use && cost::has_prices(build.use->prices);
  if (priced) csv[0].push_back("price_" + build.use->prices.currency);
  std::uint32_t number = 0;
  for (const NestedCopy& copy : build.copies) {
    const OrderRow& row = table.rows[copy.row];
    csv.push_back({fmt::format("{}", ++number), serials[copy.row][copy.copy], row.order, row.customer, file_name(row),
                   number_text(copy.x_mm), number_text(copy.y_mm), fmt::format("{:g}", static_cast<double>(copy.turn) * 1e-6),
                   fmt::format("{:.3f}", copy.width_mm), fmt::format("{:.3f}", copy.depth_mm),
                   fmt::format("{:.3f}", copy.height_mm), row.due ? date_text(*row.due) : "", row.note, build.material,
                   number_text(row.keep_apart_mm)});
    if (priced) csv.back().push_back(money(build.use->quote.parts[number - 1].cents()));
  }
  return csv;
}

CsvTable orders_table(const NestPlan& plan, const OrderTable& table, const SerialNumbers& serials) {
  CsvTable csv{{"order", "customer", "file", "copies", "build", "serials", "reason", "due", "priority", "material", "note"}};
  const std::string currency = currency_of(plan);
  if (!currency.empty()) csv[0].insert(csv[0].end(), {"price_" + currency, "price_each_" + currency});
  csv[0].insert(csv[0].end(), table.more_columns.begin(), table.more_columns.end());
  const auto add = [&](std::uint32_t number, std::size_t count, const std::string& build, const std::string& text,
                       const std::string& reason, const std::vector<std::int64_t>& cents) {
    const OrderRow& row = table.rows[number];
    csv.push_back({row.order, row.customer, file_name(row), fmt::format("{}", count), build, text, reason,
                   row.due ? date_text(*row.due) : "", fmt::format("{}", row.priority), row.material, row.note});
    if (!currency.empty()) {
      csv.back().push_back(sum_price(cents));
      csv.back().push_back(each_price(cents));
    }
    csv.back().insert(csv.back().end(), row.more.begin(), row.more.end());
  };
  for (const auto& [of, found] : rows_in_builds(plan)) {
    std::string text;
    for (const std::uint32_t copy : found.copies) text += (text.empty() ? "" : " ") + serials[of.first][copy];
    add(of.first, found.copies.size(), fmt::format("{}", of.second + 1), text, "", found.cents);
  }
  for (const LeftOut& left : plan.left_out) add(left.row, left.copies, "", "", left.reason, {});
  return csv;
}

}  // namespace lamina::pipeline
