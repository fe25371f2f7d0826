// stages/load/repair/surfaces.cpp: triangles of a block are joined in a core's cache, and pieces of blocks by the vertices that they
// share. Few of those are enough to join most pieces: the ones whose hash, which is the same in every block, is small. What they
// leave over, pieces of few triangles and surfaces of their own, is looked up with all of its vertices.
#include "stages/load/repair/surfaces.h"

#include <tbb/blocked_range.h>
#include <tbb/enumerable_thread_specific.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <numeric>
#include <span>
#include <utility>
#include <vector>

#include "stages/load/repair/census.h"
#include "stages/load/repair/geometry.h"
#include "stages/load/repair/topology.h"

namespace lamina::load {
namespace {

constexpr std::uint32_t kJoined = 32;  // blocks; in more, lines are searched: joining took a tenth of the time of a job

/// Pieces of a block that its vertices join, in memory of its own.
class BlockPieces {
 public:
  /// block    names its vertices. returns  how many there are
  std::uint32_t find(const MeshBlocks& blocks, std::uint32_t block) {
    block_ = blocks.indexed(block * MeshBlocks::kClusters);
    triangles_ = blocks.triangles_in(block);
    std::iota(parent_.begin(), parent_.end(), std::uint16_t{0});
    std::uint32_t last = 0;
    each_triangle([&](std::uint16_t a, std::uint16_t b, std::uint16_t c) {
      last = std::max({last, std::uint32_t{a}, std::uint32_t{b}, std::uint32_t{c}});
      if (parent_[a] == parent_[b] && parent_[b] == parent_[c]) return;
      const std::uint16_t x = root(a), y = root(b), z = root(c), low = std::min({x, y, z});
      parent_[x] = parent_[y] = parent_[z] = parent_[a] = parent_[b] = parent_[c] = low;
    });
    vertices_ = last + 1;
    std::uint16_t pieces = 0;
    for (std::uint32_t v = 0; v < vertices_; ++v)  // no parent is larger than its child
      piece_[v] = parent_[v] == v ? pieces++ : piece_[parent_[v]];
    return pieces;
  }

  /// Of the block that was found last. visit(hash, piece)
  template <class Visit>
  void each_vertex(const Visit& visit) const {
    for (std::uint32_t v = 0; v < vertices_; ++v) visit(hash(block_.vertex[v]), std::uint32_t{piece_[v]});
  }
  /// Adds six times the volume between the facets and a point, nm3, to that of their pieces.
  void add_volumes(const Point3& from, double* sixfold) const {
    each_triangle([&](std::uint16_t a, std::uint16_t b, std::uint16_t c) {
      const auto to = [&](std::uint16_t v, Nm Point3::*axis) { return double(block_.vertex[v].*axis) - double(from.*axis); };
      const double ax = to(a, &Point3::x), ay = to(a, &Point3::y), az = to(a, &Point3::z);
      const double bx = to(b, &Point3::x), by = to(b, &Point3::y), bz = to(b, &Point3::z);
      const double cx = to(c, &Point3::x), cy = to(c, &Point3::y), cz = to(c, &Point3::z);
      sixfold[piece_[a]] += ax * (by * cz - bz * cy) + ay * (bz * cx - bx * cz) + az * (bx * cy - by * cx);
    });
  }

 private:
  template <class Visit>
  void each_triangle(const Visit& visit) const {
    for (std::uint32_t i = 0; i < triangles_; i += kClusterSize) {
      const auto& corner = block_.cluster[i / kClusterSize].corner;
      for (std::uint32_t lane = 0; lane < std::min(kClusterSize, triangles_ - i); ++lane)
        visit(corner[0][lane], corner[1][lane], corner[2][lane]);
    }
  }
  std::uint16_t root(std::uint16_t v) {
    while (parent_[v] != v) v = parent_[v] = parent_[parent_[v]];
    return v;
  }

  MeshBlocks::Indexed block_{};
  std::uint32_t triangles_ = 0, vertices_ = 0;
  std::array<std::uint16_t, 3 * kBlockSize> parent_, piece_;
};

/// A vertex and the piece that has it, of all blocks.
struct VertexOfPiece {
  std::uint64_t hash;
  std::uint32_t piece;
};
using Vertices = std::vector<std::vector<VertexOfPiece>>;  // of each block

/// Lines on a grid over a mesh, halfway between whole nanometres, so that no vertex lies on one.
class VerticalLines {
 public:
  explicit VerticalLines(const MeshBlocks& blocks) : blocks_(blocks) {
    for (const Box& box : blocks.bounds()) bounds_.add(box);
    const double lines = std::clamp(std::sqrt(blocks.triangle_count() / 128.0), 16.0, 512.0);
    per_side_ = static_cast<std::int64_t>(lines);
    step_x_ = std::max<std::int64_t>(1, bounds_.width() / per_side_), step_y_ = std::max<std::int64_t>(1, bounds_.depth() / per_side_);
    lines_per_nm_x_ = 1 / static_cast<double>(step_x_), lines_per_nm_y_ = 1 / static_cast<double>(step_y_);
    origin_x_ = static_cast<double>(line_x(0)) / 2, origin_y_ = static_cast<double>(line_y(0)) / 2;
  }

