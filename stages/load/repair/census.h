// stages/load/repair/census.h: the sums of a census, for readers that see a mesh piece by piece; internal to load.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "stages/data/mesh.h"

namespace lamina::load {

/// Sums over facets that do not depend on their order.
struct CensusSums {
  std::uint64_t boundary = 0;          // 0: every edge is walked as often one way as the other (Census::balanced)
  std::uint64_t fingerprint = 0;       // Census::fingerprint
  std::vector<std::uint64_t> sampled;  // facets without their orientation, which is the lowest bit

  /// share  of sampled_share()
  void add(std::span<const Triangle> facets, std::uint64_t share);
  void add(const CensusSums& other);
};

/// Which share of a mesh's facets is sampled, for CensusSums::add(). triangles  of the whole mesh
std::uint64_t sampled_share(std::size_t triangles);

/// Whether two of the sampled facets differ in orientation alone (Census::reversed_twins).
bool any_reversed(std::span<const std::uint64_t> sampled);

/// Six times the signed volume of the prisms between facets and a level plane, nm3, and twice their signed area projected
/// along z, nm2, by which the volume changes where the plane is another: sums of pieces that were taken at planes of their own.
struct Prisms {
  double sixfold_volume = 0, doubled_shadow = 0;
  Nm plane = 0;  // within the facets or near them, so that little cancels out

  double sixfold_volume_above(Nm other) const {
    return sixfold_volume + 3 * (static_cast<double>(plane) - other) * doubled_shadow;
  }
};

}  // namespace lamina::load
