#include "pipeline/batch/shares.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <numeric>
#include <queue>
#include <random>
#include <set>
#include <thread>
#include <utility>

#include "pipeline/batch/record.h"
#include "pipeline/batch/summary.h"
#include "pipeline/job/errors.h"
#include "stages/load/load.h"
#include "stages/support/io/file.h"
#include "stages/support/io/file_reader.h"
#include "stages/support/io/journal.h"
#include "stages/support/io/temporary.h"
#include "stages/support/text/json_value.h"
#include "stages/support/text/number_text.h"
#include "stages/support/text/version.h"

namespace lamina::pipeline {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view kFirstLine = "lamina shares\t3\n", kColumns = "job\tshare\tcost\twords\tsource\n", kEnd = "end\t";
constexpr std::string_view kYes = "yes", kNo = "no";  // of the line `overwrite`
constexpr std::uint64_t kStartBytes = 64 << 10;       // what it costs to start a job, in bytes of a part
constexpr std::uint64_t kMaxShares = 1'000'000;       // of read_shard()

/// Cost of loading each part.
using Loads = std::map<Hash128, std::uint64_t, HashOrder>;

Loads loads_of(std::span<const CostedJob> jobs) {
  Loads loads;
  for (const CostedJob& job : jobs) loads[job.part] = std::max(loads[job.part], job.load);
  return loads;
}

/// Jobs of one part, or some of them.
struct Piece {
  Hash128 part;
  std::uint64_t load = 0, cost = 0;  // cost: without the load
  std::vector<std::uint32_t> jobs;   // indices

  std::uint64_t whole() const { return load + cost; }
};

/// Cuts the jobs of each part into pieces of at most `limit`, or of one job.
std::vector<Piece> cut_pieces(std::span<const CostedJob> jobs, const Loads& loads, double limit) {
  std::vector<Piece> pieces;
  std::map<Hash128, std::size_t, HashOrder> open;  // the piece of each part that grows
  for (std::uint32_t i = 0; i < jobs.size(); ++i) {
    const auto [found, is_new] = open.try_emplace(jobs[i].part, pieces.size());
    if (is_new || static_cast<double>(pieces[found->second].whole() + jobs[i].cost) > limit) {
      found->second = pieces.size();
      pieces.push_back({jobs[i].part, loads.at(jobs[i].part), 0, {}});
    }
    Piece& piece = pieces[found->second];
    piece.cost += jobs[i].cost;
    piece.jobs.push_back(i);
  }
  return pieces;
}

/// Shares to which pieces are given, and their costs.
class Shares {
 public:
  explicit Shares(std::uint32_t count) : sums_(count) {
    for (std::uint32_t share = 0; share < count; ++share) all_.emplace(0, share);
  }

  /// Where the piece ends first: in the smallest share, or in the smallest of those that load its part anyway.
  std::uint32_t give(const Piece& piece) {
    Heap& having = having_[piece.part];
    const std::uint32_t share = smallest(all_);
    if (!having.empty()) {
      const std::uint32_t other = smallest(having);
      if (sums_[other] <= sums_[share] + piece.load) {
        sums_[other] += piece.cost;
        return other;
      }
    }
    sums_[share] += piece.whole();
    if (piece.load > 0) having.emplace(sums_[share], share);
    return share;
  }

 private:
  using Sum = std::pair<std::uint64_t, std::uint32_t>;  // cost when it was added, share
  using Heap = std::priority_queue<Sum, std::vector<Sum>, std::greater<>>;

  /// Costs only grow, so that what is outdated is found at the top.
  std::uint32_t smallest(Heap& heap) const {
    while (heap.top().first != sums_[heap.top().second]) {
      const std::uint32_t share = heap.top().second;
      heap.pop();
      heap.emplace(sums_[share], share);
    }
    return heap.top().second;
  }

