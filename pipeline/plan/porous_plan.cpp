#include "pipeline/plan/porous_plan.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "pipeline/job/keys.h"
#include "pipeline/plan/layer_cut.h"
#include "pipeline/text/json_text.h"
#include "stages/raster/porous.h"
#include "stages/segment/expand.h"
#include "stages/segment/predict.h"

namespace lamina::pipeline {
namespace {

std::uint64_t bytes_of(const Runs& runs) { return bytes_held(runs.row_offset) + bytes_held(runs.change); }

/// Widths of a powder's beads are what is asked for.
void set_widths(const FillSettings& fill, SegmentSettings& segment) {
  if (!segment.thick_width_mm) segment.thick_width_mm = fill.width_mm;
  if (!segment.continuous_width_mm) segment.continuous_width_mm = fill.width_mm;
  if (!segment.thin_width_mm) segment.thin_width_mm = fill.width_mm / 2;
}

/// The mean distance of a filling's lines, mm; for estimates.
double mean_distance_mm(const infill::FillParameters& fill) {
  if (fill.pattern == infill::Pattern::kHoneycomb || fill.pattern == infill::Pattern::kQuatrefoil) return mm(fill.cell) / 2;
  double sum = 0;
  if (!fill.distances.empty()) {
    for (const Nm distance : fill.distances) sum += mm(distance);
    return std::max(sum / static_cast<double>(fill.distances.size()), mm(fill.width) / 4);
  }
  for (const Nm gap : fill.gaps) sum += mm(gap);
  const double mean = sum / static_cast<double>(std::max<std::size_t>(fill.gaps.size(), 1)) / fill.group;
  return std::max(mm(fill.width) + mean, mm(fill.width) / 4);
}

}  // namespace

std::uint64_t PorousWork::bytes() const { return plan.bytes() + beads.bytes() + bytes_of(laid) + bytes_of(inner); }

std::string filling_text(const Job& job) {
  std::string text;
  for (const std::string_view section : {"fill", "segment"}) {
    text += fmt::format("\n[{}]\n", section);
    for (const JobKey& key : job_keys()) {
      const std::string value = key.section == section ? key.write(job) : std::string();
      if (!value.empty()) text += fmt::format("{} = {}\n", key.name, json_string(value));
    }
  }
  return text;
}

Result<bool> PorousPlan::asked(const Job& job) {
  if (job.segment.all.on || !job.segment.by_height.empty()) return true;
  for (const PartRequest& part : job.parts) {
    const auto filling = plan_filling(job.fill, part.fill);
    if (!filling) return filling.error();
    if (filling->fills()) return true;
  }
  return false;
}

Result<PorousPlan> PorousPlan::make(const Job& asked, const PixelGrid& grid, const ProgressCallback& progress) {
  if (asked.dose.core < 1) {
    return Error{Fault::kUsage,
                 "dose.core: a part that is filled by beads has no core to thin out; leave out --core or the filling"};
  }
  if (asked.heights.containment != Containment::kAcross) {
    return Error{Fault::kUsage, "--containment: a filling is cut in the middle of layers; leave out one of the two"};
  }
  Job job = asked;
  set_widths(job.fill.all, job.segment.all);
  segment::Calibration exact;  // no tables: beads are as wide as they are asked to be
  exact.width_mm = job.fill.all.width_mm;
  auto segments = plan_segments(job.segment, exact, job.fill);
  if (!segments) return segments.error();
  PorousPlan plan;
  plan.grid_ = grid;
  for (const auto& range : segments->ranges) {
    if (!range.settings.on) continue;
    for (std::string& warning : segment::warnings(range.plan, exact)) plan.warnings_.push_back(std::move(warning));
  }
  if (segments->base.settings.on) {
    for (std::string& warning : segment::warnings(segments->base.plan, exact)) plan.warnings_.push_back(std::move(warning));
  }
  plan.segments_ = std::make_unique<SegmentPlan>(std::move(*segments));
  auto slices = SlicePlan::make(job, progress);
  if (!slices) return slices.error();
  plan.slices_ = std::make_unique<SlicePlan>(std::move(*slices));
  if (Status status = check_thin_stretches(*plan.segments_, *plan.slices_); !status) return status.error();
  plan.ends_ = job.dose.bead_ends;
  const std::int64_t shell = nm_of(job.dose.shell_mm);
  if (shell > 0) plan.shell_ = dose::reach_of(grid, shell, shell);
  return plan;
}

Status PorousPlan::apply(const Layer& layer, Runs& image, Runs& scratch, std::unique_ptr<PorousWork>& kept) const {
  if (!kept) kept = std::make_unique<PorousWork>(grid_);
  PorousWork& work = *kept;
  if (Status status = slices_->layer(layer.index, work.plan); !status) return status;
  work.beads.clear();
  const ToolpathsView all = work.plan.paths;
  for (std::uint32_t a = 0; a + 1 < work.plan.path_area.size(); ++a) {
    const SlicePlan::Area& area = slices_->areas()[a];
    const Box& part = area.box;
    const SegmentRange& range = segments_->at(std::int64_t{layer.plane()} - part.lo.z);
    const auto cut = layer_cut(range, slices_->filling(area, layer), layer, part);
    if (!cut) return cut.error();
    ToolpathsView paths = all;
    paths.offset = all.offset.subspan(work.plan.path_area[a], work.plan.path_area[a + 1] - work.plan.path_area[a] + 1);
    const auto width = [](double millimetres) { return static_cast<Nm>(nm_of(millimetres)); };
    const segment::Segmentation& of = range.plan;
    const raster::BeadWidths widths{cut->on, width(of.thick_width_mm), width(of.thin_width_mm), width(of.continuous_width_mm)};
    raster::BeadPen pen(work.beads, widths, ends_);
    segment::for_each_stretch(paths, *cut, [&](const Stretch& s) { pen.lay(s); });
  }
  work.beads.runs(work.laid);
  const bool has_shell = !shell_.half_width.empty();
  if (has_shell) dose::erode(image, shell_, work.inner);
  raster::keep_beads(image, work.laid, has_shell ? &work.inner : nullptr, scratch);
  return {};
}

std::uint64_t PorousPlan::spans_expected(std::uint32_t index) const {
  const Layer layer = slices_->layers()[index].own();
  const double rows_per_mm = grid_.y.pixels_per_nm() * kNmPerMm;
  // Of a cut the slicer needs some 140 bytes: so many corners have walls and closed curves.
  const double corners = static_cast<double>(slices_->slicer().layer_bytes_bound(index)) / 140;
  double spans = 0;
  for (const SlicePlan::Area& area : slices_->areas()) {
    const Box& box = area.box;
    if (layer.plane() < box.lo.z || layer.plane() > box.hi.z) continue;
    const infill::FillParameters& fill = slices_->filling(area, layer);
    const SegmentRange& range = segments_->at(std::int64_t{layer.plane()} - box.lo.z);
    const double width = mm(fill.width), distance = mean_distance_mm(fill);
    const double of_bead = width * rows_per_mm + 2;  // rows of a bead along x
    double loops = fill.walls;
    if (fill.pattern == infill::Pattern::kContour) loops += mm(std::min(box.width(), box.depth())) / 2 / distance;
    if (fill.pattern == infill::Pattern::kContourRaster) loops += fill.loops;
    spans += loops * corners * of_bead + 2 * loops * mm(box.width() + box.depth()) * rows_per_mm;
    if (fill.pattern == infill::Pattern::kNone) continue;
    const double length = mm(box.width()) * mm(box.depth()) / distance;
    double stretch = range.settings.on ? std::min(range.plan.thick_mm, range.plan.thin_mm) : INFINITY;
    if (fill.pattern == infill::Pattern::kContour) {
      spans += length / stretch * of_bead;  // closed curves are divided where they have no corner
      continue;
    }
    if (fill.pattern != infill::Pattern::kRaster && fill.pattern != infill::Pattern::kContourRaster)
      stretch = std::min(stretch, width);
    spans += length * rows_per_mm + (length / stretch + 2 * mm(box.width() + box.depth()) / distance) * of_bead;
  }
  return static_cast<std::uint64_t>(spans) + 1;
}

std::uint64_t PorousPlan::bytes_expected(std::uint32_t layer) const {
  const std::uint64_t rows = grid_.rows(), spans = spans_expected(layer);
  const std::uint64_t of_beads = 24 * spans + 4 * rows;        // spans, and in the order of rows
  const std::uint64_t of_images = 2 * (8 * spans + 4 * rows);  // laid, inner
  const std::uint64_t of_paths = 20 * spans;                   // a point of a toolpath is 17 bytes, and has a span or more
  return slices_->bytes_bound(layer) + of_beads + of_images + of_paths;
}

}  // namespace lamina::pipeline
