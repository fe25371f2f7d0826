// pipeline/report/replay_text.h: what the replay of a job found, for people and for programs.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "stages/replay/count.h"
#include "stages/support/text/json_value.h"

namespace lamina::replay {

struct Totals {
  std::string machine;
  std::uint64_t layers = 0;
  Count count;
  std::uint64_t moved = 0, lost = 0;  // pixels of blocked nozzles
  Material material;
  double coverage = 0;  // drops / pixels of the layers
};

/// Lines of text, each with its name.
std::vector<std::string> totals_text(const Totals& totals);
/// Lengths in mm, time in seconds.
Json totals_json(const Totals& totals);

/// "1 h 38 min (5930.2 s) on nuferbj"
std::string time_text(double seconds, const std::string& machine);

}  // namespace lamina::replay
