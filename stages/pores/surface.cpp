#include "stages/pores/surface.h"

#include <tbb/parallel_for.h>

#include <cmath>
#include <cstdint>
#include <optional>
#include <vector>

#include "stages/pores/rows.h"

namespace lamina::pores {
namespace {

/// Columns x of a such that x + step is in b. cost  O(runs)
std::uint64_t met(Row a, Row b, std::int64_t step) {
  std::uint64_t sum = 0;
  for (std::size_t i = 0, j = 0; i < a.size() && j < b.size();) {
    const std::int64_t begin = std::max<std::int64_t>(a[i] + step, b[j]);
    const std::int64_t a_end = a[i + 1] + step, b_end = b[j + 1];
    if (begin < std::min(a_end, b_end)) sum += static_cast<std::uint64_t>(std::min(a_end, b_end) - begin);
    (a_end <= b_end ? i : j) += 2;
  }
  return sum;
}

std::optional<std::uint32_t> moved(std::uint32_t at, int step, std::uint32_t count, bool periodic) {
  const std::int64_t to = std::int64_t{at} + step;
  if (to >= 0 && to < count) return static_cast<std::uint32_t>(to);
  if (!periodic) return std::nullopt;
  return to < 0 ? count - 1 : 0;
}

struct Crossings {
  std::uint64_t pairs = 0, different = 0;  // neighbours in a direction
};

struct Boxes {
  VoxelView empty, solid;  // of the body
  std::optional<VoxelView> body;
};

/// Of the slice's voxels and their neighbours in a direction.
Crossings crossings(const Boxes& boxes, std::uint32_t z, const std::array<int, 3>& direction) {
  Crossings sum;
  const VoxelView& box = boxes.solid;
  const auto to_z = moved(z, direction[2], box.nz, box.periodic[2]);
  if (!to_z) return sum;
  const std::int64_t step = direction[0], nx = box.nx;
  const std::array<std::uint32_t, 2> all{0, box.nx};
  for (std::uint32_t y = 0; y < box.ny; ++y) {
    const auto to_y = moved(y, direction[1], box.ny, box.periodic[1]);
    if (!to_y) continue;
    const auto count = [&](Row a, Row b) {
      std::uint64_t pairs = met(a, b, step);
      if (box.periodic[0] && step != 0) pairs += met(a, b, step > 0 ? step - nx : step + nx);
      return pairs;
    };
    const Row from_body = boxes.body ? boxes.body->row(y, z) : Row(all);
    const Row to_body = boxes.body ? boxes.body->row(*to_y, *to_z) : Row(all);
    sum.pairs += count(from_body, to_body);
    sum.different += count(boxes.empty.row(y, z), boxes.solid.row(*to_y, *to_z));
    sum.different += count(boxes.solid.row(y, z), boxes.empty.row(*to_y, *to_z));
  }
  return sum;
}

}  // namespace

std::array<double, 13> shares_of_directions(const std::array<Nm, 3>& edge) {
  std::array<double, 13> share{};
  if (edge[0] == edge[1] && edge[1] == edge[2]) {
    for (std::size_t d = 0; d < 13; ++d) {
      share[d] = d < 3 ? 2 * 0.04577789120476 : d < 9 ? 2 * 0.03698062787608 : 2 * 0.03519563978232;
    }
    return share;
  }
  std::array<std::array<double, 3>, 13> unit{};
  for (std::size_t d = 0; d < 13; ++d) {
    double squared = 0;
    for (std::size_t i = 0; i < 3; ++i) {
      unit[d][i] = kDirections[d][i] * static_cast<double>(edge[i]);
      squared += unit[d][i] * unit[d][i];
    }
    for (double& part : unit[d]) part /= std::sqrt(squared);
  }
  // Points of a grid on three faces of a cube; each stands for its share of the sphere.
  constexpr int kSteps = 400;
  double sum = 0;
  for (std::size_t face = 0; face < 3; ++face) {
    for (int i = 0; i < kSteps * kSteps; ++i) {
      std::array<double, 3> p{};
      p[face] = 1;
      p[(face + 1) % 3] = (2 * (i % kSteps) + 1.0) / kSteps - 1;
      p[(face + 2) % 3] = (2 * (i / kSteps) + 1.0) / kSteps - 1;
      std::size_t nearest = 0;
      double maximum = -1;
      for (std::size_t d = 0; d < 13; ++d) {
        const double along = std::abs(p[0] * unit[d][0] + p[1] * unit[d][1] + p[2] * unit[d][2]);
        if (along > maximum) maximum = along, nearest = d;
      }
      const double squared = p[0] * p[0] + p[1] * p[1] + p[2] * p[2], solid_angle = 1 / (squared * std::sqrt(squared));
      share[nearest] += solid_angle;
      sum += solid_angle;
    }
  }
  for (double& one : share) one /= sum;
  return share;
}

Surface specific_surface(const VoxelView& solid, const VoxelView* body) {
  const VoxelStack empty = void_of(solid, body);
  const VoxelStack wall = body == nullptr ? VoxelStack() : both_of(solid, *body);
  Boxes boxes{empty.view(), body == nullptr ? solid : wall.view(), std::nullopt};
  if (body != nullptr) boxes.body = *body;
  std::vector<std::array<Crossings, 13>> by_slice(solid.nz);
  tbb::parallel_for(std::uint32_t{0}, solid.nz, [&](std::uint32_t z) {
    for (std::size_t d = 0; d < 13; ++d) by_slice[z][d] = crossings(boxes, z, kDirections[d]);
  });
  Surface surface{};
  const std::array<double, 13> share = shares_of_directions(solid.edge);
  double shares = 0;
  for (std::size_t d = 0; d < 13; ++d) {
    Crossings sum;
    for (const auto& slice : by_slice) sum.pairs += slice[d].pairs, sum.different += slice[d].different;
    if (sum.pairs == 0) continue;
    double squared = 0;
    for (std::size_t i = 0; i < 3; ++i) squared += std::abs(kDirections[d][i]) * mm(solid.edge[i]) * mm(solid.edge[i]);
    const double in_a_mm = static_cast<double>(sum.different) / (static_cast<double>(sum.pairs) * std::sqrt(squared));
    shares += share[d];
    surface.crofton += 2 * share[d] * in_a_mm;
    if (d < 3) surface.faces += in_a_mm;
  }
  // A box of one slice has no pairs along z: the directions that are left stand for all.
  if (shares > 0) surface.crofton /= shares;
  return surface;
}

}  // namespace lamina::pores
