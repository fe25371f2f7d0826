// stages/write/journal.h: a text file that grows by whole lines and survives being killed at any moment.
//
// Each line is a single write. A line that a kill or a full disk has torn stays torn: the next one begins on a line of its
// own, and whoever reads the file has to skip what is not whole. As long as the journal is open it holds a lock on the
// file, which is gone with the process.
#pragma once

#include <functional>
#include <string>
#include <string_view>

#include "stages/data/status.h"

namespace lamina::write {

class Journal {
 public:
  /// Opens a file, which is created empty if it is absent. Nothing in it is changed.
  /// held    what is said behind the path if another process holds it: "another batch is running here"
  /// errors  kOutput: another process holds it, or the system's reason
  static Result<Journal> open(const std::string& path, std::string_view held);
  Journal(Journal&& other) noexcept;
  Journal& operator=(Journal&&) = delete;
  ~Journal();

  bool empty() const;
  /// Begins anew. errors  kOutput
  Status clear();
  /// Every line so far, in order, without its end; the last one may be torn. cost  reads the file once
  void read(const std::function<void(const std::string&)>& line);
  /// Adds a line, which ends with a line's end. errors  kOutput: one line with the path and the system's reason
  Status append(std::string line);

 private:
  Journal(std::string path, int file) : path_(std::move(path)), file_(file) {}

  std::string path_;
  int file_;
  bool torn_ = false;  // the file does not end with a line's end
};

}  // namespace lamina::write
