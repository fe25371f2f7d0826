#include "stages/stokes/canonical.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <iterator>
#include <span>
#include <tuple>
#include <utility>

namespace lamina::stokes {
namespace {

template <class Value>
std::array<Value, 3> ordered(const std::array<Value, 3>& of_box, const Turn& turn) {
  return {of_box[turn.from[0]], of_box[turn.from[1]], of_box[turn.from[2]]};
}

std::uint32_t mirrored(std::uint32_t i, std::uint32_t size, bool backwards) { return backwards ? size - 1 - i : i; }

std::vector<Turn> turns_of(std::size_t axis, bool reversible) {
  std::vector<Turn> turns;
  const std::size_t a = axis == 0 ? 1 : 0, b = axis == 2 ? 1 : 2;
  for (const auto& from : {std::array{a, b, axis}, std::array{b, a, axis}})
    for (unsigned mirrors = 0; mirrors < (reversible ? 8u : 4u); ++mirrors)
      turns.push_back({from, {(mirrors & 1) != 0, (mirrors & 2) != 0, (mirrors & 4) != 0}});
  return turns;
}

/// Digits that look random (S. Vigna's splitmix64, 2015).
std::uint64_t mixed(std::uint64_t x) {
  x += 0x9e3779b97f4a7c15;
  x = (x ^ x >> 30) * 0xbf58476d1ce4e5b9;
  x = (x ^ x >> 27) * 0x94d049bb133111eb;
  return x ^ x >> 31;
}

/// A number for each place along an axis of the turned box, and sums of those before it.
struct Weights {
  std::vector<std::uint64_t> of, before{0};
  Weights(std::size_t axis, std::uint32_t size) {
    for (std::uint32_t i = 0; i < size; ++i) {
      of.push_back(mixed(std::uint64_t{axis} << 32 | i));
      before.push_back(before.back() + of.back());
    }
  }
};

/// The sum over solid voxels of the product of their weights along the turned axes, modulo 2^64: a multilinear hash. Boxes that
/// differ have the same with a chance of about 2^-60.
std::uint64_t fingerprint(const VoxelView& box, const Turn& turn) {
  const std::array<std::uint32_t, 3> size = box.size();
  std::vector<Weights> along;  // axes of the box
  std::array<bool, 3> back{};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const auto c = static_cast<std::size_t>(std::find(turn.from.begin(), turn.from.end(), axis) - turn.from.begin());
    along.emplace_back(c, size[axis]);
    back[axis] = turn.backwards[c];
  }
  const std::vector<std::uint64_t>& before = along[0].before;
  std::uint64_t sum = 0;
  for (std::uint32_t z = 0; z < box.nz; ++z) {
    const std::uint64_t of_z = along[2].of[mirrored(z, box.nz, back[2])];
    for (std::uint32_t y = 0; y < box.ny; ++y) {
      std::uint64_t row = 0;
      const auto changes = box.row(y, z);
      for (std::size_t i = 0; i < changes.size(); i += 2)
        row += back[0] ? before[box.nx - changes[i]] - before[box.nx - changes[i + 1]]
                       : before[changes[i + 1]] - before[changes[i]];
      sum += row * along[1].of[mirrored(y, box.ny, back[1])] * of_z;
    }
  }
  return sum;
}

/// Calls change(row, place) for all changes along the rows of the turned box; those of a row in order, and by one thread.
template <class Change>
void for_each_change(const VoxelView& box, const Turn& turn, const Change& change) {
  const std::array<std::uint32_t, 3> size = box.size(), to = ordered(size, turn);
  const auto row_of = [&](const CellIndex& at) {  // at  in the box; its place along the rows does not matter
    const std::size_t y = mirrored(at[turn.from[1]], to[1], turn.backwards[1]);
    return y + std::size_t{to[1]} * mirrored(at[turn.from[2]], to[2], turn.backwards[2]);
  };
  const std::size_t along = turn.from[0];
  if (along == 0) {
    tbb::parallel_for(std::uint32_t{0}, box.nz, [&](std::uint32_t z) {
      for (std::uint32_t y = 0; y < box.ny; ++y) {
        const auto row = box.row(y, z);
        for (std::size_t i = 0; i < row.size(); ++i)
          change(row_of({0, y, z}), turn.backwards[0] ? box.nx - row[row.size() - 1 - i] : row[i]);
      }
    });
    return;
  }
  // Where a row of the box is not as the one before it, those across change.
  tbb::parallel_for(std::uint32_t{0}, size[3 - along], [&](std::uint32_t fixed) {
    std::span<const std::uint32_t> last, next;
    std::vector<std::uint32_t> unlike;
    for (std::uint32_t i = 0; i <= to[0]; ++i, last = next) {
      CellIndex at{};
      at[3 - along] = fixed;
      at[along] = i < to[0] ? mirrored(i, to[0], turn.backwards[0]) : 0;
      next = i < to[0] ? box.row(at[1], at[2]) : std::span<const std::uint32_t>();
      unlike.clear();
      std::set_symmetric_difference(last.begin(), last.end(), next.begin(), next.end(), std::back_inserter(unlike));
      for (std::size_t k = 0; k < unlike.size(); k += 2)
        for (at[0] = unlike[k]; at[0] < unlike[k + 1]; ++at[0]) change(row_of(at), i);
    }
  });
}

Result<VoxelStack> turned(const VoxelView& box, const Turn& turn) {
  const std::array<std::uint32_t, 3> size = ordered(box.size(), turn);
  VoxelStack result(size[0], size[1], ordered(box.edge, turn), ordered(box.periodic, turn));
  result.nz = size[2];
  Buffer<std::uint32_t> next(std::size_t{size[1]} * size[2] + 1);
  std::fill(next.begin(), next.end(), 0);
  for_each_change(box, turn, [&](std::size_t row, std::uint32_t) { ++next[row]; });
  std::uint64_t changes = 0;
  for (std::uint32_t& begin : next) changes += std::exchange(begin, static_cast<std::uint32_t>(changes));
  if (changes > UINT32_MAX) return Error{Fault::kInput, "more walls than 2^32; take a smaller window or larger voxels"};
  result.row_offset = next;
  result.change.resize(changes);
  for_each_change(box, turn, [&](std::size_t row, std::uint32_t position) { result.change[next[row]++] = position; });
  return result;
}

}  // namespace

