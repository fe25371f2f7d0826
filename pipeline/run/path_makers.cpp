#include "pipeline/run/path_makers.h"

#include <algorithm>
#include <functional>
#include <optional>
#include <utility>
#include <vector>

#include "pipeline/output/slice_files.h"
#include "pipeline/output/toolpath_file.h"
#include "pipeline/plan/layers.h"
#include "pipeline/plan/overhangs.h"
#include "pipeline/plan/segment.h"
#include "pipeline/report/path_observers.h"
#include "pipeline/run/around_parts.h"
#include "pipeline/run/progress_estimate.h"
#include "pipeline/run/travel_region.h"
#include "stages/bead/even_starts.h"
#include "stages/formats/extrusion_format.h"
#include "stages/segment/moves.h"
#include "stages/support/io/file.h"

namespace lamina::pipeline {
namespace {

ToolpathsView paths_of(const Sections::Work& work, std::uint32_t area) {
  ToolpathsView paths = work.paths;
  paths.offset = paths.offset.subspan(work.path_area[area], work.path_area[area + 1] - work.path_area[area] + 1);
  return paths;
}

/// The segmentation of an area at a layer, and its cut. errors  of layer_cut
struct AreaCut {
  const SegmentRange& range;
  Result<segment::LayerCut> cut;
};
AreaCut cut_of(const Plan& plan, std::uint32_t area_number, const Layer& layer) {
  const Sections::Area& area = plan.sections->areas()[area_number];
  const SegmentRange& range = plan.segments->at(Sections::height_in(area, layer));
  return {range, layer_cut(range, plan.sections->filling(area, layer), layer, area.box)};
}

/// The pores of a layer by segmented range, in a job that reports them by range.
class PoresByRange {
 public:
  explicit PoresByRange(const Plan& plan) {
    if (has_ranges_by_layer(plan)) segmented_ = plan.segments->segmented();
    ranges.resize(segmented_.size());
  }
  /// What `count` adds to `all` is added to the range too. returns  what it returns
  template <class SampleCount>
  auto take(const SegmentRange& range, PoreCounts& all, SampleCount count) {
    if (ranges.empty()) return count();
    const PoreCounts before = std::exchange(all, {});
    const auto result = count();
    if (RangePores* of = find(range)) of->pores.add(all);
    PoreCounts sum = before;
    sum.add(all);
    all = sum;
    return result;
  }
  RangePores* find(const SegmentRange& range) {
    for (std::size_t i = 0; i < ranges.size(); ++i) {
      if (segmented_[i].second == &range) return &ranges[i];
    }
    return nullptr;
  }
  std::vector<RangePores> ranges;

