// pipeline/watch/candidates.h: which jobs the files of a watched folder make, and which of them can begin.
#pragma once

#include <atomic>
#include <deque>
#include <map>
#include <set>
#include <string>
#include <vector>

#include "pipeline/watch/folder.h"
#include "pipeline/watch/settings.h"
#include "stages/data/status.h"

namespace lamina::pipeline {

/// A job that can begin: all of its files are complete.
struct Candidate {
  std::string part;                  // the file that it is named after: a part, or a job file without a part next to it
  std::string job_file;              // that plans it; "": settings.with
  std::vector<std::string> inside;   // the files that it reads in the watched folder, `part` first
  std::vector<std::string> outside;  // paths of the other parts that a job file names
  FolderSettings settings;
};

/// The jobs of the files, found anew after each scan.
///   a part next to a job file of its name (bracket.stl, bracket.toml) that names no parts   a job of both
///   a job file that names parts                                                            a job of all of them
///   any other part                                                                         a job of its own
/// A part waits while a job file in its folder, or in one above, is incomplete: it may name the part.
class Candidates {
 public:
  Candidates(Folder& folder, FolderSettings settings, const ReadCall& read)
      : folder_(folder), settings_(std::move(settings)), read_(read) {}

  /// active  names of jobs that run: they and their parts are left out
  void find(const std::set<std::string>& active, const std::atomic<bool>& stop);

  std::deque<Candidate> ready;                        // by name
  std::map<std::string, std::set<std::string>> used;  // by which jobs of the folder each file is read
  bool any_unsettled = false;                         // a file may become complete by time alone
  Fault left = Fault::kInterrupted;                   // what the first file that waits lacks; kInterrupted: no file waits
  /// One line for each file that waits for something else than time, and for each watch.toml with an error; each once.
  std::vector<std::string> take_waits();

 private:
  /// A folder with its settings, or without, if they are incomplete or wrong.
  struct SettingsOfFolder {
    FolderSettings settings;
    bool valid = true;
  };
  /// A job file that is complete.
  struct JobFile {
    FileStamp stamp;
    bool valid = true;
    std::vector<std::string> inside, outside;
  };

  const SettingsOfFolder& settings_of(const std::string& folder);
  void read_job_files();
  bool is_complete(const std::string& file);
  void add_job(const std::string& job_file);
  void add_part(const std::string& part);
  void waits(const std::string& file, Fault fault, const std::string& line);
  bool is_held(const std::string& folder) const;

  Folder& folder_;
  FolderSettings settings_;
  const ReadCall& read_;
  const std::atomic<bool>* stop_ = nullptr;
  std::map<std::string, SettingsOfFolder> folders_;
  std::map<std::string, JobFile> jobs_, known_jobs_;
  std::set<std::string> named_, held_;          // parts that job files name; folders with an incomplete job file
  std::set<std::string> stems_;                 // of parts that no job file names
  std::map<std::string, std::string> by_stem_;  // job files that name no parts
  std::map<std::string, std::string> reported_, waiting_;
  std::vector<std::string> fresh_;
};

}  // namespace lamina::pipeline