  /// Whether the winding number is negative somewhere on a line.
  bool any_negative() const {
    tbb::enumerable_thread_specific<std::vector<LineCrossing>> found;
    const auto all = static_cast<std::uint32_t>(blocks_.cluster_count());
    tbb::parallel_for(tbb::blocked_range<std::uint32_t>(0, all, 1024), [&](const tbb::blocked_range<std::uint32_t>& range) {
      std::vector<LineCrossing>& own = found.local();
      for (std::uint32_t c = range.begin(); c != range.end(); ++c) {
        const Box& box = blocks_.bounds()[c];
        if (!lines_in(box.lo.x, box.hi.x, box.lo.y, box.hi.y).any()) continue;
        Cluster expanded;
        const Cluster& cluster = blocks_.cluster(c, expanded);
        for (std::uint32_t lanes = near_lines(cluster); lanes != 0; lanes &= lanes - 1)
          cross(cluster.triangle(static_cast<std::uint32_t>(std::countr_zero(lanes))), own);
      }
    });
    std::vector<std::uint32_t> end(static_cast<std::size_t>((per_side_ + 2) * (per_side_ + 2)), 0);
    for (const auto& some : found)
      for (const LineCrossing& one : some) ++end[one.line];
    std::partial_sum(end.begin(), end.end(), end.begin());
    std::vector<LineCrossing> crossings(end.back());
    for (const auto& some : found)
      for (const LineCrossing& one : some) crossings[--end[one.line]] = one;
    for (std::size_t begin = 0, next = 0; begin < crossings.size(); begin = next) {
      while (next < crossings.size() && crossings[next].line == crossings[begin].line) ++next;
      if (is_negative(std::span(crossings).subspan(begin, next - begin))) return true;
    }
    return false;
  }

 private:
  struct LineCrossing {
    double z;
    std::uint32_t line;
    std::int32_t enters;  // 1, or -1 where it leaves
  };
  /// Downwards from above: a body is entered through its top. Of equal heights those that enter come first.
  static bool is_negative(std::span<LineCrossing> of_line) {
    std::ranges::sort(of_line, [](const LineCrossing& one, const LineCrossing& other) {
      return one.z != other.z ? one.z > other.z : one.enters > other.enters;
    });
    std::int32_t winding = 0;
    for (const LineCrossing& one : of_line)
      if ((winding += one.enters) < 0) return true;
    return false;
  }
  /// Twice the coordinate of a line: half a step and half a nanometre behind the start of its cell.
  std::int64_t line_x(std::int64_t i) const { return 2 * (bounds_.lo.x + step_x_ / 2 + i * step_x_) + 1; }
  std::int64_t line_y(std::int64_t j) const { return 2 * (bounds_.lo.y + step_y_ / 2 + j * step_y_) + 1; }

  /// Lines, first to last, that may lie in a box; one that lies beside it by rounding is met by no facet.
  struct Lines {
    std::int32_t x_first, x_last, y_first, y_last;
    bool any() const { return x_first <= x_last && y_first <= y_last; }
  };
  Lines lines_in(Nm x_low, Nm x_high, Nm y_low, Nm y_high) const {
    constexpr double kNear = 1e-6, kPositive = 1 << 20;  // positive numbers are rounded down by conversion
    const auto first = [](double at) { return static_cast<std::int32_t>(at + (kPositive + 1 - kNear)) - (1 << 20); };
    const auto last = [](double at) { return static_cast<std::int32_t>(at + (kPositive + kNear)) - (1 << 20); };
    return {first((x_low - origin_x_) * lines_per_nm_x_), last((x_high - origin_x_) * lines_per_nm_x_),
            first((y_low - origin_y_) * lines_per_nm_y_), last((y_high - origin_y_) * lines_per_nm_y_)};
  }

  /// Whether p lies left of the edge; of two facets that share it, to one alone where p lies on it. p  twice its coordinates
  static bool is_left(const Point3& from, const Point3& to, std::int64_t px, std::int64_t py) {
    const bool reversed = std::pair(to.x, to.y) < std::pair(from.x, from.y);
    const Point3 &a = reversed ? to : from, &b = reversed ? from : to;
    // A line within the facet's box: both products are below 2^64 in size, and doubles tell them apart but for the last digits.
    const std::int64_t ux = std::int64_t{b.x} - a.x, uy = std::int64_t{b.y} - a.y, vx = px - 2 * std::int64_t{a.x},
                       vy = py - 2 * std::int64_t{a.y};
    const double about = static_cast<double>(ux) * static_cast<double>(vy) - static_cast<double>(uy) * static_cast<double>(vx);
    const bool is_side = std::fabs(about) > 65536 ? about > 0 : Int128{ux} * vy >= Int128{uy} * vx;
    return is_side != reversed;
  }

