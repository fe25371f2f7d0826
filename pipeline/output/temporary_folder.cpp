#include "pipeline/output/temporary_folder.h"

#include <stdlib.h>

#include <filesystem>

namespace lamina::pipeline {

namespace fs = std::filesystem;

TemporaryFolder::TemporaryFolder(const std::string& purpose) {
  std::error_code none;
  std::string name = (fs::temp_directory_path(none) / ("lamina_" + purpose + "_XXXXXX")).string();
  if (!none && mkdtemp(name.data()) != nullptr) path_ = name;
}

TemporaryFolder::~TemporaryFolder() {
  std::error_code ignored;
  if (!path_.empty()) fs::remove_all(path_, ignored);
}

Status TemporaryFolder::status() const {
  if (!path_.empty()) return {};
  return Error{Fault::kOutput, "no temporary folder can be made; TMPDIR names the folder that they are made in"};
}

std::string TemporaryFolder::file(const char* name) const { return (fs::path(path_) / name).string(); }

}  // namespace lamina::pipeline
