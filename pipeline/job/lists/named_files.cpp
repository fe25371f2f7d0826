#include "pipeline/job/lists/named_files.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <system_error>

#include "pipeline/job/profiles/library.h"
#include "stages/support/io/file_reader.h"
#include "stages/support/text/json_text.h"
#include "stages/support/text/readable.h"

namespace lamina::pipeline {
namespace {

namespace fs = std::filesystem;

std::string path_from(const fs::path& folder, const std::string& path) {
  return path.empty() || fs::path(path).is_absolute() ? path : (folder / path).lexically_normal().string();
}

/// A path that has lost its slash would be a name.
std::string as_path(std::string path) { return is_profile_path(path) ? path : "./" + path; }

std::string profile_from(const fs::path& folder, const std::string& name) {
  return folder.empty() || !is_profile_path(name) ? name : as_path(path_from(folder, name));
}

void replace_path(TomlValue* table, std::string_view name, const fs::path& folder) {
  TomlValue* const path = table != nullptr && table->is_table() ? table->find(name) : nullptr;
  if (path != nullptr && path->is_text()) path->text = path_from(folder, path->text);
}

std::string divided(const std::string& name) {
  return fmt::format("{}: a comma divides presets; rename the file or its folder", one_line(name));
}

/// The profiles that a job file names.
class Profiles {
 public:
  Profiles(const fs::path& folder, const std::string& file, MissingProfiles& missing)
      : folder_(folder), file_(file), missing_(missing) {}

  void replace(TomlValue& value, std::string_view key) {
    if (!value.is_text()) return;
    const std::string said = value.text;
    value.text = profile_from(folder_, said);
    std::error_code ignored;
    if (names_stream(file_) || !is_profile_path(value.text) || fs::exists(value.text, ignored)) return;
    const bool here = fs::path(said).is_relative() && fs::exists(said, ignored);
    missing_.emplace_back(value.text,
                          fmt::format("{}machine.{}: {}: no such machine profile; correct it (a relative path begins "
                                      "beside the job file{})",
                                      value.position.text(file_), key, one_line(value.text),
                                      here ? ", not where lamina runs, where " + one_line(said) + " is" : ""));
  }

  /// Of a list, or of a text with commas. errors  kUsage: the folder's name has a comma
  Status replace_all(TomlValue& presets) {
    const auto text = flat_text(presets);
    std::vector<std::string> names;
    if (!text || !read_presets(*text, names).empty()) return {};  // the reader of the key tells it
    TomlValue list{TomlValue::Kind::kList, {}, {}, {}, presets.position};
    for (std::size_t i = 0; i < names.size(); ++i) {
      const TextPosition position = names.size() == presets.value.size() ? presets.value[i].position : presets.position;
      TomlValue& preset = list.value.emplace_back(TomlValue{TomlValue::Kind::kText, std::move(names[i]), {}, {}, position});
      replace(preset, "presets");
      if (preset.text.find(',') == std::string::npos) continue;
      return Error{Fault::kUsage, fmt::format("{}machine.presets: {}", position.text(file_), divided(preset.text))};
    }
    presets = std::move(list);
    return {};
  }

 private:
  const fs::path& folder_;
  const std::string& file_;
  MissingProfiles& missing_;
};

}  // namespace

Status replace_paths(TomlValue& job, const std::string& file, MissingProfiles& missing) {
  const fs::path folder = names_stream(file) ? fs::path() : fs::path(file).parent_path();
  if (TomlValue* const parts = job.find("part"); parts != nullptr && parts->is_list()) {
    for (TomlValue& part : parts->value) replace_path(&part, "path", folder);
  }
  replace_path(job.find("run"), "output", folder);
  TomlValue* const machine = job.find("machine");
  if (machine == nullptr || !machine->is_table()) return {};
  Profiles profiles(folder, file, missing);
  if (TomlValue* const profile = machine->find("profile")) profiles.replace(*profile, "profile");
  TomlValue* const presets = machine->find("presets");
  return presets == nullptr ? Status() : profiles.replace_all(*presets);
}

Status check_there(const MissingProfiles& missing, const std::string& profile, const std::vector<std::string>& presets) {
  for (const auto& [path, what] : missing) {
    if (path == profile || std::ranges::find(presets, path) != presets.end()) return Error{Fault::kUsage, what};
  }
  return {};
}

std::string path_in(const std::string& folder, const std::string& path) {
  if (folder.empty() || path.empty()) return path;
  const fs::path whole = fs::absolute(path).lexically_normal();
  const fs::path near = whole.lexically_relative(fs::absolute(folder).lexically_normal());
  return near.empty() || *near.begin() == ".." ? whole.string() : near.string();
}

std::string profile_in(const std::string& folder, const std::string& name) {
  return folder.empty() || !is_profile_path(name) ? name : as_path(path_in(folder, name));
}

std::string profile_name(const std::string& name) {
  const std::string file = fs::path(name).filename().string();
  return is_profile_path(name) && !file.empty() ? file : name;
}

Status check_nameable(const std::string& folder, const std::string& profile, const std::vector<std::string>& presets) {
  std::vector<std::string> names{profile};
  names.insert(names.end(), presets.begin(), presets.end());
  for (const std::string& one : names) {
    const std::string name = profile_in(folder, one);
    if (!is_utf8(name)) return Error{Fault::kUsage, name + ": a job file cannot name it, it is not UTF-8; rename it"};
    if (&one != &names.front() && name.find(',') != std::string::npos) return Error{Fault::kUsage, divided(name)};
  }
  return {};
}

}  // namespace lamina::pipeline
