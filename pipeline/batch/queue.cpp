#include "pipeline/batch/queue.h"

#include <fmt/format.h>
#include <malloc.h>

#include <algorithm>
#include <chrono>
#include <condition_variable>
#include <filesystem>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <thread>
#include <utility>

#include "stages/load/part_store.h"
#include "stages/support/io/file.h"
#include "stages/support/io/sync.h"
#include "stages/support/text/readable.h"

namespace lamina::pipeline {
namespace {

using Clock = std::chrono::steady_clock;
using std::chrono::milliseconds;
constexpr std::chrono::seconds kGrace{20};            // for a job to stop at its time limit
constexpr std::chrono::milliseconds kLastGrace{600};  // with the batch: a signal is heard within a second
constexpr std::chrono::nanoseconds kTrimInterval{50'000'000};
constexpr Fault kOverdue = Fault::kInput;  // its part cannot be planned within the time limit

double seconds_since(Clock::time_point start) { return std::chrono::duration<double>(Clock::now() - start).count(); }

bool holds_something(const std::string& output) {
  std::error_code error;
  return !output.empty() && std::filesystem::exists(output, error) && !std::filesystem::is_empty(output, error);
}

/// A running job; shared with its thread, which may outlive the batch.
struct Slot {
  std::atomic<bool> cancel{false};
  std::atomic<std::uint32_t> layers_done{0}, layers{0};
  Clock::time_point begun, stop_requested;
  std::atomic<bool> overdue{false};
  bool abandoned = false;
};

class Queue : public std::enable_shared_from_this<Queue> {
 public:
  Queue(std::shared_ptr<const std::vector<BatchJob>> jobs, BatchRecord record, const BatchOptions& options, const RunJob& run)
      : kept_jobs_(std::move(jobs)), results_(jobs_.size()), record_(std::move(record)), options_(options), run_(run) {}

  Result<BatchSummary> run(const BatchWatcher& watcher, const std::atomic<bool>& interrupt) {
    const auto start = Clock::now();
    const std::size_t threads = std::min<std::size_t>(std::max(options_.jobs, 1u), jobs_.size());
    // Once while there is one thread: with another allocator (jemalloc, a sanitizer's) the first call initialises glibc's own,
    // which takes no lock for it.
    ::malloc_trim(0);
    if (options_.sync_in_groups) start_syncer();
    for (std::size_t i = 0; i < threads; ++i) start_worker();
    std::unique_lock lock(mutex_);
    while (true) {
      if (interrupt && !summary_.interrupted) {
        summary_.interrupted = true;
        stop_all();
      }
      check_clocks();
      if (const auto ended = report(watcher, lock);
          ended == jobs_.size() || (stopped_ && running_ == 0 && (unsynced_ == 0 || is_sync_overdue())))
        break;
      changed_.wait_for(lock, milliseconds(100));
    }
    report(watcher, lock);
    summary_.seconds = seconds_since(start);
    summary_.peak_resident_bytes = peak_resident_bytes();
    // Wakes idle workers so that they exit. A worker shares ownership of this object and may exit later.
    stopped_ = closed_ = true;
    changed_.notify_all();
    changed_.wait_for(lock, grace(), [&] { return workers_ == 0; });
    const BatchRecord released = std::move(record_);  // the next run may open it at once
    if (!record_status_) return record_status_.error();
    summary_.results = std::move(results_);  // what jobs that were abandoned return goes nowhere
    return std::move(summary_);
  }

 private:
  // Threads are detached: a job that ignores its stop must not keep the batch from ending.
  void start_worker() {
    ++workers_;
    std::thread([self = shared_from_this()] { self->work(); }).detach();
  }

  /// Whether a stopped batch has waited long enough for its disk. The jobs of the group have no end in the record then.
  bool is_sync_overdue() {
    if (!stopped_at_) stopped_at_ = Clock::now();
    summary_.abandoned = summary_.abandoned || Clock::now() - *stopped_at_ > kGrace;
    return Clock::now() - *stopped_at_ > kGrace;
  }

  /// A thread that syncs what has ended since its last sync.
  void start_syncer() {
    directory_device_ = device_of(options_.directory);
    folder_ = FolderSync::of({options_.directory});
    ++workers_;
    std::thread([self = shared_from_this()] { self->sync_groups(); }).detach();
  }

