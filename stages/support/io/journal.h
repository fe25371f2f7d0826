// stages/support/io/journal.h: a text file that grows by whole lines and survives a kill at any moment.
//
// Each line is a single write. A line torn by a kill or a full disk stays torn: the next line starts after a line break,
// and readers must skip incomplete lines. An open journal locks the file; the lock ends with the process.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <string_view>

#include "stages/data/status.h"

namespace lamina {

/// Every line of a journal, in order, without its end, and where it begins; the last one may be torn.
/// cost    reads the file once
/// errors  kOutput: cannot be read, or a line of more than 64 MiB
using ReadLine = std::function<void(const std::string& line, std::uint64_t at)>;
Status read_journal(const std::string& path, const ReadLine& line);

/// Whether a process has the journal open; false if there is none. Changes nothing.
bool is_journal_held(const std::string& path);

class Journal {
 public:
  /// Opens a file without changing it, or creates it empty.
  /// held    error text after the path if another process holds the file: "another batch is running here"
  /// errors  kOutput: another process holds it, it is no file, or the system's reason
  static Result<Journal> open(const std::string& path, std::string_view held);
  Journal(Journal&& other) noexcept;
  Journal& operator=(Journal&&) = delete;
  ~Journal();

  bool empty() const;
  /// Whether its name still leads to this file. cost  two system calls
  bool has_its_name() const;
  /// Empties the file. errors  kOutput
  Status clear();
  /// Replaces the file by another one with these lines, in one step: a kill leaves the one or the other. The old one gets the
  /// name `old`, on file systems with hard links. errors  kOutput: the file stays as it is
  Status replace(std::string_view lines, const std::string& old);
  /// As read_journal().
  Status read(const ReadLine& line);
  /// Adds a line, which ends with a line's end. errors  kOutput: one line with the path and the system's reason
  Status append(std::string line);
  /// What was added survives a power cut; the caller syncs the folder. errors  kOutput
  Status sync();
  std::uint64_t end() const;  // of the last line that was added

 private:
  Journal(std::string path, int file) : path_(std::move(path)), file_(file) {}

  std::string path_;
  int file_, replaced_ = -1;
  bool torn_ = false;  // the file does not end with a line break
};

}  // namespace lamina
