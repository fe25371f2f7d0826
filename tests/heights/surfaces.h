// tests/heights/surfaces.h: surfaces to decide layers for: files, and profiles drawn out to strips.
#pragma once

#include <gtest/gtest.h>

#include <cstdlib>
#include <deque>
#include <string>
#include <utility>
#include <vector>

#include "stages/heights/evaluate.h"
#include "stages/heights/heights.h"
#include "stages/load/load.h"

namespace lamina::heights::test {

inline Nm nm(double millimetres) { return static_cast<Nm>(std::llround(millimetres * 1e6)); }

inline ThicknessSet set_of(std::initializer_list<double> millimetres) {
  ThicknessSet set;
  for (const double value : millimetres) set.values.push_back(nm(value));
  return set;
}
inline ThicknessSet range_of(double low, double high, double step) {
  ThicknessSet set;
  for (Nm value = nm(low); value <= nm(high); value += nm(step)) set.values.push_back(value);
  return set;
}

/// A profile in x and z (mm), 10 mm deep, its outside on the right of its direction (x right, z up). Layers use slopes and
/// heights only, so it need not be closed.
inline Mesh strip(const std::vector<std::pair<double, double>>& profile) {
  Mesh mesh;
  for (std::size_t i = 0; i + 1 < profile.size(); ++i) {
    const auto [x0, z0] = profile[i];
    const auto [x1, z1] = profile[i + 1];
    const Point3 a{nm(x0), 0, nm(z0)}, b{nm(x1), 0, nm(z1)}, c{nm(x1), nm(10), nm(z1)}, d{nm(x0), nm(10), nm(z0)};
    mesh.triangles.push_back({a, c, b});
    mesh.triangles.push_back({a, d, c});
  }
  for (const Triangle& t : mesh.triangles) {
    for (const Point3& p : {t.a, t.b, t.c}) mesh.bounds.add(p);
  }
  return mesh;
}

/// Keeps meshes for as long as the tests run: an index refers to them.
inline std::span<const Mesh> kept(std::vector<Mesh> meshes) {
  static std::deque<std::vector<Mesh>> all;
  return all.emplace_back(std::move(meshes));
}

inline SurfaceIndex index_of(const Mesh& mesh, const SurfaceOptions& options = {}) {
  const Instance instance{0, {0, 0, -mesh.bounds.lo.z}};
  const std::uint32_t part = 0;
  return index_surface(kept({mesh}), std::span(&instance, 1), std::span(&part, 1), 1, options);
}

/// A file standing on the bed.
inline SurfaceIndex index_of_file(const std::string& path, const SurfaceOptions& options = {}) {
  Result<Part> part = load::load(path, {});
  EXPECT_TRUE(part.ok()) << (part.ok() ? "" : part.error().message);
  if (!part.ok()) return {};
  std::vector<Instance> instances = part->instances;
  for (Instance& instance : instances) instance.offset.z -= part->bounds.lo.z;
  const std::vector<std::uint32_t> parts(instances.size(), 0);
  return index_surface(kept(std::move(part->meshes)), instances, parts, 1, options);
}

inline std::string reference(const std::string& name) { return std::string(LAMINA_TEST_DIR) + "/reference/lima2009/" + name; }

/// A real part, or "" where the folder of models is not given.
inline std::string model(const std::string& name) {
  const char* folder = std::getenv("LAMINA_MODELS");
  return folder == nullptr ? std::string() : std::string(folder) + "/" + name;
}

/// The thicknesses of a table, mm.
inline std::vector<double> thicknesses(const LayerTable& table) {
  std::vector<double> all;
  for (std::uint32_t i = 0; i < table.size(); ++i) all.push_back(mm(table[i].thickness));
  return all;
}

}  // namespace lamina::heights::test
