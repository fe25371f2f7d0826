// tests/commands/unpack_runs.h: the code of runs in a report's page, read back by a reader of its own.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "stages/data/runs.h"
#include "stages/data/status.h"

namespace lamina::test {

/// The image again. errors  kVerification: the bytes are not such a code of an image of that size
Result<Runs> unpack_runs(std::span<const std::byte> packed, std::uint32_t columns, std::uint32_t rows);

}  // namespace lamina::test
