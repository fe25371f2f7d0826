// pipeline/watch/record.h: what a watcher has begun and ended, in a file that survives a kill at any moment.
//
// watch.jsonl is a journal of JSON objects (stages/support/io/journal.h), one for each step of a job, with its time:
//   begun    the job's files, with size, time of change and hash
//   dropped  a file changed while it was planned: the result was discarded
//   planned  exit code, reason and result; the result has its name from now on, and the files are moved
//   moved    where the part is now
//   then     the command after the job begins
//   ended    nothing is left to do
#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "pipeline/batch/job.h"
#include "pipeline/watch/folder.h"
#include "stages/data/status.h"
#include "stages/support/hash/hash.h"
#include "stages/support/io/journal.h"
#include "stages/support/text/json_value.h"

namespace lamina::pipeline {

/// A file that a job reads: content and stamp at its begin.
struct WatchedInput {
  std::string path;  // relative to the watched folder if it is `inside`, else as the job names it
  bool inside = true;
  FileStamp stamp;
  Hash128 hash;
};

/// A job of a watched folder, from its begin to its end.
struct WatchedJob {
  std::string part;                  // the file that it is named after, relative to the watched folder
  std::vector<std::string> words;    // command line
  std::vector<WatchedInput> inputs;  // of these, the first is `part`
  std::string root;                  // directory of its result
  std::string name;                  // of its result in there, without ending; not unique yet
  std::string ending;                // "", ".gcode"; of a directory ""
  bool has_output = false;           // else the result is a value
  std::string then;                  // shell command; "": none
  // --- set while it runs
  Hash128 id;        // of the part's name and all inputs
  std::string work;  // folder in which it is planned
  bool planned = false, moved = false;
  std::string stem;  // final path of the result without ending; "" if there is none
  std::string now;   // where the part is, once it was moved
  BatchResult result;
};

class WatchRecord {
 public:
  /// Opens directory/watch.jsonl, creates both if absent, and reads what is unfinished. A file of more than 16 MiB is replaced
  /// by the lines of that, and becomes watch.old.jsonl. errors  kOutput: another watcher holds it, or the system's reason.
  /// kUsage: it belongs to another watched folder, or a name is not in UTF-8, which it cannot contain
  static Result<WatchRecord> open(const std::string& directory, const std::string& root);

  /// Of this record alone, from its first run on; other watchers may write to the same folders.
  const std::string& id() const { return id_; }
  /// Jobs that were planned, and are to be moved or to run their command; in the order of their begin. To be called once.
  std::vector<WatchedJob> take_unfinished();
  /// Work folders of jobs that begun and were not planned, by the name of the part.
  std::map<std::string, std::string>& begun_work() { return begun_work_; }

  // --- from one thread at a time; errors  kOutput, also if the record was removed or replaced
  Status begun(const WatchedJob& job);
  Status dropped(const WatchedJob& job);
  Status planned(const WatchedJob& job);
  Status moved(const WatchedJob& job);
  Status then(const WatchedJob& job);
  Status ended(const WatchedJob& job, std::optional<int> then_code);

 private:
  WatchRecord(Journal journal, std::string path) : journal_(std::move(journal)), path_(std::move(path)) {}
  void read_line(const std::string& line);
  std::string unfinished_lines() const;
  Status append(const char* event, const WatchedJob& job, const Json& more);

  Journal journal_;
  std::string path_, id_;
  std::string folder_;                             // the watched one, of the last run
  std::vector<std::string> order_;                 // ids
  std::map<std::string, WatchedJob> jobs_;         // by id
  std::map<std::string, std::string> lines_;       // of these, by id
  std::map<std::string, std::string> begun_work_;  // by part
};

}  // namespace lamina::pipeline
