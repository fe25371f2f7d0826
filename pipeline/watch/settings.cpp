#include "pipeline/watch/settings.h"

#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <filesystem>
#include <string_view>

#include "pipeline/job/errors.h"
#include "stages/support/io/file_reader.h"
#include "stages/support/text/escape.h"
#include "stages/support/text/number_text.h"
#include "stages/support/text/readable.h"
#include "stages/support/text/toml.h"

namespace lamina::pipeline {
namespace {

namespace fs = std::filesystem;

constexpr std::array<std::string_view, 4> kNames = {"with", "then", "settle_s", "output"};

fs::path canonical(const std::string& path) {
  std::error_code ignored;
  const fs::path full = fs::weakly_canonical(fs::absolute(path, ignored), ignored);
  return full.has_filename() ? full : full.parent_path();
}

bool is_below(const fs::path& inner, const fs::path& outer) {
  return std::mismatch(outer.begin(), outer.end(), inner.begin(), inner.end()).first == outer.end();
}

/// returns  "" or what is wrong
std::string read_setting(std::string_view name, const TomlValue& value, const std::string& path, const std::string& root,
                         const ReadCall& read, FolderSettings& settings) {
  if (!value.is_text()) return "is a text; write it in quotes";
  if (name == "settle_s") return read_number(value.text, 0, 1e6, " s", settings.settle_seconds);
  if (name == "then") {
    settings.then = value.text;
    return {};
  }
  if (name == "output") {
    if (value.text.empty()) return "is empty; name a directory";
    settings.output = full_path((fs::path(path).parent_path() / value.text).string());
    const Status apart = check_output(settings.output, root);
    return apart ? "" : apart.error().message;
  }
  const auto words = split_words(value.text);
  if (!words) return words.error().message;
  settings.with = *words;
  const Status valid = check_with(settings.with, read);
  return valid ? "" : valid.error().message;
}

}  // namespace

std::string full_path(const std::string& path) {
  std::error_code ignored;
  return path.empty() ? "" : fs::absolute(path, ignored).lexically_normal().string();
}

Status check_with(const std::vector<std::string>& with, const ReadCall& read) {
  if (with.empty()) return usage("no command; as in --with 'jet --dpi 600'");
  std::vector<std::string> words = with;
  words.push_back("part.stl");
  const Result<Call> call = read(words);
  if (!call) return call.error();
  if (!call->output.empty() && !call->output_of_job_file)
    return usage("has -o; results are named after the parts, leave it out");
  if (!call->side_output.empty())
    return usage("{}: is one file for all parts, and each would replace it; leave it out, or write a file for each with --then",
                 one_line(call->side_output));
  return {};
}

Status check_output(const std::string& output, const std::string& root) {
  const fs::path inner = canonical(output), outer = canonical(root);
  if (is_below(inner, outer))
    return usage("{}: is in the watched folder {}; name a directory outside of it", one_line(output), one_line(root));
  if (is_below(outer, inner))
    return usage("{}: contains the watched folder {}; name a directory next to it", one_line(output), one_line(root));
  return {};
}

Status read_watch_file(const std::string& path, const std::string& root, const ReadCall& read, FolderSettings& settings) {
  auto file = FileReader::open(path, {.fault = Fault::kUsage, .max_bytes = kMaxTomlBytes});
  if (!file) return file.error();
  struct stat status {};  // of the file that is read; another may get its name meanwhile
  if (::fstat(file->descriptor(), &status) != 0 ||
      ((status.st_uid != ::geteuid() && status.st_uid != 0) || (status.st_mode & (S_IWGRP | S_IWOTH)) != 0)) {
    return usage("{}: other users may write it, and it runs commands; change it with chown and chmod go-w", path);
  }
  const auto text = file->text();
  if (!text) return text.error();
  const Result<TomlValue> table = read_toml(*text, path);
  if (!table) return table.error();
  FolderSettings changed = settings;
  changed.folder = fs::path(path).parent_path().lexically_relative(root).string();
  if (changed.folder == ".") changed.folder.clear();
  if (table->find("output") == nullptr) changed.folder = settings.folder;
  for (std::size_t i = 0; i < table->name.size(); ++i) {
    const std::string& name = table->name[i];
    const auto where = table->value[i].position.text(path);
    if (std::ranges::find(kNames, name) == kNames.end())
      return usage("{}{}: unknown key{}", where, one_line(name), suggest(name, kNames));
    const std::string wrong = read_setting(name, table->value[i], path, root, read, changed);
    if (!wrong.empty()) return usage("{}{}: {}", where, name, wrong);
  }
  settings = std::move(changed);
  return {};
}

}  // namespace lamina::pipeline
