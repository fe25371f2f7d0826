#include "stages/heights/greedy.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "stages/heights/steepest.h"

namespace lamina::heights {
namespace {

// The slopes that a layer looks at, by rungs: those in its cells, or those that the plane on top of it cuts.
class Slopes {
 public:
  Slopes(const SurfaceIndex& index, const Options& options, const Ladder& ladder)
      : ladder_(ladder),
        plane_(options.facets == Facets::kPlane),
        values_(plane_ ? steepest_at_rungs(index, index.parts, ladder) : steepest_in_cells(index, index.parts, ladder)) {}

  std::uint32_t rung_of(std::int64_t height) const { return ladder_.rungs_up_to(height) - 1; }
  bool plane() const { return plane_; }
  Steepness at(std::uint32_t i) const { return i < values_.size() ? values_[i] : 0; }

  /// Grows upwards from a rung: the flattest slope of a layer from there to each of increasing heights.
  class Growing {
   public:
    Growing(const Slopes& slopes, std::int64_t bottom) : slopes_(slopes), cell_(slopes.rung_of(bottom)) {}
    Steepness up_to(std::int64_t top) {
      const std::uint32_t rung = slopes_.rung_of(top);
      if (slopes_.plane_) return slopes_.at(rung);
      for (; cell_ < rung; ++cell_) most_ = std::max(most_, slopes_.at(cell_));
      return most_;
    }

   private:
    const Slopes& slopes_;
    std::uint32_t cell_;
    Steepness most_ = 0;
  };

 private:
  const Ladder& ladder_;
  bool plane_;
  Buffer<Steepness> values_;
};

// The least thickness that covers what is left, if any does.
std::uint32_t covering(const ThicknessSet& set, std::int64_t left, std::uint32_t most) {
  for (std::uint32_t i = 0; i < most; ++i) {
    if (set.values[i] >= left) return i;
  }
  return most;
}

}  // namespace

Plan plan_by_angle(const SurfaceIndex& index, const Options& options, const Ladder& ladder) {
  const Slopes slopes(index, options, ladder);
  std::vector<Flat> peaks = find_flats(index, options.surface.flat_tolerance, options.least_flat_mm2);
  std::erase_if(peaks, [&](const Flat& flat) { return flat.up_mm2 + flat.down_mm2 < options.least_flat_mm2; });
  const double limit = std::sin(options.adapt_angle_deg * std::numbers::pi / 180) - options.surface.normal_tolerance;
  const auto steep = static_cast<Steepness>(std::clamp(std::ceil(limit * kHorizontal), 0.0, 2.0 * kHorizontal));
  const ThicknessSet& set = options.set;
  const std::int64_t top = index.top;

  Plan plan;
  std::vector<Steepness> flattest(set.size());
  for (std::int64_t bottom = 0; bottom + set.least() <= top; bottom = plan.table.top()) {
    Slopes::Growing growing(slopes, bottom);
    for (std::uint32_t i = 0; i < set.size(); ++i) flattest[i] = growing.up_to(bottom + set.values[i]);
    // The lowest peak below which the least thickness fits.
    const auto peak = std::ranges::lower_bound(peaks, bottom + set.least(), {}, &Flat::height);
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
    plan.looked_at.push_back(flattest[i]);
  }
  if (plan.table.size() == 0) {
    plan.table.add(set.least(), LayerReason::kUniform);
    plan.looked_at.push_back(slopes.at(0));
  }
  return plan;
}

Plan plan_by_cusp(const SurfaceIndex& index, const Options& options, const Ladder& ladder) {
  const Slopes slopes(index, options, ladder);
  const ThicknessSet& set = options.set;
  Plan plan;
  for (std::int64_t bottom = 0; bottom < index.top; bottom = plan.table.top()) {
    const std::uint32_t rung = slopes.rung_of(bottom);
    const Steepness at_bottom = slopes.at(rung);
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

Plan plan_stepwise(const SurfaceIndex& index, const Options& options, const Ladder& ladder) {
  const Slopes slopes(index, options, ladder);
  const std::int64_t slab = options.set.most();
  const std::int64_t most = slab / options.set.least();
  Plan plan;
  for (std::int64_t bottom = 0; bottom < index.top; bottom += slab) {
    Slopes::Growing growing(slopes, bottom);
    Steepness flattest = growing.up_to(bottom + slab);
    if (slopes.plane()) flattest = std::max(flattest, slopes.at(slopes.rung_of(bottom)));
    std::int64_t layers = 1;
    while (layers < most && cusp_of(ceil_div(slab, layers), flattest) > options.cusp) ++layers;
    for (std::int64_t i = 0; i < layers && bottom + slab * i / layers < index.top; ++i) {
      plan.table.add(static_cast<Nm>(slab * (i + 1) / layers - slab * i / layers),
                     layers > 1 ? LayerReason::kCusp : LayerReason::kUniform);
    }
  }
  return plan;
}

}  // namespace lamina::heights
