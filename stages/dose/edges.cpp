#include "stages/dose/edges.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "stages/geometry/combine.h"
#include "stages/geometry/isa.h"
#include "stages/geometry/targets.h"

namespace lamina::dose {
namespace {

using Row = std::span<const std::uint32_t>;

/// What rows leave of a piece of a row, each of which has one run over it. wide  how much shorter each makes it at both ends
struct PieceEnds {
  std::int32_t begin, end;
};
struct EdgeRows {
  const std::int32_t *begin, *end, *wide;
  std::size_t count;
};
LAMINA_BODY PieceEnds shrink_body(const EdgeRows& rows, PieceEnds piece) {
  for (std::size_t k = 0; k < rows.count; ++k) {
    piece.begin = std::max(piece.begin, rows.begin[k] + rows.wide[k]);
    piece.end = std::min(piece.end, rows.end[k] - rows.wide[k]);
  }
  return piece;
}
PieceEnds shrink_plain(const EdgeRows& rows, PieceEnds piece) { return shrink_body(rows, piece); }
#if defined(LAMINA_WIDE_KERNELS)
LAMINA_AVX2 PieceEnds shrink_avx2(const EdgeRows& rows, PieceEnds piece) { return shrink_body(rows, piece); }
#endif
auto shrink_kernel() {
#if defined(LAMINA_WIDE_KERNELS)
  if (widest_isa() >= Isa::kAvx2) return shrink_avx2;
#endif
  return shrink_plain;
}

/// Erosion of blocks of rows. All rows of a block have rows around them in common: a piece that is left by the runs of these,
/// each made as much shorter as the farthest row of the block requires, is of one run of each. So for each row the ends of
/// these runs are enough. Halves of a block, down to single rows, add the rows that they have in common and the block has not.
class Eroder {
 public:
  Eroder(const RunsView& image, const Reach& reach, Runs& result)
      : image_(image), far_(static_cast<std::int64_t>(reach.half_width.size()) - 1), result_(result) {
    for (std::int64_t j = -far_; j <= far_; ++j)
      wide_.push_back(static_cast<std::int32_t>(reach.half_width[static_cast<std::size_t>(j < 0 ? -j : j)]));
    levels_.resize(8);
  }
  void erode() {
    const std::int64_t rows = image_.rows(), end = rows - far_;
    result_.columns = image_.columns;
    result_.row_offset.assign(1, 0);
    result_.change.clear();
    const std::int64_t block = std::clamp<std::int64_t>(far_, 1, 32);
    for (std::int64_t r = far_; r < end; r += block) {
      skip_to(r);
      const std::int64_t last = std::min(r + block, end);
      whole_.begin.assign(1, 0), whole_.end.assign(1, static_cast<std::int32_t>(image_.columns));
      erode_block(0, r, last, last - 1 - far_, r + far_);
    }
    skip_to(rows);
  }

 private:
  struct Pieces {
    std::vector<std::int32_t> begin, end;
    std::vector<std::uint32_t> parent;  // of the level above
    void clear() { begin.clear(), end.clear(), parent.clear(); }
  };
  struct Level {
    Pieces pieces, next;
    std::int64_t first = 0, count = 0;             // rows
    std::vector<std::int32_t> run_begin, run_end;  // of each piece, row by row
  };

  void skip_to(std::int64_t row) {
    while (static_cast<std::int64_t>(result_.row_offset.size()) <= row)
      result_.row_offset.push_back(static_cast<std::uint32_t>(result_.change.size()));
  }

