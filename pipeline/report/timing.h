// pipeline/report/timing.h: the run time's breakdown and its hardware limit. `--timing`
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "pipeline/flow/layers.h"
#include "stages/formats/null/floor.h"
#include "stages/support/clocks.h"
#include "stages/support/text/json_value.h"

namespace lamina::pipeline {

struct Timing {
  struct TimedPhase {
    std::string_view name;
    Elapsed took;
  };
  std::uint32_t threads = 1;
  std::vector<TimedPhase> phases;  // one after the other; together the run. Of "start", what the process did before, the
                                   // processor's time stands for both, in a batch with that of other jobs
  std::vector<NodeTime> nodes;     // of the graph that makes the layers, at the same time
  std::optional<formats::Floor> floor;  // of jobs that are rastered
  std::string not_measured;             // why the limit is not; else empty

  Elapsed whole() const;
};

/// The share of a phase's wall time in which one thread works, if all others have an equal part of the rest; 0 with one
/// thread. As by Amdahl, "Validity of the single processor approach", 1967.
double serial_share(const Elapsed& took, std::uint32_t threads);

using Lines = std::vector<std::pair<std::string, std::string>>;
Lines timing_lines(const Timing& timing);
Json timing_json(const Timing& timing);

}  // namespace lamina::pipeline
