#include "pipeline/machine/profiles.h"

#include <fmt/format.h>

#include <algorithm>
#include <vector>

#include "pipeline/job/decisions.h"
#include "stages/data/input/file_reader.h"
#include "stages/data/text/json_text.h"
#include "stages/data/text/names.h"
#include "stages/data/text/readable.h"
#include "stages/segment/calibration.h"
#include "stages/write/program/dialect.h"

namespace lamina::pipeline {
namespace {

/// Reads a shipped profile or a file. unknown(suggestion, names)  makes the error for an unknown name
template <class Profile, class Unknown>
Result<Profile> find(const std::string& name_or_file, std::span<const ShippedProfile> shipped,
                     Result<Profile> (*read)(std::string_view, const std::string&), const Unknown& unknown) {
  if (name_or_file.find('/') == std::string::npos && !name_or_file.ends_with(".toml")) {
    for (const auto& [name, text] : shipped) {
      if (name == name_or_file) return read(text, std::string(name) + ".toml");
    }
    const std::vector<std::string_view> names = names_of(shipped);
    return Error{Fault::kUsage, unknown(suggest(name_or_file, names), fmt::format("{}", fmt::join(names, ", ")))};
  }
  const auto text =
      read_file(name_or_file,
                {.fault = Fault::kUsage, .missing = "no such machine profile", .most_bytes = kMostTomlBytes, .streams = true});
  return text ? read(*text, name_or_file) : Result<Profile>(text.error());
}

bool is_one_of(std::span<const ShippedProfile> shipped, std::string_view name) {
  return std::ranges::find(shipped, name, &ShippedProfile::name) != shipped.end();
}

/// Whether a profile has a section.
bool has_section(std::string_view text, std::string_view section) {
  return text.starts_with(section) || text.find(fmt::format("\n{}", section)) != std::string_view::npos;
}

}  // namespace

std::vector<std::string_view> names_of(std::span<const ShippedProfile> profiles) {
  std::vector<std::string_view> names;
  for (const ShippedProfile& profile : profiles) names.push_back(profile.name);
  return names;
}

Result<Machine> read_machine(std::string_view text, const std::string& where) {
  if (has_section(text, "[material]") && !has_section(text, "[head]")) {
    const auto other = read_extruder(text, where);
    return Error{Fault::kUsage,
                 other ? where + ": is the profile of an extrusion printer; lamina extrude takes it" : other.error().message};
  }
  count(Decision::kMachine);
  std::vector<std::string_view> dialects;
  for (const auto& dialect : write::dialects()) dialects.push_back(dialect.id);
  return read::read_machine(text, where, dialects);
}

Result<ExtruderProfile> read_extruder(std::string_view text, const std::string& where) {
  if (has_section(text, "[head]") && !has_section(text, "[material]")) {
    return Error{Fault::kUsage, where + ": is the profile of a powder printer; lamina jet takes it"};
  }
  count(Decision::kMachine);
  auto profile = read::read_extruder(text, where, {.machine = {}, .calibration = segment::anet_a8_calibration()});
  if (!profile) return profile;
  if (const Status status = segment::check(profile->calibration); !status) {
    return Error{Fault::kUsage, fmt::format("{}: calibration.{}", where, status.error().message)};
  }
  return profile;
}

Result<Machine> find_machine(const std::string& name_or_file) {
  return find(name_or_file, shipped_machines(), read_machine, [&](const std::string& near, const std::string& names) {
    if (is_one_of(shipped_extruders(), name_or_file))
      return fmt::format("'{}' is an extrusion printer, of lamina extrude; name a profile or one of {}", name_or_file, names);
    return fmt::format("no machine '{}'; name a profile (a file that ends in .toml) or one of {}{}", name_or_file, names, near);
  });
}

Result<ExtruderProfile> find_extruder(const std::string& name_or_file) {
  return find(name_or_file, shipped_extruders(), read_extruder, [&](const std::string& near, const std::string& names) {
    if (is_one_of(shipped_machines(), name_or_file))
      return fmt::format("'{}' is a powder printer, of lamina jet; name a profile or one of {}", name_or_file, names);
    return fmt::format("no extrusion printer '{}'{}; name a profile (a file that ends in .toml) or one of {}",
                       one_line(name_or_file), near, names);
  });
}

Result<bool> names_extruder(const std::string& name_or_file) {
  if (is_one_of(shipped_extruders(), name_or_file)) return true;
  if (is_one_of(shipped_machines(), name_or_file)) return false;
  if (name_or_file.find('/') == std::string::npos && !name_or_file.ends_with(".toml")) {
    std::vector<std::string_view> names = names_of(shipped_extruders());
    for (const std::string_view name : names_of(shipped_machines())) names.push_back(name);
    return Error{Fault::kUsage, fmt::format("no machine '{}'{}; name a profile (a file that ends in .toml) or one of {}",
                                            one_line(name_or_file), suggest(name_or_file, names), fmt::join(names, ", "))};
  }
  const auto text =
      read_file(name_or_file, {.fault = Fault::kUsage, .missing = "no such machine profile", .most_bytes = kMostTomlBytes});
  if (!text) return text.error();
  return !has_section(*text, "[head]") || has_section(*text, "[material]");
}

}  // namespace lamina::pipeline
