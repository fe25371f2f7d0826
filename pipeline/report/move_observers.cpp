#include "pipeline/report/move_observers.h"

#include <fmt/format.h>

#include <string>
#include <utility>

#include "pipeline/plan/heights.h"
#include "pipeline/report/deposited_summary.h"
#include "stages/checks/layer_warnings.h"
#include "stages/formats/gcode/write_gcode.h"
#include "stages/support/text/number_text.h"
#include "stages/support/text/readable.h"

namespace lamina::pipeline {
namespace {

using MoveObserver = Observer<void>;

/// Beads of the parts, travels and the skirt.
class BeadObserver : public MoveObserver {
 public:
  BeadObserver(const Plan& plan, const PathFacts& sums) : plan_(plan), sums_(sums) {}
  void layer(const LayerRecord& record, const void*) override {
    const DepositedSums& deposited = record.paths->deposited;
    paths_.add(record.layer, record.paths->open, deposited.segments.lines, deposited.segments.thin);
  }
  void warn(const Summary& summary, std::vector<Warning>& warnings) override {
    paths_.report(plan_.sections->fills(), sums_.totals.part_moves(), summary.layers_planned, warnings);
  }
  void report(Summary& summary) const override {
    const formats::MoveTotals& totals = sums_.totals;
    summary.volume_mm3 = totals.volume_mm3 - totals.auxiliary_mm3;
    summary.results.emplace_back(
        "beads", fmt::format("{} moves, {:.2f} m, {:.3f} cm3; {} travels, {:.2f} m", readable_count(totals.part_moves()),
                             (totals.bead_mm - totals.auxiliary_mm) / 1000, summary.volume_mm3 / 1000,
                             readable_count(totals.travels), totals.travel_mm / 1000));
    const char* none = plan_.moves->profile.machine.skirt.loops == 0 || !plan_.sections->fills() ? "none"
                       : plan_.range[0] > 0 ? "none: --layers leaves the first layer out"
                                            : "none: no room on the bed";
    summary.results.emplace_back(
        "skirt", totals.auxiliary_moves == 0
                     ? std::string(none)
                     : fmt::format("{:.1f} mm, {:.1f} mm3, {:.1f} mm of filament, beside the parts", totals.auxiliary_mm,
                                   totals.auxiliary_mm3, totals.auxiliary_filament_mm));
  }

 private:
  const Plan& plan_;
  const PathFacts& sums_;
  checks::PathWarnings paths_;
};

/// Segmented lines and the pores between them, by range of heights.
class SegmentObserver : public MoveObserver {
 public:
  SegmentObserver(const Plan& plan, const PathFacts& sums)
      : plan_(plan), sums_(sums), segmented_(plan.segments->segmented()), by_layer_(has_ranges_by_layer(plan)) {
    for (const auto& [heights, range] : segmented_) ranges_.push_back({heights, {}});
  }
  void layer(const LayerRecord& record, const void*) override {
    const DepositedSums& deposited = record.paths->deposited;
    if (record.layer.index == plan_.range[0]) first_layer_points_ = deposited.segments.points();
    const std::vector<RangePores>& by_range = record.paths->by_range;
    const auto& areas = plan_.sections->areas();
    const SegmentRange& in = plan_.segments->at(record.layer.plane() - (areas.empty() ? 0 : areas.front().box.lo.z));
    for (std::size_t i = 0; i < segmented_.size(); ++i) {
      if (by_layer_) {
        if (i < by_range.size()) add(ranges_[i], by_range[i].pores, by_range[i].area_mm2);
      } else if (segmented_[i].second == &in) {
        add(ranges_[i], deposited.pores, record.paths->area_mm2);
      }
    }
    if (!by_layer_ || !by_range.empty() || deposited.segments.lines == 0) return;
    if (ranges_.size() == segmented_.size()) ranges_.push_back({"all ranges, layers of an earlier build", {}});
    add(ranges_.back(), deposited.pores, record.paths->area_mm2);
  }
  void warn(const Summary&, std::vector<Warning>& warnings) override {
    std::string slow = speed_warning(sums_.deposited.shorts, plan_.moves->profile.machine);
    if (!slow.empty()) warnings.push_back({"acceleration", std::move(slow)});
  }
  void report(Summary& summary) const override {
    report_deposited(sums_.deposited, ranges_, plan_.moves->profile.machine, first_layer_points_, summary.results,
                     summary.facts);
  }

