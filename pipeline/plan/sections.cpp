#include "pipeline/plan/sections.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <filesystem>
#include <iterator>
#include <map>

#include "pipeline/job/decisions.h"
#include "pipeline/job/keys.h"
#include "stages/geometry/boxes.h"
#include "stages/geometry/clipping.h"
#include "stages/geometry/contours/edge_bands.h"
#include "stages/geometry/contours/nest.h"
#include "stages/infill/brim.h"
#include "stages/infill/density.h"
#include "stages/slice/bodies.h"

namespace lamina::pipeline {
namespace {

/// The name of a key in a job file and on a command line.
std::string named(std::string_view name) {
  for (const auto& key : fill_settings_keys()) {
    if (key.name == name && !key.flag.empty()) return fmt::format("fill.{} ({})", name, key.flag);
  }
  return fmt::format("fill.{}", name);
}

/// Checks mutually exclusive keys. returns "" or an error message
std::string contradiction(const FillSettings& settings) {
  const auto keys = distance_keys(settings);
  if (keys.size() > 1) {
    return fmt::format("{} and {} both say how far lines lie from each other; give one of them", named(keys[0]),
                       named(keys[1]));
  }
  if (!settings.distance_mm.empty() && settings.group > 1) {
    return fmt::format(
        "{} and {}: groups are of beads with gaps between; write the distances of a group one by one, or give gaps",
        named("distance_mm"), named("group"));
  }
  return {};
}

}  // namespace

void FillPlan::set_beads(BeadShape shape, Nm nominal_thickness, bool varies_width) {
  const auto set = [&](infill::FillParameters& parameters) {
    parameters.shape = shape;
    parameters.nominal_thickness = nominal_thickness;
    parameters.varies_width = varies_width;
  };
  set(base);
  for (FillInterval& range : ranges) set(range.parameters);
}

void FillPlan::set_width(Nm width) {
  base.width = base.wall_width = width;
  for (FillInterval& range : ranges) range.parameters.width = range.parameters.wall_width = width;
}

const infill::FillParameters& FillPlan::at(std::int64_t height) const {
  for (const FillInterval& range : ranges) {
    if (range.from <= height && height < range.to) return range.parameters;
  }
  return base;
}

bool FillPlan::fills() const {
  const auto does = [](const infill::FillParameters& p) { return p.walls > 0 || p.pattern != infill::Pattern::kNone; };
  return does(base) || std::ranges::any_of(ranges, [&](const FillInterval& range) { return does(range.parameters); });
}

Result<FillPlan> plan_filling(const FillRequest& request, const FillChanges& part_changes) {
  count(Decision::kFilling);
  const auto wrong = [](std::string_view key, const std::string& what) {
    return Error{Fault::kUsage, fmt::format("{}: {}", key, what)};
  };
  if (const std::string what = contradiction(request.all); !what.empty()) return Error{Fault::kUsage, what};
  FillSettings settings = request.all;
  apply(part_changes, settings);
  if (const std::string what = contradiction(settings); !what.empty()) return wrong("part.fill", what);
  FillPlan plan;
  plan.base = infill::parameters_of(settings);
  if (Status status = infill::check(plan.base); !status) {
    return wrong(part_changes.empty() ? "fill" : "part.fill", status.error().message);
  }
  for (const FillRange& range : request.ranges) {
    FillSettings own = settings;
    apply(range.changes, own);
    const std::string name = fmt::format("fill.range: {}", range_name(range.from_mm, range.to_mm));
    if (const std::string what = contradiction(own); !what.empty()) return wrong(name, what);
    plan.ranges.push_back({nm_of(range.from_mm), nm_of(range.to_mm), infill::parameters_of(own)});
    if (Status status = infill::check(plan.ranges.back().parameters); !status) return wrong(name, status.error().message);
  }
  std::ranges::sort(plan.ranges, {}, &FillPlan::FillInterval::from);
  return plan;
}

namespace fs = std::filesystem;

Box box_of(const Scene& scene, const Instance& instance) {
  const Box& own = scene.meshes[instance.mesh].bounds;
  Box box;
  if (own.empty()) return box;
  const Point3& by = instance.offset;
  box.add(Point3{own.lo.x + by.x, own.lo.y + by.y, own.lo.z + by.z});
  box.add(Point3{own.hi.x + by.x, own.hi.y + by.y, own.hi.z + by.z});
  return box;
}

Result<Sections> Sections::make(const Job& job, const Scene& scene, LayerSchedule schedule, std::vector<FillPlan> fillings) {
  Sections made;
  made.scene_ = &scene;
  made.schedule_ = std::move(schedule);
  made.plans_ = std::move(fillings);
  made.fills_ = std::ranges::any_of(made.plans_, &FillPlan::fills);
  const bool on_bed = job.extrude.raft_layers == 0;
  if (on_bed) made.elephant_foot_ = static_cast<Nm>(nm_of(job.extrude.elephant_foot_mm));
  if (on_bed && job.extrude.first_bead_mm) {
    made.first_plans_ = made.plans_;
    for (FillPlan& plan : made.first_plans_) plan.set_width(static_cast<Nm>(nm_of(*job.extrude.first_bead_mm)));
  }
  made.containment_ = job.heights.containment;
  std::vector<Box> boxes;
  for (const Instance& instance : scene.instances) {
    boxes.push_back(box_of(scene, instance));
    made.bounds_.add(boxes.back());
  }
  if (job.slice.offset_mm > 0) made.grow_ = static_cast<Nm>(nm_of(job.slice.offset_mm));
  std::vector<Box> reach;  // offset boxes: parts may touch only after the offset
  for (const Box& box : boxes) reach.push_back(slice::grown(box, made.grow_));
  made.body_ = group_touching(reach);
  const std::vector<std::uint32_t>& body = made.body_;
  const std::vector<std::uint32_t> part_area = made.make_areas(job, boxes, body);
  made.find_copies(body);
  made.bounds_ = slice::grown(made.bounds_, made.grow_);
  slice::SliceOptions options;
  options.fill_rule = job.fill_rule;
  auto tolerance = static_cast<Nm>(nm_of(job.slice.tolerance_um.value_or(0) / 1000));
  // What is filled moves twice: its contours, and a tenth of that the walls made of them.
  if (made.fills_) made.of_walls_ = tolerance / 10;
  tolerance -= made.of_walls_;
  // Two planes of a layer are combined at full resolution: where they cross at a small angle, corners would move further.
  (job.heights.containment == Containment::kAcross ? options.tolerance : made.tolerance_) = tolerance;
  options.gap = static_cast<Nm>(nm_of(job.slice.bridge_mm));
  options.offset = nm_of(job.slice.offset_mm);
  auto slicer = slice::Slicer::build(scene.meshes, scene.instances, body, made.schedule_.planes, options);
  if (!slicer) return slicer.error();
  made.slicer_.emplace(std::move(*slicer));
  const bool shares = std::ranges::any_of(part_area, [](std::uint32_t area) { return area != slice::Slicer::kLeftOut; });
  if (made.fills_ && shares) made.part_slicer_ = made.slicer_->regrouped(part_area);
  if (job.heights.per_part) {
    if (Status status = made.make_own_slicers(job, body); !status) return status.error();
  }
  made.reach_ = made.skin_reach();
  made.keep_neighbours(0);
  if (tolerance > 0) {
    for (const slice::Slicer& own : made.own_slicers_) made.exact_slicers_.push_back(own.exact());
    if (made.own_slicers_.empty()) made.exact_slicers_.push_back(made.slicer_->exact());
  }
  return made;
}

Status Sections::make_own_slicers(const Job& job, const std::vector<std::uint32_t>& body) {
  for (const Area& area : areas_) {
    if (area.shared == UINT32_MAX) continue;
    return Error{Fault::kUsage, fmt::format("--per-part: {} touches another part, so they have to share their layers; move "
                                            "them apart or leave it out",
                                            fs::path(job.parts[area.part].path).filename().string())};
  }
  for (std::uint32_t part = 0; part < job.parts.size(); ++part) {
    std::vector<std::uint32_t> own = body;
    for (std::size_t i = 0; i < own.size(); ++i) {
      if (scene_->part_of_instance[i] != part) own[i] = slice::Slicer::kLeftOut;
    }
    own_slicers_.push_back(slicer_->regrouped(own));
  }
  return {};
}

std::vector<std::uint32_t> Sections::make_areas(const Job& job, const std::vector<Box>& boxes,
                                                const std::vector<std::uint32_t>& body) {
  // Bodies are numbered by their first instances, instances in the order of the parts: so are the areas of a body.
  std::map<std::pair<std::uint32_t, std::uint32_t>, std::vector<std::uint32_t>> members;  // by body and part
  for (std::uint32_t i = 0; i < body.size(); ++i) members[{body[i], scene_->part_of_instance[i]}].push_back(i);
  std::vector<std::uint32_t> part_area(body.size(), slice::Slicer::kLeftOut);
  std::uint32_t shared = 0;
  for (auto it = members.begin(); it != members.end();) {
    const std::uint32_t b = it->first.first;
    auto end = it;
    while (end != members.end() && end->first.first == b) ++end;
    body_area_.push_back(static_cast<std::uint32_t>(areas_.size()));
    names_.push_back(fs::path(job.parts[it->first.second].path).filename().string());
    const bool shares = std::next(it) != end;
    for (; it != end; ++it) {
      Area area{b, it->first.second, {}};
      if (shares) area.shared = shared++;
      for (const std::uint32_t i : it->second) {
        area.box.add(boxes[i]);
        if (shares) part_area[i] = area.shared;
      }
      areas_.push_back(area);
    }
  }
  body_area_.push_back(static_cast<std::uint32_t>(areas_.size()));
  return part_area;
}

/// Copies of a part, each a body of its own, that stand at one height. Middles of their boxes have to be rounded alike.
void Sections::find_copies(const std::vector<std::uint32_t>& body) {
  std::vector<std::uint32_t> members(areas_.size(), 0);
  std::vector<std::uint32_t> mesh(areas_.size(), 0);
  for (std::size_t i = 0; i < body.size(); ++i) {
    const std::uint32_t a = body_area_[body[i]];
    ++members[a];
    mesh[a] = scene_->instances[i].mesh;
  }
  std::map<std::array<std::int64_t, 3>, std::uint32_t> first;  // by part, mesh and height
  for (std::uint32_t a = 0; a < areas_.size(); ++a) {
    Area& area = areas_[a];
    area.alike = a;
    if (area.shared != UINT32_MAX || members[a] != 1 || area.box.lo.x < 0 || area.box.lo.y < 0) continue;
    area.alike = first.try_emplace({area.part, mesh[a], area.box.lo.z}, a).first->second;
  }
}

bool Sections::is_moved(const Area& copy, const Area& original, const Work& work) const {
  const Contours& all = work.contours.contours;
  const std::span<const std::uint32_t> body = work.contours.body;
  const std::uint32_t a = body[copy.body], b = body[original.body], count = body[copy.body + 1] - a;
  if (body[original.body + 1] - b != count) return false;
  const std::uint32_t from = all.offset[a], of_original = all.offset[b];
  for (std::uint32_t c = 1; c <= count; ++c) {
    if (all.offset[a + c] - from != all.offset[b + c] - of_original) return false;
  }
  const Nm dx = copy.box.lo.x - original.box.lo.x, dy = copy.box.lo.y - original.box.lo.y;
  const std::span<const Point2> points = all.point;
  return std::ranges::equal(points.subspan(from, all.offset[a + count] - from),
                            points.subspan(of_original, all.offset[b + count] - of_original),
                            [&](Point2 p, Point2 q) { return std::int64_t{p.x} - q.x == dx && std::int64_t{p.y} - q.y == dy; });
}

const infill::FillParameters& Sections::filling(const Area& area, const Layer& layer) const {
  const bool first = layer.bottom <= 0 && !first_plans_.empty();
  return (first ? first_plans_ : plans_)[area.part].at(height_in(area, layer));
}

ContoursView Sections::contours_of(const Area& area, Work& work) const {
  return area.shared == UINT32_MAX ? work.contours.of(area.body, work.rebased) : ContoursView(work.surface[area.shared]);
}

double Sections::area_mm2(const Area& area, const Work& work) const {
  if (area.shared != UINT32_MAX) return square_mm(doubled_area(work.surface[area.shared]));
  const slice::LayerContours& all = work.contours;
  double sum = 0;
  for (std::uint32_t c = all.body[area.body]; c < all.body[area.body + 1]; ++c) {
    sum += square_mm(doubled_area(ContoursView(all.contours)[c]));
  }
  return sum;
}

std::unique_ptr<slice::SectionScratch> Sections::Scratches::take() {
  const std::lock_guard lock(mutex);
  if (idle.empty()) return std::make_unique<slice::SectionScratch>();
  auto scratch = std::move(idle.back());
  idle.pop_back();
  return scratch;
}

void Sections::Scratches::give_back(std::unique_ptr<slice::SectionScratch> scratch) {
  const std::lock_guard lock(mutex);
  idle.push_back(std::move(scratch));
}

Result<slice::SectionReport> Sections::section(const slice::Slicer& slicer, const ScheduledLayer& scheduled, Nm tolerance,
                                               slice::SectionScratch& scratch, Work& work, slice::LayerContours& out) const {
  auto report = slicer.layer(scheduled.low, scratch, out);
  if (!report || containment_ == Containment::kAcross) return report;
  const auto high = slicer.layer(scheduled.high, scratch, work.highest);
  if (!high) return high.error();
  report->cuts += high->cuts;
  report->merged += high->merged;
  report->gaps.add(high->gaps);
  report->level.keep_larger(high->level);
  slice::LayerContours both;
  for (std::uint32_t b = 0; b < slicer.bodies(); ++b) {
    const ContoursView low_view = out.of(b, work.rebased), high_view = work.highest.of(b, work.rebased_highest);
    Result<Contours> region = Contours();
    if (containment_ == Containment::kInside) {
      region = intersect_contours(low_view, high_view);
    } else {
      Contours all;
      all.append(low_view);
      all.append(high_view);
      region = contour_union(all, FillRule::kNonzero);
    }
    if (!region) return region.error();
    order_by_outer(*region);
    simplify(*region, tolerance, scratch.simplify);
    both.contours.append(*region);
    both.body.push_back(both.contours.size());
  }
  out = std::move(both);
  return report;
}

Status Sections::slice_layer(std::uint32_t index, slice::SectionScratch& scratch, Work& work) const {
  const ScheduledLayer& scheduled = schedule_.layers[index];
  const slice::Slicer& slicer = own_slicers_.empty() ? *slicer_ : own_slicers_[scheduled.part];
  if (neighbours_->used) {
    const auto shared = share(index, scratch);
    if (!shared) return shared.error();
    work.contours = (*shared)->contours;
    work.report = (*shared)->report;
  } else {
    auto report = section(slicer, scheduled, tolerance_, scratch, work, work.contours);
    if (!report) return report.error();
    // Bodies of other parts have nothing in this layer.
    work.contours.body.resize(slicer_->bodies() + 1, work.contours.contours.size());
    work.report = *report;
  }
  if (!part_slicer_) return {};
  const auto again = section(*part_slicer_, scheduled, tolerance_, scratch, work, work.parts);
  return again ? Status() : Status(again.error());
}

void Sections::keep_neighbours(std::uint32_t layers) {
  if (reach_ == 0) return;
  neighbours_->used = true;
  constexpr std::uint32_t kMaxReach = 64;  // further layers are cut again: memory stays bounded
  neighbours_->contours.reserve(layers + 2 * std::min(reach_, kMaxReach) + 2);
}

void Sections::keep_exact_neighbours(std::uint32_t layers) {
  NearbyLayers& nearby = exact_slicers_.empty() ? *neighbours_ : *exact_neighbours_;
  nearby.used = true;
  nearby.contours.reserve(layers);
}

std::uint64_t Sections::shared_bytes() const { return neighbours_->contours.bytes() + exact_neighbours_->contours.bytes(); }

double Sections::sampled_at(std::uint32_t index) const {
  const ScheduledLayer& scheduled = schedule_.layers[index];
  return (static_cast<double>(schedule_.planes[scheduled.low]) + schedule_.planes[scheduled.high]) / 2;
}

std::optional<std::uint32_t> Sections::above(std::uint32_t index) const {
  for (std::uint32_t next = index + 1; next < schedule_.layers.size(); ++next) {
    if (schedule_.layers[next].part == schedule_.layers[index].part) return next;
  }
  return std::nullopt;
}

std::optional<std::uint32_t> Sections::below(std::uint32_t index) const {
  for (std::uint32_t next = index; next-- > 0;) {
    if (schedule_.layers[next].part == schedule_.layers[index].part) return next;
  }
  return std::nullopt;
}

Result<std::shared_ptr<const Sections::SharedContours>> Sections::shared_contours(std::uint32_t index) const {
  auto scratch = scratches_->take();
  auto shared = share(index, *scratch);
  scratches_->give_back(std::move(scratch));
  return shared;
}

Result<std::shared_ptr<const Sections::SharedContours>> Sections::exact_contours(std::uint32_t index) const {
  auto scratch = scratches_->take();
  auto shared = share(index, *scratch, !exact_slicers_.empty());
  scratches_->give_back(std::move(scratch));
  return shared;
}

Result<std::shared_ptr<const Sections::SharedContours>> Sections::share(std::uint32_t index, slice::SectionScratch& scratch,
                                                                        bool exact) const {
  NearbyLayers& nearby = exact ? *exact_neighbours_ : *neighbours_;
  return nearby.contours.get(index, [&]() -> Result<SharedContours> {
    Work work;
    const ScheduledLayer& scheduled = schedule_.layers[index];
    const slice::Slicer& slicer = exact                  ? exact_slicers_[own_slicers_.empty() ? 0 : scheduled.part]
                                  : own_slicers_.empty() ? *slicer_
                                                         : own_slicers_[scheduled.part];
    const auto report = section(slicer, scheduled, exact ? 0 : tolerance_, scratch, work, work.contours);
    if (!report) return report.error();
    // Bodies of other parts have nothing in this layer.
    work.contours.body.resize(slicer_->bodies() + 1, work.contours.contours.size());
    return SharedContours{std::move(work.contours), *report};
  });
}

Result<infill::Outlines> Sections::outlines_of(const Area& area, const Layer& layer, Work& work) const {
  const ContoursView contours = contours_of(area, work);
  const infill::FillContext context{layer, area.box, of_walls_};
  if (elephant_foot_ == 0 || layer.bottom > 0) return infill::outlines_of(contours, context, filling(area, layer));
  const auto inset = infill::without_elephant_foot(contours, elephant_foot_, filling(area, layer).wall_width);
  return inset ? infill::outlines_of(*inset, context, filling(area, layer)) : inset.error();
}

Status Sections::contours(std::uint32_t index, Work& work) const {
  const Layer own = schedule_.layers[index].own();
  auto scratch = scratches_->take();
  const Status sliced = slice_layer(index, *scratch, work);
  work.lent = scratch->bytes();
  scratches_->give_back(std::move(scratch));
  if (!sliced) return sliced;
  work.paths.clear();
  work.path_body.clear();
  work.path_area.clear();
  if (!fills_) return {};
  if (part_slicer_) {
    work.surface.resize(part_slicer_->bodies());
    for (std::size_t a = 0; a < areas_.size(); ++a) {
      const Area& area = areas_[a];
      if (area.shared == UINT32_MAX) continue;
      const ContoursView surface = work.parts.of(area.shared, work.rebased);
      Contours earlier;
      for (std::size_t other = body_area_[area.body]; other < a; ++other) {
        if (!touch(slice::grown(areas_[other].box, grow_), slice::grown(area.box, grow_))) continue;
        earlier.append(work.surface[areas_[other].shared]);
      }
      auto rest = subtract_contours(surface, earlier);
      if (!rest) return rest.error();
      order_by_outer(*rest);
      work.surface[area.shared] = std::move(*rest);
    }
  }
  work.outlines.resize(areas_.size());
  work.original.resize(areas_.size());
  for (std::uint32_t a = 0; a < areas_.size(); ++a) {
    const Area& area = areas_[a];
    const bool copy = area.alike != a && is_moved(area, areas_[area.alike], work);
    work.original[a] = copy ? area.alike : a;
    work.outlines[a] = {};
    if (copy) continue;
    auto outlines = outlines_of(area, own, work);
    if (!outlines) return failed(area, outlines.error());
    work.outlines[a] = std::move(*outlines);
    if (Status status = divide_skins(index, area, work.outlines[a]); !status) return failed(area, status.error());
  }
  find_lost(work);
  return {};
}

void Sections::find_lost(Work& work) const {
  work.lost = {};
  for (std::uint32_t a = 0; a < areas_.size(); ++a) {
    const std::uint32_t original = work.original[a];
    const Contours& lost = work.outlines[original].lost;
    if (lost.size() == 0) continue;
    if (work.lost.area_mm2 == 0) {
      const Box &from = areas_[original].box, &to = areas_[a].box;
      const Point2 first = lost.point[0];
      work.lost.at = {static_cast<Nm>(first.x + to.lo.x - from.lo.x), static_cast<Nm>(first.y + to.lo.y - from.lo.y)};
    }
    work.lost.area_mm2 += square_mm(doubled_area(lost));
  }
}

Status Sections::fill(std::uint32_t index, Work& work) const {
  work.lent = 0;
  if (!fills_) return {};
  const Layer layer = schedule_.layers[index].own();
  work.path_body.push_back(0);
  work.path_area.push_back(0);
  for (std::uint32_t a = 0; a < areas_.size(); ++a) {
    const Area& area = areas_[a];
    if (const std::uint32_t original = work.original[a]; original != a) {
      const Box &from = areas_[original].box, &to = area.box;
      work.paths.append_moved(work.path_area[original], work.path_area[original + 1],
                              {to.lo.x - from.lo.x, to.lo.y - from.lo.y});
    } else if (const Status status =
                   infill::append_fill(std::move(work.outlines[a]), {layer, area.box}, filling(area, layer), work.paths);
               !status) {
      return failed(area, status.error());
    }
    work.outlines[a] = {};
    work.path_area.push_back(work.paths.size());
    if (a + 1 == body_area_[area.body + 1]) work.path_body.push_back(work.paths.size());
  }
  return {};
}

/// Of a region of an area, keeps what has the part above and below it in all layers that skins reach.
Status Sections::keep_covered(std::uint32_t index, const Area& area, Contours& region) const {
  const infill::FillParameters& parameters = filling(area, schedule_.layers[index].own());
  const Layer layer = schedule_.layers[index].layer;
  Buffer<std::uint32_t> rebased;
  ContainmentTest within;
  within.set_inner(region);
  for (const bool up : {true, false}) {
    std::optional<std::uint32_t> at = index;
    for (std::uint32_t steps = 0; region.size() > 0; ++steps) {
      const Layer face = schedule_.layers[*at].layer;
      // How much of the skin of a face is on the side of the layer that is away from it.
      const std::int64_t between = up ? std::int64_t{face.bottom} + face.thickness - layer.bottom - layer.thickness
                                      : std::int64_t{layer.bottom} - face.bottom;
      if (!infill::has_skin(parameters, up, steps, between)) break;
      at = up ? above(*at) : below(*at);
      if (!at) {
        region.clear();
        break;
      }
      const auto other = shared_contours(*at);
      if (!other) return other.error();
      const ContoursView section = (*other)->contours.of(area.body, rebased);
      if (within.certainly_in(section)) continue;
      auto both = intersect_contours(region, section, false);
      if (!both) return both.error();
      region = std::move(*both);
      within.set_inner(region);
    }
  }
  return {};
}

Status Sections::divide_skins(std::uint32_t index, const Area& area, infill::Outlines& outlines) const {
  const infill::FillParameters& parameters = filling(area, schedule_.layers[index].own());
  if (!infill::has_skins(parameters) || outlines.region.size() == 0) return {};
  Contours covered = outlines.region;
  if (Status status = keep_covered(index, area, covered); !status) return status;
  return infill::divide_skins(covered, {schedule_.layers[index].own(), area.box, of_walls_}, parameters, outlines);
}

std::uint32_t Sections::skin_reach() const {
  if (schedule_.layers.empty()) return 0;
  const auto thinnest =
      std::ranges::min_element(schedule_.layers, {}, [](const ScheduledLayer& l) { return l.layer.thickness; });
  std::uint32_t reach = 0;
  for (const FillPlan& plan : plans_) {
    reach = std::max(reach, infill::skin_layers(plan.base, thinnest->layer.thickness));
    for (const FillPlan::FillInterval& range : plan.ranges) {
      reach = std::max(reach, infill::skin_layers(range.parameters, thinnest->layer.thickness));
    }
  }
  return std::min(reach, static_cast<std::uint32_t>(schedule_.layers.size()));
}

Status Sections::layer(std::uint32_t index, Work& work) const {
  if (Status status = contours(index, work); !status) return status;
  return fill(index, work);
}

Error Sections::failed(const Area& area, const Error& error) const {
  const std::string name = fs::path(scene_->parts[area.part].path).filename().string();
  return {error.fault, fmt::format("{}: fill: {}", name, error.message)};
}

std::uint64_t Sections::bytes_bound(std::uint32_t index) const {
  // A contour point takes at most 50 bytes of text, which is kept in addition to the contours.
  const ScheduledLayer& scheduled = schedule_.layers[index];
  const auto bound = [&](const slice::Slicer& slicer) {
    return 3 * (slicer.layer_bytes_bound(scheduled.low) +
                (scheduled.low == scheduled.high ? 0 : 3 * slicer.layer_bytes_bound(scheduled.high)));
  };
  std::uint64_t contours = bound(own_slicers_.empty() ? *slicer_ : own_slicers_[scheduled.part]);
  if (part_slicer_) contours += bound(*part_slicer_);
  std::uint64_t walls = 0;
  for (const Area& area : areas_) walls = std::max<std::uint64_t>(walls, filling(area, scheduled.own()).walls);
  // A skin takes operations of the regions in addition.
  return ((fills_ ? 2 : 1) + (reach_ > 0 ? 2 : 0)) * contours + walls * contours / 16 +
         (1 << 14);  // walls hold few of a contour's bytes
}

Result<std::uint64_t> Sections::fill_bytes_bound(std::uint32_t index, Work& work, TextBytes text) const {
  if (!fills_) return std::uint64_t{0};
  constexpr std::uint64_t kOfPoint = 17, kOfPath = 4;
  const Layer own = schedule_.layers[index].own();
  std::uint64_t bytes = 0, scratch = 0;
  std::vector<std::uint64_t> of_area(areas_.size());
  for (std::size_t a = 0; a < areas_.size(); ++a) {
    const Area& area = areas_[a];
    if (work.original[a] != a) {
      bytes += of_area[a] = of_area[work.original[a]];
      continue;
    }
    const auto bound = infill::bound_fill(contours_of(area, work), work.outlines[a], {own, area.box}, filling(area, own));
    if (!bound) return failed(area, bound.error());
    of_area[a] =
        bound->points * (kOfPoint + text.point) + bound->intervals * text.interval + bound->paths * (kOfPath + text.path);
    bytes += of_area[a];
    scratch = std::max(scratch, bound->scratch_bytes);
  }
  // Buffers grow by half or double, so their capacity is at most twice their content.
  return 2 * bytes + scratch;
}

std::uint64_t Sections::Work::bytes() const {
  const auto of = [](const Contours& c) { return bytes_held(c.point) + bytes_held(c.offset); };
  std::uint64_t total = lent + of(contours.contours) + of(highest.contours) + of(parts.contours) + bytes_held(text);
  for (const Contours& c : surface) total += of(c);
  for (const infill::Outlines& o : outlines) total += o.bytes();
  return total + bytes_held(paths.point) + bytes_held(paths.kind) + bytes_held(paths.width) + bytes_held(paths.line) +
         bytes_held(paths.offset) + bytes_held(original);
}

}  // namespace lamina::pipeline
