#include "pipeline/report/path_observers.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <utility>

#include "pipeline/plan/layers.h"
#include "pipeline/plan/raft.h"
#include "pipeline/report/overhang_observer.h"
#include "stages/checks/layer_warnings.h"
#include "stages/checks/lost_features_tally.h"
#include "stages/formats/gcode/write_gcode.h"
#include "stages/geometry/bead_section.h"
#include "stages/support/text/number_text.h"
#include "stages/support/text/readable.h"

namespace lamina::pipeline {
namespace {

/// The share of a speed that stretches come up to without a warning.
constexpr double kNearStated = 0.75;

double mean(double sum, std::uint64_t count) { return count > 0 ? sum / static_cast<double>(count) : 0; }

/// The layers of a range of heights with segmented lines.
struct DepositedRange {
  std::string heights;  // "3 to 5.7 mm", above the bottoms of parts, "" for all
  PoreCounts pores;
  double area_mm2 = 0;  // within the contours, over all layers
};

std::string pores_text(const DepositedRange& range) {
  const PoreCounts& p = range.pores;
  std::string text = range.heights.empty() ? "" : range.heights + ": ";
  if (p.closed == 0) text += "none closes";
  if (p.closed > 0) {
    text += fmt::format("{} of {:.2f} x {:.3f} mm (ratio {:.2f}), {:.2f} a mm2 of layer", readable_count(p.closed),
                        mean(p.length_mm, p.closed), mean(p.width_mm, p.closed), p.width_mm / p.length_mm,
                        range.area_mm2 > 0 ? static_cast<double>(p.closed) / range.area_mm2 : 0);
  }
  if (p.open > 0) {
    text += fmt::format("; {} stay open: lines {:.3f} mm apart, which thick segments do not bridge", readable_count(p.open),
                        mean(p.distance_mm, p.open));
  }
  if (p.filled > 0) text += fmt::format("; {} have no space and are filled", readable_count(p.filled));
  if (p.edges > 0) text += fmt::format("; {} at walls and ends of lines", readable_count(p.edges));
  if (p.crossing > 0) {
    text += fmt::format("; {} of {} thin segments are under one of the next layer", readable_count(p.crossed),
                        readable_count(p.crossing));
  }
  return text;
}

Json pores_json(const DepositedRange& range) {
  const PoreCounts& p = range.pores;
  return {{"heights", range.heights},
          {"closed", p.closed},
          {"open", p.open},
          {"filled", p.filled},
          {"edges", p.edges},
          {"crossing", p.crossing},
          {"crossed", p.crossed},
          {"length_mm", mean(p.length_mm, p.closed)},
          {"width_mm", mean(p.width_mm, p.closed)},
          {"aspect", p.length_mm > 0 ? p.width_mm / p.length_mm : 0},
          {"closed_per_mm2", range.area_mm2 > 0 ? static_cast<double>(p.closed) / range.area_mm2 : 0}};
}

std::string short_text(const ShortIntervals& shorts, const Extruder& machine) {
  return fmt::format("{} segments are too short for {:g} mm/s2: the shortest has {:.3f} mm, none exceeds {:.1f} of {:g} mm/s",
                     readable_count(shorts.count), machine.speed.acceleration_mm_s2, shorts.shortest_mm, shorts.reached_mm_s,
                     shorts.commanded_mm_s);
}

using ContourObserver = Observer<slice::SectionReport>;

/// Adds stretches, porosity, pores and speeds that are not reached to a summary, and the same numbers to its object.
/// sums    of the job. points_first_layer  of segmented lines in its first layer
void report_deposited(const DepositedSums& sums, const std::vector<DepositedRange>& ranges, const Extruder& machine,
                      std::uint64_t points_first_layer, Summary::Lines& lines, Json& facts) {
  const SegmentCounts& segments = sums.segments;
  const PlannedPorosity& porosity = sums.porosity;
  const ShortIntervals& shorts = sums.shorts;
  const bool solid = porosity.solid_mm3 > 0;
  if (segments.intervals > 0) {
    lines.emplace_back("segments",
                       fmt::format("{} lines, {} thick and {} thin segments, {} points", readable_count(segments.lines),
                                   readable_count(segments.intervals - segments.thin), readable_count(segments.thin),
                                   readable_count(segments.points())));
  }
  if (solid) {
    std::string text = fmt::format("{:.2f} % by what is extruded", 100 * porosity.by_extrusion());
    if (segments.intervals > 0) text += fmt::format(", {:.2f} % by measured widths", 100 * porosity.by_widths());
    lines.emplace_back("porosity", text);
  }
  facts["segments"] = {{"lines", segments.lines}, {"pieces", segments.pieces},   {"intervals", segments.intervals},
                       {"thin", segments.thin},   {"points", segments.points()}, {"points_first_layer", points_first_layer}};
  facts["solid_mm3"] = porosity.solid_mm3;
  facts["porosity"] = {{"by_extrusion", solid ? porosity.by_extrusion() : 0}, {"by_widths", solid ? porosity.by_widths() : 0}};
  facts["pores"] = Json::array();
  for (const DepositedRange& range : ranges) {
    if (ranges.size() == 1 || range.area_mm2 > 0) lines.emplace_back("pores", pores_text(range));  // else no layer lies in it
    facts["pores"].push_back(pores_json(range));
  }
  if (shorts.count > 0) lines.emplace_back("speeds", short_text(shorts, machine));
  facts["too_short"] = {{"intervals", shorts.count},
                        {"shortest_mm", shorts.shortest_mm},
                        {"reached_mm_s", shorts.reached_mm_s},
                        {"commanded_mm_s", shorts.commanded_mm_s}};
}

/// What 100 % of extrusion is, and how many layers at the top are left out, before any deposition; as above.
/// cut_at  "middle" or "top", the place of a layer that decides whether it is empty
void report_bead(const Extruder& machine, std::uint32_t left_out, std::string_view cut_at, Summary::Lines& lines, Json& facts) {
  constexpr std::array<std::string_view, 3> kShapes{"stadium", "rectangle", "ellipse"};
  const auto& material = machine.material;
  const std::string_view shape = kShapes[static_cast<std::size_t>(material.shape())];
  std::string text = fmt::format("100 % is a {} of the bead's width and the layer's height", shape);
  if (material.flow != 1) text += fmt::format(" x {:g}", material.flow);
  if (!material.bead_area && material.flow != 1) text += " (the profile has a flow and no bead_area)";
  if (material.feed_ratio != 1) text += fmt::format("; the machine feeds {:g} of what E says", material.feed_ratio);
  lines.emplace_back("bead", text);
  facts["bead"] = {{"area", shape}, {"flow", material.flow}, {"feed_ratio", material.feed_ratio}};
  facts["layers_left_out"] = left_out;
  if (left_out == 0) return;
  lines.emplace_back("top", fmt::format("{} more layer{} left out: empty, the {} is above the parts", left_out,
                                        left_out == 1 ? " is" : "s are", cut_at));
}

/// "612 segments are too short for 400 mm/s2: ..." if most of the speed is missed; else "".
std::string speed_warning(const ShortIntervals& shorts, const Extruder& machine) {
  return shorts.reached_mm_s < kNearStated * shorts.commanded_mm_s ? short_text(shorts, machine) : std::string();
}

/// Contours and their filling.
class PathObserver : public ContourObserver {
 public:
  explicit PathObserver(const Plan& plan) : plan_(plan) {}
  void layer(const LayerRecord& record, const slice::SectionReport* made) override {
    sums_.add(*record.paths);
    volume_mm3_ += record.paths->area_mm2 * mm(record.layer.thickness);
    if (made == nullptr) return;
    cuts_ += made->cuts;
    level_.add(record.layer, made->level);
  }
  void warn(const Summary&, std::vector<Warning>& warnings) override {
    level_.report(plan_.sections->names()[level_.owner()], warnings);
  }
  void report(Summary& summary) const override {
    summary.volume_mm3 = volume_mm3_;
    summary.results.emplace_back(
        "contours", fmt::format("{} with {} points, {:.3f} cm3; {} layers needed a union", readable_count(sums_.contours),
                                readable_count(sums_.points), volume_mm3_ / 1000, readable_count(sums_.merged)));
    if (sums_.paths > 0) {
      const std::string_view written = plan_.job.slice.format == "3mf" ? ", not in the file" : "";
      summary.results.emplace_back(
          "filling", fmt::format("{} paths, {:.2f} m of bead{}", readable_count(sums_.paths), sums_.bead_mm / 1000, written));
    }
    summary.facts["cuts"] = cuts_;
    summary.facts["contours"] = sums_.contours;
    summary.facts["points"] = sums_.points;
    summary.facts["paths"] = sums_.paths;
    summary.facts["bead_mm"] = sums_.bead_mm;
    summary.facts["merged_layers"] = sums_.merged;
  }

