#include "pipeline/plan/beads.h"

#include <algorithm>
#include <cmath>

#include "stages/segment/cut.h"
#include "stages/segment/segmentation.h"

namespace lamina::pipeline {
namespace {

std::uint64_t bytes_of(const Runs& runs) { return bytes_held(runs.row_offset) + bytes_held(runs.change); }

/// Powder beads have exactly the requested widths.
void set_widths(const FillSettings& fill, SegmentSettings& segment) {
  if (!segment.thick_width_mm) segment.thick_width_mm = fill.width_mm;
  if (!segment.continuous_width_mm) segment.continuous_width_mm = fill.width_mm;
  if (!segment.thin_width_mm) segment.thin_width_mm = fill.width_mm / 2;
}

}  // namespace

std::uint64_t BeadWork::bytes() const { return sections.bytes() + beads.bytes() + bytes_of(inner); }

Result<SegmentPlan> plan_bead_segments(const Job& job, FillRequest& fill, std::vector<Warning>& warnings) {
  if (job.dose.core < 1) {
    return Error{Fault::kUsage,
                 "dose.core: a part that is filled by beads has no core to thin out; leave out --core or the filling"};
  }
  if (job.heights.containment != Containment::kAcross) {
    return Error{Fault::kUsage, "--containment: a filling is cut in the middle of layers; leave out one of the two"};
  }
  SegmentRequest request = job.segment;
  set_widths(fill.all, request.all);
  segment::Calibration exact;  // no tables: beads are as wide as the job says
  exact.width_mm = fill.all.width_mm;
  auto segments = plan_segments(request, exact, fill);
  if (!segments) return segments.error();
  const auto warn = [&](const SegmentRange& range) {
    if (!range.settings.on) return;
    for (Warning& warning : segment::warnings(range.plan, exact)) warnings.push_back(std::move(warning));
  };
  std::ranges::for_each(segments->ranges, warn);
  warn(segments->base);
  return segments;
}

Beads::Beads(const Job& job, const PixelGrid& grid, const Sections& sections, const SegmentPlan& segments)
    : grid_(grid), sections_(&sections), segments_(&segments), ends_(job.dose.bead_ends) {
  const std::int64_t shell = nm_of(job.dose.shell_mm);
  if (shell > 0) shell_ = dose::reach_of(grid, shell, shell);
}

Status Beads::deposit(const Layer& layer, BeadWork& work) const {
  const ToolpathsView all = work.sections.paths;
  work.beads.clear();
  work.beads.reserve(all.point.size());
  const std::span<const std::uint32_t> path_area = work.sections.path_area;
  for (std::uint32_t a = 0; a + 1 < path_area.size(); ++a) {
    const Sections::Area& area = sections_->areas()[a];
    const SegmentRange& range = segments_->at(Sections::height_in(area, layer));
    const auto cut = layer_cut(range, sections_->filling(area, layer), layer, area.box);
    if (!cut) return cut.error();
    ToolpathsView paths = all;
    paths.offset = all.offset.subspan(path_area[a], path_area[a + 1] - path_area[a] + 1);
    if (Status status = segment::check_interval_count(range.plan, *cut, paths, layer.index); !status) return status;
    const auto width = [](double millimetres) { return static_cast<Nm>(nm_of(millimetres)); };
    const segment::Segmentation& of = range.plan;
    const raster::BeadWidths widths{cut->on, width(of.thick_width_mm), width(of.thin_width_mm), width(of.continuous_width_mm)};
    raster::BeadPen pen(work.beads, widths, ends_);
    segment::for_each_interval(paths, *cut, [&](const PathInterval& s) { pen.deposit(s); });
  }
  return {};
}

void Beads::apply(Runs& image, Runs& scratch, BeadWork& work) const {
  const bool has_shell = !shell_.half_width.empty();
  if (has_shell) dose::erode(image, shell_, work.inner);
  raster::keep_beads(image, work.beads, has_shell ? &work.inner : nullptr, scratch);
}

Beads::Expected Beads::expected(std::uint32_t index) const {
  const Layer layer = sections_->layers()[index].own();
  const double rows_per_mm = grid_.y.pixels_per_nm() * kNmPerMm;
  // Of walls and closed curves.
  const auto corners = static_cast<double>(sections_->slicer().cut_bound(index).cuts);
  double beads = 1, spans = 1;
  for (const Sections::Area& area : sections_->areas()) {
    const Box& box = area.box;
    const std::int64_t height = Sections::height_in(area, layer);
    if (height < 0 || height > std::int64_t{box.hi.z} - box.lo.z) continue;
    const infill::FillParameters& fill = sections_->filling(area, layer);
    const SegmentRange& range = segments_->at(height);
    const double width = mm(fill.width), distance = infill::mean_distance_mm(fill);
    const double of_bead = width * rows_per_mm + 2;  // rows of a bead along x
    double loops = fill.walls;
    if (fill.pattern == infill::Pattern::kContour) loops += mm(std::min(box.width(), box.depth())) / 2 / distance;
    if (fill.pattern == infill::Pattern::kContourRaster) loops += fill.loops;
    spans += loops * corners * of_bead + 2 * loops * mm(box.width() + box.depth()) * rows_per_mm;
    beads += loops * corners;
    if (fill.pattern == infill::Pattern::kNone) continue;
    const double length = mm(box.width()) * mm(box.depth()) / distance;
    double interval = range.settings.on ? std::min(range.plan.thick_mm, range.plan.thin_mm) : INFINITY;
    if (fill.pattern == infill::Pattern::kContour) {
      spans += length / interval * of_bead;  // closed curves are divided where they have no corner
      beads += length / interval;
      continue;
    }
    if (fill.pattern != infill::Pattern::kRaster && fill.pattern != infill::Pattern::kContourRaster)
      interval = std::min(interval, width);
    const double ends = length / interval + 2 * mm(box.width() + box.depth()) / distance;
    spans += length * rows_per_mm + ends * of_bead;
    beads += ends;
  }
  return {static_cast<std::uint64_t>(beads), static_cast<std::uint64_t>(spans)};
}

std::uint64_t Beads::bytes_expected(std::uint32_t layer) const {
  const std::uint64_t rows = grid_.rows();
  const auto [beads, spans] = expected(layer);
  const std::uint64_t of_beads = 64 * beads + 4 * rows;  // a bead and its index take 44 bytes
  const std::uint64_t at_once = 2 * (spans + raster::kBeadBandRows * beads) / std::max<std::uint64_t>(rows, 1);  // in a band
  const std::uint64_t of_band = raster::BeadRaster::band_bytes(grid_, at_once);
  const std::uint64_t of_images = 2 * (8 * spans + 4 * rows);  // second, inner
  const std::uint64_t of_paths = 34 * beads;                   // a point of a toolpath is 17 bytes, and begins a bead or more
  return sections_->bytes_bound(layer) + of_beads + of_band + of_images + of_paths;
}

}  // namespace lamina::pipeline
