// tests/infill/outlines.h: what is filled in tests: made outlines, and layers of real parts.
#pragma once

#include <array>
#include <initializer_list>
#include <string>
#include <vector>

#include "stages/data/contours.h"
#include "stages/data/toolpaths.h"
#include "stages/infill/fill.h"

namespace lamina::test {

inline constexpr Nm kMm = 1'000'000;

struct Outline {
  std::string name;
  Contours contours;
};

/// From corners in mm.
Contours contours_of(std::initializer_list<std::vector<std::array<double, 2>>> all);

/// A square of 20 mm at the origin, needles, slivers, touching holes, islands in holes, a comb, and layers of parts.
const std::vector<Outline>& outlines();
/// By name.
const Contours& outline(const std::string& name);

/// The contours' box, 20 mm high, and layer `index` of 0.2 mm.
infill::FillContext context_of(const ContoursView& contours, std::uint32_t index = 0);

/// Appends the fill of contours. errors  of infill::outlines_of
Status fill(const ContoursView& contours, const infill::FillContext& context, const infill::FillParameters& parameters,
            Toolpaths& out);
Toolpaths filled(const ContoursView& contours, const infill::FillContext& context, const infill::FillParameters& parameters);

/// Whether a path ends where it begins.
inline bool is_closed(const ToolpathsView& paths, std::uint32_t p) {
  return paths[p].size() > 3 && paths[p].front() == paths[p].back();
}

struct Sums {
  double raster = 0, link = 0, closed = 0;  // nm
};
Sums sums_of(const Toolpaths& paths);

/// Places of the lines on the square at angle 0, nm from its side.
std::vector<Nm> positions_of(const infill::FillParameters& parameters, std::uint32_t layer = 0);
std::vector<Nm> distances_of(const std::vector<Nm>& positions);

}  // namespace lamina::test