  /// The rows [begin, end), of which the rows first .. last are to be applied yet that all of them have in common.
  void erode_block(std::size_t depth, std::int64_t begin, std::int64_t end, std::int64_t first, std::int64_t last) {
    Level& level = levels_[depth];
    const Pieces& above = depth == 0 ? whole_ : levels_[depth - 1].pieces;
    level.pieces.begin = above.begin, level.pieces.end = above.end;
    level.pieces.parent.resize(above.begin.size());
    std::iota(level.pieces.parent.begin(), level.pieces.parent.end(), 0u);
    level.first = first, level.count = last - first + 1;
    // The farthest rows first: where they are empty, nothing else has to be read.
    for (std::int64_t low = first, high = last; low <= high; ++low, --high) {
      narrow(level, low, begin, end);
      if (low < high) narrow(level, high, begin, end);
      if (level.pieces.begin.empty()) return;
    }
    find_runs(level);
    if (end - begin == 1) return put_row(depth, begin);
    const std::int64_t middle = (begin + end) / 2;
    erode_block(depth + 1, begin, middle, middle - 1 - far_, end - 2 - far_);
    erode_block(depth + 1, middle, end, begin + far_ + 1, middle + far_);
  }

  /// Keeps of the pieces what a row leaves for the row of [begin, end) that is the farthest from it.
  void narrow(Level& level, std::int64_t row, std::int64_t begin, std::int64_t end) {
    const std::int64_t farthest = std::max(row - begin, end - 1 - row);
    const std::int32_t width = wide_[static_cast<std::size_t>(far_ + farthest)];
    const Row runs = image_.row(static_cast<std::uint32_t>(row));
    const Pieces& kept = level.pieces;
    level.next.clear();
    std::size_t k = 0;
    for (std::size_t i = 0; i + 1 < runs.size() && k < kept.begin.size(); i += 2) {
      const std::int32_t from = static_cast<std::int32_t>(runs[i]) + width, to = static_cast<std::int32_t>(runs[i + 1]) - width;
      if (from >= to) continue;
      while (k < kept.begin.size() && kept.end[k] <= from) ++k;
      for (std::size_t j = k; j < kept.begin.size() && kept.begin[j] < to; ++j) {
        level.next.begin.push_back(std::max(from, kept.begin[j]));
        level.next.end.push_back(std::min(to, kept.end[j]));
        level.next.parent.push_back(kept.parent[j]);
      }
    }
    std::swap(level.pieces, level.next);
  }

  void find_runs(Level& level) {
    const auto count = static_cast<std::size_t>(level.count), pieces = level.pieces.begin.size();
    level.run_begin.resize(pieces * count);
    level.run_end.resize(pieces * count);
    for (std::size_t s = 0; s < count; ++s) {
      const Row runs = image_.row(static_cast<std::uint32_t>(level.first + static_cast<std::int64_t>(s)));
      for (std::size_t p = 0, i = 0; p < pieces; ++p) {
        while (static_cast<std::int32_t>(runs[i + 1]) <= level.pieces.begin[p]) i += 2;
        level.run_begin[p * count + s] = static_cast<std::int32_t>(runs[i]);
        level.run_end[p * count + s] = static_cast<std::int32_t>(runs[i + 1]);
      }
    }
  }

  void put_row(std::size_t depth, std::int64_t row) {
    skip_to(row);
    const Level& own = levels_[depth];
    for (std::size_t p = 0; p < own.pieces.begin.size(); ++p) {
      PieceEnds piece{own.pieces.begin[p], own.pieces.end[p]};
      std::size_t of = p;
      for (std::size_t d = depth + 1; d-- > 0;) {
        const Level& level = levels_[d];
        const auto count = static_cast<std::size_t>(level.count);
        piece = shrink_({level.run_begin.data() + of * count, level.run_end.data() + of * count,
                         wide_.data() + (level.first - row + far_), count},
                        piece);
        of = level.pieces.parent[of];
      }
      if (piece.begin >= piece.end) continue;
      result_.change.push_back(static_cast<std::uint32_t>(piece.begin));
      result_.change.push_back(static_cast<std::uint32_t>(piece.end));
    }
  }

