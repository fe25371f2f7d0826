// pipeline/report/machine_text.h: what follows from the profile of a powder printer, as text.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "stages/data/machine.h"
#include "stages/data/program.h"

namespace lamina::program {

/// What several drops a pixel take of a head that fires them in one sweep.
struct DropSweeps {
  std::uint32_t max_drops = 1;  // that a pixel of the job can get
  std::uint64_t added = 0;      // sweeps that are there for the frequency (Sweep::added), and their time
  double added_seconds = 0;
};
/// How many sweeps the drops of a pixel take, and what the head's frequency adds to them.
std::string sweeps_text(const Machine& machine, const HeadGrid& grid, const DropSweeps& sweeps);

/// A layer that sets every pixel of the bed, by the program that the machine gets for it.
struct FullLayer {
  double thickness_mm = 0;
  std::uint32_t sweeps = 0;        // second passes for blocked nozzles included
  double seconds = 0;              // of the layer; care that is not due in each one is averaged
  double empty_seconds = 0;        // of a layer without a pixel: powder, pauses, care; averaged likewise
  double drops_seconds = 0;        // of all drops that the head has on every pixel; 0: it has one
  double maintenance_seconds = 0;  // of `seconds`: what they are more than without care of the head
  double spat_drops = 0;           // off the bed, averaged likewise
};

/// What follows from a profile, one fact a line, for people.
/// full  absent: its time is not told
std::string explain(const Machine& machine, const HeadGrid& grid, const std::optional<FullLayer>& full);

}  // namespace lamina::program
