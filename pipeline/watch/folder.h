// pipeline/watch/folder.h: the part and job files below a watched folder, and when each of them changed last.
//
// The folder is read again and again, which works on every file system. Events (inotify) wake the reader early, and state that
// a file was renamed into the folder or closed by its writer.
#pragma once

#include <chrono>
#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "pipeline/watch/completeness.h"
#include "stages/data/status.h"

namespace lamina::pipeline {

/// What changes when a file is written or replaced.
struct FileStamp {
  std::uint64_t inode = 0, bytes = 0;
  std::int64_t mtime_ns = 0;
  friend bool operator==(const FileStamp&, const FileStamp&) = default;
};
/// Of a regular file, not of what a link leads to; nothing for anything else.
std::optional<FileStamp> stamp_of(const std::string& path);

struct WatchedFile {
  enum class Arrival { kUnknown, kClosed, kRenamed };  // the last event after its last change
  FileStamp stamp;
  Arrival arrival = Arrival::kUnknown;
  std::chrono::steady_clock::time_point unchanged_since;
  bool writer_checked = false;  // for this stamp, without an event
  std::optional<FileEnd> end;   // of this stamp, if it was read
  std::chrono::steady_clock::time_point end_read_at;
  bool has_writer = false;  // would be complete, but a process has it open for writing
};

class Folder {
 public:
  /// root     as given by the caller
  /// skipped  folders below it whose files do not count, relative to it
  /// errors   kUsage: missing or no folder, or a folder above or below is watched. kOutput: another process holds it
  /// cost     reads all folders below it
  static Result<Folder> open(const std::string& root, std::vector<std::string> skipped);
  Folder(Folder&& other) noexcept;
  Folder& operator=(Folder&&) = delete;
  ~Folder();

  const std::string& root() const { return root_; }
  /// A file's name for messages and commands.
  std::string path_of(const std::string& relative) const;
  /// To be polled for input; -1 without events.
  int events() const { return events_; }
  /// Takes the events so far. returns  whether files or folders came, went or were closed
  bool take_events();

  /// Reads the folder, also a new one of its name. Hidden files and folders, links and files of other names are left out.
  /// errors  kInput: the folder cannot be read; kOutput: another process holds the new one; files() stays as it was
  Status scan();
  /// By their names relative to the folder.
  std::map<std::string, WatchedFile>& files() { return files_; }
  /// One line for each folder that cannot be read, and if events are missing; each once while it lasts.
  std::vector<std::string> take_problems();

  /// Whether the file has all of its content: it has the length that it states, and was closed, renamed or unchanged for
  /// `settle_seconds`; or it states none, nothing is missing, and it was renamed or unchanged for so long. No process has it
  /// open for writing, where the system states that.
  /// cost  of end_of_file(), once for each change; of a file that cannot be read, once a second
  bool is_complete(const std::string& relative, double settle_seconds, const std::atomic<bool>& stop);
  /// What a file lacks that is unchanged for so long; "" if nothing. Only after is_complete().
  static std::string lack_of(const WatchedFile& file, double settle_seconds);

 private:
  enum class Event { kChanged, kClosed, kRenamed };
  Folder(std::string root, std::vector<std::string> skipped) : root_(std::move(root)), skipped_(std::move(skipped)) {}
  /// Locks the folder of the name, if it is not the one that is locked. errors  of scan()
  Status hold();
  bool read_folder(const std::string& relative, std::map<std::string, WatchedFile>& found);
  void add_events(const std::string& relative);
  void take_file(const std::string& relative, std::map<std::string, WatchedFile>& found);
  void report(std::string problem);

  std::string root_;
  std::vector<std::string> skipped_, problems_;
  std::set<std::string> reported_, found_;  // problems up to the last scan, and since then
  int events_ = -1, held_ = -1;
  std::map<int, std::string> folders_;    // of watch descriptors, relative
  std::map<std::string, Event> changes_;  // since the last scan
  std::map<std::string, WatchedFile> files_;
};

/// A folder's or file's name below another one: "sub" and "part.stl" are "sub/part.stl".
std::string joined(const std::string& folder, const std::string& name);
/// Whether the name is that of a job file (.toml).
bool is_toml_name(const std::string& path);

}  // namespace lamina::pipeline