  void sync_groups() {
    std::unique_lock lock(mutex_);
    while (true) {
      changed_.wait(lock, [&] { return !group_.empty() || closed_; });
      if (group_.empty()) break;
      auto group = std::exchange(group_, {});
      lock.unlock();
      const Status status = folder_->sync();
      lock.lock();
      for (auto& [i, result] : group) {
        --unsynced_;
        record_end(i, status ? std::move(result) : failed(status.error(), std::move(result)));
      }
      changed_.notify_all();
    }
    --workers_;
    changed_.notify_all();
  }

  /// Whether the files of a job are on the file system that the group is synced on.
  bool syncs_in_group(const BatchJob& job) const {
    if (!options_.sync_in_groups || job.names_sync || job.below == 0) return false;
    std::filesystem::path folder = job.output;
    std::error_code ignored;
    if (std::filesystem::is_symlink(folder, ignored)) return false;  // its target may be elsewhere
    std::optional<std::uint64_t> device;
    while (!(device = device_of(folder.string())) && folder.has_parent_path()) folder = folder.parent_path();
    return device == directory_device_;
  }

  static std::optional<std::uint64_t> device_of(const std::string& path) {
    const std::optional<FileId> id = file_id(path);
    return id ? std::optional(id->device) : std::nullopt;
  }

  void stop_all() {
    stopped_ = true;
    for (const auto& [i, slot] : slots_) request_stop(*slot);
    changed_.notify_all();
  }

  std::chrono::milliseconds grace() const { return summary_.interrupted ? kLastGrace : std::chrono::milliseconds(kGrace); }

  static void request_stop(Slot& slot) {
    if (slot.cancel) return;
    slot.stop_requested = Clock::now();
    slot.cancel = true;
  }

  void check_clocks() {
    std::vector<std::pair<std::size_t, BatchResult>> abandoned;
    for (const auto& [i, shared] : slots_) {
      Slot& slot = *shared;
      if (options_.time_limit_seconds > 0 && !slot.cancel && seconds_since(slot.begun) > options_.time_limit_seconds) {
        slot.overdue = true;
        request_stop(slot);
      }
      if (!slot.cancel || Clock::now() - slot.stop_requested < grace()) continue;
      slot.abandoned = summary_.abandoned = true;
      BatchResult result;
      result.code = static_cast<int>(Fault::kInterrupted);
      result.reason = "did not stop after the stop request and was abandoned";
      result.seconds = seconds_since(slot.begun);
      stopped_by(slot, result, ", " + result.reason);
      abandoned.emplace_back(i, std::move(result));
    }
    for (auto& [i, result] : abandoned) {
      end(i, std::move(result));
      if (!stopped_) start_worker();
    }
  }

  /// Requires the lock and releases it during the observer's call. returns the number of ended jobs
  std::size_t report(const BatchWatcher& watcher, std::unique_lock<std::mutex>& lock) {
    BatchState state;
    state.total = static_cast<std::uint32_t>(jobs_.size());
    state.ended = ended_;
    state.failed = failed_;
    for (const auto& [i, slot] : slots_) state.running.push_back({jobs_[i].entry.name, slot->layers_done, slot->layers});
    std::vector<std::size_t> fresh = std::exchange(fresh_, {});
    std::ranges::sort(fresh);
    lock.unlock();
    // Ended jobs do not change any more.
    for (const std::size_t i : fresh) {
      if (watcher.ended) watcher.ended(jobs_[i], results_[i], state);
    }
    if (watcher.progress) watcher.progress(state);
    lock.lock();
    return state.ended;
  }

  void work() {
    std::unique_lock lock(mutex_);
    while (!stopped_ && next_ < jobs_.size()) {
      const BatchJob& job = jobs_[next_];
      if (running_ > 0 && need_ + job.need_bytes > options_.memory_bytes) {
        changed_.wait(lock);
        continue;
      }
      const std::size_t i = next_++;
      const std::shared_ptr<Slot> slot = slots_[i] = std::make_shared<Slot>();
      slot->begun = Clock::now();
      ++running_;
      take_memory(job.need_bytes);
      summary_.max_running = std::max(summary_.max_running, running_);
      summary_.max_need_bytes = std::max(summary_.max_need_bytes, need_);
      lock.unlock();
      BatchResult result = run_job(i, *slot);
      result.take_warnings();
      trim();
      lock.lock();
      if (slot->abandoned) break;  // another job has its place
      end(i, std::move(result));
    }
    --workers_;
    changed_.notify_all();
  }

