#include "stages/raster/beads.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <utility>

#include "stages/geometry/combine.h"
#include "stages/geometry/isa.h"

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

Bead bead_of(Point2 a, Point2 b, Nm width, BeadEnds ends) {
  Bead bead{a.x,
            a.y,
            std::int64_t{b.x} - a.x,
            std::int64_t{b.y} - a.y,
            static_cast<Wide>(width) * width,
            0,
            ends == BeadEnds::kSquare};
  bead.length2 = static_cast<Wide>(bead.dx) * bead.dx + static_cast<Wide>(bead.dy) * bead.dy;
  return bead;
}

/// Of doubles: a root is off by less than 2 nm, as its argument is by less than 4 nm2, and centres of pixels are rounded down
/// by less than 1; what slopes multiply is off by its last bits.
void set_shape(Point2 a, Point2 b, Nm width, BeadEnds ends, const PixelAxis& axis, BeadShape& shape) {
  if (b.y < a.y || (b.y == a.y && b.x < a.x)) std::swap(a, b);
  constexpr double kOfRoot = 3, kOfSlope = 1.0 / (1ull << 49);
  shape = {};
  const double radius = static_cast<double>(width) / 2;
  shape.y0 = a.y;
  shape.dx = static_cast<double>(std::int64_t{b.x} - a.x);
  shape.dy = static_cast<double>(std::int64_t{b.y} - a.y);
  shape.radius = radius;
  shape.radius2 = radius * radius;
  shape.square = ends == BeadEnds::kSquare;
  double tolerance = kOfRoot + std::abs(shape.dx) * kOfSlope;
  if (shape.dy > 0) {
    const double length = std::sqrt(shape.dx * shape.dx + shape.dy * shape.dy), tangent = radius * shape.dx / length;
    shape.slope = shape.dx / shape.dy;
    shape.aside = radius * length / shape.dy;
    shape.left[0] = tangent, shape.left[1] = tangent + shape.dy;
    shape.right[0] = -tangent, shape.right[1] = shape.dy - tangent;
    tolerance += (shape.aside + std::abs(shape.slope) * (radius + shape.dy)) * kOfSlope;
  } else {
    // The lower end is the left one: its disc is all of the left boundary, the other one of the right.
    shape.aside = INFINITY;
    shape.left[0] = shape.left[1] = INFINITY;
    shape.right[0] = shape.right[1] = -INFINITY;
  }
  if (shape.square) {
    shape.end[0] = -INFINITY, shape.end[1] = INFINITY;
    if (shape.dx != 0) {
      shape.turned = -shape.dy / shape.dx;
      const double other = shape.dx + shape.dy * shape.dy / shape.dx;
      shape.end[0] = std::min(other, 0.0), shape.end[1] = std::max(other, 0.0);
      tolerance += (std::abs(other) + std::abs(shape.turned) * radius) * kOfSlope;
    }
  }
  shape.columns_per_nm = axis.pixels_per_nm();
  shape.tolerance = 2 * (tolerance * shape.columns_per_nm + 1e-7);
  shape.first_column = a.x * shape.columns_per_nm + 0.5 + shape.tolerance / 2;
  shape.columns = static_cast<std::int32_t>(axis.count);
}

}  // namespace

BeadRaster::BeadRaster(const PixelGrid& grid, Isa isa)
    : grid_(grid), rows_per_nm_(grid.y.pixels_per_nm()), kernels_(&bead_kernels_for(limited_isa(isa))) {}

void BeadRaster::add(Point2 a, Point2 b, Nm width, BeadEnds ends) {
  const bool upright = ends == BeadEnds::kSquare && a.x == b.x;
  const std::int64_t half = upright ? 0 : width / 2;  // what is within reach, in whole nm
  const auto rows = static_cast<std::int64_t>(grid_.rows());
  const std::int64_t first = std::max<std::int64_t>(0, grid_.y.first_at_or_beyond(std::min(a.y, b.y) - half));
  const std::int64_t last = std::min(rows, grid_.y.first_at_or_beyond(std::max(a.y, b.y) + half + 1));
  if (first >= last || (ends == BeadEnds::kSquare && a == b)) return;
  beads_.push_back({a, b, static_cast<std::uint32_t>(rows - last), static_cast<std::uint32_t>(rows - first), width, ends});
}

