// stages/heights/greedy.h: the modes that decide one layer after the other, from the bottom up.
#pragma once

#include <algorithm>
#include <cstdint>
#include <memory>
#include <vector>

#include "stages/data/buffer.h"
#include "stages/heights/candidate_heights.h"
#include "stages/heights/heights.h"

namespace lamina::heights {

/// The slopes that a layer meets: those in its cells of the candidates, or those that the plane on top of it cuts.
class SlopesByHeight {
 public:
  /// The candidate heights must outlive this object, the index need not.
  SlopesByHeight(const SurfaceIndex& index, const Options& options, const CandidateHeights& candidate_heights, Slope slope)
      : candidate_heights_(candidate_heights),
        plane_(options.facets == Facets::kPlane),
        values_(plane_ ? steepest_at_candidates(index, index.parts, candidate_heights, slope)
                       : steepest_in_cells(index, index.parts, candidate_heights, slope)) {}

  std::uint32_t candidate_of(std::int64_t height) const { return candidate_heights_.candidates_up_to(height) - 1; }
  bool plane() const { return plane_; }
  Steepness at(std::uint32_t i) const { return i < values_.size() ? values_[i] : 0; }

  /// Grows upwards from a candidate height: the flattest slope of a layer from there to each of increasing heights.
  class Growing {
   public:
    Growing(const SlopesByHeight& slopes, std::int64_t bottom) : slopes_(slopes), cell_(slopes.candidate_of(bottom)) {}
    Steepness up_to(std::int64_t top) {
      const std::uint32_t candidate = slopes_.candidate_of(top);
      if (slopes_.plane_) return slopes_.at(candidate);
      for (; cell_ < candidate; ++cell_) max_ = std::max(max_, slopes_.at(cell_));
      return max_;
    }

   private:
    const SlopesByHeight& slopes_;
    std::uint32_t cell_;
    Steepness max_ = 0;
  };

 private:
  const CandidateHeights& candidate_heights_;
  bool plane_;
  Buffer<Steepness> values_;
};

/// Decides layers when it is called for them. Pure: a table is the same, however its layers are called for.
///
/// kAngle: figure 3.5 of M. V. A. de Lima, "Modelo de fatiamento adaptativo para prototipagem rapida", UTFPR, 2009. A layer
/// starts with the greatest thickness and gets the next thinner one while a slope is at least as flat as the angle, or
/// else while a flat lies in it or on top of it and the least thickness still fits below that flat, or it leaves the
/// part. What is left at the top is not built if it is less than the least thickness; with cover_top it is, by another
/// division of the last layer or by one layer more.
///
/// kCusp: A. Dolenc and I. Makela, "Slicing procedures for layered manufacturing techniques", Computer-Aided Design 26 (1994):
/// the greatest thickness of which no slope in the layer gets a step above the limit. The top is covered by the least
/// thickness that does.
///
/// kStepwise: E. Sabourin, S. A. Houser and J. H. Bohn, "Adaptive slicing using stepwise uniform refinement", Rapid Prototyping
/// Journal 2 (1996): slabs of the greatest thickness, each divided evenly into as many layers as the flattest slope in
/// it needs, at most greatest / least.
class GreedyLayers {
 public:
  /// options  checked, of one of these modes. candidate_heights  that their thicknesses reach
  /// plan     empty; gets what is known before any layer
  /// cost  reads every facet once; 4 bytes per cell of the candidates are kept
  GreedyLayers(const SurfaceIndex& index, const Options& options, CandidateHeights candidate_heights, Plan& plan);
  GreedyLayers(const GreedyLayers&) = delete;
  GreedyLayers& operator=(const GreedyLayers&) = delete;

  /// Adds a layer or some to the table, or ends it. returns  false once it is complete
  bool advance(Plan& plan);

  /// Decides layers until the one at a position cannot change any more. returns  whether there is one
  bool decide(std::uint32_t position, Plan& plan);

  /// An upper bound of the number of layers.
  std::uint32_t max_layers() const { return static_cast<std::uint32_t>(top_ / options_.set.minimum() + 3); }

 private:
  bool add_by_angle(Plan& plan);
  void end_by_angle(Plan& plan) const;
  bool add_by_cusp(Plan& plan);
  bool add_slab(Plan& plan);

  const Options options_;
  const CandidateHeights candidate_heights_;
  const SlopesByHeight slopes_;
  const std::int64_t top_;
  bool done_ = false;
  // kAngle
  std::vector<Flat> peaks_;
  Steepness steep_ = 0;
  std::vector<Steepness> flattest_;  // by thickness, of a layer from the current height
};

/// Begins to decide layers: for callers that take them one by one. `plan` gets the capacity for all layers, so that entries of
/// its table keep their addresses: other threads may read those that are decided.
/// options  of a mode of GreedyLayers. errors  of plan_heights
Result<std::unique_ptr<GreedyLayers>> begin_heights(const SurfaceIndex& index, const Options& options, Plan& plan);

}  // namespace lamina::heights
