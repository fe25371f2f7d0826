#include "pipeline/job/file.h"

#include <fmt/format.h>
#define TOML_EXCEPTIONS 0
#define TOML_ENABLE_WINDOWS_COMPAT 0
#include <toml++/toml.h>

#include <filesystem>
#include <vector>

#include "pipeline/job/keys.h"
#include "pipeline/text/json_text.h"
#include "pipeline/text/names.h"
#include "pipeline/text/number_text.h"
#include "stages/write/file.h"

namespace lamina::pipeline {
namespace {

namespace fs = std::filesystem;

template <class Target>
std::span<const Key<Target>> keys_of();
template <>
std::span<const JobKey> keys_of<Job>() {
  return job_keys();
}
template <>
std::span<const PartKey> keys_of<PartRequest>() {
  return part_keys();
}

template <class Target>
const Key<Target>* find_key(std::string_view section, std::string_view name) {
  for (const auto& key : keys_of<Target>()) {
    if (key.section == section && key.name == name) return &key;
  }
  return nullptr;
}

std::vector<std::string_view> section_names() {
  std::vector<std::string_view> names;
  for (const JobKey& key : job_keys()) {
    if (names.empty() || names.back() != key.section) names.push_back(key.section);
  }
  names.push_back("part");
  return names;
}

template <class Target>
std::string no_such_key(std::string_view section, std::string_view name) {
  std::vector<std::string_view> names;
  for (const auto& key : keys_of<Target>()) {
    if (key.section == section) names.push_back(key.name);
  }
  const std::string near = suggest(name, names);
  return near.empty() ? fmt::format("no such key; [{}] has {}", section, fmt::join(names, ", "))
                      : fmt::format("no such key{}", near);
}

std::string no_such_section(std::string_view section) {
  const auto names = section_names();
  const std::string near = suggest(section, names);
  return near.empty() ? fmt::format("no such section; there are {}", fmt::join(names, ", "))
                      : fmt::format("no such section{}", near);
}

// A TOML value as the text that Key::read takes; false if it is no value or list of values.
bool text_of(const toml::node& node, std::string& text, bool inside_list = false) {
  if (const auto* string = node.as_string()) {
    text += string->get();
  } else if (const auto* whole = node.as_integer()) {
    text += fmt::format("{}", whole->get());
  } else if (const auto* number = node.as_floating_point()) {
    text += number_text(number->get());
  } else if (const auto* boolean = node.as_boolean()) {
    text += boolean->get() ? "true" : "false";
  } else if (const auto* list = node.as_array(); list != nullptr && !inside_list) {
    for (std::size_t i = 0; i < list->size(); ++i) {
      if (i > 0) text += ',';
      if (!text_of((*list)[i], text, true)) return false;
    }
  } else {
    return false;
  }
  return true;
}

// Where a node of a file is, as the front of an error line.
std::string place(const std::string& path, const toml::node& node) {
  return fmt::format("{}:{}", path, node.source().begin.line);
}

template <class Target>
Status read_table(const std::string& path, const toml::table& table, std::string_view section, Target& target) {
  for (const auto& [name, node] : table) {
    const auto* key = find_key<Target>(section, name.str());
    const auto wrong = [&](const std::string& what) {
      return Error{Fault::kUsage, fmt::format("{}: {}.{}: {}", place(path, node), section, name.str(), what)};
    };
    if (key == nullptr) return wrong(no_such_key<Target>(section, name.str()));
    std::string text;
    if (!text_of(node, text)) return wrong("is not a single value or a list of them");
    if (const std::string what = key->read(text, target); !what.empty()) return wrong(what);
  }
  return {};
}

Status read_parts(const std::string& path, const toml::node& node, Job& job) {
  const toml::array* parts = node.as_array();
  if (parts == nullptr || parts->empty() || !parts->is_homogeneous(toml::node_type::table)) {
    return Error{Fault::kUsage, fmt::format("{}: part: write one [[part]] table for each part", place(path, node))};
  }
  job.parts.clear();
  for (const toml::node& entry : *parts) {
    PartRequest part;
    if (Status status = read_table(path, *entry.as_table(), "part", part); !status) return status;
    if (part.path.empty()) {
      return Error{Fault::kUsage, fmt::format("{}: part.path is missing; name a file", place(path, entry))};
    }
    part.named_at = place(path, *entry.as_table()->get("path"));
    job.parts.push_back(std::move(part));
  }
  return {};
}

std::string beside(const fs::path& directory, const std::string& path) {
  return path.empty() || fs::path(path).is_absolute() ? path : (directory / path).lexically_normal().string();
}

std::string toml_value(KeyForm form, const std::string& text) {
  if (form == KeyForm::kString) return json_string(text);  // TOML's basic strings escape as JSON's do
  if (form == KeyForm::kBare) return text;
  return fmt::format("[{}]", fmt::join(split(text, ","), ", "));
}

std::string all_text(const Job& job, bool only_bytes) {
  std::string text;
  std::string_view section;
  for (const JobKey& key : job_keys()) {
    const std::string value = key.write(job);
    if (value.empty() || (only_bytes && !key.decides_bytes)) continue;
    if (section != key.section) text += fmt::format("{}[{}]\n", section.empty() ? "" : "\n", key.section);
    section = key.section;
    text += fmt::format("{} = {}\n", key.name, toml_value(key.form, value));
  }
  for (const PartRequest& part : job.parts) {
    text += "\n[[part]]\n";
    for (const PartKey& key : part_keys()) {
      const std::string value = key.write(part);
      if (value.empty()) continue;
      text += fmt::format("{} = {}\n", key.name, toml_value(key.form, value));
    }
  }
  return text;
}

template <class Target>
Status set_in(std::string_view assignment, std::string_view section, std::string_view name, std::string_view value,
              Target& target) {
  const auto* key = find_key<Target>(section, name);
  const std::string wrong = key == nullptr ? no_such_key<Target>(section, name) : key->read(value, target);
  if (wrong.empty()) return {};
  return Error{Fault::kUsage, fmt::format("--set {}: {}", assignment, wrong)};
}

}  // namespace

namespace {

Status read_parsed(const std::string& path, const toml::parse_result& parsed, Job& job) {
  if (!parsed) {
    const toml::source_position at = parsed.error().source().begin;
    return Error{Fault::kUsage, fmt::format("{}:{}:{}: {}", path, at.line, at.column, one_line(parsed.error().description()))};
  }
  for (const auto& [name, node] : parsed.table()) {
    const std::string_view section = name.str();
    Status status;
    if (section == "part") {
      status = read_parts(path, node, job);
    } else {
      bool known = false;
      for (const std::string_view other : section_names()) known = known || other == section;
      if (!known) {
        return Error{Fault::kUsage, fmt::format("{}: {}: {}", place(path, node), section, no_such_section(section))};
      }
      if (!node.is_table()) {
        return Error{Fault::kUsage, fmt::format("{}: {} is a section; write [{}]", place(path, node), section, section)};
      }
      const std::string output_before = job.output;
      job.output.clear();
      status = read_table(path, *node.as_table(), section, job);
      job.output = job.output.empty() ? output_before : beside(fs::path(path).parent_path(), job.output);
    }
    if (!status) return status;
    if (section == "part") {
      for (PartRequest& part : job.parts) part.path = beside(fs::path(path).parent_path(), part.path);
    }
  }
  return {};
}

}  // namespace

Status read_job(const std::string& path, Job& job) {
  std::error_code error;
  if (!fs::is_regular_file(path, error)) {
    return Error{Fault::kUsage, fmt::format("{}: no such job file", path)};
  }
  return read_parsed(path, toml::parse_file(path), job);
}

Status read_job_text(std::string_view text, const std::string& path, Job& job) {
  return read_parsed(path, toml::parse(text), job);
}

Status set_key(Job& job, std::string_view assignment) {
  const std::size_t equals = assignment.find('=');
  const auto wrong = [&](const std::string& what) {
    return Error{Fault::kUsage, fmt::format("--set {}: {}", assignment, what)};
  };
  const auto names = split(assignment.substr(0, equals), ".");
  if (equals == std::string_view::npos || names.size() < 2 || names.size() > 3) {
    return wrong("write section.key=value, as in bed.dpi=600");
  }
  // Values may be written as in a job file: quoted, or lists in brackets.
  std::string value(assignment.substr(equals + 1));
  if (value.size() >= 2 && ((value.front() == '"' && value.back() == '"') || (value.front() == '[' && value.back() == ']'))) {
    value = value.substr(1, value.size() - 2);
    if (assignment.back() == ']') std::erase(value, ' ');
  }
  if (names[0] == "part") {
    std::size_t first = 0, last = job.parts.size();
    if (names.size() == 3) {
      std::int64_t number = 0;
      const auto most = static_cast<std::int64_t>(job.parts.size());
      if (const std::string what = read_whole(names[1], 1, most, number); !what.empty()) return wrong(what);
      first = static_cast<std::size_t>(number - 1);
      last = first + 1;
    }
    if (first == last) return wrong("the job has no part yet; name one");
    for (std::size_t i = first; i < last; ++i) {
      if (Status status = set_in(assignment, "part", names.back(), value, job.parts[i]); !status) return status;
    }
    return {};
  }
  bool known = false;
  for (const std::string_view section : section_names()) known = known || section == names[0];
  if (!known) return wrong(no_such_section(names[0]));
  if (names.size() == 3) return wrong("write section.key=value, as in bed.dpi=600");
  return set_in(assignment, names[0], names[1], value, job);
}

std::string job_text(const Job& job, const std::string& directory) {
  Job named = job;
  if (!directory.empty()) {
    const auto relative = [&](const std::string& path) {
      if (path.empty()) return path;
      const fs::path whole = fs::absolute(path).lexically_normal();
      const fs::path near = whole.lexically_relative(fs::absolute(directory).lexically_normal());
      return near.empty() || *near.begin() == ".." ? whole.string() : near.string();
    };
    named.output = relative(named.output);
    for (PartRequest& part : named.parts) part.path = relative(part.path);
  }
  return all_text(named, false);
}

std::string canonical_job_text(const Job& job) {
  Job named = job;
  for (PartRequest& part : named.parts) part.path = fs::path(part.path).filename().string();
  return all_text(named, true);
}

Status save_job(const std::string& path, const Job& job) {
  for (const PartRequest& part : job.parts) {
    std::error_code absent;
    if (fs::equivalent(path, part.path, absent)) {
      return Error{Fault::kUsage, fmt::format("--save-job {}: is a part of the job; name another file", path)};
    }
    if (!is_utf8(part.path)) {
      return Error{Fault::kUsage, fmt::format("{}: a job file cannot name it, it is not UTF-8; rename it", part.path)};
    }
  }
  fs::path directory = fs::path(path).parent_path();
  if (directory.empty()) directory = ".";
  const std::string text = "# A job of lamina. Run it with: lamina jet --job FILE\n\n" + job_text(job, directory.string());
  return write::write_file(path, std::as_bytes(std::span(text)));
}

}  // namespace lamina::pipeline