/// Rows that are between the discs, if they are many and no flat line.
void BeadRaster::set_straight(Reaching& bead) const {
  const DepositedParts& deposited = bead.deposited;
  const BeadShape& shape = bead.shape;
  bead.straight.first = bead.straight.last = 0;
  constexpr double kOne = 1 << kBeadLineBits, kFar = 1 << 30;
  if (kernels_->line == nullptr || shape.square || !(shape.dy * rows_per_nm_ > kMinLineRows)) return;
  const auto centre = [&](std::uint32_t row) {
    return static_cast<double>(grid_.y.centre(std::int64_t{grid_.rows()} - 1 - deposited.first_row - row)) - shape.y0;
  };
  const double top = centre(0), high = std::min(shape.left[1], shape.right[1]), low = std::max(shape.left[0], shape.right[0]);
  const double rows = deposited.last_row - deposited.first_row;
  // Rows are cut off from doubles: std::ceil and std::floor are calls, and a row more or less is the other loop's.
  const auto first = static_cast<std::uint32_t>(std::clamp<double>((top - high) * rows_per_nm_ + 1, 0, rows));
  const auto last = static_cast<std::uint32_t>(std::clamp<double>((top - low) * rows_per_nm_ + 1, 0, rows));
  if (last < first + kMinLineRows) return;
  // Centres of rows are rounded down by less than 1 nm, and steps by their last bits: of a band's rows, and of all.
  const double step = -shape.slope / rows_per_nm_ * shape.columns_per_nm, way = step * rows;
  const double off = (1 + std::abs(shape.slope)) * shape.columns_per_nm + (kBeadBandRows / 2 + 1 + rows * 0x1p-11) / kOne;
  const double at = shape.first_column - shape.tolerance / 2 + off, line = centre(first) * shape.slope;
  const double from = (line - shape.aside) * shape.columns_per_nm + at, to = (line + shape.aside) * shape.columns_per_nm + at;
  if (!(off < 0.25 && std::abs(from) < kFar && std::abs(to) < kFar && std::abs(way) < kFar)) return;
  const auto fixed = [](double columns) { return static_cast<std::int64_t>(columns * 0x1p32); };
  bead.straight.first = deposited.first_row + first;
  bead.straight.last = deposited.first_row + last;
  bead.straight.from = fixed(from);
  bead.straight.to = fixed(to);
  bead.straight.step = fixed(step);
  bead.straight.tolerance = (static_cast<std::uint32_t>(2 * off * kOne) + 1) << (32 - kBeadLineBits);
}

/// Sets the bits of a bead in the band that begins with first_row, into which it reaches.
void BeadRaster::cover(const Reaching& bead, std::uint32_t first_row, std::uint32_t band_rows) {
  const std::uint32_t first = std::max(first_row, bead.deposited.first_row) - first_row;
  const std::uint32_t last = std::min(first_row + band_rows, bead.deposited.last_row) - first_row;
  const std::uint32_t from = std::max(first_row, bead.straight.first), to = std::min(first_row + band_rows, bead.straight.last);
  std::uint64_t undecided = 0;
  if (to < from + kMinLineRows || !cover_line(bead.straight, first_row, from - first_row, to - first_row, undecided))
    return cover_rows(bead, first_row, first, last);
  if (first < from - first_row) cover_rows(bead, first_row, first, from - first_row);
  if (to - first_row < last) cover_rows(bead, first_row, to - first_row, last);
  for (; undecided != 0; undecided &= undecided - 1) {
    const auto r = static_cast<std::uint32_t>(std::countr_zero(undecided));
    cover_rows(bead, first_row, r, r + 1);
  }
}

/// Sets the bits of rows [first, last) of the band, which are between the discs.
/// undecided  becomes a bit for each of these whose bits are not set
/// returns    false: they are too wide, or beyond the image
bool BeadRaster::cover_line(const Straight& line, std::uint32_t first_row, std::uint32_t first, std::uint32_t last,
                            std::uint64_t& undecided) {
  constexpr std::int64_t kOne = std::int64_t{1} << 32, kMaxColumns = (1 << (32 - kBeadLineBits)) - 2 * kBeadWordBits;
  const std::int64_t down = line.step * (first_row + first - line.first), way = line.step * (last - 1 - first);
  const std::int64_t from = line.from + down, to = line.to + down;
  const std::int64_t left = from + std::min<std::int64_t>(way, 0), right = to + std::max<std::int64_t>(way, 0);
  if (left < kOne || right >= grid_.columns() * kOne || right - left >= kMaxColumns * kOne) return false;
  const std::int64_t word = left / (kBeadWordBits * kOne);
  const auto rounded = [](std::int64_t columns) {
    return static_cast<std::uint32_t>((columns + (1 << (31 - kBeadLineBits))) >> (32 - kBeadLineBits));
  };
  const std::int64_t before = word * kBeadWordBits * kOne;
  const BeadLine bits{static_cast<std::uint32_t>(word), rounded(from - before), rounded(to - before), rounded(line.step),
                      line.tolerance};
  undecided = kernels_->line(bits, first, last, words_.data(), touched_.data());
  return true;
}

