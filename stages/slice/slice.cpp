#include "stages/slice/slice.h"

#include <fmt/format.h>
#include <tbb/enumerable_thread_specific.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <utility>

#include "stages/data/growth.h"
#include "stages/geometry/clipping.h"
#include "stages/geometry/contours/nest.h"
#include "stages/slice/deep.h"

namespace lamina::slice {
namespace {

/// Scratch of more cuts than this is given back, for what searches contacts.
constexpr std::size_t kManyCuts = 1 << 16;

/// The cuts of a source at a plane become chains: `closed`, and scratch.open. returns  how many there are
std::size_t find_loops(const Mesh& mesh, const SourceMesh& source, std::span<const Nm> planes, std::uint32_t plane,
                       SectionScratch& scratch, Contours& closed) {
  const std::int64_t z = std::int64_t{planes[plane]} - source.z;
  scratch.facets.clear();
  if (source.blocks) {
    cut(*source.blocks, plane, z, scratch.blocks, scratch.facets, scratch.cuts);
  } else {
    source.list->append(plane, scratch.facets);
    cut(mesh.triangles, scratch.facets, z, scratch.cuts);
  }
  const CrossedFacets facets{mesh.triangles, mesh.blocks.get(), scratch.facets, mesh.closed};
  scratch.open.clear();
  chain(facets, scratch.cuts, z, scratch.chain, closed, scratch.open);
  const std::size_t count = facets.at.size();
  if (count > kManyCuts) {
    const LevelFace level = scratch.cuts.level;
    scratch.facets = {}, scratch.blocks = {}, scratch.cuts = {}, scratch.chain = {};
    scratch.cuts.level = level;
  }
  return count;
}

/// returns  merged groups
Result<std::uint32_t> nest_apart(Contours& contours, FillRule rule, SectionScratch& scratch) {
  tidy(contours);
  if (!find_contacts(contours, scratch.contact, scratch.group)) scratch.group.clear();
  return nest(contours, rule, scratch.group);
}

/// Contours of an instance become clean, so that they can be combined with those of others.
/// errors  kInput: they wind backwards about something, so what is solid depends on how often others wind about it
Status clean_alone(Contours& contours, FillRule rule, SectionScratch& scratch) {
  Contours forwards = contours;
  if (const auto merged = nest_apart(contours, rule, scratch); !merged) return merged.error();
  if (rule == FillRule::kEvenOdd) return {};
  const FillRule other = rule == FillRule::kNonzero ? FillRule::kPositive : FillRule::kNonzero;
  if (const auto merged = nest_apart(forwards, other, scratch); !merged) return merged.error();
  if (contours.point == forwards.point && contours.offset == forwards.offset) return {};
  return Error{Fault::kInput, fmt::format("more than {} instances overlap at once and the mesh of one is inside out; repair "
                                          "the mesh, or remove copies",
                                          kDeep)};
}

bool overlap_deeply(std::span<const Mesh> meshes, std::span<const Instance> instances) {
  std::vector<Box> boxes;
  for (const Instance& instance : instances) {
    const Box& own = meshes[instance.mesh].bounds;
    const Point3& by = instance.offset;
    const auto moved = [&](const Point3& p) { return Point3{p.x + by.x, p.y + by.y, p.z + by.z}; };
    boxes.push_back(own.empty() ? own : Box{moved(own.lo), moved(own.hi)});
  }
  return overlaps_deeply(boxes);
}

}  // namespace

std::uint64_t SectionScratch::bytes() const {
  const auto of = [](const Contours& c) { return bytes_held(c.point) + bytes_held(c.offset); };
  std::uint64_t total = bytes_held(facets) + blocks.bytes() + cuts.bytes() + chain.bytes() + contact.bytes() +
                        bytes_held(group) + simplify.bytes() + of(closed) + of(open);
  for (const Contours& contours : of_source) total += of(contours);
  return total;
}

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

  std::vector<std::uint32_t> source_of;
  slicer.sources_ = std::make_shared<const std::vector<SourceMesh>>(find_sources(meshes, instances, planes, source_of));
  for (std::size_t i = 0; i < instances.size(); ++i)
    slicer.instances_.push_back({source_of[i], {instances[i].offset.x, instances[i].offset.y}});
  slicer.group(body_of);
  return slicer;
}

Slicer Slicer::regrouped(std::span<const std::uint32_t> body_of) const {
  Slicer other = *this;
  other.group(body_of);
  return other;
}

Slicer Slicer::exact() const {
  Slicer other = *this;
  other.options_.tolerance = 0;
  return other;
}

