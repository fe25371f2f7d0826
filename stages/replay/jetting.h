// stages/replay/jetting.h: a layer while its print program jets it.
#pragma once

#include <cstdint>
#include <optional>
#include <string_view>
#include <vector>

#include "stages/data/grid.h"
#include "stages/data/picture/jetting.h"
#include "stages/data/runs.h"
#include "stages/data/status.h"
#include "stages/replay/machine.h"

namespace lamina::replay {

/// The step that is looked at; the middle one of those that fire where nothing is chosen.
struct StepChoice {
  std::uint32_t layer = 0;
  std::optional<std::uint32_t> swath, step;
};

/// A layer's program, carried out up to a step.
struct Jetting {
  std::uint32_t swath = 0, step = 0;  // what is looked at
  std::size_t place = 0, sweeps = 0;  // of this sweep among those that fire, from 1; of all those
  std::size_t fired = 0, drops = 0;   // drops by now; of the whole layer
  Runs printed;                       // pixels by now
  std::vector<SwathBand> bands;       // of the sweeps that fire, by their numbers
  std::vector<NozzlePlace> nozzles;   // at this step
  std::size_t firing = 0;             // of them
};

/// grid    of the layer's image
/// errors  kUsage: the program fires nothing, or not in that swath or at that step; of VirtualMachine::run
/// cost    O(text + drops log drops)
Result<Jetting> jet_until(const VirtualMachine& machine, std::string_view program, const StepChoice& choice,
                          const PixelGrid& grid);

}  // namespace lamina::replay
