#include "stages/heights/greedy.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <numbers>

#include "stages/heights/steepest.h"

namespace lamina::heights {
namespace {

// The slopes that a layer considers, by candidates: those in its cells, or those that its upper plane cuts.
class Slopes {
 public:
  Slopes(const SurfaceIndex& index, const Options& options, const CandidateHeights& candidate_heights, Slope slope)
      : candidate_heights_(candidate_heights),
        plane_(options.facets == Facets::kPlane),
        values_(plane_ ? steepest_at_candidates(index, index.parts, candidate_heights, slope)
                       : steepest_in_cells(index, index.parts, candidate_heights, slope)) {}

  std::uint32_t candidate_of(std::int64_t height) const { return candidate_heights_.candidates_up_to(height) - 1; }
  bool plane() const { return plane_; }
  Steepness at(std::uint32_t i) const { return i < values_.size() ? values_[i] : 0; }

  /// Grows upwards from a candidate: the flattest slope of a layer from there to each of increasing heights.
  class Growing {
   public:
    Growing(const Slopes& slopes, std::int64_t bottom) : slopes_(slopes), cell_(slopes.candidate_of(bottom)) {}
    Steepness up_to(std::int64_t top) {
      const std::uint32_t candidate = slopes_.candidate_of(top);
      if (slopes_.plane_) return slopes_.at(candidate);
      for (; cell_ < candidate; ++cell_) max_ = std::max(max_, slopes_.at(cell_));
      return max_;
    }

   private:
    const Slopes& slopes_;
    std::uint32_t cell_;
    Steepness max_ = 0;
  };

 private:
  const CandidateHeights& candidate_heights_;
  bool plane_;
  Buffer<Steepness> values_;
};

// The least thickness that covers what is left, if any does.
std::uint32_t covering(const ThicknessSet& set, std::int64_t left, std::uint32_t maximum) {
  for (std::uint32_t i = 0; i < maximum; ++i) {
    if (set.values[i] >= left) return i;
  }
  return maximum;
}

// The peaks, and how many more the documents' rule has.
std::vector<Flat> find_peaks(const SurfaceIndex& index, const Options& options, std::uint32_t& small) {
  std::vector<Flat> peaks = find_flats(index, options.surface.flat_tolerance, 0);
  std::erase_if(peaks, [](const Flat& flat) { return flat.up_mm2 + flat.down_mm2 <= 0; });
  if (options.peaks == Peaks::kFacets) return peaks;
  const std::size_t all = peaks.size();
  std::erase_if(peaks, [&](const Flat& flat) { return flat.up_mm2 + flat.down_mm2 < options.min_flat_mm2; });
  small = static_cast<std::uint32_t>(all - peaks.size());
  return peaks;
}

// The end of a part that the rule leaves less than the least thickness below its top.
struct End {
  const Slopes& slopes;
  const ThicknessSet& set;
  Steepness steep;
  std::int64_t top;
  Nm tolerance;

