#include "pipeline/batch/job.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <filesystem>
#include <map>
#include <set>

#include "stages/load/load.h"
#include "stages/support/io/file_target.h"
#include "stages/support/text/version.h"

namespace lamina::pipeline {
namespace {

namespace fs = std::filesystem;

constexpr std::uint64_t kMebibyte = 1ull << 20;

/// The batch's own files in its directory; .part while being written.
constexpr std::array kOwnFiles = {"batch.jsonl", "summary.json", "summary.json.part", "summary.tsv", "summary.tsv.part"};

/// A path relative to the batch's directory; empty if it is not below.
fs::path below_batch(const fs::path& path, const std::string& directory) {
  const fs::path below = path.lexically_normal().lexically_relative(fs::path(directory).lexically_normal());
  return below.empty() || *below.begin() == ".." ? fs::path() : below;
}

/// Resolves entries in order; an error of a single job becomes job.refused.
class Preparation {
 public:
  explicit Preparation(const BatchShare& share) : share_(share) {}

  void prepare(BatchJob& job, const ReadCall& read) {
    Result<Call> call = read(job.entry.words);
    if (!call) {
      job.refused = call.error();
      return;
    }
    job.call = std::move(*call);
    find_output(job);
    job.need_bytes = 16 * kMebibyte;
    if (job.call.layer_bytes) {
      job.layer_bytes = *job.call.layer_bytes > 0 ? *job.call.layer_bytes : share_.layer_bytes;
      job.need_bytes += job.layer_bytes;
    }
    digest_inputs(job);
  }

 private:
  void find_output(BatchJob& job) {
    const Call& call = job.call;
    if (!call.output.empty() && call.output_of_job_file) {
      job.output = call.output;
    } else if (!call.output.empty()) {
      const fs::path given = call.output;
      job.relative_output = given.is_relative();
      job.output = (fs::path(share_.directory) / given).lexically_normal().string();
    } else if (call.ending) {
      std::string name = job.entry.name;
      for (std::uint32_t next = 2; !names_.insert(name + *call.ending).second; ++next) {
        name = fmt::format("{}-{}", job.entry.name, next);
      }
      job.entry.name = name;
      job.output = (fs::path(share_.directory) / (name + *call.ending)).string();
    } else {
      return;
    }
    const fs::path below = below_batch(job.output, share_.directory);
    job.position = below.empty() ? job.output : below.string();
  }

  void digest_inputs(BatchJob& job) {
    std::string identity = fmt::format("lamina {}\n{}\n", version(), job.position);
    for (const std::string& word : job.entry.words) identity += fmt::format("{}:{}\n", word.size(), word);
    for (const std::string& input : std::set<std::string>(job.call.inputs.begin(), job.call.inputs.end())) {
      const auto [known, fresh] = digests_.try_emplace(input, Error{});
      if (fresh && is_file(input)) known->second = digest_file(input);
      const Result<FileDigest>& digest = known->second;
      if (!digest) continue;
      identity += fmt::format("{} {} {}\n", input, digest->bytes, hex(digest->hash));
      job.need_bytes += load::part_bytes(input, digest->bytes);
    }
    job.id = hash_text(identity);
  }

  const BatchShare& share_;
  std::map<std::string, Result<FileDigest>> digests_;                // many jobs read the same files
  std::set<std::string> names_{kOwnFiles.begin(), kOwnFiles.end()};  // of outputs named after their jobs
};

bool lies_within(const fs::path& inner, const fs::path& outer) {
  return std::mismatch(outer.begin(), outer.end(), inner.begin(), inner.end()).first == outer.end();
}

/// Refuses misplaced outputs, and jobs whose outputs collide.
/// Sorted by the parts of their paths, a directory stands right before what lies in it.
Status check_apart(const std::vector<BatchJob>& jobs, const std::string& directory) {
  std::vector<std::pair<fs::path, const BatchJob*>> outputs;
  std::error_code ignored;
  const fs::path own = fs::weakly_canonical(fs::absolute(directory, ignored), ignored);
  for (const BatchJob& job : jobs) {
    if (job.refused || job.output.empty()) continue;
    const auto refused = [&](const std::string& why) {
      return Error{Fault::kUsage, fmt::format("{}: {}", job.entry.source, why)};
    };
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
    for (const char* name : kOwnFiles) {
      if (!lies_within(path, own / name)) continue;
      return refused(fmt::format("writes into {}, which belongs to the batch; give it another name with -o",
                                 (fs::path(directory) / name).string()));
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

std::string_view outcome_name(BatchOutcome outcome) {
  constexpr std::string_view kNames[] = {"done", "kept", "failed", "time limit", "stopped", "not run"};
  return kNames[static_cast<std::size_t>(outcome)];
}

Result<std::vector<BatchJob>> prepare_batch(std::vector<BatchEntry> entries, const BatchShare& share, const ReadCall& read) {
  Preparation preparation(share);
  std::vector<BatchJob> jobs;
  for (BatchEntry& entry : entries) {
    BatchJob& job = jobs.emplace_back();
    job.number = static_cast<std::uint32_t>(jobs.size());
    job.entry = std::move(entry);
    preparation.prepare(job, read);
  }
  if (Status status = check_apart(jobs, share.directory); !status) return status.error();
  return jobs;
}

}  // namespace lamina::pipeline
