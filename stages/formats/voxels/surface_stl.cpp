#include "stages/formats/voxels/surface_stl.h"

#include <fmt/format.h>

#include <array>
#include <cmath>
#include <cstring>

#include "stages/formats/voxels/image.h"  // kMark

namespace lamina::formats::voxels {
namespace {

constexpr std::size_t kFacet = 50, kFacetsAtOnce = 4096;  // bytes, facets
constexpr double kPart = 1.0 / 64;                        // of a voxel: how far the middles of a parted edge move

using Step = std::array<int, 3>;
using GridPoint = std::array<double, 3>;  // in voxels

Step operator+(const Step& a, const Step& b) { return {a[0] + b[0], a[1] + b[1], a[2] + b[2]}; }

/// The rows around one, a voxel longer at both ends: outside of the box nothing is set.
class Neighbours {
 public:
  Neighbours(const VoxelView& box, VoxelPhase side) : box_(box), side_(side), stride_(std::size_t{box.nx} + 2) {
    for (auto& bytes : row_) bytes.assign(stride_, 0);
  }
  /// Goes to a row; three of the nine are known if it follows the one before.
  void go(std::uint32_t y, std::uint32_t z) {
    const bool follows = z == z_ && y == y_ + 1 && y > 0;
    y_ = y, z_ = z;
    for (int k = -1; k <= 1; ++k) {
      if (follows) {
        row_[at(-1, k)].swap(row_[at(0, k)]);
        row_[at(0, k)].swap(row_[at(1, k)]);
      }
      for (int j = follows ? 1 : -1; j <= 1; ++j) fill(j, k);
    }
  }
  bool set(std::uint32_t x, const Step& step) const {
    return row_[at(step[1], step[2])][static_cast<std::size_t>(std::int64_t{x} + 1 + step[0])] != 0;
  }

 private:
  static std::size_t at(int j, int k) { return static_cast<std::size_t>(3 * (k + 1) + j + 1); }
  void fill(int j, int k) {
    const std::int64_t y = std::int64_t{y_} + j, z = std::int64_t{z_} + k;
    auto& bytes = row_[at(j, k)];
    if (y < 0 || z < 0 || y >= box_.ny || z >= box_.nz) {
      std::ranges::fill(bytes, std::uint8_t{0});
      return;
    }
    expand_row(box_.row(static_cast<std::uint32_t>(y), static_cast<std::uint32_t>(z)), side_,
               std::span(bytes).subspan(1, box_.nx));
  }

  const VoxelView box_;
  VoxelPhase side_;
  std::size_t stride_;
  std::uint32_t y_ = UINT32_MAX, z_ = UINT32_MAX;
  std::array<Buffer<std::uint8_t>, 9> row_;
};

/// A face of a voxel: its normal, and the four steps to its edges, counter-clockwise viewed from outside.
struct Face {
  Step normal;
  std::array<Step, 4> edge;
};

std::array<Face, 6> make_faces() {
  std::array<Face, 6> faces{};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    for (std::size_t upper = 0; upper < 2; ++upper) {
      Face& face = faces[2 * axis + upper];
      face.normal[axis] = upper == 1 ? 1 : -1;
      const std::size_t u = (axis + (upper == 1 ? 1 : 2)) % 3, v = 3 - axis - u;
      face.edge[0][u] = face.edge[1][v] = 1;
      face.edge[2][u] = face.edge[3][v] = -1;
    }
  }
  return faces;
}

/// Whether the voxel beyond the edge in direction normal + edge meets this one in that edge alone.
bool is_parted(const Neighbours& near, std::uint32_t x, const Face& face, std::size_t edge) {
  return !near.set(x, face.edge[edge]) && near.set(x, face.normal + face.edge[edge]);
}

/// The corners of a face, one after the other, with the middles of parted edges between them.
struct Ring {
  std::array<GridPoint, 8> position;
  std::size_t count = 0;
};

Ring ring_of(const GridPoint& middle, const Face& face, std::uint32_t parted) {
  Ring ring;
  for (std::size_t e = 0; e < 4; ++e) {
    const Step &here = face.edge[e], &next = face.edge[(e + 1) % 4];
    GridPoint corner = middle, bent = middle;
    // Of the two axes across the edge, it moves inwards along the one and outwards along the other.
    std::size_t across = 0;
    for (std::size_t a = 0; a < 3; ++a) {
      corner[a] += 0.5 * (face.normal[a] + here[a] + next[a]);
      const int out = face.normal[a] + here[a];
      if (out != 0) bent[a] += out * (0.5 + (across++ == 0 ? -kPart : kPart));
    }
    if ((parted >> e & 1) != 0) ring.position[ring.count++] = bent;
    ring.position[ring.count++] = corner;
  }
  return ring;
}

/// Facets on their way into a file.
class FacetSink {
 public:
  FacetSink(File& file, const VoxelView& box) : file_(file) {
    for (std::size_t a = 0; a < 3; ++a) edge_mm_[a] = mm(box.edge[a]);
    piece_.reserve(kFacetsAtOnce * kFacet);
  }
  void add(const GridPoint& a, const GridPoint& b, const GridPoint& c) {
    std::array<float, 12> number{};
    const GridPoint* const corner[] = {&a, &b, &c};
    for (std::size_t k = 0; k < 9; ++k) number[3 + k] = static_cast<float>((*corner[k / 3])[k % 3] * edge_mm_[k % 3]);
    GridPoint u{}, v{};
    for (std::size_t i = 0; i < 3; ++i) u[i] = (b[i] - a[i]) * edge_mm_[i], v[i] = (c[i] - a[i]) * edge_mm_[i];
    const GridPoint n{u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]};
    const double length = std::hypot(n[0], n[1], n[2]);
    for (std::size_t i = 0; i < 3; ++i) number[i] = static_cast<float>(n[i] / length);
    const std::size_t at = piece_.size();
    piece_.resize(at + kFacet);
    std::memcpy(piece_.data() + at, number.data(), sizeof number);
    std::memset(piece_.data() + at + sizeof number, 0, kFacet - sizeof number);
    if (piece_.size() >= kFacetsAtOnce * kFacet) hand_over();
  }
  Status finish() {
    hand_over();
    return status_;
  }

