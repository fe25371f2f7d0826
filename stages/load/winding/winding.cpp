// stages/load/winding/winding.cpp: a tree of dipoles; the winding number on a grid, near facets and where it changes, and the
// surface in it.
#include "stages/load/winding/winding.h"

#include <tbb/parallel_for.h>
#include <tbb/parallel_sort.h>

#include <algorithm>
#include <cmath>
#include <numbers>

namespace lamina::load {
namespace {

using Point = WindingTree::Point;

constexpr std::uint32_t kLeaf = 8;
constexpr double kFar = 2.5;  // distance over radius from which on a node is a dipole

/// The sum of half of the solid angles of triangles from the origin. The angles of some triangles are added as the argument of
/// a product of complex numbers: arctangents take most of the time.
class HalfAngles {
 public:
  /// At most 8 triangles before the next call of sum(), for the size of the product: each is below 1e31.
  void add(const Point& a, const Point& b, const Point& c) {
    const double la = std::sqrt(dot(a, a)), lb = std::sqrt(dot(b, b)), lc = std::sqrt(dot(c, c));
    const double below = la * lb * lc + dot(a, b) * lc + dot(b, c) * la + dot(c, a) * lb, above = dot(a, cross(b, c));
    if (!(below > 0)) {
      sum_ += std::atan2(above, below);
      return;
    }
    // Both angles are below a quarter turn, so that no turn is lost.
    const double real = real_ * below - imaginary_ * above;
    imaginary_ = real_ * above + imaginary_ * below;
    real_ = real;
    if (!(real_ > 0)) take_product();
  }
  double sum() {
    take_product();
    return sum_;
  }

 private:
  void take_product() {
    sum_ += std::atan2(imaginary_, real_);
    real_ = 1, imaginary_ = 0;
  }

