#include "pipeline/job/profiles/library.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <system_error>

#include "pipeline/job/errors.h"
#include "stages/support/io/file_reader.h"
#include "stages/support/text/number_text.h"
#include "stages/support/text/readable.h"

namespace lamina::pipeline {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kDeepest = 16, kMaxFiles = 64;
constexpr std::string_view kInherits = "inherits";

/// The names that a file inherits from. returns "" or what is wrong
std::string read_bases(const TomlValue& value, std::vector<std::string>& bases) {
  const auto add = [&](const TomlValue& one) {
    if (one.is_text()) bases.push_back(one.text);
    return one.is_text() && !one.text.empty();
  };
  const bool good = value.is_list() ? std::ranges::all_of(value.value, add) : add(value);
  return good ? std::string() : "is the name or the file of a profile, or a list of them";
}

/// "mine.toml:12" of the last file that has the key; "default".
std::string source_of(const ProfileFiles& files, std::string_view section, std::string_view name) {
  for (auto file = files.rbegin(); file != files.rend(); ++file) {
    const TomlValue* table = file->keys.find(section);
    const TomlValue* value = table == nullptr ? nullptr : table->find(name);
    if (value != nullptr) return fmt::format("{}:{}", file->where, value->position.line);
  }
  return "default";
}

}  // namespace

struct Library::Found {
  std::string text, where, id;
  std::string folder;  // of a file
};

/// From the profile to the base that is being read.
struct Library::Chain {
  std::vector<std::string> id, where;
};

std::string check_currency(std::string_view text) {
  const bool good =
      !text.empty() && text.size() <= 8 && std::ranges::all_of(text, [](unsigned char c) { return c > ' ' && c != 127; });
  return good ? std::string() : "is a short word without blanks, such as EUR";
}

std::vector<std::string_view> names_of(std::span<const ShippedProfile> profiles) {
  std::vector<std::string_view> names;
  for (const ShippedProfile& profile : profiles) names.push_back(profile.name);
  return names;
}

bool have_section(const ProfileFiles& files, std::string_view section) {
  return std::ranges::any_of(files, [&](const ProfileFile& file) { return file.keys.find(section) != nullptr; });
}

std::string read_presets(std::string_view text, std::vector<std::string>& presets) {
  presets.clear();
  for (const std::string_view name : text.empty() ? std::vector<std::string_view>() : split(text, ",")) {
    if (trimmed(name).empty()) return "has an empty name; give names or files with commas between";
    presets.emplace_back(trimmed(name));
  }
  return {};
}

std::string presets_text(const std::vector<std::string>& presets) { return fmt::format("{}", fmt::join(presets, ",")); }

std::string sourced_text(const std::string& text, const ProfileFiles& files) {
  if (files.size() < 2) return text;
  std::string sourced;
  std::string_view section;
  for (std::string_view rest = text; !rest.empty();) {
    const std::string_view line = rest.substr(0, rest.find('\n'));
    rest.remove_prefix(std::min(line.size() + 1, rest.size()));
    if (line.starts_with('[')) section = line.substr(1, line.size() - 2);
    const std::size_t equals = line.find(" = ");
    sourced += line;
    if (!line.starts_with('[') && equals != std::string_view::npos) {
      sourced += fmt::format("  # {}", one_line(source_of(files, section, line.substr(0, equals))));
    }
    sourced += '\n';
  }
  return sourced;
}

bool is_profile_path(std::string_view name) { return name.find('/') != std::string_view::npos || name.ends_with(".toml"); }

std::string profile_folder() {
  const auto variable = [](const char* name) {
    const char* value = std::getenv(name);
    return std::string(value == nullptr ? "" : value);
  };
  if (const std::string own = variable("LAMINA_PROFILES"); !own.empty()) return own;
  if (const std::string config = variable("XDG_CONFIG_HOME"); !config.empty()) return config + "/lamina/profiles";
  const std::string home = variable("HOME");
  return home.empty() ? home : home + "/.config/lamina/profiles";
}

