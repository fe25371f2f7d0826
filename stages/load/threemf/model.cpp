#include "stages/load/threemf/model.h"

#include <algorithm>

namespace lamina::load {

std::uint32_t ModelPackage::file_of(const std::string& name) {
  const auto [found, is_new] = file_of_name.emplace(name, static_cast<std::uint32_t>(files.size()));
  if (is_new) files.push_back({name, 1});
  return found->second;
}

void ModelPackage::depart(std::string_view rule, std::string_view what) {
  auto at = std::find_if(departures.begin(), departures.end(), [&](const Departure& one) { return one.rule == rule; });
  if (at == departures.end()) at = departures.insert(at, {std::string(rule), std::string(what), 0});
  ++at->count;
}

}  // namespace lamina::load