  /// Whose boxes may meet a line, a bit a triangle. A loop that compilers turn into vectors; float places a line within some hundredths of a step or less.
  std::uint32_t near_lines(const Cluster& cluster) const {
    constexpr float kPositive = 4096;
    const double far = std::max(std::fabs(origin_x_ * lines_per_nm_x_), std::fabs(origin_y_ * lines_per_nm_y_));
    const auto near = static_cast<float>((kPositive + far) * 2.5e-7);
    const auto scale_x = static_cast<float>(lines_per_nm_x_), scale_y = static_cast<float>(lines_per_nm_y_);
    const auto shift_x = static_cast<float>(kPositive - origin_x_ * lines_per_nm_x_),
               shift_y = static_cast<float>(kPositive - origin_y_ * lines_per_nm_y_);
    const auto met = [near](Nm a, Nm b, Nm c, float scale, float shift) {
      const float low = static_cast<float>(std::min(std::min(a, b), c)) * scale + (shift - near);
      const float high = static_cast<float>(std::max(std::max(a, b), c)) * scale + (shift + near);
      return static_cast<std::int32_t>(high) - static_cast<std::int32_t>(low);  // lines between them
    };
    std::int32_t found[kClusterSize];
    for (std::uint32_t i = 0; i < kClusterSize; ++i) {
      const std::int32_t x = met(cluster.x[0][i], cluster.x[1][i], cluster.x[2][i], scale_x, shift_x);
      const std::int32_t y = met(cluster.y[0][i], cluster.y[1][i], cluster.y[2][i], scale_y, shift_y);
      found[i] = std::min(x, y);
    }
    std::uint32_t lanes = 0;
    for (std::uint32_t i = 0; i < kClusterSize; ++i) lanes |= static_cast<std::uint32_t>(found[i] > 0) << i;
    return lanes;
  }

  void cross(const Triangle& t, std::vector<LineCrossing>& out) const {
    const Lines lines = lines_in(std::min({t.a.x, t.b.x, t.c.x}), std::max({t.a.x, t.b.x, t.c.x}),
                                 std::min({t.a.y, t.b.y, t.c.y}), std::max({t.a.y, t.b.y, t.c.y}));
    for (std::int64_t i = std::max(0, lines.x_first); i <= std::min<std::int64_t>(lines.x_last, per_side_ + 1); ++i) {
      for (std::int64_t j = std::max(0, lines.y_first); j <= std::min<std::int64_t>(lines.y_last, per_side_ + 1); ++j) {
        const std::int64_t px = line_x(i), py = line_y(j);
        const bool left = is_left(t.a, t.b, px, py);
        if (is_left(t.b, t.c, px, py) != left || is_left(t.c, t.a, px, py) != left) continue;
        const double ux = double(t.b.x) - t.a.x, uy = double(t.b.y) - t.a.y, uz = double(t.b.z) - t.a.z;
        const double vx = double(t.c.x) - t.a.x, vy = double(t.c.y) - t.a.y, vz = double(t.c.z) - t.a.z;
        const double nx = uy * vz - uz * vy, ny = uz * vx - ux * vz, nz = ux * vy - uy * vx;
        const double dx = 0.5 * static_cast<double>(px) - t.a.x, dy = 0.5 * static_cast<double>(py) - t.a.y;
        const double z = nz == 0 ? double(t.a.z) : t.a.z - (nx * dx + ny * dy) / nz;
        out.push_back({z, static_cast<std::uint32_t>(j * (per_side_ + 2) + i), left ? 1 : -1});
      }
    }
  }

  const MeshBlocks& blocks_;
  Box bounds_;
  std::int64_t per_side_, step_x_, step_y_;
  double lines_per_nm_x_, lines_per_nm_y_, origin_x_, origin_y_;
};

class Surfaces {
 public:
  explicit Surfaces(const MeshBlocks& blocks) : blocks_(blocks), first_(blocks.block_count() + 1, 0) {}

  bool may_be_negative() {
    constexpr std::uint64_t kFew = UINT64_MAX / 16;
    Vertices found(blocks_.block_count());
    each_block([&](BlockPieces& block, std::uint32_t b, std::uint32_t pieces) {
      first_[b + 1] = pieces;
      block.each_vertex([&](std::uint64_t hash, std::uint32_t piece) {
        if (hash <= kFew) found[b].push_back({hash, piece});
      });
    });
    std::partial_sum(first_.begin(), first_.end(), first_.begin());
    sets_.emplace_back(first_.back());
    join(found);
    return !is_one() && (join_rest(), !is_one()) && any_negative();
  }

