// pipeline/job/profiles/sections.h: the sections and the machine name common to all kinds of profiles.
#pragma once

#include <fmt/format.h>

#include <span>
#include <string>
#include <string_view>

#include "pipeline/job/profiles/library.h"
#include "stages/support/text/json_text.h"
#include "stages/support/text/key.h"
#include "stages/support/text/readable.h"

namespace lamina::pipeline {

inline std::string read_name(std::string_view text, std::string& name) {
  name = one_line(text);
  return name.empty() ? "is empty; name the machine" : "";
}
inline std::string read_line(std::string_view text, std::string& line) { return line = one_line(text), std::string(); }
inline std::string same_text(const std::string& text) { return text; }

/// Reads every section of a profile's files, at least one. name  of the machine; required
/// errors  kUsage: place, key, reason
template <class Profile>
Status read_sections(const ProfileFiles& files, std::span<const Key<Profile>> keys, Profile& profile, const std::string& name) {
  for (const ProfileFile& file : files) {
    for (std::size_t i = 0; i < file.keys.value.size(); ++i) {
      const Status status = read_section(file.keys.value[i], file.keys.name[i], file.where, keys, profile);
      if (!status) return status;
    }
  }
  if (!name.empty()) return {};
  return Error{Fault::kUsage, fmt::format("{}: machine.name is missing; name the machine", files.back().where)};
}

}  // namespace lamina::pipeline