void Slicer::group(std::span<const std::uint32_t> body_of) {
  bodies_ = 0;
  for (const std::uint32_t body : body_of)
    if (body != kLeftOut) bodies_ = std::max(bodies_, body + 1);
  body_offset_.assign(bodies_ + 1, 0);
  for (const std::uint32_t body : body_of)
    if (body != kLeftOut) ++body_offset_[body + 1];
  for (std::uint32_t b = 0; b < bodies_; ++b) body_offset_[b + 1] += body_offset_[b];
  placed_.resize(body_offset_.back());
  std::vector<std::uint32_t> position(body_offset_.begin(), body_offset_.end() - 1);
  for (std::size_t i = 0; i < body_of.size(); ++i)
    if (body_of[i] != kLeftOut) placed_[position[body_of[i]]++] = instances_[i];
  alone_.assign(sources_->size(), 0);
  deep_.assign(bodies_, 0);
  for (std::uint32_t b = 0; b < bodies_; ++b) {
    const std::span<const Placed> members = std::span(placed_).subspan(body_offset_[b], body_offset_[b + 1] - body_offset_[b]);
    if (members.size() == 1) ++alone_[members.front().source];
    if (members.size() <= kDeep) continue;
    std::vector<Instance> together;
    for (const auto& [source, by] : members)
      together.push_back({(*sources_)[source].mesh, {by.x, by.y, (*sources_)[source].z}});
    deep_[b] = overlap_deeply(meshes_, together);
  }
}

void Slicer::loops_of(const SourceMesh& source, std::uint32_t plane, SectionScratch& scratch, Contours& closed,
                      SectionReport& report) const {
  const std::size_t count = find_loops(meshes_[source.mesh], source, planes_, plane, scratch, closed);
  report.cuts += count;
  report.level.keep_larger(scratch.cuts.level);
  if (scratch.open.size() == 0) return;
  report.gaps.add(close_gaps(scratch.open, options_.gap, closed));
}

Status Slicer::clean(Contours& contours, SectionScratch& scratch, SectionReport& report) const {
  const auto merged = nest_apart(contours, options_.fill_rule, scratch);
  if (!merged) return merged.error();
  report.merged += *merged;
  return finish(contours, scratch);
}

Status Slicer::finish(Contours& contours, SectionScratch& scratch) const {
  order_by_outer(contours);
  if (options_.offset != 0) {
    auto moved = offset_contours(contours, options_.offset);
    if (!moved) return moved.error();
    contours = std::move(*moved);
  }
  simplify(contours, options_.tolerance, scratch.simplify);
  return {};
}

Status Slicer::combine_members(std::span<const Placed> members, std::uint32_t plane, SectionScratch& scratch,
                               SectionReport& report, Contours& all) const {
  std::vector<Contours> clean_source(sources_->size()), sets(members.size());
  std::vector<std::uint8_t> done(sources_->size(), 0);
  for (std::size_t i = 0; i < members.size(); ++i) {
    const auto& [source, by] = members[i];
    Contours& own = clean_source[source];
    if (std::exchange(done[source], 1) == 0) {
      loops_of((*sources_)[source], plane, scratch, own, report);
      if (Status status = clean_alone(own, options_.fill_rule, scratch); !status) return status;
    }
    append_moved(own, by, sets[i]);
  }
  auto combined = combine_in_groups(std::move(sets), options_.fill_rule);
  if (!combined) return combined.error();
  all = std::move(*combined);
  if (const auto merged = nest_apart(all, options_.fill_rule, scratch); !merged) return merged.error();
  report.merged += 1;
  return finish(all, scratch);
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
    LevelFace level = std::exchange(report.level, {});
    const std::span<const Placed> members = std::span(placed_).subspan(body_offset_[b], body_offset_[b + 1] - body_offset_[b]);
    if (members.size() == 1) {
      const Placed& only = members.front();
      Contours& own = scratch.of_source[only.source];
      if (scratch.source_done[only.source] == 0) {
        own.clear();
        loops_of((*sources_)[only.source], plane, scratch, own, report);
        if (auto status = clean(own, scratch, report); !status) return failed(status);
        scratch.source_done[only.source] = 1;
        reserve_more(out.contours.point, std::size_t{alone_[only.source]} * own.point.size());
      }
      append_moved(own, only.by, out.contours);
    } else {
      Contours& all = scratch.closed;
      all.clear();
      for (const Placed& member : deep_[b] ? std::span<const Placed>() : members) {
        Contours own;
        loops_of((*sources_)[member.source], plane, scratch, own, report);
        append_moved(own, member.by, all);
      }
      Status status = deep_[b] ? combine_members(members, plane, scratch, report, all) : clean(all, scratch, report);
      if (!status) return failed(status);
      append_moved(all, {0, 0}, out.contours);
    }
    out.body.push_back(out.contours.size());
    report.level.owner = b, report.level.plane = planes_[plane];
    level.keep_larger(report.level);
    report.level = level;
  }
  return report;
}

