#include "pipeline/report/job_cost.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <map>
#include <set>
#include <string_view>

#include "stages/support/text/readable.h"

namespace lamina::cost {
namespace {

double ml(std::int64_t nl) { return static_cast<double>(nl) * 1e-6; }
double mm3(std::int64_t nl) { return static_cast<double>(nl) / 1e3; }
double hours(const Use& use) { return static_cast<double>(use.microseconds) / 3.6e9; }

Json use_json(const Use& use, const Machine::Cost& cost) {
  Json json = {{"set_pixels", use.pixels},
               {"drops", use.drops},
               {"print_seconds", static_cast<double>(use.microseconds) / 1e6},
               {"binder_mm3", mm3(use.binder_nl)},
               {"powder_fed_mm3", mm3(use.fed_nl)},
               {"powder_bound_mm3", mm3(use.bound_nl)},
               {"powder_left_mm3", mm3(use.left_nl())}};
  if (!has_prices(cost)) return json;
  json["cost"] = static_cast<double>(use.cents()) / 100;
  json["cost_time"] = static_cast<double>(use.hour_cents) / 100;
  json["cost_binder"] = static_cast<double>(use.binder_cents) / 100;
  json["cost_powder"] = static_cast<double>(use.powder_cents) / 100;
  return json;
}

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

std::string money(std::int64_t cents) { return fmt::format("{}.{:02}", cents / 100, cents % 100); }

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

Json json_of(const Quote& quote, const Machine::Cost& cost, std::span<const QuotedPart> parts) {
  Json json = use_json(quote.job, cost);
  if (has_prices(cost)) json["currency"] = cost.currency;
  if (!has_prices(cost) && parts.size() < 2) return json;
  if (parts.size() > 1) json["unknown_layers"] = quote.unknown_layers;
  for (std::size_t p = 0; p < parts.size(); ++p) {
    Json& part = json["parts"].emplace_back();
    part = {{"path", parts[p].name}};
    part.update(use_json(quote.parts[p], cost));
  }
  return json;
}

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

namespace lamina::pipeline {
namespace {

/// Parts by the names of their files, as manifests have them; the second a.stl is a.stl (2).
std::vector<cost::QuotedPart> named(const std::vector<PartSummary>& parts, bool apart) {
  std::vector<cost::QuotedPart> named;
  if (!apart) named.push_back({title_of(parts), 0});
  std::map<std::string, std::uint32_t> last;
  std::set<std::string> taken;
  for (const PartSummary& part : parts) {
    if (apart) {
      const std::string file = std::filesystem::path(part.path).filename().string();
      std::string name = file;
      std::uint32_t& number = last.try_emplace(file, 1).first->second;
      while (taken.contains(name)) name = fmt::format("{} ({})", file, ++number);
      taken.insert(name);
      named.push_back({std::move(name), 0});
    }
    named.back().copies += part.copies;
  }
  return named;
}

bool separates_parts(const Plan& plan) { return plan.job.quote || cost::has_prices(plan.images->machine->machine.cost); }

}  // namespace

std::size_t reported_parts(const Plan& plan) { return separates_parts(plan) ? plan.scene->parts.size() : 1; }

JobCost::JobCost(const Machine& machine, const PixelGrid& grid, const std::vector<PartSummary>& parts, bool separates)
    : machine_(machine), parts_(named(parts, separates)), tally_(machine_, grid, parts_.size()) {}

JobCost::JobCost(const Machine& machine, const Manifest& manifest)
    : JobCost(machine, manifest.head.grid, manifest.head.parts,
              std::ranges::any_of(manifest.layers, [](const LayerRecord& record) { return !record.part_pixels.empty(); })) {
  drop_pl_ = machine.head.drop_pl;
  for (const JobMaterial& material : manifest.head.materials) {
    if (manifest.head.max_drops > 0) powders_.push_back({material.name});
  }
}

JobCost::JobCost(const Plan& plan)
    : JobCost(plan.images->machine->machine, plan.images->grid, plan.scene->parts, separates_parts(plan)) {}

void JobCost::add(const LayerRecord& record, std::uint64_t drops, std::int64_t microseconds) {
  if (record.layer.index == 0) tally_.add_base();
  tally_.add(record.layer.thickness, microseconds, drops, record.filled_pixels(), record.part_pixels, record.part_drops);
  for (std::size_t m = 0; m < powders_.size(); ++m)
    powders_[m].add(record.image_of(m, powders_.size()).set_pixels, record.drops_of(m, powders_.size()));
}

void JobCost::report(Summary& summary) const {
  Json& use = summary.facts["use"];
  const cost::Quote quote = tally_.quote();
  for (auto& line : cost::lines_of(quote, machine_.cost, parts_)) summary.results.push_back(std::move(line));
  use = cost::json_of(quote, machine_.cost, parts_);
  summary.quote = cost::quote_rows(quote, machine_.cost, parts_);
  for (const PowderDrops& powder : powders_) {
    summary.results.emplace_back("", powder_text(powder, drop_pl_));
    use["materials"].push_back(powder_json(powder, drop_pl_));
  }
}

}  // namespace lamina::pipeline
