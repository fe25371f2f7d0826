#include "stages/bead/along.h"

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "stages/bead/section.h"

namespace lamina::bead {
namespace {

constexpr int kRounds = 8;           // each makes room for what the one before has moved
constexpr double kNothing = 1e-9;    // mm3
constexpr double kNoProgress = 0.9;  // of what was over before

double length_of(const LaidPiece& piece) {
  return std::hypot(mm(piece.to.x) - mm(piece.from.x), mm(piece.to.y) - mm(piece.from.y));
}

/// One line: what is over flows to both sides.
class LineFlow {
 public:
  LineFlow(std::span<LaidPiece> pieces, std::span<PieceRoom> rooms, double height_mm)
      : pieces_(pieces), rooms_(rooms), height_(height_mm), gained_(pieces.size(), 0.0) {}

  void run() {
    double over = 0;
    for (PieceRoom& room : rooms_) {
      over += room.over;
      if (room.over > 0) room.room = 0;
    }
    if (over <= kNothing) return;
    const double passed = pass(0, true, 0.5);
    const double back = pass(passed, false, 0.5);
    const double rest = pass(back, true, 0);
    const double moved = 1 - rest / over;
    for (std::size_t i = 0; i < pieces_.size(); ++i) change(pieces_[i], gained_[i] - moved * rooms_[i].over);
  }

 private:
  /// From one end to the other with `carried`, taking `share` of what is over. returns  what is left at the other end
  double pass(double carried, bool forwards, double share) {
    for (std::size_t n = 0; n < pieces_.size(); ++n) {
      const std::size_t i = forwards ? n : pieces_.size() - 1 - n;
      carried += share * rooms_[i].over;
      const double taken = std::min(carried, rooms_[i].room);
      gained_[i] += taken;
      rooms_[i].room -= taken;
      carried -= taken;
    }
    return carried;
  }

  void change(LaidPiece& piece, double volume_mm3) const {
    const double length = length_of(piece);
    if (volume_mm3 == 0 || !(length > 0)) return;
    const double area = std::max(piece.area_mm2 + volume_mm3 / length, 0.0);
    piece.width_mm = std::max(piece.width_mm + width_of(area, false, height_) - width_of(piece.area_mm2, false, height_), 0.0);
    piece.area_mm2 = area;
  }

  std::span<LaidPiece> pieces_;
  std::span<PieceRoom> rooms_;
  double height_;
  Buffer<double> gained_;
};

}  // namespace

double flow_along(std::span<LaidPiece> pieces, double height_mm, Buffer<PieceSides>& sides) {
  Buffer<PieceRoom> rooms;
  double over = find_contacts(pieces, height_mm, sides, &rooms);
  for (int round = 0; round < kRounds && over > kNothing; ++round) {
    for (std::size_t begin = 0; begin < pieces.size();) {
      std::size_t end = begin + 1;
      while (end < pieces.size() && pieces[end - 1].to == pieces[end].from) ++end;
      LineFlow(pieces.subspan(begin, end - begin), std::span(rooms).subspan(begin, end - begin), height_mm).run();
      begin = end;
    }
    const double before = over;
    over = find_contacts(pieces, height_mm, sides, &rooms);
    if (over > kNoProgress * before) break;
  }
  return over;
}

}  // namespace lamina::bead
