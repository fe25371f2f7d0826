#include "words.h"

#include <algorithm>
#include <array>
#include <functional>
#include <map>
#include <string_view>
#include <utility>

#include "pipeline/lamina.h"

namespace lamina::python {
namespace {

/// What options become that are arguments of functions here, or that no key has.
constexpr std::array<std::pair<std::string_view, std::string_view>, 5> kArguments = {{{"--overwrite", "overwrite=True"},
                                                                                      {"--resume", "resume=True"},
                                                                                      {"--material", "materials"},
                                                                                      {"--job", "job"},
                                                                                      {"-o", "output"}}};
/// Advice for the command line that is none here.
constexpr std::array<std::pair<std::string_view, std::string_view>, 1> kAdvice = {
    {{"neither TIFF nor PNG nor PBM (P4) nor BMP; plan the layer again",
      "neither TIFF nor PNG nor PBM (P4) nor BMP; name the image of a layer (lamina.load reads parts)"}}};

/// Keys by their option; an option of several products has several keys.
const std::map<std::string, std::string, std::less<>>& keys_by_option() {
  static const auto* const keys = [] {
    auto* made = new std::map<std::string, std::string, std::less<>>;
    for (const pipeline::KeyFacts& key : pipeline::key_facts()) {
      if (key.flag.empty()) continue;
      std::string& name = (*made)[key.flag];
      name += (name.empty() ? "'" : " or '") + key.name + "'";
    }
    for (const auto& [option, words] : kArguments) (*made)[std::string(option)] = words;
    return made;
  }();
  return *keys;
}

bool in_option(char c) { return (c >= 'a' && c <= 'z') || (c >= '0' && c <= '9') || c == '-'; }

}  // namespace

std::string in_python(const std::string& message) {
  std::string_view left = message;
  std::string text;
  char before = ' ';
  while (!left.empty()) {
    const bool begins = left.front() == '-' && (before == ' ' || before == '(' || before == '\'');
    std::size_t size = 0;
    while (begins && size < left.size() && in_option(left[size])) ++size;
    const auto known = keys_by_option().find(left.substr(0, size));
    if (begins && left.starts_with("--set ")) {
      size = 6;
    } else if (size > 1 && known != keys_by_option().end() && left.substr(size, 1) != ".") {
      text += known->second;
    } else {
      size = std::max<std::size_t>(size, 1);
      text += left.substr(0, size);
    }
    before = left[size - 1];
    left.remove_prefix(size);
  }
  for (const auto& [words, instead] : kAdvice) {
    const std::size_t at = text.find(words);
    if (at != std::string::npos) text.replace(at, words.size(), instead);
  }
  return text;
}

}  // namespace lamina::python
