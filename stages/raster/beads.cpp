#include "stages/raster/beads.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "stages/geometry/combine.h"

namespace lamina::raster {
namespace {

__extension__ using Wide = __int128;

/// A bead, for queries of points near it.
struct Bead {
  std::int64_t ax, ay, dx, dy;  // a, b - a
  Wide width2, length2;
  bool square;

  /// |p - a| and |p - b| below 2^32, and p no farther than 2^28 from the line: nothing overflows 127 bits.
  bool holds(std::int64_t px, std::int64_t py) const {
    const std::int64_t x = px - ax, y = py - ay;
    const Wide along = static_cast<Wide>(x) * dx + static_cast<Wide>(y) * dy;
    if (along < 0) return !square && 4 * (static_cast<Wide>(x) * x + static_cast<Wide>(y) * y) <= width2;
    if (along > length2) {
      const std::int64_t ex = x - dx, ey = y - dy;
      return !square && 4 * (static_cast<Wide>(ex) * ex + static_cast<Wide>(ey) * ey) <= width2;
    }
    if (length2 == 0) return !square && 4 * (static_cast<Wide>(x) * x + static_cast<Wide>(y) * y) <= width2;
    const Wide across = static_cast<Wide>(x) * dy - static_cast<Wide>(y) * dx;
    return 4 * across * across <= width2 * length2;
  }
};

/// About where the bead meets a row: its convex shape is the hull of two discs, or a rectangle.
struct Interval {
  double low = INFINITY, high = -INFINITY;
  void add(double a, double b) {
    low = std::min(low, a);
    high = std::max(high, b);
  }
};

Interval estimate(const Bead& bead, double radius, double y) {
  Interval x;
  const double dx = static_cast<double>(bead.dx), dy = static_cast<double>(bead.dy), length = std::hypot(dx, dy);
  if (!bead.square) {
    for (const double end : {0.0, 1.0}) {
      const double rise = y - end * dy, square = radius * radius - rise * rise;
      if (square >= 0) x.add(end * dx - std::sqrt(square), end * dx + std::sqrt(square));
    }
  }
  if (length > 0) {
    // The four corners of the rectangle; its edges cut the row.
    const double nx = -dy / length * radius, ny = dx / length * radius;
    const double cx[] = {nx, dx + nx, dx - nx, -nx}, cy[] = {ny, dy + ny, dy - ny, -ny};
    for (int i = 0; i < 4; ++i) {
      const int j = (i + 1) % 4;
      if ((cy[i] <= y) == (cy[j] <= y)) {
        if (cy[i] == y && cy[j] == y) x.add(std::min(cx[i], cx[j]), std::max(cx[i], cx[j]));
        continue;
      }
      const double at = cx[i] + (y - cy[i]) / (cy[j] - cy[i]) * (cx[j] - cx[i]);
      x.add(at, at);
    }
  }
  return x;
}

}  // namespace

void BeadRaster::add(Point2 a, Point2 b, Nm width, BeadEnds ends) {
  const std::int64_t half = (std::int64_t{width} + 1) / 2;
  const auto rows = static_cast<std::int64_t>(grid_.rows());
  const std::int64_t first = std::max<std::int64_t>(0, grid_.y.first_at_or_beyond(std::min(a.y, b.y) - half));
  const std::int64_t last = std::min(rows, grid_.y.first_at_or_beyond(std::max(a.y, b.y) + half + 1));
  if (first >= last) return;
  beads_.push_back({a, b, static_cast<std::uint32_t>(rows - last), static_cast<std::uint32_t>(rows - first), width, ends});
}

/// The spans of a bead in the image rows [first_row, last_row), which it may reach.
void BeadRaster::cover(const DepositedParts& deposited, std::uint32_t first_row, std::uint32_t last_row) {
  const Point2 a = deposited.a, b = deposited.b;
  Bead bead{a.x,
            a.y,
            std::int64_t{b.x} - a.x,
            std::int64_t{b.y} - a.y,
            static_cast<Wide>(deposited.width) * deposited.width,
            0,
            deposited.ends == BeadEnds::kSquare};
  bead.length2 = static_cast<Wide>(bead.dx) * bead.dx + static_cast<Wide>(bead.dy) * bead.dy;
  const auto rows = static_cast<std::int64_t>(grid_.rows()), columns = static_cast<std::int64_t>(grid_.columns());
  // A guess is wrong by the rounding of doubles, and by the nanometre that a centre is rounded down: one pixel is ample.
  const double radius = static_cast<double>(deposited.width) / 2;
  for (std::uint32_t row = first_row; row < last_row; ++row) {
    const std::int64_t y = grid_.y.centre(rows - 1 - row);
    Interval x = estimate(bead, radius, static_cast<double>(y - bead.ay));
    if (!(x.low <= x.high)) {
      // A row that only touches the bead's edge, as far as doubles can decide: test where it is widest.
      const double share =
          bead.dy == 0 ? 0.5 : std::clamp(static_cast<double>(y - bead.ay) / static_cast<double>(bead.dy), 0.0, 1.0);
      x.add(share * static_cast<double>(bead.dx), share * static_cast<double>(bead.dx));
    }
    const std::int64_t low = bead.ax + static_cast<std::int64_t>(std::floor(x.low)),
                       high = bead.ax + static_cast<std::int64_t>(std::ceil(x.high));
    std::int64_t begin = grid_.x.first_at_or_beyond(low) - 1, end = grid_.x.first_at_or_beyond(high + 1) + 1;
    while (begin < end && !bead.holds(grid_.x.centre(begin), y)) ++begin;
    while (end > begin && !bead.holds(grid_.x.centre(end - 1), y)) --end;
    begin = std::max<std::int64_t>(begin, 0);
    end = std::min(end, columns);
    if (begin < end) spans_.push_back({row, static_cast<std::uint32_t>(begin), static_cast<std::uint32_t>(end)});
  }
}

/// Merges the spans of the image rows [first_row, last_row) in band_.
void BeadRaster::merge(std::uint32_t first_row, std::uint32_t last_row) {
  const std::uint32_t rows = last_row - first_row;
  start_.assign(std::size_t{rows} + 1, 0);
  for (const Span& span : spans_) ++start_[span.row - first_row + 1];
  for (std::uint32_t r = 0; r < rows; ++r) start_[r + 1] += start_[r];
  ordered_.resize(spans_.size());
  for (const Span& span : spans_) ordered_[start_[span.row - first_row]++] = span;  // start_[r] becomes the end of row r
  band_.row_offset.assign(1, 0);
  band_.change.clear();
  std::uint32_t begin = 0;
  for (std::uint32_t r = 0; r < rows; ++r) {
    const std::uint32_t end = start_[r];
    std::sort(ordered_.begin() + begin, ordered_.begin() + end,
              [](const Span& s, const Span& t) { return s.begin != t.begin ? s.begin < t.begin : s.end < t.end; });
    for (std::uint32_t i = begin; i < end;) {
      std::uint32_t reach = ordered_[i].end;
      band_.change.push_back(ordered_[i].begin);
      for (++i; i < end && ordered_[i].begin <= reach; ++i) reach = std::max(reach, ordered_[i].end);
      band_.change.push_back(reach);
    }
    band_.row_offset.push_back(static_cast<std::uint32_t>(band_.change.size()));
    begin = end;
  }
}

void BeadRaster::for_each_band(const std::function<void(std::uint32_t, const RunsView&)>& take) {
  const std::uint32_t rows = grid_.rows(), bands = (rows + kBandRows - 1) / kBandRows;
  // Beads by the band of their first row.
  band_begin_.assign(std::size_t{bands} + 1, 0);
  for (const DepositedParts& bead : beads_) ++band_begin_[bead.first_row / kBandRows + 1];
  for (std::uint32_t b = 0; b < bands; ++b) band_begin_[b + 1] += band_begin_[b];
  by_band_.resize(beads_.size());
  for (std::uint32_t i = 0; i < beads_.size(); ++i) by_band_[band_begin_[beads_[i].first_row / kBandRows]++] = i;
  band_.columns = grid_.columns();
  reaching_.clear();
  for (std::uint32_t b = 0, next = 0; b < bands; ++b) {
    const std::uint32_t first = b * kBandRows, last = std::min(rows, first + kBandRows);
    for (; next < band_begin_[b]; ++next) reaching_.push_back(by_band_[next]);
    spans_.clear();
    std::size_t stay = 0;
    for (const std::uint32_t i : reaching_) {
      const DepositedParts& bead = beads_[i];
      cover(bead, std::max(first, bead.first_row), std::min(last, bead.last_row));
      if (bead.last_row > last) reaching_[stay++] = i;
    }
    reaching_.resize(stay);
    merge(first, last);
    take(first, band_);
  }
}

void BeadRaster::runs(Runs& out) {
  out.columns = grid_.columns();
  out.row_offset.assign(1, 0);
  out.row_offset.reserve(std::size_t{grid_.rows()} + 1);
  out.change.clear();
  for_each_band([&](std::uint32_t, const RunsView& band) {
    const auto before = static_cast<std::uint32_t>(out.change.size());
    out.change.insert(out.change.end(), band.change.begin(), band.change.end());
    for (const std::uint32_t offset : band.row_offset.subspan(1)) out.row_offset.push_back(before + offset);
  });
}

// Beads of a toolpath file, and the grid to inspect them.

void BeadRaster::add(std::span<const DepositedBead> beads, Point2 origin) {
  const auto at = [&](Point2 p) { return Point2{p.x - origin.x, p.y - origin.y}; };
  for (const DepositedBead& bead : beads) add(at(bead.from), at(bead.to), bead.width, BeadEnds::kRound);
}

PixelGrid bead_grid(const Box& box) {
  constexpr std::int64_t kMaxDots = 508, kMaxPixels = 20'000;  // an inch; along a side
  const std::int64_t longest = std::max<std::int64_t>({box.width(), box.depth(), 1});
  const std::int64_t dots = std::clamp<std::int64_t>(kMaxPixels * kNmPerInch / longest, 1, kMaxDots);
  return {PixelAxis(dots, std::max<std::int64_t>(box.width(), 1)), PixelAxis(dots, std::max<std::int64_t>(box.depth(), 1))};
}

Nm BeadWidths::of(const PathInterval& s) const {
  if (s.thickness == Thickness::kThick) return thick;
  if (s.thickness == Thickness::kThin) return thin;
  const bool wall = s.kind == PathKind::kOuter || s.kind == PathKind::kInner;
  return segmented && !wall ? continuous : s.width;
}

void BeadPen::deposit(const PathInterval& s) {
  const Nm width = widths_.of(s);
  beads_.add(s.from, s.to, width, ends_);
  // Square ends leave a wedge where a bead turns; they belong only where its width changes along a line.
  const bool turns = !s.jump && (s.thickness == last_ || s.kind != last_kind_);
  if (ends_ == BeadEnds::kSquare && turns) beads_.add(s.from, s.from, std::min(width, last_width_), BeadEnds::kRound);
  last_width_ = width;
  last_ = s.thickness;
  last_kind_ = s.kind;
}

void keep_beads(Runs& image, BeadRaster& beads, const Runs* inner, Runs& scratch) {
  scratch.columns = image.columns;
  scratch.row_offset.assign(1, 0);
  scratch.change.clear();
  Runs kept, shell;  // of a band
  beads.for_each_band([&](std::uint32_t first, const RunsView& deposited) {
    const auto band_of = [&](const Runs& whole) {
      return RunsView{whole.columns, std::span(whole.row_offset).subspan(first, std::size_t{deposited.rows()} + 1),
                      whole.change};
    };
    const RunsView part = band_of(image);
    if (inner == nullptr) return append_combined(part, deposited, SetOperation::kIntersection, scratch);
    combine(part, deposited, SetOperation::kIntersection, kept);
    combine(part, band_of(*inner), SetOperation::kDifference, shell);
    append_combined(kept, shell, SetOperation::kUnion, scratch);
  });
  std::swap(image, scratch);
}

}  // namespace lamina::raster
