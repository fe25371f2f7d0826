#include "stages/cost/account.h"

#include <nlohmann/json.hpp>

#include "stages/cost/told.h"

namespace lamina::cost {
namespace {

std::vector<QuotedPart> named(std::span<const PartSummary> parts, bool apart, const std::string& title) {
  std::vector<QuotedPart> named;
  if (!apart) named.push_back({title, 0});
  for (const PartSummary& part : parts) {
    if (apart) named.push_back({part.path, 0});
    named.back().copies += part.copies;
  }
  return named;
}

}  // namespace

Account::Account(const Machine& machine, const PixelGrid& grid, std::span<const PartSummary> parts, bool apart,
                 const std::string& title)
    : machine_(machine), parts_(named(parts, apart, title)), tally_(machine_, grid, parts_.size()) {}

void Account::tell(std::vector<std::pair<std::string, std::string>>& lines, nlohmann::ordered_json& use, Rows& rows) const {
  const Quote quote = tally_.quote();
  for (auto& line : lines_of(quote, machine_.cost, parts_)) lines.push_back(std::move(line));
  use = json_of(quote, machine_.cost, parts_);
  rows = quote_rows(quote, machine_.cost, parts_);
}

}  // namespace lamina::cost