/// Sets the bits of rows [first, last) of the band. They are no further than the radius from the middle line as far as that is
/// no further above or below.
void BeadRaster::cover_rows(const Reaching& bead, std::uint32_t first_row, std::uint32_t first, std::uint32_t last) {
  const BeadShape& shape = bead.shape;
  const double below = std::clamp(rows_.y[last - 1] - shape.y0 - shape.radius, 0.0, shape.dy) * shape.slope;
  const double above =
      shape.dy > 0 ? std::clamp(rows_.y[first] - shape.y0 + shape.radius, 0.0, shape.dy) * shape.slope : shape.dx;
  const double from = (std::min(below, above) - shape.radius) * shape.columns_per_nm + shape.first_column - 1;
  const double to = (std::max(below, above) + shape.radius) * shape.columns_per_nm + shape.first_column + 1;
  if (!(to >= 0 && from < shape.columns)) return;
  const auto word = [&](double column) {
    return static_cast<std::uint32_t>(std::clamp<double>(column, 0, shape.columns)) / kBeadWordBits;
  };
  if (kernels_->columns(shape, first, last, rows_)) {
    for (std::uint32_t r = first; r < last; ++r)
      if (rows_.near[r] < shape.tolerance) decide(bead, first_row + r, r);
  }
  kernels_->set(rows_, first, last, {word(from), word(to)}, words_.data(), touched_.data());
}

/// The columns of an undecided row, exactly.
void BeadRaster::decide(const Reaching& reaching, std::uint32_t row, std::uint32_t in_band) {
  const auto& [deposited, shape, straight] = reaching;
  const Bead bead = bead_of(deposited.a, deposited.b, deposited.width, deposited.ends);
  const std::int64_t y = grid_.y.centre(std::int64_t{grid_.rows()} - 1 - row);
  const auto margin = static_cast<std::int32_t>(std::min(shape.tolerance, 1e9)) + 1;
  std::int32_t& begin = rows_.begin[in_band];
  std::int32_t& end = rows_.end[in_band];
  begin = std::max(0, begin - margin);
  end = std::min(end, shape.columns - margin) + margin;
  while (begin < end && !bead.holds(grid_.x.centre(begin), y)) ++begin;
  while (end > begin && !bead.holds(grid_.x.centre(end - 1), y)) --end;
}

/// Room for any changes of one more column of words in each row.
void BeadRaster::widen_rows() {
  const std::size_t before = row_capacity_;
  row_capacity_ = std::min<std::size_t>(2 * before + 256, std::size_t{grid_.columns()} + 2 * kBeadWordBits);
  row_change_.resize(kBeadBandRows * row_capacity_);
  for (std::size_t r = kBeadBandRows; r-- > 1 && before > 0;)
    std::copy_backward(row_change_.begin() + r * before, row_change_.begin() + (r + 1) * before,
                       row_change_.begin() + r * row_capacity_ + before);
}