CellIndex Turn::in_turned(const CellIndex& in_box, const CellIndex& size) const {
  CellIndex at{};
  for (std::size_t c = 0; c < 3; ++c) at[c] = mirrored(in_box[from[c]], size[c], backwards[c]);
  return at;
}

CellIndex Turn::in_box(const CellIndex& in_turned, const CellIndex& size) const {
  CellIndex at{};
  for (std::size_t c = 0; c < 3; ++c) at[from[c]] = mirrored(in_turned[c], size[c], backwards[c]);
  return at;
}

Result<Canonical> Canonical::of(const VoxelView& box, int axis, bool reversible) {
  const std::vector<Turn> turns = turns_of(static_cast<std::size_t>(axis), reversible);
  const auto key = [&](const Turn& turn) {
    return std::tuple(ordered(box.size(), turn), ordered(box.edge, turn), ordered(box.periodic, turn));
  };
  std::vector<std::uint64_t> prints(turns.size());
  tbb::parallel_for(std::size_t{0}, turns.size(), [&](std::size_t i) { prints[i] = fingerprint(box, turns[i]); });
  const auto rank = [&](std::size_t i) { return std::tuple(key(turns[i]), prints[i]); };
  std::size_t minimum = 0;
  for (std::size_t i = 1; i < turns.size(); ++i)
    if (rank(i) < rank(minimum)) minimum = i;
  Canonical result;
  result.box_ = box;
  for (std::size_t i = minimum; i < turns.size(); ++i)
    if (rank(i) == rank(minimum)) result.turns_.push_back(turns[i]);
  result.turned_ = result.turn() != Turn();
  if (!result.turned_) return result;
  Result<VoxelStack> stack = turned(box, result.turn());
  if (!stack) return stack.error();
  result.stack_ = std::move(*stack);
  return result;
}

std::array<double, 3> Canonical::in_box(const std::array<double, 3>& velocity) const {
  std::array<std::array<int, 3>, 3> count{};  // whole numbers, so that the order of turns does not matter
  for (const Turn& turn : turns_)
    for (std::size_t c = 0; c < 3; ++c) count[turn.from[c]][c] += turn.backwards[c] != turn.backwards[kAxis] ? -1 : 1;
  std::array<double, 3> mean{};
  for (std::size_t b = 0; b < 3; ++b) {
    for (std::size_t c = 0; c < 3; ++c) mean[b] += count[b][c] * velocity[c];
    mean[b] /= static_cast<double>(turns_.size());
  }
  return mean;
}

}  // namespace lamina::stokes
