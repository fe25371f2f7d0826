// pipeline/output/program_file.h: a file that grows while it is hashed, and appears under its final name when it is whole.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>

#include "pipeline/text/hash.h"
#include "stages/data/status.h"

namespace lamina::pipeline {

class ProgramFile {
 public:
  /// Writes path + ".part". errors  kOutput with the system's reason
  static Result<ProgramFile> create(const std::string& path);
  ProgramFile(ProgramFile&&) noexcept;
  ProgramFile& operator=(ProgramFile&&) noexcept;
  /// Removes what was begun and not finished.
  ~ProgramFile();

  Status append(std::span<const std::byte> bytes);
  /// Gives the file its name, and says what is in it.
  Result<FileDigest> finish();

 private:
  ProgramFile();
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace lamina::pipeline
