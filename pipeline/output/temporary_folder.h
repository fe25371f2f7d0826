// pipeline/output/temporary_folder.h: a folder for files that only the call that makes them reads.
#pragma once

#include <string>

#include "stages/data/status.h"

namespace lamina::pipeline {

/// In TMPDIR; gone with all that is in it when it is left. One of a killed run is removed by the next run of the same purpose.
class TemporaryFolder {
 public:
  /// purpose  a word of its name, as in "design"
  explicit TemporaryFolder(const std::string& purpose);
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;
  ~TemporaryFolder();
  /// errors  kOutput: it could not be made
  Status status() const;
  /// The path of a file in it.
  std::string file(const char* name) const;

 private:
  std::string path_;
  int lock_ = -1;  // of a file in it
};

}  // namespace lamina::pipeline