 private:
  decltype(std::declval<SegmentPlan>().segmented()) segmented_;
};

/// Counts pores that cross those of the part's next layer, which is made for it. errors  of Sections::layer and layer_cut
Status count_crossed(const Plan& plan, std::uint32_t index, const Sections::Work& work, PoreCounts& all,
                     PoresByRange& by_range) {
  const std::vector<ScheduledLayer>& layers = plan.sections->layers();
  std::uint32_t next = index + 1;
  while (next < layers.size() && layers[next].part != layers[index].part) ++next;
  if (next >= layers.size()) return {};
  Sections::Work above;
  if (Status status = plan.sections->layer(next, above); !status) return status;
  for (std::uint32_t a = 0; a + 1 < work.path_area.size(); ++a) {
    const AreaCut below = cut_of(plan, a, layers[index].own()), over = cut_of(plan, a, layers[next].own());
    if (!below.cut) return below.cut.error();
    if (!over.cut) return over.cut.error();
    if (!below.range.settings.across || !over.range.settings.across) continue;
    by_range.take(below.range, all, [&] {
      segment::count_crossed(paths_of(work, a), *below.cut, paths_of(above, a), *over.cut, all);
      return true;
    });
  }
  return {};
}

/// Statistics of a layer's contours and stored paths, without area and the length of the paths.
PathFacts facts_of(const Sections::Work& work) {
  PathFacts facts;
  const Contours& contours = work.contours.contours;
  facts.contours = contours.size();
  facts.points = contours.point.size();
  facts.paths = work.paths.size();
  facts.merged = work.report.merged;
  facts.open = work.report.gaps.open;
  facts.stored_points = work.paths.point.size();
  facts.lost = work.lost;
  return facts;
}

/// The text buffer of a writer, with a callback at a size limit.
struct TextBuffer {
  Buffer<char>& text;
  std::size_t maximum;          // bytes; `grown` is called after each move beyond this size
  std::function<bool()> grown;  // drains the text, or returns false to abandon the layer
};

/// Converts the stored toolpaths of a layer to moves. Stretches are expanded one at a time and never stored.
/// facts    receives the sums of the moves unless the layer is abandoned
/// returns  false if `buffer.grown` abandons the layer
Result<bool> deposit_moves(const Plan& plan, std::uint32_t index, const Sections::Work& work, const TextBuffer& buffer,
                           formats::LayerMoves& out, PathFacts& facts) {
  const Layer layer = plan.sections->layers()[index].own();
  DepositedSums deposited;
  deposited.porosity.solid_mm3 = facts.area_mm2 * mm(layer.thickness);
  PoresByRange by_range(plan);
  const Extruder& machine = plan.moves->profile.machine;
  bead::EvenStarts starts(machine, mm(layer.thickness));
  if (index == 0 && plan.sections->fills()) {
    if (Status status = deposit_around(plan, layer, work.contours.contours, out); !status) return status.error();
  }
  for (std::uint32_t a = 0; a + 1 < work.path_area.size(); ++a) {
    const AreaCut of = cut_of(plan, a, layer);
    const SegmentRange& range = of.range;
    if (work.path_area[a] < work.path_area[a + 1]) out.begin_object(plan.sections->areas()[a].body);
    const Result<segment::LayerCut>& cut = of.cut;
    if (!cut) return cut.error();
    segment::MoveTable table(range.plan, *cut, machine, layer);
    const ToolpathsView paths = paths_of(work, a);
    if (Status status = segment::check_interval_count(range.plan, *cut, paths, layer.index); !status) return status.error();
    const auto write = [&](const BeadMove& move) -> std::optional<DepositedMove> {
      const double length = out.deposit(move);
      if (buffer.text.size() > buffer.maximum && !buffer.grown()) return std::nullopt;
      return DepositedMove{length, length * move.area_mm2};
    };
    const bool even = range.settings.on && range.settings.even_starts && machine.material.lag_s > 0;
    if (!even) starts.forget();
    const auto deposit = [&](const BeadMove& move) { return even ? starts.deposit(move, write) : write(move); };
    if (!by_range.take(range, deposited.pores, [&] { return segment::for_each_move(paths, *cut, table, deposited, deposit); }))
      return false;
    if (RangePores* reported = by_range.find(range))
      reported->area_mm2 += plan.sections->area_mm2(plan.sections->areas()[a], work);
  }
  facts.totals = out.finish();
  if (plan.segments->crosses()) {
    if (Status status = count_crossed(plan, index, work, deposited.pores, by_range); !status) return status.error();
  }
  facts.deposited = deposited;
  facts.by_range = std::move(by_range.ranges);
  return true;
}

/// Layers whose contours are kept for the layer above: those in flight and the one below.
std::uint32_t neighbours_of(const FlowLimits& limits) { return limits.max_in_flight + 2; }

/// The step that finds what hangs in a layer.
MakerStep overhang_step(const Overhangs& overhangs, std::vector<std::shared_ptr<const LayerOverhang>>& found) {
  return {"overhangs", [&](std::uint32_t layer, const Ticket& ticket) -> Status {
            auto made = overhangs.at(layer);
            if (!made) return made.error();
            found[ticket.work] = std::make_shared<const LayerOverhang>(std::move(*made));
            return {};
          }};
}

class ContourMaker : public Maker {
 public:
  ContourMaker(const Plan& plan, JobChecks& checks, const FlowLimits& limits)
      : plan_(plan),
        checks_(checks),
        files_(plan),
        work_(limits.max_in_flight),
        made_(limits.max_in_flight),
        overhangs_(*plan.sections, plan.job.support_angle_deg, neighbours_of(limits)),
        overhang_(limits.max_in_flight) {
    plan.sections->keep_neighbours(limits.max_in_flight);
    observe_contours(plan, observers_);
  }

  std::uint64_t bytes_of(std::uint32_t layer) const override { return plan_.sections->bytes_bound(layer); }

  Result<std::vector<std::uint32_t>> open() override {
    if (Status status = files_.open(); !status) return status.error();
    std::vector<std::uint32_t> todo;
    for (auto i = plan_.range[0] + static_cast<std::uint32_t>(files_.kept().size()); i < plan_.range[1]; ++i) todo.push_back(i);
    return todo;
  }
  std::vector<LayerRecord> kept() const override { return files_.kept(); }