  std::vector<std::uint64_t> sums_;
  Heap all_;
  std::map<Hash128, Heap, HashOrder> having_;  // a part's shares
};

Error damaged_plan(const std::string& path) {
  return failure(Fault::kVerification,
                 "{}: is damaged; restore it, or remove it and the records of the shares and start the shares again", path);
}

/// The value of the next line, "name\tvalue", which is removed from the text; nothing if it has another name.
std::optional<std::string_view> take_value(std::string_view& text, std::string_view name) {
  const std::size_t end = text.find('\n');
  if (end == std::string_view::npos || !text.starts_with(name) || text.substr(name.size(), 1) != "\t") return {};
  const std::string_view value = text.substr(name.size() + 1, end - name.size() - 1);
  text.remove_prefix(end + 1);
  return value;
}

bool read_count(std::string_view text, std::uint64_t max, std::uint64_t& count) {
  std::int64_t number = 0;
  if (!read_whole(text, 0, static_cast<std::int64_t>(max), number).empty()) return false;
  count = static_cast<std::uint64_t>(number);
  return true;
}

bool read_planned_job(std::string_view line, std::size_t number, const SharePlan& plan, PlannedJob& job) {
  const std::vector<std::string_view> cells = split(line, "\t");
  std::uint64_t first = 0, share = 0;
  if (cells.size() != 5 || !read_count(cells[0], UINT32_MAX, first) || first != number) return false;
  if (!read_count(cells[1], plan.shares, share) || share == 0) return false;
  if (!read_count(cells[2], kMaxJobCost, job.cost) || !read_hex(cells[3], job.words)) return false;
  job.share = static_cast<std::uint32_t>(share);
  job.source = cells[4];
  return true;
}

std::string plan_text(const SharePlan& plan) {
  std::string text =
      fmt::format("{}version\t{}\ngeneration\t{}\nshares\t{}\nwith\t{}\nunit\t{}\noverwrite\t{}\n{}", kFirstLine, plan.version,
                  hex(plan.generation), plan.shares, plan.with, plan.unit, plan.overwrite ? kYes : kNo, kColumns);
  for (std::size_t i = 0; i < plan.jobs.size(); ++i) {
    const PlannedJob& job = plan.jobs[i];
    text += fmt::format("{}\t{}\t{}\t{}\t{}\n", i + 1, job.share, job.cost, hex(job.words), job.source);
  }
  return text + fmt::format("{}{}\n", kEnd, hex(hash_text(text)));
}

/// Whether a plan is that of this process. errors  of agree_on_plan()
Status check_plan(const SharePlan& found, const SharePlan& own, const std::string& path) {
  if (found.version != own.version) {
    return usage("{}: a worker of another version: the shares are of lamina {}, this is lamina {}; use one version", path,
                 found.version, own.version);
  }
  if (found.shares != own.shares) {
    return usage("{}: divides the batch into {} shares, not {}; use that number, or divide it again with --overwrite", path,
                 found.shares, own.shares);
  }
  if (found.with != own.with) {
    return usage("{}: the shares have --with {}, not {}; use the same words, or divide the batch again with --overwrite", path,
                 found.with, own.with);
  }
  const std::size_t both = std::min(found.jobs.size(), own.jobs.size());
  for (std::size_t i = 0; i < both; ++i) {
    if (found.jobs[i].words == own.jobs[i].words) continue;
    return usage("{}: job {} differs from {}; restore the list, or divide it again with --overwrite", own.jobs[i].source, i + 1,
                 path);
  }
  if (found.jobs.size() == own.jobs.size()) return {};
  const bool longer = own.jobs.size() > both;
  return usage("{}: job {} is {} {}; restore the list, or divide it again with --overwrite",
               (longer ? own : found).jobs[both].source, both + 1, longer ? "not in" : "missing; it is in", path);
}

bool is_undivided_file(std::string_view name) { return name.starts_with("batch.") || name.starts_with("summary."); }

/// Files of the shares, or of an undivided batch.
std::vector<fs::path> batch_files(const std::string& directory, bool undivided) {
  std::vector<fs::path> files;
  std::error_code error;
  for (fs::directory_iterator entry(directory, error), end; !error && entry != end; entry.increment(error)) {
    const std::string name = entry->path().filename().string();
    if (is_batch_file(name) && is_undivided_file(name) == undivided) files.push_back(entry->path());
  }
  std::ranges::sort(files);
  return files;
}

/// As batch_files(). errors  of `fault`: one of them is running
Result<std::vector<fs::path>> idle_files(const std::string& directory, bool undivided, Fault fault) {
  std::vector<fs::path> files = batch_files(directory, undivided);
  for (const fs::path& file : files) {
    if (file.extension() == ".jsonl" && is_journal_held(file.string()))
      return failure(fault, "{}: is running in another process; wait for it", file.string());
  }
  return files;
}

/// Tries to lock a plan. Of processes that try at once all may fail, so the pauses grow and are random.
class PlanLock {
 public:
  PlanLock(std::string path, bool replace) : path_(std::move(path)), replace_(replace) {}

