// tests/segment/cylinder.h: an upright cylinder as ASCII STL.
#pragma once

#include <array>
#include <cmath>
#include <fstream>
#include <numbers>
#include <string>

namespace lamina::test {

inline void write_cylinder(const std::string& path, double diameter, double height, int sides = 180) {
  std::ofstream file(path);
  file.precision(12);
  file << "solid cylinder\n";
  const auto facet = [&](const std::array<double, 9>& v) {
    file << "facet normal 0 0 0\nouter loop\n";
    for (int i = 0; i < 9; i += 3) file << "vertex " << v[i] << ' ' << v[i + 1] << ' ' << v[i + 2] << '\n';
    file << "endloop\nendfacet\n";
  };
  for (int i = 0; i < sides; ++i) {
    const double a = 2 * std::numbers::pi * i / sides, b = 2 * std::numbers::pi * ((i + 1) % sides) / sides, r = diameter / 2;
    const double ax = r * std::cos(a), ay = r * std::sin(a), bx = r * std::cos(b), by = r * std::sin(b);
    facet({ax, ay, 0, bx, by, 0, bx, by, height});
    facet({ax, ay, 0, bx, by, height, ax, ay, height});
    facet({0, 0, height, ax, ay, height, bx, by, height});
    facet({0, 0, 0, bx, by, 0, ax, ay, 0});
  }
  file << "endsolid cylinder\n";
}

}  // namespace lamina::test
