// stages/write/atomic_file.h: a file appears under its final name only when it is whole.
#pragma once

#include <cstddef>
#include <span>
#include <string>

#include "stages/data/status.h"

namespace lamina::write {

/// Writes `bytes` under a temporary name beside `path` (path + ".part"), then renames it. A symbolic link stays one, and
/// the file that it leads to is written. A device, a pipe or a directory of that name is not replaced.
/// errors  kOutput, one line with the path and the system's reason (no space, no permission, ...); the temporary file
///         is removed again, and an older file of that name stays as it was.
Status write_file(const std::string& path, std::span<const std::byte> bytes);

/// The one line about a file that could not be written, from the system's error number: what happened and what to do.
Error write_failure(const std::string& path, int code);

}  // namespace lamina::write