 private:
  const Plan& plan_;
  PathFacts sums_;
  double volume_mm3_ = 0;
  std::uint64_t cuts_ = 0;
  checks::LevelWarnings level_;
};

/// Gaps between cuts: closed, or left open.
class GapObserver : public ContourObserver {
 public:
  void layer(const LayerRecord& record, const slice::SectionReport* made) override {
    open_chains_ += record.paths->open;
    if (made == nullptr) return;
    closed_ += made->gaps.closed;
    largest_mm_ = std::max(largest_mm_, mm(made->gaps.largest_closed));
    if (made->gaps.open > 0) open_.add(record.layer);
  }
  void warn(const Summary&, std::vector<Warning>& warnings) override {
    open_.warn("chains-open",
               fmt::format("{} chains of cuts stay open, first in {}: they bound nothing and are left out; leave out "
                           "--no-repair to close the parts, or give a longer --bridge",
                           open_chains_, open_.first),
               warnings);
  }
  void report(Summary& summary) const override {
    if (closed_ > 0 || open_chains_ > 0) {
      summary.results.emplace_back("gaps",
                                   fmt::format("{} closed by straight segments, the longest {:.6f} mm; {} chains left open",
                                               readable_count(closed_), largest_mm_, readable_count(open_chains_)));
    }
    summary.facts["gaps_closed"] = closed_;
    summary.facts["largest_gap_mm"] = largest_mm_;
    summary.facts["open_chains"] = open_chains_;
  }

