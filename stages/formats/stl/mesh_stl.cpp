#include "stages/formats/stl/mesh_stl.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstring>

#include "stages/geometry/blocks/mesh_blocks.h"

namespace lamina::formats::stl {
namespace {

constexpr std::size_t kHeader = 80, kFacet = 50, kPiece = 4096;  // bytes, bytes, facets
using Vector = std::array<double, 3>;

Vector normal_of(const std::array<Vector, 3>& corner) {
  Vector u{}, v{};
  for (int i = 0; i < 3; ++i) u[i] = corner[1][i] - corner[0][i], v[i] = corner[2][i] - corner[0][i];
  Vector n{u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]};
  const double length = std::hypot(n[0], n[1], n[2]);
  for (double& part : n) part = length > 0 ? part / length : 0;
  return n;
}

/// Appends a facet's 50 bytes; little-endian, as this program's hosts are. rounding  grows, mm
void put_facet(const Triangle& t, const Point3& by, Buffer<char>& out, double& rounding) {
  std::array<Vector, 3> corner{};
  std::array<float, 12> number{};
  const Point3* const points[] = {&t.a, &t.b, &t.c};
  for (std::size_t c = 0; c < 3; ++c) {
    corner[c] = {mm(std::int64_t{points[c]->x} + by.x), mm(std::int64_t{points[c]->y} + by.y),
                 mm(std::int64_t{points[c]->z} + by.z)};
    for (std::size_t i = 0; i < 3; ++i) {
      number[3 + 3 * c + i] = static_cast<float>(corner[c][i]);
      rounding = std::max(rounding, std::abs(static_cast<double>(number[3 + 3 * c + i]) - corner[c][i]));
    }
  }
  const Vector normal = normal_of(corner);
  for (std::size_t i = 0; i < 3; ++i) number[i] = static_cast<float>(normal[i]);
  const std::size_t at = out.size();
  out.resize(at + kFacet);
  std::memcpy(out.data() + at, number.data(), sizeof number);
  std::memset(out.data() + at + sizeof number, 0, kFacet - sizeof number);
}

}  // namespace

Result<StlCounts> write_stl(File& file, std::span<const Mesh> meshes, std::span<const Instance> instances,
                            std::string_view program) {
  StlCounts counts;
  for (const Instance& instance : instances) counts.triangles += triangle_count(meshes[instance.mesh]);
  if (counts.triangles > UINT32_MAX) {
    return Error{Fault::kInput, fmt::format("{} triangles are more than an STL file counts; write .3mf", counts.triangles)};
  }
  // A header that begins with "solid" would be taken for ASCII.
  std::string header = fmt::format("{}; binary STL, mm", program);
  header.resize(kHeader, ' ');
  const auto count = static_cast<std::uint32_t>(counts.triangles);
  header.append(reinterpret_cast<const char*>(&count), sizeof count);
  if (Status status = file.append(std::string_view(header)); !status) return status.error();
  Buffer<char> piece;
  piece.reserve(kPiece * kFacet);
  const auto put = [&](std::span<const Triangle> triangles, const Point3& by) -> Status {
    for (const Triangle& triangle : triangles) {
      put_facet(triangle, by, piece, counts.rounding_mm);
      if (piece.size() < kPiece * kFacet) continue;
      if (Status status = file.append(piece); !status) return status;
      piece.clear();
    }
    return {};
  };
  Buffer<Triangle> scratch;
  for (const Instance& instance : instances) {
    const Mesh& mesh = meshes[instance.mesh];
    Status status;
    each_listed(mesh, 0, triangle_count(mesh), scratch, [&](std::span<const Triangle> facets) {
      if (status) status = put(facets, instance.offset);
    });
    if (!status) return status.error();
  }
  if (Status status = file.append(piece); !status) return status.error();
  return counts;
}

std::string block(const std::array<double, 3>& size) {
  std::string bytes(80, ' ');
  const auto put = [&](const auto& value) { bytes.append(reinterpret_cast<const char*>(&value), sizeof value); };
  put(std::uint32_t{12});
  for (int axis = 0; axis < 3; ++axis) {
    for (int side = 0; side < 2; ++side) {
      // The four corners of a side, anticlockwise viewed from outside.
      const int u = (axis + 1) % 3, v = (axis + 2) % 3;
      std::array<std::array<float, 3>, 4> corner{};
      for (int i = 0; i < 4; ++i) {
        const bool at_u = i == 1 || i == 2, at_v = i >= 2;
        corner[i][axis] = static_cast<float>(side * size[axis]);
        corner[i][side == 1 ? u : v] = static_cast<float>(at_u ? size[side == 1 ? u : v] : 0);
        corner[i][side == 1 ? v : u] = static_cast<float>(at_v ? size[side == 1 ? v : u] : 0);
      }
      for (const auto& triangle : {std::array{0, 1, 2}, {0, 2, 3}}) {
        put(std::array<float, 3>{});
        for (const int i : triangle) put(corner[i]);
        put(std::uint16_t{0});
      }
    }
  }
  return bytes;
}

}  // namespace lamina::formats::stl