  Steepness flattest(std::int64_t bottom, std::int64_t thickness) const {
    return Slopes::Growing(slopes, bottom).up_to(bottom + thickness);
  }
  /// Whether the rule allows a layer.
  bool allows(std::int64_t bottom, std::int64_t thickness) const {
    return thickness == set.minimum() || flattest(bottom, thickness) < steep;
  }
};

// Covers the end: one layer or two in place of the last one that reach the least above the top and whose last has its middle,
// where it is sampled, in the part; else, or if the last layer ends on a peak, a layer more.
void cover(const End& end, bool keep, Plan& plan) {
  const Layer last = plan.table[plan.table.size() - 1];
  const std::int64_t bottom = last.bottom, height = end.top - bottom;
  std::int64_t lower = last.thickness, upper = end.set.minimum(), min_above = INT64_MAX;
  const auto try_stack = [&](std::int64_t below) {
    const auto covering = std::ranges::lower_bound(end.set.values, height - below - end.tolerance);
    if (covering == end.set.values.end()) return;
    const std::int64_t above = below + *covering - height;
    const bool allowed = (below == 0 || end.allows(bottom, below)) && end.allows(bottom + below, *covering);
    if (!allowed || below + *covering / 2 >= height || above >= min_above) return;
    min_above = above, lower = below, upper = *covering;
  };
  if (!keep) try_stack(0);
  for (const Nm below : end.set.values) {
    if (below < height && !keep) try_stack(below);
  }
  plan.table.drop_last();
  plan.inspected.pop_back();
  LayerReason reason = lower == last.thickness ? last.reason : LayerReason::kFlat;
  for (const std::int64_t thickness : {lower, upper}) {
    if (thickness > 0) {
      plan.inspected.push_back(end.flattest(plan.table.top(), thickness));
      plan.table.add(static_cast<Nm>(thickness), reason);
    }
    reason = LayerReason::kFlat;
  }
}

}  // namespace

Plan plan_by_angle(const SurfaceIndex& index, const Options& options, const CandidateHeights& candidate_heights) {
  const Slopes slopes(index, options, candidate_heights, Slope::kAngles);
  Plan plan;
  const std::vector<Flat> peaks = find_peaks(index, options, plan.small_peaks);
  const double limit = std::sin(options.adapt_angle_deg * std::numbers::pi / 180) - options.surface.normal_tolerance;
  const auto steep = static_cast<Steepness>(std::clamp(std::ceil(limit * kHorizontal), 0.0, 2.0 * kHorizontal));
  const ThicknessSet& set = options.set;
  const std::int64_t top = index.top;

  std::vector<Steepness> flattest(set.size());
  for (std::int64_t bottom = 0; bottom + set.minimum() <= top; bottom = plan.table.top()) {
    Slopes::Growing growing(slopes, bottom);
    for (std::uint32_t i = 0; i < set.size(); ++i) flattest[i] = growing.up_to(bottom + set.values[i]);
    // The lowest peak below which the least thickness fits.
    const auto peak = std::ranges::lower_bound(peaks, bottom + set.minimum(), {}, &Flat::height);
    const std::int64_t peak_height = peak == peaks.end() ? INT64_MAX : peak->height;
    LayerReason reason = LayerReason::kUniform;
    std::uint32_t i = set.size() - 1;
    for (; i > 0; --i) {
      const std::int64_t end = bottom + set.values[i];
      if (flattest[i] >= steep && flattest[i] > 0) {
        reason = LayerReason::kSlope;
      } else if (peak_height <= end || end > top) {
        reason = LayerReason::kPeak;
      } else {
        break;
      }
    }
    plan.table.add(set.values[i], reason);
    plan.inspected.push_back(flattest[i]);
  }
  if (plan.table.size() == 0) {
    plan.table.add(set.minimum(), LayerReason::kUniform);
    plan.inspected.push_back(slopes.at(0));
  }
  if (options.cover_top && top - plan.table.top() > options.surface.flat_tolerance) {
    const Nm tolerance = options.surface.flat_tolerance;
    const bool keep =
        std::ranges::any_of(peaks, [&](const Flat& p) { return std::abs(p.height - plan.table.top()) <= tolerance; });
    cover({slopes, set, steep, top, tolerance}, keep, plan);
  }
  return plan;
}

Plan plan_by_cusp(const SurfaceIndex& index, const Options& options, const CandidateHeights& candidate_heights) {
  const Slopes slopes(index, options, candidate_heights, Slope::kSteps);
  const ThicknessSet& set = options.set;
  Plan plan;
  for (std::int64_t bottom = 0; bottom < index.top; bottom = plan.table.top()) {
    const std::uint32_t candidate = slopes.candidate_of(bottom);
    const Steepness at_bottom = slopes.at(candidate);
    std::uint32_t chosen = 0;
    Slopes::Growing growing(slopes, bottom);
    for (std::uint32_t i = 0; i < set.size(); ++i) {
      Steepness flattest = growing.up_to(bottom + set.values[i]);
      if (slopes.plane()) flattest = std::max(flattest, at_bottom);
      if (cusp_of(set.values[i], flattest) <= options.cusp) {
        chosen = i;
      } else if (!slopes.plane()) {
        break;  // thicker layers only see more
      }
    }
    const bool limited = chosen + 1 < set.size();
    plan.stepped_back.push_back(limited && cusp_of(set.values[chosen + 1], at_bottom) <= options.cusp);
    const std::uint32_t last = covering(set, index.top - bottom, chosen);
    plan.table.add(set.values[last], last < chosen ? LayerReason::kFlat : limited ? LayerReason::kCusp : LayerReason::kUniform);
  }
  return plan;
}

Plan plan_stepwise(const SurfaceIndex& index, const Options& options, const CandidateHeights& candidate_heights) {
  const Slopes slopes(index, options, candidate_heights, Slope::kSteps);
  const std::int64_t slab = options.set.maximum();
  const std::int64_t maximum = slab / options.set.minimum();
  Plan plan;
  for (std::int64_t bottom = 0; bottom < index.top; bottom += slab) {
    Slopes::Growing growing(slopes, bottom);
    Steepness flattest = growing.up_to(bottom + slab);
    if (slopes.plane()) flattest = std::max(flattest, slopes.at(slopes.candidate_of(bottom)));
    std::int64_t layers = 1;
    while (layers < maximum && cusp_of(ceil_div(slab, layers), flattest) > options.cusp) ++layers;
    for (std::int64_t i = 0; i < layers && bottom + slab * i / layers < index.top; ++i) {
      plan.table.add(static_cast<Nm>(slab * (i + 1) / layers - slab * i / layers),
                     layers > 1 ? LayerReason::kCusp : LayerReason::kUniform);
    }
  }
  return plan;
}

}  // namespace lamina::heights
