#include "pipeline/run/move_maker.h"

#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "pipeline/output/toolpath_file.h"
#include "pipeline/run/path_layer.h"
#include "stages/data/text/number_text.h"
#include "stages/data/text/readable.h"
#include "stages/sanity/paths.h"
#include "stages/segment/laid/told.h"
#include "stages/write/gcode/gcode.h"

namespace lamina::pipeline {
namespace {

/// A stored toolpath point takes about 40 bytes of text; a path adds tags, a travel move and retraction.
constexpr std::size_t kTextOfPoint = 48, kTextOfPath = 128;
/// A layer's text waits until all earlier layers are written. If segmented lines exceed these bytes and the size of the
/// plain filling, the text is not kept: the layer is written piece by piece in its turn.
constexpr std::size_t kWaitingText = 1 << 17, kPieceOfText = 1 << 16;

class MoveMaker : public Maker {
 public:
  MoveMaker(const Plan& plan, Sanity& sanity, const FlowLimits& limits)
      : plan_(plan), sanity_(sanity), file_(plan), work_(limits.max_in_flight), made_(limits.max_in_flight) {
    segmented_ = plan.segments->segmented();
    by_range_ = tells_ranges(plan);
    for (const auto& [heights, range] : segmented_) ranges_.push_back({heights, {}});
  }

  std::uint64_t bytes_of(std::uint32_t layer) const override { return plan_.sections->bytes_bound(layer); }

  Result<std::vector<std::uint32_t>> open() override {
    if (Status status = file_.open(); !status) return status.error();
    std::vector<std::uint32_t> todo;
    const auto stand = static_cast<std::uint32_t>(file_.file().kept().size());
    for (std::uint32_t i = plan_.range[0] + stand; i < plan_.range[1]; ++i) todo.push_back(i);
    return todo;
  }
  std::vector<LayerRecord> kept() const override { return file_.file().kept(); }

  std::vector<MakerStep> steps() override {
    return {
        {"contours",
         [this](std::uint32_t layer, const Ticket& ticket) {
           made_[ticket.work] = Made();
           made_[ticket.work].record.layer = plan_.layer(layer);
           return plan_.sections->contours(layer, work_[ticket.work]);
         }},
        {"fill", [this](std::uint32_t layer, const Ticket& ticket) { return plan_.sections->fill(layer, work_[ticket.work]); },
         [this](std::uint32_t layer, const Ticket& ticket) {
           auto bytes = plan_.sections->fill_bytes_bound(layer, work_[ticket.work], {kTextOfPoint, 0, kTextOfPath});
           if (bytes && plan_.segments->any()) *bytes += 2 * kWaitingText;
           if (bytes && plan_.segments->crosses()) *bytes += *bytes + plan_.sections->bytes_bound(layer);  // the next layer too
           return bytes;
         }},
        {"stretches", [this](std::uint32_t layer, const Ticket& ticket) {
           return lay_waiting(layer, work_[ticket.work], made_[ticket.work]);
         }}};
  }
  bool records_from_work() const override { return true; }

