// stages/dose/budget.h: requested and reached binder of a job, before it is made and after.
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "stages/data/grid.h"
#include "stages/data/layer.h"
#include "stages/data/status.h"
#include "stages/dose/field.h"
#include "stages/dose/saturation.h"

namespace lamina::dose {

/// A bound by boxes: zones reported as absent are absent; zones reported as present may be absent.
class CoveredSpans {
 public:
  /// Every zone at all heights, with a core.
  CoveredSpans() = default;
  /// shell_nm  a core lies deeper than that; parts that may touch have one together. pixel_nm  the larger pitch
  /// cost      O(boxes log boxes)
  CoveredSpans(std::span<const ZoneBox> boxes, std::uint32_t zones, std::int64_t shell_nm, std::int64_t pixel_nm);

  bool any(std::uint32_t zone, const Layer& layer) const { return everywhere_ || meets(all_[zone], layer); }
  bool core(std::uint32_t zone, const Layer& layer) const { return everywhere_ || meets(core_[zone], layer); }

 private:
  struct Span {
    std::int64_t from = 0, to = 0;
  };
  using Spans = std::vector<Span>;  // in order, apart
  static void merge(Spans& spans);
  static bool meets(const Spans& spans, const Layer& layer);

  bool everywhere_ = true;
  std::vector<Spans> all_, core_;  // by zone
};

/// Layers [first, last) that follow each other.
struct LayerSpan {
  std::uint32_t first = 0, last = 0;
  std::int64_t from_nm = 0, to_nm = 0;  // heights above the bed
};

/// Layers that have a fault in common, and the worst of them.
struct DoseFault {
  std::vector<LayerSpan> where;
  double requested = 0, gets = 0, drops = 0;  // per cent and drops a pixel, of the worst
  bool alike = true;                          // all get the same
  /// worse  whether this is worse than what was found so far
  void add(const Layer& layer, double requested_percent, double gets_percent, double requested_drops, bool worse);
};

/// How drops are jetted.
struct Jetting {
  bool dithered = true;          // else drops of a pixel are rounded to whole ones
  bool shell = false;            // else all is core
  double core = 1;               // share of the core's pixels that get their drop; a job with a target has 1
  std::uint32_t full_drops = 1;  // of a full pixel without a target
};

/// Checks the doses of a job's layers before any is made.
class Budget {
 public:
  /// targets      none: one drop a pixel
  /// max_drops    that may be jetted on a pixel
  /// min_percent  of the voids, that binds; 0: unknown
  /// covered      where doses are needed: elsewhere they are not checked
  Budget(const Binder& binder, const PixelGrid& grid, std::optional<DoseTargets> targets, std::uint32_t max_drops,
         double min_percent, const Jetting& jetting = {true, true, 1}, CoveredSpans covered = {});

  /// Before foresee(), of targets that are formulas: positions of the parts, and number of layers.
  void survey(std::vector<ZoneBox> boxes, std::uint32_t layers) { boxes_ = std::move(boxes), layers_ = layers; }

  /// Layers in their order. cost  that of dose_of(), once for equal layers; of formulas that of FieldSurvey
  /// made  false: by another run of the same job, which reports its warnings
  void foresee(const Layer& layer, bool made = true);

  /// The most drops of any pixel in the layers so far.
  std::uint32_t max_drops() const { return max_drops_; }

  /// Warns of targets that cannot be met, and of those too low for one drop.
  /// errors  kUsage: layers of any run get less than binds, and that is not allowed; a formula is invalid
  Status check(bool allow_unbound, std::vector<Warning>& warnings) const;

  const Binder& binder() const { return binder_; }
  const PixelGrid& grid() const { return grid_; }
  const Jetting& jetting() const { return jetting_; }
  bool has_target() const { return targets_.has_value(); }
  /// Whether somewhere in the boxes of parts a formula is no number of per cent, or gives less than binds.
  bool is_uncertain(bool allow_unbound) const { return no_number_ || (!allow_unbound && !thin_.where.empty()); }
  /// Minimum and maximum per cent that the made layers get.
  std::pair<double, double> gets() const { return gets_; }

 private:
  const LayerDose& dose(const Layer& layer, std::uint32_t zone);
  void check_dose(const Layer& layer, std::uint32_t zone, const LayerDose& dose, bool core, DoseFault& cut);
  void inspect_field(const Layer& layer, std::uint32_t zone, bool core);
  FieldSurvey* survey_of(const std::string& formula, std::size_t position, std::uint32_t zone);
  void warn_of_none(std::vector<Warning>& warnings) const;

  Binder binder_;
  PixelGrid grid_;
  std::optional<DoseTargets> targets_;
  std::uint32_t limit_, max_drops_ = 0;
  double min_percent_;
  Jetting jetting_;
  CoveredSpans spans_;
  std::pair<double, double> gets_{0, 0};
  bool any_ = false, made_ = true;                          // made: the layer under inspection
  std::map<std::pair<std::size_t, Nm>, LayerDose> known_;   // by target index and thickness
  DoseFault peaks_;                                         // as cut_, of formulas in boxes of parts
  DoseFault cut_, unbound_, thin_;                          // thin: by positions of a formula, in parts or not
  DoseFault unbound_anywhere_;                              // in layers of other runs, too
  std::map<std::pair<std::size_t, bool>, DoseFault> none_;  // targets above 0 without a drop; by index, of the core
  std::map<std::uint32_t, bool> jetted_;                    // whether parts with their own target get any; by zone
  std::vector<ZoneBox> boxes_;
  std::uint32_t layers_ = 1;
  std::map<std::pair<std::string, std::uint32_t>, FieldSurvey> surveys_;  // by formula and zone
  std::optional<Error> no_formula_;
  bool no_number_ = false;
};

/// Counts what layers got.
class BinderCount {
 public:
  /// dosed_pixels, drops, requested_drops, max_drops  of the layer's record; lost  drops that no nozzle fires
  void add(const Budget& budget, const Layer& layer, std::uint64_t dosed_pixels, std::uint64_t drops,
           std::uint64_t requested_drops, std::uint64_t lost, std::uint32_t max_drops = 0);

  std::uint64_t drops() const { return drops_; }
  /// Of any pixel; a dithered target plans for one more than a small part may get.
  std::uint32_t max_drops() const { return max_drops_; }
  double binder_ml(const Budget& budget) const { return static_cast<double>(drops_) * budget.binder().drop_pl * 1e-9; }
  /// Per cent of the voids of all dosed pixels, by the target and by the drops.
  double requested_percent(const Budget& budget) const { return percent(budget, requested_drops_); }
  double reached_percent(const Budget& budget) const { return percent(budget, drops_); }

 private:
  double percent(const Budget& budget, std::uint64_t drops) const;
  std::uint64_t drops_ = 0, requested_drops_ = 0;
  std::uint32_t max_drops_ = 0;
  double voids_pl_ = 0;
};

}  // namespace lamina::dose