  std::vector<MakerStep> steps() override {
    const Sections& sections = *plan_.sections;
    return {{"contours",
             [&](std::uint32_t layer, const Ticket& ticket) {
               made_[ticket.work] = LayerRecord();
               made_[ticket.work].layer = plan_.layer(layer);
               return sections.contours(layer, work_[ticket.work]);
             }},
            overhang_step(overhangs_, overhang_),
            {"fill", [&](std::uint32_t layer, const Ticket& ticket) { return sections.fill(layer, work_[ticket.work]); },
             [&](std::uint32_t layer, const Ticket& ticket) {
               return sections.fill_bytes_bound(layer, work_[ticket.work], files_.text_bytes());
             }},
            {"encode",
             [&](std::uint32_t, const Ticket& ticket) {
               Sections::Work& work = work_[ticket.work];
               PathFacts facts = facts_of(work);
               facts.bead_mm = length_mm(work.paths);
               facts.overhang = overhang_[ticket.work];
               facts.area_mm2 = checks_.add_contours(made_[ticket.work].layer, work.contours);
               made_[ticket.work].paths = std::make_shared<const PathFacts>(facts);
               Status encoded = files_.encode(view_of(made_[ticket.work].layer, work), work.text);
               if (!files_.records_contours()) work.contours.contours = Contours();
               return encoded;
             }},
            {kStoreStep, [&](std::uint32_t layer, const Ticket& ticket) {
               return files_.store(layer, work_[ticket.work].text, made_[ticket.work]);
             }}};
  }
  bool records_from_work() const override { return true; }

  Status record(std::uint32_t, const Ticket& ticket) override {
    const Sections::Work& work = work_[ticket.work];
    LayerRecord& record = made_[ticket.work];
    if (Status status = files_.record(view_of(record.layer, work), work.text, record); !status) return status;
    observers_.layer(record, &work.report);
    checks_.record(record.layer.index, record.paths->contours > 0);
    // Layers that are admitted and not begun hold slots: each would keep the memory of the largest layer that it had.
    constexpr std::uint64_t kLarge = 1 << 20;
    if (work.bytes() > kLarge) let_go(ticket.work);
    return {};
  }
  void add_kept(const LayerRecord& record) override {
    observers_.layer(record, nullptr);
    checks_.keep(record.layer.index, record.paths->contours > 0);
  }

  std::uint64_t bytes_held(std::uint32_t work) const override { return work_[work].bytes(); }
  std::uint64_t extra_bytes() const override { return plan_.sections->shared_bytes(); }
  void let_go(std::uint32_t work) override { work_[work] = Sections::Work(); }

  Status finish() override {
    const auto bytes = files_.finish();
    if (!bytes) return bytes.error();
    bytes_written_ = *bytes;
    return {};
  }
  bool keeps() const override { return files_.keeps(); }
  Status stop(bool keep) override {
    if (keep) return files_.keep();
    files_.discard();
    return {};
  }
  void discard() override { files_.discard(); }
  void warn(const Summary& summary, std::vector<Warning>& warnings) const override {
    observers_.warn(summary, warnings);
    if (plan_.job.resume && files_.kept().empty() && (!files_.keeps() || plan_.job.slice.file_a_layer)) {
      warnings.push_back({"planned-again", "--resume: no layer of an interrupted job was found; all were planned again"});
    }
  }
  void report(Summary& summary) const override {
    summary.output = files_.output();
    summary.format = plan_.job.slice.format;
    summary.bytes_written = bytes_written_;
    summary.index_bytes = plan_.sections->slicer().index_bytes();
    observers_.report(summary);
  }

 private:
  static formats::SliceLayer view_of(const Layer& layer, const Sections::Work& work) {
    return {layer, work.contours.contours, work.contours.body, work.paths, work.path_body};
  }

  const Plan& plan_;
  JobChecks& checks_;
  SliceFiles files_;
  std::vector<Sections::Work> work_;
  std::vector<LayerRecord> made_;
  Overhangs overhangs_;
  std::vector<std::shared_ptr<const LayerOverhang>> overhang_;
  Observers<slice::SectionReport> observers_;
  std::uint64_t bytes_written_ = 0;
};

/// A stored toolpath point takes about 40 bytes of text; a path adds tags, a travel move and retraction.
constexpr std::size_t kTextOfPoint = 48, kTextOfPath = 128;
/// A layer's text waits until all earlier layers are written. If segmented lines exceed these bytes and the size of the
/// plain filling, the text is not kept: the layer is written piece by piece in its turn.
constexpr std::size_t kWaitingText = 1 << 17, kPieceOfText = 1 << 16;

class MoveMaker : public Maker {
 public:
  MoveMaker(const Plan& plan, JobChecks& checks, const FlowLimits& limits)
      : plan_(plan),
        checks_(checks),
        file_(plan),
        work_(limits.max_in_flight),
        made_(limits.max_in_flight),
        overhangs_(*plan.sections, plan.job.support_angle_deg, neighbours_of(limits)),
        overhang_(limits.max_in_flight) {
    plan.sections->keep_neighbours(limits.max_in_flight);
    observe_moves(plan, sums_, observers_);
  }

