// pipeline/pores/bead_voxels.h: the deposited beads of a toolpath file as voxels of a window, for pore analysis.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>

#include "stages/bead/deposition.h"
#include "stages/data/mesh.h"  // Box
#include "stages/data/status.h"
#include "stages/data/voxels.h"
#include "stages/formats/gcode/read_gcode.h"

namespace lamina::pipeline {

struct BeadRules {
  std::optional<bead::DepositionRules> rules;  // none: beads are as wide as the file states
  std::string reported;                        // for people: where widths come from
  bool depends_on_acceleration = false;        // speeds change along lines, and the melt lags
  std::vector<Warning> warnings = {};          // whose widths they are, if nothing was measured on the printer
};

/// beads    "spread": by the bead model (docs/theory/bead.md); "deposited": the same, without spread along their lines;
/// "stated" by
///          the file; or "": spread where the printer is known
/// machine  its acceleration counts where the file commands none;
///          as --machine takes it; "": the one that the file names, if a profile of that name is shipped
/// errors   kUsage: an unknown printer or word; "deposited" or "spread" without a printer
Result<BeadRules> bead_rules(const formats::GcodeFile& file, const std::string& beads, const std::string& machine);

/// A box of a print, cut into voxels.
struct Window {
  Box box;                               // nm: on the bed, z of the nozzle
  std::array<std::uint32_t, 3> count{};  // voxels along x, y, z; they need not be cubes
  std::array<bool, 3> periodic{};

  std::uint64_t voxels() const { return std::uint64_t{count[0]} * count[1] * count[2]; }
};

/// Layers that beads of a file fill, one upon the other.
struct Pile {
  struct PileLayer {
    std::uint32_t index;     // in the file
    std::int64_t low, high;  // nm
  };
  std::vector<PileLayer> layers;
  std::uint32_t skipped = 0;  // layers with beads that do not lie above those before
};
/// cost  reads the file once; 24 bytes a layer
Result<Pile> pile_of(const formats::GcodeFile& file);

/// Cuts the voxels whose centres lie in a bead.
/// rules   by which beads come to lie as what is fed makes them (stages/bead/deposition.h); heights are those of
/// the pile.
///         None: a bead is a stadium, as high as its layer and as wide as the file states, with round ends; one narrower
///         than its layer is high is round, in the middle of its layer; beads keep their widths where they overlap
/// left_out  by rules, the share of material around the window that has no room next to its neighbours, and is left out
/// errors  kUsage: a layer cannot be read; kInput: 2^32 runs and more
/// cost    O(runs) and reading the window's layers; 8 bytes a run. By rules, 150 bytes for each 20 um of line about the window.
/// y of the voxels rises as that of the bed does
Result<VoxelStack> bead_voxels(const formats::GcodeFile& file, const Pile& pile, const Window& window,
                               const bead::DepositionRules* rules = nullptr, double* left_out = nullptr);

/// What of a plan repeats, around a place where it does.
struct Repeat {
  std::array<std::int64_t, 2> length{};  // nm along x and y; 0: not found
  std::uint32_t layers = 0;              // after so many a layer is as it was; 0: not found
};
/// Analyses a square of 9 mm, or the smaller part, in the middle layer and up to eight layers above it.
/// errors  of bead_voxels
Result<Repeat> find_repeat(const formats::GcodeFile& file, const Pile& pile, Point2 middle, std::size_t layer);

}  // namespace lamina::pipeline
