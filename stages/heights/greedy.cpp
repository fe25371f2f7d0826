#include "stages/heights/greedy.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <numbers>
#include <span>

namespace lamina::heights {

namespace {

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
  const SlopesByHeight& slopes;
  const ThicknessSet& set;
  Steepness steep;
  std::int64_t top;
  Nm tolerance;

  Steepness flattest(std::int64_t bottom, std::int64_t thickness) const {
    return SlopesByHeight::Growing(slopes, bottom).up_to(bottom + thickness);
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

GreedyLayers::GreedyLayers(const SurfaceIndex& index, const Options& options, CandidateHeights candidate_heights, Plan& plan)
    : options_(options),
      candidate_heights_(std::move(candidate_heights)),
      slopes_(index, options, candidate_heights_, options.mode == Mode::kAngle ? Slope::kAngles : Slope::kSteps),
      top_(index.top) {
  if (options.mode != Mode::kAngle) return;
  peaks_ = find_peaks(index, options, plan.small_peaks);
  const double limit = std::sin(options.adapt_angle_deg * std::numbers::pi / 180) - options.surface.normal_tolerance;
  steep_ = static_cast<Steepness>(std::clamp(std::ceil(limit * kHorizontal), 0.0, 2.0 * kHorizontal));
  flattest_.resize(options.set.size());
}

bool GreedyLayers::advance(Plan& plan) {
  if (done_) return false;
  switch (options_.mode) {
    case Mode::kAngle: done_ = !add_by_angle(plan); break;
    case Mode::kCusp: done_ = !add_by_cusp(plan); break;
    default: done_ = !add_slab(plan); break;
  }
  return true;
}

bool GreedyLayers::decide(std::uint32_t position, Plan& plan) {
  // cover() may divide the last layer anew.
  const auto settled = [&] {
    return plan.table.size() - (done_ || options_.mode != Mode::kAngle || plan.table.size() == 0 ? 0 : 1);
  };
  while (settled() <= position && advance(plan)) {
  }
  return position < settled();
}

bool GreedyLayers::add_by_angle(Plan& plan) {
  const ThicknessSet& set = options_.set;
  const std::int64_t bottom = plan.table.top();
  if (bottom + set.minimum() > top_) {
    end_by_angle(plan);
    return false;
  }
  SlopesByHeight::Growing growing(slopes_, bottom);
  for (std::uint32_t i = 0; i < set.size(); ++i) flattest_[i] = growing.up_to(bottom + set.values[i]);
  // The lowest peak below which the least thickness fits.
  const auto peak = std::ranges::lower_bound(peaks_, bottom + set.minimum(), {}, &Flat::height);
  const std::int64_t peak_height = peak == peaks_.end() ? INT64_MAX : peak->height;
  LayerReason reason = LayerReason::kUniform;
  std::uint32_t i = set.size() - 1;
  for (; i > 0; --i) {
    const std::int64_t end = bottom + set.values[i];
    if (flattest_[i] >= steep_ && flattest_[i] > 0) {
      reason = LayerReason::kSlope;
    } else if (peak_height <= end || end > top_) {
      reason = LayerReason::kPeak;
    } else {
      break;
    }
  }
  plan.table.add(set.values[i], reason);
  plan.inspected.push_back(flattest_[i]);
  return true;
}

void GreedyLayers::end_by_angle(Plan& plan) const {
  const ThicknessSet& set = options_.set;
  if (plan.table.size() == 0) {
    plan.table.add(set.minimum(), LayerReason::kUniform);
    plan.inspected.push_back(slopes_.at(0));
  }
  const Nm tolerance = options_.surface.flat_tolerance;
  if (!options_.cover_top || top_ - plan.table.top() <= tolerance) return;
  const bool keep =
      std::ranges::any_of(peaks_, [&](const Flat& p) { return std::abs(p.height - plan.table.top()) <= tolerance; });
  cover({slopes_, set, steep_, top_, tolerance}, keep, plan);
}

bool GreedyLayers::add_by_cusp(Plan& plan) {
  const ThicknessSet& set = options_.set;
  const std::int64_t bottom = plan.table.top();
  if (bottom >= top_) return false;
  const std::uint32_t candidate = slopes_.candidate_of(bottom);
  const Steepness at_bottom = slopes_.at(candidate);
  std::uint32_t chosen = 0;
  SlopesByHeight::Growing growing(slopes_, bottom);
  for (std::uint32_t i = 0; i < set.size(); ++i) {
    Steepness flattest = growing.up_to(bottom + set.values[i]);
    if (slopes_.plane()) flattest = std::max(flattest, at_bottom);
    if (cusp_of(set.values[i], flattest) <= options_.cusp) {
      chosen = i;
    } else if (!slopes_.plane()) {
      break;  // thicker layers only see more
    }
  }
  const bool limited = chosen + 1 < set.size();
  plan.stepped_back.push_back(limited && cusp_of(set.values[chosen + 1], at_bottom) <= options_.cusp);
  // The least thickness that covers what is left, if any does.
  const auto thinner = std::span(set.values).first(chosen);
  const auto last = static_cast<std::uint32_t>(std::ranges::lower_bound(thinner, top_ - bottom) - thinner.begin());
  plan.table.add(set.values[last], last < chosen ? LayerReason::kFlat : limited ? LayerReason::kCusp : LayerReason::kUniform);
  return true;
}

bool GreedyLayers::add_slab(Plan& plan) {
  const std::int64_t bottom = plan.table.top(), slab = options_.set.maximum();
  const std::int64_t maximum = slab / options_.set.minimum();
  if (bottom >= top_) return false;
  SlopesByHeight::Growing growing(slopes_, bottom);
  Steepness flattest = growing.up_to(bottom + slab);
  if (slopes_.plane()) flattest = std::max(flattest, slopes_.at(slopes_.candidate_of(bottom)));
  std::int64_t layers = 1;
  while (layers < maximum && cusp_of(ceil_div(slab, layers), flattest) > options_.cusp) ++layers;
  for (std::int64_t i = 0; i < layers && bottom + slab * i / layers < top_; ++i) {
    plan.table.add(static_cast<Nm>(slab * (i + 1) / layers - slab * i / layers),
                   layers > 1 ? LayerReason::kCusp : LayerReason::kUniform);
  }
  return true;
}

Result<std::unique_ptr<GreedyLayers>> begin_heights(const SurfaceIndex& index, const Options& options, Plan& plan) {
  if (Status status = check_options(options); !status) return status.error();
  Result<CandidateHeights> candidate_heights =
      CandidateHeights::reachable(options.set, std::int64_t{index.top} + options.set.maximum());
  if (!candidate_heights) return candidate_heights.error();
  auto layers = std::make_unique<GreedyLayers>(index, options, std::move(*candidate_heights), plan);
  plan.table.reserve(layers->max_layers());
  return layers;
}

}  // namespace lamina::heights
