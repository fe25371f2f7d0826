#include "pipeline/job/file.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <system_error>
#include <vector>

#include "pipeline/job/errors.h"
#include "pipeline/job/job_command.h"
#include "pipeline/job/keys.h"
#include "pipeline/job/profiles/library.h"
#include "stages/support/io/file.h"
#include "stages/support/io/file_reader.h"
#include "stages/support/text/json_text.h"
#include "stages/support/text/readable.h"

namespace lamina::pipeline {
namespace {

namespace fs = std::filesystem;

Error refuse(const std::string& file, const TextPosition& at, const std::string& what) {
  return usage("{}{}", at.text(file), what);
}

// --- The files that a job file names. Their relative paths begin at its folder, wherever lamina runs; profiles and presets
// that are no paths are names, which stay.

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

/// Makes the path of a profile one from the working directory; one that is not there is noted as missing.
void replace_profile(TomlValue& value, std::string_view key, const fs::path& folder, const std::string& file, Job& job) {
  if (!value.is_text()) return;
  const std::string said = value.text;
  value.text = profile_from(folder, said);
  std::error_code ignored;
  if (names_stream(file) || !is_profile_path(value.text) || fs::exists(value.text, ignored)) return;
  const bool here = fs::path(said).is_relative() && fs::exists(said, ignored);
  job.missing.emplace_back(value.text, fmt::format("{}{}: {}: no such profile; correct it (relative paths start at "
                                                   "the job file{})",
                                                   value.position.text(file), key, one_line(value.text),
                                                   here ? ", not where lamina runs, where " + one_line(said) + " is" : ""));
}

/// Of a list, or of a text with commas. errors  kUsage: the folder's name has a comma
Status replace_presets(TomlValue& presets, const fs::path& folder, const std::string& file, Job& job) {
  const auto text = flat_text(presets);
  std::vector<std::string> names;
  if (!text || !read_presets(*text, names).empty()) return {};  // the reader of the key reports the error
  TomlValue list{TomlValue::Kind::kList, {}, {}, {}, presets.position};
  for (std::size_t i = 0; i < names.size(); ++i) {
    const TextPosition position = names.size() == presets.value.size() ? presets.value[i].position : presets.position;
    TomlValue& preset = list.value.emplace_back(TomlValue{TomlValue::Kind::kText, std::move(names[i]), {}, {}, position});
    replace_profile(preset, "machine.presets", folder, file, job);
    if (preset.text.find(',') == std::string::npos) continue;
    return refuse(file, position, "machine.presets: " + divided(preset.text));
  }
  presets = std::move(list);
  return {};
}

/// Makes part.path, run.output, extrude.material, machine.profile and machine.presets of a job's tree paths from the working
/// directory. file  the job file, for its folder and for messages; of a stream paths stay as they are errors  kUsage: a comma
/// in the path of a preset, which divides them
Status replace_paths(TomlValue& tree, const std::string& file, Job& job) {
  const fs::path folder = names_stream(file) ? fs::path() : fs::path(file).parent_path();
  if (TomlValue* const parts = tree.find("part"); parts != nullptr && parts->is_list()) {
    for (TomlValue& part : parts->value) replace_path(&part, "path", folder);
  }
  replace_path(tree.find("run"), "output", folder);
  TomlValue* const extrude = tree.find("extrude");
  TomlValue* const material = extrude != nullptr && extrude->is_table() ? extrude->find("material") : nullptr;
  if (material != nullptr) replace_profile(*material, "extrude.material", folder, file, job);
  TomlValue* const machine = tree.find("machine");
  if (machine == nullptr || !machine->is_table()) return {};
  if (TomlValue* const profile = machine->find("profile")) replace_profile(*profile, "machine.profile", folder, file, job);
  TomlValue* const presets = machine->find("presets");
  return presets == nullptr ? Status() : replace_presets(*presets, folder, file, job);
}

/// The way back: a path as a file in `folder` names it, relative if it is below, else absolute. Unchanged for "".
std::string path_in(const std::string& folder, const std::string& path) {
  if (folder.empty() || path.empty()) return path;
  const fs::path whole = fs::absolute(path).lexically_normal();
  const fs::path near = whole.lexically_relative(fs::absolute(folder).lexically_normal());
  return near.empty() || *near.begin() == ".." ? whole.string() : near.string();
}

std::string profile_in(const std::string& folder, const std::string& name) {
  return folder.empty() || !is_profile_path(name) ? name : as_path(path_in(folder, name));
}

/// A profile by its file's name alone, as manifests have it.
std::string profile_name(const std::string& name) {
  const std::string file = fs::path(name).filename().string();
  return is_profile_path(name) && !file.empty() ? file : name;
}

/// Whether a job file in `folder` can name them. errors  kUsage: a path that is not UTF-8, a preset's with a comma
Status check_nameable(const std::string& folder, const Job& job) {
  const MachineRequest& machine = job.machine;
  if (!is_utf8(profile_in(folder, job.extrude.material)))
    return Error{Fault::kUsage, job.extrude.material + ": a job file cannot name it, it is not UTF-8; rename it"};
  for (std::size_t i = 0; i <= machine.presets.size(); ++i) {
    const std::string name = profile_in(folder, i == 0 ? machine.profile : machine.presets[i - 1]);
    if (!is_utf8(name)) return Error{Fault::kUsage, name + ": a job file cannot name it, it is not UTF-8; rename it"};
    if (i > 0 && name.find(',') != std::string::npos) return Error{Fault::kUsage, divided(name)};
  }
  return {};
}

// --- its text

Status read_parts(const TomlValue& list, const std::string& file, Job& job) {
  if (!list.is_list() || list.value.empty() || !std::ranges::all_of(list.value, &TomlValue::is_table)) {
    return refuse(file, list.position, "part: write one [[part]] table for each part");
  }
  job.parts.clear();
  for (const TomlValue& table : list.value) {
    PartRequest part;
    if (Status status = read_section(table, "part", file, part_keys(), part); !status) return status;
    if (part.path.empty()) return refuse(file, table.position, "part.path is missing; name a file");
    const TextPosition& named = table.find("path")->position;
    part.named_at = fmt::format("{}:{}:{}", file, named.line, named.column);
    job.parts.push_back(std::move(part));
  }
  return {};
}

Status no_section(const TomlValue& value, std::string_view section, const std::string& file) {
  auto names = section_names(job_keys());
  names.push_back("part");
  return refuse(file, value.position, fmt::format("{}: {}", section, no_such_section(section, names)));
}

bool has_section(std::string_view section) {
  return std::ranges::any_of(job_keys(), [&](const JobKey& key) { return key.section == section; });
}

Status read_tree(Result<TomlValue> tree, const std::string& file, Job& job) {
  if (!tree) return tree.error();
  if (Status status = replace_paths(*tree, file, job); !status) return status;
  for (std::size_t i = 0; i < tree->value.size(); ++i) {
    const std::string& section = tree->name[i];
    if (section == "part") {
      if (Status status = read_parts(tree->value[i], file, job); !status) return status;
      continue;
    }
    if (!has_section(section)) return no_section(tree->value[i], section, file);
    if (Status status = read_section(tree->value[i], section, file, job_keys(), job); !status) return status;
    for (const std::string& name : tree->value[i].name) job.named.push_back(section + "." + name);
  }
  return {};
}

/// The lines of a part's keys that are set.
std::string part_text(const PartRequest& part) {
  std::string text = "\n[[part]]\n";
  for (const PartKey& key : part_keys()) {
    const std::string value = key.write(part);
    if (!value.empty()) text += key_line(key.name, key.form, value) + "\n";
  }
  return text;
}

template <class Change>
void change_profiles(Job& job, const Change& change) {
  job.machine.profile = change(job.machine.profile);
  job.extrude.material = change(job.extrude.material);
  for (std::string& preset : job.machine.presets) preset = change(preset);
}

/// The value of an assignment: text, or TOML in quotes, brackets or braces.
TomlValue assigned_value(std::string_view text) {
  const bool toml = !text.empty() && (text.front() == '"' || text.front() == '[' || text.front() == '{');
  if (auto value = toml ? read_toml_value(text) : std::nullopt) {
    value->position = {};
    return *value;
  }
  if (text.size() >= 2 && text.front() == '[' && text.back() == ']') text = text.substr(1, text.size() - 2);  // [a, b]
  return {TomlValue::Kind::kText, std::string(text), {}, {}, {}};
}

/// Reads the one value of a table.
template <class Target>
Status read_assigned(const TomlValue& table, std::string_view section, const std::string& option,
                     std::span<const Key<Target>> keys, Target& target) {
  TextPosition unused;
  const std::string& name = table.name.front();
  std::string wrong;
  const auto* key = find_key(keys, section, name, wrong);
  if (key != nullptr) wrong = key->read(table.value.front(), target, unused);
  return wrong.empty() ? Status() : usage("{}: {}", option, wrong);
}

}  // namespace

Status read_job(const std::string& path, Job& job) {
  const auto text =
      read_file(path, {.fault = Fault::kUsage, .missing = "no such job file", .max_bytes = kMaxTomlBytes, .streams = true});
  return text ? read_job_text(*text, path, job) : Status(text.error());
}

Status read_job_text(std::string_view text, const std::string& path, Job& job) {
  return read_tree(read_toml(text, path), path, job);
}

Status set_key(Job& job, std::string_view assignment) {
  const std::string option = fmt::format("--set {}", assignment);
  const auto wrong = [&](const std::string& what) { return usage("{}: {}", option, what); };
  const std::size_t equals = assignment.find('=');
  const auto names = split(assignment.substr(0, equals), ".");
  if (equals == std::string_view::npos || names.size() < 2 || names.size() > 3 || (names.size() == 3 && names[0] != "part")) {
    return wrong("write section.key=value, as in bed.dpi=600");
  }
  if (names[0] != "part" && !has_section(names[0])) {
    const Status status = no_section({}, names[0], {});
    return wrong(status.error().message.substr(names[0].size() + 2));
  }
  TomlValue root, table;
  root.kind = table.kind = TomlValue::Kind::kTable;
  table.add(names.back(), assigned_value(assignment.substr(equals + 1)));
  root.add(names[0], std::move(table));
  job.named.emplace_back(assignment.substr(0, equals));
  const TomlValue& set = root.value.front();
  if (names[0] != "part") return read_assigned(set, names[0], option, job_keys(), job);
  std::size_t first = 0, last = job.parts.size();
  if (names.size() == 3 && last > 0) {
    std::int64_t number = 0;
    if (!read_whole(names[1], 1, static_cast<std::int64_t>(last), number).empty()) {
      return wrong(last == 1 ? "there is one part; write part.1"
                             : fmt::format("there are {} parts; write part.1 to part.{}", last, last));
    }
    first = static_cast<std::size_t>(number - 1);
    last = first + 1;
  }
  if (first == last) return wrong("the job has no part yet; name one");
  for (std::size_t i = first; i < last; ++i) {
    if (Status status = read_assigned(set, "part", option, part_keys(), job.parts[i]); !status) return status;
  }
  return {};
}

std::string job_text(const Job& job, const std::string& directory) {
  Job named = job;
  named.output = path_in(directory, named.output);
  change_profiles(named, [&](const std::string& name) { return profile_in(directory, name); });
  for (PartRequest& part : named.parts) part.path = path_in(directory, part.path);
  std::string text = sections_text(job_keys(), named, [](const JobKey&, const std::string& value) { return !value.empty(); });
  for (const PartRequest& part : named.parts) text += part_text(part);
  return text;
}

std::string canonical_job_text(const Job& job, Product product) {
  const bool filled = product == Product::kImages && fills(job);  // by beads, which [fill] and [segment] decide
  Job whole = job;
  whole.slice.tolerance_um = tolerance_um_of(job, product);
  change_profiles(whole, profile_name);
  std::string text = sections_text(job_keys(), whole, [&](const JobKey& key, const std::string& value) {
    const bool of_filling = key.section == "fill" || key.section == "segment";
    return !value.empty() && ((key.decides & bit(product)) != 0 || (filled && of_filling));
  });
  for (PartRequest part : job.parts) {
    part.path = fs::path(part.path).filename().string();
    text += part_text(part);
  }
  return text;
}

Result<File> write_job(const std::string& path, const Job& job, bool durable, std::string_view command) {
  for (const PartRequest& part : job.parts) {
    if (same_file(path, part.path)) return usage("--save-job {}: is a part of the job; name another file", path);
    if (!is_utf8(part.path)) return usage("{}: a job file cannot name it, it is not UTF-8; rename it", part.path);
  }
  fs::path directory = fs::path(path).parent_path();
  if (directory.empty()) directory = ".";
  if (Status status = check_nameable(directory.string(), job); !status) return status.error();
  const std::string text = job_command_line(command) + "\n\n" + job_text(job, directory.string());
  auto file = File::open(path, {.durable = durable ? Durable::kAll : Durable::kNo});
  Status status = file ? file->append(text) : Status(file.error());
  if (status) status = file->flush();
  return status ? std::move(file) : status.error();
}

Status save_job(const std::string& path, const Job& job, std::string_view command) {
  auto file = write_job(path, job, true, command);
  const auto written = file ? file->finish() : file.error();
  return written ? Status() : written.error();
}

}  // namespace lamina::pipeline
