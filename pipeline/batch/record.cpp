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

constexpr std::string_view kName = "batch.jsonl";

Hash128 key_of(const BatchJob& job) { return hash_text(job.output.empty() ? hex(job.id) : job.position()); }

/// Reads one line of the file; nothing if it is incomplete.
void read_line(const std::string& line, std::uint64_t at, std::map<Hash128, BatchRecord::Earlier, HashOrder>& earlier) try {
  if (!json_nests_within(line)) return;
  const Json json = parse_json(line);
  const bool ended = json.contains("ended");
  const std::string id = json.at(ended ? "ended" : "begun").text(), position = json.at("output").text();
  BatchRecord::Earlier entry;
  if (!read_hex(id, entry.begun)) return;
  if (ended) {
    const std::string& outcome = json.at("outcome").text();
    const bool done = outcome == outcome_name(BatchOutcome::kDone) || outcome == outcome_name(BatchOutcome::kKept);
    entry.ended = read_hex(json.at("hash").get<std::string>(), entry.output.hash) && done;
    json.at("seconds").get_to(entry.seconds);
    if (!json.at("files").is_number_unsigned() || !json.at("bytes").is_number_unsigned()) return;
    json.at("files").get_to(entry.output.files);
    json.at("bytes").get_to(entry.output.bytes);
    if (!json.contains("result")) return;
    entry.line = {at, static_cast<std::uint32_t>(line.size())};
  }
  BatchRecord::Earlier& known = earlier[hash_text(position.empty() ? id : position)];
  entry.unowned = ended ? known.unowned && !entry.ended : json.contains("unowned");
  known = std::move(entry);
} catch (const JsonError&) {
  return;
}

}  // namespace

Json result_json(const BatchJob& job, const BatchResult& result, const Json& value) {
  return {{"job", job.number},
          {"source", job.entry.source},
          {"words", job.entry.words.unpacked()},
          {"output", job.position()},
          {"outcome", outcome_name(result.outcome)},
          {"code", result.code},
          {"reason", result.reason},
          {"seconds", std::round(result.seconds * 1000) / 1000},
          {"files", result.output.files},
          {"bytes", result.output.bytes},
          {"hash", hex(result.output.hash)},
          {"result", value}};
}

Result<BatchRecord> BatchRecord::open(const std::string& directory, bool resume, bool overwrite) {
  namespace fs = std::filesystem;
  std::error_code error;
  fs::create_directories(directory, error);
  if (error) return failure(Fault::kOutput, "{}: {}", directory, error.message());
  const std::string path = (fs::path(directory) / kName).string();
  auto journal = Journal::open(path, "another batch is running here right now; wait for it or name another directory");
  if (!journal) return journal.error();
  if (!journal->empty() && !resume && !overwrite) {
    return usage(
        "{}: belongs to an earlier batch; continue it with --resume, replace it with --overwrite, or name another directory",
        path);
  }
  BatchRecord record(directory, std::move(*journal));
  if (resume) {
    const Status status =
        record.journal_.read([&](const std::string& line, std::uint64_t at) { read_line(line, at, record.earlier_); });
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

Status BatchRecord::append(const std::string& line) {
  const Status status = journal_.append(line);
  return status ? status : Error{status.error().fault, status.error().message + ", and continue with --resume"};
}

Status BatchRecord::begun(const BatchJob& job, bool unowned) {
  Json entry = {{"begun", hex(job.id)}, {"job", job.number}, {"output", job.position()}};
  if (unowned) entry["unowned"] = true;
  return append(json_line(entry));
}

Status BatchRecord::ended(const BatchJob& job, BatchResult& result) {
  Json entry = {{"ended", hex(job.id)}};
  entry.update(result_json(job, result, result.value));
  const std::string text = json_line(entry);
  if (Status status = append(text); !status) return status;
  result.line = {journal_.end() - text.size(), static_cast<std::uint32_t>(text.size() - 1)};
  result.value = {};
  return {};
}

RecordedValues::RecordedValues(const std::string& directory) : path_((std::filesystem::path(directory) / kName).string()) {}

Result<Json> RecordedValues::at(const RecordedLine& line) try {
  if (!file_) {
    auto opened = FileReader::open(path_, {.fault = Fault::kOutput, .any_bytes = true});
    if (!opened) return opened.error();
    file_.emplace(std::move(*opened));
  }
  std::string text(line.bytes, '\0');
  if (!file_->read_at(line.at, text) || !json_nests_within(text))
    return failure(Fault::kOutput, "{}: was changed by something else while the batch ran", path_);
  return parse_json(text).at("result");
} catch (const JsonError&) {
  return failure(Fault::kOutput, "{}: was changed by something else while the batch ran", path_);
}

Result<BatchResult> BatchRecord::kept(const Earlier& earlier) const {
  Result<Json> value = RecordedValues(directory_).at(earlier.line);
  if (!value) return value.error();
  BatchResult found;
  found.outcome = BatchOutcome::kKept;
  found.seconds = earlier.seconds;
  found.output = earlier.output;
  found.value = std::move(*value);
  found.take_warnings();
  found.value = {};
  found.line = earlier.line;
  return found;
}

}  // namespace lamina::pipeline
