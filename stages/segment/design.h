// stages/segment/design.h: the segmented filling that has the target pores: what may be chosen for a machine, the pores of a
// choice in microseconds, the search, and targets that change from the bottom of a part to its top.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "stages/data/extruder.h"
#include "stages/data/status.h"
#include "stages/segment/calibration.h"
#include "stages/segment/segmentation.h"

namespace lamina::segment {

// --- what may be chosen for a machine, and what of that was measured

/// What is free: lengths of stretches, what lies between thick beads and their neighbours (below 0: overlap), the extrusion of
/// segmented lines, and how many continuous ones lie between two of them. Speeds follow from the extrusion.
struct Choice {
  std::uint32_t continuous = 1;
  double extrusion = 100;  // %
  double thick_mm = 1.5, thin_mm = 1.5, gap_mm = 0;
};

struct Interval {
  double minimum = 0, maximum = 0;
  double near(double value) const { return value < minimum ? minimum : value > maximum ? maximum : value; }
};

/// Bounds of choices for a machine.
class DesignLimits {
 public:
  /// calibration  has to outlive it
  /// errors       kUsage: no widths of repeated segments, or at other speeds than 200 %; no thin segment reaches its speed
  static Result<DesignLimits> of(const Extruder& machine, const Calibration& calibration);

  /// Lines between two segmented ones: those of Di Nisio 2022, Table 8.
  static constexpr std::uint32_t kMaxContinuous = 3;

  Interval extrusion() const { return extrusion_; }
  /// The nearest choice that can be deposited. Thin segments are long enough for the machine to come to three quarters of their
  /// speed, and to keep a pore of 0.3 mm between thick beads; at most half as long as it takes the bead to be as wide as
  /// before. Pores are at least 0.03 mm wide: 0.02 mm are bonded. Thick beads overlap their neighbours by at most 0.02 mm, and
  /// stay away by no more than 0.02 mm. Lengths of thick segments are between 1 and 2.4 mm.
  Choice nearest(Choice choice) const;

  /// The key's values, as they are written unless `exact`: lengths to a micrometre, spacings to 0.1 um, percent to 0.1.
  SegmentSettings settings_of(const Choice& choice, bool exact = false) const;
  /// The plan with the widths that the machine's beads will have. errors  of resolve()
  Result<Segmentation> plan_of(const SegmentSettings& settings) const;

  /// The plan with the widths that toolpaths are written with: that of continuous lines is of the deposit at 100 %, not the
  /// measured one. A better model of beads belongs here.
  Segmentation deposited(Segmentation plan) const;

  /// The void of a period by what is fed: thick and thin stretches are fed alike.
  double fed_porosity(const Segmentation& plan) const;

  /// How far a choice is from what was measured, 0 where it was: extrusion, thick, thin, gap; 1 is far.
  std::array<double, 4> beyond(const Choice& choice) const;

  const Calibration& calibration() const { return *calibration_; }

