#include "pipeline/run/contour_maker.h"

#include "pipeline/output/slice_files.h"
#include "pipeline/report/contour_observers.h"
#include "pipeline/run/path_layer.h"

namespace lamina::pipeline {
namespace {

class ContourMaker : public Maker {
 public:
  ContourMaker(const Plan& plan, JobChecks& checks, const FlowLimits& limits)
      : plan_(plan), checks_(checks), files_(plan), work_(limits.max_in_flight), made_(limits.max_in_flight) {
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
            {"fill", [&](std::uint32_t layer, const Ticket& ticket) { return sections.fill(layer, work_[ticket.work]); },
             [&](std::uint32_t layer, const Ticket& ticket) {
               return sections.fill_bytes_bound(layer, work_[ticket.work], files_.text_bytes());
             }},
            {"encode",
             [&](std::uint32_t, const Ticket& ticket) {
               Sections::Work& work = work_[ticket.work];
               PathFacts facts = facts_of(work);
               facts.bead_mm = length_mm(work.paths);
               facts.area_mm2 = checks_.add_contours(made_[ticket.work].layer, work.contours);
               made_[ticket.work].paths = std::make_shared<const PathFacts>(facts);
               return files_.encode(view_of(made_[ticket.work].layer, work), work.text);
             }},
            {"store", [&](std::uint32_t layer, const Ticket& ticket) {
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
    return {};
  }
  void add_kept(const LayerRecord& record) override {
    observers_.layer(record, nullptr);
    checks_.keep(record.layer.index, record.paths->contours > 0);
  }

  std::uint64_t bytes_held(std::uint32_t work) const override { return work_[work].bytes(); }
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
  Observers<slice::SectionReport> observers_;
  std::uint64_t bytes_written_ = 0;
};

}  // namespace

std::unique_ptr<Maker> make_contour_maker(const Plan& plan, JobChecks& checks, const FlowLimits& limits) {
  return std::make_unique<ContourMaker>(plan, checks, limits);
}

}  // namespace lamina::pipeline
