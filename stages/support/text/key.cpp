#include "stages/support/text/key.h"

#include "stages/support/text/json_text.h"
#include "stages/support/text/readable.h"
#include "stages/support/text/renamed_keys.h"

namespace lamina {

std::string no_such_key(std::string_view section, std::string_view name, std::span<const std::string_view> names) {
  for (const auto& [of, old, now] : kRenamedKeys) {
    if (of == section && old == name) return fmt::format("is now {}; see docs/job.md", now);
  }
  const std::string near = suggest(name, names);
  return near.empty() ? fmt::format("no such key; [{}] has {}", section, fmt::join(names, ", "))
                      : fmt::format("no such key{}", near);
}

std::string no_such_section(std::string_view section, std::span<const std::string_view> names) {
  for (const auto& [of, old, now] : kRenamedKeys) {
    if (of == section && old.empty()) return fmt::format("is now [{}]; see docs/job.md", now);
  }
  const std::string near = suggest(section, names);
  return near.empty() ? fmt::format("no such section; there are {}", fmt::join(names, ", "))
                      : fmt::format("no such section{}", near);
}

std::string key_line(std::string_view name, Form form, std::string_view text) {
  if (form == Form::kString) return fmt::format("{} = {}", name, toml_string(text));
  if (form == Form::kBare || form == Form::kToml) return fmt::format("{} = {}", name, text);
  std::string list;
  for (const std::string_view piece : text.empty() ? std::vector<std::string_view>() : split(text, ",")) {
    list += (list.empty() ? "" : ", ") + (form == Form::kStrings ? toml_string(piece) : std::string(piece));
  }
  return fmt::format("{} = [{}]", name, list);
}

}  // namespace lamina