  std::uint64_t bytes_of(std::uint32_t layer) const override { return plan_.sections->bytes_bound(layer); }

  Result<std::vector<std::uint32_t>> open() override {
    if (Status status = file_.open(); !status) return status.error();
    if (plan_.moves->profile.machine.code.progress) {
      const auto raft = seconds_of_raft();
      if (!raft) return raft.error();
      auto estimate = ProgressEstimate::make(plan_.range[0], plan_.range[1], *raft,
                                             [&](std::uint32_t layer) { return seconds_of(layer); });
      if (!estimate) return estimate.error();
      progress_ = std::move(*estimate);
    }
    std::vector<std::uint32_t> todo;
    const auto kept_count = static_cast<std::uint32_t>(file_.file().kept().size());
    for (std::uint32_t i = plan_.range[0] + kept_count; i < plan_.range[1]; ++i) todo.push_back(i);
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
        overhang_step(overhangs_, overhang_),
        {"fill", [this](std::uint32_t layer, const Ticket& ticket) { return plan_.sections->fill(layer, work_[ticket.work]); },
         [this](std::uint32_t layer, const Ticket& ticket) {
           const bool slows = plan_.moves->profile.machine.fan.min_layer_s > 0;  // moves wait, and their text is made twice
           const std::uint64_t of_point = slows ? 2 * kTextOfPoint + sizeof(BeadMove) : kTextOfPoint;
           auto bytes = plan_.sections->fill_bytes_bound(layer, work_[ticket.work], {of_point, 0, kTextOfPath});
           if (bytes) *bytes += TravelRegion::bytes_bound(plan_, work_[ticket.work]);
           if (bytes && plan_.segments->any()) *bytes += 2 * kWaitingText;
           if (bytes && plan_.segments->crosses()) *bytes += *bytes + plan_.sections->bytes_bound(layer);  // the next layer too
           return bytes;
         }},
        {"intervals", [this](std::uint32_t layer, const Ticket& ticket) {
           return deposit_waiting(layer, work_[ticket.work], made_[ticket.work]);
         }}};
  }
  bool records_from_work() const override { return true; }

  Status record(std::uint32_t layer, const Ticket& ticket) override {
    Made& made = made_[ticket.work];
    Sections::Work& work = work_[ticket.work];
    if (!made.waits) {
      if (Status status = deposit_pieces(layer, work, made); !status) return status;
    }
    file_.travel_from(sums_.totals, made.facts.totals);
    made.facts.overhang = overhang_[ticket.work];
    made.record.paths = std::make_shared<const PathFacts>(made.facts);
    const std::string_view text(work.text.data(), work.text.size());
    if (Status status = made.waits ? file_.file().append(text, made.record) : file_.file().end_pieces(made.record); !status)
      return status;
    add(made.record);
    checks_.record(layer, made.facts.totals.part_moves() > 0);
    return {};
  }
  void add_kept(const LayerRecord& record) override {
    add(record);
    checks_.keep(record.layer.index, record.paths->totals.part_moves() > 0);
  }

  std::uint64_t bytes_held(std::uint32_t work) const override { return work_[work].bytes(); }
  std::uint64_t extra_bytes() const override { return plan_.sections->shared_bytes(); }
  void let_go(std::uint32_t work) override { work_[work] = Sections::Work(); }

  bool times_dry_runs() const override { return true; }
  bool keeps() const override { return !plan_.job.dry_run && !is_stream(plan_.job.output); }
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
  void warn(const Summary& summary, std::vector<Warning>& warnings) const override { observers_.warn(summary, warnings); }
  void report(Summary& summary) const override {
    summary.bytes_written = bytes_written_;
    observers_.report(summary);
  }

 private:
  struct Made {
    LayerRecord record;
    PathFacts facts;
    bool waits = false;  // the text is complete; otherwise recording makes it
  };

  void add(const LayerRecord& record) {
    sums_.add(*record.paths);
    observers_.layer(record, nullptr);
  }

