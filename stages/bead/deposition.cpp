#include "stages/bead/deposition.h"

#include <oneapi/tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <numbers>

#include "stages/bead/spread.h"

namespace lamina::bead {
namespace {

constexpr double kFarthest = 1.5;                    // mm: what is wider than 3 mm spreads so far
constexpr double kWidest = 3;                        // mm
constexpr double kMaxPrimed = 4;                     // times the flow of a line: what is primed beyond that is a purge
constexpr double kMinSpeed = 0.01, kMaxSpeed = 1e4;  // mm/s: a file may say anything

template <class Straight>
double length_of(const Straight& bead) {
  return std::hypot(mm(bead.to.x) - mm(bead.from.x), mm(bead.to.y) - mm(bead.from.y));
}

/// The beads of one line and how far along it each begins.
class DepositedLine {
 public:
  explicit DepositedLine(const DepositionRules& rules) : rules_(rules), spread_(rules.height_mm, rules.piece_mm, kFarthest) {}

  /// flow     mm3/s with which the line before ended; below 0: not known
  /// returns  that with which this one ends
  double deposit(std::span<const DepositedBead> beads, std::span<const BeadFeed> feeds, double flow,
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
    BeadMachine machine = rules_.machine;
    if (feeds[0].acceleration_mm_s2 > 0) machine.acceleration_mm_s2 = feeds[0].acceleration_mm_s2;
    BeadLine line(machine, rules_.height_mm);
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

 private:
  /// fed, maximum  mm3/s: at the speed with which the line begins, and at full speed
  double first_flow(double fed, double maximum, double flow) const {
    if (flow < 0 || !(rules_.machine.tau_s > 0)) return fed;
    const double primed = flow + feeds_[0].primed_mm3 * rules_.feed_ratio / rules_.machine.tau_s;
    return primed >= 0 && primed <= kMaxPrimed * std::max(maximum, flow) ? primed : fed;
  }

  double speed_of(const BeadFeed& feed) const {
    return feed.speed_mm_s > 0 ? std::clamp(feed.speed_mm_s, kMinSpeed, kMaxSpeed) : rules_.usual_mm_s;
  }

  /// The speed with which the head goes from bead i to the next.
  double speed_between(std::size_t i) const {
    const DepositedBead &a = beads_[i], &b = beads_[i + 1];
    const double across =
        (mm(a.to.x) - mm(a.from.x)) * (mm(b.to.y) - mm(b.from.y)) - (mm(a.to.y) - mm(a.from.y)) * (mm(b.to.x) - mm(b.from.x));
    const double along =
        (mm(a.to.x) - mm(a.from.x)) * (mm(b.to.x) - mm(b.from.x)) + (mm(a.to.y) - mm(a.from.y)) * (mm(b.to.y) - mm(b.from.y));
    const double bend = 2 * std::sin(std::abs(std::atan2(across, along)) / 2);  // change of velocity / speed
    return std::min({speed_of(feeds_[i]), speed_of(feeds_[i + 1]), bend > 0 ? rules_.corner_mm_s / bend : HUGE_VAL});
  }

  Point2 at(std::size_t bead, double position) const {
    const DepositedBead& on = beads_[bead];
    const double length = begin_[bead + 1] - begin_[bead];
    const double share = length > 0 ? (position - begin_[bead]) / length : 0;
    const auto between = [share](Nm a, Nm b) {
      return static_cast<Nm>(std::llround(a + share * (static_cast<double>(b) - a)));
    };
    return {between(on.from.x, on.to.x), between(on.from.y, on.to.y)};
  }

  /// Cuts a piece, along which area and width run evenly, into shorter ones.
  void put(const BeadPiece& piece, Buffer<DepositedPiece>& out) {
    const double length = piece.end_mm - piece.begin_mm;
    const auto parts = static_cast<std::uint32_t>(std::ceil(length / rules_.piece_mm));
    const double mean = piece.volume_mm3 / length, slope = piece.end_area_mm2 - piece.begin_area_mm2;
    for (std::uint32_t i = 0; i < parts; ++i) {
      const double middle = (i + 0.5) / parts, area = std::max(mean + slope * (middle - 0.5), 0.0);
      const double begin = piece.begin_mm + length * i / parts, end = piece.begin_mm + length * (i + 1) / parts;
      put(SpreadCell{begin, end, area * (end - begin), area, width_of(area, piece.pressed, rules_.height_mm)}, out);
    }
  }

  void put(const SpreadCell& cell, Buffer<DepositedPiece>& out) {
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

  const DepositionRules& rules_;
  BeadSpread spread_;
  std::span<const DepositedBead> beads_;
  std::span<const BeadFeed> feeds_;
  Buffer<double> begin_;  // mm, one more than beads
  std::size_t here_ = 0;  // the bead that the last piece lies on
};

constexpr std::uint32_t kNone = UINT32_MAX;
constexpr double kAlike = 0.9;                               // cosine of the angle between beads that lie side by side
constexpr double kLevels = 0.05;                             // of a bead: what a free side takes at once does not heap up
constexpr double kOwnLine = 0.2;                             // of a width: what is nearer lies on the same line
constexpr double kCorners = 4 * (1 - std::numbers::pi / 4);  // area of the cusps of two round sides / their radius squared
constexpr std::size_t kMaxSquares = std::size_t{1} << 22;

/// A piece's middle, mm, and its direction.
struct PieceFrame {
  double x, y, along_x, along_y, half_mm;
  double forward(const PieceFrame& to) const { return (to.x - x) * along_x + (to.y - y) * along_y; }
  double leftward(const PieceFrame& to) const { return (to.y - y) * along_x - (to.x - x) * along_y; }
};

PieceFrame frame_of(const DepositedPiece& piece) {
  const double x = mm(piece.to.x) - mm(piece.from.x), y = mm(piece.to.y) - mm(piece.from.y), length = std::hypot(x, y);
  const double scale = length > 0 ? 1 / length : 0;
  return {(mm(piece.from.x) + mm(piece.to.x)) / 2, (mm(piece.from.y) + mm(piece.to.y)) / 2, x * scale, y * scale, length / 2};
}

/// Frames by squares of the bed as wide as the widest bead.
class Squares {
 public:
  Squares(std::span<const PieceFrame> frames, double widest_mm) {
    double right = -HUGE_VAL, top = -HUGE_VAL;
    for (const PieceFrame& frame : frames) {
      left_ = std::min(left_, frame.x), right = std::max(right, frame.x);
      bottom_ = std::min(bottom_, frame.y), top = std::max(top, frame.y);
    }
    edge_ = std::max(widest_mm, 0.05);
    while ((right - left_) / edge_ * ((top - bottom_) / edge_) > static_cast<double>(kMaxSquares)) edge_ *= 2;
    columns_ = column(right) + 1;
    rows_ = row(top) + 1;
    begin_.assign(columns_ * rows_ + 1, 0);
    for (const PieceFrame& frame : frames) ++begin_[square(frame) + 1];
    for (std::size_t s = 1; s < begin_.size(); ++s) begin_[s] += begin_[s - 1];
    Buffer<std::uint32_t> next(begin_.begin(), begin_.end());
    held_.resize(frames.size());
    for (std::uint32_t i = 0; i < frames.size(); ++i) held_[next[square(frames[i])]++] = i;
  }

  /// Calls see(index) of all frames that may lie within a bead's width of one.
  template <class See>
  void around(const PieceFrame& frame, const See& see) const {
    const std::size_t c = column(frame.x), r = row(frame.y);
    for (std::size_t y = r > 0 ? r - 1 : 0; y < std::min(r + 2, rows_); ++y) {
      for (std::size_t x = c > 0 ? c - 1 : 0; x < std::min(c + 2, columns_); ++x) {
        const std::size_t s = x + y * columns_;
        for (std::uint32_t k = begin_[s]; k < begin_[s + 1]; ++k) see(held_[k]);
      }
    }
  }

 private:
  std::size_t column(double x) const { return static_cast<std::size_t>((x - left_) / edge_); }
  std::size_t row(double y) const { return static_cast<std::size_t>((y - bottom_) / edge_); }
  std::size_t square(const PieceFrame& frame) const { return column(frame.x) + row(frame.y) * columns_; }

  double left_ = HUGE_VAL, bottom_ = HUGE_VAL, edge_ = 1;
  std::size_t columns_ = 0, rows_ = 0;
  Buffer<std::uint32_t> begin_, held_;
};

/// A neighbour that a piece touches, and the area of the cusps between them; below 0: both do not fit.
struct Contact {
  std::uint32_t piece = kNone;
  double distance_mm = 0, clearance_mm2 = 0;
};
using Contacts = std::array<Contact, 2>;  // at the left, at the right

class ContactFinder {
 public:
  ContactFinder(std::span<const DepositedPiece> pieces, double height_mm)
      : pieces_(pieces), frames_(pieces.size()), contacts_(pieces.size()), height_(height_mm) {
    for_all([&](std::size_t i) { frames_[i] = frame_of(pieces_[i]); });
  }

  double run(Buffer<PieceSides>& sides, Buffer<PieceClearance>& clearances) {
    double widest = 0;
    for (const DepositedPiece& piece : pieces_) widest = std::max(widest, piece.width_mm);
    const Squares squares(frames_, widest);
    for_all([&](std::size_t i) { contacts_[i] = touched(squares, static_cast<std::uint32_t>(i)); });
    for_all([&](std::size_t i) { clearances[i] = shape(i, sides[i]); });
    double sum = 0;
    for (const PieceClearance& clearance : clearances) sum += clearance.over;
    return sum;
  }

 private:
  template <class Do>
  void for_all(const Do& what) const {
    tbb::parallel_for(std::size_t{0}, pieces_.size(), what);
  }

  /// The nearest piece at each side that a bead reaches, of those that it passes.
  Contacts touched(const Squares& squares, std::uint32_t i) const {
    const PieceFrame& here = frames_[i];
    Contacts found;
    std::array<double, 2> offset{};
    squares.around(here, [&](std::uint32_t j) {
      const PieceFrame& other = frames_[j];
      if (std::abs(here.along_x * other.along_x + here.along_y * other.along_y) < kAlike) return;
      const double forward = std::abs(here.forward(other)), leftward = here.leftward(other), distance = std::abs(leftward);
      const double widths = (pieces_[i].width_mm + pieces_[j].width_mm) / 2;
      if (distance >= widths || distance <= kOwnLine * widths || forward > here.half_mm + other.half_mm) return;
      Contact& best = found[leftward > 0 ? 0 : 1];
      double& best_offset = offset[leftward > 0 ? 0 : 1];
      // Pieces of one line differ in rounding alone: the one straight across is the neighbour.
      const bool same_line = best.piece != kNone && std::abs(distance - best.distance_mm) < 0.1 * widths;
      const bool nearer = same_line ? forward < best_offset || (forward == best_offset && j < best.piece)
                                    : best.piece == kNone || distance < best.distance_mm;
      if (!nearer) return;
      best = {j, distance, height_ * distance - (pieces_[i].area_mm2 + pieces_[j].area_mm2) / 2};
      best_offset = forward;
    });
    return found;
  }

  /// Half of what has no room at one side of a piece, and goes to its other one.
  double pushed(std::size_t piece, std::size_t from_side) const {
    return std::max(-contacts_[piece][from_side].clearance_mm2, 0.0) / 2;
  }

  PieceClearance shape(std::size_t i, PieceSides& out) const {
    PieceClearance found;
    for (std::size_t s = 0; s < 2; ++s) {
      const Contact& contact = contacts_[i][s];
      PieceSide& side = s == 0 ? out.left : out.right;
      const double more = pushed(i, 1 - s);
      if (contact.piece == kNone) {
        side = {pieces_[i].width_mm / 2 + more / height_, -1};
        found.clearance += kLevels * pieces_[i].area_mm2 * 2 * frames_[i].half_mm;
        continue;
      }
      const DepositedPiece& neighbour = pieces_[contact.piece];
      const bool faces_left = frames_[contact.piece].leftward(frames_[i]) > 0;
      const double taken = more + pushed(contact.piece, faces_left ? 1 : 0), clearance = contact.clearance_mm2 - taken;
      const double share = pieces_[i].width_mm / (pieces_[i].width_mm + neighbour.width_mm);
      side = {contact.distance_mm * share, std::min(std::sqrt(std::max(clearance, 0.0) / kCorners), height_ / 2)};
      // What a contact has no room for goes to the other sides; half of what has none there is this piece's.
      found.over += (contact.clearance_mm2 >= 0 ? std::max(-clearance, 0.0) : taken) * frames_[i].half_mm;
      found.clearance += std::max(clearance, 0.0) * frames_[i].half_mm;
    }
    return found;
  }

  std::span<const DepositedPiece> pieces_;
  Buffer<PieceFrame> frames_;
  Buffer<Contacts> contacts_;
  double height_;
};

constexpr int kRounds = 8;           // each makes room for what the one before has moved
constexpr double kNothing = 1e-9;    // mm3
constexpr double kNoProgress = 0.9;  // of what was over before

/// One line: what is over flows to both sides.
class LineFlow {
 public:
  LineFlow(std::span<DepositedPiece> pieces, std::span<PieceClearance> clearances, double height_mm)
      : pieces_(pieces), clearances_(clearances), height_(height_mm), gained_(pieces.size(), 0.0) {}

  void run() {
    double over = 0;
    for (PieceClearance& clearance : clearances_) {
      over += clearance.over;
      if (clearance.over > 0) clearance.clearance = 0;
    }
    if (over <= kNothing) return;
    const double passed = pass(0, true, 0.5);
    const double back = pass(passed, false, 0.5);
    const double rest = pass(back, true, 0);
    const double moved = 1 - rest / over;
    for (std::size_t i = 0; i < pieces_.size(); ++i) change(pieces_[i], gained_[i] - moved * clearances_[i].over);
  }

 private:
  /// From one end to the other with `carried`, taking `share` of what is over. returns  what is left at the other end
  double pass(double carried, bool forwards, double share) {
    for (std::size_t n = 0; n < pieces_.size(); ++n) {
      const std::size_t i = forwards ? n : pieces_.size() - 1 - n;
      carried += share * clearances_[i].over;
      const double taken = std::min(carried, clearances_[i].clearance);
      gained_[i] += taken;
      clearances_[i].clearance -= taken;
      carried -= taken;
    }
    return carried;
  }

  void change(DepositedPiece& piece, double volume_mm3) const {
    const double length = length_of(piece);
    if (volume_mm3 == 0 || !(length > 0)) return;
    const double area = std::max(piece.area_mm2 + volume_mm3 / length, 0.0);
    piece.width_mm = std::max(piece.width_mm + width_of(area, false, height_) - width_of(piece.area_mm2, false, height_), 0.0);
    piece.area_mm2 = area;
  }

  std::span<DepositedPiece> pieces_;
  std::span<PieceClearance> clearances_;
  double height_;
  Buffer<double> gained_;
};

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

// Contacts of pieces.

double find_contacts(std::span<const DepositedPiece> pieces, double height_mm, Buffer<PieceSides>& sides,
                     Buffer<PieceClearance>& clearances) {
  sides.resize(pieces.size());
  clearances.resize(pieces.size());
  return pieces.empty() ? 0 : ContactFinder(pieces, height_mm).run(sides, clearances);
}

double reach_at(const DepositedPiece& piece, const PieceSide& side, double height_mm, double above_mm) {
  const double above = std::abs(above_mm);
  if (side.corner_mm >= 0) {
    const double into = above - (height_mm / 2 - side.corner_mm);
    if (into <= 0) return side.reach_mm;
    return into >= side.corner_mm ? -1
                                  : side.reach_mm - side.corner_mm + std::sqrt(side.corner_mm * side.corner_mm - into * into);
  }
  // A bead that does not fill its layer is a circle, or an ellipse as high as its area makes it.
  const bool thread = piece.width_mm < height_mm;
  const double height = thread ? std::min(height_mm, piece.area_mm2 / (std::numbers::pi / 4 * piece.width_mm)) : height_mm;
  if (above >= height / 2) return -1;
  if (thread) return side.reach_mm * std::sqrt(1 - 4 * above * above / (height * height));
  return side.reach_mm - height / 2 + std::sqrt(height * height / 4 - above * above);
}

double flow_along(std::span<DepositedPiece> pieces, double height_mm, Buffer<PieceSides>& sides) {
  Buffer<PieceClearance> clearances;
  double over = find_contacts(pieces, height_mm, sides, clearances);
  for (int round = 0; round < kRounds && over > kNothing; ++round) {
    for (std::size_t begin = 0; begin < pieces.size();) {
      std::size_t end = begin + 1;
      while (end < pieces.size() && pieces[end - 1].to == pieces[end].from) ++end;
      LineFlow(pieces.subspan(begin, end - begin), std::span(clearances).subspan(begin, end - begin), height_mm).run();
      begin = end;
    }
    const double before = over;
    over = find_contacts(pieces, height_mm, sides, clearances);
    if (over > kNoProgress * before) break;
  }
  return over;
}

}  // namespace lamina::bead
