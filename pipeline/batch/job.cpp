#include "pipeline/batch/job.h"

#include <fmt/format.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <filesystem>
#include <map>
#include <set>

#include "pipeline/job/errors.h"
#include "pipeline/job/job_command.h"
#include "stages/load/load.h"
#include "stages/support/io/file.h"
#include "stages/support/io/file_reader.h"
#include "stages/support/text/escape.h"
#include "stages/support/text/number_text.h"
#include "stages/support/text/readable.h"
#include "stages/support/text/version.h"

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
    entry.words = std::vector<std::string>{command_of(path), "--job", path.string()};
  } else {
    std::vector<std::string> words = with;
    // A name that begins with a dash still means a file.
    words.push_back(path.string().starts_with('-') ? "./" + path.string() : path.string());
    entry.words = words;
  }
  return entry;
}

Status read_directory(const fs::path& directory, const std::vector<std::string>& with, std::vector<BatchEntry>& entries) {
  std::vector<fs::path> files;
  std::error_code error;
  for (fs::recursive_directory_iterator at(directory, error), end; !error && at != end; at.increment(error)) {
    std::error_code ignored;
    if (at->is_regular_file(ignored) && (is_job_file(at->path()) || load::is_part_name(at->path().string())))
      files.push_back(at->path());
  }
  if (error) return usage("{}: {}", directory.string(), error.message());
  if (files.empty())
    return usage("{}: no part (.stl .obj .3mf, .gz of them) and no job (.toml) in it or below it", directory.string());
  std::ranges::sort(files);
  for (const fs::path& file : files) entries.push_back(entry_of_file(file, file.lexically_relative(directory), with));
  return {};
}

/// Name of a job in a list, from its first file.
std::string name_of_words(const std::vector<std::string>& words) {
  for (std::size_t i = 1; i < words.size(); ++i) {
    const fs::path path = words[i];
    if (!words[i].starts_with('-') && (load::is_part_name(words[i]) || is_job_file(path))) return name_of(path.filename());
  }
  return words.front().substr(0, kLongestName);
}

Status read_list(const std::string& path, std::vector<BatchEntry>& entries) {
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
    if (!words) return usage("{}: {}", source, words.error().message);
    if (!words->empty() && words->front() == "lamina") words->erase(words->begin());
    if (words->empty()) continue;
    std::string name = name_of_words(*words);
    entries.push_back({source, std::move(name), *words});
  }
  if (!file->status()) return file->status().error();
  if (entries.size() == before)
    return usage("{}: no job in it; write one command line a line, as: jet part.stl --dpi 600", path);
  return {};
}

constexpr std::uint64_t kMebibyte = 1ull << 20;

/// The batch's own files in its directory; .part while being written.
constexpr std::array kOwnFiles = {"batch.jsonl",      "summary.json", "summary.json.part", "summary.tsv",
                                  "summary.tsv.part", "shares.tsv",   "shares.tsv.part"};

/// A path relative to the batch's directory; empty if it is not below.
fs::path below_batch(const fs::path& path, const std::string& directory) {
  const fs::path below = path.lexically_normal().lexically_relative(fs::path(directory).lexically_normal());
  return below.empty() || *below.begin() == ".." ? fs::path() : below;
}

/// Hashes the input files of jobs. Many jobs read the same file: it is read once.
class JobIdentities {
 public:
  explicit JobIdentities(InputDigests* inputs) : inputs_(inputs) {}

  /// Sets the job's id and adds the memory for its input files.
  void identify(const std::vector<std::string>& words, const std::vector<std::string>& inputs, BatchJob& job) {
    std::string identity = fmt::format("lamina {}\n{}\n", version(), job.position());
    for (const std::string& word : words) identity += fmt::format("{}:{}\n", word.size(), word);
    for (const std::string& input : std::set<std::string>(inputs.begin(), inputs.end())) {
      const auto [known, fresh] = digests_.try_emplace(hash_text(input));
      if (fresh && is_file(input)) {
        const Result<FileDigest> read = inputs_ != nullptr ? inputs_->of(input) : digest_file(input);
        if (read) known->second = *read;
      }
      const std::optional<FileDigest>& digest = known->second;
      if (!digest) continue;
      identity += fmt::format("{} {} {}\n", input, digest->bytes, hex(digest->hash));
      job.need_bytes += load::part_bytes(input, digest->bytes);
    }
    job.id = hash_text(identity);
  }