  RunsView image_;
  std::int64_t far_;
  Runs& result_;
  std::vector<std::int32_t> wide_;  // of the rows -far .. far
  Pieces whole_;
  std::vector<Level> levels_;  // of halves of halves
  PieceEnds (*shrink_)(const EdgeRows&, PieceEnds) = shrink_kernel();
};

/// Appends [begin, end) to runs whose begins rise; joins what touches.
void append(std::uint32_t begin, std::uint32_t end, Buffer<std::uint32_t>& runs) {
  if (runs.empty() || runs.back() < begin) {
    runs.push_back(begin);
    runs.push_back(end);
  } else {
    runs.back() = std::max(runs.back(), end);
  }
}

/// The runs of `merged` with those of `row`, each longer by `width` at both ends.
void merge(Row merged, Row row, std::uint32_t width, std::uint32_t columns, Buffer<std::uint32_t>& result) {
  result.clear();
  std::size_t u = 0;
  for (std::size_t i = 0; i + 1 < row.size(); i += 2) {
    const std::uint32_t begin = row[i] > width ? row[i] - width : 0;
    for (; u + 1 < merged.size() && merged[u] <= begin; u += 2) append(merged[u], merged[u + 1], result);
    append(begin, columns - row[i + 1] > width ? row[i + 1] + width : columns, result);
  }
  for (; u + 1 < merged.size(); u += 2) append(merged[u], merged[u + 1], result);
}

/// The gaps of an image, numbered from 1 row by row; a row of n runs has n + 1 of them, of which the outer ones may be empty.
struct Gaps {
  RunsView image;
  Buffer<std::uint32_t>& parent;

  std::uint32_t first(std::uint32_t row) const { return 1 + image.row_offset[row] / 2 + row; }
  std::uint32_t count(std::uint32_t row) const { return static_cast<std::uint32_t>(image.row(row).size() / 2) + 1; }
  std::uint32_t begin(std::uint32_t row, std::uint32_t k) const { return k == 0 ? 0 : image.row(row)[2 * k - 1]; }
  std::uint32_t end(std::uint32_t row, std::uint32_t k) const {
    return k + 1 == count(row) ? image.columns : image.row(row)[2 * k];
  }

