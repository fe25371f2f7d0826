#include "stages/support/text/key.h"

#include "stages/support/text/json_text.h"
#include "stages/support/text/names.h"

namespace lamina {

namespace {

/// Keys that have another name now.
constexpr std::string_view kRenamed[][3] = {{"fill", "by_height", "range"},
                                            {"segment", "by_height", "range"},
                                            {"part", "material_by_height", "material_range"},
                                            {"extrude", "set", "machine"}};

}  // namespace

std::string no_such_key(std::string_view section, std::string_view name, std::span<const std::string_view> names) {
  for (const auto& [of, old, now] : kRenamed) {
    if (of == section && old == name) return fmt::format("is now {}.{}; see docs/job.md", section, now);
  }
  const std::string near = suggest(name, names);
  return near.empty() ? fmt::format("no such key; [{}] has {}", section, fmt::join(names, ", "))
                      : fmt::format("no such key{}", near);
}

std::string no_such_section(std::string_view section, std::span<const std::string_view> names) {
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