 private:
  InputDigests* const inputs_;
  std::map<Hash128, std::optional<FileDigest>, HashOrder> digests_;  // by the names of the files
};

/// Resolves entries in order; an error of a single job becomes job.refused.
class Preparation {
 public:
  explicit Preparation(const BatchShare& share) : share_(share), identities_(share.inputs) {
    for (const char* name : kOwnFiles) names_.insert(hash_text(name));
  }

  /// call  of the job's words
  void prepare(BatchJob& job, Result<Call> call, const InspectCall& inspect) {
    const std::vector<std::string> words = job.entry.words.unpacked();
    if (!call) {
      job.refused = call.error();
      if (inspect) inspect(job, {});
      return;
    }
    job.can_continue = call->can_continue;
    job.can_replace = call->can_replace;
    job.names_sync = call->names_sync;
    job.parsed = std::move(call->parsed);
    find_output(*call, job);
    job.need_bytes = 16 * kMebibyte;
    if (call->layer_bytes) {
      job.layer_bytes = *call->layer_bytes > 0 ? *call->layer_bytes : share_.layer_bytes;
      job.need_bytes += job.layer_bytes;
    }
    inspect ? inspect(job, *call) : identities_.identify(words, call->inputs, job);
  }

 private:
  void find_output(const Call& call, BatchJob& job) {
    if (!call.output.empty() && call.output_of_job_file) {
      job.output = call.output;
    } else if (!call.output.empty()) {
      const fs::path given = call.output;
      job.relative_output = given.is_relative();
      job.output = (fs::path(share_.directory) / given).lexically_normal().string();
    } else if (call.ending) {
      std::string name = job.entry.name;
      for (std::uint32_t next = 2; !names_.insert(hash_text(name + *call.ending)).second; ++next) {
        name = fmt::format("{}-{}", job.entry.name, next);
      }
      job.entry.name = name;
      job.output = (fs::path(share_.directory) / (name + *call.ending)).string();
    } else {
      return;
    }
    job.output.shrink_to_fit();
    const std::string below = below_batch(job.output, share_.directory).string();
    if (!below.empty() && job.output.ends_with(below)) job.below = static_cast<std::uint32_t>(job.output.size() - below.size());
  }

  const BatchShare& share_;
  JobIdentities identities_;
  std::set<Hash128, HashOrder> names_;  // of outputs named after their jobs, and own files
};

/// A path as text that is sorted by the parts of paths: what separates them comes before all else.
std::string sortable(const fs::path& path) {
  std::string text = path.string();
  std::ranges::replace(text, '/', '\0');
  text.shrink_to_fit();
  return text;
}

/// Refuses misplaced outputs, and jobs whose outputs collide.
/// Sorted by the parts of their paths, a directory stands right before what lies in it.
Status check_apart(const std::vector<BatchJob>& jobs, const std::string& directory) {
  std::vector<std::pair<std::string, const BatchJob*>> outputs;
  std::error_code ignored;
  const fs::path own = fs::weakly_canonical(fs::absolute(directory, ignored), ignored);
  for (const BatchJob& job : jobs) {
    if (job.refused || job.output.empty()) continue;
    const auto refused = [&](const std::string& why) { return usage("{}: {}", job.entry.source, why); };
    if (job.relative_output && below_batch(job.output, directory).empty()) {
      return refused(
          fmt::format("-o leads out of {}, to {}; an output elsewhere has to be an absolute path", directory, job.output));
    }
    fs::path path = fs::weakly_canonical(fs::absolute(job.output, ignored), ignored);
    if (!path.has_filename()) path = path.parent_path();
    if (path == own) {
      return refused(
          fmt::format("writes into {} itself, which belongs to the batch; give it a name below it with -o", directory));
    }
    const fs::path below = below_batch(path, own.string());
    if (!below.empty() && is_batch_file(below.begin()->string())) {
      return refused(fmt::format("writes into {}, which belongs to the batch; give it another name with -o",
                                 (fs::path(directory) / *below.begin()).string()));
    }
    outputs.emplace_back(sortable(path), &job);
  }
  std::ranges::stable_sort(outputs, {}, &std::pair<std::string, const BatchJob*>::first);
  for (std::size_t i = 1; i < outputs.size(); ++i) {
    const auto& [outer, first] = outputs[i - 1];
    const auto& [inner, second] = outputs[i];
    if (inner.starts_with(outer) && (inner.size() == outer.size() || inner[outer.size()] == '\0' || outer.ends_with('\0'))) {
      return usage("{} and {}: both write into {}; give one of them another -o", first->entry.source, second->entry.source,
                   first->output);
    }
  }
  return {};
}

}  // namespace

