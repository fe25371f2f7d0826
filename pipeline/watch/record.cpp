#include "pipeline/watch/record.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <ctime>
#include <filesystem>
#include <random>
#include <utility>

#include "pipeline/job/errors.h"
#include "pipeline/watch/moves.h"
#include "stages/support/text/json_text.h"
#include "stages/support/text/json_value.h"
#include "stages/support/text/readable.h"
#include "stages/support/text/version.h"

namespace lamina::pipeline {
namespace {

namespace fs = std::filesystem;

constexpr std::uintmax_t kMaxBytes = 16 << 20;  // of a record that is continued as it is

/// UTC, with milliseconds: "2026-11-30T16:25:12.345Z".
std::string time_text() {
  const auto now = std::chrono::system_clock::now().time_since_epoch();
  const auto ms = std::chrono::duration_cast<std::chrono::milliseconds>(now).count();
  const std::time_t seconds = ms / 1000;
  std::tm date{};
  ::gmtime_r(&seconds, &date);
  return fmt::format("{:04}-{:02}-{:02}T{:02}:{:02}:{:02}.{:03}Z", date.tm_year + 1900, date.tm_mon + 1, date.tm_mday,
                     date.tm_hour, date.tm_min, date.tm_sec, ms % 1000);
}

std::string random_id() {
  std::random_device random;
  return fmt::format("{:08x}{:08x}", random(), random());
}

Json input_json(const WatchedInput& input) {
  return {{"path", input.path},         {"inside", input.inside},           {"inode", input.stamp.inode},
          {"bytes", input.stamp.bytes}, {"mtime_ns", input.stamp.mtime_ns}, {"hash", hex(input.hash)}};
}

/// errors  throws JsonError
WatchedInput read_input(const Json& json) {
  WatchedInput input{json.at("path").text(), json.at("inside").get<bool>(), {}, {}};
  json.at("inode").get_to(input.stamp.inode);
  json.at("bytes").get_to(input.stamp.bytes);
  json.at("mtime_ns").get_to(input.stamp.mtime_ns);
  if (!read_hex(json.at("hash").text(), input.hash)) throw JsonError("hash");
  return input;
}

/// errors  throws JsonError
void read_begun(const Json& json, WatchedJob& job) {
  job.part = json.at("part").text();
  job.words = json.at("words").get<std::vector<std::string>>();
  job.root = json.at("root").text();
  job.name = json.at("name").text();
  job.ending = json.at("ending").text();
  job.has_output = json.at("has_output").get<bool>();
  job.then = json.at("then").text();
  job.work = json.at("work").text();
  for (const Json& input : json.at("inputs")) job.inputs.push_back(read_input(input));
}

}  // namespace

Result<WatchRecord> WatchRecord::open(const std::string& directory, const std::string& root) {
  std::error_code error;
  for (const std::string& name : {directory, root}) {
    if (!is_utf8(fs::weakly_canonical(name, error).string()))
      return usage("{}: its path is not in UTF-8, which the record of a watcher cannot contain; rename it", one_line(name));
  }
  fs::create_directories(directory, error);
  if (error) return failure(Fault::kOutput, "{}: {}", directory, error.message());
  const std::string path = (fs::path(directory) / "watch.jsonl").string();
  auto journal = Journal::open(path, "another watcher is running here right now; stop it or name another directory");
  if (!journal) return journal.error();
  WatchRecord record(std::move(*journal), path);
  const Status read = record.journal_.read([&](const std::string& line, std::uint64_t) { record.read_line(line); });
  if (!read) return read.error();
  const std::string folder = fs::weakly_canonical(root, error).string();
  if (!record.folder_.empty() && record.folder_ != folder)
    return usage("{}: belongs to the watched folder {}; name another directory with -o", path, one_line(record.folder_));
  if (record.id_.empty()) record.id_ = random_id();
  const std::string started = json_line(
      {{"event", "started"}, {"time", time_text()}, {"record", record.id_}, {"folder", folder}, {"version", version()}});
  if (fs::file_size(path, error) > kMaxBytes &&
      record.journal_.replace(started + record.unfinished_lines(), (fs::path(directory) / "watch.old.jsonl").string()))
    return record;
  if (Status status = record.journal_.append(started); !status) return status.error();
  return record;
}

std::string WatchRecord::unfinished_lines() const {
  std::string lines;
  for (const std::string& id : order_) {
    const WatchedJob& job = jobs_.at(id);
    const auto work = begun_work_.find(job.part);
    if (job.planned || (work != begun_work_.end() && work->second == job.work)) lines += lines_.at(id);
  }
  return lines;
}

/// A line that a kill has torn is skipped.
void WatchRecord::read_line(const std::string& line) try {
  if (!json_nests_within(line)) return;
  const Json json = parse_json(line);
  const std::string& event = json.at("event").text();
  if (event == "started") {
    folder_ = json.at("folder").text();
    if (const Json* id = json.find("record")) id_ = id->text();
    return;
  }
  const std::string& id = json.at("id").text();
  if (event == "begun") {
    WatchedJob job;
    if (!read_hex(id, job.id)) return;
    read_begun(json, job);
    begun_work_[job.part] = job.work;
    if (!jobs_.contains(id)) order_.push_back(id);
    jobs_[id] = std::move(job);
    lines_[id] = line + "\n";
    return;
  }
  const auto found = jobs_.find(id);
  if (found == jobs_.end()) return;
  WatchedJob& job = found->second;
  lines_[id] += line + "\n";
  if (event == "planned") {
    job.result.code = json.at("code").get<int>();
    job.result.reason = json.at("reason").text();
    job.result.seconds = json.at("seconds").get<double>();
    job.stem = json.at("stem").text();
    json.at("files").get_to(job.result.output.files);
    json.at("bytes").get_to(job.result.output.bytes);
    if (!read_hex(json.at("hash").text(), job.result.output.hash)) throw JsonError("hash");
    job.result.value = json.at("result");
    job.planned = true;
    begun_work_.erase(job.part);
  } else if (event == "moved") {
    job.now = json.at("to").text();
    job.moved = true;
  } else if (event == "ended" || event == "dropped") {
    jobs_.erase(found);
    lines_.erase(id);
    std::erase(order_, id);
  }
} catch (const JsonError&) {
  return;
}

std::vector<WatchedJob> WatchRecord::take_unfinished() {
  std::vector<WatchedJob> jobs;
  for (const std::string& id : std::exchange(order_, {})) {
    WatchedJob& job = jobs_[id];
    if (job.planned) jobs.push_back(std::move(job));
  }
  jobs_.clear();
  lines_.clear();
  return jobs;
}

Status WatchRecord::append(const char* event, const WatchedJob& job, const Json& more) {
  if (!journal_.has_its_name())
    return failure(Fault::kOutput, "{}: was removed or replaced while the watcher ran; start it again", path_);
  Json line = {{"event", event}, {"time", time_text()}, {"part", job.part}, {"id", hex(job.id)}};
  line.update(more);
  return journal_.append(json_line(line));
}

Status WatchRecord::begun(const WatchedJob& job) {
  Json inputs = Json::array();
  for (const WatchedInput& input : job.inputs) inputs.push_back(input_json(input));
  return append("begun", job,
                {{"words", job.words},
                 {"root", job.root},
                 {"name", job.name},
                 {"ending", job.ending},
                 {"has_output", job.has_output},
                 {"then", job.then},
                 {"work", job.work},
                 {"inputs", std::move(inputs)}});
}

Status WatchRecord::dropped(const WatchedJob& job) { return append("dropped", job, Json::object()); }

Status WatchRecord::planned(const WatchedJob& job) {
  const BatchResult& result = job.result;
  return append("planned", job,
                {{"code", result.code},
                 {"reason", result.reason},
                 {"stem", job.stem},
                 {"output", result_path(job)},
                 {"seconds", std::round(result.seconds * 1000) / 1000},
                 {"files", result.output.files},
                 {"bytes", result.output.bytes},
                 {"hash", hex(result.output.hash)},
                 {"result", result.value}});
}

Status WatchRecord::moved(const WatchedJob& job) { return append("moved", job, {{"to", job.now}}); }

Status WatchRecord::then(const WatchedJob& job) { return append("then", job, Json::object()); }

Status WatchRecord::ended(const WatchedJob& job, std::optional<int> then_code) {
  return append("ended", job, {{"then_code", then_code ? Json(*then_code) : Json()}});
}

}  // namespace lamina::pipeline
