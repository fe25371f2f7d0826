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

Hash128 key_of(const BatchJob& job) { return hash_text(job.output.empty() ? hex(job.id) : job.position()); }

constexpr std::string_view kPlan = R"({"plan":")";  // begins the first line of the record of a share

std::optional<Hash128> plan_in(std::string_view line) {
  Hash128 plan;
  return line.starts_with(kPlan) && read_hex(line.substr(kPlan.size(), 32), plan) ? std::optional(plan) : std::nullopt;
}

/// Adds the bytes of an output that is not UTF-8: JSON text loses them.
void add_output_bytes(const BatchJob& job, Json& entry) {
  const std::string_view output = job.position();
  if (!is_utf8(output)) entry["output_bytes"] = std::vector<std::uint8_t>(output.begin(), output.end());
}

/// errors  throws JsonError
std::string output_in(const Json& entry) {
  const Json* const list = entry.find("output_bytes");
  if (list == nullptr) return entry.at("output").text();
  const auto bytes = list->get<std::vector<std::uint8_t>>();
  return {bytes.begin(), bytes.end()};
}

/// Reads one line of the file; nothing if it is incomplete.
/// replacing  the list of the last run, if that replaces what is there
void read_line(const std::string& line, std::uint64_t at, std::map<Hash128, BatchRecord::Earlier, HashOrder>& earlier,
               std::optional<Hash128>& replacing) try {
  if (!json_nests_within(line)) return;
  const Json json = parse_json(line);
  if (json.contains("jobs")) {
    Hash128 list;
    const Json* overwrite = json.find("overwrite");
    replacing = overwrite != nullptr && read_hex(overwrite->text(), list) ? std::optional(list) : std::nullopt;
    return;
  }
  const bool ended = json.contains("ended");
  const std::string id = json.at(ended ? "ended" : "begun").text(), position = output_in(json);
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

/// Reads the lines of a record in order.
class RecordReader {
 public:
  void read(const std::string& line, std::uint64_t at) try {
    if (const auto plan = plan_in(line)) batch.plan = plan;
    if (!json_nests_within(line)) return;
    const Json json = parse_json(line);
    if (const Json* count = json.find("jobs")) return begin_list(count->get<std::size_t>());
    if (json.contains("kept")) return keep(json);
    add(json, {at, static_cast<std::uint32_t>(line.size())});
  } catch (const JsonError&) {
    return;
  }

  RecordedBatch batch;

 private:
  /// The id of a job, and its number if it has no output: equal jobs without output have one id.
  using Key = std::pair<Hash128, std::uint32_t>;
  struct KeyOrder {
    bool operator()(const Key& a, const Key& b) const {
      return a.first == b.first ? a.second < b.second : HashOrder()(a.first, b.first);
    }
  };

  void begin_list(std::size_t count) {
    for (auto& [number, job] : batch.jobs) {
      const Key key{job.job.id, job.job.output.empty() ? number : 0};
      if (job.ended) earlier_.insert_or_assign(key, std::move(job));
    }
    batch.jobs.clear();
    batch.planned = count;
  }

  /// errors  throws JsonError
  void keep(const Json& json) {
    Hash128 id;
    if (!read_hex(json.at("kept").text(), id)) return;
    const auto number = json.at("job").get<std::uint32_t>();
    auto found = earlier_.find({id, number});
    if (found == earlier_.end()) found = earlier_.lower_bound({id, 0});
    if (found == earlier_.end() || found->first.first != id) return;
    RecordedJob& job = batch.jobs[number] = found->second;
    job.job.number = number;
    job.job.entry.source = json.at("source").text();
  }

  /// errors  throws JsonError
  void add(const Json& json, const RecordedLine& position) {
    const bool ended = json.contains("ended");
    RecordedJob entry;
    entry.job.number = json.at("job").get<std::uint32_t>();
    entry.job.output = output_in(json);
    if (!read_hex(json.at(ended ? "ended" : "begun").text(), entry.job.id)) return;
    if (ended && !read_end(json, entry)) return;
    RecordedJob& known = batch.jobs[entry.job.number];
    if (!ended) {
      entry.begun = position;
    } else {
      entry.result.line = position;
      if (known.job.id == entry.job.id) entry.begun = known.begun;
    }
    known = std::move(entry);
  }

  /// errors  throws JsonError
  static bool read_end(const Json& json, RecordedJob& entry) {
    BatchResult& result = entry.result;
    const std::optional<BatchOutcome> outcome = outcome_of(json.at("outcome").text());
    if (!outcome || !read_hex(json.at("hash").text(), result.output.hash)) return false;
    result.outcome = *outcome;
    json.at("code").get_to(result.code);
    json.at("reason").get_to(result.reason);
    json.at("seconds").get_to(result.seconds);
    json.at("files").get_to(result.output.files);
    json.at("bytes").get_to(result.output.bytes);
    result.value = json.at("result");
    result.take_warnings();
    result.value = {};
    entry.job.entry.source = json.at("source").text();
    entry.job.entry.words = json.at("words").get<std::vector<std::string>>();
    entry.ended = true;
    if (const Json* elsewhere = json.find("elsewhere")) entry.elsewhere = elsewhere->get<bool>();
    return true;
  }

  std::map<Key, RecordedJob, KeyOrder> earlier_;  // that ended in the lists of earlier runs
};

Hash128 list_hash(const std::vector<BatchJob>& jobs) {
  std::string words;
  for (const BatchJob& job : jobs) words += hex(hash_text(job.entry.words.text()));
  return hash_text(words);
}

}  // namespace