  double sum_ = 0, real_ = 1, imaginary_ = 0;
};

}  // namespace

WindingTree::WindingTree(std::span<const Triangle> triangles, const Point3& origin) {
  const auto point = [&](const Point3& p) {
    return Point{static_cast<double>(p.x) - origin.x, static_cast<double>(p.y) - origin.y, static_cast<double>(p.z) - origin.z};
  };
  facets_.reserve(triangles.size());
  for (const Triangle& t : triangles) facets_.push_back({point(t.a), point(t.b), point(t.c)});
  if (!facets_.empty()) build(0, static_cast<std::uint32_t>(facets_.size()));
}

std::uint32_t WindingTree::build(std::uint32_t begin, std::uint32_t end) {
  const auto index = static_cast<std::uint32_t>(nodes_.size());
  nodes_.push_back({});
  Node node;
  node.begin = begin, node.end = end;
  double area = 0;
  Point lo{1e30, 1e30, 1e30}, hi{-1e30, -1e30, -1e30}, middle{};
  for (std::uint32_t i = begin; i < end; ++i) {
    const Corners& f = facets_[i];
    const Point normal = cross(minus(f.b, f.a), minus(f.c, f.a));
    const double size = std::sqrt(dot(normal, normal));
    area += size;
    for (std::size_t k = 0; k < 3; ++k) {
      const double centre = (f.a[k] + f.b[k] + f.c[k]) / 3;
      node.normal[k] += normal[k] / 2;
      node.centre[k] += size * centre;
      middle[k] += centre / (end - begin);
      lo[k] = std::min(lo[k], centre), hi[k] = std::max(hi[k], centre);
    }
  }
  for (std::size_t k = 0; k < 3; ++k) node.centre[k] = area > 0 ? node.centre[k] / area : middle[k];
  for (std::uint32_t i = begin; i < end; ++i) {
    for (const Point* corner : {&facets_[i].a, &facets_[i].b, &facets_[i].c}) {
      const Point off = minus(*corner, node.centre);
      node.radius = std::max(node.radius, std::sqrt(dot(off, off)));
    }
  }
  if (end - begin > kLeaf) {
    std::size_t axis = 0;
    for (std::size_t k = 1; k < 3; ++k)
      if (hi[k] - lo[k] > hi[axis] - lo[axis]) axis = k;
    const std::uint32_t half = begin + (end - begin) / 2;
    std::nth_element(facets_.begin() + begin, facets_.begin() + half, facets_.begin() + end,
                     [&](const Corners& one, const Corners& other) {
                       return one.a[axis] + one.b[axis] + one.c[axis] < other.a[axis] + other.b[axis] + other.c[axis];
                     });
    build(begin, half);
    node.second = build(half, end);
  }
  nodes_[index] = node;
  return index;
}

double WindingTree::at(const Point& point, std::uint64_t* inspected) const {
  if (nodes_.empty()) return 0;
  double angles = 0;                      // halves of solid angles
  std::array<std::uint32_t, 64> stack{};  // halving 2^32 facets goes 32 deep
  std::size_t height = 1;
  std::uint64_t visits = 0;
  while (height > 0) {
    ++visits;
    const std::uint32_t index = stack[--height];
    const Node& node = nodes_[index];
    const Point off = minus(node.centre, point);
    const double square = dot(off, off);
    if (square > kFar * kFar * node.radius * node.radius && square > 0) {
      angles += dot(node.normal, off) / (2 * square * std::sqrt(square));
    } else if (node.second == 0) {
      visits += node.end - node.begin;
      HalfAngles of_leaf;
      for (std::uint32_t i = node.begin; i < node.end; ++i) {
        const Corners& f = facets_[i];
        of_leaf.add(minus(f.a, point), minus(f.b, point), minus(f.c, point));
      }
      angles += of_leaf.sum();
    } else {
      stack[height++] = node.second;
      stack[height++] = index + 1;
    }
  }
  if (inspected != nullptr) *inspected += visits;
  return angles / (2 * std::numbers::pi);
}

bool WindingTree::meets(const Point& lo, const Point& hi) const {
  if (nodes_.empty()) return false;
  std::array<std::uint32_t, 64> stack{};
  std::size_t height = 1;
  while (height > 0) {
    const std::uint32_t index = stack[--height];
    const Node& node = nodes_[index];
    double square = 0;  // of the distance from the box
    for (std::size_t k = 0; k < 3; ++k) {
      const double off = std::max({lo[k] - node.centre[k], node.centre[k] - hi[k], 0.0});
      square += off * off;
    }
    if (square > node.radius * node.radius * (1 + 1e-9)) continue;
    for (std::uint32_t i = node.begin; node.second == 0 && i < node.end; ++i) {
      const Corners& f = facets_[i];
      bool apart = false;
      for (std::size_t k = 0; k < 3; ++k)
        apart = apart || std::max({f.a[k], f.b[k], f.c[k]}) < lo[k] || std::min({f.a[k], f.b[k], f.c[k]}) > hi[k];
      if (!apart) return true;
    }
    if (node.second == 0) continue;
    stack[height++] = node.second;
    stack[height++] = index + 1;
  }
  return false;
}

namespace {

constexpr int kBlock = 8, kHalvings = 4;

/// Corners of a cell by the bits x, y, z; six tetrahedra around its diagonal, which neighbours cut alike.
constexpr std::array<std::array<int, 4>, 6> kTetrahedra{
    {{0, 1, 3, 7}, {0, 3, 2, 7}, {0, 2, 6, 7}, {0, 6, 4, 7}, {0, 4, 5, 7}, {0, 5, 1, 7}}};

class LevelGrid {
 public:
  LevelGrid(const Mesh& mesh, int cells) : mesh_(mesh), tree_({mesh.triangles.data(), mesh.triangles.size()}, mesh.bounds.lo) {
    const std::array<double, 3> size{static_cast<double>(mesh.bounds.width()), static_cast<double>(mesh.bounds.depth()),
                                     static_cast<double>(mesh.bounds.height())};
    cell_ = std::max(1.0, std::max({size[0], size[1], size[2]}) / cells);
    for (std::size_t k = 0; k < 3; ++k) {
      // A cell of air on both sides, and whole blocks; off the facets of parts that lie along the axes.
      blocks_[k] = static_cast<int>((size[k] / cell_ + 2.5) / kBlock) + 1;
      points_[k] = blocks_[k] * kBlock + 1;
    }
    value_.resize(static_cast<std::size_t>(points_[0]) * points_[1] * points_[2]);
    fill();
  }