  /// The file, locked until it is finished or discarded; nothing, after a pause, if another process had it.
  /// errors  kOutput: it failed in many tries without another process in sight
  Result<std::optional<File>> try_once() {
    constexpr int kMaxIdle = 8;
    Result<File> file = File::open(path_, {.follow = false, .replace = replace_});
    if (file) return std::optional<File>(std::move(*file));
    const bool there = is_file(path_), busy = !check_not_being_written(path_);
    idle_ = busy || there != std::exchange(was_there_, there) ? 0 : idle_ + 1;
    if (idle_ == kMaxIdle) return file.error();
    std::this_thread::sleep_for(std::chrono::milliseconds(longest_ms_ / 2 + random_() % longest_ms_));
    longest_ms_ = std::min(longest_ms_ * 3 / 2, 300u);
    return std::optional<File>();
  }

 private:
  std::string path_;
  bool replace_, was_there_ = is_file(path_);
  int idle_ = 0;  // tries in a row
  unsigned longest_ms_ = 20;
  std::random_device random_;
};

Status make_directory(const std::string& directory) {
  std::error_code error;
  fs::create_directories(directory, error);
  return error ? Status(failure(Fault::kOutput, "{}: {}", directory, error.message())) : Status();
}

Status remove_files(const std::string& directory, bool undivided) {
  const Result<std::vector<fs::path>> files = idle_files(directory, undivided, Fault::kOutput);
  if (!files) return files.error();
  std::error_code error;
  for (const fs::path& file : *files) {
    if (!error) fs::remove(file, error);
    if (error) return failure(Fault::kOutput, "{}: {}", file.string(), error.message());
  }
  remove_leftovers(directory,
                   [&](std::string_view name) { return is_batch_file(name) && is_undivided_file(name) == undivided; });
  return {};
}

}  // namespace

CostedJob FileCosts::of(const Call& call) {
  std::uint64_t bytes = kStartBytes;
  CostedJob result;
  bool has_part = false;
  for (const std::string& input : call.inputs) {
    const std::string path = fs::path(input).lexically_normal().string();
    const auto [known, is_new] = known_.try_emplace(hash_text(path), 0);
    std::error_code error;
    if (is_new && is_file(path)) known->second = load::part_bytes(path, fs::file_size(path, error));
    if (known->second == 0 || error) continue;
    bytes += known->second;
    const bool part = load::is_part_name(path);
    if (has_part || (result.part != Hash128() && !part)) continue;
    result.part = known->first;
    has_part = part;
  }
  const double layers_per_mm = call.layer_mm > 0 ? 1 / call.layer_mm : 1;
  result.cost = static_cast<std::uint64_t>(
      std::clamp(std::round(static_cast<double>(bytes) * layers_per_mm), 1.0, static_cast<double>(kMaxJobCost)));
  return result;
}

