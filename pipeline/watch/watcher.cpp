#include "pipeline/watch/watcher.h"

#include <fmt/format.h>
#include <malloc.h>
#include <poll.h>
#include <sys/eventfd.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <condition_variable>
#include <deque>
#include <filesystem>
#include <map>
#include <memory>
#include <thread>
#include <utility>
#include <vector>

#include "pipeline/batch/queue.h"
#include "pipeline/job/errors.h"
#include "pipeline/watch/after_job.h"
#include "pipeline/watch/candidates.h"
#include "pipeline/watch/folder.h"
#include "pipeline/watch/moves.h"
#include "pipeline/watch/planning.h"
#include "stages/load/part_store.h"

namespace lamina::pipeline {
namespace {

namespace fs = std::filesystem;
using Clock = std::chrono::steady_clock;
using std::chrono::milliseconds;
using End = WatchTask::End;

constexpr milliseconds kTick{100};       // until a signal is heard
constexpr milliseconds kBetween{20};     // min time between two scans
constexpr milliseconds kLastGrace{600};  // for running jobs after a signal: it is heard within a second
constexpr std::chrono::seconds kRetryAfter{10};

/// What the main thread and the threads of jobs share; these may outlive the watcher.
struct Running {
  WatchShared shared;
  std::vector<WatchedJob> planned;  // news, guarded by shared.mutex, as is the next
  std::vector<std::shared_ptr<WatchTask>> ended;
  std::condition_variable changed;
  int wake = -1;  // an eventfd

  ~Running() {
    if (wake >= 0) ::close(wake);
  }
  template <class News>
  void report(std::vector<News>& list, const News& news) {
    {
      const std::lock_guard lock(shared.mutex);
      list.push_back(news);
    }
    changed.notify_all();
    const std::uint64_t one = 1;
    if (wake >= 0 && ::write(wake, &one, sizeof one) < 0) return;  // the next tick is soon
  }
};

/// A task that waits: for the next try, or for memory.
struct Waiting {
  std::shared_ptr<WatchTask> task;
  Clock::time_point from;
};

class FolderWatcher {
 public:
  FolderWatcher(const WatchOptions& options, const ReadCall& read, const WatchObserver& observer, Folder folder)
      : options_(options),
        read_(read),
        observer_(observer),
        folder_(std::move(folder)),
        candidates_(folder_, options.settings, read_) {}

  WatchSummary run(WatchRecord record, const RunJob& run, std::string done, std::string failed,
                   const std::atomic<bool>& interrupt) {
    WatchShared& shared = running_->shared;
    shared.folder = options_.folder;
    shared.done = std::move(done);
    shared.failed = std::move(failed);
    shared.run = run;
    shared.time_limit_seconds = options_.time_limit_seconds;
    shared.then_limit_seconds = options_.then_limit_seconds;
    running_->wake = ::eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC);
    ::malloc_trim(0);  // once while there is one thread, as in a batch
    for (WatchedJob& job : record.take_unfinished()) add_unfinished(std::move(job));
    shared.record.emplace(std::move(record));
    while (!interrupt && !fatal_) {
      report();
      scan_if_due(interrupt);
      start_tasks(interrupt);
      if (options_.once && is_finished()) break;
      wait();
    }
    stop(interrupt);
    report();
    if (!summary_.abandoned) shared.record.reset();  // the next run may open it at once
    summary_.problem = fatal_;
    summary_.left = candidates_.left;
    for (const Waiting& one : waiting_) {
      if (summary_.left == Fault::kInterrupted) summary_.left = one.task->problem ? one.task->problem->fault : Fault::kOutput;
    }
    return summary_;
  }

 private:
  void add_unfinished(WatchedJob job) {
    auto task = std::make_shared<WatchTask>();
    task->job = std::move(job);
    active_.insert(task->job.part);
    waiting_.push_back({std::move(task), Clock::now()});
  }

  void wait() {
    for (const auto& task : tasks_) {
      const std::chrono::duration<double> time = Clock::now() - task->begun;
      if (options_.time_limit_seconds > 0 && time.count() > options_.time_limit_seconds) task->cancel = true;
    }
    std::array<pollfd, 2> sources = {pollfd{folder_.events(), POLLIN, 0}, pollfd{running_->wake, POLLIN, 0}};
    ::poll(sources.data(), sources.size(), static_cast<int>(kTick.count()));
    std::uint64_t count = 0;
    if (sources[1].revents != 0 && ::read(running_->wake, &count, sizeof count) < 0) return;
    // Writers may cause many events: they are gathered.
    if (sources[0].revents != 0) std::this_thread::sleep_for(kBetween);
  }

