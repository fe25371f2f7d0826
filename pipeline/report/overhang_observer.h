// pipeline/report/overhang_observer.h: sums the overhangs of layers that this run makes, for a warning and the facts.
#pragma once

#include "pipeline/manifest/record.h"
#include "pipeline/report/observer.h"
#include "stages/checks/overhang_tally.h"
#include "stages/data/overhang.h"

namespace lamina::pipeline {

/// {"angle_deg": 45, "area_mm2": 300, "layers": 1, "first_layer": 100, "last_layer": 100, "largest": [{"area_mm2", "x_mm",
/// ...}]}
Json overhangs_json(const checks::OverhangTally& tally, double angle_deg);

template <class Made>
class OverhangObserver : public Observer<Made> {
 public:
  explicit OverhangObserver(double angle_deg) : angle_deg_(angle_deg) {}
  void layer(const LayerRecord& record, const Made*) override {
    if (record.paths->overhang) tally_.add(record.layer, *record.paths->overhang);
  }
  void warn(const Summary&, std::vector<Warning>& warnings) override { tally_.warn(angle_deg_, warnings); }
  void report(Summary& summary) const override { summary.facts["overhangs"] = overhangs_json(tally_, angle_deg_); }

 private:
  double angle_deg_;
  checks::OverhangTally tally_;
};

}  // namespace lamina::pipeline
