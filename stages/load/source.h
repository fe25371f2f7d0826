// stages/load/source.h: the bytes of a part file, from disk or inflated in memory; internal to load.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "stages/data/buffer.h"
#include "stages/data/status.h"
#include "stages/support/io/file.h"
#include "stages/support/io/file_reader.h"

namespace lamina::load {

/// Random access to bytes, from any thread. Files are read, not mapped: mapped pages would count as resident, and a
/// file that is cut short while it is read would end the program.
class Source {
 public:
  Source() = default;

  /// errors  kInput: missing, not readable, not a regular file
  static Result<Source> open(const std::string& path);
  static Source of_memory(std::string path, std::shared_ptr<const Buffer<char>> bytes);

  std::string_view path() const { return path_; }
  /// Of the file before it was opened; nothing in memory.
  const std::optional<FileStamp>& stamp() const { return stamp_; }
  std::uint64_t size() const { return size_; }
  /// The bytes, if they are in memory.
  const std::shared_ptr<const Buffer<char>>& memory() const { return memory_; }

  /// Fills all of `to`; false if the file is shorter or cannot be read.
  bool read(std::uint64_t offset, char* to, std::size_t count) const;

  /// The bytes from the start that fit into `space`, which has to outlive them; none if they cannot be read.
  std::string_view head(std::span<char> space) const;

  /// An error about this file: "path: message".
  Error error(const std::string& message) const { return {Fault::kInput, path_ + ": " + message}; }
  Error changed_while_read() const { return error("cannot be read to its end; was it changed while it was read?"); }

 private:
  std::string path_;
  std::optional<FileStamp> stamp_;
  std::optional<FileReader> file_;  // else in memory
  std::shared_ptr<const Buffer<char>> memory_;
  std::uint64_t size_ = 0;
};

/// Inflates a gzip file (RFC 1952), all of its members.
/// errors  kInput: cut short, damaged, more than `limit` bytes, or a bomb (gzip_ratio_is_absurd)
Result<Source> inflate_gzip(const Source& compressed, std::uint64_t limit);

/// No part compresses better than 200:1 for long; what does is made to fill memory.
inline bool expansion_is_absurd(std::uint64_t compressed, std::uint64_t expanded) {
  return expanded > (64ull << 20) && expanded / 200 > compressed;
}

}  // namespace lamina::load
