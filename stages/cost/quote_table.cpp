#include "stages/cost/quote_table.h"

#include <fmt/format.h>

#include <cmath>
#include <string_view>

#include "stages/support/text/readable.h"

namespace lamina::cost {
namespace {

/// A whole number of units, `digits` of which lie behind the point.
std::string decimal(std::int64_t amount, int digits) {
  std::int64_t unit = 1;
  for (int i = 0; i < digits; ++i) unit *= 10;
  return fmt::format("{}.{:0{}}", amount / unit, amount % unit, digits);
}

/// A spreadsheet takes a text that begins so for a formula; a file's name with ./ before it is the same file.
std::string name_of(const std::string& name) {
  const std::string line = one_line(name);
  return !line.empty() && std::string_view("=+-@").find(line[0]) != std::string_view::npos ? "./" + line : line;
}

/// The whole units of each part, and behind them their sum.
std::vector<std::int64_t> column(std::int64_t total, const std::vector<std::uint64_t>& weights) {
  std::vector<std::int64_t> units = shares(total, weights);
  units.push_back(total);
  return units;
}

}  // namespace

std::vector<std::vector<std::string>> quote_rows(const Quote& quote, const Machine::Cost& cost,
                                                 std::span<const QuotedPart> parts) {
  const Use& job = quote.job;
  std::vector<Use> uses = quote.parts;
  std::vector<std::uint64_t> time, bound, left;
  std::uint64_t copies = 0;
  for (const QuotedPart& part : parts) copies += part.copies;
  for (const Use& use : uses) {
    time.push_back(static_cast<std::uint64_t>(use.microseconds));
    bound.push_back(static_cast<std::uint64_t>(use.bound_nl));
    left.push_back(static_cast<std::uint64_t>(use.left_nl()));
  }
  uses.push_back(job);
  // Units of a ten thousandth of an hour, of a hundredth of a per cent, of a milligram: 1000 nl of 1 kg/l are one.
  const auto hours = column(std::llround(static_cast<double>(job.microseconds) / 3.6e5), time), percent = column(10'000, time);
  const auto bound_mg = column(std::llround(static_cast<double>(job.bound_nl) * cost.powder_kg_l * 1e-3), bound);
  const auto left_nl = column(job.left_nl(), left);
  const auto money = [&](std::int64_t cents) { return has_prices(cost) ? decimal(cents, 2) : std::string(); };
  const auto price = [&](const char* what) { return fmt::format("{}_{}", what, cost.currency); };

  std::vector<std::vector<std::string>> rows;
  rows.push_back({"part", "copies", "volume_mm3", "pixels", "drops", "binder_ml", "powder_fed_ml", "powder_bound_ml",
                  "powder_left_ml", "powder_bound_g", "hours", "hours_percent", price("cost_hours"), price("cost_binder"),
                  price("cost_powder"), price("cost")});
  for (std::size_t i = 0; i < uses.size(); ++i) {
    const Use& use = uses[i];
    const bool total = i == parts.size();
    rows.push_back({total ? "total" : name_of(parts[i].name), fmt::format("{}", total ? copies : parts[i].copies),
                    decimal(use.bound_nl, 3), fmt::format("{}", use.pixels), fmt::format("{}", use.drops),
                    decimal(use.binder_nl, 6), decimal(use.fed_nl, 6), decimal(use.bound_nl, 6), decimal(left_nl[i], 6),
                    cost.powder_kg_l > 0 ? decimal(bound_mg[i], 3) : "", decimal(hours[i], 4), decimal(percent[i], 2),
                    money(use.hour_cents), money(use.binder_cents), money(use.powder_cents), money(use.cents())});
  }
  return rows;
}

std::string csv_text(std::span<const std::vector<std::string>> rows) {
  std::string text;
  for (const std::vector<std::string>& row : rows) {
    for (std::size_t i = 0; i < row.size(); ++i) {
      if (i > 0) text += ',';
      if (row[i].find_first_of(",\"\r\n") == std::string::npos) {
        text += row[i];
        continue;
      }
      text += '"';
      for (const char c : row[i]) text += c == '"' ? std::string("\"\"") : std::string(1, c);
      text += '"';
    }
    text += "\r\n";
  }
  return text;
}

}  // namespace lamina::cost
