#include "pipeline/machine/profiles.h"

#include <fmt/format.h>

#include <algorithm>
#include <vector>

#include "pipeline/job/decisions.h"
#include "stages/program/dialect.h"
#include "stages/segment/calibration.h"
#include "stages/support/text/json_text.h"
#include "stages/support/text/names.h"
#include "stages/support/text/readable.h"

namespace lamina::pipeline {
namespace {

/// The files of a profile, shipped or the user's. unknown(suggestion, names)  makes the error for an unknown name
template <class Unknown>
Result<read::ProfileFiles> find(const std::string& name_or_file, std::span<const ShippedProfile> shipped,
                                const Unknown& unknown) {
  const read::Library library = profile_library();
  std::vector<std::string_view> names = names_of(shipped);
  if (!read::is_profile_path(name_or_file) && std::ranges::find(names, name_or_file) == names.end() &&
      !library.is_own(name_or_file)) {
    const std::vector<std::string> own = library.own_names();
    names.insert(names.end(), own.begin(), own.end());
    return Error{Fault::kUsage, unknown(suggest(name_or_file, names), fmt::format("{}", fmt::join(names, ", ")))};
  }
  read::ProfileFiles files;
  const Status status = library.add(name_or_file, files);
  return status ? Result<read::ProfileFiles>(std::move(files)) : status.error();
}

bool is_one_of(std::span<const ShippedProfile> shipped, std::string_view name) {
  return std::ranges::find(shipped, name, &ShippedProfile::name) != shipped.end();
}

Result<ExtruderProfile> extruder_of(const read::ProfileFiles& files) {
  if (have_section(files, "head") && !have_section(files, "material"))
    return Error{Fault::kUsage, files.back().where + ": is the profile of a powder printer; lamina jet takes it"};
  count(Decision::kMachine);
  auto profile = read::read_extruder(files, {.machine = {}, .calibration = segment::anet_a8_calibration()});
  if (!profile) return profile;
  if (const Status status = segment::check(profile->calibration); !status) {
    return Error{Fault::kUsage, fmt::format("{}: calibration.{}", files.back().where, status.error().message)};
  }
  return profile;
}

}  // namespace

read::Library profile_library() {
  std::vector<ShippedProfile> all;
  for (const auto shipped : {shipped_machines(), shipped_presets(), shipped_extruders()})
    all.insert(all.end(), shipped.begin(), shipped.end());
  return {std::move(all), read::profile_folder()};
}

Result<Machine> read_machine(const read::ProfileFiles& files) {
  if (have_section(files, "material") && !have_section(files, "head")) {
    const auto other = extruder_of(files);
    return Error{Fault::kUsage, other ? files.back().where + ": is the profile of an extrusion printer; lamina extrude takes it"
                                      : other.error().message};
  }
  count(Decision::kMachine);
  std::vector<std::string_view> dialects;
  for (const auto& dialect : write::dialects()) dialects.push_back(dialect.id);
  return read::read_machine(files, dialects);
}

Result<Machine> read_machine(std::string_view text, const std::string& where) {
  auto keys = read_toml(text, where);
  return keys ? read_machine(read::ProfileFiles{{std::move(*keys), where, {}}}) : keys.error();
}

Result<ExtruderProfile> read_extruder(std::string_view text, const std::string& where) {
  auto keys = read_toml(text, where);
  return keys ? extruder_of({{std::move(*keys), where, {}}}) : keys.error();
}

Result<read::ProfileFiles> machine_files(const std::string& name_or_file, const std::vector<std::string>& presets) {
  auto files = find(name_or_file, shipped_machines(), [&](const std::string& near, const std::string& names) {
    if (is_one_of(shipped_extruders(), name_or_file))
      return fmt::format("'{}' is an extrusion printer, of lamina extrude; name a profile or one of {}", name_or_file, names);
    return fmt::format("no machine '{}'; name a profile (a file that ends in .toml) or one of {}{}", name_or_file, names, near);
  });
  for (std::size_t i = 0; files && i < presets.size(); ++i) {
    if (Status status = profile_library().add(presets[i], *files); !status)
      return Error{Fault::kUsage, "--preset: " + status.error().message};
  }
  return files;
}

Result<Machine> find_machine(const std::string& name_or_file, const std::vector<std::string>& presets) {
  const auto files = machine_files(name_or_file, presets);
  return files ? read_machine(*files) : files.error();
}

Result<ExtruderProfile> find_extruder(const std::string& name_or_file) {
  const auto files = find(name_or_file, shipped_extruders(), [&](const std::string& near, const std::string& names) {
    if (is_one_of(shipped_machines(), name_or_file))
      return fmt::format("'{}' is a powder printer, of lamina jet; name a profile or one of {}", name_or_file, names);
    return fmt::format("no extrusion printer '{}'{}; name a profile (a file that ends in .toml) or one of {}",
                       one_line(name_or_file), near, names);
  });
  return files ? extruder_of(*files) : files.error();
}

Result<bool> names_extruder(const std::string& name_or_file) {
  std::vector<ShippedProfile> printers(shipped_extruders().begin(), shipped_extruders().end());
  printers.insert(printers.end(), shipped_machines().begin(), shipped_machines().end());
  const auto files = find(name_or_file, printers, [&](const std::string& near, const std::string& names) {
    return fmt::format("no machine '{}'{}; name a profile (a file that ends in .toml) or one of {}", one_line(name_or_file),
                       near, names);
  });
  if (!files) return files.error();
  return !have_section(*files, "head") || have_section(*files, "material");
}

}  // namespace lamina::pipeline
