// stages/support/io/file_reader.h: the one way to open and read a file.
//
// A name leads to a regular file or to one line of error: a pipe without a writer, a device, a directory or a file
// without line ends costs neither time nor memory.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <string_view>

#include "stages/data/status.h"

namespace lamina {

/// What a kind of file may be, and how its errors read.
struct ReadRules {
  Fault fault = Fault::kVerification;
  std::string_view missing = "no such file";  // of a name that leads nowhere
  std::string_view directory = "is a directory, not a file";
  std::string_view device = "is a device or a pipe, not a file";
  std::string_view no_text = "is no text file";  // of a line with a NUL byte, or that is too long
  std::uint64_t max_bytes = UINT64_MAX;          // of the file
  std::size_t longest_line = 64 << 10;           // bytes
  bool any_bytes = false;                        // lines may hold NUL bytes
  bool cr_ends = false;                          // lines end with CR, LF or CR LF instead of LF
  bool streams = false;                          // `-`, /dev/stdin and /dev/fd/N are read as well: pipes by request
};

/// Bounds by kind of file; docs/reference/job.md and docs/reference/formats.md name them.
inline constexpr std::uint64_t kMaxTomlBytes = 16 << 20, kMaxTableBytes = 64 << 20, kMaxListBytes = 256 << 20;

/// Reads a file from its start, whole or line by line. Thread-compatible; movable.
class FileReader {
 public:
  /// errors  rules.fault: "path: reason" for what is missing, unreadable, no regular file, or longer than the rules allow
  static Result<FileReader> open(const std::string& path, const ReadRules& rules);
  FileReader(FileReader&&) noexcept;
  FileReader& operator=(FileReader&&) noexcept;
  ~FileReader();

  const std::string& path() const;
  std::uint64_t size() const;  // bytes; 0 of a stream
  int descriptor() const;      // at the file's start until text(), next() or read() is called; of an entry, that of a copy

  /// All that has not been read. errors  rules.fault: cannot be read, or longer than the rules allow
  Result<std::string> text();

  /// The next line, without its end, valid until the next call; false at the end and after an error, see status().
  bool next(std::string_view& line);
  /// From here on lines are at most so long.
  void bound_lines(std::size_t longest);
  /// Why next() stopped before the end. errors  rules.fault: "path:line: reason"
  const Status& status() const;
  std::uint64_t line_number() const;  // of the line that next() gave, from 1
  std::uint64_t offset() const;       // bytes, behind that line and its end
  bool ended_by_break() const;        // the line that next() gave had an end
  bool ended_by_cr() const;           // which was CR alone
  /// Continues reading there, after `lines` lines. Not of a stream.
  void go_to(std::uint64_t offset, std::uint64_t lines);

  /// The next bytes, as of ::read(); 0 at the end. Not together with next(). errors  rules.fault
  Result<std::size_t> read(std::span<char> to);

  /// Fills all of `to` from that place; false if the file is shorter. Not of a stream; leaves next() alone.
  bool read_at(std::uint64_t offset, std::span<char> to) const;

 private:
  struct State;
  explicit FileReader(std::unique_ptr<State> state);
  std::unique_ptr<State> state_;
};

/// The whole content of a file. errors  of FileReader
Result<std::string> read_file(const std::string& path, const ReadRules& rules);

/// Whether a name stands for standard input or for a descriptor that the caller handed over.
bool names_stream(std::string_view path);

}  // namespace lamina
