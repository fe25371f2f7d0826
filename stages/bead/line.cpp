// stages/bead/line.cpp: stretches -> phases of constant acceleration -> pieces.
#include "stages/bead/line.h"

#include <array>
#include <cstdint>

namespace lamina::bead {
namespace {

/// The highest speed at one end of a way if it is `speed` at the other.
double within_reach(double speed, double length, double acceleration) {
  return std::isinf(acceleration) ? acceleration : std::sqrt(speed * speed + 2 * acceleration * length);
}

constexpr double kMinPiece = 1e-4;  // mm

/// The one to three phases of a stretch, in order.
struct Phases {
  std::array<FlowPhase, 3> phase;
  std::uint32_t count = 0;

  void add(double length, double area, double from, double to, double tau) {
    if (length <= 0) return;
    phase[count++] = {length, area, from, (to * to - from * from) / (2 * length), tau, 0};
  }
};

Phases phases_of(const Planned& planned, const BeadMachine& machine) {
  const auto& [length, area, speed] = planned.segment;
  const double tau = machine.tau_s, acceleration = machine.acceleration_mm_s2;
  const double from = planned.begin_mm_s, to = planned.end_mm_s;
  Phases phases;
  if (std::isinf(acceleration)) {
    phases.add(length, area, speed, speed, tau);
    return phases;
  }
  const double peak = planned.peak(acceleration);
  const double up = std::max((peak * peak - from * from) / (2 * acceleration), 0.0);
  const double down = std::max((peak * peak - to * to) / (2 * acceleration), 0.0);
  const double rest = length - up - down;
  if (up + down > length * (1 + 1e-9)) {  // joined faster than the head can brake
    phases.add(length, area, from, to, tau);
    return phases;
  }
  const double even = rest > length * 1e-12 ? rest : 0;
  const double share = (length - even) / std::max(up + down, 1e-300);
  phases.add(up * share, area, from, peak, tau);
  phases.add(even, area, peak, peak, tau);
  phases.add(down * share, area, peak, to, tau);
  return phases;
}

}  // namespace

double Planned::peak(double acceleration_mm_s2) const {
  if (std::isinf(acceleration_mm_s2)) return segment.speed_mm_s;
  const double reached =
      std::sqrt((begin_mm_s * begin_mm_s + end_mm_s * end_mm_s) / 2 + acceleration_mm_s2 * segment.length_mm);
  return std::max({begin_mm_s, end_mm_s, std::min(segment.speed_mm_s, reached)});
}

double SpeedPlan::end_of_first(double last_mm_s) const {
  double speed = std::min(last_mm_s, waiting_.back().speed_mm_s);
  for (std::size_t i = waiting_.size() - 1; i > first_; --i) {
    speed = std::min(
        {within_reach(speed, waiting_[i].length_mm, acceleration_), waiting_[i].speed_mm_s, waiting_[i - 1].speed_mm_s});
  }
  return speed;
}

bool SpeedPlan::give(double end_mm_s, Planned& out) {
  const LineSegment& s = waiting_[first_++];
  const double begin = std::min(speed_, s.speed_mm_s);
  out = {s, begin, std::min(end_mm_s, within_reach(begin, s.length_mm, acceleration_))};
  speed_ = out.end_mm_s;
  if (first_ == waiting_.size()) {
    waiting_.clear();
    first_ = 0;
  } else if (first_ > 64 && 2 * first_ > waiting_.size()) {
    waiting_.erase(waiting_.begin(), waiting_.begin() + static_cast<std::ptrdiff_t>(first_));
    first_ = 0;
  }
  return true;
}

bool SpeedPlan::take(Planned& out) {
  if (waiting() < 2) return false;
  const double lower_bound = end_of_first(0);
  if (lower_bound < end_of_first(waiting_.back().speed_mm_s)) return false;
  return give(lower_bound, out);
}

bool SpeedPlan::take_last(double speed_mm_s, Planned& out) { return waiting() > 0 && give(end_of_first(speed_mm_s), out); }

double cyclic_speed(std::span<const LineSegment> period, double acceleration_mm_s2) {
  if (period.empty()) return 0;
  // The slowest joint needs no other; two rounds backwards and two forwards carry it everywhere.
  double speed = std::min(period.back().speed_mm_s, period.front().speed_mm_s);
  const auto limit = [&](const LineSegment& s) {
    speed = std::min(within_reach(speed, s.length_mm, acceleration_mm_s2), s.speed_mm_s);
  };
  for (int round = 0; round < 2; ++round) {
    for (std::size_t i = period.size(); i-- > 0;) limit(period[i]);
  }
  double first = std::min(speed, period.back().speed_mm_s);
  for (int round = 0; round < 2; ++round) {
    for (const LineSegment& s : period) limit(s);
  }
  return std::min({first, speed, period.front().speed_mm_s});
}

BeadLine::BeadLine(const BeadMachine& machine, double height_mm, double tolerance_mm)
    : machine_(machine), height_(height_mm), tolerance_(tolerance_mm), plan_(machine.acceleration_mm_s2) {}

void BeadLine::begin(const Joint& from) {
  plan_ = SpeedPlan(machine_.acceleration_mm_s2);
  plan_.begin(from.speed_mm_s);
  position_ = seconds_ = deposited_ = fed_ = 0;
  flow_ = from.flow_mm3_s;
  speed_ = from.speed_mm_s;
  pressed_ = from.pressed;
}

void BeadLine::add(const LineSegment& segment, const TakePiece& take) {
  if (!(segment.length_mm > 0)) return;
  plan_.add(segment);
  for (Planned planned{}; plan_.take(planned);) deposit(planned, take);
}

Joint BeadLine::end(double speed_mm_s, const TakePiece& take) {
  for (Planned planned{}; plan_.waiting() > 0;) {
    plan_.take_last(speed_mm_s, planned);
    deposit(planned, take);
  }
  return {speed_, flow_, pressed_};
}

void BeadLine::deposit(const Planned& planned, const TakePiece& take) {
  Phases phases = phases_of(planned, machine_);
  for (std::uint32_t i = 0; i < phases.count; ++i) {
    phases.phase[i].flow_mm3_s = flow_;
    deposit(phases.phase[i], take);
  }
}

double BeadLine::width(const FlowPhase& phase, double s) const {
  return width_of(std::min(phase.area_at(s), 1e12), pressed_ && may_stay_pressed(phase.area_mm2, height_), height_);
}

double BeadLine::step_within(const FlowPhase& phase, double from, double step) const {
  // Probes see an exponential's and a root's largest distance within a quarter of it: half of the tolerance is allowed.
  for (; step > kMinPiece; step /= 2) {
    const double a = width(phase, from), b = width(phase, from + step);
    bool within = true;
    for (const double share : {0.125, 0.25, 0.5, 0.75, 0.875}) {
      const double between = a + share * (b - a);
      within = within && std::abs(width(phase, from + share * step) - between) <= tolerance_ / 2;
    }
    if (within) break;
  }
  return step;
}

void BeadLine::deposit(const FlowPhase& phase, const TakePiece& take) {
  const double length = phase.length_mm;
  double s = 0, step = length, deposited = 0;
  const double fed = phase.area_mm2;
  pressed_ = stays_pressed(phase.area_at(0), fed, pressed_, height_);
  while (s < length) {
    step = step_within(phase, s, std::min(2 * step, length - s));
    if (step < kMinPiece) step = std::min(kMinPiece, length - s);
    const double next = length - s - step < kMinPiece / 2 ? length : s + step;
    const double volume = phase.deposited_after(phase.time_at(next));
    const double mean = (volume - deposited) / (next - s);
    double a = phase.area_at(s), b = phase.area_at(next);
    if (!std::isfinite(a)) a = mean;  // the head stands
    if (!std::isfinite(b)) b = mean;
    const bool pressed = pressed_ && may_stay_pressed(fed, height_);
    take({position_ + s, position_ + next, a, b, width_of(a, pressed, height_), width_of(b, pressed, height_),
          volume - deposited, pressed});
    pressed_ = stays_pressed(b, fed, pressed_, height_);
    deposited = volume;
    s = next;
  }
  const double time = phase.time_at(length);
  flow_ = phase.flow_after(time);
  speed_ = phase.speed_at(length);
  seconds_ += time;
  deposited_ += deposited;
  fed_ += phase.area_mm2 * length;
  position_ += length;
}

Joint steady_joint(const BeadMachine& machine, double height_mm, std::span<const LineSegment> period) {
  const double speed = cyclic_speed(period, machine.acceleration_mm_s2);
  if (period.empty()) return {};
  // The flow after a period is kept x the flow before + added.
  SpeedPlan plan(machine.acceleration_mm_s2);
  plan.begin(speed);
  for (const LineSegment& segment : period) plan.add(segment);
  double flow = 0, seconds = 0;
  while (plan.waiting() > 0) {
    Planned planned{};
    plan.take_last(speed, planned);
    Phases phases = phases_of(planned, machine);
    for (std::uint32_t i = 0; i < phases.count; ++i) {
      phases.phase[i].flow_mm3_s = flow;
      const double time = phases.phase[i].time_at(phases.phase[i].length_mm);
      flow = phases.phase[i].flow_after(time);
      seconds += time;
    }
  }
  if (machine.tau_s > 0) flow /= -std::expm1(-seconds / machine.tau_s);
  // A period in which the layer is filled anywhere forgets how it began; in one in which it is not, only the feed decides.
  Joint joint{speed, flow, true};
  BeadLine line(machine, height_mm, 0.01);
  for (int round = 0; round < 2; ++round) {
    line.begin(joint);
    for (const LineSegment& segment : period) line.add(segment, [](const BeadPiece&) {});
    joint.pressed = line.end(speed, [](const BeadPiece&) {}).pressed;
  }
  return joint;
}

}  // namespace lamina::bead