  /// Requires the lock. Shared parts get what running jobs do not need. bytes  a job's need; negated at its end, modulo 2^64
  void take_memory(std::uint64_t bytes) {
    need_ += bytes;
    if (options_.loaded) options_.loaded->limit(loaded_share(options_.memory_bytes, need_));
  }

  /// Returns freed memory to the system; between small jobs only now and then, for they free little.
  void trim() {
    const std::int64_t now = Clock::now().time_since_epoch().count();
    std::int64_t last = last_trim_;
    if (now - last < kTrimInterval.count() || !last_trim_.compare_exchange_strong(last, now)) return;
    ::malloc_trim(0);
  }

  /// Requires the lock. A job that is done waits for the sync of its group.
  void end(std::size_t i, BatchResult result) {
    slots_.erase(i);
    --running_;
    take_memory(0 - jobs_[i].need_bytes);
    if (result.outcome == BatchOutcome::kDone && result.unsynced) {
      ++unsynced_;
      group_.emplace_back(i, std::move(result));
    } else {
      record_end(i, std::move(result));
    }
    changed_.notify_all();
  }

  /// Requires the lock.
  void record_end(std::size_t i, BatchResult result) {
    ++ended_;
    if (result.outcome != BatchOutcome::kDone && result.outcome != BatchOutcome::kKept) ++failed_;
    const bool news = result.outcome != BatchOutcome::kStopped && (result.outcome != BatchOutcome::kKept || result.recognized);
    if (news) note(record_.ended(jobs_[i], result));
    results_[i] = std::move(result);
    fresh_.push_back(i);
    if (options_.fail_fast && results_[i].failed()) stop_all();
  }

  void note(const Status& status) {
    if (!status && record_status_) record_status_ = status;
  }

  /// Must be called without the lock.
  BatchResult run_job(std::size_t i, Slot& slot) {
    const BatchJob& job = jobs_[i];
    if (job.refused) return failed(*job.refused);
    const BatchRecord::Earlier* earlier = options_.resume ? record_.earlier(job) : nullptr;
    if (earlier != nullptr && earlier->ended && earlier->begun == job.id) {
      const Result<TreeDigest> now = job.output.empty() ? TreeDigest() : digest_tree(job.output);
      const TreeDigest& then = earlier->output;
      if (job.output.empty() || (now && now->files == then.files && now->hash == then.hash)) {
        Result<BatchResult> result = record_.kept(*earlier);
        return result ? std::move(*result) : failed(result.error());
      }
    }
    const bool unowned = !replaces_ && (earlier == nullptr || earlier->unowned) && holds_something(job.output);
    {
      const std::lock_guard lock(mutex_);
      note(record_.begun(job, unowned));
    }
    const bool synced_later = syncs_in_group(job);
    CallSettings settings{job.output, job.layer_bytes, earlier_of(job, earlier, unowned), synced_later};
    BatchResult result = run_call(job, slot, settings);
    const bool continued = settings.earlier == CallSettings::Earlier::kContinue && !earlier_ended(earlier);
    if (replaces_ && continued && job.can_replace && result.code == static_cast<int>(Fault::kUsage)) {
      // It was killed before it had replaced what was there.
      settings.earlier = CallSettings::Earlier::kReplace;
      result = run_call(job, slot, settings);
    }
    result.unsynced = synced_later;
    result.recognized = result.recognized && unowned && result.outcome == BatchOutcome::kDone;
    if (result.outcome == BatchOutcome::kDone && !job.output.empty() && !result.digested) {
      const Result<TreeDigest> digest = digest_tree(job.output);
      if (!digest) return failed({Fault::kOutput, digest.error().message}, std::move(result));
      result.output = *digest;
    }
    if (result.outcome == BatchOutcome::kDone && result.recognized) result.outcome = BatchOutcome::kKept;
    return result;
  }