 private:
  std::uint64_t closed_ = 0, open_chains_ = 0;
  double largest_mm_ = 0;  // of those closed
  checks::ReportedLayers open_;
};

/// Layers that are solid before a negative offset and empty after it.
class OffsetObserver : public ContourObserver {
 public:
  explicit OffsetObserver(const Plan& plan) : plan_(plan) {}
  void layer(const LayerRecord& record, const slice::SectionReport* made) override {
    if (made == nullptr || plan_.job.slice.offset_mm >= 0) return;
    if (made->cuts > 0 && record.paths->contours == 0 && made->gaps.open == 0) emptied_.add(record.layer);
  }
  void warn(const Summary& summary, std::vector<Warning>& warnings) override {
    emptied_.warn("offset",
                  fmt::format("--offset {} leaves nothing of {} of {} layers, first {}: they are thinner than twice that; "
                              "give a smaller offset",
                              number_text(plan_.job.slice.offset_mm), emptied_.count, summary.layers_planned, emptied_.first),
                  warnings);
  }
  void report(Summary& summary) const override { summary.facts["emptied_layers"] = emptied_.count; }

 private:
  const Plan& plan_;
  checks::ReportedLayers emptied_;
};

/// Whether any bead of the filling fits into the parts.
class FillingObserver : public ContourObserver {
 public:
  explicit FillingObserver(const Plan& plan) : plan_(plan) {}
  void layer(const LayerRecord& record, const slice::SectionReport*) override {
    contours_ += record.paths->contours;
    paths_ += record.paths->paths;
    lost_.add(record.layer, record.paths->lost);
  }
  void warn(const Summary&, std::vector<Warning>& warnings) override {
    lost_.warn(warnings);
    if (!plan_.sections->fills() || contours_ == 0 || paths_ > 0) return;
    warnings.push_back({"no-bead",
                        "no bead of the filling fits into the parts: they are narrower than walls and filling "
                        "require; give a smaller --bead"});
  }

