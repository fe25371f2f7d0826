#include "tests/dose/rebuilt.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <map>
#include <numbers>
#include <utility>

#include "stages/coverage/coverage.h"
#include "stages/data/layer.h"
#include "stages/data/levels.h"
#include "stages/data/runs.h"
#include "stages/dose/layer_drops.h"
#include "stages/dose/saturation.h"
#include "stages/raster/raster.h"
#include "tests/raster/shapes.h"

namespace lamina::test {
namespace {

constexpr double kReachMm = 0.4, kStepMm = 0.002;

Point3 nm_point(double x, double y, double z) {
  const auto nm = [](double mm) { return static_cast<Nm>(std::llround(mm * 1e6)); };
  return {nm(x), nm(y), nm(z)};
}

/// Points of the unit square that fill it evenly (a rank-1 lattice of the golden ratio).
std::pair<double, double> spread(std::uint32_t i, std::uint32_t count) {
  return {(i + 0.5) / count, std::fmod((i + 1) * std::numbers::phi, 1.0)};
}

}  // namespace

DropStack::DropStack(const std::vector<Triangle>& part, const DropWay& way, double bed_mm, double height_mm) {
  const std::int64_t bed = std::llround(bed_mm * 1e6), high = std::llround(height_mm * 1e6);
  const PixelGrid grid{PixelAxis(way.dpi, bed), PixelAxis(way.dpi, bed)};
  count_ = {grid.columns(), grid.rows(), (high + way.thickness - 1) / way.thickness};
  pitch_mm_ = {25.4 / static_cast<double>(way.dpi), 25.4 / static_cast<double>(way.dpi), 1e-6 * way.thickness};
  share_.assign(static_cast<std::size_t>(count_[0] * count_[1] * count_[2]), 0);
  Mesh mesh = make_mesh(part), other = mesh;
  const Instance instance{0, {0, 0, 0}};
  const auto rasterizer =
      raster::Rasterizer::build({&mesh, 1}, {&instance, 1}, grid, FillRule::kNonzero, false, true, Isa::kPlain);
  const auto coverage =
      coverage::Coverage::build({&other, 1}, {&instance, 1}, grid, FillRule::kNonzero, std::max(2u, way.levels));
  if (!rasterizer.ok() || !coverage.ok()) std::abort();
  raster::LayerScratch of_pixels;
  coverage::CoverageScratch of_voxels;
  Runs image, second;
  dose::DropWork work;
  Levels drops;
  const std::uint32_t full = way.levels > 0 && !way.dithered ? way.levels - 1 : 1;  // drops of a full voxel
  dose::LayerDose dose = dose::one_drop();
  dose.shell = dose.core = dose.requested_shell = dose.requested_inside = full * dose::kOneDrop;
  for (std::uint32_t l = 0; l < count_[2]; ++l) {
    const Layer layer{l, static_cast<Nm>(l) * way.thickness, way.thickness};
    rasterizer->layer(raster::Engine::kContours, layer.plane(), of_pixels, image);
    if (way.levels > 0) coverage->layer(layer, of_voxels, work.shares);
    const auto top = static_cast<std::uint8_t>(way.levels > 0 ? way.levels - 1 : 0);
    dose::drops_of_layer({top, way.dithered, {}, full, false}, dose, l, image, second, work);
    levels_of(work.drops[0], drops);
    for (std::uint32_t r = 0; r < grid.rows(); ++r) {
      float* row = share_.data() + (std::size_t{l} * grid.rows() + (grid.rows() - 1 - r)) * grid.columns();
      for (std::uint32_t i = drops.row_offset[r]; i < drops.row_offset[r + 1]; ++i) {
        std::fill(row + drops.change[2 * i], row + drops.change[2 * i + 1],
                  static_cast<float>(drops.level[i]) / static_cast<float>(full));
      }
    }
  }
}

float DropStack::share(std::int64_t column, std::int64_t row, std::int64_t layer) const {
  if (column < 0 || row < 0 || layer < 0 || column >= count_[0] || row >= count_[1] || layer >= count_[2]) return 0;
  return share_[static_cast<std::size_t>((layer * count_[1] + row) * count_[0] + column)];
}

bool DropStack::filled(const Position& at) const {
  std::array<std::int64_t, 3> voxel{};
  std::array<double, 3> within{};
  for (std::size_t a = 0; a < 3; ++a) {
    const double position = at[a] / pitch_mm_[a];
    voxel[a] = static_cast<std::int64_t>(std::floor(position));
    within[a] = position - std::floor(position);
  }
  const auto [i, j, k] = voxel;
  const float own = share(i, j, k);
  if (own <= 0 || own >= 1) return own >= 1;
  const float around[6] = {share(i, j, k - 1), share(i, j, k + 1), share(i - 1, j, k),
                           share(i + 1, j, k), share(i, j - 1, k), share(i, j + 1, k)};
  constexpr std::size_t kAxis[6] = {2, 2, 0, 0, 1, 1};
  const auto fullest = static_cast<std::size_t>(std::ranges::max_element(around) - around);
  const double depth = fullest % 2 == 0 ? within[kAxis[fullest]] : 1 - within[kAxis[fullest]];
  return depth < own;
}

double DropStack::blurred(const Position& at) const {
  // The weights of each axis: drops lie in the middles of voxels; sigma is 1 or 1/3 of them.
  constexpr std::int64_t kMax = 5;
  constexpr double kSigma[3] = {1, 1, 1.0 / 3};
  std::array<std::int64_t, 3> first{};
  double weight[3][2 * kMax + 1] = {};
  for (std::size_t a = 0; a < 3; ++a) {
    const double position = at[a] / pitch_mm_[a] - 0.5;
    const std::int64_t reach = a < 2 ? kMax : 2;
    first[a] = std::llround(position) - reach;
    for (std::int64_t n = 0; n <= 2 * reach; ++n) {
      const double far = (static_cast<double>(first[a] + n) - position) / kSigma[a];
      weight[a][n] = std::exp(-0.5 * far * far) / (kSigma[a] * std::sqrt(2 * std::numbers::pi));
    }
  }
  double sum = 0;
  for (std::int64_t k = 0; k <= 4; ++k) {
    for (std::int64_t j = 0; j <= 2 * kMax; ++j) {
      double row = 0;
      for (std::int64_t i = 0; i <= 2 * kMax; ++i) row += weight[0][i] * share(first[0] + i, first[1] + j, first[2] + k);
      sum += row * weight[1][j] * weight[2][k];
    }
  }
  return sum;
}

namespace {

template <class Solid>
SurfaceDistance distance(const std::vector<SurfacePoint>& points, Solid&& solid) {
  SurfaceDistance found;
  double sum = 0;
  for (const SurfacePoint& point : points) {
    const auto is_solid = [&](double by) {
      return solid(
          Position{point.at[0] + by * point.normal[0], point.at[1] + by * point.normal[1], point.at[2] + by * point.normal[2]});
    };
    const bool here = is_solid(0);
    bool outwards = here, inwards = here, lost = true;
    for (double by = kStepMm; by < kReachMm; by += kStepMm) {
      const bool out = is_solid(by), in = is_solid(-by);
      // From solid to empty, along the outward direction.
      if ((outwards && !out) || (!inwards && in)) {
        sum += (by - kStepMm / 2) * (by - kStepMm / 2);
        lost = false;
        break;
      }
      outwards = out;
      inwards = in;
    }
    found.lost += lost ? 1 : 0;
  }
  found.rms_mm = std::sqrt(sum / static_cast<double>(std::max<std::size_t>(1, points.size() - found.lost)));
  return found;
}

}  // namespace

SurfaceDistance distance_of_filled(const DropStack& stack, const std::vector<SurfacePoint>& points) {
  return distance(points, [&](const Position& at) { return stack.filled(at); });
}
SurfaceDistance distance_of_blurred(const DropStack& stack, const std::vector<SurfacePoint>& points) {
  return distance(points, [&](const Position& at) { return stack.blurred(at) >= 0.5; });
}

RebuiltShape rebuilt_sphere(std::uint32_t points) {
  constexpr double kRadius = 2.5, kMiddle = 3.017, kHigh = 2.613;
  constexpr int kRings = 90, kSides = 180;  // facets within a micrometre of the ball
  RebuiltShape shape{"sphere of 5 mm", 6.1, kHigh + kRadius + 0.5, {}, {}};
  const auto corner = [&](int ring, int side) {
    const double polar = std::numbers::pi * ring / kRings, turn = 2 * std::numbers::pi * (side % kSides) / kSides;
    return nm_point(kMiddle + kRadius * std::sin(polar) * std::cos(turn), kMiddle + kRadius * std::sin(polar) * std::sin(turn),
                    kHigh - kRadius * std::cos(polar));
  };
  for (int ring = 0; ring < kRings; ++ring) {
    for (int side = 0; side < kSides; ++side) {
      const Point3 a = corner(ring, side), b = corner(ring, side + 1), c = corner(ring + 1, side + 1),
                   d = corner(ring + 1, side);
      if (ring > 0) shape.part.push_back({a, c, b});
      if (ring + 1 < kRings) shape.part.push_back({a, d, c});
    }
  }
  for (std::uint32_t i = 0; i < points; ++i) {
    const auto [u, v] = spread(i, points);
    const double z = 2 * u - 1, turn = 2 * std::numbers::pi * v, flat = std::sqrt(1 - z * z);
    const Position normal{flat * std::cos(turn), flat * std::sin(turn), z};
    shape.points.push_back(
        {{kMiddle + kRadius * normal[0], kMiddle + kRadius * normal[1], kHigh + kRadius * normal[2]}, normal});
  }
  return shape;
}

RebuiltShape rebuilt_wedge(const char* name, double degrees, std::uint32_t points) {
  constexpr double kLow = 0.45, kRise = 1.8, kLeft = 0.513, kFront = 0.531, kDeep = 2.1;
  const double slope = std::tan(degrees * std::numbers::pi / 180), run = kRise / slope;
  RebuiltShape shape{name, std::max(run, kDeep) + 1.3, kLow + kRise + 0.5, {}, {}};
  const double x0 = kLeft, x1 = kLeft + run, y0 = kFront, y1 = kFront + kDeep, top = kLow + kRise;
  const Point3 a = nm_point(x0, y0, 0), b = nm_point(x1, y0, 0), c = nm_point(x1, y0, top), d = nm_point(x0, y0, kLow);
  const Point3 e = nm_point(x0, y1, 0), f = nm_point(x1, y1, 0), g = nm_point(x1, y1, top), h = nm_point(x0, y1, kLow);
  shape.part = {{a, b, c}, {a, c, d}, {e, g, f}, {e, h, g}, {a, e, f}, {a, f, b},
                {b, f, g}, {b, g, c}, {c, g, h}, {c, h, d}, {d, h, e}, {d, e, a}};
  const double length = std::hypot(1, slope);
  for (std::uint32_t i = 0; i < points; ++i) {
    const auto [u, v] = spread(i, points);
    const double x = x0 + run * (0.15 + 0.7 * u), y = kFront + kDeep * (0.3 + 0.4 * v);
    shape.points.push_back({{x, y, kLow + (x - x0) * slope}, {-slope / length, 0, 1 / length}});
  }
  return shape;
}

}  // namespace lamina::test
