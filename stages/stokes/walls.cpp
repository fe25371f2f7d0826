#include "stages/stokes/walls.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <utility>

namespace lamina::stokes {
namespace {

constexpr double kNearest = 0.1;  // voxels: nearer walls count as that near

std::array<std::int64_t, 3> moved(std::array<std::int64_t, 3> at, int axis, int by) {
  at[static_cast<std::size_t>(axis)] += by;
  return at;
}

/// Sets bits begin .. end - 1 of a row.
void set_bits(std::uint64_t* row, std::uint32_t begin, std::uint32_t end) {
  while (begin < end) {
    const std::uint32_t bit = begin % 64, count = std::min(end - begin, 64 - bit);
    row[begin / 64] |= (count == 64 ? ~std::uint64_t{0} : (std::uint64_t{1} << count) - 1) << bit;
    begin += count;
  }
}

}  // namespace

Walls::Walls(const VoxelView& fine, std::uint32_t factor)
    : size_{fine.nx / factor, fine.ny / factor, fine.nz / factor},
      fine_(fine.size()),
      periodic_(fine.periodic),
      factor_(factor),
      words_((fine.nx + 63) / 64),
      bits_(words_ * fine.rows()),
      open_(std::size_t{size_[0]} * size_[1] * size_[2]) {
  tbb::parallel_for(std::uint32_t{0}, fine.nz, [&](std::uint32_t z) {
    for (std::uint32_t y = 0; y < fine.ny; ++y) {
      std::uint64_t* row = bits_.data() + words_ * (y + std::size_t{fine.ny} * z);
      std::fill(row, row + words_, 0);
      const auto changes = fine.row(y, z);
      for (std::size_t i = 0; i < changes.size(); i += 2) set_bits(row, changes[i], changes[i + 1]);
    }
  });
  for_each_voxel([&](const CellIndex& at) {
    std::uint32_t mask = 0;
    for (int a = 0; a < 3; ++a) {
      const std::array<std::int64_t, 3> below = below_face(at, a);
      if (!solid(below) && !solid(moved(below, a, 1))) mask |= 1u << a;
    }
    open_[index(at)] = static_cast<std::uint8_t>(mask);
  });
  Buffer<std::uint8_t> tight(open_.size());
  for_each_voxel([&](const CellIndex& at) {
    tight[index(at)] = open_[index(at)];
    for (int a = 0; a < 3; ++a) {
      CellIndex below = at, above = at;
      const bool shut = open(at, a) && ((step(below, a, false) && film_within(at, a, below)) ||
                                        (step(above, a, true) && film_within(above, a, at)));
      if (shut) tight[index(at)] &= static_cast<std::uint8_t>(~(1u << a));
    }
  });
  open_ = std::move(tight);
}

template <class Visit>
void Walls::for_each_voxel(const Visit& visit) const {
  tbb::parallel_for(std::uint32_t{0}, size_[2], [&](std::uint32_t z) {
    for (std::uint32_t y = 0; y < size_[1]; ++y)
      for (std::uint32_t x = 0; x < size_[0]; ++x) visit(CellIndex{x, y, z});
  });
}

/// The fine voxel right below the middle of an upper face.
std::array<std::int64_t, 3> Walls::below_face(const CellIndex& at, int face) const {
  std::array<std::int64_t, 3> below{};
  for (std::size_t b = 0; b < 3; ++b)
    below[b] = std::int64_t{at[b]} * factor_ + (static_cast<int>(b) == face ? factor_ - 1 : factor_ / 2);
  return below;
}

/// Whether solid parts the open faces of a voxel along an axis. below  the voxel before it
bool Walls::film_within(const CellIndex& at, int axis, const CellIndex& below) const {
  return open(at, axis) && open(below, axis) && voids(below_face(at, axis), axis, false) < factor_;
}

bool Walls::passes(const CellIndex& at) const {
  if (open_[index(at)] != 0) return true;
  for (int a = 0; a < 3; ++a) {
    CellIndex below = at;
    if (step(below, a, false) && open(below, a)) return true;
  }
  return false;
}

/// What lies behind ends that do not repeat is solid.
bool Walls::solid(std::array<std::int64_t, 3> at) const {
  for (std::size_t a = 0; a < 3; ++a) {
    const std::int64_t n = fine_[a];
    if (at[a] >= 0 && at[a] < n) continue;
    if (!periodic_[a]) return true;
    at[a] = ((at[a] % n) + n) % n;
  }
  const std::uint64_t word =
      bits_[words_ * static_cast<std::size_t>(at[1] + std::int64_t{fine_[1]} * at[2]) + static_cast<std::size_t>(at[0] / 64)];
  return (word >> (at[0] % 64) & 1) != 0;
}

/// To the next voxel. false  there is none
bool Walls::step(CellIndex& at, int axis, bool up) const {
  const auto a = static_cast<std::size_t>(axis);
  const bool leaves = up ? at[a] + 1 == size_[a] : at[a] == 0;
  if (leaves && !periodic_[a]) return false;
  at[a] = leaves ? (up ? 0 : size_[a] - 1) : (up ? at[a] + 1 : at[a] - 1);
  return true;
}

/// Fine voxels without solid, that one included, of those that matter.
std::uint32_t Walls::voids(std::array<std::int64_t, 3> from, int along, bool up) const {
  std::uint32_t count = 0;
  while (count <= 3 * factor_ && !solid(from)) {
    ++count;
    from = moved(from, along, up ? 1 : -1);
  }
  return count;
}

/// From the middle of an open face to a wall, in voxels, at most 1. Along the face it is the mean of what the fine voxels on
/// its two sides see.
double Walls::distance(const CellIndex& at, int face, int along, bool up) const {
  const std::array<std::int64_t, 3> below = below_face(at, face), above = moved(below, face, 1);
  if (along == face) return std::min(1.0, static_cast<double>(voids(up ? above : below, along, up)) / factor_);
  const auto detected = [&](const std::array<std::int64_t, 3>& from) {
    return (static_cast<double>(voids(from, along, up)) - 0.5) / factor_;
  };
  return std::min(1.0, 0.5 * (detected(below) + detected(above)));
}

double Walls::hold(const CellIndex& at, int face, const std::array<double, 3>& weight) const {
  double sum = 0;
  for (int along = 0; along < 3; ++along) {
    for (const bool up : {false, true}) {
      CellIndex next = at;
      if (step(next, along, up) && open(next, face)) continue;
      sum += weight[static_cast<std::size_t>(along)] * (1 / std::max(kNearest, distance(at, face, along, up)) - 1);
    }
  }
  return sum;
}

}  // namespace lamina::stokes