 private:
  const Plan& plan_;
  std::uint64_t contours_ = 0, paths_ = 0;
  checks::LostFeaturesTally lost_;
};

using MoveObserver = Observer<void>;

/// Beads of the parts, travels and the skirt.
class BeadObserver : public MoveObserver {
 public:
  BeadObserver(const Plan& plan, const PathFacts& sums) : plan_(plan), sums_(sums) {}
  void layer(const LayerRecord& record, const void*) override {
    const DepositedSums& deposited = record.paths->deposited;
    paths_.add(record.layer, record.paths->open, deposited.segments.lines, deposited.segments.thin);
    lost_.add(record.layer, record.paths->lost);
  }
  void warn(const Summary& summary, std::vector<Warning>& warnings) override {
    paths_.report(plan_.sections->fills(), sums_.totals.part_moves(), summary.layers_planned, warnings);
    lost_.warn(warnings);
  }
  void report(Summary& summary) const override {
    const formats::MoveTotals& totals = sums_.totals;
    summary.volume_mm3 = totals.volume_mm3 - totals.auxiliary_mm3;
    summary.results.emplace_back(
        "beads", fmt::format("{} moves, {:.2f} m, {:.3f} cm3; {} travels, {:.2f} m", readable_count(totals.part_moves()),
                             (totals.bead_mm - totals.auxiliary_mm) / 1000, summary.volume_mm3 / 1000,
                             readable_count(totals.travels), totals.travel_mm / 1000));
    add_auxiliary(summary);
  }

 private:
  /// Of loops of the brim.
  double first_pitch_mm() const {
    const FillSettings& fill = plan_.job.fill.all;
    const double width = plan_.job.extrude.first_bead_mm.value_or(fill.wall_width_mm > 0 ? fill.wall_width_mm : fill.width_mm);
    const double height = mm(plan_.sections->layers().front().layer.thickness);
    return bead_area(width, height, plan_.moves->profile.machine.material.shape()) / height;
  }

  /// Skirt, brim and raft.
  void add_auxiliary(Summary& summary) const {
    const formats::MoveTotals& totals = sums_.totals;
    const ExtrudeRequest& request = plan_.job.extrude;
    const char* none = plan_.moves->profile.machine.skirt.loops == 0 || !plan_.sections->fills() ? "none"
                       : plan_.range[0] > 0 ? "none: --layers leaves the first layer out"
                                            : "none: no space on the bed";
    const bool with_skirt = plan_.moves->profile.machine.skirt.loops > 0 && (request.raft_layers > 0 || request.brim_mm > 0);
    std::string text = totals.auxiliary_moves == 0
                           ? std::string(none)
                           : fmt::format("{}{:.1f} mm, {:.1f} mm3, {:.1f} mm of filament, in addition to the parts",
                                         with_skirt ? "with the skirt " : "", totals.auxiliary_mm, totals.auxiliary_mm3,
                                         totals.auxiliary_filament_mm);
    if (request.raft_layers > 0) {
      const RaftPlan raft = plan_raft(request, plan_.sections->layers().front().layer.thickness);
      summary.results.emplace_back("raft", fmt::format("{} layer{}, {:g} mm high with its gap of {:g} mm; {}",
                                                       request.raft_layers, request.raft_layers > 1 ? "s" : "", mm(raft.lift),
                                                       request.raft_gap_mm, text));
    } else if (request.brim_mm > 0) {
      if (plan_.sections->bounds().lo.z > 0) text += "; no brim, since the parts begin above the bed";
      if (request.brim_mm < first_pitch_mm() / 2) text += "; no loop of the brim fits into its width";
      summary.results.emplace_back("brim", text);
    } else {
      summary.results.emplace_back("skirt", text);
    }
  }

  const Plan& plan_;
  const PathFacts& sums_;
  checks::PathWarnings paths_;
  checks::LostFeaturesTally lost_;
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
    if (std::string fast = melt_warning(); !fast.empty()) warnings.push_back({"melt-rate", std::move(fast)});
  }
  void report(Summary& summary) const override {
    report_deposited(sums_.deposited, ranges_, plan_.moves->profile.machine, first_layer_points_, summary.results,
                     summary.facts);
  }

