#include "stages/infill/parameters.h"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace lamina::infill {
namespace {

Nm short_nm(double millimetres) { return static_cast<Nm>(nm_of(millimetres)); }
MicroDegrees micro(double degrees) { return std::llround(degrees * 1e6); }

std::vector<Nm> list_nm(const std::vector<double>& list) {
  std::vector<Nm> nm;
  for (const double value : list) nm.push_back(short_nm(value));
  return nm;
}

}  // namespace

FillParameters parameters_of(const FillSettings& settings) {
  FillParameters p;
  p.pattern = settings.pattern;
  p.width = short_nm(settings.width_mm);
  p.wall_width = settings.wall_width_mm > 0 ? short_nm(settings.wall_width_mm) : p.width;
  p.walls = settings.walls;
  p.seam = settings.seam;
  p.loops = settings.loops;
  p.angle_base = micro(settings.angle_deg);
  p.angle_step = micro(settings.angle_step_deg);
  p.build_layers = settings.build_layers;
  p.gaps = list_nm(settings.gap_mm);
  p.group = settings.group;
  for (const auto& [z, gap] : settings.gap_by_height) p.gap_table.emplace_back(nm_of(z), short_nm(gap));
  p.gap_expression = settings.gap_formula;
  p.distances = list_nm(settings.distance_mm);
  p.stagger = list_nm(settings.stagger_mm);
  p.stagger_every_layer = settings.stagger_every_layer;
  if (settings.first_line_mm) p.first_line = short_nm(*settings.first_line_mm);
  if (settings.end_inset_mm) p.end_inset = short_nm(*settings.end_inset_mm);
  if (settings.link_mm) p.longest_link = nm_of(*settings.link_mm);
  p.shortest_line = short_nm(settings.shortest_mm);
  p.cell = short_nm(settings.cell_mm);
  if (settings.density_percent) p.density = *settings.density_percent / 100;
  p.top = short_nm(settings.top_mm);
  p.bottom = short_nm(settings.bottom_mm);
  p.top_layers = settings.top_layers;
  p.bottom_layers = settings.bottom_layers;
  return p;
}

MicroDegrees layer_angle(const FillParameters& parameters, std::uint32_t layer) {
  const std::int64_t blocks = layer / parameters.build_layers;
  const MicroDegrees step = ((parameters.angle_step % kTurn) + kTurn) % kTurn;
  const MicroDegrees base = ((parameters.angle_base % kTurn) + kTurn) % kTurn;
  return (base + blocks * step) % kTurn;
}

Nm layer_stagger(const FillParameters& parameters, std::uint32_t layer) {
  constexpr MicroDegrees kHalf = kTurn / 2;
  std::uint64_t turn = layer;
  if (!parameters.stagger_every_layer) {
    const MicroDegrees step = ((parameters.angle_step % kHalf) + kHalf) % kHalf;
    const auto period = static_cast<std::uint64_t>(step == 0 ? 1 : kHalf / std::gcd(step, kHalf));
    turn = layer / parameters.build_layers / period;
  }
  return parameters.stagger.empty() ? 0 : parameters.stagger[turn % parameters.stagger.size()];
}

std::optional<double> touching_distance(const FillParameters& fill) {
  const bool parallel =
      fill.pattern == Pattern::kRaster || fill.pattern == Pattern::kContour || fill.pattern == Pattern::kContourRaster;
  if (!parallel || fill.density || !fill.gap_table.empty() || !fill.gap_expression.empty()) return std::nullopt;
  const std::vector<Nm>& list = fill.distances.empty() ? fill.gaps : fill.distances;
  const Nm more = fill.distances.empty() ? fill.width : 0;
  if (list.empty() || std::ranges::max(list) + more > fill.width) return std::nullopt;
  double sum = 0;
  for (const Nm each : list) sum += each + more;
  if (fill.distances.empty() && fill.group > 1) {  // beads within a group are one width from each other
    sum += static_cast<double>(list.size() * (fill.group - 1)) * fill.width;
    return sum / static_cast<double>(list.size() * fill.group);
  }
  return sum / static_cast<double>(list.size());
}

double mean_distance_mm(const FillParameters& fill) {
  if (fill.pattern == Pattern::kHoneycomb || fill.pattern == Pattern::kQuatrefoil) return mm(fill.cell) / 2;
  double sum = 0;
  if (!fill.distances.empty()) {
    for (const Nm distance : fill.distances) sum += mm(distance);
    return std::max(sum / static_cast<double>(fill.distances.size()), mm(fill.width) / 4);
  }
  for (const Nm gap : fill.gaps) sum += mm(gap);
  const double mean = sum / static_cast<double>(std::max<std::size_t>(fill.gaps.size(), 1)) / fill.group;
  return std::max(mm(fill.width) + mean, mm(fill.width) / 4);
}

}  // namespace lamina::infill
