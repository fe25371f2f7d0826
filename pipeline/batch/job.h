// pipeline/batch/job.h: the jobs of a batch: read from lists, directories and job files, then made ready to run.
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "pipeline/cache/input_digests.h"
#include "pipeline/plan/progress.h"
#include "stages/data/status.h"
#include "stages/support/hash/hash.h"
#include "stages/support/text/json_value.h"

namespace lamina::pipeline {

/// The words of a command line in one piece of memory: a batch has many.
class PackedWords {
 public:
  PackedWords() = default;
  PackedWords(const std::vector<std::string>& words) {
    std::size_t bytes = 0;
    for (const std::string& word : words) bytes += word.size() + 1;
    text_.reserve(bytes);
    for (const std::string& word : words) (text_ += word) += '\0';
  }
  std::vector<std::string> unpacked() const {
    std::vector<std::string> words;
    for (std::size_t at = 0; at < text_.size(); at += words.back().size() + 1) words.emplace_back(text_.c_str() + at);
    return words;
  }
  std::string_view text() const { return text_; }  // a NUL byte ends each word

 private:
  std::string text_;
};

/// One job as written in its source.
struct BatchEntry {
  std::string source;  // where: "jobs.txt:12", "parts/bracket.stl"
  std::string name;    // default name of the output; not unique yet
  PackedWords words;   // command and arguments: "jet", "bracket.stl", "--dpi", "600"
};

/// The jobs of all operands, in order:
///   NAME.toml                         a job file: COMMAND --job NAME.toml, of the command in its first lines (job_command.h),
///                                     else of jet
///   NAME.stl .obj .3mf (.gz)          a part: `with` and the file
///   a directory                       all of the above in it and below it, by name
///   anything else                     a list: one command line a line, "jet bracket.stl --dpi 600 -o bracket"; the word
///                                     lamina in front, empty lines and comments are skipped
/// errors  kUsage: an operand that is missing, unreadable or without jobs; a line that cannot be split
Result<std::vector<BatchEntry>> read_batch(const std::vector<std::string>& operands, const std::vector<std::string>& with);

/// What a batch adds to a job's command line when the job starts.
struct CallSettings {
  std::string output;                                                          // "" if the command line has none
  std::uint64_t layer_bytes = 0;                                               // layer budget if the command line sets none
  enum class Earlier { kNone, kContinue, kReplace } earlier = Earlier::kNone;  // output of an earlier run
  bool synced_later = false;  // by the queue: the job does not sync its files
};

enum class BatchOutcome {
  kDone,       // ended with exit code 0
  kKept,       // done before, output unchanged
  kFailed,     // ended with another exit code
  kTimeLimit,  // exceeded the time limit
  kStopped,    // stopped with the batch
  kNotRun      // never started
};

std::string_view outcome_name(BatchOutcome outcome);
/// Of a name; nothing if no outcome has it.
std::optional<BatchOutcome> outcome_of(std::string_view name);

/// For sets and maps of names, which take less as hashes.
struct HashOrder {
  bool operator()(const Hash128& a, const Hash128& b) const { return std::pair(a.high, a.low) < std::pair(b.high, b.low); }
};

/// A line of the record: bytes [at, at + bytes) of the file.
struct RecordedLine {
  std::uint64_t at = 0;
  std::uint32_t bytes = 0;
};

struct BatchResult {
  BatchOutcome outcome = BatchOutcome::kNotRun;
  int code = 0;        // of the command; 3 on the time limit
  std::string reason;  // one line, if the job is not done
  Json value;          // result of the command; null if none, or where the record has it
  RecordedLine line;   // of the record that has the value; empty if none
  std::uint32_t warnings = 0;
  std::string first_warning;
  double seconds = 0;
  TreeDigest output;
  bool digested = false;    // `output` is known without reading the files
  bool unsynced = false;    // the queue syncs the files
  bool recognized = false;  // kept without a record: the directory holds the finished job

  /// Whether the job failed by itself, as opposed to being stopped with the batch.
  bool failed() const { return outcome == BatchOutcome::kFailed || outcome == BatchOutcome::kTimeLimit; }
  /// Counts the warnings in the value.
  void take_warnings();
};

/// A command line as a batch sees it before it runs.
struct Call {
  std::string output;               // "" if the command line names none
  bool output_of_job_file = false;  // relative to the working directory, not to the batch's directory
  std::string side_output;          // option of another file that is written, with its text: "--quote prices.csv"
  /// Extension of the default output name, "" for a directory. Absent: the command only returns a value.
  std::optional<std::string> ending;
  bool can_continue = false, can_replace = false;  // output of an earlier run
  std::optional<std::uint64_t> layer_bytes;        // its layer budget; 0 if it accepts one and sets none
  bool names_sync = false;                         // when its files are synced is stated by the words or the job file
  std::vector<std::string> inputs;                 // words of the command line that may be input files
  double layer_mm = 0;                             // layer thickness of a job with layers, else 0
  PackedWords parsed;                              // for RunJob
};

/// Parses a command line of at least one word; any thread. errors  kUsage: invalid command line
using ReadCall = std::function<Result<Call>(const std::vector<std::string>& words)>;

struct BatchJob {
  std::uint32_t number = 0;  // from 1
  BatchEntry entry;          // its name is unique and becomes the output's unless the job names one
  PackedWords parsed;        // of its Call
  std::string output;        // file or directory; empty if the command only returns a value
  std::uint32_t below = 0;   // length of the batch's directory in front of an output in it
  bool relative_output = false;                    // the output was given relative to the batch's directory
  bool can_continue = false, can_replace = false;  // output of an earlier run
  bool names_sync = false;
  std::uint64_t layer_bytes = 0;                   // for the layers in flight
  std::uint64_t need_bytes = 0;   // expected peak memory
  Hash128 id;                     // hash of version, words, output path and all input files
  std::optional<Error> refused;   // invalid job: it fails at its turn, the others run

  /// The output as reported: below the batch's directory, else as given.
  std::string_view position() const { return std::string_view(output).substr(below); }
};

/// Runs a job; callable from any thread. Progress is reported from one thread at a time.
/// returns  code, reason, value, and whether all layers existed already; the queue fills in the rest
using RunJob =
    std::function<BatchResult(const BatchJob&, const CallSettings&, const ProgressCallback&, const std::atomic<bool>& cancel)>;

struct BatchShare {
  std::string directory;          // of the batch
  std::uint64_t layer_bytes = 0;  // for each job without a budget of its own
  InputDigests* inputs = nullptr;  // known hashes of files, which outlive the call; nullptr: own ones
};

/// Receives each job with its call, an empty one if the job is refused.
using InspectCall = std::function<void(const BatchJob&, const Call&)>;

/// Prepares the jobs in the order of the entries. Writes nothing. Some hundred bytes a job stay.
/// inspect  if set, no input file is read: identify_jobs() completes the jobs that will run
/// errors  kUsage: outputs of two jobs coincide or nest (both are named); an output collides with the batch's own files;
///         a relative output leaves the batch's directory
/// cost    reads every input file once, to detect later changes
Result<std::vector<BatchJob>> prepare_batch(std::vector<BatchEntry> entries, const BatchShare& share, const ReadCall& read,
                                            const InspectCall& inspect = {});

/// Sets id and expected memory from the input files. cost  reads every input file of these jobs once
void identify_jobs(std::vector<BatchJob>& jobs, const BatchShare& share, const ReadCall& read);

/// Whether a batch keeps a file of this name in its directory: batch.jsonl, batch-2-of-4.jsonl, summary.json, shares.tsv.
bool is_batch_file(std::string_view name);

}  // namespace lamina::pipeline