  std::uint32_t root(std::uint32_t gap) {
    while (parent[gap] != gap) gap = parent[gap] = parent[parent[gap]];
    return gap;
  }
  void join(std::uint32_t a, std::uint32_t b) {
    a = root(a), b = root(b);
    parent[std::max(a, b)] = std::min(a, b);
  }
};

/// Joins the gaps of a row with those of the next one that share a column with them.
void join_rows(std::uint32_t row, Gaps& gaps) {
  std::uint32_t a = 0, b = 0;
  while (a < gaps.count(row) && b < gaps.count(row + 1)) {
    const std::uint32_t end_a = gaps.end(row, a), end_b = gaps.end(row + 1, b);
    if (std::max(gaps.begin(row, a), gaps.begin(row + 1, b)) < std::min(end_a, end_b))
      gaps.join(gaps.first(row) + a, gaps.first(row + 1) + b);
    if (end_a <= end_b) ++a;
    if (end_b <= end_a) ++b;
  }
}

EdgeMove edge_move(const PixelGrid& grid, const BleedUm& um) {
  return {reach_of(grid, std::llround(std::abs(um[0]) * 1000), std::llround(std::abs(um[1]) * 1000)), um[0] < 0 || um[1] < 0};
}

void move_edge(const RunsView& image, const Reach& reach, bool grows, Runs& result) {
  grows ? dilate(image, reach, result) : erode(image, reach, result);
}

/// A layer's image with moved edges. What stands in a hole has the edges of that hole.
void move_edges(const RunsView& image, const Bleed& bleed, BleedWork& work, Runs& result) {
  if (bleed.outside == bleed.holes) return move_edge(image, bleed.outside.reach, bleed.outside.grows, result);
  Runs &filled = work.second, &holes = work.third, &moved = work.fourth;
  fill_holes(image, work.holes, filled);
  combine(filled, image, SetOperation::kDifference, holes);
  // What is set grows into a hole where the hole shrinks.
  if (bleed.holes.any()) {
    move_edge(holes, bleed.holes.reach, !bleed.holes.grows, moved);
    std::swap(holes, moved);
  }
  if (bleed.outside.any()) {
    move_edge(filled, bleed.outside.reach, bleed.outside.grows, moved);
    std::swap(filled, moved);
  }
  combine(filled, holes, SetOperation::kDifference, result);
}

}  // namespace

Reach reach_of(const PixelGrid& grid, std::int64_t x_nm, std::int64_t y_nm) {
  Reach reach;
  if (x_nm <= 0 && y_nm <= 0) return reach;
  const auto picometres = [](const PixelAxis& axis) {
    return std::llround(static_cast<double>(axis.span) * 1000 / static_cast<double>(axis.dots));
  };
  const __int128 px = picometres(grid.x), py = picometres(grid.y), x = x_nm, y = y_nm;
  const auto within = [&](std::int64_t i, std::int64_t j) {
    const __int128 along = i * px, across = j * py;  // picometres
    if (i == 0 || j == 0) return along <= x * 1000 && across <= y * 1000;
    if (x == 0 || y == 0) return false;
    if (x == y) return along * along + across * across <= x * x * 1'000'000;
    return along * along * y * y + across * across * x * x <= x * x * y * y * 1'000'000;
  };
  auto width = static_cast<std::int64_t>(x * 1000 / px);
  for (std::int64_t j = 0; within(0, j); ++j) {
    while (width > 0 && !within(width, j)) --width;
    reach.half_width.push_back(static_cast<std::uint32_t>(width));
  }
  return reach;
}

void erode(const RunsView& image, const Reach& reach, Runs& result) {
  if (!reach.half_width.empty()) return Eroder(image, reach, result).erode();
  result.columns = image.columns;
  result.row_offset.assign(image.row_offset.begin(), image.row_offset.end());
  result.change.assign(image.change.begin(), image.change.end());
}

void dilate(const RunsView& image, const Reach& reach, Runs& result) {
  const std::int64_t rows = image.rows(), far = static_cast<std::int64_t>(reach.half_width.size()) - 1;
  result.columns = image.columns;
  result.row_offset.assign(1, 0);
  result.change.clear();
  Buffer<std::uint32_t> merged, next;
  for (std::int64_t r = 0; r < rows; ++r) {
    const Row own = image.row(static_cast<std::uint32_t>(r));
    merged.assign(own.begin(), own.end());
    for (std::int64_t j = -far; j <= far; ++j) {
      if (r + j < 0 || r + j >= rows) continue;
      const Row row = image.row(static_cast<std::uint32_t>(r + j));
      if (row.empty()) continue;
      merge(merged, row, reach.half_width[static_cast<std::size_t>(j < 0 ? -j : j)], image.columns, next);
      std::swap(merged, next);
    }
    result.change.insert(result.change.end(), merged.begin(), merged.end());
    result.row_offset.push_back(static_cast<std::uint32_t>(result.change.size()));
  }
}

bool grows_beyond(const RunsView& image, const Reach& reach) {
  if (reach.half_width.empty()) return false;
  const std::uint32_t rows = image.rows(), width = reach.half_width[0];
  const auto far = static_cast<std::uint32_t>(reach.half_width.size()) - 1;
  for (std::uint32_t r = 0; r < rows; ++r) {
    const Row row = image.row(r);
    if (row.empty()) continue;
    if (r < far || rows - 1 - r < far || row.front() < width || image.columns - row.back() < width) return true;
  }
  return false;
}

void fill_holes(const RunsView& image, Buffer<std::uint32_t>& parent, Runs& filled) {
  const std::uint32_t rows = image.rows();
  Gaps gaps{image, parent};
  parent.resize(1 + image.change.size() / 2 + rows);
  std::iota(parent.begin(), parent.end(), 0u);
  for (std::uint32_t r = 0; r < rows; ++r) {
    const std::uint32_t first = gaps.first(r), last = first + gaps.count(r) - 1;
    const bool border = r == 0 || r + 1 == rows;
    for (std::uint32_t gap = first; gap <= last; ++gap) {
      const bool outer = (gap == first || gap == last || border) && gaps.begin(r, gap - first) < gaps.end(r, gap - first);
      if (outer) gaps.join(0, gap);
    }
    if (r > 0) join_rows(r - 1, gaps);
  }
  filled.columns = image.columns;
  filled.row_offset.assign(1, 0);
  filled.change.clear();
  for (std::uint32_t r = 0; r < rows; ++r) {
    const auto row = image.row(r);
    for (std::size_t i = 0; i + 1 < row.size(); i += 2) {
      const std::uint32_t gap = gaps.first(r) + static_cast<std::uint32_t>(i / 2);  // before the run
      if (i == 0 || gaps.root(gap) == 0) filled.change.push_back(row[i]);
      if (i + 2 >= row.size() || gaps.root(gap + 1) == 0) filled.change.push_back(row[i + 1]);
    }
    filled.row_offset.push_back(static_cast<std::uint32_t>(filled.change.size()));
  }
}

Bleed bleed_of(const PixelGrid& grid, const BleedUm& outside, const BleedUm& holes) {
  return {edge_move(grid, outside), edge_move(grid, holes)};
}

std::uint64_t BleedWork::bytes() const {
  std::uint64_t total = bytes_held(holes);
  for (const Runs* runs : {&moved, &second, &third, &fourth}) total += bytes_held(runs->row_offset) + bytes_held(runs->change);
  return total;
}

bool Bleeds::any() const {
  return std::ranges::any_of(
      zones_, [&](const ZoneBleed& zone) { return zone.above.any() || (first_layers_ > 0 && zone.first.any()); });
}

bool Bleeds::grows() const {
  return std::ranges::any_of(
      zones_, [&](const ZoneBleed& zone) { return zone.above.grows() || (first_layers_ > 0 && zone.first.grows()); });
}

std::uint32_t Bleeds::max_rows() const {
  std::size_t maximum = 0;
  for (const ZoneBleed& zone : zones_) {
    for (const Bleed* bleed : {&zone.above, &zone.first})
      maximum = std::max({maximum, bleed->outside.reach.half_width.size(), bleed->holes.reach.half_width.size()});
  }
  return static_cast<std::uint32_t>(maximum);
}

void Bleeds::remove(const Layer& layer, Runs& image, std::span<Runs> zone, BleedWork& work) const {
  if (zones_.size() == 1) {
    const Bleed& bleed = of(0, layer);
    if (!bleed.any()) return;
    move_edges(image, bleed, work, work.moved);
    return std::swap(image, work.moved);
  }
  // First all that stays within the layer: a border with another part is no edge. Then what grows out of it.
  const Runs whole = image;
  const auto deposit = [&](Runs& own) {
    combine(image, own, SetOperation::kUnion, work.second);
    std::swap(image, work.second);
  };
  image.change.clear();
  std::ranges::fill(image.row_offset, 0);
  std::vector<Runs> grown(zone.size());
  for (std::uint32_t z = 0; z < zone.size(); ++z) {
    const Bleed& bleed = of(z, layer);
    if (bleed.grows()) {
      move_edges(zone[z], bleed, work, work.moved);
      combine(work.moved, whole, SetOperation::kDifference, grown[z]);
    }
    if (bleed.any()) {
      move_edges(whole, bleed, work, work.moved);
      combine(work.moved, zone[z], SetOperation::kIntersection, work.second);
      std::swap(zone[z], work.second);
    }
    deposit(zone[z]);
  }
  for (std::uint32_t z = 0; z < zone.size(); ++z) {
    if (grown[z].change.empty()) continue;
    combine(grown[z], image, SetOperation::kDifference, work.moved);
    combine(zone[z], work.moved, SetOperation::kUnion, work.second);
    std::swap(zone[z], work.second);
    deposit(zone[z]);
  }
}

}  // namespace lamina::dose
