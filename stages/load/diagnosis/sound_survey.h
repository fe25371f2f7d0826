// stages/load/diagnosis/sound_survey.h: is a mesh sound, decided in one pass over its triangles, none of which is kept;
// internal to load.
//
// Facets come in chunks that fit a core's cache. Most edges have both of their sides in one chunk, and most vertices are of one
// chunk alone. What is left is compared at the end, a share at a time that fits the cache too:
//
//   rim of a chunk    ends of sides that met no other side in the chunk, and corners of facets that use a vertex twice
//   vertices          one that several chunks have must be on the rim of each: else the mesh is not taken for sound
//   edges             so an edge with sides in several chunks lies between rim vertices in each of them; all sides of such
//   edges,
//                     and that an edge met both of its sides within a chunk, are compared by the coordinates of the ends
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>

#include "stages/data/mesh.h"
#include "stages/load/repair/diagnose.h"

namespace lamina::load {

/// A mesh is sound if each edge has two sides, walked once either way, no facet is there twice, some volume is enclosed, and no
/// shell is inside out or has two facets only.
class SoundSurvey {
 public:
  SoundSurvey();
  ~SoundSurvey();

  /// At most Numbered::kChunk facets, by any thread.
  /// returns  false: the mesh is not sound, or may not be: no more is to be inspected
  /// cost     O(F); 6 to 8 bytes a facet are kept where neighbours follow each other, and 28 for each side on a rim; else, until
  ///          the end, the facets in cells of space
  bool inspect(std::span<const Triangle> facets);

  /// What diagnose() says of a sound mesh; degenerate facets are not searched for. Nothing where it is not sound, or may not
  /// be.
  std::optional<Diagnosis> finish();

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace lamina::load
