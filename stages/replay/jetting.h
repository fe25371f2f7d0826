// stages/replay/jetting.h: a layer at a step of its print program.
#pragma once

#include <cstdint>
#include <optional>
#include <string_view>
#include <vector>

#include "stages/data/grid.h"
#include "stages/data/levels.h"
#include "stages/data/status.h"
#include "stages/replay/machine.h"

namespace lamina::replay {

/// The chosen step; default: the middle one of the steps that fire.
struct StepChoice {
  std::uint32_t layer = 0;
  std::optional<std::uint32_t> swath, step;
  std::uint32_t planes = 1;  // most drops of a pixel
};

/// The state of a layer's program after a step.
struct Jetting {
  std::uint32_t swath = 0, step = 0;     // the chosen step
  std::size_t position = 0, sweeps = 0;  // index of this sweep among those that fire, from 1; their number
  std::size_t fired = 0, drops = 0;      // drops so far; of the whole layer
  Levels printed;                        // drops so far of each pixel
  std::vector<SwathBand> bands;          // of the sweeps that fire, in order of their numbers
  std::vector<NozzlePosition> nozzles;   // at this step
  std::size_t firing = 0;                // number of nozzles that fire
};

/// grid    of the layer's image
/// errors  kUsage: the program does not fire at all, in that swath or at that step; of VirtualMachine::run
/// cost    O(text + drops log drops)
Result<Jetting> jet_until(const VirtualMachine& machine, std::string_view program, const StepChoice& choice,
                          const PixelGrid& grid);

}  // namespace lamina::replay