 private:
  /// Thick and thin segments that take more than the material's melt rate in the thickest layer; "" if none does. Their speeds
  /// decide the pores, so that they are not limited.
  std::string melt_warning() const {
    const Extruder& machine = plan_.moves->profile.machine;
    const auto& material = machine.material;
    if (!(material.max_melt_mm3_s > 0)) return {};
    Nm thickest = 0;
    for (const ScheduledLayer& layer : plan_.sections->layers()) thickest = std::max(thickest, layer.own().thickness);
    double rate = 0;
    for (const auto& [heights, range] : segmented_) {
      const segment::Segmentation& s = range->plan;
      rate = std::max(rate, s.thick_extrusion * s.thick_speed);
      const std::size_t lines = std::max<std::size_t>(s.sweep.size(), 1);
      for (std::size_t k = 0; k < lines; ++k) {
        const auto thin = s.thin_of(static_cast<std::int64_t>(k));
        rate = std::max(rate, thin.extrusion * thin.speed);
      }
    }
    rate *=
        bead_area(plan_.job.fill.all.width_mm, mm(thickest), material.shape()) * material.flow * machine.speed.print_mm_s / 1e4;
    if (rate <= material.max_melt_mm3_s) return {};
    return fmt::format(
        "segmented lines take up to {:.2f} mm3/s, and the material melts at most {:g}: thin segments get too "
        "little; give a slower --print-speed",
        rate, material.max_melt_mm3_s);
  }
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
    const formats::FilamentUse use = formats::filament_use(totals, plan_.moves->profile.machine);
    const auto& material = plan_.moves->profile.machine.material;
    std::string text = fmt::format("{:.1f} mm, {:.2f} cm3, {:.2f} g", totals.filament_mm, use.mm3 / 1000, use.grams);
    if (!material.name.empty()) text += fmt::format(" of {}", material.name);
    summary.results.emplace_back("filament", text);
    const double cost = use.grams / 1000 * material.price_kg;
    if (material.price_kg > 0) {
      summary.results.emplace_back(
          "cost", fmt::format("{:.2f} {} of filament, {:g} per kg", cost, material.currency, material.price_kg));
    }
    summary.results.emplace_back("printing", fmt::format("about {}", formats::gcode::time_text(totals.seconds)));
    Json& facts = summary.facts;
    facts["moves"] = totals.part_moves();
    facts["travels"] = totals.travels;
    facts["retractions"] = totals.retractions;
    facts["stored_points"] = sums_.stored_points;
    facts["bead_mm"] = totals.bead_mm - totals.auxiliary_mm;
    facts["travel_mm"] = totals.travel_mm;
    facts["filament_mm"] = totals.filament_mm;
    facts["filament_mm3"] = use.mm3;
    facts["filament_g"] = use.grams;
    if (!material.name.empty()) facts["material"] = material.name;
    if (material.price_kg > 0) {
      facts["filament_cost"] = cost;
      facts["currency"] = material.currency;
    }
    facts["skirt"] = {{"moves", totals.auxiliary_moves},
                      {"bead_mm", totals.auxiliary_mm},
                      {"volume_mm3", totals.auxiliary_mm3},
                      {"filament_mm", totals.auxiliary_filament_mm}};
    if (const ExtrudeRequest& request = plan_.job.extrude; request.raft_layers > 0) {
      const RaftPlan raft = plan_raft(request, plan_.sections->layers().front().layer.thickness);
      facts["raft"] = {{"layers", request.raft_layers}, {"lift_mm", mm(raft.lift)}, {"gap_mm", request.raft_gap_mm}};
    }
    facts["print_seconds"] = totals.seconds;
  }

 private:
  const Plan& plan_;
  const PathFacts& sums_;
};

}  // namespace

void observe_contours(const Plan& plan, Observers<slice::SectionReport>& observers) {
  observers.add<PathObserver>(plan);
  observers.add<GapObserver>();
  observers.add<OffsetObserver>(plan);
  observers.add<FillingObserver>(plan);
  observers.add<OverhangObserver<slice::SectionReport>>(plan.job.support_angle_deg);
}

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
  observers.add<OverhangObserver<void>>(plan.job.support_angle_deg);
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