  double cell_nm() const { return cell_; }

  Buffer<Triangle> surface() const {
    Buffer<std::array<CubeEdge, 3>> facets;
    Buffer<CubeEdge> edges;
    for (int z = 0; z + 1 < points_[2]; ++z) {
      for (int y = 0; y + 1 < points_[1]; ++y) {
        for (int x = 0; x + 1 < points_[0]; ++x) {
          cut_cell(index(x, y, z), [&](const CubeEdge& p, const CubeEdge& q, const CubeEdge& r) {
            facets.push_back({p, q, r});
            edges.push_back(p), edges.push_back(q), edges.push_back(r);
          });
        }
      }
    }
    tbb::parallel_sort(edges.begin(), edges.end());
    edges.erase(std::unique(edges.begin(), edges.end()), edges.end());
    Buffer<Point3> vertex(edges.size());
    tbb::parallel_for(std::size_t{0}, edges.size(), [&](std::size_t i) { vertex[i] = crossing(edges[i]); });
    Buffer<Triangle> triangles;
    triangles.reserve(facets.size() + kTriangleSlack);
    triangles.resize(facets.size());
    tbb::parallel_for(std::size_t{0}, facets.size(), [&](std::size_t i) {
      const auto at = [&](const CubeEdge& edge) {
        return vertex[static_cast<std::size_t>(std::lower_bound(edges.begin(), edges.end(), edge) - edges.begin())];
      };
      triangles[i] = {at(facets[i][0]), at(facets[i][1]), at(facets[i][2])};
    });
    return triangles;
  }

 private:
  std::size_t index(int x, int y, int z) const { return (static_cast<std::size_t>(z) * points_[1] + y) * points_[0] + x; }
  Point point_at(std::size_t at) const {
    const auto width = static_cast<std::size_t>(points_[0]), depth = static_cast<std::size_t>(points_[1]);
    const auto nm = [&](std::size_t i) { return (static_cast<double>(i) - 1.2371) * cell_; };
    return {nm(at % width), nm(at / width % depth), nm(at / width / depth)};
  }
  /// Above 0 inside.
  float level(const Point& p) const { return static_cast<float>(std::fabs(tree_.at(p)) - 0.5); }
  bool at_rim(int x, int y, int z) const {
    return x == 0 || y == 0 || z == 0 || x == points_[0] - 1 || y == points_[1] - 1 || z == points_[2] - 1;
  }
  std::size_t block_index(int x, int y, int z) const { return (static_cast<std::size_t>(z) * blocks_[1] + y) * blocks_[0] + x; }

  struct CubeEdge {
    std::uint64_t from;  // index of the corner with fewer bits
    std::uint32_t code;  // bits that its other end has more
    bool operator<(const CubeEdge& other) const { return from != other.from ? from < other.from : code < other.code; }
    bool operator==(const CubeEdge&) const = default;
  };
  std::size_t corner(std::size_t first, int bits) const {
    return first + (bits & 1) + (bits & 2 ? points_[0] : 0) +
           (bits & 4 ? static_cast<std::size_t>(points_[0]) * points_[1] : 0);
  }