 private:
  template <class Visit>
  void each_block(const Visit& visit) const {
    tbb::parallel_for(tbb::blocked_range<std::uint32_t>(0, blocks_.block_count()),
                      [&](const tbb::blocked_range<std::uint32_t>& range) {
                        BlockPieces pieces;
                        for (std::uint32_t b = range.begin(); b != range.end(); ++b) visit(pieces, b, pieces.find(blocks_, b));
                      });
  }

  /// Joins the pieces that have a vertex in common.
  void join(const Vertices& vertices) {
    std::size_t all = 0;
    for (const auto& some : vertices) all += some.size();
    std::vector<VertexOfPiece> slot(std::bit_ceil(2 * all + 1), VertexOfPiece{UINT64_MAX, 0});
    for (std::uint32_t b = 0; b < vertices.size(); ++b) {
      for (const auto& [hash, piece] : vertices[b]) {
        std::size_t at = hash & (slot.size() - 1);
        while (slot[at].hash != hash && slot[at].hash != UINT64_MAX) at = (at + 1) & (slot.size() - 1);
        if (slot[at].hash == UINT64_MAX) slot[at] = {hash, first_[b] + piece};
        sets_.front().join(slot[at].piece, first_[b] + piece);
      }
    }
  }

  bool is_one() {
    for (std::uint32_t piece = 0; piece < first_.back(); ++piece)
      if (sets_.front().find(piece) != 0) return false;
    return true;
  }

  /// Joins those that are not of the surface that has most pieces, by all of their vertices.
  void join_rest() {
    std::vector<std::uint32_t> count(first_.back(), 0);
    for (std::uint32_t piece = 0; piece < first_.back(); ++piece) ++count[sets_.front().find(piece)];
    const auto largest = static_cast<std::uint32_t>(std::ranges::max_element(count) - count.begin());
    std::vector<std::uint8_t> is_rest(first_.back());
    for (std::uint32_t piece = 0; piece < first_.back(); ++piece) is_rest[piece] = sets_.front().find(piece) != largest ? 1 : 0;
    Vertices rest(blocks_.block_count());
    each_block([&](const BlockPieces& block, std::uint32_t b, std::uint32_t pieces) {
      const auto begin = is_rest.begin() + first_[b];
      if (std::find(begin, begin + pieces, 1) == begin + pieces) return;
      block.each_vertex([&](std::uint64_t hash, std::uint32_t piece) {
        if (is_rest[first_[b] + piece] != 0) rest[b].push_back({hash, piece});
      });
    });
    std::size_t all = 0;
    for (const auto& some : rest) all += some.size();
    std::vector<std::uint64_t> bits(std::bit_ceil(all / 4 + 1));  // 16 bits a vertex: few others are looked up
    const auto position = [&](std::uint64_t hash) { return std::pair(hash >> 6 & (bits.size() - 1), hash & 63); };
    for (const auto& some : rest) {
      for (const VertexOfPiece& one : some) {
        const auto [word, bit] = position(one.hash);
        bits[word] |= std::uint64_t{1} << bit;
      }
    }
    each_block([&](const BlockPieces& block, std::uint32_t b, std::uint32_t) {
      rest[b].clear();
      block.each_vertex([&](std::uint64_t hash, std::uint32_t piece) {
        const auto [word, bit] = position(hash);
        if ((bits[word] >> bit & 1) != 0) rest[b].push_back({hash, piece});
      });
    });
    join(rest);
  }

  bool any_negative() {
    const Point3 from = blocks_.bounds()[0].lo;
    std::vector<double> of_piece(first_.back(), 0.0), of_surface(first_.back(), 0.0);
    each_block([&](const BlockPieces& block, std::uint32_t b, std::uint32_t) {
      block.add_volumes(from, of_piece.data() + first_[b]);
    });
    for (std::uint32_t piece = 0; piece < first_.back(); ++piece) of_surface[sets_.front().find(piece)] += of_piece[piece];
    return std::ranges::any_of(of_surface, [](double sixfold) { return sixfold < 0; });
  }

  const MeshBlocks& blocks_;
  std::vector<std::uint32_t> first_;  // piece of each block, and the end
  std::vector<DisjointSets> sets_;    // one, of all pieces
};

}  // namespace

bool may_have_negative_surface(const MeshBlocks& blocks) {
  bool by_lines = blocks.block_count() > kJoined;
  for (std::uint32_t b = 0; b < blocks.block_count() && !by_lines; ++b)
    by_lines = blocks.indexed(b * MeshBlocks::kClusters).cluster == nullptr;
  return (!by_lines && Surfaces(blocks).may_be_negative()) || VerticalLines(blocks).any_negative();
}

}  // namespace lamina::load
