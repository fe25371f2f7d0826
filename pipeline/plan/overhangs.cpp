#include "pipeline/plan/overhangs.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <map>
#include <utility>
#include <vector>

#include "stages/checks/overhangs.h"
#include "stages/geometry/boxes.h"
#include "stages/slice/slice.h"

namespace lamina::pipeline {
namespace {

/// Whether contours are others moved by `by`.
bool is_moved_by(const ContoursView& copy, const ContoursView& original, Point2 by) {
  return std::ranges::equal(copy.offset, original.offset) &&
         std::ranges::equal(copy.point, original.point, [&](Point2 p, Point2 q) {
           return std::int64_t{p.x} - q.x == by.x && std::int64_t{p.y} - q.y == by.y;
         });
}

/// What hangs of a layer, body by body. Those with equal numbers of points may be copies: they are compared with one.
Result<Contours> overhang_of(const slice::LayerContours& own, const slice::LayerContours& below, std::int64_t reach) {
  struct Original {
    std::uint32_t body, begin, end;  // of its contours in the region
  };
  std::map<std::pair<std::size_t, std::size_t>, Original> originals;
  Contours region;
  checks::RegionBelow scratch;
  Buffer<std::uint32_t> rebased, rebased_below, of_original, of_original_below;
  const ContoursView none;
  for (std::uint32_t b = 0; b + 1 < own.body.size(); ++b) {
    if (own.body[b] == own.body[b + 1]) continue;
    const auto below_of = [&](std::uint32_t body, Buffer<std::uint32_t>& offsets) {
      return body + 1 < below.body.size() ? below.of(body, offsets) : none;
    };
    const ContoursView contours = own.of(b, rebased), carrying = below_of(b, rebased_below);
    const auto [known, added] =
        originals.try_emplace({contours.point.size(), carrying.point.size()}, Original{b, region.size(), 0});
    if (!added) {
      const Original& original = known->second;
      const ContoursView first = own.of(original.body, of_original), first_below = below_of(original.body, of_original_below);
      const Point2 by{contours.point[0].x - first.point[0].x, contours.point[0].y - first.point[0].y};
      if (is_moved_by(contours, first, by) && is_moved_by(carrying, first_below, by)) {
        for (std::uint32_t c = original.begin; c < original.end; ++c) {
          const std::uint32_t begin = region.offset[c], end = region.offset[c + 1];
          for (std::uint32_t i = begin; i < end; ++i) {
            const Point2 p = region.point[i];
            region.point.push_back({p.x + by.x, p.y + by.y});
          }
          region.close();
        }
        continue;
      }
    }
    auto found = checks::find_overhangs(contours, carrying, reach, scratch);
    if (!found) return found.error();
    region.append(*found);
    if (added) known->second.end = region.size();
  }
  return region;
}

}  // namespace

Overhangs::Overhangs(Sections& sections, double angle_deg, std::uint32_t neighbours)
    : sections_(sections), angle_deg_(angle_deg) {
  sections.keep_exact_neighbours(neighbours);
}

Result<LayerOverhang> Overhangs::at(std::uint32_t index) const {
  const auto hanging = region(index);
  return hanging ? checks::measure_overhang(*hanging) : Result<LayerOverhang>(hanging.error());
}

Result<Contours> Overhangs::region(std::uint32_t index) const {
  const std::optional<std::uint32_t> below = sections_.below(index);
  if (!below && sections_.layers()[index].layer.bottom <= 0) return Contours();
  const auto own = sections_.exact_contours(index);
  if (!own) return own.error();
  if (!below) return overhang_of((*own)->contours, {}, 0);
  const auto carrying = sections_.exact_contours(*below);
  if (!carrying) return carrying.error();
  const double distance = sections_.sampled_at(index) - sections_.sampled_at(*below);
  return overhang_of((*own)->contours, (*carrying)->contours, checks::overhang_reach(distance, angle_deg_));
}

Result<checks::OverhangTally> tally_overhangs(std::span<const Mesh> meshes, std::span<const Instance> instances,
                                              FillRule fill_rule, std::span<const Layer> layers, std::span<const Nm> planes,
                                              double angle_deg) {
  std::vector<Box> boxes;
  for (const Instance& instance : instances) {
    const Box& own = meshes[instance.mesh].bounds;
    const Point3& by = instance.offset;
    Box& box = boxes.emplace_back();
    if (own.empty()) continue;
    box.add(Point3{own.lo.x + by.x, own.lo.y + by.y, own.lo.z + by.z});
    box.add(Point3{own.hi.x + by.x, own.hi.y + by.y, own.hi.z + by.z});
  }
  slice::SliceOptions options;
  options.fill_rule = fill_rule;
  const auto slicer = slice::Slicer::build(meshes, instances, group_touching(boxes), planes, options);
  if (!slicer) return slicer.error();
  constexpr std::uint32_t kTogether = 32;  // layers of a task; each task cuts one layer more
  const auto count = static_cast<std::uint32_t>(layers.size());
  std::vector<LayerOverhang> overhangs(count);
  std::vector<Status> status(ceil_div(count, kTogether));
  tbb::parallel_for(std::uint32_t{0}, static_cast<std::uint32_t>(status.size()), [&](std::uint32_t task) {
    slice::SectionScratch scratch;
    slice::LayerContours own, below;
    const std::uint32_t begin = task * kTogether, end = std::min(count, begin + kTogether);
    for (std::uint32_t i = std::max(begin, 1u) - 1; i < end; ++i) {
      if (const auto cut = slicer->layer(i, scratch, own); !cut) {
        status[task] = cut.error();
        return;
      }
      const bool on_bed = i == 0 && layers[0].bottom <= 0;
      if (i >= begin && !on_bed) {
        const double distance = i == 0 ? 0 : static_cast<double>(planes[i]) - planes[i - 1];
        auto found = overhang_of(own, below, checks::overhang_reach(distance, angle_deg));
        found ? void(overhangs[i] = checks::measure_overhang(*found)) : void(status[task] = found.error());
      }
      std::swap(own, below);
    }
  });
  for (const Status& each : status)
    if (!each) return each.error();
  checks::OverhangTally tally;
  for (std::uint32_t i = 0; i < count; ++i) tally.add(layers[i], overhangs[i]);
  return tally;
}

}  // namespace lamina::pipeline