 private:
  void hand_over() {
    if (status_) status_ = file_.append(piece_);
    piece_.clear();
  }

  File& file_;
  GridPoint edge_mm_{};
  Buffer<char> piece_;
  Status status_;
};

/// Calls take(x, y, z, face, bits of parted edges) for each face, in the order of voxels.
template <class Take>
void for_each_face(const VoxelView& box, VoxelPhase side, const Take& take) {
  const std::array<Face, 6> faces = make_faces();
  Neighbours near(box, side);
  for (std::uint32_t z = 0; z < box.nz; ++z) {
    for (std::uint32_t y = 0; y < box.ny; ++y) {
      near.go(y, z);
      for (std::uint32_t x = 0; x < box.nx; ++x) {
        if (!near.set(x, {})) continue;
        for (const Face& face : faces) {
          if (near.set(x, face.normal)) continue;
          std::uint32_t parted = 0;
          for (std::size_t e = 0; e < 4; ++e) parted |= is_parted(near, x, face, e) ? 1u << e : 0u;
          take(x, y, z, face, parted);
        }
      }
    }
  }
}

std::uint32_t bits(std::uint32_t parted) { return (parted & 1) + (parted >> 1 & 1) + (parted >> 2 & 1) + (parted >> 3 & 1); }

}  // namespace

SurfaceCounts count_surface(const VoxelView& box, VoxelPhase side) {
  SurfaceCounts counts;
  std::uint64_t detected = 0;  // each parted edge from four faces
  for_each_face(box, side, [&](auto, auto, auto, const Face&, std::uint32_t parted) {
    counts.facets += parted == 0 ? 2 : 4 + bits(parted);
    detected += bits(parted);
  });
  counts.parted_edges = detected / 4;
  return counts;
}

Result<SurfaceCounts> write_surface(File& file, const VoxelView& box, VoxelPhase side, std::string_view version) {
  const SurfaceCounts counts = count_surface(box, side);
  if (counts.facets == 0) return Error{Fault::kInput, "nothing of this kind is in the window, so that it has no surface"};
  if (counts.facets > UINT32_MAX) {
    return Error{Fault::kInput, fmt::format("{} facets are more than an STL file counts; take larger voxels", counts.facets)};
  }
  // A header that begins with "solid" would be taken for ASCII.
  std::string head = fmt::format("surface of voxels, {} {}; binary STL, mm", kMark, version);
  head.resize(80, ' ');
  const auto count = static_cast<std::uint32_t>(counts.facets);
  head.append(reinterpret_cast<const char*>(&count), sizeof count);
  if (Status status = file.append(head); !status) return status.error();
  FacetSink sink(file, box);
  for_each_face(box, side, [&](std::uint32_t x, std::uint32_t y, std::uint32_t z, const Face& face, std::uint32_t parted) {
    const GridPoint middle{x + 0.5, y + 0.5, z + 0.5};
    const Ring ring = ring_of(middle, face, parted);
    if (parted == 0) {
      sink.add(ring.position[0], ring.position[1], ring.position[2]);
      sink.add(ring.position[0], ring.position[2], ring.position[3]);
      return;
    }
    GridPoint centre = middle;
    for (std::size_t a = 0; a < 3; ++a) centre[a] += 0.5 * face.normal[a];
    for (std::size_t i = 0; i < ring.count; ++i) sink.add(centre, ring.position[i], ring.position[(i + 1) % ring.count]);
  });
  if (Status status = sink.finish(); !status) return status.error();
  return counts;
}

}  // namespace lamina::formats::voxels
