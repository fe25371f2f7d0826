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
/// written, so that no byte is written that differs. Files above 32 MiB are read twice.
///
/// directory  of a whole job with a machine
/// consume    begin with what no earlier call delivered, and delete images and program of each layer as soon as its last byte
/// is
///            taken (check/consumed.h)
/// output     a file, which appears when it is whole; a device or a pipe; "-" is standard output
/// errors     kUsage: no such directory, no program; kVerification: unfinished, a shard, a file that is missing or differs;
///            kOutput; of Consumption
Result<StreamReport> stream_program(const std::string& directory, const std::string& output, bool consume = false);

}  // namespace lamina::pipeline