 private:
  static void add(DepositedRange& range, const PoreCounts& pores, double area_mm2) {
    range.pores.add(pores);
    range.area_mm2 += area_mm2;
  }

  const Plan& plan_;
  const PathFacts& sums_;
  decltype(std::declval<SegmentPlan>().segmented()) segmented_;
  bool by_layer_;                       // records have the pores of each range
  std::vector<DepositedRange> ranges_;  // of segmented_, and one of layers of an earlier build
  std::uint64_t first_layer_points_ = 0;
};

/// Filament and time.
class FilamentObserver : public MoveObserver {
 public:
  FilamentObserver(const Plan& plan, const PathFacts& sums) : plan_(plan), sums_(sums) {}
  void layer(const LayerRecord&, const void*) override {}
  void report(Summary& summary) const override {
    const formats::MoveTotals& totals = sums_.totals;
    const auto& material = plan_.moves->profile.machine.material;
    const double filament_cm3 = totals.filament_mm * material.mm3_of_e() / 1000;
    const double filament_g = filament_cm3 * material.density_g_cm3;
    summary.results.emplace_back("filament",
                                 fmt::format("{:.1f} mm, {:.2f} cm3, {:.2f} g", totals.filament_mm, filament_cm3, filament_g));
    summary.results.emplace_back("printing", fmt::format("about {}", formats::gcode::time_text(totals.seconds)));
    Json& facts = summary.facts;
    facts["moves"] = totals.part_moves();
    facts["travels"] = totals.travels;
    facts["retractions"] = totals.retractions;
    facts["stored_points"] = sums_.stored_points;
    facts["bead_mm"] = totals.bead_mm - totals.auxiliary_mm;
    facts["travel_mm"] = totals.travel_mm;
    facts["filament_mm"] = totals.filament_mm;
    facts["filament_g"] = filament_g;
    facts["skirt"] = {{"moves", totals.auxiliary_moves},
                      {"bead_mm", totals.auxiliary_mm},
                      {"volume_mm3", totals.auxiliary_mm3},
                      {"filament_mm", totals.auxiliary_filament_mm}};
    facts["print_seconds"] = totals.seconds;
  }

 private:
  const Plan& plan_;
  const PathFacts& sums_;
};

}  // namespace

bool has_ranges_by_layer(const Plan& plan) {
  if (plan.segments->ranges.empty() || !plan.segments->any()) return false;
  // A layer that continues above a part is in that part's topmost range, regardless of the range of others.
  if (covers_top(plan.job) || plan.job.heights.containment == Containment::kOutside) return true;
  const auto& areas = plan.sections->areas();
  return std::ranges::any_of(areas, [&](const Sections::Area& area) { return area.box.lo.z != areas.front().box.lo.z; });
}

void observe_moves(const Plan& plan, const PathFacts& sums, Observers<void>& observers) {
  observers.add<BeadObserver>(plan, sums);
  observers.add<SegmentObserver>(plan, sums);
  observers.add<FilamentObserver>(plan, sums);
}

void report_move_plan(const Plan& plan, Summary& summary) {
  summary.output = plan.job.output;
  summary.machine = plan.moves->profile.machine.name;
  summary.format = plan.moves->profile.machine.format;
  summary.index_bytes = plan.sections->slicer().index_bytes();
  report_bead(plan.moves->profile.machine, plan.moves->left_out,
              plan.job.heights.containment == Containment::kInside ? "top" : "middle", summary.head, summary.facts);
  const double tolerance_um = tolerance_um_of(plan.job, plan.product);
  summary.head.emplace_back("contours", tolerance_um > 0 ? fmt::format("points are left out that move them by at most {} um",
                                                                       number_text(tolerance_um))
                                                         : "all their points");
  summary.facts["tolerance_um"] = tolerance_um;
}

}  // namespace lamina::pipeline