  Status record(std::uint32_t layer, const Ticket& ticket) override {
    Made& made = made_[ticket.work];
    Sections::Work& work = work_[ticket.work];
    if (!made.waits) {
      if (Status status = lay_pieces(layer, work, made); !status) return status;
    }
    made.record.paths = std::make_shared<const PathFacts>(made.facts);
    const std::string_view text(work.text.data(), work.text.size());
    if (Status status = made.waits ? file_.file().append(text, made.record) : file_.file().end_pieces(made.record); !status)
      return status;
    add(made.record);
    sanity_.record(layer, made.facts.totals.part_moves() > 0);
    return {};
  }
  void add_kept(const LayerRecord& record) override {
    add(record);
    sanity_.keep(record.layer.index, record.paths->totals.part_moves() > 0);
  }
  void add(const LayerRecord& record) {
    if (record.layer.index == plan_.range[0]) first_layer_points_ = record.paths->laid.segments.points();
    told_.add(record.layer, record.paths->open, record.paths->laid.segments.lines, record.paths->laid.segments.thin);
    sums_.add(*record.paths);
    const std::vector<RangePores>& by_range = record.paths->by_range;
    const auto& areas = plan_.sections->areas();
    const SegmentRange& in = plan_.segments->at(record.layer.plane() - (areas.empty() ? 0 : areas.front().box.lo.z));
    const auto add_to = [&](segment::LaidRange& range, const PoreCounts& pores, double area_mm2) {
      range.pores.add(pores);
      range.area_mm2 += area_mm2;
    };
    for (std::size_t i = 0; i < segmented_.size(); ++i) {
      if (by_range_) {
        if (i < by_range.size()) add_to(ranges_[i], by_range[i].pores, by_range[i].area_mm2);
      } else if (segmented_[i].second == &in) {
        add_to(ranges_[i], record.paths->laid.pores, record.paths->area_mm2);
      }
    }
    if (!by_range_ || !by_range.empty() || record.paths->laid.segments.lines == 0) return;
    if (ranges_.size() == segmented_.size()) ranges_.push_back({"all ranges, layers of an earlier build", {}});
    add_to(ranges_.back(), record.paths->laid.pores, record.paths->area_mm2);
  }

  std::uint64_t bytes_held(std::uint32_t work) const override { return work_[work].bytes(); }
  void let_go(std::uint32_t work) override { work_[work] = Sections::Work(); }

  bool times_dry_runs() const override { return true; }
  bool keeps() const override { return !plan_.job.dry_run; }
  Status finish() override {
    const auto bytes = file_.finish(sums_.totals);
    if (!bytes) return bytes.error();
    bytes_written_ = plan_.job.dry_run ? 0 : *bytes;
    return {};
  }
  Status stop(bool keep) override {
    if (keep) return file_.keep();
    file_.discard();
    return {};
  }
  void discard() override { file_.discard(); }
  void warn(const Summary& so_far, std::vector<Warning>& warnings) const override;
  void tell(Summary& summary) const override;

 private:
  struct Made {
    LayerRecord record;
    PathFacts facts;
    bool waits = false;  // the text is complete; otherwise recording makes it
  };

  /// Makes the layer's text unless it becomes too long to wait.
  Status lay_waiting(std::uint32_t layer, Sections::Work& work, Made& made) {
    made.facts = facts_of(work);
    made.facts.area_mm2 = sanity_.add_contours(made.record.layer, work.contours);
    work.text.clear();
    const auto out = file_.layer(made.record.layer, work.text);
    const std::size_t most = plan_.segments->any() ? std::max(kWaitingText, kTextOfPoint * work.paths.point.size()) : SIZE_MAX;
    const auto laid = lay_moves(plan_, layer, work, {work.text, most, [] { return false; }}, *out, made.facts);
    if (!laid) return laid.error();
    made.waits = *laid;
    if (made.waits) {
      made.record.bytes = work.text.size();
      made.record.hash = hash_bytes(std::as_bytes(std::span(work.text)));
    } else {
      Buffer<char>().swap(work.text);
    }
    return {};
  }

  Status lay_pieces(std::uint32_t layer, const Sections::Work& work, Made& made) {
    piece_.clear();
    Status status;
    const auto give = [&] {
      status = file_.file().append_piece({piece_.data(), piece_.size()});
      piece_.clear();
      return status.ok();
    };
    const auto out = file_.layer(made.record.layer, piece_);
    const auto laid = lay_moves(plan_, layer, work, {piece_, kPieceOfText, give}, *out, made.facts);
    if (!laid) return laid.error();
    if (!status) return status;
    return file_.file().append_piece({piece_.data(), piece_.size()});
  }

  const Plan& plan_;
  Sanity& sanity_;
  ToolpathFile file_;
  std::vector<Sections::Work> work_;
  std::vector<Made> made_;
  Buffer<char> piece_;