std::vector<DividedJob> divide_jobs(std::span<const CostedJob> jobs, std::uint32_t shares) {
  const Loads loads = loads_of(jobs);
  double total = 0;
  for (const CostedJob& job : jobs) total += static_cast<double>(job.cost);
  for (const auto& [part, load] : loads) total += static_cast<double>(load);
  std::vector<Piece> pieces = cut_pieces(jobs, loads, 0.05 * total / shares);
  std::ranges::stable_sort(pieces, std::greater<>(), &Piece::whole);
  std::vector<DividedJob> result(jobs.size());
  Shares sums(shares);
  for (const Piece& piece : pieces) {
    const std::uint32_t share = sums.give(piece);
    for (const std::uint32_t job : piece.jobs) result[job] = {share + 1, jobs[job].cost};
  }
  std::map<Hash128, std::set<std::uint32_t>, HashOrder> loaded;  // the shares of each part
  for (std::size_t i = 0; i < jobs.size(); ++i) {
    if (!loaded[jobs[i].part].insert(result[i].share).second) continue;
    result[i].cost = std::min(result[i].cost + loads.at(jobs[i].part), kMaxJobCost);
  }
  return result;
}

std::vector<std::uint64_t> SharePlan::costs() const {
  std::vector<std::uint64_t> sums(shares);
  for (const PlannedJob& job : jobs) sums[job.share - 1] += job.cost;
  return sums;
}

SharePlan plan_shares(const std::vector<BatchJob>& jobs, std::span<const CostedJob> costs, std::uint32_t shares,
                      const std::vector<std::string>& with, std::string_view unit) {
  SharePlan plan{shares, std::string(version()), json_text(Json(with)), std::string(unit), false, {}, {}};
  const std::vector<DividedJob> divided = divide_jobs(costs, shares);
  plan.jobs.reserve(jobs.size());
  for (std::size_t i = 0; i < jobs.size(); ++i)
    plan.jobs.push_back(
        {divided[i].share, divided[i].cost, hash_text(jobs[i].entry.words.text()), table_cell(jobs[i].entry.source)});
  return plan;
}

std::string plan_path(const std::string& directory) { return (fs::path(directory) / "shares.tsv").string(); }

Result<SharePlan> read_plan(const std::string& directory) {
  const std::string path = plan_path(directory);
  const Result<std::string> read = read_file(path, {.max_bytes = 2 * kMaxListBytes});
  if (!read) return read.error();
  std::string_view text = *read;
  const std::size_t end = text.rfind(kEnd);
  Hash128 hash;
  if (end == std::string_view::npos || !text.ends_with('\n') ||
      !read_hex(text.substr(end + kEnd.size(), text.size() - end - kEnd.size() - 1), hash) ||
      hash != hash_text(text.substr(0, end)) || !text.starts_with(kFirstLine)) {
    return damaged_plan(path);
  }
  text = text.substr(0, end);
  text.remove_prefix(kFirstLine.size());
  SharePlan plan;
  std::uint64_t shares = 0;
  const auto version_text = take_value(text, "version"), generation = take_value(text, "generation"),
             count = take_value(text, "shares"), with = take_value(text, "with"), unit = take_value(text, "unit"),
             overwrite = take_value(text, "overwrite");
  if (!version_text || !generation || !count || !with || !unit || (overwrite != kYes && overwrite != kNo) ||
      !read_hex(*generation, plan.generation) || !read_count(*count, kMaxShares, shares) || shares == 0)
    return damaged_plan(path);
  plan.shares = static_cast<std::uint32_t>(shares);
  plan.version = *version_text;
  plan.with = *with;
  plan.unit = *unit;
  plan.overwrite = overwrite == kYes;
  if (!text.starts_with(kColumns)) return damaged_plan(path);
  text.remove_prefix(kColumns.size());
  while (!text.empty()) {
    const std::size_t line = text.find('\n');
    PlannedJob job;
    if (line == std::string_view::npos || !read_planned_job(text.substr(0, line), plan.jobs.size() + 1, plan, job))
      return damaged_plan(path);
    plan.jobs.push_back(std::move(job));
    text.remove_prefix(line + 1);
  }
  return plan;
}