std::string BatchFiles::path(std::string_view name, std::string_view ending) const {
  const std::string share_name = shares == 0 ? std::string() : fmt::format("-{}-of-{}", share, shares);
  return (std::filesystem::path(directory) / fmt::format("{}{}{}", name, share_name, ending)).string();
}

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

Result<BatchRecord> BatchRecord::open(const BatchFiles& files, bool resume, bool overwrite,
                                      const std::function<Result<Hash128>()>& plan) {
  namespace fs = std::filesystem;
  std::error_code error;
  fs::create_directories(files.directory, error);
  if (error) return failure(Fault::kOutput, "{}: {}", files.directory, error.message());
  const std::string path = files.record();
  auto journal =
      Journal::open(path, files.shares > 0 ? "this share is running right now in another process; wait for it"
                                           : "another batch is running here right now; wait for it or name another directory");
  if (!journal) return journal.error();
  BatchRecord record(files, std::move(*journal));
  const Result<Hash128> current = plan ? plan() : Hash128();
  if (!current) {
    if (record.journal_.empty()) fs::remove(path, error);  // what this call has made
    return current.error();
  }
  std::optional<Hash128> recorded;
  const auto read = [&](const std::string& line, std::uint64_t at) {
    if (const auto found = plan_in(line)) recorded = found;
    if (resume) read_line(line, at, record.earlier_, record.replacing_);
  };
  if (Status status = resume || plan ? record.journal_.read(read) : Status(); !status) return status.error();
  const bool replaced = plan && recorded != *current;  // of another plan
  if (!record.journal_.empty() && !resume && !overwrite && !replaced) {
    return usage(
        "{}: belongs to an earlier batch; continue it with --resume, replace it with --overwrite, or name another directory",
        path);
  }
  if (resume && !replaced) return record;
  record.earlier_.clear();
  record.replacing_.reset();
  if (Status status = record.journal_.clear(); !status) return status.error();
  if (Status status = plan ? record.append(json_line({{"plan", hex(*current)}})) : Status(); !status) return status.error();
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

Status BatchRecord::planned(const std::vector<BatchJob>& jobs, bool overwrite) {
  const Hash128 list = list_hash(jobs);
  replaces_ = overwrite || replacing_ == list;
  Json count = {{"jobs", jobs.size()}};
  if (replaces_) count["overwrite"] = hex(list);
  Status status = append(json_line(count));
  for (const BatchJob& job : jobs) {
    const Earlier* const known = job.refused ? nullptr : earlier(job);
    if (!status || known == nullptr || !known->ended || known->begun != job.id) continue;
    status = append(json_line({{"kept", hex(job.id)}, {"job", job.number}, {"source", job.entry.source}}));
  }
  return status;
}

Status BatchRecord::begun(const BatchJob& job, bool unowned) {
  Json entry = {{"begun", hex(job.id)}, {"job", job.number}, {"output", job.position()}};
  if (unowned) entry["unowned"] = true;
  add_output_bytes(job, entry);
  return append(json_line(entry));
}

Status BatchRecord::ended(const BatchJob& job, BatchResult& result) {
  Json entry = {{"ended", hex(job.id)}};
  entry.update(result_json(job, result, result.value));
  add_output_bytes(job, entry);
  // Of a job file: relative to the working directory, not to the batch's.
  if (job.below == 0 && !job.output.empty() && !job.output.starts_with('/')) entry["elsewhere"] = true;
  const std::string text = json_line(entry);
  if (Status status = append(text); !status) return status;
  result.line = {journal_.end() - text.size(), static_cast<std::uint32_t>(text.size() - 1)};
  result.value = {};
  return {};
}

Result<std::string> RecordedValues::line_at(const RecordedLine& line) {
  if (!file_) {
    auto opened = FileReader::open(path_, {.fault = Fault::kOutput, .any_bytes = true});
    if (!opened) return opened.error();
    file_.emplace(std::move(*opened));
  }
  std::string text(line.bytes, '\0');
  if (!file_->read_at(line.at, text))
    return failure(Fault::kOutput, "{}: was changed by something else while the batch ran", path_);
  return text;
}

Result<Json> RecordedValues::value_in(const std::string& line) const try {
  if (!json_nests_within(line)) throw JsonError("nests too deeply");
  return parse_json(line).at("result");
} catch (const JsonError&) {
  return failure(Fault::kOutput, "{}: was changed by something else while the batch ran", path_);
}

Result<BatchResult> BatchRecord::kept(const Earlier& earlier) const {
  Result<Json> value = RecordedValues(files_).at(earlier.line);
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

Result<RecordedBatch> read_record(const BatchFiles& files) {
  RecordReader reader;
  Status status = read_journal(files.record(), [&](const std::string& line, std::uint64_t at) { reader.read(line, at); });
  if (!status) return status.error();
  return std::move(reader.batch);
}

}  // namespace lamina::pipeline
