// stages/load/winding/winding.cpp: a tree of dipoles.
#include "stages/load/winding/winding.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace lamina::load {
namespace {

using Point = WindingTree::Point;

constexpr std::uint32_t kLeaf = 8;
constexpr double kFar = 2.5;  // distance over radius from which on a node is a dipole

Point minus(const Point& p, const Point& q) { return {p[0] - q[0], p[1] - q[1], p[2] - q[2]}; }
double product(const Point& p, const Point& q) { return p[0] * q[0] + p[1] * q[1] + p[2] * q[2]; }
Point across(const Point& p, const Point& q) {
  return {p[1] * q[2] - p[2] * q[1], p[2] * q[0] - p[0] * q[2], p[0] * q[1] - p[1] * q[0]};
}

/// Half of the solid angle of a triangle seen from the origin.
double half_angle(const Point& a, const Point& b, const Point& c) {
  const double la = std::sqrt(product(a, a)), lb = std::sqrt(product(b, b)), lc = std::sqrt(product(c, c));
  const double below = la * lb * lc + product(a, b) * lc + product(b, c) * la + product(c, a) * lb;
  return std::atan2(product(a, across(b, c)), below);
}

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
    const Point normal = across(minus(f.b, f.a), minus(f.c, f.a));
    const double size = std::sqrt(product(normal, normal));
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
      node.radius = std::max(node.radius, std::sqrt(product(off, off)));
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
    const double square = product(off, off);
    if (square > kFar * kFar * node.radius * node.radius && square > 0) {
      angles += product(node.normal, off) / (2 * square * std::sqrt(square));
    } else if (node.second == 0) {
      visits += node.end - node.begin;
      for (std::uint32_t i = node.begin; i < node.end; ++i) {
        const Corners& f = facets_[i];
        angles += half_angle(minus(f.a, point), minus(f.b, point), minus(f.c, point));
      }
    } else {
      stack[height++] = node.second;
      stack[height++] = index + 1;
    }
  }
  if (inspected != nullptr) *inspected += visits;
  return angles / (2 * std::numbers::pi);
}

}  // namespace lamina::load
