#include "pipeline/batch/record.h"

#include <fmt/format.h>

#include <cmath>
#include <filesystem>
#include <utility>

#include "pipeline/job/errors.h"
#include "stages/support/text/json_text.h"
#include "stages/support/text/json_value.h"

namespace lamina::pipeline {
namespace {

std::string key_of(const BatchJob& job) { return job.position.empty() ? hex(job.id) : job.position; }

/// Reads one line of the file; nothing if it is incomplete.
void read_line(const std::string& line, std::map<std::string, BatchRecord::Earlier>& earlier) try {
  if (!json_nests_within(line)) return;
  const Json json = parse_json(line);
  const bool ended = json.contains("ended");
  const std::string id = json.at(ended ? "ended" : "begun").text(), position = json.at("output").text();
  BatchRecord::Earlier entry;
  if (!read_hex(id, entry.begun)) return;
  if (ended) {
    const std::string& outcome = json.at("outcome").text();
    const bool done = outcome == outcome_name(BatchOutcome::kDone) || outcome == outcome_name(BatchOutcome::kKept);
    BatchResult& result = entry.result;
    entry.ended = read_hex(json.at("hash").get<std::string>(), result.output.hash) && done;
    result.outcome = BatchOutcome::kDone;
    json.at("seconds").get_to(result.seconds);
    if (!json.at("files").is_number_unsigned() || !json.at("bytes").is_number_unsigned()) return;
    json.at("files").get_to(result.output.files);
    json.at("bytes").get_to(result.output.bytes);
    result.value = json.at("result");
  }
  BatchRecord::Earlier& known = earlier[position.empty() ? id : position];
  entry.unowned = ended ? known.unowned && !entry.ended : json.contains("unowned");
  known = std::move(entry);
} catch (const JsonError&) {
  return;
}

}  // namespace

Json result_json(const BatchJob& job, const BatchResult& result) {
  return {{"job", job.number},
          {"source", job.entry.source},
          {"words", job.entry.words},
          {"output", job.position},
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
  if (error) return failure(Fault::kOutput, "{}: {}", directory, error.message());
  const std::string path = (fs::path(directory) / "batch.jsonl").string();
  auto journal = Journal::open(path, "another batch is running here right now; wait for it or name another directory");
  if (!journal) return journal.error();
  if (!journal->empty() && !resume && !overwrite) {
    return usage(
        "{}: belongs to an earlier batch; continue it with --resume, replace it with --overwrite, or name another directory",
        path);
  }
  BatchRecord record(std::move(*journal));
  if (resume) {
    const Status status = record.journal_.read([&](const std::string& line) { read_line(line, record.earlier_); });
    if (!status) return status.error();
  } else if (Status status = record.journal_.clear(); !status) {
    return status.error();
  }
  return record;
}

const BatchRecord::Earlier* BatchRecord::earlier(const BatchJob& job) const {
  const auto found = earlier_.find(key_of(job));
  return found == earlier_.end() ? nullptr : &found->second;
}

Status BatchRecord::append(const Json& entry) {
  const Status status = journal_.append(json_line(entry));
  return status ? status : Error{status.error().fault, status.error().message + ", and continue with --resume"};
}

Status BatchRecord::begun(const BatchJob& job, bool unowned) {
  Json entry = {{"begun", hex(job.id)}, {"job", job.number}, {"output", job.position}};
  if (unowned) entry["unowned"] = true;
  return append(entry);
}

Status BatchRecord::ended(const BatchJob& job, const BatchResult& result) {
  Json entry = {{"ended", hex(job.id)}};
  entry.update(result_json(job, result));
  return append(entry);
}

}  // namespace lamina::pipeline
