#include "stages/bead/even_starts.h"

#include <algorithm>
#include <cmath>

#include "stages/data/units.h"

namespace lamina::bead {
namespace {

constexpr double kMin = 1e-3;      // mm3 that the melt holds too little or too much: a hundredth of a mm of a bead
constexpr double kWay = 0.2;       // mm, of the first piece
constexpr double kMinFeed = 0.05;  // times that of the line: a move without a feed is a travel
constexpr double kMaxFeed = 3;
constexpr double kTolerance = 1;     // mm of width: widths are not used here
constexpr double kMinLength = 1e-3;  // mm, of a piece

double length_of(const BeadMove& move) { return std::hypot(mm(move.to.x - move.from.x), mm(move.to.y - move.from.y)); }

/// How long a line takes, mm, whose flow is to come from `ratio` of its own to that: as long as keeps its feed between
/// kMinFeed and kMaxFeed. reach  mm that the head goes in one lag
double way_of(double ratio, double reach) {
  const double minimum =
      ratio > 1 ? std::log((ratio - kMinFeed) / (1 - kMinFeed)) : std::log((kMaxFeed - ratio) / (kMaxFeed - 1));
  return std::max(kWay, reach * minimum);
}

const TakePiece kDiscard = [](const BeadPiece&) {};

}  // namespace

EvenStarts::EvenStarts(const Extruder& machine, double height_mm)
    : lag_(machine.material.lag_s), line_({0, lag_, machine.speed.acceleration_mm_s2}, height_mm, kTolerance) {}

EvenStarts::MovePieces EvenStarts::take(const BeadMove& move) {
  const double flow = move.area_mm2 * move.speed_mm_s;
  if (move.jump || move.begins || !known_) {
    left_ = !known_ ? flow : even_ ? line_.end(speed_, kDiscard).flow_mm3_s : left_;
    own_ = flow;
    even_ = !(flow > 0) || std::abs(missing_at_start(left_, flow, lag_)) < kMin;
    if (even_) line_.begin({move.speed_mm_s, flow, true});
    known_ = true;
  } else if (!even_ && std::abs(flow - own_) > 1e-9 * own_) {
    even_ = true;  // another stretch of the line: what is left is the lag that it lives from
    line_.begin({speed_, left_, true});
  }
  speed_ = move.speed_mm_s;
  if (!even_) return made_even(move);
  line_.add({length_of(move), move.area_mm2, move.speed_mm_s}, kDiscard);
  return {{move, move}, 1};
}

EvenStarts::MovePieces EvenStarts::made_even(const BeadMove& move) {
  MovePieces pieces{{move, move}, 1};
  const double length = length_of(move), reach = move.speed_mm_s * lag_, ratio = left_ / own_;
  const double way = way_of(ratio, reach), kept = std::exp(-way / reach);
  const double share = (1 - ratio * kept) / (1 - kept);
  pieces.move[0].area_mm2 *= share;
  if (length < way - kMinLength) {  // continues with the line's next move
    left_ = own_ * (share + (ratio - share) * std::exp(-length / reach));
    return pieces;
  }
  even_ = true;
  line_.begin({move.speed_mm_s, own_, true});
  if (length < way + kMinLength) return pieces;
  const auto at = [&](Nm a, Nm b) { return static_cast<Nm>(a + std::llround(way / length * (static_cast<double>(b) - a))); };
  pieces.count = 2;
  pieces.move[0].to = pieces.move[1].from = {at(move.from.x, move.to.x), at(move.from.y, move.to.y)};
  pieces.move[1].jump = pieces.move[1].begins = false;
  line_.add({length - way, move.area_mm2, move.speed_mm_s}, kDiscard);
  return pieces;
}

}  // namespace lamina::bead
