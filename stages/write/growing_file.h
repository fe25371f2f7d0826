// stages/write/growing_file.h: a file that is written piece by piece and appears under its name only when it is whole.
#pragma once

#include <span>
#include <string>

#include "stages/data/status.h"

namespace lamina::write {

/// Writes path + ".part" and renames it at the end. Not finished, it is removed again.
class GrowingFile {
 public:
  /// errors  kOutput with the path and the system's reason
  static Result<GrowingFile> open(const std::string& path);
  GrowingFile(GrowingFile&& other) noexcept;
  GrowingFile& operator=(GrowingFile&&) = delete;
  ~GrowingFile();

  Status append(std::span<const char> bytes);
  /// Closes the file and gives it its name.
  Status finish();
  std::uint64_t size() const { return size_; }

 private:
  GrowingFile(std::string path, int file) : path_(std::move(path)), file_(file) {}
  std::string path_;
  int file_ = -1;
  std::uint64_t size_ = 0;
};

}  // namespace lamina::write
