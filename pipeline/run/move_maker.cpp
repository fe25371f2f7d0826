#include "pipeline/run/move_maker.h"

#include <algorithm>

#include "pipeline/output/toolpath_file.h"
#include "pipeline/report/move_observers.h"
#include "pipeline/run/path_layer.h"

namespace lamina::pipeline {
namespace {

/// A stored toolpath point takes about 40 bytes of text; a path adds tags, a travel move and retraction.
constexpr std::size_t kTextOfPoint = 48, kTextOfPath = 128;
/// A layer's text waits until all earlier layers are written. If segmented lines exceed these bytes and the size of the
/// plain filling, the text is not kept: the layer is written piece by piece in its turn.
constexpr std::size_t kWaitingText = 1 << 17, kPieceOfText = 1 << 16;

class MoveMaker : public Maker {
 public:
  MoveMaker(const Plan& plan, JobChecks& checks, const FlowLimits& limits)
      : plan_(plan), checks_(checks), file_(plan), work_(limits.max_in_flight), made_(limits.max_in_flight) {
    observe_moves(plan, sums_, observers_);
  }

  std::uint64_t bytes_of(std::uint32_t layer) const override { return plan_.sections->bytes_bound(layer); }

  Result<std::vector<std::uint32_t>> open() override {
    if (Status status = file_.open(); !status) return status.error();
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
        {"fill", [this](std::uint32_t layer, const Ticket& ticket) { return plan_.sections->fill(layer, work_[ticket.work]); },
         [this](std::uint32_t layer, const Ticket& ticket) {
           auto bytes = plan_.sections->fill_bytes_bound(layer, work_[ticket.work], {kTextOfPoint, 0, kTextOfPath});
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
    const auto out = file_.layer(made.record.layer, work.text);
    const std::size_t maximum =
        plan_.segments->any() ? std::max(kWaitingText, kTextOfPoint * work.paths.point.size()) : SIZE_MAX;
    const auto deposited = deposit_moves(plan_, layer, work, {work.text, maximum, [] { return false; }}, *out, made.facts);
    if (!deposited) return deposited.error();
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
    Status status;
    const auto give = [&] {
      status = file_.file().append_piece({piece_.data(), piece_.size()});
      piece_.clear();
      return status.ok();
    };
    const auto out = file_.layer(made.record.layer, piece_);
    const auto deposited = deposit_moves(plan_, layer, work, {piece_, kPieceOfText, give}, *out, made.facts);
    if (!deposited) return deposited.error();
    if (!status) return status;
    return file_.file().append_piece({piece_.data(), piece_.size()});
  }

  const Plan& plan_;
  JobChecks& checks_;
  ToolpathFile file_;
  std::vector<Sections::Work> work_;
  std::vector<Made> made_;
  Buffer<char> piece_;

  PathFacts sums_;
  Observers<void> observers_;
  std::uint64_t bytes_written_ = 0;
};

}  // namespace

std::unique_ptr<Maker> make_move_maker(const Plan& plan, JobChecks& checks, const FlowLimits& limits) {
  return std::make_unique<MoveMaker>(plan, checks, limits);
}

}  // namespace lamina::pipeline
