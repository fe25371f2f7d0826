#include "stages/cost/account.h"

#include <fmt/format.h>

#include <cstdint>
#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>
#include <set>

#include "stages/cost/told.h"

namespace lamina::cost {
namespace {

/// Parts by the names of their files, as manifests have them; the second a.stl is a.stl (2).
std::vector<QuotedPart> named(std::span<const PartSummary> parts, bool apart, const std::string& title) {
  std::vector<QuotedPart> named;
  if (!apart) named.push_back({title, 0});
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
