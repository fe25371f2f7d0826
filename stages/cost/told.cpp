#include "stages/cost/told.h"

#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "stages/support/text/readable.h"

namespace lamina::cost {
namespace {

double ml(std::int64_t nl) { return static_cast<double>(nl) * 1e-6; }
double litres(std::int64_t nl) { return static_cast<double>(nl) * 1e-9; }
double hours(const Use& use) { return static_cast<double>(use.microseconds) / 3.6e9; }
std::string money(std::int64_t cents) { return fmt::format("{}.{:02}", cents / 100, cents % 100); }

nlohmann::ordered_json use_json(const Use& use, const Machine::Cost& cost) {
  nlohmann::ordered_json json = {{"set_pixels", use.pixels},
                                 {"drops", use.drops},
                                 {"hours", hours(use)},
                                 {"binder_l", litres(use.binder_nl)},
                                 {"powder_fed_l", litres(use.fed_nl)},
                                 {"powder_bound_l", litres(use.bound_nl)},
                                 {"powder_left_l", litres(use.left_nl())}};
  if (!has_prices(cost)) return json;
  json["cost"] = static_cast<double>(use.cents()) / 100;
  json["cost_hours"] = static_cast<double>(use.hour_cents) / 100;
  json["cost_binder"] = static_cast<double>(use.binder_cents) / 100;
  json["cost_powder"] = static_cast<double>(use.powder_cents) / 100;
  return json;
}

}  // namespace

std::vector<std::pair<std::string, std::string>> lines_of(const Quote& quote, const Machine::Cost& cost,
                                                          std::span<const QuotedPart> parts) {
  std::vector<std::pair<std::string, std::string>> lines;
  const Use& job = quote.job;
  lines.emplace_back("material", fmt::format("{:.3f} ml of binder{}, {:.2f} ml of powder dosed: {:.2f} bound, {:.2f} left over",
                                             ml(job.binder_nl), cost.spit_drops > 0 ? " with cost.spit_drops" : "",
                                             ml(job.fed_nl), ml(job.bound_nl), ml(job.left_nl())));
  const auto text = [&](const Use& use) {
    return fmt::format("{} {}: {:.2f} h {}, binder {}, powder {}", money(use.cents()), cost.currency, hours(use),
                       money(use.hour_cents), money(use.binder_cents), money(use.powder_cents));
  };
  if (has_prices(cost)) lines.emplace_back("cost", text(job));
  if (parts.size() < 2) return lines;
  for (std::size_t p = 0; has_prices(cost) && p < parts.size(); ++p) {
    lines.emplace_back("", fmt::format("{}: {}", one_line(parts[p].name), text(quote.parts[p])));
  }
  if (quote.unknown_layers > 0) {
    lines.emplace_back("",
                       fmt::format("{} layers do not say whose their pixels are; the parts share them as they do the others",
                                   quote.unknown_layers));
  }
  return lines;
}

nlohmann::ordered_json json_of(const Quote& quote, const Machine::Cost& cost, std::span<const QuotedPart> parts) {
  nlohmann::ordered_json json = use_json(quote.job, cost);
  if (has_prices(cost)) json["currency"] = cost.currency;
  if (!has_prices(cost) && parts.size() < 2) return json;
  if (parts.size() > 1) json["unknown_layers"] = quote.unknown_layers;
  for (std::size_t p = 0; p < parts.size(); ++p) {
    nlohmann::ordered_json& part = json["parts"].emplace_back();
    part = {{"path", parts[p].name}};
    part.update(use_json(quote.parts[p], cost));
  }
  return json;
}

}  // namespace lamina::cost
