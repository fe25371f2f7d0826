#include "pipeline/batch/record.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>
#include <unistd.h>

#include <cerrno>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <utility>

#include "pipeline/text/json.h"
#include "pipeline/text/json_text.h"
#include "stages/write/file.h"

namespace lamina::pipeline {
namespace {

std::string key_of(const BatchJob& job) { return job.place.empty() ? hex(job.id) : job.place; }

/// Reads one line of the file; what is not whole is nothing.
void read_line(const std::string& line, std::map<std::string, BatchRecord::Earlier>& earlier) {
  const Json json = Json::parse(line, nullptr, false);
  if (!json.is_object()) return;
  const auto text = [&](const char* name) {
    return json.contains(name) && json[name].is_string() ? json[name].get<std::string>() : "";
  };
  const auto whole = [&](const char* name) {
    return json.contains(name) && json[name].is_number_unsigned() ? json[name].get<std::uint64_t>() : 0;
  };
  const bool ended = json.contains("ended");
  const std::string id = text(ended ? "ended" : "begun");
  BatchRecord::Earlier entry;
  if (!read_hex(id, entry.begun)) return;
  if (ended) {
    const std::string outcome = text("outcome");
    entry.ended = outcome == outcome_name(BatchOutcome::kDone) || outcome == outcome_name(BatchOutcome::kKept);
    entry.result.outcome = BatchOutcome::kDone;
    entry.result.seconds = json.contains("seconds") && json["seconds"].is_number() ? json["seconds"].get<double>() : 0;
    entry.result.output.files = whole("files");
    entry.result.output.bytes = whole("bytes");
    if (!read_hex(text("hash"), entry.result.output.hash)) entry.ended = false;
    if (json.contains("result")) entry.result.value = json["result"];
  }
  const std::string place = text("output");
  BatchRecord::Earlier& known = earlier[place.empty() ? id : place];
  entry.foreign = ended ? known.foreign && !entry.ended : json.contains("foreign");
  known = std::move(entry);
}

}  // namespace

std::string_view outcome_name(BatchOutcome outcome) {
  switch (outcome) {
    case BatchOutcome::kDone: return "done";
    case BatchOutcome::kKept: return "kept";
    case BatchOutcome::kFailed: return "failed";
    case BatchOutcome::kTimeLimit: return "time limit";
    case BatchOutcome::kStopped: return "stopped";
    case BatchOutcome::kNotRun: return "not run";
  }
  return "";
}

Json result_json(const BatchJob& job, std::uint32_t number, const BatchResult& result) {
  return {{"job", number},
          {"source", job.entry.source},
          {"words", job.entry.words},
          {"output", job.place},
          {"outcome", outcome_name(result.outcome)},
          {"code", result.code},
          {"reason", result.reason},
          {"seconds", std::round(result.seconds * 1000) / 1000},
          {"files", result.output.files},
          {"bytes", result.output.bytes},
          {"hash", hex(result.output.hash)},
          {"result", result.value}};
}

Result<BatchRecord> BatchRecord::open(const std::string& directory, bool resume, bool overwrite) {
  namespace fs = std::filesystem;
  std::error_code error;
  fs::create_directories(directory, error);
  if (error) return Error{Fault::kOutput, fmt::format("{}: {}", directory, error.message())};
  BatchRecord record;
  record.path_ = (fs::path(directory) / "batch.jsonl").string();
  const auto failed = [&](int reason) {
    return Error{Fault::kOutput, fmt::format("{}: {}", record.path_, std::strerror(reason))};
  };
  record.file_ = ::open(record.path_.c_str(), O_RDWR | O_CREAT | O_APPEND | O_CLOEXEC, 0666);
  if (record.file_ < 0) return failed(errno);
  if (::flock(record.file_, LOCK_EX | LOCK_NB) != 0) {
    if (errno != EWOULDBLOCK) return failed(errno);
    return Error{Fault::kOutput, fmt::format("{}: another batch is running here right now; wait for it or name another "
                                             "directory",
                                             record.path_)};
  }
  const bool empty = fs::file_size(record.path_, error) == 0;
  if (!empty && !resume && !overwrite) {
    return Error{Fault::kUsage, fmt::format("{}: an earlier batch; go on with it by --resume, replace it with --overwrite, "
                                            "or name another directory",
                                            record.path_)};
  }
  if (!resume) {
    if (::ftruncate(record.file_, 0) != 0) return failed(errno);
    return record;
  }
  std::ifstream lines(record.path_, std::ios::binary);
  for (std::string line; std::getline(lines, line);) {
    record.torn_ = lines.eof();
    read_line(line, record.earlier_);
  }
  return record;
}

BatchRecord::BatchRecord(BatchRecord&& other) noexcept
    : path_(std::move(other.path_)),
      file_(std::exchange(other.file_, -1)),
      torn_(other.torn_),
      earlier_(std::move(other.earlier_)) {}

BatchRecord::~BatchRecord() {
  if (file_ >= 0) ::close(file_);
}

const BatchRecord::Earlier* BatchRecord::earlier(const BatchJob& job) const {
  const auto found = earlier_.find(key_of(job));
  return found == earlier_.end() ? nullptr : &found->second;
}

Status BatchRecord::append(const Json& entry) {
  std::string line = json_line(entry);
  if (torn_) line.insert(line.begin(), '\n');
  const int reason = write::write_all(file_, std::as_bytes(std::span(line)));
  torn_ = reason != 0;
  if (!torn_) return {};
  const Error failed = write::write_failure(path_, reason);
  return Error{failed.fault, failed.message + ", and go on with --resume"};
}

Status BatchRecord::begun(const BatchJob& job, std::uint32_t number, bool foreign) {
  Json entry = {{"begun", hex(job.id)}, {"job", number}, {"output", job.place}};
  if (foreign) entry["foreign"] = true;
  return append(entry);
}

Status BatchRecord::ended(const BatchJob& job, std::uint32_t number, const BatchResult& result) {
  Json entry = {{"ended", hex(job.id)}};
  entry.update(result_json(job, number, result));
  return append(entry);
}

}  // namespace lamina::pipeline