  void scan_if_due(const std::atomic<bool>& interrupt) {
    news_ = folder_.take_events() || news_;
    const auto now = Clock::now();
    if (!first_ && (now < next_scan_ || (!news_ && now < next_poll_))) return;
    first_ = news_ = false;
    const Status status = folder_.scan();
    for (const std::string& problem : folder_.take_problems()) observer_.note(problem);
    next_poll_ =
        Clock::now() + std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(options_.poll_seconds));
    if (status) {
      candidates_.find(active_, interrupt);
      {
        const std::lock_guard lock(running_->shared.mutex);
        running_->shared.used = candidates_.used;
        for (auto& [file, users] : running_->shared.used)
          std::erase_if(users, [&](const std::string& user) { return running_->shared.moving.contains(user); });
      }
      for (const std::string& line : candidates_.take_waits()) observer_.note(line);
    } else {
      candidates_.ready.clear();
    }
    if (!status && scanned_ && !options_.once) observer_.failed(status.error());
    if (!status && options_.once) fatal_ = status.error();
    scanned_ = status.ok();
    if (scanned_ && std::exchange(is_new_, false)) remove_lost_work();
    next_scan_ = Clock::now() + std::max<Clock::duration>(kBetween, 4 * (Clock::now() - now));
  }

  /// Removes what killed runs began of parts that are gone.
  void remove_lost_work() {
    const std::lock_guard lock(running_->shared.mutex);
    std::erase_if(running_->shared.record->begun_work(), [&](const auto& entry) {
      if (folder_.files().contains(entry.first)) return false;
      remove_work(entry.second);
      return true;
    });
  }

  /// Starts what fits into memory, in order.
  void start_tasks(const std::atomic<bool>& interrupt) {
    if (!scanned_) return;
    while (!interrupt && tasks_.size() < std::max(options_.jobs, 1u)) {
      std::shared_ptr<WatchTask> task;
      const auto due = std::ranges::find_if(waiting_, [](const Waiting& one) { return one.from <= Clock::now(); });
      if (due != waiting_.end()) {
        if (!fits(*due->task)) return;
        task = std::move(due->task);
        waiting_.erase(due);
      } else if (!candidates_.ready.empty()) {
        const Candidate candidate = std::move(candidates_.ready.front());
        candidates_.ready.pop_front();
        task = std::make_shared<WatchTask>();
        prepare_task(candidate, folder_, layer_share(options_.memory_bytes, options_.jobs), read_, *task);
        active_.insert(task->job.part);
        if (!fits(*task)) {
          waiting_.push_back({std::move(task), Clock::now()});
          return;
        }
      } else {
        return;
      }
      start(std::move(task));
    }
  }

  bool fits(const WatchTask& task) const { return tasks_.empty() || need_ + task.need_bytes <= options_.memory_bytes; }

  /// As in a batch.
  void take_memory(std::uint64_t bytes) {
    need_ += bytes;
    if (options_.loaded) options_.loaded->limit(loaded_share(options_.memory_bytes, need_));
  }

  // Threads are detached: a job that ignores its stop must not keep the watcher from ending.
  void start(std::shared_ptr<WatchTask> task) {
    task->begun = Clock::now();
    take_memory(task->need_bytes);
    tasks_.insert(task);
    std::thread([running = running_, task = std::move(task)] {
      run_task(running->shared, *task, [&] { running->report(running->planned, task->job); });
      running->report(running->ended, task);
    }).detach();
  }

  /// Passes the news of jobs on.
  void report() {
    std::vector<WatchedJob> planned;
    std::vector<std::shared_ptr<WatchTask>> ended;
    {
      const std::lock_guard lock(running_->shared.mutex);
      planned = std::exchange(running_->planned, {});
      ended = std::exchange(running_->ended, {});
      for (const auto& task : ended) running_->shared.moving.erase(task->job.part);
    }
    for (const WatchedJob& job : planned) observer_.planned(job);
    for (const auto& task : ended) end(task);
  }

