// stages/view/drawable_layers.h: layers of a job to draw: which of them, and the areas of their beads as shapes.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "stages/data/layer_shapes.h"
#include "stages/data/status.h"
#include "stages/data/toolpaths.h"

namespace lamina::view {

inline constexpr std::uint32_t kMaxCells = 400;  // of a picture

/// One layer, every n-th layer, or a number of layers over the height (default 12); at most one is set.
struct LayerChoice {
  std::optional<std::uint32_t> layer, every, count;
};

/// Indices into the list of a job's layer numbers, which must not be empty.
/// errors  kUsage: several choices, no such layer, too many for a picture
/// cost    O(layers)
Result<std::vector<std::size_t>> chosen_layers(const LayerChoice& choice, const std::vector<std::uint32_t>& layers);

/// The ink for one of several widths of a kind: pale for the narrowest, step 0, and full for the widest.
Ink shade(const Ink& ink, std::size_t step, std::size_t steps);

/// Drawable layers, read one at a time.
struct LayerSeries {
  std::string name;                   // of the part or file
  std::uint32_t first = 0, last = 0;  // available layers: [first, last)
  std::uint32_t count = 0;            // of the whole job
  std::function<Result<LayerShapes>(std::uint32_t)> layer;
  std::vector<std::string> notes = {};  // for a person, one line each
};

/// Adds the areas of planned beads to `shapes`, one per kind. errors  kInternal if Clipper refuses them
Status add_paths(const ToolpathsView& paths, LayerShapes& shapes);

/// Adds the areas of a file's beads by type, in order of first occurrence. Beads of different widths within a type have
/// different shades, four at most; widths within 0.03 mm or 5 % are one.
/// types   names of the bead types as written by any slicer; they decide the ink; "" if unknown
/// errors  kInternal if Clipper refuses them
/// cost    O(beads * types) and the union of the beads
Status add_beads(std::span<const DepositedBead> beads, std::span<const std::string> types, LayerShapes& shapes);

/// Total length of all beads, mm.
double length_mm(std::span<const DepositedBead> beads);

}  // namespace lamina::view
