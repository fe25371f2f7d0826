#include "stages/dose/erode.h"

#if defined(__x86_64__)
#include <immintrin.h>
#endif

#include <algorithm>
#include <array>
#include <numeric>
#include <span>

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

constexpr std::size_t kMaxBlock = 64, kLanes = 32;  // rows; that are shrunk at once

/// Ends of one run in each of block + count - 1 rows, and what they leave of each row r of the block: the greatest
/// begin[r + j] + wide[j], and the least end[r + j] - wide[j], of j below count. Blocks are whole lanes.
struct SteadyRun {
  const std::int32_t *begin, *end, *wide;
  std::size_t count, block;
};
struct BlockEnds {
  std::array<std::int32_t, kMaxBlock> begin, end;
};
void shrink_block_plain(const SteadyRun& run, BlockEnds& left) {
  left.begin.fill(0), left.end.fill(INT32_MAX);
  for (std::size_t j = 0; j < run.count; ++j) {
    for (std::size_t r = 0; r < run.block; ++r) {
      left.begin[r] = std::max(left.begin[r], run.begin[r + j] + run.wide[j]);
      left.end[r] = std::min(left.end[r], run.end[r + j] - run.wide[j]);
    }
  }
}
#if defined(LAMINA_WIDE_KERNELS)
LAMINA_AVX2 inline __m256i load(const std::int32_t* at) { return _mm256_loadu_si256(reinterpret_cast<const __m256i*>(at)); }
LAMINA_AVX2 void shrink_block_avx2(const SteadyRun& run, BlockEnds& left) {
  constexpr std::size_t kVectors = kLanes / 8;
  for (std::size_t first = 0; first < run.block; first += kLanes) {
    __m256i begin[kVectors], end[kVectors];
    for (std::size_t v = 0; v < kVectors; ++v) begin[v] = _mm256_setzero_si256(), end[v] = _mm256_set1_epi32(INT32_MAX);
    for (std::size_t j = 0; j < run.count; ++j) {
      const __m256i wide = _mm256_set1_epi32(run.wide[j]);
      for (std::size_t v = 0; v < kVectors; ++v) {
        const std::size_t at = first + 8 * v + j;
        begin[v] = _mm256_max_epi32(begin[v], _mm256_add_epi32(load(run.begin + at), wide));
        end[v] = _mm256_min_epi32(end[v], _mm256_sub_epi32(load(run.end + at), wide));
      }
    }
    for (std::size_t v = 0; v < kVectors; ++v) {
      _mm256_storeu_si256(reinterpret_cast<__m256i*>(left.begin.data() + first + 8 * v), begin[v]);
      _mm256_storeu_si256(reinterpret_cast<__m256i*>(left.end.data() + first + 8 * v), end[v]);
    }
  }
}
#endif

struct ShrinkKernels {
  PieceEnds (*piece)(const EdgeRows&, PieceEnds);
  void (*block)(const SteadyRun&, BlockEnds&);
};
ShrinkKernels shrink_kernels() {
#if defined(LAMINA_WIDE_KERNELS)
  if (widest_isa() >= Isa::kAvx2) return {shrink_avx2, shrink_block_avx2};
#endif
  return {shrink_plain, shrink_block_plain};
}

/// The first run from run `from` on that ends after `column`; runs are numbered by their changes.
std::size_t run_after(Row runs, std::size_t from, std::int32_t column) {
  for (std::size_t step = 2;;) {
    if (from + step <= runs.size() && static_cast<std::int32_t>(runs[from + step - 1]) <= column) {
      from += step, step *= 2;
    } else if (step == 2) {
      return from;
    } else {
      step = 2;
    }
  }
}

