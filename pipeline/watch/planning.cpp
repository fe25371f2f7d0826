#include "pipeline/watch/planning.h"

#include <fmt/format.h>
#include <malloc.h>

#include <algorithm>
#include <cerrno>
#include <filesystem>
#include <utility>

#include "pipeline/job/errors.h"
#include "pipeline/watch/after_job.h"
#include "pipeline/watch/moves.h"
#include "stages/load/load.h"
#include "stages/support/clocks.h"
#include "stages/support/io/file.h"
#include "stages/support/text/readable.h"
#include "stages/support/text/version.h"

namespace lamina::pipeline {
namespace {

namespace fs = std::filesystem;
using End = WatchTask::End;

constexpr std::uint64_t kFixedBytes = 16ull << 20;  // of a job, besides its layers and parts; as in a batch

std::string path_in(const WatchShared& shared, const WatchedInput& input) {
  return input.inside ? joined(shared.folder, input.path) : input.path;
}

/// The content of an input: of a folder, of all files in it. Zero if it cannot be read.
Hash128 content_of(const std::string& path) {
  if (is_file(path)) {
    const auto digest = digest_file(path);
    return digest ? digest->hash : Hash128{};
  }
  const auto digest = digest_tree(path);
  return digest ? digest->hash : Hash128{};
}

/// Whether an input has its stamp and, with `and_content`, its content.
bool is_unchanged(const WatchShared& shared, const WatchedInput& input, bool and_content) {
  const std::string path = path_in(shared, input);
  if (input.inside && stamp_of(path) != input.stamp) return false;
  return !and_content || content_of(path) == input.hash;
}

bool are_unchanged(const WatchShared& shared, const WatchedJob& job, bool and_content) {
  return std::ranges::all_of(job.inputs, [&](const auto& input) { return is_unchanged(shared, input, and_content); });
}

/// Hashes the inputs and names the job after them. returns  whether they are what the folder's scan has found
bool take_inputs(const WatchShared& shared, WatchedJob& job) {
  std::string identity = job.part + "\n";
  for (WatchedInput& input : job.inputs) {
    input.hash = content_of(path_in(shared, input));
    identity += fmt::format("{}:{} {} {} {}\n", input.path.size(), input.path, input.stamp.bytes, input.stamp.mtime_ns,
                            hex(input.hash));
  }
  job.id = hash_text(identity);
  for (const std::string& word : job.words) identity += fmt::format("{}:{}\n", word.size(), word);
  // Another watcher of equal parts may have the same root.
  job.work =
      joined(job.root, fmt::format(".watch/{}", hex(hash_text(shared.record->id() + identity + std::string(version())))));
  return are_unchanged(shared, job, false);
}

void fail(WatchedJob& job, const Error& error) {
  job.result.outcome = BatchOutcome::kFailed;
  job.result.code = static_cast<int>(error.fault);
  job.result.reason = one_line(error.message);
}

/// Runs the command in the work folder; continues what an earlier run left there, if the command can.
void run_command_of(WatchShared& shared, WatchTask& task) {
  WatchedJob& job = task.job;
  BatchJob& call = task.call;
  std::error_code error;
  const bool continues = call.can_continue && fs::exists(job.work, error);
  if (!continues) remove_work(job.work);
  error = make_work(job.work);
  if (error) return fail(job, {Fault::kOutput, fmt::format("{}: {}", job.work, error.message())});
  if (job.has_output) call.output = joined(job.work, fs::path(job.name).filename().string() + job.ending);
  CallSettings settings{call.output, call.layer_bytes, CallSettings::Earlier::kNone};
  if (continues) settings.earlier = CallSettings::Earlier::kContinue;
  const Stopwatch time;
  job.result = shared.run(
      call, settings, [](const ProgressEvent&) {}, task.cancel);
  if (continues && job.result.code != 0 && !task.cancel) {  // what a kill left may be of no use
    fs::remove_all(job.work, error);
    make_work(job.work);
    settings.earlier = CallSettings::Earlier::kNone;
    job.result = shared.run(
        call, settings, [](const ProgressEvent&) {}, task.cancel);
  }
  ::malloc_trim(0);  // returns freed memory to the system before the next job starts
  job.result.seconds = time.elapsed().wall;
  job.result.outcome = job.result.code == 0 ? BatchOutcome::kDone : BatchOutcome::kFailed;
  if (job.result.code != 0 || !job.has_output) return;
  const Result<TreeDigest> digest = digest_tree(job.work);
  if (!digest) return fail(job, {Fault::kOutput, digest.error().message});
  job.result.output = *digest;
}

/// A status of the record ends the watcher.
bool recorded(WatchTask& task, const Status& status) {
  if (status) return true;
  task.fatal = true;
  task.problem = status.error();
  task.end = End::kRetry;
  return false;
}

/// Whether a job failed by a fault of the machine, after which it is planned again: a full disk, or up to three times too
/// little memory, which the job itself may exhaust.
bool is_passing(WatchTask& task) {
  constexpr int kTries = 3;
  const int code = task.job.result.code;
  if (task.call.refused || task.cancel) return false;
  if (code == static_cast<int>(Fault::kOutput)) return true;
  return code == static_cast<int>(Fault::kMemory) && ++task.shortages < kTries;
}

/// returns  whether the job is planned; else task.end states why it is not
bool plan(WatchShared& shared, WatchTask& task) {
  WatchedJob& job = task.job;
  task.end = End::kChanged;
  if (!take_inputs(shared, job)) return false;
  {
    const std::lock_guard lock(shared.mutex);
    std::string& work = shared.record->begun_work()[job.part];
    if (work != job.work) remove_work(work);
    work = job.work;
    if (!recorded(task, shared.record->begun(job))) return false;
  }
  if (task.call.refused) {
    fail(job, *task.call.refused);
  } else {
    run_command_of(shared, task);
  }
  if (task.stop && job.result.code != 0) {
    task.end = End::kStopped;
    return false;
  }
  if (task.cancel && job.result.code != 0)
    fail(job, {Fault::kInput, fmt::format("took longer than its time limit of {} s", shared.time_limit_seconds)});
  const bool unchanged = are_unchanged(shared, job, true);
  if (unchanged && is_passing(task)) {
    task.end = End::kRetry;
    task.problem = Error{static_cast<Fault>(job.result.code),
                         fmt::format("{}: {}", path_in(shared, job.inputs.front()), job.result.reason)};
    return false;
  }
  const std::lock_guard lock(shared.mutex);
  if (!unchanged) {
    remove_work(job.work);
    shared.record->begun_work().erase(job.part);
    recorded(task, shared.record->dropped(job));
    return false;
  }
  choose_stem(job);
  if (!recorded(task, shared.record->planned(job))) return false;
  shared.record->begun_work().erase(job.part);
  job.planned = true;
  return true;
}

/// Moves the inputs that no other job of the folder reads; the one that names the job comes last.
/// An input that is gone was moved by an earlier run. errors  kOutput
Status move_inputs(WatchShared& shared, WatchedJob& job) {
  const std::string& to = job.result.code == 0 ? shared.done : shared.failed;
  for (std::size_t i = job.inputs.size(); i-- > 0;) {
    const WatchedInput& input = job.inputs[i];
    if (!input.inside) continue;
    {
      const std::lock_guard lock(shared.mutex);
      shared.moving.insert(job.part);
      std::set<std::string>& users = shared.used[input.path];
      users.erase(job.part);
      if (!users.empty()) continue;
    }
    const Result<std::optional<std::string>> moved = move_input(path_in(shared, input), input, to);
    if (!moved) return moved.error();
    if (i == 0) job.now = *moved ? **moved : find_moved(input, to).value_or("");
  }
  if (job.now.empty()) job.now = path_in(shared, job.inputs.front());
  return {};
}

/// Publishes, moves and runs the command. errors  kOutput; kInternal: the command cannot be started
Status end_job(WatchShared& shared, WatchTask& task) {
  WatchedJob& job = task.job;
  if (!job.moved && is_lost(job)) {
    const std::lock_guard lock(shared.mutex);
    if (!recorded(task, shared.record->dropped(job))) return {};
    task.end = End::kChanged;
    task.problem = Error{Fault::kOutput, fmt::format("{}: the result is gone; {} is planned again, if it is there",
                                                     result_path(job), path_in(shared, job.inputs.front()))};
    return {};
  }
  if (!job.moved) {
    {
      const std::lock_guard lock(shared.mutex);
      const auto again = [&](const WatchedJob& renamed) { return shared.record->planned(renamed); };
      if (Status status = publish(job, again); !status) return status;
    }
    if (Status status = move_inputs(shared, job); !status) return status;
    const std::lock_guard lock(shared.mutex);
    if (!recorded(task, shared.record->moved(job))) return {};
    job.moved = true;
  }
  if (!job.then.empty()) {
    {
      const std::lock_guard lock(shared.mutex);
      if (!recorded(task, shared.record->then(job))) return {};
    }
    task.in_command = true;
    const auto code = run_shell(job.then,
                                {{"LAMINA_OUTPUT", job.result.code == 0 ? full_path(result_path(job)) : ""},
                                 {"LAMINA_PART", full_path(job.now)},
                                 {"LAMINA_CODE", std::to_string(job.result.code)},
                                 {"LAMINA_ERROR", job.result.reason}},
                                shared.then_limit_seconds, task.stop);
    task.in_command = false;
    if (!code) return code.error();
    if (!*code) return {};  // stopped: it runs again
    task.then_code = **code;
  }
  const std::lock_guard lock(shared.mutex);
  if (recorded(task, shared.record->ended(job, task.then_code))) task.end = End::kEnded;
  return {};
}

}  // namespace

void prepare_task(const Candidate& candidate, Folder& folder, std::uint64_t layer_bytes, const ReadCall& read,
                  WatchTask& task) {
  WatchedJob& job = task.job;
  job.part = candidate.part;
  job.root = candidate.settings.output;
  job.then = candidate.settings.then;
  const std::string ending = endings_of(job.part);
  job.name = fs::path(job.part.substr(0, job.part.size() - ending.size()))
                 .lexically_relative(candidate.settings.folder.empty() ? "." : candidate.settings.folder)
                 .string();
  if (candidate.settings.folder.empty()) job.name = job.part.substr(0, job.part.size() - ending.size());
  // Its files have endings, numbers and names of unfinished files, each up to 255 bytes long.
  constexpr std::size_t kMaxName = 200;
  const fs::path name(job.name);
  job.name = joined(name.parent_path(), short_name(name.filename(), kMaxName));
  task.need_bytes = kFixedBytes;
  for (const std::string& file : candidate.inside) {
    const FileStamp& stamp = folder.files().at(file).stamp;
    job.inputs.push_back({file, true, stamp, {}});
    task.need_bytes += load::part_bytes(file, stamp.bytes);
  }
  for (const std::string& file : candidate.outside) {
    std::error_code ignored;
    job.inputs.push_back({file, false, {}, {}});
    if (is_file(file)) task.need_bytes += load::part_bytes(file, fs::file_size(file, ignored));
  }
  const std::string file = folder.path_of(candidate.job_file.empty() ? job.part : candidate.job_file);
  auto entry = read_batch({file}, candidate.settings.with);
  if (!entry) {
    task.call.refused = entry.error();
    return;
  }
  task.call.entry = std::move(entry->front());
  job.words = task.call.entry.words.unpacked();
  if (!candidate.job_file.empty() && candidate.job_file != job.part) job.words.push_back(folder.path_of(job.part));
  task.call.entry.words = job.words;
  Result<Call> call = read(job.words);
  if (!call) {
    task.call.refused = call.error();
    return;
  }
  task.call.parsed = std::move(call->parsed);
  task.call.can_continue = call->can_continue;
  job.has_output = call->ending.has_value();
  job.ending = call->ending.value_or("");
  if (!call->layer_bytes) return;
  task.call.layer_bytes = *call->layer_bytes > 0 ? *call->layer_bytes : layer_bytes;
  task.need_bytes += task.call.layer_bytes;
}

void run_task(WatchShared& shared, WatchTask& task, const std::function<void()>& planned) {
  if (!task.job.planned) {
    if (!plan(shared, task)) return;
    planned();
  }
  task.end = task.stop ? End::kStopped : End::kRetry;
  if (task.stop) return;
  if (const Status status = end_job(shared, task); !status) task.problem = status.error();
  if (task.end != End::kEnded && task.stop) task.end = End::kStopped;
}

}  // namespace lamina::pipeline
