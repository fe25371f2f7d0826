#include "pipeline/job/lists/batch_list.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>

#include "pipeline/job/lists/job_command.h"
#include "stages/support/io/file_reader.h"
#include "stages/support/text/escape.h"
#include "stages/support/text/readable.h"

namespace lamina::pipeline {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kLongestName = 80;  // of a job that names no file, bytes

bool is_job_file(const fs::path& path) { return lower_case(path.extension().string()) == ".toml"; }

/// The file's name without its extensions; folders become part of it.
std::string name_of(const fs::path& path) {
  fs::path name = path;
  if (lower_case(name.extension().string()) == ".gz") name.replace_extension();
  name.replace_extension();
  std::string text = name.lexically_normal().string();
  std::ranges::replace(text, '/', '_');
  return text;
}

/// The command that a saved job names in its leading comments, "jet" if none does. Reading the job reports its errors.
std::string command_of(const fs::path& path) {
  auto file = FileReader::open(path.string(), {.fault = Fault::kUsage, .max_bytes = kMaxTomlBytes, .longest_line = 1 << 16});
  if (!file) return "jet";
  for (std::string_view line; file->next(line) && (line.empty() || line.starts_with('#') || line == "\r");) {
    if (const std::string_view command = command_in(line); !command.empty()) return std::string(command);
  }
  return "jet";
}

BatchEntry entry_of_file(const fs::path& path, const fs::path& below, const std::vector<std::string>& with) {
  BatchEntry entry{path.string(), name_of(below), {}};
  if (is_job_file(path)) {
    entry.words = {command_of(path), "--job", path.string()};
  } else {
    entry.words = with;
    // A name that begins with a dash still means a file.
    entry.words.push_back(path.string().starts_with('-') ? "./" + path.string() : path.string());
  }
  return entry;
}

Status read_directory(const fs::path& directory, const std::vector<std::string>& with, const IsPart& is_part,
                      std::vector<BatchEntry>& entries) {
  std::vector<fs::path> files;
  std::error_code error;
  for (fs::recursive_directory_iterator at(directory, error), end; !error && at != end; at.increment(error)) {
    std::error_code ignored;
    if (at->is_regular_file(ignored) && (is_job_file(at->path()) || is_part(at->path().string()))) files.push_back(at->path());
  }
  if (error) return Error{Fault::kUsage, fmt::format("{}: {}", directory.string(), error.message())};
  if (files.empty()) {
    return Error{Fault::kUsage, fmt::format("{}: no part (.stl .obj .3mf, .gz of them) and no job (.toml) in it or below it",
                                            directory.string())};
  }
  std::ranges::sort(files);
  for (const fs::path& file : files) entries.push_back(entry_of_file(file, file.lexically_relative(directory), with));
  return {};
}

/// Name of a job in a list, from its first file.
std::string name_of_words(const std::vector<std::string>& words, const IsPart& is_part) {
  for (std::size_t i = 1; i < words.size(); ++i) {
    const fs::path path = words[i];
    if (!words[i].starts_with('-') && (is_part(words[i]) || is_job_file(path))) return name_of(path.filename());
  }
  return words.front().substr(0, kLongestName);
}

Status read_list(const std::string& path, const IsPart& is_part, std::vector<BatchEntry>& entries) {
  auto file = FileReader::open(path, {.fault = Fault::kUsage,
                                      .no_text = "not a text; a list has one command line a line",
                                      .max_bytes = kMaxListBytes,
                                      .longest_line = 1 << 20,
                                      .streams = true});
  if (!file) return file.error();
  const std::size_t before = entries.size();
  for (std::string_view line; file->next(line);) {
    const std::string source = fmt::format("{}:{}", path, file->line_number());
    Result<std::vector<std::string>> words = split_words(line);
    if (!words) return Error{Fault::kUsage, fmt::format("{}: {}", source, words.error().message)};
    if (!words->empty() && words->front() == "lamina") words->erase(words->begin());
    if (words->empty()) continue;
    std::string name = name_of_words(*words, is_part);
    entries.push_back({source, std::move(name), std::move(*words)});
  }
  if (!file->status()) return file->status().error();
  if (entries.size() == before) {
    return Error{Fault::kUsage,
                 fmt::format("{}: no job in it; write one command line a line, as: jet part.stl --dpi 600", path)};
  }
  return {};
}

}  // namespace

Result<std::vector<BatchEntry>> read_batch(const std::vector<std::string>& operands, const std::vector<std::string>& with,
                                           const IsPart& is_part) {
  std::vector<BatchEntry> entries;
  for (const std::string& operand : operands) {
    std::error_code error;
    const fs::file_status status = fs::status(operand, error);
    if (operand != "-" && !fs::exists(status))
      return Error{
          Fault::kUsage,
          fmt::format("{}: no such file or directory; name a list, a part, a job file or a directory of them", operand)};
    if (fs::is_directory(status)) {
      if (Status read = read_directory(operand, with, is_part, entries); !read) return read.error();
    } else if (is_job_file(operand) || is_part(operand)) {
      entries.push_back(entry_of_file(operand, fs::path(operand).filename(), with));
    } else if (Status read = read_list(operand, is_part, entries); !read) {
      return read.error();
    }
  }
  return entries;
}

}  // namespace lamina::pipeline