std::uint64_t Slicer::index_bytes() const {
  std::uint64_t total = 0;
  for (const SourceMesh& source : *sources_) total += source.bytes();
  return total;
}

Slicer::CutBound Slicer::cut_bound(std::uint32_t plane) const {
  CutBound bound{0, 0};
  std::vector<std::uint8_t> visited(sources_->size(), 0);
  for (const Placed& placed : placed_) {
    const std::uint64_t found = (*sources_)[placed.source].max_found(plane);
    bound.points += found;
    if (std::exchange(visited[placed.source], 1) == 0) bound.cuts += found;
  }
  return bound;
}

std::uint64_t Slicer::layer_bytes_bound(std::uint32_t plane) const {
  // Of a cut: its facet, which is found first and sorted then; hashes and point; slots, links and states; its edge in the grid;
  // its points before and after, and once more while points are left out.
  const std::uint64_t of_cut = 9 + 16 + 6 + 5 + 24 + 24 + (options_.tolerance > 0 ? 48 : 0);
  const CutBound bound = cut_bound(plane);
  return bound.cuts * of_cut + bound.points * sizeof(Point2);
}

namespace {

/// A mesh at a height, and the positions of its copies; where contours are combined in groups each position once.
struct SharedMesh {
  const Mesh& mesh;
  const SourceMesh& source;
  std::vector<Point2> by;
  std::int64_t copies = 0;
};

Result<double> surplus_area(std::span<const SharedMesh> shared, bool deep, std::span<const Nm> planes, std::uint32_t plane,
                            SectionScratch& scratch, Contours& all) {
  all.clear();
  __int128 wound = 0;
  std::vector<Contours> sets;
  for (const auto& [mesh, source, offsets, copies] : shared) {
    scratch.closed.clear();
    find_loops(mesh, source, planes, plane, scratch, scratch.closed);
    wound += doubled_area(scratch.closed) * copies;
    if (deep) {
      if (Status status = clean_alone(scratch.closed, FillRule::kNonzero, scratch); !status) return status.error();
      for (const Point2 by : offsets) append_moved(scratch.closed, by, sets.emplace_back());
      continue;
    }
    reserve_more(all.point, offsets.size() * scratch.closed.point.size());
    for (const Point2 by : offsets) append_moved(scratch.closed, by, all);
  }
  if (deep) {
    auto combined = combine_in_groups(std::move(sets), FillRule::kNonzero);
    if (!combined) return combined.error();
    return square_mm(doubled_area(*combined) - wound);
  }
  if (const auto merged = nest_apart(all, FillRule::kNonzero, scratch); !merged) return merged.error();
  return square_mm(doubled_area(all) - wound);
}

}  // namespace

Result<std::vector<double>> surplus_areas(std::span<const Mesh> meshes, std::span<const Instance> instances,
                                          std::span<const Nm> planes) {
  std::vector<std::uint32_t> source_of;
  const std::vector<SourceMesh> sources = find_sources(meshes, instances, planes, source_of);
  std::vector<SharedMesh> shared;
  for (const SourceMesh& source : sources) shared.push_back({meshes[source.mesh], source, {}, 0});
  for (std::size_t i = 0; i < instances.size(); ++i)
    shared[source_of[i]].by.push_back({instances[i].offset.x, instances[i].offset.y});
  const bool deep = overlap_deeply(meshes, instances);
  for (SharedMesh& one : shared) {
    one.copies = std::ssize(one.by);
    if (!deep) continue;
    std::ranges::sort(one.by, {}, [](const Point2& p) { return std::pair(p.x, p.y); });
    one.by.erase(std::unique(one.by.begin(), one.by.end()), one.by.end());
  }
  std::vector<double> areas(planes.size());
  std::vector<Status> status(planes.size());
  struct Scratch {
    SectionScratch section;
    Contours all;
  };
  tbb::enumerable_thread_specific<Scratch> scratches;
  tbb::parallel_for(std::uint32_t{0}, static_cast<std::uint32_t>(planes.size()), [&](std::uint32_t plane) {
    Scratch& own = scratches.local();
    const Result<double> area = surplus_area(shared, deep, planes, plane, own.section, own.all);
    area ? void(areas[plane] = *area) : void(status[plane] = area.error());
  });
  for (const Status& each : status)
    if (!each) return each.error();
  return areas;
}

}  // namespace lamina::slice
