#include "pipeline/machine/import/orca_config.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <map>
#include <optional>
#include <system_error>
#include <utility>
#include <vector>

#include "pipeline/job/errors.h"
#include "stages/support/io/file_reader.h"
#include "stages/support/text/json_text.h"
#include "stages/support/text/json_value.h"
#include "stages/support/text/readable.h"

namespace lamina::pipeline {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kDeepestPreset = 32, kMaxFolderEntries = 50'000, kMaxPresetKeys = 20'000;
constexpr std::uint64_t kMaxPresetBytes = 4 << 20;

/// A text, a number or a switch; nothing for other kinds.
std::optional<std::string> scalar_text(const Json& value) {
  if (value.is_string()) return value.text();
  if (value.is_null() || value.is_object() || value.begin() != value.end()) return std::nullopt;
  const std::string text = json_text(value);
  return text == "[]" ? std::string() : text;
}

Result<Json> parse_preset(std::string_view text, const std::string& where) {
  if (!json_nests_within(text))
    return failure(Fault::kInput, "{}: is no preset: it nests deeper than {} levels", where, kDeepestText);
  try {
    Json json = parse_json(text);
    if (!json.is_object()) return usage("{}: is no preset of Orca or BambuStudio, which is an object", where);
    if (json.size() > kMaxPresetKeys) return usage("{}: has more than {} settings", where, kMaxPresetKeys);
    return json;
  } catch (const JsonError& error) {
    return failure(Fault::kInput, "{}: is no JSON: {}", where, one_line(error.what()));
  }
}

std::string member_text(const Json& preset, std::string_view name) {
  const Json* value = preset.find(name);
  return value != nullptr ? scalar_text(*value).value_or("") : "";
}

/// Keys that are the preset's own, without effect on a print.
bool describes_preset(std::string_view key) {
  constexpr std::string_view kKeys[] = {"inherits",      "type",       "name",        "from",
                                        "instantiation", "setting_id", "filament_id", "version"};
  return std::ranges::find(kKeys, key) != std::end(kKeys);
}

void add_preset(const Json& preset, SlicerSettings& settings) {
  for (const Json::Member& member : preset.members()) {
    if (describes_preset(member.name)) continue;
    std::vector<std::string> values;
    if (member.value.begin() == member.value.end()) {
      if (const auto text = scalar_text(member.value)) values.push_back(*text);
    }
    for (const Json& element : member.value) {
      if (const auto text = scalar_text(element)) values.push_back(*text);
    }
    settings.set(member.name, std::move(values));
  }
}

/// Presets by name in the folders of a file.
class PresetFolder {
 public:
  explicit PresetFolder(const std::string& path) : folder_(fs::path(path).parent_path()) {
    if (folder_.empty()) folder_ = ".";
    std::error_code ignored;
    fs::path above = fs::absolute(folder_, ignored).lexically_normal();
    for (int level = 0; level < 3 && above.has_relative_path(); ++level, above = above.parent_path()) {
      const std::string name = above.filename().string();
      if (name == "machine" || name == "filament" || name == "process") folder_ = above.parent_path();
    }
  }

  /// errors  kUsage: too many files
  Result<std::optional<std::string>> find(const std::string& name) {
    if (!listed_) {
      if (Status status = list(); !status) return status.error();
    }
    const auto found = path_.find(name + ".json");
    return found == path_.end() ? std::optional<std::string>() : found->second;
  }

 private:
  Status list() {
    listed_ = true;
    if (Status status = list(folder_); !status) return status;
    std::error_code ignored;
    const fs::path library = fs::absolute(folder_, ignored).lexically_normal().parent_path() / "OrcaFilamentLibrary";
    return fs::is_directory(library, ignored) ? list(library) : Status();
  }

  Status list(const fs::path& folder) {
    std::error_code error;
    std::size_t count = 0;
    for (fs::recursive_directory_iterator entry(folder, fs::directory_options::skip_permission_denied, error), end;
         !error && entry != end; entry.increment(error)) {
      if (++count > kMaxFolderEntries)
        return usage("{}: has more than {} files; copy the preset and its bases into a folder of their own", folder.string(),
                     kMaxFolderEntries);
      if (entry.depth() > 4) entry.disable_recursion_pending();
      std::error_code ignored;
      const fs::path& path = entry->path();
      if (path.extension() != ".json" || !entry->is_regular_file(ignored)) continue;
      // Of files with the same name the first one by path, whatever the order of the folder.
      const auto [known, added] = path_.try_emplace(path.filename().string(), path.string());
      if (!added && path.string() < known->second) known->second = path.string();
    }
    return {};
  }

