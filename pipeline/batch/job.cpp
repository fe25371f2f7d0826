#include "pipeline/batch/job.h"
#include "pipeline/text/version.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <filesystem>
#include <map>
#include <set>
#include <span>

#include "pipeline/job/file.h"
#include "pipeline/text/number_text.h"

namespace lamina::pipeline {
namespace {

namespace fs = std::filesystem;

constexpr std::uint64_t kMebibyte = 1ull << 20;

/// What the batch writes in its directory; .part while they are written.
constexpr std::array kOwnFiles = {"batch.jsonl", "summary.json", "summary.json.part", "summary.tsv", "summary.tsv.part"};

const OptionSpec* find_option(const CommandSpec& spec, std::string_view name) {
  for (const OptionSpec& option : spec.options) {
    for (const std::string_view flag : split(option.flag, ",")) {
      if (flag == name) return &option;
    }
  }
  return nullptr;
}

/// Digests of the files that the jobs of a batch read; many jobs read the same ones.
class Digests {
 public:
  const FileDigest* of(const std::string& path) {
    const auto [found, fresh] = known_.try_emplace(path);
    std::error_code ignored;
    if (fresh && fs::is_regular_file(path, ignored)) {
      if (const Result<FileDigest> digest = digest_file(path)) found->second = *digest;
    }
    return found->second ? &*found->second : nullptr;
  }

 private:
  std::map<std::string, std::optional<FileDigest>> known_;
};

Hash128 hash_text(const std::string& text) { return hash_bytes(std::as_bytes(std::span(text))); }

/// A path seen from the batch's directory, as it is written; empty if it is not below.
fs::path below_batch(const fs::path& path, const std::string& directory) {
  const fs::path below = path.lexically_normal().lexically_relative(fs::path(directory).lexically_normal());
  return below.empty() || *below.begin() == ".." ? fs::path() : below;
}

/// Resolves one entry; what is wrong with the job itself becomes job.refused.
class Preparation {
 public:
  Preparation(const BatchShare& share, Digests& digests) : share_(share), digests_(digests) {}

  Status prepare(BatchJob& job) {
    const std::vector<std::string>& words = job.entry.words;
    if (words.front() == "batch" || words.front() == "preview") {
      return Error{Fault::kUsage, fmt::format("'{}' cannot be a job of a batch; run it by itself", words.front())};
    }
    job.command = find_command(words.front());
    if (job.command == nullptr) {
      return Error{Fault::kUsage, fmt::format("'{}' is no command; lamina --help lists them", words.front())};
    }
    const CommandSpec& spec = spec_of_command(*job.command);
    job.arguments.assign(words.begin() + 1, words.end());
    const Result<Arguments> read = read_arguments(spec, job.arguments);
    if (!read) return read.error();
    if (read->help) return Error{Fault::kUsage, "--help is no job"};
    Job planned;
    if (read->has("--job")) {
      if (Status status = read_job(read->text("--job"), planned); !status) return status;
    }
    std::vector<std::string> added;
    if (Status status = find_output(spec, *read, planned, job, added); !status) return status;
    job.can_resume = find_option(spec, "--resume") != nullptr && !read->has("--resume");
    job.can_overwrite = find_option(spec, "--overwrite") != nullptr && !read->has("--overwrite") && !read->has("--resume");
    for (const char* flag : {"--json", "--quiet"}) {
      if (find_option(spec, flag) != nullptr && !read->has(flag)) added.emplace_back(flag);
    }
    job.need_bytes = 16 * kMebibyte;
    if (const OptionSpec* memory = find_option(spec, "--memory")) {
      std::uint64_t bytes = share_.layer_bytes;
      if (read->has(memory->flag)) {
        read_bytes(read->text(memory->flag), bytes);
      } else {
        added.insert(added.end(), {"--memory", fmt::format("{}", bytes)});
      }
      job.need_bytes += bytes;
    }
    // One pool for all: a job's own number of threads would hold for the whole program.
    if (find_option(spec, "--threads") != nullptr) added.insert(added.end(), {"--threads", "0"});
    // The last one of an option counts, and nothing behind -- is an option.
    const auto end_of_options = std::ranges::find(job.arguments, "--");
    job.arguments.insert(end_of_options, added.begin(), added.end());
    look_at_inputs(*read, planned, job);
    return {};
  }

 private:
  const CommandSpec& spec_of_command(const Command& command) {
    const auto [found, fresh] = specs_.try_emplace(command.name);
    if (fresh) found->second = spec_of(command);
    return found->second;
  }

  Status find_output(const CommandSpec& spec, const Arguments& read, const Job& planned, BatchJob& job,
                     std::vector<std::string>& added) {
    const OptionSpec* option = find_option(spec, "--output");
    if (option == nullptr || read.has("--dry-run")) return {};
    const bool asked = read.has(option->flag);
    if (!asked && !planned.output.empty()) {
      job.output = planned.output;  // as the job file says
    } else if (asked) {
      const fs::path given = read.text(option->flag);
      job.relative_output = given.is_relative();
      job.output = (fs::path(share_.directory) / given).lexically_normal().string();
    } else if (option->value.find("DIR") != std::string::npos) {
      std::string name = job.entry.name;
      for (std::uint32_t next = 2; !names_.insert(name).second; ++next) name = fmt::format("{}-{}", job.entry.name, next);
      job.entry.name = name;
      job.output = (fs::path(share_.directory) / name).string();
    } else {
      return Error{Fault::kUsage,
                   fmt::format("{} {} is missing; in a batch it is below the batch's directory", "-o", option->value)};
    }
    added.insert(added.end(), {"--output", job.output});
    const fs::path below = below_batch(job.output, share_.directory);
    job.place = below.empty() ? job.output : below.string();
    return {};
  }

