#include "stages/heights/evaluate.h"

#include <algorithm>

#include "stages/heights/section.h"
#include "stages/heights/steepest.h"

namespace lamina::heights {

std::vector<std::int64_t> boundaries_of(const LayerTable& table) {
  std::vector<std::int64_t> boundaries(table.size() + 1);
  for (std::uint32_t i = 0; i < table.size(); ++i) boundaries[i] = table[i].bottom;
  boundaries.back() = table.top();
  return boundaries;
}

Evaluation evaluate(const SurfaceIndex& index, std::span<const std::int64_t> boundaries, const Options& options) {
  Evaluation result;
  const std::size_t count = boundaries.size() - 1;
  const CandidateHeights candidate_heights = CandidateHeights::listed({boundaries.begin(), boundaries.end()});
  const Nm tolerance = options.surface.flat_tolerance;
  result.layers.resize(count);
  const bool nominal = index.has_nominal();
  Buffer<Steepness> of_steps(count, 0);
  for (std::uint32_t part = 0; part < index.parts.size(); ++part) {
    const auto own = std::span(index.parts).subspan(part, 1);
    const Buffer<Steepness> cells = steepest_in_cells(index, own, candidate_heights);
    const Buffer<Steepness> angles =
        nominal ? steepest_in_cells(index, own, candidate_heights, Slope::kAngles) : Buffer<Steepness>();
    for (std::size_t i = 0; i < count; ++i) {
      of_steps[i] = std::max(of_steps[i], cells[i]);
      const Steepness slope = nominal ? angles[i] : cells[i];
      if (slope <= result.layers[i].flattest) continue;
      result.layers[i].flattest = slope;
      result.layers[i].part = part;
    }
  }
  const Buffer<double> below = projected_below(index, index.parts, candidate_heights, Sign::kBoth);
  const bool timed = options.time.on() || options.estimates_time;
  const TimeModel& time = options.time.on() ? options.time : kPlainTime;
  const Buffer<double> section = timed ? section_at_candidates(index, candidate_heights, tolerance) : Buffer<double>();
  double steps = 0;
  for (std::uint32_t i = 0; i < count; ++i) {
    LayerFacts& layer = result.layers[i];
    const std::int64_t thickness = boundaries[i + 1] - boundaries[i];
    layer.cusp = cusp_of(thickness, of_steps[i]);
    if (layer.cusp > result.largest_cusp) {
      result.largest_cusp = layer.cusp;
      result.largest_cusp_layer = i;
    }
    result.above_limit += layer.cusp > options.cusp;
    steps += static_cast<double>(thickness) * (below[i + 1] - below[i]);
    if (timed) result.seconds += seconds_of_layer(time, section[i]);
  }
  if (index.area_mm2 > 0) result.mean_cusp = steps / index.area_mm2;

  for (const Flat& flat : find_flats(index, tolerance, options.min_flat_mm2)) {
    const std::int64_t miss = distance_to_nearest(boundaries, flat.height);
    result.flats.push_back({flat, miss});
    if (miss > tolerance) {
      ++result.flats_missed;
      result.largest_miss = std::max(result.largest_miss, miss);
    } else {
      const auto above = std::ranges::lower_bound(boundaries, flat.height - tolerance);
      if (above != boundaries.begin()) result.layers[static_cast<std::size_t>(above - boundaries.begin()) - 1].hits_flat = true;
    }
  }
  result.top_miss = boundaries.back() - index.top;
  return result;
}

}  // namespace lamina::heights