  fs::path folder_;
  bool listed_ = false;
  std::map<std::string, std::string> path_;
};

class PresetReader {
 public:
  explicit PresetReader(const std::string& path) : folder_(path) {}

  /// Adds a preset over what it inherits. errors  of read_orca_config
  Status add(const Json& preset, const std::string& where, SlicerSettings& settings) {
    const bool again = std::ranges::find(chain_, where) != chain_.end();
    chain_.push_back(where);
    if (again) return usage("{}: inherits goes round in a circle: {}", where, fmt::join(chain_, " > "));
    if (chain_.size() > kDeepestPreset) return usage("{}: inherits over more than {} files", where, kDeepestPreset);
    if (const std::string base = member_text(preset, "inherits"); !base.empty()) {
      const auto path = folder_.find(base);
      if (!path) return path.error();
      if (!*path)
        return usage("{}: inherits: no file '{}.json' in its folders; copy it next to the preset", where, one_line(base));
      if (Status status = add_file(**path, settings); !status) return status;
    }
    add_preset(preset, settings);
    chain_.pop_back();
    return {};
  }

  /// Adds a preset that a machine names, if it and its bases are there; else a note. errors  of read_orca_config
  Status add_default(const std::string& name, std::string_view what, SlicerSettings& settings,
                     std::vector<std::string>& notes) {
    const Result<std::optional<std::string>> path = name.empty() ? std::optional<std::string>() : folder_.find(name);
    if (!path) return path.error();
    if (*path) return add_file(**path, settings);
    notes.push_back(name.empty()
                        ? fmt::format("the printer names no {}: the values are lamina's defaults", what)
                        : fmt::format("{} '{}' is not in its folders: the values are lamina's defaults", what, one_line(name)));
    return {};
  }

  /// Adds the filament that was requested. errors  of read_orca_config; no such file
  Status add_requested(const std::string& name, SlicerSettings& settings) {
    const auto path = folder_.find(name);
    if (!path) return path.error();
    if (!*path) return usage("--filament: no file '{}.json' in the folders of the printer", one_line(name));
    return add_file(**path, settings);
  }

 private:
  Status add_file(const std::string& path, SlicerSettings& settings) {
    const auto text = read_file(path, {.fault = Fault::kUsage, .missing = "no such preset", .max_bytes = kMaxPresetBytes});
    if (!text) return text.error();
    const auto preset = parse_preset(*text, path);
    return preset ? add(*preset, path, settings) : Status(preset.error());
  }

  PresetFolder folder_;
  std::vector<std::string> chain_;
};

}  // namespace

Result<PrusaConfig> read_orca_config(std::string_view text, const std::string& path, const std::string& filament) {
  const auto preset = parse_preset(text, path);
  if (!preset) return preset.error();
  const std::string type = member_text(*preset, "type");
  if (type != "machine" && type != "filament")
    return usage("{}: is {}; name the preset of a machine or a filament", path,
                 type.empty() ? std::string("no preset of Orca or BambuStudio, which has a type")
                              : fmt::format("a preset of the type '{}'", one_line(type)));
  if (type == "filament" && !filament.empty()) return usage("--filament: {} is a filament; leave it out", path);
  PrusaConfig config;
  config.name = one_line(member_text(*preset, "name"));
  PresetReader reader(path);
  SlicerSettings own;
  if (Status status = reader.add(*preset, path, own); !status) return status.error();
  if (type == "machine") {
    const auto usual = [&](const char* key, const char* what) {
      return reader.add_default(own.element(key).value_or(""), what, config.settings, config.notes);
    };
    if (Status status = usual("default_print_profile", "process"); !status) return status.error();
    Status status =
        filament.empty() ? usual("default_filament_profile", "filament") : reader.add_requested(filament, config.settings);
    if (!status) return status.error();
  }
  config.settings.update(own);
  return config;
}

}  // namespace lamina::pipeline
