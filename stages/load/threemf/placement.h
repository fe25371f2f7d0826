// stages/load/threemf/placement.h: meshes of a package are snapped where they stand, copies once; internal to load.
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <utility>
#include <vector>

#include "stages/load/reader.h"
#include "stages/load/threemf/expansion.h"
#include "stages/load/threemf/model.h"

namespace lamina::load {

/// Snaps leaf after leaf. One whose vertices all snap to the places of an earlier leaf but for a whole translation shares its
/// mesh. Most need no look at their vertices: where translations differ by whole nanometres and less than it takes to round any
/// coordinate otherwise, the rest follows. A closed mesh of negative volume is turned over, with a note.
///
/// cost  a leaf that is known to be a copy: nothing; any other one: three passes over its triangles, parallel
class Placement {
 public:
  Placement(const Source& source, const ModelPackage& model, const LoadOptions& options, Package& to)
      : source_(source), model_(model), options_(options), to_(to) {}

  /// errors  kInput: a coordinate is not finite or beyond reach
  Status add(const Leaf& leaf);

 private:
  using Axes = std::array<double, 3>;
  /// One way in which the vertices of an object are snapped.
  struct Variant {
    std::size_t object;  // index in Package::objects
    Axes translation;    // nm
    Axes margin;         // nm: what may be added to every coordinate before one is rounded otherwise
    Axes reach;          // nm: bound of the terms that add up to a coordinate, translation aside
  };
  struct Turned {
    std::vector<Variant> variants;
    std::multimap<std::uint64_t, std::size_t> by_hash;  // of variants, by their triangles relative to the first corner
  };
  using Turn = std::pair<std::uint32_t, std::array<double, 9>>;  // an object and its transform but for the translation

  bool share_known(const Turned& turned, const Axes& translation);
  bool share_equal(const Turned& turned, const Facets& facets, std::uint64_t hash);
  void turn_outside_out(std::uint32_t object, Facets& facets);

  const Source& source_;
  const ModelPackage& model_;
  const LoadOptions& options_;
  Package& to_;
  std::map<Turn, Turned> turns_;
  std::vector<bool> told_;  // of objects: that they are inside out
};

}  // namespace lamina::load