/// Erosion of blocks of rows. All rows of a block have rows around them in common: a piece that is left by the runs of these,
/// each made as much shorter as the farthest row of the block requires, is of one run of each. Where it meets one run at most
/// in each other row that any of the block reaches, it is steady: the ends of these runs give all rows at once. Else halves of
/// the block, down to single rows, add the rows that they have in common and the block has not.
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
    const std::int64_t block = std::clamp<std::int64_t>(far_ + far_ / 3, 1, kMaxBlock);
    for (std::int64_t r = far_; r < end; r += block) {
      skip_to(result_, r);
      const std::int64_t last = std::min(r + block, end);
      whole_.begin.assign(1, 0), whole_.end.assign(1, static_cast<std::int32_t>(image_.columns));
      if (!narrow_all(0, r, last, last - 1 - far_, r + far_)) continue;
      block_ = r;
      take_steady(r, last);
      loose_.row_offset.assign(1, 0);
      loose_.change.clear();
      if (!levels_[0].pieces.begin.empty()) halve(0, r, last);
      put_rows(r, last);
    }
    skip_to(result_, rows);
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

  static void skip_to(Runs& runs, std::int64_t row) {
    while (static_cast<std::int64_t>(runs.row_offset.size()) <= row)
      runs.row_offset.push_back(static_cast<std::uint32_t>(runs.change.size()));
  }

  /// The pieces that the rows first .. last, which the rows [begin, end) have in common, leave of those above. False: none
  bool narrow_all(std::size_t depth, std::int64_t begin, std::int64_t end, std::int64_t first, std::int64_t last) {
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
      if (level.pieces.begin.empty()) return false;
    }
    return true;
  }

  /// The rows [begin, end), whose pieces are those of a level.
  void halve(std::size_t depth, std::int64_t begin, std::int64_t end) {
    find_runs(levels_[depth]);
    if (end - begin == 1) return put_row(depth, begin);
    const std::int64_t middle = (begin + end) / 2;
    if (narrow_all(depth + 1, begin, middle, middle - 1 - far_, end - 2 - far_)) halve(depth + 1, begin, middle);
    if (narrow_all(depth + 1, middle, end, begin + far_ + 1, middle + far_)) halve(depth + 1, middle, end);
  }

  /// Keeps of the pieces what a row leaves for the row of [begin, end) that is the farthest from it.
  void narrow(Level& level, std::int64_t row, std::int64_t begin, std::int64_t end) {
    const std::int64_t farthest = std::max(row - begin, end - 1 - row);
    const std::int32_t width = wide_[static_cast<std::size_t>(far_ + farthest)];
    const Row runs = image_.row(static_cast<std::uint32_t>(row));
    const Pieces& kept = level.pieces;
    level.next.clear();
    for (std::size_t k = 0, i = 0; k < kept.begin.size(); ++k) {
      i = run_after(runs, i, kept.begin[k]);
      for (std::size_t j = i; j < runs.size() && static_cast<std::int32_t>(runs[j]) < kept.end[k]; j += 2) {
        const std::int32_t from = std::max(static_cast<std::int32_t>(runs[j]) + width, kept.begin[k]);
        const std::int32_t to = std::min(static_cast<std::int32_t>(runs[j + 1]) - width, kept.end[k]);
        if (from >= to) continue;
        level.next.begin.push_back(from);
        level.next.end.push_back(to);
        level.next.parent.push_back(kept.parent[k]);
      }
    }
    std::swap(level.pieces, level.next);
  }

  /// Moves the steady pieces of the rows [begin, end) from the first level into steady_, with what is left of them.
  void take_steady(std::int64_t begin, std::int64_t end) {
    constexpr std::int64_t kMinRows = 8;
    constexpr std::int32_t kBeyond = 1 << 30;
    steady_.clear();
    ends_.clear();
    if (end - begin < kMinRows) return;
    Pieces& pieces = levels_[0].pieces;
    const std::size_t count = pieces.begin.size(), lanes = static_cast<std::size_t>(end - begin + kLanes - 1) / kLanes * kLanes;
    const std::size_t reach = wide_.size(), rows = lanes + reach - 1;
    run_begin_.resize(count * rows), run_end_.resize(count * rows);
    loose_piece_.assign(count, 0);
    for (std::int64_t row = begin - far_; row < end + far_; ++row) {
      const Row runs = image_.row(static_cast<std::uint32_t>(row));
      for (std::size_t p = 0, i = 0, at = static_cast<std::size_t>(row - begin + far_); p < count; ++p, at += rows) {
        i = run_after(runs, i, pieces.begin[p]);
        const bool met = i < runs.size() && static_cast<std::int32_t>(runs[i]) < pieces.end[p];
        run_begin_[at] = met ? static_cast<std::int32_t>(runs[i]) : kBeyond;
        run_end_[at] = met ? static_cast<std::int32_t>(runs[i + 1]) : -kBeyond;
        loose_piece_[p] |= met && i + 2 < runs.size() && static_cast<std::int32_t>(runs[i + 2]) < pieces.end[p];
      }
    }
    std::size_t loose = 0;
    for (std::size_t p = 0; p < count; ++p) {
      if (loose_piece_[p] != 0) {
        pieces.begin[loose] = pieces.begin[p], pieces.end[loose] = pieces.end[p], pieces.parent[loose++] = pieces.parent[p];
        continue;
      }
      steady_.push_back({pieces.begin[p], pieces.end[p]});
      kernels_.block({run_begin_.data() + p * rows, run_end_.data() + p * rows, wide_.data(), reach, lanes}, ends_.emplace_back());
    }
    pieces.begin.resize(loose), pieces.end.resize(loose), pieces.parent.resize(loose);
  }

  /// Appends the rows [begin, end) of steady pieces and of others, in the order of their columns.
  void put_rows(std::int64_t begin, std::int64_t end) {
    skip_to(loose_, end - begin);
    for (std::int64_t row = begin; row < end; ++row) {
      const auto r = static_cast<std::uint32_t>(row - begin);
      skip_to(result_, row);
      std::uint32_t next = loose_.row_offset[r];
      const std::uint32_t last = loose_.row_offset[r + 1];
      for (std::size_t p = 0; p <= steady_.size(); ++p) {
        const bool any = p < steady_.size();
        for (; next < last && (!any || static_cast<std::int32_t>(loose_.change[next]) < steady_[p].begin); next += 2)
          result_.change.insert(result_.change.end(), {loose_.change[next], loose_.change[next + 1]});
        if (!any) break;
        const std::int32_t from = std::max(steady_[p].begin, ends_[p].begin[r]), to = std::min(steady_[p].end, ends_[p].end[r]);
        if (from >= to) continue;
        result_.change.push_back(static_cast<std::uint32_t>(from));
        result_.change.push_back(static_cast<std::uint32_t>(to));
      }
    }
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
    skip_to(loose_, row - block_);
    const Level& own = levels_[depth];
    for (std::size_t p = 0; p < own.pieces.begin.size(); ++p) {
      PieceEnds piece{own.pieces.begin[p], own.pieces.end[p]};
      std::size_t of = p;
      for (std::size_t d = depth + 1; d-- > 0;) {
        const Level& level = levels_[d];
        const auto count = static_cast<std::size_t>(level.count);
        piece = kernels_.piece({level.run_begin.data() + of * count, level.run_end.data() + of * count,
                         wide_.data() + (level.first - row + far_), count},
                        piece);
        of = level.pieces.parent[of];
      }
      if (piece.begin >= piece.end) continue;
      loose_.change.push_back(static_cast<std::uint32_t>(piece.begin));
      loose_.change.push_back(static_cast<std::uint32_t>(piece.end));
    }
  }

  RunsView image_;
  std::int64_t far_;
  Runs& result_;
  std::vector<std::int32_t> wide_;  // of the rows -far .. far
  Pieces whole_;
  std::vector<Level> levels_;  // of halves of halves
  std::int64_t block_ = 0;           // its first row
  std::vector<PieceEnds> steady_;    // pieces, and what is left of them
  std::vector<BlockEnds> ends_;
  std::vector<std::int32_t> run_begin_, run_end_;  // of each piece, row by row
  std::vector<std::uint8_t> loose_piece_;
  Runs loose_;  // what is left of the others
  ShrinkKernels kernels_ = shrink_kernels();
};


}  // namespace

void erode(const RunsView& image, const Reach& reach, Runs& result) {
  if (!reach.half_width.empty()) return Eroder(image, reach, result).erode();
  result.columns = image.columns;
  result.row_offset.assign(image.row_offset.begin(), image.row_offset.end());
  result.change.assign(image.change.begin(), image.change.end());
}

}  // namespace lamina::dose
