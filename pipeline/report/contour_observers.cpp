#include "pipeline/report/contour_observers.h"

#include <fmt/format.h>

#include <algorithm>

#include "stages/checks/layer_warnings.h"
#include "stages/support/text/number_text.h"
#include "stages/support/text/readable.h"

namespace lamina::pipeline {
namespace {

using ContourObserver = Observer<slice::SectionReport>;

/// Contours and their filling.
class PathObserver : public ContourObserver {
 public:
  explicit PathObserver(const Plan& plan) : plan_(plan) {}
  void layer(const LayerRecord& record, const slice::SectionReport* made) override {
    sums_.add(*record.paths);
    volume_mm3_ += record.paths->area_mm2 * mm(record.layer.thickness);
    if (made != nullptr) cuts_ += made->cuts;
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
                                   fmt::format("{} closed by straight stretches, the longest {:.6f} mm; {} chains left open",
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
  }
  void warn(const Summary&, std::vector<Warning>& warnings) override {
    if (!plan_.sections->fills() || contours_ == 0 || paths_ > 0) return;
    warnings.push_back({"no-bead",
                        "no bead of the filling fits into the parts: they are narrower than walls and filling ask "
                        "for; give a smaller --bead"});
  }

 private:
  const Plan& plan_;
  std::uint64_t contours_ = 0, paths_ = 0;
};

}  // namespace

void observe_contours(const Plan& plan, Observers<slice::SectionReport>& observers) {
  observers.add<PathObserver>(plan);
  observers.add<GapObserver>();
  observers.add<OffsetObserver>(plan);
  observers.add<FillingObserver>(plan);
}

}  // namespace lamina::pipeline
