#include "stages/slice/slice.h"

#include <fmt/format.h>

#include <algorithm>
#include <map>

#include "stages/geometry/clipping.h"
#include "stages/geometry/contours/nest.h"
#include "stages/geometry/contours/simplify.h"

namespace lamina::slice {
namespace {

void append_moved(const Contours& from, Point2 by, Contours& to) {
  to.point.reserve(to.point.size() + from.point.size());
  for (std::uint32_t c = 0; c < from.size(); ++c) {
    for (const Point2 p : from[c]) to.point.push_back({p.x + by.x, p.y + by.y});
    to.close();
  }
}

}  // namespace

ContoursView LayerContours::of(std::uint32_t b, Buffer<std::uint32_t>& rebased) const {
  const std::uint32_t first = body[b], last = body[b + 1], base = contours.offset[first];
  rebased.resize(last - first + 1);
  for (std::uint32_t c = first; c <= last; ++c) rebased[c - first] = contours.offset[c] - base;
  return {rebased, std::span(contours.point).subspan(base, rebased.back())};
}

Result<Slicer> Slicer::build(std::span<const Mesh> meshes, std::span<const Instance> instances,
                             std::span<const std::uint32_t> body_of, std::span<const Nm> planes, const SliceOptions& options) {
  for (std::size_t p = 1; p < planes.size(); ++p) {
    if (planes[p] <= planes[p - 1]) {
      return Error{Fault::kUsage, fmt::format("plane {} at {} mm is not above plane {} at {} mm; give planes in order", p,
                                              mm(planes[p]), p - 1, mm(planes[p - 1]))};
    }
  }
  Slicer slicer;
  slicer.meshes_ = meshes;
  slicer.planes_.assign(planes.begin(), planes.end());
  slicer.options_ = options;

  std::map<std::pair<std::uint32_t, Nm>, std::uint32_t> known;
  std::vector<std::int64_t> own_planes(planes.size());
  std::vector<SourceMesh> sources;
  for (const Instance& instance : instances) {
    const Nm z = instance.offset.z;
    const auto [found, is_new] = known.emplace(std::pair(instance.mesh, z), static_cast<std::uint32_t>(sources.size()));
    if (is_new) {
      std::ranges::transform(planes, own_planes.begin(), [&](Nm plane) { return std::int64_t{plane} - z; });
      sources.push_back({instance.mesh, z, index_crossings(meshes[instance.mesh].triangles, own_planes)});
    }
    slicer.instances_.push_back({found->second, {instance.offset.x, instance.offset.y}});
  }
  slicer.sources_ = std::make_shared<const std::vector<SourceMesh>>(std::move(sources));
  slicer.group(body_of);
  return slicer;
}

Slicer Slicer::regrouped(std::span<const std::uint32_t> body_of) const {
  Slicer other = *this;
  other.group(body_of);
  return other;
}

void Slicer::group(std::span<const std::uint32_t> body_of) {
  bodies_ = 0;
  for (const std::uint32_t body : body_of) {
    if (body != kLeftOut) bodies_ = std::max(bodies_, body + 1);
  }
  body_offset_.assign(bodies_ + 1, 0);
  for (const std::uint32_t body : body_of) {
    if (body != kLeftOut) ++body_offset_[body + 1];
  }
  for (std::uint32_t b = 0; b < bodies_; ++b) body_offset_[b + 1] += body_offset_[b];
  placed_.resize(body_offset_.back());
  std::vector<std::uint32_t> position(body_offset_.begin(), body_offset_.end() - 1);
  for (std::size_t i = 0; i < body_of.size(); ++i) {
    if (body_of[i] != kLeftOut) placed_[position[body_of[i]]++] = instances_[i];
  }
}

void Slicer::loops_of(const SourceMesh& source, std::uint32_t plane, SectionScratch& scratch, Contours& closed,
                      SectionReport& report) const {
  const std::int64_t z = std::int64_t{planes_[plane]} - source.z;
  const std::span<const Triangle> triangles = meshes_[source.mesh].triangles;
  scratch.facets.clear();
  source.index.append(plane, scratch.facets);
  cut(triangles, scratch.facets, z, scratch.cuts);
  scratch.open.clear();
  chain(scratch.cuts, z, scratch.chain, closed, scratch.open);
  report.cuts += scratch.cuts.size();
  if (scratch.open.size() == 0) return;
  const GapReport gaps = close_gaps(scratch.open, options_.gap, closed);
  report.gaps.add(gaps);
}

Status Slicer::clean(Contours& contours, SectionScratch& scratch, SectionReport& report) const {
  tidy(contours);
  if (!find_contacts(contours, scratch.contact, scratch.group)) scratch.group.clear();
  const auto merged = nest(contours, options_.fill_rule, scratch.group);
  if (!merged) return merged.error();
  report.merged += *merged;
  order_by_outer(contours);
  if (options_.offset != 0) {
    auto moved = offset_contours(contours, options_.offset);
    if (!moved) return moved.error();
    contours = std::move(*moved);
  }
  simplify(contours, options_.tolerance, scratch.simplify);
  return {};
}

Result<SectionReport> Slicer::layer(std::uint32_t plane, SectionScratch& scratch, LayerContours& out) const {
  SectionReport report;
  out.contours.clear();
  out.body.assign(1, 0);
  scratch.of_source.resize(sources_->size());
  scratch.source_done.assign(sources_->size(), 0);
  const auto failed = [&](const Status& status) {
    return Error{status.error().fault, fmt::format("plane at {} mm: {}", mm(planes_[plane]), status.error().message)};
  };
  for (std::uint32_t b = 0; b < bodies_; ++b) {
    const std::span<const Placed> members = std::span(placed_).subspan(body_offset_[b], body_offset_[b + 1] - body_offset_[b]);
    if (members.size() == 1) {
      const Placed& only = members.front();
      Contours& own = scratch.of_source[only.source];
      if (scratch.source_done[only.source] == 0) {
        own.clear();
        loops_of((*sources_)[only.source], plane, scratch, own, report);
        if (auto status = clean(own, scratch, report); !status) return failed(status);
        scratch.source_done[only.source] = 1;
      }
      append_moved(own, only.by, out.contours);
    } else {
      Contours& all = scratch.closed;
      all.clear();
      for (const Placed& member : members) {
        Contours own;
        loops_of((*sources_)[member.source], plane, scratch, own, report);
        append_moved(own, member.by, all);
      }
      if (auto status = clean(all, scratch, report); !status) return failed(status);
      append_moved(all, {0, 0}, out.contours);
    }
    out.body.push_back(out.contours.size());
  }
  return report;
}

std::uint64_t Slicer::index_bytes() const {
  std::uint64_t total = 0;
  for (const SourceMesh& source : *sources_) total += source.index.bytes();
  return total;
}

std::uint64_t Slicer::layer_bytes_bound(std::uint32_t plane) const {
  // Of a cut: its two edges, hashes and point; slots, links and states; its edge in the grid; its points before and after,
  // and once more while points are left out.
  const std::uint64_t of_cut = 48 + 16 + 8 + 16 + 5 + 24 + 24 + (options_.tolerance > 0 ? 48 : 0);
  std::uint64_t maximum = 0;
  std::vector<std::uint8_t> visited(sources_->size(), 0);
  for (const Placed& placed : placed_) visited[placed.source] = 1;
  for (std::size_t s = 0; s < visited.size(); ++s) {
    if (visited[s] != 0) maximum += (*sources_)[s].index.max_found(plane) * of_cut;
  }
  std::uint64_t points = 0;
  for (const Placed& placed : placed_) points += (*sources_)[placed.source].index.max_found(plane);
  return maximum + points * sizeof(Point2);
}

}  // namespace lamina::slice