  void look_at_inputs(const Arguments& read, const Job& planned, BatchJob& job) {
    std::set<std::string> inputs(read.operands.begin(), read.operands.end());
    for (const auto& [flag, text] : read.options) {
      if (flag.find("--output") == std::string::npos && !text.empty()) inputs.insert(text);
    }
    if (read.operands.empty()) {
      for (const PartRequest& part : planned.parts) inputs.insert(part.path);
    }
    std::string identity = fmt::format("lamina {}\n{}\n", version(), job.place);
    for (const std::string& word : job.entry.words) identity += fmt::format("{}:{}\n", word.size(), word);
    for (const std::string& input : inputs) {
      const FileDigest* digest = digests_.of(input);
      if (digest == nullptr) continue;
      identity += fmt::format("{} {} {}\n", input, digest->bytes, hex(digest->hash));
      job.need_bytes += part_bytes(input, digest->bytes);
    }
    job.id = hash_text(identity);
  }

  const BatchShare& share_;
  Digests& digests_;
  std::map<std::string_view, CommandSpec> specs_;
  std::set<std::string> names_{kOwnFiles.begin(), kOwnFiles.end()};  // of outputs that are called as their jobs
};

bool lies_within(const fs::path& inner, const fs::path& outer) {
  return std::mismatch(outer.begin(), outer.end(), inner.begin(), inner.end()).first == outer.end();
}

/// Refuses outputs out of place, and two jobs that would write over each other.
/// Sorted by the parts of their paths, a directory stands right before what lies in it.
Status check_apart(const std::vector<BatchJob>& jobs, const std::string& directory) {
  std::vector<std::pair<fs::path, const BatchJob*>> outputs;
  std::error_code ignored;
  const fs::path own = fs::weakly_canonical(fs::absolute(directory, ignored), ignored);
  for (const BatchJob& job : jobs) {
    if (job.refused || job.output.empty()) continue;
    if (job.relative_output && below_batch(job.output, directory).empty()) {
      return Error{Fault::kUsage, fmt::format("{}: -o leads out of {}, to {}; an output elsewhere has to be an absolute path",
                                              job.entry.source, directory, job.output)};
    }
    fs::path path = fs::weakly_canonical(fs::absolute(job.output, ignored), ignored);
    if (!path.has_filename()) path = path.parent_path();
    if (path == own) {
      return Error{Fault::kUsage, fmt::format("{}: writes into {} itself, which belongs to the batch; give it a name "
                                              "below it with -o",
                                              job.entry.source, directory)};
    }
    for (const char* name : kOwnFiles) {
      if (!lies_within(path, own / name)) continue;
      return Error{Fault::kUsage, fmt::format("{}: writes into {}, which belongs to the batch; give it another name with "
                                              "-o",
                                              job.entry.source, (fs::path(directory) / name).string())};
    }
    outputs.emplace_back(std::move(path), &job);
  }
  std::ranges::stable_sort(outputs, {}, &std::pair<fs::path, const BatchJob*>::first);
  for (std::size_t i = 1; i < outputs.size(); ++i) {
    const auto& [outer, first] = outputs[i - 1];
    const auto& [inner, second] = outputs[i];
    if (lies_within(inner, outer)) {
      return Error{Fault::kUsage, fmt::format("{} and {}: both write into {}; give one of them another -o", first->entry.source,
                                              second->entry.source, first->output)};
    }
  }
  return {};
}

}  // namespace

std::uint64_t part_bytes(const std::string& path, std::uint64_t file_bytes) {
  std::string end = path.substr(path.size() - std::min<std::size_t>(path.size(), 4));
  std::ranges::transform(end, end.begin(), [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  if (end == ".stl" || end == ".obj") return 4 * file_bytes;
  if (end == ".3mf") return 40 * file_bytes;
  if (end.ends_with(".gz")) return 16 * file_bytes;
  return file_bytes;
}

Result<OutputDigest> digest_output(const std::string& path) {
  OutputDigest digest;
  std::vector<fs::path> files;
  std::error_code error;
  if (fs::is_regular_file(path, error)) files.emplace_back(path);
  if (fs::is_directory(path, error)) {
    for (fs::recursive_directory_iterator at(path, error), end; !error && at != end; at.increment(error)) {
      std::error_code ignored;
      if (at->is_regular_file(ignored)) files.push_back(at->path());
    }
    if (error) return Error{Fault::kVerification, fmt::format("{}: {}", path, error.message())};
  }
  std::ranges::sort(files);
  std::string text;
  for (const fs::path& file : files) {
    const Result<FileDigest> one = digest_file(file.string());
    if (!one) return one.error();
    text += fmt::format("{} {} {}\n", file.lexically_relative(path).string(), one->bytes, hex(one->hash));
    digest.bytes += one->bytes;
  }
  digest.files = files.size();
  digest.hash = hash_text(text);
  return digest;
}

Result<std::vector<BatchJob>> prepare_batch(std::vector<BatchEntry> entries, const BatchShare& share) {
  Digests digests;
  Preparation preparation(share, digests);
  std::vector<BatchJob> jobs;
  for (BatchEntry& entry : entries) {
    BatchJob& job = jobs.emplace_back();
    job.entry = std::move(entry);
    if (Status status = preparation.prepare(job); !status) job.refused = status.error();
  }
  if (Status status = check_apart(jobs, share.directory); !status) return status.error();
  return jobs;
}

}  // namespace lamina::pipeline