void BatchResult::take_warnings() {
  const Json* const list = value.find("warnings");
  if (list == nullptr || list->empty()) return;
  warnings = static_cast<std::uint32_t>(list->size());
  const Json& first = list->front();
  const Json* text = first.is_object() ? first.find("text") : &first;
  if (text != nullptr) first_warning = text->text();
}

namespace {

constexpr std::string_view kOutcomes[] = {"done", "kept", "failed", "time limit", "stopped", "not run"};

}  // namespace

std::string_view outcome_name(BatchOutcome outcome) { return kOutcomes[static_cast<std::size_t>(outcome)]; }

std::optional<BatchOutcome> outcome_of(std::string_view name) {
  const auto found = std::ranges::find(kOutcomes, name);
  if (found == std::end(kOutcomes)) return {};
  return static_cast<BatchOutcome>(found - std::begin(kOutcomes));
}

Result<std::vector<BatchEntry>> read_batch(const std::vector<std::string>& operands, const std::vector<std::string>& with) {
  std::vector<BatchEntry> entries;
  for (const std::string& operand : operands) {
    std::error_code error;
    const fs::file_status status = fs::status(operand, error);
    if (operand != "-" && !fs::exists(status))
      return usage("{}: no such file or directory; name a list, a part, a job file or a directory of them", operand);
    if (fs::is_directory(status)) {
      if (Status read = read_directory(operand, with, entries); !read) return read.error();
    } else if (is_job_file(operand) || load::is_part_name(operand)) {
      entries.push_back(entry_of_file(operand, fs::path(operand).filename(), with));
    } else if (Status read = read_list(operand, entries); !read) {
      return read.error();
    }
  }
  return entries;
}

bool is_batch_file(std::string_view name) {
  if (std::ranges::find(kOwnFiles, name) != kOwnFiles.end()) return true;
  if (name.ends_with(".part")) name.remove_suffix(5);
  for (const auto& [before, after] :
       {std::pair<std::string_view, std::string_view>{"batch-", ".jsonl"}, {"summary-", ".json"}, {"summary-", ".tsv"}}) {
    if (!name.starts_with(before) || !name.ends_with(after) || name.size() < before.size() + after.size()) continue;
    const std::string_view share = name.substr(before.size(), name.size() - before.size() - after.size());
    const std::size_t of = share.find("-of-");
    std::array<std::uint32_t, 2> ignored{};
    if (of == std::string_view::npos) continue;
    if (read_shard(fmt::format("{}/{}", share.substr(0, of), share.substr(of + 4)), ignored).empty()) return true;
  }
  return false;
}

Result<std::vector<BatchJob>> prepare_batch(std::vector<BatchEntry> entries, const BatchShare& share, const ReadCall& read,
                                            const InspectCall& inspect) {
  constexpr std::size_t kAtOnce = 1024;  // command lines, whose options take more than the jobs that stay
  Preparation preparation(share);
  std::vector<BatchJob> jobs;
  jobs.reserve(entries.size());
  std::vector<Result<Call>> calls;
  for (std::size_t first = 0; first < entries.size(); first += kAtOnce) {
    const std::size_t count = std::min(kAtOnce, entries.size() - first);
    calls.assign(count, Error{});
    tbb::parallel_for(std::size_t{0}, count, [&](std::size_t i) { calls[i] = read(entries[first + i].words.unpacked()); });
    for (std::size_t i = 0; i < count; ++i) {
      BatchJob& job = jobs.emplace_back();
      job.number = static_cast<std::uint32_t>(jobs.size());
      job.entry = std::move(entries[first + i]);
      preparation.prepare(job, std::move(calls[i]), inspect);
    }
  }
  if (Status status = check_apart(jobs, share.directory); !status) return status.error();
  return jobs;
}

void identify_jobs(std::vector<BatchJob>& jobs, const BatchShare& share, const ReadCall& read) {
  JobIdentities identities(share.inputs);
  for (BatchJob& job : jobs) {
    if (job.refused) continue;
    const std::vector<std::string> words = job.entry.words.unpacked();
    const Result<Call> call = read(words);
    identities.identify(words, call ? call->inputs : std::vector<std::string>(), job);
  }
}

}  // namespace lamina::pipeline