 private:
  const Calibration* calibration_ = nullptr;
  Interval extrusion_;
  double speed_mm_s_ = 0, acceleration_ = 0, max_thin_ = 0, continuous_mm_ = 0, full_mm2_ = 0;
};

// --- the pores of a segmented filling as slots between beads

/// One period of a plan: two pores, mirror images of each other, and what lies between continuous lines.
struct Slots {
  double porosity = 0;         // void / volume, cusps between beads included
  double permeability_m2 = 0;  // Darcy's k1 along z
  double throat_mm = 0;        // the largest ball that passes along z
};

/// Layers lie upon each other without a turn, so pores of all layers make one channel next to each thin segment, along z.
/// Beads are stadia as high as their layer, with round ends; one narrower than its layer is high is round. They keep their
/// widths where they overlap. At each position along the line the fluid flows along z through a gap that varies with height:
/// its resistance is the mean over the layer of 12 / gap^3. What flows along the line and across it is left out, and that
/// walls are not parallel, so that wide gaps of short pores are given too permeable; the order of plans is right.
/// plan      checked (segmentation.h), without a sweep; rules of ends have no part in it
/// layer_mm  > 0
/// source    the cubic law: P. A. Witherspoon, J. S. Y. Wang, K. Iwai, J. E. Gale, "Validity of cubic law for fluid flow in a
///           deformable rock fracture", Water Resour. Res. 16 (1980)
/// cost      some thousand roots, 20 microseconds
Slots slots_of(const Segmentation& plan, double layer_mm);

// --- what can be reached

/// The smallest and largest values of plans with a number of continuous lines; the plans that have those of k1.
struct Reach {
  Interval porosity{1, 0}, permeability_m2{1, 0}, pore_width_mm{1e9, 0}, pore_length_mm{1e9, 0};
  Choice tightest, widest;
};

/// k1 and pores by slots, porosity by what is fed, of all plans at the ends of what is free, for 1 .. kMaxContinuous lines:
/// every quantity rises or falls with each of them.
/// cost  72 calls of slots_of()
std::array<Reach, DesignLimits::kMaxContinuous> reach_of(const DesignLimits& limits);

// --- the search

/// The target: one or two of these. A pore is that of predict_pores().
struct PoreTarget {
  std::optional<double> porosity;         // 0 .. 1, all void
  std::optional<double> permeability_m2;  // along z
  std::optional<double> pore_width_mm, pore_length_mm;
};

/// What a better computation says / what slots_of() says, of a plan near the one that is searched for.
struct SlotRatio {
  double porosity = 1, permeability = 1;
};

/// The same of one plan.
struct RatioAt {
  Choice choice;
  SlotRatio ratio;
};

/// What is fed / what slots_of() says at the ends of what is free: tables of widths do not conserve volume.
/// permeability  ratio that all of them get
std::vector<RatioAt> fed_ratios(const DesignLimits& limits, double permeability);

/// How many continuous lines may lie between two segmented ones.
struct LineBounds {
  std::uint32_t minimum = 1, maximum = DesignLimits::kMaxContinuous;
};

struct Design {
  Choice choice;
  SegmentSettings settings;  // its keys
  Segmentation plan;
  Slots slots;  // with the ratios
  SlotRatio ratio;
  Pores pores;
  double miss = 0;    // of the target that is met worst: relative
  double beyond = 0;  // what was measured: length of DesignLimits::beyond()
};

/// Whether no number of lines comes near to the target: k1 is outside of its reach by more than a half, or another quantity by
/// more than 15 %. That is more than slots, corrected at both ends, differ from forward runs (bench/design.md).
/// reach  of 1, 2, .. lines; empty: unknown, nothing is out of it
bool out_of_reach(const PoreTarget& target, std::span<const Reach> reach);

/// The largest relative miss of what a plan is.
double miss_of(const PoreTarget& target, const Slots& slots, const Pores& pores);

/// Of all choices within the limits that meet the target the one nearest to what was measured; where none does, the one that
/// misses it least (sum of squared logarithms). Nothing is random: least squares (Levenberg and Marquardt, within bounds)
/// from a grid of beginnings for each number of continuous lines.
/// target  at least one; positive
/// ratio   of plans far from all that are known; near to these the ratio is theirs: a mean of logarithms, weighted with inverse
///         squares of distances (D. Shepard, "A two-dimensional interpolation function for irregularly-spaced data", Proc. 23rd
///         ACM National Conference, 1968)
/// source  K. Levenberg, "A method for the solution of certain non-linear problems in least squares", Q. Appl. Math. 2 (1944)
/// cost    some 10,000 calls of slots_of(), a fifth of a second
Design search(const PoreTarget& target, const DesignLimits& limits, const SlotRatio& ratio, const LineBounds& bounds = {},
              std::span<const RatioAt> known = {});

// --- targets that change with height, as regions one above the other

/// One region of a filling.
struct TargetStep {
  double from_mm = 0, to_mm = 0;  // above the part's bottom; ends of layers
  PoreTarget target;
};

/// A region has so many layers at least: where two of them meet, pores lie upon each other only in part.
inline constexpr std::uint32_t kMinLayers = 3;
inline constexpr std::uint32_t kMaxRegions = 50;

/// The tops of regions as high as each other, up to whole layers; the last one ends with the layer that reaches the height.
/// steps   2 or more
/// errors  kUsage: some would have less than kMinLayers
Result<std::vector<double>> equal_tops(double height_mm, std::uint32_t steps, double layer_mm);

/// The same for tops that are given: each is moved to the nearest end of a layer, the last one up.
/// errors  kUsage: less than two, more than kMaxRegions, or not kMinLayers above the one before
Result<std::vector<double>> whole_tops(const std::vector<double>& tops_mm, double layer_mm);

/// The target of each region: the bottom's in the first, the top's in the last, and between them in proportion to heights of
/// the regions' middles.
/// bottom, top  targets of the same quantities
/// tops_mm      of equal_tops() or whole_tops()
std::vector<TargetStep> steps_of(const PoreTarget& bottom, const PoreTarget& top, const std::vector<double>& tops_mm);

/// The minimum number of continuous lines whose slots meet the target of every region that any number meets, unless a larger
/// one is much nearer to what was measured. With one number, pores of neighbouring regions lie in rows of about the same
/// distance. 0: there is none.
/// tolerance  relative
/// cost       of search(), for each step
std::uint32_t common_lines(const std::vector<TargetStep>& steps, const DesignLimits& limits, const SlotRatio& ratio,
                           double tolerance);

}  // namespace lamina::segment
