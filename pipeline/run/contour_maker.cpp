#include "pipeline/run/contour_maker.h"

#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "pipeline/output/slice_files.h"
#include "pipeline/run/path_layer.h"
#include "stages/data/text/number_text.h"
#include "stages/data/text/readable.h"
#include "stages/sanity/paths.h"

namespace lamina::pipeline {
namespace {

class ContourMaker : public Maker {
 public:
  ContourMaker(const Plan& plan, Sanity& sanity, const FlowLimits& limits)
      : plan_(plan), sanity_(sanity), files_(plan), work_(limits.max_in_flight), made_(limits.max_in_flight) {}

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
               facts.area_mm2 = sanity_.add_contours(made_[ticket.work].layer, work.contours);
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
    cuts_ += work.report.cuts;
    gaps_closed_ += work.report.gaps.closed;
    largest_gap_mm_ = std::max(largest_gap_mm_, mm(work.report.gaps.largest_closed));
    if (plan_.job.slice.offset_mm < 0 && work.report.cuts > 0 && record.paths->contours == 0 && work.report.gaps.open == 0) {
      emptied_.add(record.layer);
    }
    if (work.report.gaps.open > 0) open_.add(record.layer);
    add(record);
    sanity_.record(record.layer.index, record.paths->contours > 0);
    return {};
  }
  void add_kept(const LayerRecord& record) override {
    add(record);
    sanity_.keep(record.layer.index, record.paths->contours > 0);
  }
  void add(const LayerRecord& record) {
    sums_.add(*record.paths);
    volume_mm3_ += record.paths->area_mm2 * mm(record.layer.thickness);
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
  void warn(const Summary& so_far, std::vector<Warning>& warnings) const override;
  void tell(Summary& summary) const override;

 private:
  static write::SliceLayer view_of(const Layer& layer, const Sections::Work& work) {
    return {layer, work.contours.contours, work.contours.body, work.paths, work.path_body};
  }

  const Plan& plan_;
  Sanity& sanity_;
  SliceFiles files_;
  std::vector<Sections::Work> work_;
  std::vector<LayerRecord> made_;

  PathFacts sums_;
  double volume_mm3_ = 0, largest_gap_mm_ = 0;  // largest of those closed
  std::uint64_t cuts_ = 0, gaps_closed_ = 0, bytes_written_ = 0;
  sanity::LayersTold open_, emptied_;  // emptied: solid before the offset
};

void ContourMaker::warn(const Summary& so_far, std::vector<Warning>& warnings) const {
  open_.warn("chains-open",
             fmt::format("{} chains of cuts stay open, first in {}: they bound nothing and are left out; leave out "
                         "--no-repair to close the parts, or give a longer --bridge",
                         sums_.open, open_.first),
             warnings);
  emptied_.warn("offset",
                fmt::format("--offset {} leaves nothing of {} of {} layers, first {}: they are thinner than twice that; "
                            "give a smaller offset",
                            number_text(plan_.job.slice.offset_mm), emptied_.count, so_far.layers_planned, emptied_.first),
                warnings);
  if (plan_.sections->fills() && sums_.contours > 0 && sums_.paths == 0) {
    warnings.push_back({"no-bead",
                        "no bead of the filling fits into the parts: they are narrower than walls and filling ask "
                        "for; give a smaller --bead"});
  }
  if (plan_.job.resume && files_.kept().empty() && (!files_.keeps() || plan_.job.slice.file_a_layer)) {
    warnings.push_back({"planned-again", "--resume: no layer of an interrupted job was found; all were planned again"});
  }
}

void ContourMaker::tell(Summary& summary) const {
  summary.output = files_.output();
  summary.format = plan_.job.slice.format;
  summary.volume_mm3 = volume_mm3_;
  summary.bytes_written = bytes_written_;
  summary.index_bytes = plan_.sections->slicer().index_bytes();
  const auto result = [&](std::string_view name, std::string text) { summary.results.emplace_back(name, std::move(text)); };
  result("contours", fmt::format("{} with {} points, {:.3f} cm3; {} layers needed a union", readable_count(sums_.contours),
                                 readable_count(sums_.points), volume_mm3_ / 1000, readable_count(sums_.united)));
  if (sums_.paths > 0) {
    const std::string_view written = plan_.job.slice.format == "3mf" ? ", not in the file" : "";
    result("filling", fmt::format("{} paths, {:.2f} m of bead{}", readable_count(sums_.paths), sums_.bead_mm / 1000, written));
  }
  if (gaps_closed_ > 0 || sums_.open > 0) {
    result("gaps", fmt::format("{} closed by straight stretches, the longest {:.6f} mm; {} chains left open",
                               readable_count(gaps_closed_), largest_gap_mm_, readable_count(sums_.open)));
  }
  nlohmann::ordered_json& facts = *summary.facts;
  facts["cuts"] = cuts_;
  facts["contours"] = sums_.contours;
  facts["points"] = sums_.points;
  facts["paths"] = sums_.paths;
  facts["bead_mm"] = sums_.bead_mm;
  facts["united_layers"] = sums_.united;
  facts["gaps_closed"] = gaps_closed_;
  facts["largest_gap_mm"] = largest_gap_mm_;
  facts["open_chains"] = sums_.open;
  facts["emptied_layers"] = emptied_.count;
}

}  // namespace

std::unique_ptr<Maker> make_contour_maker(const Plan& plan, Sanity& sanity, const FlowLimits& limits) {
  return std::make_unique<ContourMaker>(plan, sanity, limits);
}

}  // namespace lamina::pipeline
