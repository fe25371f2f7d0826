// stages/load/threemf/placement.h: meshes of a package are snapped where they stand, copies once; internal to load.
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <set>
#include <span>
#include <string_view>
#include <tuple>
#include <utility>
#include <vector>

#include "stages/load/threemf/expansion.h"
#include "stages/load/threemf/model.h"
#include "stages/load/threemf/threemf.h"

namespace lamina::load {

/// Snaps leaf after leaf. One whose vertices all snap to the places of an earlier leaf but for a whole translation shares its
/// mesh. Most need no look at their vertices: where translations differ by whole nanometres and less than it takes to round any
/// coordinate otherwise, the rest follows. One that is a void becomes a hollow of its container, with a note.
///
/// cost  a leaf that is known to be a copy: nothing; any other one: three passes over its triangles, parallel
class Placement {
 public:
  Placement(const Source& source, const ModelPackage& model, const LoadOptions& options, Package& to)
      : source_(source), model_(model), options_(options), to_(to) {}

  /// errors  kInput: a coordinate is not finite or beyond reach
  Status add(std::span<const Leaf> leaves);

 private:
  using Axes = std::array<double, 3>;
  /// One way in which the vertices of an object are snapped.
  struct Variant {
    std::size_t object;  // index in Package::objects
    Axes translation;    // nm
    Axes margin;         // nm: what may be added to every coordinate before one is rounded otherwise
    Axes reach;          // nm: bound of the terms that add up to a coordinate, translation aside
  };
  struct TurnedObject {
    std::vector<Variant> variants;
    std::multimap<std::uint64_t, std::size_t> by_hash;  // of variants, by their triangles relative to the first corner
  };
  /// An object, its transform but for the translation, and whether it has voids.
  using Turn = std::tuple<std::uint32_t, std::array<double, 9>, bool>;

  Status add_solid(const Leaf& leaf);
  Status add_hollow(const Leaf& leaf, std::span<const Leaf> leaves, std::span<const std::uint32_t> voids);
  bool share_known(const TurnedObject& turned, const Axes& translation);
  bool share_equal(const TurnedObject& turned, const Facets& facets, std::uint64_t hash);
  void report_once(std::uint32_t object, const char* what);

  const Source& source_;
  const ModelPackage& model_;
  const LoadOptions& options_;
  Package& to_;
  std::map<Turn, TurnedObject> turns_;
  std::set<std::pair<std::uint32_t, std::string_view>> reports_;  // of objects
};

}  // namespace lamina::load