  /// Blocks that a facet may run through: its box meets the block, and so does its plane.
  Buffer<std::uint8_t> blocks_with_facets() const {
    Buffer<std::uint8_t> meets(static_cast<std::size_t>(blocks_[0]) * blocks_[1] * blocks_[2], std::uint8_t{0});
    const double width = kBlock * cell_, reach = std::sqrt(3.0) / 2 * (width + 2 * cell_);
    for (const Triangle& t : mesh_.triangles) {
      std::array<Point, 3> p{};
      for (std::size_t i = 0; const Point3& corner : {t.a, t.b, t.c}) {
        p[i++] = {static_cast<double>(corner.x) - mesh_.bounds.lo.x, static_cast<double>(corner.y) - mesh_.bounds.lo.y,
                  static_cast<double>(corner.z) - mesh_.bounds.lo.z};
      }
      std::array<int, 3> lo{}, hi{};
      for (std::size_t k = 0; k < 3; ++k) {
        const auto block = [&](double nm) {
          return std::clamp(static_cast<int>((nm / cell_ + 1.2371) / kBlock), 0, blocks_[k] - 1);
        };
        lo[k] = block(std::min({p[0][k], p[1][k], p[2][k]}) - cell_);
        hi[k] = block(std::max({p[0][k], p[1][k], p[2][k]}) + cell_);
      }
      Point n{};
      for (std::size_t k = 0; k < 3; ++k) {
        const std::size_t i = (k + 1) % 3, j = (k + 2) % 3;
        n[k] = (p[1][i] - p[0][i]) * (p[2][j] - p[0][j]) - (p[1][j] - p[0][j]) * (p[2][i] - p[0][i]);
      }
      const double length = std::sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]);
      for (int z = lo[2]; z <= hi[2]; ++z) {
        for (int y = lo[1]; y <= hi[1]; ++y) {
          for (int x = lo[0]; x <= hi[0]; ++x) {
            double off = 0;
            for (std::size_t k = 0; const int at : {x, y, z}) {
              off += n[k] * (((at + 0.5) * kBlock - 1.2371) * cell_ - p[0][k]);
              ++k;
            }
            if (std::fabs(off) <= reach * length) meets[block_index(x, y, z)] = 1;
          }
        }
      }
    }
    return meets;
  }

  /// Whether the surface may pass between a block's corners.
  bool changes(int x, int y, int z) const {
    bool above = false, below = false;
    for (int bits = 0; bits < 8; ++bits) {
      const float value = value_[index((x + (bits & 1)) * kBlock, (y + (bits >> 1 & 1)) * kBlock, (z + (bits >> 2)) * kBlock)];
      above = above || value > -0.3f;
      below = below || value < 0.3f;
    }
    return above && below;
  }

  void fill() {
    const auto evaluate = [&](int x, int y, int z) {
      const std::size_t at = index(x, y, z);
      value_[at] = at_rim(x, y, z) ? -0.5f : level(point_at(at));
    };
    const auto each_block = [&](const auto& visit) {
      tbb::parallel_for(0, blocks_[0] * blocks_[1] * blocks_[2], [&](int block) {
        visit(block % blocks_[0], block / blocks_[0] % blocks_[1], block / blocks_[0] / blocks_[1]);
      });
    };
    tbb::parallel_for(0, blocks_[2] + 1, [&](int z) {
      for (int y = 0; y <= blocks_[1]; ++y)
        for (int x = 0; x <= blocks_[0]; ++x) evaluate(x * kBlock, y * kBlock, z * kBlock);
    });
    Buffer<std::uint8_t> active = blocks_with_facets();
    each_block([&](int x, int y, int z) { active[block_index(x, y, z)] |= changes(x, y, z); });
    // A block has the points of its lower sides; those of its upper sides belong to its neighbours, and are near facets as
    // well if it is. A quiet block is all inside or all outside, as its first corner.
    const auto near_active = [&](int x, int y, int z, int px, int py, int pz) {
      for (int bits = 0; bits < 8; ++bits) {
        const int bx = x - (bits & 1), by = y - (bits >> 1 & 1), bz = z - (bits >> 2);
        if ((bx < x && px > 0) || (by < y && py > 0) || (bz < z && pz > 0) || bx < 0 || by < 0 || bz < 0) continue;
        if (active[block_index(bx, by, bz)]) return true;
      }
      return false;
    };
    each_block([&](int x, int y, int z) {
      const float first = value_[index(x * kBlock, y * kBlock, z * kBlock)];
      const auto last = [&](int at, int count) { return at + 1 == count ? kBlock : kBlock - 1; };
      for (int pz = 0; pz <= last(z, blocks_[2]); ++pz) {
        for (int py = 0; py <= last(y, blocks_[1]); ++py) {
          for (int px = 0; px <= last(x, blocks_[0]); ++px) {
            if (px % kBlock == 0 && py % kBlock == 0 && pz % kBlock == 0) continue;  // is known, and read by others
            const int gx = x * kBlock + px, gy = y * kBlock + py, gz = z * kBlock + pz;
            if (near_active(x, y, z, px, py, pz)) {
              evaluate(gx, gy, gz);
            } else {
              value_[index(gx, gy, gz)] = at_rim(gx, gy, gz) ? -0.5f : first;
            }
          }
        }
      }
    });
  }

