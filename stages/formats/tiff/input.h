// stages/formats/tiff/input.h: a TIFF open for reading, beginning with any of its directories.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "stages/support/late/tiff.h"

namespace lamina::formats::tiff {

/// A file as libtiff reads it: for a page, with a header that names its directory as the first one. TIFFSetSubDirectory()
/// would walk all directories for each page. Not mapped: a file that becomes shorter while it is read is an error then, and no
/// signal.
class Input {
 public:
  /// file  open for reading, which stays the caller's. path  for messages. page  offset of a directory; 0: the first one
  Input(int file, const std::string& path, std::uint64_t page);
  Input(const Input&) = delete;
  Input& operator=(const Input&) = delete;

  TIFF* handle() const { return handle_.get(); }  // nullptr: it cannot be opened
  std::string message;                            // the first complaint of libtiff

 private:
  static tmsize_t read(thandle_t handle, void* to, tmsize_t count);
  static toff_t seek(thandle_t handle, toff_t offset, int whence);
  static toff_t size_of(thandle_t handle);

  void name_first_directory(std::uint64_t page);

  int file_;
  std::uint64_t size_ = 0, position_ = 0;
  std::vector<std::uint8_t> header_;  // as read; empty: that of the file
  TiffHandle handle_;
};

}  // namespace lamina::formats::tiff
