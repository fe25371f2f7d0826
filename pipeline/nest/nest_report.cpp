#include "pipeline/nest/nest_report.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <map>
#include <numeric>
#include <tuple>
#include <utility>
#include <vector>

#include "pipeline/nest/nest_tables.h"
#include "pipeline/report/job_cost.h"
#include "stages/support/text/readable.h"

namespace lamina::pipeline {
namespace {

using cost::money;

std::uint64_t copies_of(const std::vector<OrderRow>& rows) {
  std::uint64_t sum = 0;
  for (const OrderRow& row : rows) sum += row.copies;
  return sum;
}

/// "960 layers, 12.30 h, 1.234 l of powder dosed, 12.3 ml of binder; 645.20 EUR: hours 202.00, binder ..".
std::string use_text(const BuildUse& build) {
  const cost::Use& job = build.quote.job;
  std::string text =
      fmt::format("{} layers, about {:.2f} h, {:.2f} l of powder dosed, {:.2f} l left over, {:.1f} ml of binder", build.layers,
                  static_cast<double>(job.microseconds) / 3.6e9, static_cast<double>(job.fed_nl) * 1e-9,
                  static_cast<double>(job.left_nl()) * 1e-9, static_cast<double>(job.binder_nl) * 1e-6);
  if (cost::has_prices(build.prices))
    text += fmt::format("; {} {}: hours {}, binder {}, powder {}", money(job.cents()), build.prices.currency,
                        money(job.hour_cents), money(job.binder_cents), money(job.powder_cents));
  return text;
}

std::string name_of(const NestBuild& build, std::size_t number) {
  return build.name.empty() ? fmt::format("build {}", number + 1) : build.name;
}

/// Parts over bed x height. plan  of a machine with a height
double powder_share(const NestPlan& plan, const NestBuild& build) {
  return build.volume_mm3 / (plan.box_mm3 / plan.box_height_mm * build.height_mm);
}

}  // namespace

Summary::Lines nest_lines(const NestPlan& plan, const OrderTable& table) {
  Summary::Lines lines;
  lines.emplace_back("parts", fmt::format("{} of {} row{}, {} kind{}", readable_count(copies_of(table.rows)), table.rows.size(),
                                          table.rows.size() == 1 ? "" : "s", plan.kinds, plan.kinds == 1 ? "" : "s"));
  for (std::size_t b = 0; b < plan.builds.size(); ++b) {
    const NestBuild& build = plan.builds[b];
    lines.emplace_back(
        name_of(build, b),
        fmt::format("{} part{}{}, {:.1f} % of the bed, {:.3f} mm high, {:.3f} cm3{}", readable_count(build.copies.size()),
                    build.copies.size() == 1 ? "" : "s", build.material.empty() ? "" : " of " + one_line(build.material),
                    100 * build.area_mm2 / plan.bed_mm2, build.height_mm, build.volume_mm3 / 1000,
                    plan.box_mm3 > 0 ? fmt::format(", {:.1f} % of its powder, {:.2f} % of the box",
                                                   100 * powder_share(plan, build), 100 * build.volume_mm3 / plan.box_mm3)
                                     : ""));
    if (build.use) lines.emplace_back("", use_text(*build.use));
  }
  std::ranges::move(left_lines(plan, table), std::back_inserter(lines));
  return lines;
}

Summary::Lines left_lines(const NestPlan& plan, const OrderTable& table) {
  Summary::Lines lines;
  for (const LeftOut& left : plan.left_out)
    lines.emplace_back("left out", fmt::format("{} of {}: {}", readable_count(left.copies),
                                               one_line(file_name(table.rows[left.row])), left.reason));
  return lines;
}

Summary::Lines price_lines(const NestPlan& plan, const OrderTable& table) {
  std::map<std::tuple<std::string, std::string, std::size_t>, std::vector<std::int64_t>> cents;  // order, file, build
  for (const auto& [of, found] : rows_in_builds(plan)) {
    const OrderRow& row = table.rows[of.first];
    std::vector<std::int64_t>& all = cents[{row.order, file_name(row), of.second}];
    all.insert(all.end(), found.cents.begin(), found.cents.end());
  }
  Summary::Lines lines;
  for (const auto& [of, all] : cents) {
    if (all.empty()) continue;
    const auto& [order, file, b] = of;
    const auto [low, high] = std::ranges::minmax(all);
    lines.emplace_back(lines.empty() ? "prices" : "",
                       fmt::format("{}{}: {} in {}, {}{} {} each", order.empty() ? "" : one_line(order) + ", ", one_line(file),
                                   readable_count(all.size()), name_of(plan.builds[b], b), money(low),
                                   low < high ? " to " + money(high) : "", plan.builds[b].use->prices.currency));
  }
  if (lines.empty()) lines.emplace_back("prices", "none: the machine and its presets name no [cost]");
  return lines;
}

namespace {

/// Hundredths that a copy of each row costs at a density.
std::map<std::uint32_t, std::int64_t> density_cents(const NestPlan& plan, double percent) {
  std::map<std::uint32_t, std::int64_t> prices_of;
  cost::Use all;
  double height_mm = 0, volume_mm3 = 0;
  const Machine::Cost* prices = nullptr;
  for (const NestBuild& build : plan.builds) {
    if (!build.use || !cost::has_prices(build.use->prices)) continue;
    const cost::Use& job = build.use->quote.job;
    all.hour_cents += job.hour_cents, all.binder_cents += job.binder_cents;
    all.fed_nl += job.fed_nl, all.bound_nl += job.bound_nl;
    height_mm += build.height_mm, volume_mm3 += build.volume_mm3;
    prices = &build.use->prices;
  }
  if (prices == nullptr || volume_mm3 == 0) return prices_of;
  const double area_mm2 = plan.box_mm3 > 0 ? plan.box_mm3 / plan.box_height_mm : plan.bed_mm2;
  std::map<std::uint32_t, const NestedCopy*> first;  // copy of each row
  for (const NestBuild& build : plan.builds)
    for (const NestedCopy& copy : build.copies) first.try_emplace(copy.row, &copy);
  for (const auto& [row, copy] : first) {
    const double volume = plan.volumes_mm3[copy->sections], share = volume / volume_mm3;
    const double heights = volume / (area_mm2 * percent / 100) / height_mm;  // of those of all builds
    const double bound_nl = static_cast<double>(all.bound_nl) * share;
    const double left_nl = std::max(0.0, static_cast<double>(all.fed_nl) * heights - bound_nl);
    const double cents = static_cast<double>(all.hour_cents) * heights + static_cast<double>(all.binder_cents) * share +
                         100 * cost::powder_price_l(*prices) * (bound_nl + left_nl * (1 - prices->powder_reuse)) * 1e-9;
    prices_of[row] = std::llround(cents);
  }
  return prices_of;
}

}  // namespace

Summary::Lines density_lines(const NestPlan& plan, const OrderTable& table, double percent) {
  Summary::Lines lines;
  for (const auto& [row, cents] : density_cents(plan, percent)) {
    const OrderRow& own = table.rows[row];
    lines.emplace_back(lines.empty() ? fmt::format("at {:g} %", percent) : "",
                       fmt::format("{}{}: {} {} each", own.order.empty() ? "" : one_line(own.order) + ", ",
                                   one_line(file_name(own)), money(cents), currency_of(plan)));
  }
  return lines;
}

Json nest_json(const NestPlan& plan, const OrderTable& table, double density) {
  Json builds = Json::array(), left = Json::array(), prices = Json::array();
  for (const NestBuild& build : plan.builds) {
    builds.push_back({{"parts", build.copies.size()},
                      {"material", build.material},
                      {"bed_fraction", build.area_mm2 / plan.bed_mm2},
                      {"height_mm", build.height_mm},
                      {"volume_mm3", build.volume_mm3}});
    if (plan.box_mm3 > 0) {
      builds.back()["box_fraction"] = build.volume_mm3 / plan.box_mm3;
      builds.back()["powder_fraction"] = powder_share(plan, build);
    }
    if (!build.use) continue;
    builds.back()["layers"] = build.use->layers;
    builds.back()["use"] = cost::json_of(build.use->quote, build.use->prices, {});
  }
  for (const auto& [of, found] : rows_in_builds(plan)) {
    if (found.cents.empty()) continue;
    const std::int64_t sum = std::accumulate(found.cents.begin(), found.cents.end(), std::int64_t{0});
    prices.push_back({{"row", of.first + 1},
                      {"order", table.rows[of.first].order},
                      {"file", table.rows[of.first].path},
                      {"build", name_of(plan.builds[of.second], of.second)},
                      {"copies", found.copies.size()},
                      {"price", static_cast<double>(sum) / 100}});
  }
  for (const LeftOut& each : plan.left_out)
    left.push_back(
        {{"row", each.row + 1}, {"file", table.rows[each.row].path}, {"copies", each.copies}, {"reason", each.reason}});
  Json at_density = Json::array();
  if (density > 0) {
    for (const auto& [row, cents] : density_cents(plan, density))
      at_density.push_back(
          {{"row", row + 1}, {"file", table.rows[row].path}, {"price_each", static_cast<double>(cents) / 100}});
  }
  return {{"command", "nest"},
          {"rows", table.rows.size()},
          {"copies", copies_of(table.rows)},
          {"kinds", plan.kinds},
          {"builds", builds},
          {"left_out", left},
          {"prices", prices},
          {"prices_at_density", at_density}};
}

}  // namespace lamina::pipeline
