// stages/support/hash/digest_range.h: the fingerprint of a stretch of a file.
#pragma once

#include <optional>

#include "stages/support/hash/hash.h"
#include "stages/support/io/file_reader.h"

namespace lamina {

/// XXH3-128 of `bytes` bytes from `offset` on, read in pieces of 256 KiB; nothing if the file is shorter.
std::optional<Hash128> digest_range(const FileReader& file, std::uint64_t offset, std::uint64_t bytes);

}  // namespace lamina
