// pipeline/show/title.h: what pictures and pages of a job are called.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "pipeline/plan/scene.h"

namespace lamina::pipeline {

/// "bracket.stl and 2 more"; empty without parts.
inline std::string title_of(const std::vector<PartSummary>& parts) {
  if (parts.empty()) return {};
  const std::string name = std::filesystem::path(parts.front().path).filename().string();
  return parts.size() == 1 ? name : name + " and " + std::to_string(parts.size() - 1) + " more";
}

}  // namespace lamina::pipeline
