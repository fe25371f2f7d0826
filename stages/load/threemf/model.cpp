#include "stages/load/threemf/model.h"

#include <algorithm>
#include <iterator>

#include "stages/load/threemf/roles.h"

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

namespace {

constexpr std::string_view kWellKnown[] = {"Title",  "Designer",     "Description",      "Copyright",  "LicenseTerms",
                                           "Rating", "CreationDate", "ModificationDate", "Application"};
constexpr std::size_t kMaxRemembered = 4096, kLongest = 64;
constexpr std::string_view kCura = "cura:";

}  // namespace

std::string Metadata::begin(const XmlReader& reader, XmlAttributes attributes, ModelPackage& package) {
  while (*attributes != nullptr && std::string_view(attributes[0]) != "name") attributes += 2;
  if (*attributes == nullptr) return "<metadata> without a name, which 3MF requires (core 3.4.1); export it again";
  name_ = attributes[1];
  text_.clear();
  const std::size_t colon = name_.find(':');
  if (colon == name_.npos && std::find(std::begin(kWellKnown), std::end(kWellKnown), name_) == std::end(kWellKnown))
    package.depart("metadata of a name that is neither of 3MF nor of a namespace (core 3.4.1)", name_);
  if (colon != name_.npos && !reader.attribute_name(name_).declared)
    package.depart("metadata whose name has a prefix that is not declared (core 3.4.1)", name_);
  if (names_.size() < kMaxRemembered && !names_.insert(name_).second)
    package.depart("metadata of one name twice (core 3.4.1)", name_);
  return {};
}

void Metadata::begin_setting(XmlAttributes attributes) {
  while (*attributes != nullptr && std::string_view(attributes[0]) != "key") attributes += 2;
  name_ = kCura;
  text_.clear();
  if (*attributes != nullptr) name_ += attributes[1];
}

void Metadata::text(std::string_view piece) { text_ += piece.substr(0, kLongest - std::min(kLongest, text_.size())); }

void Metadata::end(ModelObject* object) {
  std::string_view key = name_;
  if (object == nullptr || !key.starts_with(kCura)) return;
  while (key.starts_with(kCura)) key.remove_prefix(kCura.size());
  apply_cura_setting(key, text_, *object);
}

}  // namespace lamina::load
