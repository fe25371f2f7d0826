// stages/bead/line.h: the bead along a line, predicted while its stretches come, without keeping the line.
//
// What it assumes: extrusion follows motion (what is fed is the commanded cross-section x the speed of the head), the head
// accelerates evenly, the melt lags (FlowPhase), and volume is conserved: cross-section = flow / speed. The width is
// that of the cross-section. That material spreads along the line as well is left to spread.h. Three numbers of a
// machine and the volume it is fed enter; no table of widths is used.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <functional>
#include <limits>
#include <numbers>
#include <span>

#include "stages/data/buffer.h"
#include "stages/geometry/bead_section.h"

namespace lamina::bead {

/// A calibration for the model. Nothing else of a machine enters it.
struct BeadMachine {
  double area_mm2 = 0;  // cross-section of 100 %: bead_area x flow of the profile
  /// The melt follows the feed with this lag, s; 0: deposits at once what is fed. Anet A8: time_constant() in stabilisation.h.
  double tau_s = 0;
  /// Of the head along a line. Infinite: speeds change at once.
  double acceleration_mm_s2 = std::numeric_limits<double>::infinity();
};

/// A straight piece of a line as it is commanded.
struct LineSegment {
  double length_mm;   // > 0
  double area_mm2;    // that is fed for each mm, >= 0: area of 100 % x extrusion
  double speed_mm_s;  // > 0; reached if the stretch is long enough
};

/// How a line begins, or has ended: what the line before left behind.
struct Joint {
  double speed_mm_s = 0;  // of the head
  double flow_mm3_s = 0;  // that leaves the nozzle
  bool pressed = true;    // the bead stays between nozzle and layer
};

// --- the width of a bead of given cross-section.
//
// Three forms, none with a constant of its own:
// - A bead that fills its layer is a stadium: a rectangle with half circles at both sides (the `Flow` of PrusaSlicer and
//   Slic3r).
// - A bead that filled its layer and is starved by the lag, though it is fed enough, stays between nozzle and layer below: it
//   keeps its height and is an ellipse. Examples are the thin segments of Di Nisio 2022, Table 11.
// - A thread that is fed too little to fill its layer detaches and stays round, as it left the nozzle, until the layer is
//   filled again. Examples are those of Table 12.
// The rule that separates the last two was derived from Tables 11 and 12, in both of which a bead has half of its area
// and is 0.21 mm wide in one, 0.27 mm in the other. Tables 13 to 16 were not used for it.

/// mm2: the circle as high as the layer.
inline double full_circle(double height_mm) { return std::numbers::pi / 4 * height_mm * height_mm; }

/// What is fed is enough to fill the layer: a bead that is starved all the same stays between nozzle and layer.
inline bool may_stay_pressed(double fed_mm2, double height_mm) { return fed_mm2 >= full_circle(height_mm); }

/// Whether a bead lies between nozzle and layer. before  whether it did so just before
inline bool stays_pressed(double area_mm2, double fed_mm2, bool before, double height_mm) {
  return area_mm2 >= full_circle(height_mm) || (before && may_stay_pressed(fed_mm2, height_mm));
}

/// mm. pressed  it stays between nozzle and layer; says nothing where the layer is filled
inline double width_of(double area_mm2, bool pressed, double height_mm) {
  const bool ellipse = pressed && area_mm2 < full_circle(height_mm);
  return bead_width(std::max(area_mm2, 0.0), height_mm, ellipse ? BeadShape::kEllipse : BeadShape::kStadium);
}

// --- the flow out of a nozzle that follows its feed late, in closed form.
//
// dQ/dt = (A v - Q) / tau, where A is the cross-section that is fed and v the speed of the head: extrusion follows motion. On a
// phase of constant acceleration the solution is a line and an exponential; no step is taken, so no error is made.
// Assumed: one linear lag, the same for more and for less flow. Where its constant comes from: stabilisation.h.

/// A part of a stretch on which the head accelerates evenly, with the flow at its beginning.
struct FlowPhase {
  double length_mm, area_mm2;
  double speed_mm_s, acceleration_mm_s2;  // at the beginning; below 0 where it slows down
  double tau_s, flow_mm3_s;

  /// Speed and time after a way s within the phase. Two speeds of 0 are no phase.
  double speed_at(double s) const { return std::sqrt(std::max(speed_mm_s * speed_mm_s + 2 * acceleration_mm_s2 * s, 0.0)); }
  double time_at(double s) const { return s <= 0 ? 0.0 : 2 * s / (speed_mm_s + speed_at(s)); }

  /// Flow after a time t.
  double flow_after(double t) const {
    const double followed = area_mm2 * (speed_mm_s + acceleration_mm_s2 * (t - tau_s));
    if (tau_s <= 0) return followed;
    return followed + excess() * std::exp(-t / tau_s);
  }
  /// mm3 that were deposited by then: the integral of the flow, not what was fed less what is held.
  double deposited_after(double t) const {
    const double followed = area_mm2 * t * (speed_mm_s + acceleration_mm_s2 * (t / 2 - tau_s));
    if (tau_s <= 0) return followed;
    return followed - excess() * tau_s * std::expm1(-t / tau_s);
  }
  /// Cross-section at a way s; infinite where the head stands and the melt flows.
  double area_at(double s) const { return flow_after(time_at(s)) / speed_at(s); }

