// stages/write/file_target.h: what a name leads to, and the temporary file beside it.
#pragma once

#include <cstdint>
#include <string>

#include "stages/data/status.h"

namespace lamina::write {

/// A file, there or not, or a descriptor that takes bytes as they come and has to be closed.
struct FileTarget {
  std::string file;  // its name with all links followed; "" for a stream
  int stream = -1;
};

/// Follows the links of a name. /dev/stdout, /dev/fd/3 and "-" are open descriptors.
/// errors  kOutput: a directory, too many links; without `stream` a device, a pipe, a socket, "-"
Result<FileTarget> find_target(const std::string& path, bool stream);

std::string part_of(const std::string& file);

/// Creates a temporary file that nobody else has; one that a killed run left is removed first.
/// path    for errors
/// lock    held until the descriptor is closed; without it, whoever calls has to be alone
/// errors  kOutput: the system's reason, another run has it, a link or no file is in its place
Result<int> create_part(const std::string& path, const std::string& part, bool lock);

/// Opens and locks a temporary file that an earlier run left, of at least `size` bytes.
/// errors  those of create_part; kOutput if it is absent or shorter
Result<int> take_part(const std::string& path, const std::string& part, std::uint64_t size);

}  // namespace lamina::write
