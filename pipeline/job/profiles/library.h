// pipeline/job/profiles/library.h: profiles by name or file, and the files that a profile inherits from.
//
//      inherits = "jet1000"                          what is not said here is as there
//      inherits = ["jet1000", "steel.toml"]          of what both say, the last one counts
//      [cost]
//      hour_price = 30
#pragma once

#include <fmt/format.h>

#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "stages/data/status.h"
#include "stages/support/text/key.h"
#include "stages/support/text/readable.h"

namespace lamina::pipeline {

/// A profile that is part of the program.
struct ShippedProfile {
  std::string_view name, text;
};
std::vector<std::string_view> names_of(std::span<const ShippedProfile> profiles);

/// One of the files that a profile is made of.
struct ProfileFile {
  TomlValue keys;     // without `inherits`
  std::string where;  // its name in messages
  std::string id;     // equal for a file under all its names
};
/// From the farthest base to the profile itself: of a key that several have, the last one counts.
using ProfileFiles = std::vector<ProfileFile>;

/// Whether any of them has a section.
bool have_section(const ProfileFiles& files, std::string_view section);

/// The profile's canonical text, each value with the file and line that it comes from, or "default"; unchanged if it
/// inherits nothing.
std::string sourced_text(const std::string& text, const ProfileFiles& files);

/// Names and files with commas between. returns  "" or what is wrong
std::string read_presets(std::string_view text, std::vector<std::string>& presets);
std::string presets_text(const std::vector<std::string>& presets);

/// Whether it is the path of a profile: with a slash, or ending in .toml; else the name of one.
bool is_profile_path(std::string_view name);

/// Where a user keeps profiles: $LAMINA_PROFILES, else lamina/profiles in $XDG_CONFIG_HOME or ~/.config; "" for nowhere.
std::string profile_folder();

class Library {
 public:
  /// folder  of NAME.toml, the user's own; "" for none, and it need not be there
  Library(std::vector<ShippedProfile> shipped, std::string folder) : shipped_(std::move(shipped)), folder_(std::move(folder)) {}

  const std::string& folder() const { return folder_; }
  /// The names in the user's folder, in alphabetical order.
  std::vector<std::string> own_names() const;
  bool is_own(std::string_view name) const;

  /// The profile with that name, or in that file, and all that it inherits from, each file once. Paths in `inherits` begin at
  /// the folder of the file that names them. Added to `files`, but for those that are there.
  /// errors  kUsage: "mine.toml:1:12: inherits: ..."; a file that inherits from itself, however far; more than 16 files deep;
  ///         a name that is a shipped one's and the user's as well
  Status add(const std::string& name_or_path, ProfileFiles& files) const;

 private:
  struct Found;
  struct Chain;
  Result<Found> find(const std::string& name, const std::string& folder) const;
  Status add(const std::string& name, const std::string& folder, Chain& chain, ProfileFiles& files) const;

  std::vector<ShippedProfile> shipped_;
  std::string folder_;
};

// --- common to all kinds of profiles

inline std::string read_name(std::string_view text, std::string& name) {
  name = one_line(text);
  return name.empty() ? "is empty; name the machine" : "";
}
inline std::string read_line(std::string_view text, std::string& line) { return line = one_line(text), std::string(); }
inline std::string same_text(const std::string& text) { return text; }
std::string check_currency(std::string_view text);

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
