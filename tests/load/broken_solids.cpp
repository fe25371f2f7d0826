// tests/load/broken_solids.cpp: solids, and ways to break them.
#include <cmath>
#include <map>
#include <numbers>

#include "tests/load/broken_files.h"

namespace lamina::test {
namespace {

struct Vec {
  double x, y, z;
};

FloatTriangle facet_of(const Vec& a, const Vec& b, const Vec& c) {
  return {static_cast<float>(a.x), static_cast<float>(a.y), static_cast<float>(a.z),
          static_cast<float>(b.x), static_cast<float>(b.y), static_cast<float>(b.z),
          static_cast<float>(c.x), static_cast<float>(c.y), static_cast<float>(c.z)};
}
Vec corner(const FloatTriangle& f, std::size_t k) { return {f[3 * k], f[3 * k + 1], f[3 * k + 2]}; }
Vec middle(const Vec& a, const Vec& b, double at = 0.5) {
  return {a.x + at * (b.x - a.x), a.y + at * (b.y - a.y), a.z + at * (b.z - a.z)};
}
Vec normal(const FloatTriangle& f) {
  const Vec a = corner(f, 0), b = corner(f, 1), c = corner(f, 2);
  const Vec u{b.x - a.x, b.y - a.y, b.z - a.z}, v{c.x - a.x, c.y - a.y, c.z - a.z};
  const Vec n{u.y * v.z - u.z * v.y, u.z * v.x - u.x * v.z, u.x * v.y - u.y * v.x};
  const double length = std::sqrt(n.x * n.x + n.y * n.y + n.z * n.z);
  return length > 0 ? Vec{n.x / length, n.y / length, n.z / length} : Vec{0, 0, 0};
}
double chance(Random& random) { return static_cast<double>(random() >> 5) / static_cast<double>(1u << 27); }

/// A grid of points closed in both directions, or in one with poles, as facets outward.
Facets revolved(const std::vector<std::array<double, 2>>& profile, int steps, bool closed) {
  Facets facets;
  const auto at = [&](std::size_t i, int j) {
    const double angle = 2 * std::numbers::pi * (j % steps) / steps;
    return Vec{profile[i][0] * std::cos(angle), profile[i][0] * std::sin(angle), profile[i][1]};
  };
  const std::size_t count = profile.size();
  for (std::size_t i = 0; i + (closed ? 0 : 1) < count; ++i) {
    const std::size_t next = (i + 1) % count;
    for (int j = 0; j < steps; ++j) {
      if (profile[i][0] > 0) facets.push_back(facet_of(at(i, j), at(i, j + 1), at(next, j)));
      if (profile[next][0] > 0) facets.push_back(facet_of(at(i, j + 1), at(next, j + 1), at(next, j)));
    }
  }
  return facets;
}

}  // namespace

Facets ball(float radius, int steps) {
  std::vector<std::array<double, 2>> profile;
  for (int i = 0; i <= steps; ++i) {
    const double angle = std::numbers::pi * i / steps;
    const bool pole = i == 0 || i == steps;
    profile.push_back({pole ? 0.0 : radius * std::sin(angle), -radius * std::cos(angle)});
  }
  return revolved(profile, 2 * steps, false);
}

Facets ring(float large, float small, int steps) {
  std::vector<std::array<double, 2>> profile;
  for (int i = 0; i < steps; ++i) {
    const double angle = 2 * std::numbers::pi * i / steps;
    profile.push_back({large + small * std::cos(angle), small * std::sin(angle)});
  }
  return revolved(profile, 2 * steps, true);
}

Facets tube(float outer, float inner, float height, int steps) {
  return revolved({{inner, 0}, {outer, 0}, {outer, height}, {inner, height}}, steps, true);
}

Facets cup(float outer, float wall, float height, int steps) {
  return revolved({{0, 0}, {outer, 0}, {outer, height}, {outer - wall, height}, {outer - wall, wall}, {0, wall}}, steps, false);
}

Facets stairs(int steps) {
  Facets facets;
  const auto add = [&](const Vec& a, const Vec& b, const Vec& c, const Vec& d) {
    facets.push_back(facet_of(a, b, c));
    facets.push_back(facet_of(a, c, d));
  };
  const double depth = 8;
  for (int i = 0; i < steps; ++i) {
    const double x = 4.0 * i, next = x + 4, top = 3.0 * (steps - i);
    for (int level = 0; level < steps - i; ++level) {
      const double lo = 3.0 * level, hi = lo + 3;
      add({x, 0, lo}, {next, 0, lo}, {next, 0, hi}, {x, 0, hi});
      add({x, depth, lo}, {x, depth, hi}, {next, depth, hi}, {next, depth, lo});
      if (i == 0) add({0, 0, lo}, {0, 0, hi}, {0, depth, hi}, {0, depth, lo});
    }
    add({x, 0, 0}, {x, depth, 0}, {next, depth, 0}, {next, 0, 0});
    add({x, 0, top}, {next, 0, top}, {next, depth, top}, {x, depth, top});
    add({next, 0, top - 3}, {next, depth, top - 3}, {next, depth, top}, {next, 0, top});
  }
  return facets;
}

Facets subdivided(const Facets& facets, int times) {
  if (times == 0) return facets;
  Facets finer;
  for (const FloatTriangle& f : facets) {
    const Vec a = corner(f, 0), b = corner(f, 1), c = corner(f, 2), ab = middle(a, b), bc = middle(b, c), ca = middle(c, a);
    for (const FloatTriangle& part : {facet_of(a, ab, ca), facet_of(ab, b, bc), facet_of(ca, bc, c), facet_of(ab, bc, ca)})
      finer.push_back(part);
  }
  return subdivided(finer, times - 1);
}

Facets corpus_part(const std::string& file) {
  static std::map<std::string, Facets> known;
  Facets& facets = known[file];
  if (!facets.empty()) return facets;
  load::LoadOptions options;
  options.repair = false;
  for (const Triangle& t : placed(loaded(corpus(file), options))) {
    FloatTriangle facet{};
    std::size_t k = 0;
    for (const Point3& p : {t.a, t.b, t.c})
      for (const Nm x : {p.x, p.y, p.z}) facet[k++] = static_cast<float>(x * 1e-6);
    facets.push_back(facet);
  }
  return facets;
}

Facets joined(Facets one, const Facets& other) {
  one.insert(one.end(), other.begin(), other.end());
  return one;
}

Facets moved(Facets facets, float x, float y, float z) {
  for (FloatTriangle& f : facets)
    for (std::size_t k = 0; k < 9; k += 3) f[k] += x, f[k + 1] += y, f[k + 2] += z;
  return facets;
}

Facets scaled(Facets facets, float factor) {
  for (FloatTriangle& f : facets)
    for (float& x : f) x *= factor;
  return facets;
}

Facets jittered(Facets facets, Random& random, double um) {
  for (FloatTriangle& f : facets)
    for (float& x : f) x = static_cast<float>(static_cast<double>(x) + um * 1e-3 * (2 * chance(random) - 1));
  return facets;
}

Facets without(const Facets& facets, Random& random, double share) {
  Facets left;
  for (const FloatTriangle& f : facets)
    if (chance(random) >= share) left.push_back(f);
  if (left.size() == facets.size()) left.pop_back();
  return left;
}

Facets with_hole(const Facets& facets, Random& random, float width) {
  const Vec at = corner(facets[random() % facets.size()], 0);
  Facets left;
  for (const FloatTriangle& f : facets) {
    const Vec a = corner(f, 0);
    if (std::hypot(a.x - at.x, a.y - at.y, a.z - at.z) * 2 > static_cast<double>(width)) left.push_back(f);
  }
  return left;
}

Facets flipped(Facets facets, Random& random, double share) {
  for (FloatTriangle& f : facets)
    if (chance(random) < share) std::swap_ranges(f.begin(), f.begin() + 3, f.begin() + 3);
  return facets;
}

Facets duplicated(Facets facets, Random& random, double share) {
  const std::size_t count = facets.size();
  for (std::size_t i = 0; i < count; ++i)
    if (chance(random) < share) facets.push_back(facets[i]);
  return facets;
}

Facets inside_out(Facets facets) {
  for (FloatTriangle& f : facets) std::swap_ranges(f.begin(), f.begin() + 3, f.begin() + 3);
  return facets;
}

Facets split_sides(const Facets& facets, Random& random, double share) {
  Facets split;
  for (const FloatTriangle& f : facets) {
    const Vec a = corner(f, 0), b = corner(f, 1), c = corner(f, 2), m = middle(a, b, 0.3);
    if (chance(random) < share) {
      split.push_back(facet_of(a, m, c));
      split.push_back(facet_of(m, b, c));
    } else {
      split.push_back(f);
    }
  }
  return split;
}

Facets with_needles(const Facets& facets, Random& random, double share) {
  Facets cut;
  for (const FloatTriangle& f : facets) {
    const Vec a = corner(f, 0), b = corner(f, 1), c = corner(f, 2), m = middle(a, b, 0.002);
    if (chance(random) < share) {
      cut.push_back(facet_of(a, m, c));
      cut.push_back(facet_of(m, b, c));
      cut.push_back(facet_of(a, b, m));  // closes the side for the neighbour: without area but for rounding
    } else {
      cut.push_back(f);
    }
  }
  return cut;
}

Facets with_slivers(Facets facets, Random& random, double share) {
  const std::size_t count = facets.size();
  for (std::size_t i = 0; i < count; ++i) {
    if (chance(random) >= share) continue;
    const Vec a = corner(facets[i], 0), b = corner(facets[i], 1);
    facets.push_back(random() % 2 ? facet_of(a, b, b) : facet_of(a, a, a));
  }
  return facets;
}

Facets with_sheets(Facets facets, Random& random, int count) {
  const std::size_t solid = facets.size();
  for (int i = 0; i < count; ++i) {
    const Vec p = corner(facets[random() % solid], 1);
    const auto near = [&](double x) { return x + 4 * chance(random) - 2; };
    facets.push_back(
        facet_of({near(p.x), near(p.y), near(p.z)}, {near(p.x), near(p.y), near(p.z)}, {near(p.x), near(p.y), near(p.z)}));
  }
  return facets;
}

Facets apart(Facets facets, double um) {
  for (FloatTriangle& f : facets) {
    const Vec n = normal(f);
    for (std::size_t k = 0; k < 9; k += 3) {
      f[k] += static_cast<float>(um * 1e-3 * n.x);
      f[k + 1] += static_cast<float>(um * 1e-3 * n.y);
      f[k + 2] += static_cast<float>(um * 1e-3 * n.z);
    }
  }
  return facets;
}

double volume_by_rays(const std::vector<const Buffer<Triangle>*>& meshes, const Box& box, int rows) {
  struct Crossing {
    double x;
    int up;
  };
  std::vector<std::vector<Crossing>> lattice(static_cast<std::size_t>(rows) * rows);
  const double y0 = box.lo.y, z0 = box.lo.z, dy = static_cast<double>(box.depth()) / rows,
               dz = static_cast<double>(box.height()) / rows;
  // Rows of one height stand at as many places across as there are others, by multiples of the golden section: walls along the
  // axes are met in proportion to their thickness, however thin.
  std::vector<double> within(static_cast<std::size_t>(rows));
  for (std::size_t i = 0; i < within.size(); ++i) within[i] = std::fmod(0.5 + static_cast<double>(i) * std::numbers::phi, 1.0);
  const auto range = [&](double lo, double hi, double from, double step) {
    return std::array{std::max(0, static_cast<int>(std::floor((lo - from) / step))),
                      std::min(rows - 1, static_cast<int>(std::floor((hi - from) / step)))};
  };
  for (const Buffer<Triangle>* mesh : meshes) {
    for (const Triangle& t : *mesh) {
      const double ax = t.a.x, ay = t.a.y, az = t.a.z, bx = t.b.x, by = t.b.y, bz = t.b.z, cx = t.c.x, cy = t.c.y, cz = t.c.z;
      const double area = (by - ay) * (cz - az) - (bz - az) * (cy - ay);
      if (area == 0) continue;
      const auto ys = range(std::min({ay, by, cy}), std::max({ay, by, cy}), y0, dy);
      const auto zs = range(std::min({az, bz, cz}), std::max({az, bz, cz}), z0, dz);
      for (int j = ys[0]; j <= ys[1]; ++j) {
        for (int k = zs[0]; k <= zs[1]; ++k) {
          const double y = y0 + (j + within[static_cast<std::size_t>(k)]) * dy,
                       z = z0 + (k + within[static_cast<std::size_t>(j)]) * dz;
          const double u = ((by - y) * (cz - z) - (bz - z) * (cy - y)) / area,
                       v = ((cy - y) * (az - z) - (cz - z) * (ay - y)) / area;
          const double w = 1 - u - v;
          if (u < 0 || v < 0 || w < 0) continue;
          lattice[static_cast<std::size_t>(j) * rows + k].push_back({u * ax + v * bx + w * cx, area > 0 ? 1 : -1});
        }
      }
    }
  }
  double length = 0;
  for (auto& row : lattice) {
    std::sort(row.begin(), row.end(), [](const Crossing& one, const Crossing& other) { return one.x < other.x; });
    int winding = 0;
    for (std::size_t i = 0; i + 1 < row.size(); ++i) {
      winding += row[i].up;
      if (winding != 0) length += row[i + 1].x - row[i].x;
    }
  }
  return length * dy * dz * 1e-18;
}

}  // namespace lamina::test
