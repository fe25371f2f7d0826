// stages/support/io/file_target.h: what a name leads to.
#pragma once

#include <string>

#include "stages/data/status.h"

namespace lamina::write {

/// A file, there or not, or what takes bytes as they come.
struct FileTarget {
  std::string file;    // its name with all links followed; "" for a stream
  std::string stream;  // the name of a device, a pipe, a socket, or of an open descriptor
  int descriptor = -1;
};

/// /dev/stdout, /dev/fd/3 and "-" are open descriptors. Opens nothing.
/// follow  links, dangling or not; else a link is the file that is replaced
/// errors  kOutput: a directory, without `follow` a device or a pipe too, too many links, the system's reason
Result<FileTarget> find_target(const std::string& path, bool follow = true);

/// returns  a descriptor of a stream, to be closed. errors  kOutput: it is not allowed, or the system's reason
Result<int> open_stream(const std::string& path, const FileTarget& target, bool allowed);

}  // namespace lamina::write