Result<SharePlan> agree_on_plan(const std::string& directory, const SharePlan& own, bool overwrite) {
  if (Status status = make_directory(directory); !status) return status.error();
  const std::string path = plan_path(directory);
  std::optional<File> file;
  PlanLock lock(path, overwrite);
  while (true) {
    const bool replace = has_shares(directory);
    if (replace) {
      Result<SharePlan> found = read_plan(directory);
      const Status status = found ? check_plan(*found, own, path) : Status(found.error());
      if (status) return found;
      if (!overwrite) return status.error();
    }
    if (!file) {  // another process may have written the plan before this one has the lock
      Result<std::optional<File>> locked = lock.try_once();
      if (!locked) return locked.error();
      file = std::move(*locked);
      continue;
    }
    // A batch that is not divided may have begun, or its shares were merged, since this process has started.
    if (Status status = overwrite ? remove_undivided_batch(directory) : check_not_undivided(directory); !status)
      return status.error();
    SharePlan plan = own;
    std::string seed = temporary_name(path);  // random
    if (replace) {
      if (const auto idle = idle_files(directory, false, Fault::kUsage); !idle) return idle.error();
      if (Result<std::string> replaced = read_file(path, {.max_bytes = 2 * kMaxListBytes}); replaced)
        seed = std::move(*replaced);
    }
    plan.generation = hash_text(seed + plan_text(own));
    if (Status status = file->append(plan_text(plan)); !status) return status.error();
    if (const auto written = file->finish(); !written && (replace || !has_shares(directory))) return written.error();
    file.reset();
  }
}

Result<File> lock_plan(const std::string& directory) {
  if (Status status = make_directory(directory); !status) return status.error();
  PlanLock lock(plan_path(directory), true);
  while (true) {
    Result<std::optional<File>> locked = lock.try_once();
    if (!locked) return locked.error();
    if (*locked) return std::move(**locked);
  }
}

Result<Hash128> check_same_plan(const std::string& directory, const SharePlan& plan) {
  const std::string path = plan_path(directory);
  while (!check_not_being_written(path)) std::this_thread::sleep_for(std::chrono::milliseconds(20));
  const Result<SharePlan> now = read_plan(directory);
  if (now && now->generation == plan.generation) return plan.generation;
  return failure(Fault::kOutput, "{}: the shares were merged or planned again as this one started; start it again", path);
}

bool has_shares(const std::string& directory) { return is_file(plan_path(directory)); }

bool has_undivided_batch(const std::string& directory) {
  std::error_code error;
  const std::string path = BatchFiles(directory).record();
  return is_file(path) && fs::file_size(path, error) > 0 && !error;
}

Status check_not_undivided(const std::string& directory) {
  const std::string path = BatchFiles(directory).record();
  if (!has_undivided_batch(directory) && !is_journal_held(path)) return {};
  return usage(
      "{}: belongs to a batch without shares; continue it without shares, replace it with --overwrite, or name another directory",
      path);
}

Status remove_shares(const std::string& directory) { return remove_files(directory, false); }

Status remove_merged_shares(const std::string& directory) {
  if (batch_files(directory, false).empty()) return remove_shares(directory);  // or what is left of their files
  const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(5);
  while (true) {
    Status removed;
    {
      const Result<File> lock = lock_plan(directory);
      if (!lock) return lock.error();
      if (has_shares(directory)) return {};
      removed = remove_shares(directory);
    }
    if (removed || std::chrono::steady_clock::now() > end) return removed;
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
  }
}

Status remove_undivided_batch(const std::string& directory) { return remove_files(directory, true); }

}  // namespace lamina::pipeline
