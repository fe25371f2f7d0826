// pipeline/batch/job.h: a job of a batch made ready to run: its command, its output, what it reads and what it needs.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "pipeline/batch/list.h"
#include "pipeline/cli/command.h"
#include "stages/data/hash.h"
#include "stages/data/status.h"

namespace lamina::pipeline {

struct BatchJob {
  BatchEntry entry;  // its name is the output's, and unique, if it does not name one itself
  const Command* command = nullptr;
  std::vector<std::string> arguments;  // what the command is given
  std::string output;                  // file or directory that it writes; empty if its result is what it prints
  std::string place;                   // the output for reports: below the batch's directory, else as it was given
  bool relative_output = false;        // its output was given relative to the batch's directory
  bool can_resume = false, can_overwrite = false;
  std::uint64_t need_bytes = 0;  // most memory that it is expected to hold
  Hash128 id;                    // of the version, the words, the output's place and every file that it reads
  std::optional<Error> refused;  // it is wrong in itself: it fails at its turn, the others run
};

struct BatchShare {
  std::string directory;          // of the batch
  std::uint64_t layer_bytes = 0;  // --memory of every job that does not give one
};

/// Makes the jobs ready, in the order of the entries. Nothing is written.
/// errors  kUsage: two jobs write into the same place, or one into the other's (both are named); a job writes where the
///         batch keeps its own files; a relative output leads out of the batch's directory
/// cost    reads every file that a job names once, to tell later whether it has changed
Result<std::vector<BatchJob>> prepare_batch(std::vector<BatchEntry> entries, const BatchShare& share);

/// Memory that a part file may take while it is loaded and planned, from its size and format.
std::uint64_t part_bytes(const std::string& path, std::uint64_t file_bytes);

struct OutputDigest {
  std::uint64_t files = 0, bytes = 0;
  Hash128 hash;  // of names, sizes and contents
};

/// The regular files at or below `path`, in the order of their names; no file if there is none.
/// errors  kVerification if one cannot be read
Result<OutputDigest> digest_output(const std::string& path);

}  // namespace lamina::pipeline