  /// Recorded output of the same job is continued, recorded output of another job is replaced. For unrecorded output the
  /// command decides whether it is its own.
  CallSettings::Earlier earlier_of(const BatchJob& job, const BatchRecord::Earlier* earlier, bool unowned) const {
    const bool same = earlier != nullptr && earlier->begun == job.id;
    if (job.can_continue && (unowned ? options_.resume : same)) return CallSettings::Earlier::kContinue;
    if (!unowned && job.can_replace && (replaces_ || earlier != nullptr)) return CallSettings::Earlier::kReplace;
    return CallSettings::Earlier::kNone;
  }

  static bool earlier_ended(const BatchRecord::Earlier* earlier) { return earlier != nullptr && earlier->ended; }

  static BatchResult failed(const Error& error, BatchResult result = {}) {
    result.outcome = BatchOutcome::kFailed;
    result.code = static_cast<int>(error.fault);
    result.reason = one_line(error.message);
    return result;
  }

  /// Sets the result of a stopped job: stopped with the batch, or by its time limit, whose message ends with `rest`.
  void stopped_by(const Slot& slot, BatchResult& result, const std::string& rest = {}) const {
    result.outcome = slot.overdue ? BatchOutcome::kTimeLimit : BatchOutcome::kStopped;
    if (!slot.overdue) return;
    result.code = static_cast<int>(kOverdue);
    result.reason = fmt::format("took longer than its time limit of {} s{}", options_.time_limit_seconds, rest);
  }

  BatchResult run_call(const BatchJob& job, Slot& slot, const CallSettings& settings) const {
    const auto start = Clock::now();
    const ProgressCallback progress = [&slot](const ProgressEvent& event) {
      slot.layers_done.store(event.done, std::memory_order_relaxed);
      slot.layers.store(event.total, std::memory_order_relaxed);
    };
    BatchResult result = run_(job, settings, progress, slot.cancel);
    result.seconds = seconds_since(start);
    result.outcome = result.code == 0 ? BatchOutcome::kDone : BatchOutcome::kFailed;
    if (result.code == static_cast<int>(Fault::kInterrupted)) stopped_by(slot, result);
    return result;
  }

  const std::shared_ptr<const std::vector<BatchJob>> kept_jobs_;
  const std::vector<BatchJob>& jobs_ = *kept_jobs_;
  std::vector<BatchResult> results_;                    // one a job
  std::map<std::size_t, std::shared_ptr<Slot>> slots_;  // of running jobs
  std::vector<std::size_t> fresh_;                      // ended and not reported yet
  BatchRecord record_;
  BatchOptions options_;
  RunJob run_;
  const bool replaces_ = options_.overwrite || record_.replaces();

  std::atomic<std::int64_t> last_trim_{0};
  std::mutex mutex_;
  std::condition_variable changed_;
  std::size_t next_ = 0;
  std::uint32_t running_ = 0, workers_ = 0, ended_ = 0, failed_ = 0;
  std::uint64_t need_ = 0;
  bool stopped_ = false, closed_ = false;
  std::vector<std::pair<std::size_t, BatchResult>> group_;  // ended, with files to be synced
  std::uint32_t unsynced_ = 0;                              // of the group, and of the one that is being synced
  std::optional<Clock::time_point> stopped_at_;
  std::optional<FolderSync> folder_;  // opened before anything is written
  std::optional<std::uint64_t> directory_device_;
  Status record_status_;
  BatchSummary summary_;
};

}  // namespace

std::uint64_t loaded_share(std::uint64_t memory_bytes, std::uint64_t need_bytes) {
  return std::min(memory_bytes / 4, memory_bytes - std::min(memory_bytes, need_bytes));
}

std::uint64_t layer_share(std::uint64_t memory_bytes, std::uint32_t jobs) {
  constexpr std::uint64_t kMin = 32ull << 20;
  return std::max(memory_bytes / (2 * std::max(jobs, 1u)), kMin);
}

Result<BatchSummary> run_batch(std::shared_ptr<const std::vector<BatchJob>> jobs, BatchRecord record,
                               const BatchOptions& options, const RunJob& run, const BatchWatcher& watcher,
                               const std::atomic<bool>& interrupt) {
  return std::make_shared<Queue>(std::move(jobs), std::move(record), options, run)->run(watcher, interrupt);
}

}  // namespace lamina::pipeline
