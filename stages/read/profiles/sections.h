// stages/read/profiles/sections.h: the sections and the machine name common to all kinds of profiles.
#pragma once

#include <fmt/format.h>

#include <span>
#include <string>
#include <string_view>

#include "stages/data/text/json_text.h"
#include "stages/data/text/key.h"
#include "stages/data/text/readable.h"

namespace lamina::read {

inline std::string read_name(std::string_view text, std::string& name) {
  name = one_line(text);
  return name.empty() ? "is empty; name the machine" : "";
}
inline std::string read_line(std::string_view text, std::string& line) { return line = one_line(text), std::string(); }
inline std::string same_text(const std::string& text) { return text; }

/// Reads every section of a file. name  of the machine; required
/// errors  kUsage: place, key, reason
template <class Profile>
Status read_sections(const TomlValue& file, const std::string& where, std::span<const Key<Profile>> keys, Profile& profile,
                     const std::string& name) {
  for (std::size_t i = 0; i < file.value.size(); ++i) {
    if (Status status = read_section(file.value[i], file.name[i], where, keys, profile); !status) return status;
  }
  if (!name.empty()) return {};
  return Error{Fault::kUsage, fmt::format("{}: machine.name is missing; name the machine", where)};
}

}  // namespace lamina::read