  /// Makes the layer's text unless it becomes too long to wait.
  Status deposit_waiting(std::uint32_t layer, Sections::Work& work, Made& made) {
    made.facts = facts_of(work);
    made.facts.area_mm2 = checks_.add_contours(made.record.layer, work.contours);
    work.text.clear();
    const auto raft = raft_of(layer, work, work.text);
    if (!raft) return raft.error();
    const TravelRegion region(plan_, work);
    const auto out = file_.layer(made.record.layer, work.text, region.surroundings(progress_.before(layer)));
    const std::size_t maximum =
        plan_.segments->any() ? std::max(kWaitingText, kTextOfPoint * work.paths.point.size()) : SIZE_MAX;
    const auto deposited = deposit_moves(plan_, layer, work, {work.text, maximum, [] { return false; }}, *out, made.facts);
    if (!deposited) return deposited.error();
    add_before(*raft, made.facts);
    made.waits = *deposited;
    if (made.waits) {
      made.record.bytes = work.text.size();
      made.record.hash = hash_bytes(std::as_bytes(std::span(work.text)));
    } else {
      Buffer<char>().swap(work.text);
    }
    return {};
  }

  Status deposit_pieces(std::uint32_t layer, const Sections::Work& work, Made& made) {
    piece_.clear();
    const auto raft = raft_of(layer, work, piece_);
    if (!raft) return raft.error();
    Status status;
    const auto give = [&] {
      status = file_.file().append_piece({piece_.data(), piece_.size()});
      piece_.clear();
      return status.ok();
    };
    const TravelRegion region(plan_, work);
    const auto out = file_.layer(made.record.layer, piece_, region.surroundings(progress_.before(layer)));
    const auto deposited = deposit_moves(plan_, layer, work, {piece_, kPieceOfText, give}, *out, made.facts);
    if (!deposited) return deposited.error();
    if (!status) return status;
    add_before(*raft, made.facts);
    return file_.file().append_piece({piece_.data(), piece_.size()});
  }

  /// The text of what is under a layer. returns  its sums
  Result<std::vector<formats::MoveTotals>> raft_of(std::uint32_t layer, const Sections::Work& work, Buffer<char>& text) const {
    if (layer > 0) return std::vector<formats::MoveTotals>();
    return append_raft(plan_, file_, work.contours.contours, progress_, text);
  }
  void add_before(const std::vector<formats::MoveTotals>& raft, PathFacts& facts) const {
    if (raft.empty()) return;
    file_.travel_from(raft.back(), facts.totals);
    formats::MoveTotals all;
    for (const formats::MoveTotals& of : raft) all.add(of);
    all.add(facts.totals);
    facts.totals = all;
  }
  Result<std::vector<double>> seconds_of_raft() const {
    std::vector<double> seconds;
    if (file_.raft().layers.empty()) return seconds;
    Sections::Work work;
    if (Status status = plan_.sections->contours(0, work); !status) return status.error();
    Buffer<char> text;
    const auto raft = raft_of(0, work, text);
    if (!raft) return raft.error();
    for (const formats::MoveTotals& of : *raft) seconds.push_back(of.seconds);
    return seconds;
  }

  /// The time of a layer, which is planned and dropped for it. errors  of its steps
  Result<double> seconds_of(std::uint32_t layer) const {
    Sections::Work work;
    if (Status status = plan_.sections->layer(layer, work); !status) return status.error();
    Buffer<char> text;
    PathFacts facts;
    const TravelRegion region(plan_, work);
    const auto out = file_.layer(plan_.layer(layer), text, region.surroundings({}));
    const auto drop = [&] { return text.clear(), true; };
    const auto deposited = deposit_moves(plan_, layer, work, {text, kPieceOfText, drop}, *out, facts);
    if (!deposited) return deposited.error();
    formats::MoveTotals with_travel = facts.totals;  // from the layer below: as long as one from this layer's end to its start
    file_.travel_from(facts.totals, with_travel);
    return with_travel.seconds;
  }

  const Plan& plan_;
  JobChecks& checks_;
  ToolpathFile file_;
  ProgressEstimate progress_;
  std::vector<Sections::Work> work_;
  std::vector<Made> made_;
  Overhangs overhangs_;
  std::vector<std::shared_ptr<const LayerOverhang>> overhang_;
  Buffer<char> piece_;

  PathFacts sums_;
  Observers<void> observers_;
  std::uint64_t bytes_written_ = 0;
};

}  // namespace

std::unique_ptr<Maker> make_contour_maker(const Plan& plan, JobChecks& checks, const FlowLimits& limits) {
  return std::make_unique<ContourMaker>(plan, checks, limits);
}

std::unique_ptr<Maker> make_move_maker(const Plan& plan, JobChecks& checks, const FlowLimits& limits) {
  return std::make_unique<MoveMaker>(plan, checks, limits);
}

}  // namespace lamina::pipeline