  /// Calls emit(three edges) for each triangle of a cell, outward.
  template <class Emit>
  void cut_cell(std::size_t first, const Emit& emit) const {
    std::array<bool, 8> inside{};
    int count = 0;
    for (int bits = 0; bits < 8; ++bits) count += inside[static_cast<std::size_t>(bits)] = value_[corner(first, bits)] > 0;
    if (count == 0 || count == 8) return;
    const auto edge = [&](int one, int other) {
      return CubeEdge{corner(first, one & other),
                      static_cast<std::uint32_t>(one ^ other)};  // one's bits are a subset of the other's
    };
    for (const auto& [a, b, c, d] : kTetrahedra) {
      std::array<int, 4> in{}, out{};
      std::size_t ins = 0, outs = 0;
      for (const int v : {a, b, c, d}) (inside[static_cast<std::size_t>(v)] ? in[ins++] : out[outs++]) = v;
      if (ins == 0 || outs == 0) continue;
      // Whether the corners in the order inside, then outside, are an even permutation of the tetrahedron's.
      const std::array<int, 4> order{a, b, c, d};
      std::array<std::size_t, 4> position{};
      for (std::size_t i = 0; i < 4; ++i)
        position[i] =
            static_cast<std::size_t>(std::find(order.begin(), order.end(), i < ins ? in[i] : out[i - ins]) - order.begin());
      bool even = true;
      for (std::size_t i = 0; i < 4; ++i)
        for (std::size_t j = i + 1; j < 4; ++j) even ^= position[i] > position[j];
      const auto facet = [&](const CubeEdge& p, const CubeEdge& q, const CubeEdge& r) { even ? emit(p, q, r) : emit(p, r, q); };
      if (ins == 1) {
        facet(edge(in[0], out[0]), edge(in[0], out[1]), edge(in[0], out[2]));
      } else if (ins == 3) {
        facet(edge(in[0], out[0]), edge(in[1], out[0]), edge(in[2], out[0]));
      } else {
        facet(edge(in[0], out[0]), edge(in[0], out[1]), edge(in[1], out[1]));
        facet(edge(in[0], out[0]), edge(in[1], out[1]), edge(in[1], out[0]));
      }
    }
  }

  /// Where an edge of the grid leaves the solid, by halving it.
  Point3 crossing(const CubeEdge& edge) const {
    const std::size_t other = corner(edge.from, static_cast<int>(edge.code));
    Point in = point_at(edge.from), out = point_at(other);
    if (value_[edge.from] <= 0) std::swap(in, out);
    Point middle{};
    for (int i = 0; i <= kHalvings; ++i) {
      for (std::size_t k = 0; k < 3; ++k) middle[k] = (in[k] + out[k]) / 2;
      if (i == kHalvings) break;
      (level(middle) > 0 ? in : out) = middle;
    }
    const auto nm = [](double off, Nm lo) { return static_cast<Nm>(std::llround(off) + lo); };
    return {nm(middle[0], mesh_.bounds.lo.x), nm(middle[1], mesh_.bounds.lo.y), nm(middle[2], mesh_.bounds.lo.z)};
  }

  const Mesh& mesh_;
  WindingTree tree_;
  double cell_ = 1;
  std::array<int, 3> blocks_{}, points_{};
  Buffer<float> value_;
};

}  // namespace

double remesh(Mesh& mesh, int cells) {
  const LevelGrid grid(mesh, cells);
  mesh.triangles = grid.surface();
  mesh.repaired_from = static_cast<std::uint32_t>(mesh.triangles.size());
  mesh.bounds = {};
  for (const Triangle& t : mesh.triangles) mesh.bounds.add(t.a), mesh.bounds.add(t.b), mesh.bounds.add(t.c);
  return grid.cell_nm() / 1e6;
}

}  // namespace lamina::load
