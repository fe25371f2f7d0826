#include "stages/bead/deposition.h"

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "stages/bead/line.h"
#include "stages/bead/section.h"
#include "stages/bead/spread.h"

namespace lamina::bead {
namespace {

constexpr double kFarthest = 1.5;                    // mm: what is wider than 3 mm spreads so far
constexpr double kWidest = 3;                        // mm
constexpr double kMaxPrimed = 4;                     // times the flow of a line: what is primed beyond that is a purge
constexpr double kMinSpeed = 0.01, kMaxSpeed = 1e4;  // mm/s: a file may say anything

double length_of(const DepositedBead& bead) {
  return std::hypot((mm(bead.to.x) - mm(bead.from.x)), (mm(bead.to.y) - mm(bead.from.y)));
}

/// The beads of one line and how far along it each begins.
class DepositedLine {
 public:
  explicit DepositedLine(const DepositionRules& rules) : rules_(rules), spread_(rules.height_mm, rules.piece_mm, kFarthest) {}

  /// flow     mm3/s with which the line before ended; below 0: not known
  /// returns  that with which this one ends
  double deposit(std::span<const DepositedBead> beads, std::span<const BeadFeed> feeds, double flow,
                 Buffer<DepositedPiece>& out);

 private:
  double first_flow(double fed_mm3_s, double max_mm3_s, double flow) const;
  double speed_of(const BeadFeed& feed) const {
    return feed.speed_mm_s > 0 ? std::clamp(feed.speed_mm_s, kMinSpeed, kMaxSpeed) : rules_.usual_mm_s;
  }
  double speed_between(std::size_t i) const;
  Point2 at(std::size_t bead, double position) const;
  void put(const BeadPiece& piece, Buffer<DepositedPiece>& out);
  void put(const SpreadCell& cell, Buffer<DepositedPiece>& out);

