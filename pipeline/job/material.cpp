#include "pipeline/job/material.h"

#include <fmt/format.h>

#include <algorithm>

#include "pipeline/job/job.h"
#include "pipeline/text/key_text.h"

namespace lamina::pipeline {
namespace {

constexpr std::size_t kLongestName = 40;

}  // namespace

std::string read_material(std::string_view text, std::string& name) {
  const bool good = !text.empty() && text.size() <= kLongestName && std::ranges::all_of(text, [](unsigned char c) {
    return (c >= '0' && c <= '9') || (c >= 'A' && c <= 'Z') || (c >= 'a' && c <= 'z') || c == '-' || c == '_';
  });
  if (!good) return fmt::format("'{}' is no name of a material; use up to {} letters, digits, - and _", text, kLongestName);
  name = text;
  return {};
}

Status set_materials(std::string_view text, Job& job) {
  const auto names = split(text, ",");
  if (names.size() != 1 && names.size() != job.parts.size()) {
    return Error{Fault::kUsage,
                 fmt::format("{} names for {} parts; give one for all or one for each", names.size(), job.parts.size())};
  }
  for (std::size_t p = 0; p < job.parts.size(); ++p) {
    const auto name = names[names.size() == 1 ? 0 : p];
    if (const std::string what = read_material(name, job.parts[p].material); !what.empty()) {
      return Error{Fault::kUsage, what};
    }
  }
  return {};
}

std::string read_material_ranges(std::string_view text, std::vector<MaterialRange>& ranges) {
  ranges.clear();
  for (std::string_view piece : split(text, ";")) {
    while (piece.starts_with(' ')) piece.remove_prefix(1);
    while (piece.ends_with(' ')) piece.remove_suffix(1);
    const std::size_t gap = piece.find(' ');
    const auto ends = split(piece.substr(0, gap), ":");
    MaterialRange range;
    if (gap == std::string_view::npos || ends.size() != 2) return fmt::format("'{}' is no range; write 2:4.5 bronze", piece);
    for (const auto& [end, value] : {std::pair{ends[0], &range.from_mm}, {ends[1], &range.to_mm}}) {
      if (auto what = read_number(end, 0, kMostMm, " mm", *value); !what.empty()) return what;
    }
    if (range.from_mm >= range.to_mm) return fmt::format("'{}' ends where it begins, or below", piece);
    if (auto what = read_material(piece.substr(piece.find_last_of(' ') + 1), range.material); !what.empty()) return what;
    ranges.push_back(range);
  }
  return {};
}

}  // namespace lamina::pipeline
