// stages/data/input/digest_range.h: the fingerprint of a stretch of a file.
#pragma once

#include <optional>

#include "stages/data/input/file_reader.h"
#include "stages/data/input/hash.h"

namespace lamina {

/// XXH3-128 of `bytes` bytes from `offset` on, read in pieces of 256 KiB; nothing if the file is shorter.
std::optional<Hash128> digest_range(const FileReader& file, std::uint64_t offset, std::uint64_t bytes);

}  // namespace lamina
