// stages/checks/united.h: what the solids of a group hold together, computed once for groups that are copies of each other.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <span>
#include <vector>

#include "stages/checks/tally.h"
#include "stages/data/mesh.h"
#include "stages/data/status.h"

namespace lamina::sanity {

/// Not thread-safe.
class United {
 public:
  /// What instances hold together, mm3; 0 if that is not known.
  using Volume = std::function<Result<double>(std::span<const Mesh>, std::span<const Instance>)>;
  /// Reads the meshes again.
  using Again = std::function<Result<std::vector<Mesh>>()>;

  /// meshes  of the job; only their fingerprints are looked at if `again` is given. Must outlive this object
  /// solids  one for each instance; both must outlive this object
  /// again   where the triangles of the meshes are gone: asked once, when the first volume is
  United(std::span<const Mesh> meshes, std::span<const Instance> instances, std::span<const Solid> solids, Volume volume,
         Again again = {});

  /// errors  of `again` and `volume`; kInput: a mesh of the group has changed since
  /// cost    `volume` once for all groups that hold the same meshes in the same places relative to each other
  Result<double> mm3(std::uint32_t group);

 private:
  using Key = std::vector<std::array<std::int64_t, 4>>;  // mesh, and x, y, z from the first
  static Key key_of(std::span<const Instance> members);
  Result<double> compute(std::span<const Instance> members);

  std::span<const Mesh> meshes_;
  Volume volume_;
  Again again_;
  std::vector<std::vector<Instance>> members_;  // by group
  std::optional<Result<std::vector<Mesh>>> reread_;
  std::map<Key, Result<double>> known_;
};

}  // namespace lamina::sanity