  void end(const std::shared_ptr<WatchTask>& task) {
    tasks_.erase(task);
    take_memory(0 - task->need_bytes);
    news_ = true;  // it may have moved files
    if (task->fatal && !fatal_) fatal_ = *task->problem;
    if (task->end == End::kRetry && !task->fatal) {
      if (task->problem) report_problem(*task);
      if (task->job.planned) task->need_bytes = 0;
      return waiting_.push_back({task, Clock::now() + kRetryAfter});
    }
    active_.erase(task->job.part);
    problems_.erase(task->job.part);
    if (task->end != End::kEnded && task->problem) observer_.note(task->problem->message);
    if (task->end != End::kEnded) return;
    const int code = task->job.result.code;
    ++(code == 0 ? summary_.done : summary_.failed);
    if (summary_.code == 0) summary_.code = code;
    observer_.ended(task->job, task->then_code);
  }

  /// Each problem of a job once.
  void report_problem(const WatchTask& task) {
    std::string& before = problems_[task.job.part];
    if (before != task.problem->message) observer_.failed(*task.problem);
    before = task.problem->message;
  }

  /// Of a watcher that ends by itself: a job that could not be moved is not waited for.
  bool is_finished() const {
    const bool only_retries = std::ranges::all_of(waiting_, [](const Waiting& one) { return one.task->problem.has_value(); });
    return tasks_.empty() && only_retries && !news_ && scanned_ && candidates_.ready.empty() && !candidates_.any_unsettled;
  }

  void stop(const std::atomic<bool>& interrupt) {
    summary_.interrupted = interrupt;
    for (const auto& task : tasks_) {
      task->stop = true;  // first: a job that is cancelled without it has exceeded its time limit
      task->cancel = true;
    }
    std::unique_lock lock(running_->shared.mutex);
    const auto all_ended = [&] { return running_->ended.size() == tasks_.size(); };
    const auto commands_ended = [&] {
      return all_ended() || std::ranges::none_of(tasks_, [](const auto& task) { return task->in_command.load(); });
    };
    if (!running_->changed.wait_for(lock, kLastGrace, all_ended))
      running_->changed.wait_for(lock, kKillAfter + kLastGrace, commands_ended);
    summary_.abandoned = !all_ended();
  }

  const WatchOptions& options_;
  const ReadCall& read_;
  const WatchObserver& observer_;
  Folder folder_;
  Candidates candidates_;
  const std::shared_ptr<Running> running_ = std::make_shared<Running>();
  std::set<std::shared_ptr<WatchTask>> tasks_;  // running
  std::deque<Waiting> waiting_;
  std::set<std::string> active_;  // names of jobs that run or wait
  std::map<std::string, std::string> problems_;
  std::uint64_t need_ = 0;
  bool first_ = true, is_new_ = true, news_ = false, scanned_ = true;
  Clock::time_point next_scan_, next_poll_;
  std::optional<Error> fatal_;
  WatchSummary summary_;
};

/// The folder of planned files; relative to the watched folder in `below`, if it is in there. errors  kUsage
Status add_skipped(const std::string& folder, const std::string& root, std::vector<std::string>& skipped) {
  std::error_code ignored;
  const fs::path inner = fs::weakly_canonical(folder, ignored), outer = fs::weakly_canonical(root, ignored);
  const fs::path below = (inner / "").parent_path().lexically_relative((outer / "").parent_path());
  if (below == ".") return usage("{}: is the watched folder; name a folder in it or next to it", folder);
  if (!below.empty() && *below.begin() != "..") skipped.push_back(below.string());
  return {};
}

}  // namespace

Result<WatchSummary> watch_folder(const WatchOptions& options, const ReadCall& read, const RunJob& run,
                                  const WatchObserver& observer, const std::atomic<bool>& interrupt) {
  const std::string done = full_path(options.done.empty() ? joined(options.folder, "done") : options.done),
                    failed = full_path(options.failed.empty() ? joined(options.folder, "failed") : options.failed);
  if (Status status = check_with(options.settings.with, read); !status)
    return Error{status.error().fault, "--with: " + status.error().message};
  if (Status status = check_output(options.output, options.folder); !status) return status.error();
  std::vector<std::string> skipped;
  for (const std::string& folder : {done, failed}) {
    if (Status status = add_skipped(folder, options.folder, skipped); !status) return status.error();
  }
  Result<Folder> folder = Folder::open(options.folder, std::move(skipped));
  if (!folder) return folder.error();
  Result<WatchRecord> record = WatchRecord::open(options.output, options.folder);
  if (!record) return record.error();
  // The next run, which continues this one, may begin in another directory.
  WatchOptions full = options;
  full.settings.output = full_path(options.settings.output);
  FolderWatcher watcher(full, read, observer, std::move(*folder));
  return watcher.run(std::move(*record), run, done, failed, interrupt);
}

}  // namespace lamina::pipeline
