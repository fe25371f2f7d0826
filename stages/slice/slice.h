// stages/slice/slice.h: meshes standing on the bed -> clean contours of any layer.
//
//   PlaneIndex ─> cut ─> chain ─> tidy ─> find_contacts ─> nest ─> order_by_outer ─> simplify ─> contours
//                          └─> close_gaps (open meshes)      └─ merge what is in contact
//
// The plane rule is that of the bitmaps: a corner at the plane is below it. What is solid where shells overlap is
// decided by the same fill rule. Contours that keep clear of each other go no further than whole-number comparisons;
// boolean operations are made only of those that overlap, touch or cross themselves.
//
// Exactness: a point of a contour is the exact meeting of a mesh edge and the plane, rounded to the nearest nm in x and
// in y, so a contour lies within 0.71 nm of the true cut. Unions round their new corners once more.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "stages/data/choices.h"
#include "stages/data/contours.h"
#include "stages/data/mesh.h"
#include "stages/data/status.h"
#include "stages/geometry/contours/contact.h"
#include "stages/geometry/contours/simplify.h"
#include "stages/slice/loops.h"

namespace lamina::slice {

struct SliceOptions {
  FillRule fill_rule = FillRule::kNonzero;
  Nm tolerance = 0;         // nm by which leaving out points may move a contour; 0: only points on straight lines go
  Nm gap = 100'000;         // nm, longest gap of an open mesh that is bridged
  std::int64_t offset = 0;  // nm by which contours are grown (shrunk if negative), before points are left out
};

/// One layer. The contours of body b are [body[b], body[b + 1]).
struct LayerContours {
  Contours contours;
  Buffer<std::uint32_t> body{0};

  ContoursView of(std::uint32_t b, Buffer<std::uint32_t>& rebased) const;
};

struct SectionReport {
  std::uint64_t cuts = 0;    // facets that the plane crosses, with copies once
  std::uint32_t merged = 0;  // groups of contours that needed a boolean operation
  LevelFace level;           // the largest, of one body
  GapReport gaps;            // sums over bodies; first_open of the first one
};

/// Buffers of a layer in flight, reused.
struct SectionScratch {
  Buffer<std::uint32_t> facets;
  BlockScratch blocks;
  Cuts cuts;
  ChainScratch chain;
  ContactScratch contact;
  Buffer<std::uint32_t> group;
  SimplifyScratch simplify;
  Contours closed, open;
  std::vector<Contours> of_source;  // clean contours of what copies share
  std::vector<std::uint8_t> source_done;

  std::uint64_t bytes() const;
};

/// Bodies: instances that may overlap and are merged; those of different bodies must not.
class Slicer {
 public:
  /// meshes     stay where they are while the slicer lives
  /// instances  in the frame of the bed
  /// body_of    for each instance the number of its body, 0 .. bodies - 1
  /// planes     nm above the bed, strictly increasing
  /// errors     kUsage: planes not increasing, the first bad one
  /// cost       O(T + P) for each mesh and height at which it stands; copies at one height share all
  static Result<Slicer> build(std::span<const Mesh> meshes, std::span<const Instance> instances,
                              std::span<const std::uint32_t> body_of, std::span<const Nm> planes, const SliceOptions& options);

  /// The same planes cut for other bodies, or for some of the instances only (those with a body below kLeftOut). Shares
  /// the index; instances that only the other slicer cuts cost nothing here.
  static constexpr std::uint32_t kLeftOut = UINT32_MAX;
  Slicer regrouped(std::span<const std::uint32_t> body_of) const;
  /// The same with all points of its contours. Shares the index.
  Slicer exact() const;

  /// The contours of plane p. Pure: the same for any thread and order.
  /// errors  kInternal of the clipping library; kInput: instances overlap deeply and one winds backwards somewhere
  Result<SectionReport> layer(std::uint32_t plane, SectionScratch& scratch, LayerContours& out) const;

  std::uint32_t planes() const { return static_cast<std::uint32_t>(planes_.size()); }
  std::uint32_t bodies() const { return bodies_; }
  std::uint64_t index_bytes() const;
  /// Facets that a plane crosses at most, of each mesh once, and points of all contours.
  struct CutBound {
    std::uint64_t cuts, points;
  };
  CutBound cut_bound(std::uint32_t plane) const;
  /// Bytes that layer() may need at most for scratch and result where no union is made; unions take a multiple of
  /// their contours more.
  std::uint64_t layer_bytes_bound(std::uint32_t plane) const;

 private:
  /// One instance of a body.
  struct Placed {
    std::uint32_t source;
    Point2 by;
  };
  void loops_of(const SourceMesh& source, std::uint32_t plane, SectionScratch& scratch, Contours& closed,
                SectionReport& report) const;
  Status clean(Contours& contours, SectionScratch& scratch, SectionReport& report) const;
  Status finish(Contours& contours, SectionScratch& scratch) const;
  Status combine_members(std::span<const Placed> members, std::uint32_t plane, SectionScratch& scratch, SectionReport& report,
                         Contours& all) const;

  std::span<const Mesh> meshes_;
  std::vector<Nm> planes_;
  SliceOptions options_;
  void group(std::span<const std::uint32_t> body_of);

  std::shared_ptr<const std::vector<SourceMesh>> sources_;
  std::vector<Placed> instances_;           // as given
  std::vector<Placed> placed_;              // body by body
  std::vector<std::uint32_t> body_offset_;  // bodies + 1, into placed_
  std::vector<std::uint32_t> alone_;        // of each source, how many bodies are one instance of it
  std::vector<std::uint8_t> deep_;          // of each body, whether its instances overlap deeply (deep.h)
  std::uint32_t bodies_ = 0;
};

// --- where shells overlap or are inside out, what is solid is not what their volumes add up to.

/// For each plane, mm2: the area that is solid by the rule `nonzero`, less the sum of all winding numbers over the plane.
/// Exactly 0 where closed meshes neither overlap nor lie inside out; its integral over the height is what the union of meshes
/// has more than the sum of their signed volumes.
///
/// meshes     closed
/// instances  all of them stand together
/// planes     nm, strictly increasing
/// errors     kInternal of the clipping library; kInput: instances overlap deeply and one winds backwards somewhere
/// cost       that of slicing the planes, in parallel; the same for any number of threads
Result<std::vector<double>> surplus_areas(std::span<const Mesh> meshes, std::span<const Instance> instances,
                                          std::span<const Nm> planes);

}  // namespace lamina::slice