  const DepositionRules& rules_;
  BeadSpread spread_;
  std::span<const DepositedBead> beads_;
  std::span<const BeadFeed> feeds_;
  Buffer<double> begin_;  // mm, one more than beads
  std::size_t here_ = 0;  // the bead that the last piece lies on
};

/// The speed with which the head goes from bead i to the next.
double DepositedLine::speed_between(std::size_t i) const {
  const DepositedBead &a = beads_[i], &b = beads_[i + 1];
  const double across =
      (mm(a.to.x) - mm(a.from.x)) * (mm(b.to.y) - mm(b.from.y)) - (mm(a.to.y) - mm(a.from.y)) * (mm(b.to.x) - mm(b.from.x));
  const double along =
      (mm(a.to.x) - mm(a.from.x)) * (mm(b.to.x) - mm(b.from.x)) + (mm(a.to.y) - mm(a.from.y)) * (mm(b.to.y) - mm(b.from.y));
  const double bend = 2 * std::sin(std::abs(std::atan2(across, along)) / 2);  // change of velocity / speed
  return std::min({speed_of(feeds_[i]), speed_of(feeds_[i + 1]), bend > 0 ? rules_.corner_mm_s / bend : HUGE_VAL});
}

Point2 DepositedLine::at(std::size_t bead, double position) const {
  const DepositedBead& on = beads_[bead];
  const double length = begin_[bead + 1] - begin_[bead];
  const double share = length > 0 ? (position - begin_[bead]) / length : 0;
  const auto between = [share](Nm a, Nm b) { return static_cast<Nm>(std::llround(a + share * (static_cast<double>(b) - a))); };
  return {between(on.from.x, on.to.x), between(on.from.y, on.to.y)};
}

/// Cuts a piece, along which area and width run evenly, into shorter ones.
void DepositedLine::put(const BeadPiece& piece, Buffer<DepositedPiece>& out) {
  const double length = piece.end_mm - piece.begin_mm;
  const auto parts = static_cast<std::uint32_t>(std::ceil(length / rules_.piece_mm));
  const double mean = piece.volume_mm3 / length, slope = piece.end_area_mm2 - piece.begin_area_mm2;
  for (std::uint32_t i = 0; i < parts; ++i) {
    const double middle = (i + 0.5) / parts, area = std::max(mean + slope * (middle - 0.5), 0.0);
    const double begin = piece.begin_mm + length * i / parts, end = piece.begin_mm + length * (i + 1) / parts;
    put(SpreadCell{begin, end, area * (end - begin), area, width_of(area, piece.pressed, rules_.height_mm)}, out);
  }
}

void DepositedLine::put(const SpreadCell& cell, Buffer<DepositedPiece>& out) {
  if (!(cell.volume_mm3 > 0)) return;
  for (double from = cell.begin_mm; from < cell.end_mm;) {
    while (here_ + 1 < beads_.size() && begin_[here_ + 1] <= from) ++here_;
    const double to = here_ + 1 < beads_.size() ? std::min(cell.end_mm, begin_[here_ + 1]) : cell.end_mm;
    const Point2 a = at(here_, from), b = at(here_, to);
    const Box& box = rules_.within;
    const bool outside = !box.empty() && (std::max(a.x, b.x) < box.lo.x || std::min(a.x, b.x) > box.hi.x ||
                                          std::max(a.y, b.y) < box.lo.y || std::min(a.y, b.y) > box.hi.y);
    if (!outside) out.push_back({a, b, cell.area_mm2, std::min(cell.width_mm, kWidest)});
    from = to;
  }
}

/// fed, most  mm3/s: at the speed with which the line begins, and at full speed
double DepositedLine::first_flow(double fed, double maximum, double flow) const {
  if (flow < 0 || !(rules_.machine.tau_s > 0)) return fed;
  const double primed = flow + feeds_[0].primed_mm3 * rules_.feed_ratio / rules_.machine.tau_s;
  return primed >= 0 && primed <= kMaxPrimed * std::max(maximum, flow) ? primed : fed;
}

double DepositedLine::deposit(std::span<const DepositedBead> beads, std::span<const BeadFeed> feeds, double flow,
                              Buffer<DepositedPiece>& out) {
  beads_ = beads;
  feeds_ = feeds;
  here_ = 0;
  begin_.assign(1, 0);
  for (const DepositedBead& bead : beads) begin_.push_back(begin_.back() + length_of(bead));
  const auto area = [&](std::size_t i) {
    const double length = begin_[i + 1] - begin_[i];
    return length > 0 ? std::min(feeds[i].volume_mm3 * rules_.feed_ratio / length, kWidest * rules_.height_mm) : 0;
  };
  const TakeCell cell = [&](const SpreadCell& c) { put(c, out); };
  double moved = 0;  // along the line, where the stretch that is under way began
  const TakePiece piece = [&](BeadPiece p) {
    p.begin_mm += moved;
    p.end_mm += moved;
    if (rules_.spread)
      spread_.add(p, cell);
    else
      put(p, out);
  };
  BeadLine line(rules_.machine, rules_.height_mm);
  const double first = std::min(speed_of(feeds[0]), rules_.corner_mm_s);
  Joint joint{first, first_flow(first * area(0), speed_of(feeds[0]) * area(0), flow), true};
  for (std::size_t i = 0; i < beads.size(); ++i) {
    if (i == 0) line.begin(joint);
    line.add({begin_[i + 1] - begin_[i], area(i), speed_of(feeds[i])}, piece);
    const bool last = i + 1 == beads.size();
    const double next = last ? std::min(speed_of(feeds[i]), rules_.corner_mm_s) : speed_between(i);
    if (!last && next >= std::min(speed_of(feeds[i]), speed_of(feeds[i + 1]))) continue;
    joint = line.end(next, piece);
    moved = begin_[i + 1];
    if (!last) line.begin(joint);
  }
  if (rules_.spread) spread_.end(cell);
  return joint.flow_mm3_s;
}

}  // namespace

void deposit(std::span<const DepositedBead> beads, std::span<const BeadFeed> feeds, const DepositionRules& rules,
             Buffer<DepositedPiece>& out) {
  out.clear();
  DepositedLine line(rules);
  double flow = -1;
  for (std::size_t i = 0; i < beads.size();) {
    std::size_t end = i + 1;
    while (end < beads.size() && feeds[end].joined) ++end;
    flow = line.deposit(beads.subspan(i, end - i), feeds.subspan(i, end - i), flow, out);
    i = end;
  }
}

}  // namespace lamina::bead