  PathFacts sums_;
  decltype(std::declval<SegmentPlan>().segmented()) segmented_;
  std::vector<segment::LaidRange> ranges_;  // of segmented_, and one of layers of an earlier build
  bool by_range_ = false;                   // records hold the pores of each range
  std::uint64_t first_layer_points_ = 0, bytes_written_ = 0;
  sanity::PathsTold told_;
};

void MoveMaker::warn(const Summary& so_far, std::vector<Warning>& warnings) const {
  told_.tell(plan_.sections->fills(), sums_.totals.part_moves(), so_far.layers_planned, warnings);
  std::string slow = segment::speed_warning(sums_.laid.shorts, plan_.moves->profile.machine);
  if (!slow.empty()) warnings.push_back({"acceleration", std::move(slow)});
}

void MoveMaker::tell(Summary& summary) const {
  const write::MoveTotals& totals = sums_.totals;
  const Extruder& machine = plan_.moves->profile.machine;
  const double filament_cm3 = totals.filament_mm * machine.material.mm3_of_e() / 1000;
  const double filament_g = filament_cm3 * machine.material.density_g_cm3;
  summary.volume_mm3 = totals.volume_mm3 - totals.beside_mm3;
  summary.bytes_written = bytes_written_;

  const auto result = [&](std::string_view name, std::string text) { summary.results.emplace_back(name, std::move(text)); };
  result("beads", fmt::format("{} moves, {:.2f} m, {:.3f} cm3; {} travels, {:.2f} m", readable_count(totals.part_moves()),
                              (totals.bead_mm - totals.beside_mm) / 1000, summary.volume_mm3 / 1000,
                              readable_count(totals.travels), totals.travel_mm / 1000));
  const char* none = machine.skirt.loops == 0 || !plan_.sections->fills() ? "none"
                     : plan_.range[0] > 0                                 ? "none: --layers leaves the first layer out"
                                                                          : "none: no room on the bed";
  result("skirt", totals.beside_moves == 0 ? std::string(none)
                                           : fmt::format("{:.1f} mm, {:.1f} mm3, {:.1f} mm of filament, beside the parts",
                                                         totals.beside_mm, totals.beside_mm3, totals.beside_filament_mm));
  segment::tell_laid(sums_.laid, ranges_, machine, first_layer_points_, summary.results, *summary.facts);
  result("filament", fmt::format("{:.1f} mm, {:.2f} cm3, {:.2f} g", totals.filament_mm, filament_cm3, filament_g));
  result("printing", fmt::format("about {}", write::gcode::time_text(totals.seconds)));

  nlohmann::ordered_json& facts = *summary.facts;
  facts["moves"] = totals.part_moves();
  facts["travels"] = totals.travels;
  facts["retractions"] = totals.retractions;
  facts["stored_points"] = sums_.stored_points;
  facts["bead_mm"] = totals.bead_mm - totals.beside_mm;
  facts["travel_mm"] = totals.travel_mm;
  facts["filament_mm"] = totals.filament_mm;
  facts["filament_g"] = filament_g;
  facts["skirt"] = {{"moves", totals.beside_moves},
                    {"bead_mm", totals.beside_mm},
                    {"volume_mm3", totals.beside_mm3},
                    {"filament_mm", totals.beside_filament_mm}};
  facts["print_seconds"] = totals.seconds;
}

}  // namespace

void tell_moves(const Plan& plan, Summary& summary) {
  summary.output = plan.job.output;
  summary.machine = plan.moves->profile.machine.name;
  summary.format = plan.moves->profile.machine.format;
  summary.index_bytes = plan.sections->slicer().index_bytes();
  segment::tell_bead(plan.moves->profile.machine, plan.moves->left_out,
                     plan.job.heights.containment == Containment::kInside ? "top" : "middle", summary.head, *summary.facts);
  const double tolerance_um = tolerance_um_of(plan.job, plan.product);
  summary.head.emplace_back("contours", tolerance_um > 0 ? fmt::format("points are left out that move them by at most {} um",
                                                                       number_text(tolerance_um))
                                                         : "all their points");
  (*summary.facts)["tolerance_um"] = tolerance_um;
}

std::unique_ptr<Maker> make_move_maker(const Plan& plan, Sanity& sanity, const FlowLimits& limits) {
  return std::make_unique<MoveMaker>(plan, sanity, limits);
}

}  // namespace lamina::pipeline