 private:
  double excess() const { return flow_mm3_s - area_mm2 * (speed_mm_s - acceleration_mm_s2 * tau_s); }
};

/// mm3 by which a line that is fed so much comes short (below 0: has too much) because it begins with another flow. Fed in
/// addition before the line begins, it makes a start that is right at once: the same line then begins with the flow that it
/// keeps.
inline double missing_at_start(double flow_mm3_s, double fed_mm3_s, double tau_s) { return tau_s * (fed_mm3_s - flow_mm3_s); }

// --- the speed of the head along a line, decided as far ahead as it has to be and no further.
//
// A planner joins two segments at the slower of their two speeds: a change takes place within the faster one. Where a segment
// is too short for that, the speed at its beginning is lower. A junction speed is final as soon as it is the same whether the
// head stops after the last known segment or continues, so that the queue is as long as a braking distance.

/// A stretch and the speeds at its two ends.
struct Planned {
  LineSegment segment;
  double begin_mm_s, end_mm_s;
  /// The highest speed within it: that of the stretch, or less where it is short.
  double peak(double acceleration_mm_s2) const;
};

/// Takes the stretches of a line one after another.
class SpeedPlan {
 public:
  explicit SpeedPlan(double acceleration_mm_s2) : acceleration_(acceleration_mm_s2) {}

  /// A new line; nothing may wait. speed  that the line before joins with; faster than the first stretch: it is left at once
  void begin(double speed_mm_s) { speed_ = speed_mm_s; }
  void add(const LineSegment& segment) { waiting_.push_back(segment); }
  /// The line ends with this speed. The caller then takes all queued segments.
  bool take_last(double speed_mm_s, Planned& out);
  /// The next stretch whose speeds are final. cost  O(stretches that wait)
  bool take(Planned& out);

  std::size_t waiting() const { return waiting_.size() - first_; }

 private:
  double end_of_first(double last_mm_s) const;
  bool give(double end_mm_s, Planned& out);

  double acceleration_, speed_ = 0;
  Buffer<LineSegment> waiting_;
  std::size_t first_ = 0;  // those before it were taken
};

/// The speed with which a pattern that is repeated without end begins each time.
/// errors  none; an empty pattern has 0
double cyclic_speed(std::span<const LineSegment> period, double acceleration_mm_s2);

// ---

/// A short piece of a bead, mm from where the line begins. Between its ends area and width are in proportion, within the
/// tolerance; the volume is exact.
struct BeadPiece {
  double begin_mm, end_mm;
  double begin_area_mm2, end_area_mm2;
  double begin_width_mm, end_width_mm;
  double volume_mm3;  // deposited
  bool pressed;       // between nozzle and layer
};

using TakePiece = std::function<void(const BeadPiece&)>;

/// One line after another. Keeps the stretches within a braking distance, nothing else; not to be shared by threads.
/// cost    O(stretches + pieces): pieces grow with 1 / sqrt(tolerance), a dozen for a stretch of 1.5 mm at 0.005 mm
///
/// usage   begin(joint); add(stretch, take)...; joint = end(speed, take);
class BeadLine {
 public:
  /// height     of the layer, mm, > 0
  /// tolerance  mm of width, > 0: pieces are so short that between their ends a width is at most so far from the line
  ///            between them; none is shorter than 0.1 um, which starts from rest need
  BeadLine(const BeadMachine& machine, double height_mm, double tolerance_mm = 0.005);

  /// At the place 0. Sums begin anew.
  void begin(const Joint& from);
  /// Gives the pieces of all stretches whose speeds are final, in order.
  /// stretch  an empty one is left out
  void add(const LineSegment& segment, const TakePiece& take);
  /// Gives the rest. speed  that the line after joins with
  /// returns  how the line ends
  Joint end(double speed_mm_s, const TakePiece& take);

  double seconds() const { return seconds_; }
  double deposited_mm3() const { return deposited_; }
  double fed_mm3() const { return fed_; }

 private:
  void deposit(const Planned& planned, const TakePiece& take);
  void deposit(const FlowPhase& phase, const TakePiece& take);
  double step_within(const FlowPhase& phase, double from, double step) const;
  double width(const FlowPhase& phase, double s) const;

  BeadMachine machine_;
  double height_, tolerance_;
  SpeedPlan plan_;
  double position_ = 0, seconds_ = 0, deposited_ = 0, fed_ = 0;
  double flow_ = 0, speed_ = 0;
  bool pressed_ = true;
};

/// How a pattern that is repeated without end begins each time: a line that begins like this is in its steady state at once.
/// cost  O(stretches) and three periods: the lag is linear, so that the flow after a period is a line of the flow before
Joint steady_joint(const BeadMachine& machine, double height_mm, std::span<const LineSegment> period);

}  // namespace lamina::bead