std::vector<std::string> Library::own_names() const {
  std::vector<std::string> names;
  std::error_code error;
  if (folder_.empty()) return names;
  for (fs::directory_iterator entry(folder_, error), end; !error && entry != end; entry.increment(error)) {
    const fs::path file = entry->path();
    std::error_code ignored;
    if (file.extension() == ".toml" && fs::is_regular_file(file, ignored)) names.push_back(file.stem().string());
  }
  std::ranges::sort(names);
  return names;
}

bool Library::is_own(std::string_view name) const {
  std::error_code ignored;
  return !folder_.empty() && !is_profile_path(name) &&
         fs::is_regular_file(fs::path(folder_) / (std::string(name) + ".toml"), ignored);
}

Result<Library::Found> Library::find(const std::string& name, const std::string& folder) const {
  ReadRules rules{.fault = Fault::kUsage, .missing = "no such profile", .max_bytes = kMaxTomlBytes};
  std::string path = name;
  if (!is_profile_path(name)) {
    const auto shipped = std::ranges::find(shipped_, name, &ShippedProfile::name);
    path = (fs::path(folder_) / (name + ".toml")).string();
    if (shipped != shipped_.end()) {
      if (!is_own(name)) return Found{std::string(shipped->text), name + ".toml", name, {}};
      return usage("'{}' is part of lamina, and {} has that name as well; rename the file", one_line(name), path);
    }
    if (!is_own(name)) {
      const std::vector<std::string> own = own_names();
      std::vector<std::string_view> names = names_of(shipped_);
      names.insert(names.end(), own.begin(), own.end());
      return usage("no profile '{}'{}; name a file that ends in .toml, or one of {}", one_line(name), suggest(name, names),
                   fmt::join(names, ", "));
    }
  } else if (folder.empty()) {
    rules.streams = true;
  } else if (fs::path(name).is_relative()) {
    path = (fs::path(folder) / name).lexically_normal().string();
  }
  auto text = read_file(path, rules);
  if (!text) return text.error();
  std::error_code ignored;
  const fs::path canonical = fs::weakly_canonical(path, ignored), parent = fs::path(path).parent_path();
  return Found{std::move(*text), path, "file " + canonical.string(), parent.empty() ? "." : parent.string()};
}

Status Library::add(const std::string& name, const std::string& folder, Chain& chain, ProfileFiles& files) const {
  const auto wrong = [](const std::string& what) { return Error{Fault::kUsage, what}; };
  auto found = find(name, folder);
  if (!found) return found.error();
  const bool again = std::ranges::find(chain.id, found->id) != chain.id.end();
  chain.id.push_back(found->id);
  chain.where.push_back(one_line(found->where));
  if (again) return wrong(fmt::format("goes round in a circle: {}", fmt::join(chain.where, " > ")));
  if (chain.id.size() > kDeepest) return wrong(fmt::format("is more than {} files deep", kDeepest));
  if (files.size() >= kMaxFiles) return wrong(fmt::format("comes to more than {} files", kMaxFiles));
  if (std::ranges::find(files, found->id, &ProfileFile::id) == files.end()) {
    auto keys = read_toml(found->text, found->where);
    if (!keys) return keys.error();
    if (const TomlValue* inherits = keys->find(kInherits); inherits != nullptr) {
      const std::string at = fmt::format("{}{}: ", inherits->position.text(found->where), kInherits);
      std::vector<std::string> bases;
      if (const std::string what = read_bases(*inherits, bases); !what.empty()) return wrong(at + what);
      for (const std::string& base : bases) {
        const Status status = add(base, found->folder, chain, files);
        if (!status && status.error().message.find(" inherits: ") == std::string::npos)
          return wrong(at + status.error().message);
        if (!status) return status;
      }
      keys->remove(kInherits);
    }
    files.push_back({std::move(*keys), found->where, found->id});
  }
  chain.id.pop_back();
  chain.where.pop_back();
  return {};
}

Status Library::add(const std::string& name_or_path, ProfileFiles& files) const {
  Chain chain;
  return add(name_or_path, "", chain, files);
}

}  // namespace lamina::pipeline
