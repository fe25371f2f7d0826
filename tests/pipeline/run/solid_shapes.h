// Meshes of simple shapes for planted faults and sound parts: boxes, extruded outlines, turned profiles; cut, turned and moved.
#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <fstream>
#include <numbers>
#include <string>
#include <vector>

namespace lamina::shapes {

using Point = std::array<double, 3>;
using Outline = std::vector<std::array<double, 2>>;

/// Shells whose winding numbers add up: solids +1, cuts -1. For --fill-rule positive.
struct Shape {
  std::vector<std::array<Point, 3>> facets;

  Shape& add(const Shape& other) {
    facets.insert(facets.end(), other.facets.begin(), other.facets.end());
    return *this;
  }
  /// Only cuts that overlap no other cut outside of the solid leave exactly the rest.
  Shape& cut(const Shape& other) {
    for (auto [a, b, c] : other.facets) facets.push_back({a, c, b});
    return *this;
  }
  Shape moved(double x, double y, double z) const {
    Shape result = *this;
    for (auto& facet : result.facets) {
      for (Point& p : facet) p = {p[0] + x, p[1] + y, p[2] + z};
    }
    return result;
  }
  /// About the x (0), y (1) or z axis (2).
  Shape turned(std::size_t axis, double degrees) const {
    Shape result = *this;
    for (auto& facet : result.facets) {
      for (Point& p : facet) p = turned_point(p, axis, degrees);
    }
    return result;
  }
  static Point turned_point(Point p, std::size_t axis, double degrees) {
    const double turn = degrees * std::numbers::pi / 180;
    double &u = p[(axis + 1) % 3], &v = p[(axis + 2) % 3];
    const double old_u = u;
    u = old_u * std::cos(turn) - v * std::sin(turn);
    v = old_u * std::sin(turn) + v * std::cos(turn);
    return p;
  }
  Point lowest() const {
    Point low{1e9, 1e9, 1e9};
    for (const auto& facet : facets) {
      for (const Point& p : facet) {
        for (std::size_t k = 0; k < 3; ++k) low[k] = std::min(low[k], p[k]);
      }
    }
    return low;
  }
  void write(const std::string& path) const {
    std::ofstream file(path, std::ios::binary);
    std::string head(80, ' ');
    const auto count = static_cast<std::uint32_t>(facets.size());
    file.write(head.data(), 80).write(reinterpret_cast<const char*>(&count), 4);
    for (const auto& facet : facets) {
      std::array<float, 12> values{};
      for (std::size_t k = 0; k < 9; ++k) values[3 + k] = static_cast<float>(facet[k / 3][k % 3]);
      file.write(reinterpret_cast<const char*>(values.data()), 48).write("\0\0", 2);
    }
  }
};

/// An outline, counter-clockwise and visible from its centroid, from z = low to high, `top` times as large there.
inline Shape extruded(const Outline& outline, double low, double high, double top = 1) {
  Shape shape;
  double x = 0, y = 0;
  for (const auto& p : outline)
    x += p[0] / static_cast<double>(outline.size()), y += p[1] / static_cast<double>(outline.size());
  const auto upper = [&](const std::array<double, 2>& p) { return Point{x + top * (p[0] - x), y + top * (p[1] - y), high}; };
  for (std::size_t i = 0; i < outline.size(); ++i) {
    const auto &p = outline[i], &q = outline[(i + 1) % outline.size()];
    const Point a{p[0], p[1], low}, b{q[0], q[1], low}, c = upper(q), d = upper(p);
    shape.facets.push_back({a, b, c});
    if (top > 0) shape.facets.push_back({a, c, d});
    shape.facets.push_back({Point{x, y, low}, b, a});
    if (top > 0) shape.facets.push_back({Point{x, y, high}, d, c});
  }
  return shape;
}

inline Shape box(const Point& low, const Point& high) {
  return extruded({{low[0], low[1]}, {high[0], low[1]}, {high[0], high[1]}, {low[0], high[1]}}, low[2], high[2]);
}

inline Outline circle(double radius, double x = 0, double y = 0, int sides = 48) {
  Outline outline;
  for (int i = 0; i < sides; ++i) {
    const double turn = 2 * std::numbers::pi * i / sides;
    outline.push_back({x + radius * std::cos(turn), y + radius * std::sin(turn)});
  }
  return outline;
}

inline Shape cylinder(double radius, double low, double high, double x = 0, double y = 0, double top = 1) {
  return extruded(circle(radius, x, y), low, high, top);
}

/// A profile of points (radius, z), counter-clockwise in that plane, turned about the z axis; open ones end on the axis.
inline Shape revolved(const Outline& profile, bool closed, int sides = 64) {
  Shape shape;
  const std::size_t edges = closed ? profile.size() : profile.size() - 1;
  for (std::size_t i = 0; i < edges; ++i) {
    const auto &p = profile[i], &q = profile[(i + 1) % profile.size()];
    for (int k = 0; k < sides; ++k) {
      const double t = 2 * std::numbers::pi * k / sides, u = 2 * std::numbers::pi * (k + 1) / sides;
      const auto at = [](const std::array<double, 2>& of, double turn) {
        return Point{of[0] * std::cos(turn), of[0] * std::sin(turn), of[1]};
      };
      const Point a = at(p, t), b = at(p, u), c = at(q, u), d = at(q, t);
      if (p[0] > 0) shape.facets.push_back({a, b, c});
      if (q[0] > 0) shape.facets.push_back({a, c, d});
    }
  }
  return shape;
}

inline Shape sphere(double radius, double x, double y, double z) {
  Outline profile;
  for (int i = 0; i <= 32; ++i) {
    const double turn = std::numbers::pi * (i - 16) / 32;
    profile.push_back({i == 0 || i == 32 ? 0.0 : radius * std::cos(turn), radius * std::sin(turn)});
  }
  return revolved(profile, false).moved(x, y, z);
}

inline Shape torus(double radius, double tube) {
  Outline profile;
  for (const auto& p : circle(tube, radius, 0, 32)) profile.push_back(p);
  return revolved(profile, true);
}

}  // namespace lamina::shapes
