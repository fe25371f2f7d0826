// pipeline/check/stream.h: the whole print program of a finished job, for the host that sends it to the machine.
#pragma once

#include <cstdint>
#include <string>

#include "stages/data/status.h"

namespace lamina::pipeline {

struct StreamReport {
  std::string directory;
  std::uint64_t layers = 0, bytes = 0;  // bytes: written
};

/// Writes start, layers in order and end, expanded. A file is compared with its hash in the manifest before its first byte is
/// written, so that no byte is written that differs.
///
/// directory  of a whole job with a machine
/// output     a file, which appears when it is whole; a device or a pipe; "-" is standard output
/// errors     kUsage: no such directory, no program; kVerification: unfinished, a shard, a file that is missing or differs;
///            kOutput
Result<StreamReport> stream_program(const std::string& directory, const std::string& output);

}  // namespace lamina::pipeline