/// The changes of the band's bits, in band_; clears the bits.
void BeadRaster::collect(std::uint32_t band_rows) {
  alignas(64) std::uint32_t carry[kBeadBandRows] = {}, changed[kBeadBandRows];
  std::uint32_t count[kBeadBandRows] = {};
  std::size_t longest = 0;
  for (std::uint32_t w = 0, ends = 0; w < touched_.size(); ++w) {
    if (touched_[w] == 0 && ends == 0) continue;
    ends = std::exchange(touched_[w], std::uint8_t{0});
    if (longest + kBeadWordBits > row_capacity_) widen_rows();
    std::uint64_t rows = kernels_->changes(words_.data() + std::size_t{w} * kBeadBandRows, carry, changed);
    for (; rows != 0; rows &= rows - 1) {
      const auto r = static_cast<std::uint32_t>(std::countr_zero(rows));
      std::uint32_t* next = row_change_.data() + r * row_capacity_ + count[r];
      for (std::uint32_t bits = changed[r]; bits != 0; bits &= bits - 1)
        *next++ = w * kBeadWordBits + static_cast<std::uint32_t>(std::countr_zero(bits));
      count[r] = static_cast<std::uint32_t>(next - (row_change_.data() + r * row_capacity_));
      longest = std::max<std::size_t>(longest, count[r]);
    }
  }
  band_.row_offset.assign(1, 0);
  band_.change.clear();
  for (std::uint32_t r = 0; r < band_rows; ++r) {
    const std::uint32_t* const first = row_change_.data() + r * row_capacity_;
    band_.change.insert(band_.change.end(), first, first + count[r]);
    band_.row_offset.push_back(static_cast<std::uint32_t>(band_.change.size()));
  }
}

/// A bead reaches into the band at work.
void BeadRaster::begin(const DepositedParts& bead) {
  if (free_.empty()) {
    free_.push_back(static_cast<std::uint32_t>(slots_.size()));
    slots_.emplace_back();
  }
  reaching_.push_back(free_.back());
  Reaching& slot = slots_[free_.back()];
  free_.pop_back();
  slot.deposited = bead;
  set_shape(bead.a, bead.b, bead.width, bead.ends, grid_.x, slot.shape);
  set_straight(slot);
}

void BeadRaster::for_each_band(const std::function<void(std::uint32_t, const RunsView&)>& take) {
  const std::uint32_t rows = grid_.rows(), bands = (rows + kBeadBandRows - 1) / kBeadBandRows;
  // Beads by the band of their first row.
  band_begin_.assign(std::size_t{bands} + 1, 0);
  for (const DepositedParts& bead : beads_) ++band_begin_[bead.first_row / kBeadBandRows + 1];
  for (std::uint32_t b = 0; b < bands; ++b) band_begin_[b + 1] += band_begin_[b];
  by_band_.resize(beads_.size());
  for (std::uint32_t i = 0; i < beads_.size(); ++i) by_band_[band_begin_[beads_[i].first_row / kBeadBandRows]++] = i;
  band_.columns = grid_.columns();
  reaching_.clear();
  slots_.clear();
  free_.clear();
  // A column of words more, in which runs that end with the image do.
  touched_.assign(grid_.columns() / kBeadWordBits + 2, 0);
  words_.assign(touched_.size() * kBeadBandRows, 0);
  for (std::uint32_t b = 0, next = 0; b < bands; ++b) {
    const std::uint32_t first = b * kBeadBandRows, last = std::min(rows, first + kBeadBandRows);
    for (; next < band_begin_[b]; ++next) {
      constexpr std::uint32_t kAhead = 8;  // beads of a band are anywhere in memory
      if (next + kAhead < by_band_.size()) __builtin_prefetch(&beads_[by_band_[next + kAhead]]);
      begin(beads_[by_band_[next]]);
    }
    for (std::uint32_t r = 0; r < kBeadBandRows; ++r)
      rows_.y[r] = static_cast<double>(grid_.y.centre(std::int64_t{rows} - 1 - first - r));
    std::size_t stay = 0;
    for (const std::uint32_t slot : reaching_) {
      cover(slots_[slot], first, last - first);
      (slots_[slot].deposited.last_row > last ? reaching_[stay++] : free_.emplace_back()) = slot;
    }
    reaching_.resize(stay);
    collect(last - first);
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
    // As many changes for each of the image's as in the bands before: reserved once, as a rule.
    const std::size_t before = part.row_offset.front(), kept_changes = scratch.change.size();
    const std::size_t more = part.row_offset.back() - before + deposited.change.size();
    if (kept_changes + more > scratch.change.capacity())
      scratch.change.reserve(kept_changes + more + (image.change.size() - before) * (1 + kept_changes / (before + 1)));
    if (inner == nullptr) return append_combined(part, deposited, SetOperation::kIntersection, scratch);
    combine(part, deposited, SetOperation::kIntersection, kept);
    combine(part, band_of(*inner), SetOperation::kDifference, shell);
    append_combined(kept, shell, SetOperation::kUnion, scratch);
  });
  std::swap(image, scratch);
}

}  // namespace lamina::raster
