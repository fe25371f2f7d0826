// stages/bead/lag.h: the flow out of a nozzle that follows its feed late, in closed form.
//
// dQ/dt = (A v - Q) / tau, where A is the cross-section that is fed and v the speed of the head: extrusion follows motion. On a
// phase of constant acceleration the solution is a line and an exponential; no step is taken, so no error is made.
// Assumed: one linear lag, the same for more and for less flow. Where its constant comes from: stabilisation.h.
#pragma once

#include <algorithm>
#include <cmath>

namespace lamina::bead {

/// A part of a stretch on which the head accelerates evenly, with the flow at its beginning.
struct Phase {
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

}  // namespace lamina::bead
