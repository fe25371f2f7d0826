// stages/coverage/slab_facet.h: where voxels end along a side of the bed, what of a facet lies in a layer, and the trapezoids
// that make it up.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>

#include "stages/data/buffer.h"
#include "stages/data/grid.h"
#include "stages/data/mesh.h"

namespace lamina::coverage {

/// nm of the edge before pixel i; that of pixel `count` ends the last one.
constexpr std::int64_t edge(const PixelAxis& axis, std::int64_t i) { return i * axis.span / axis.dots; }

/// All edges of an axis; doubles hold them exactly. 16 bytes a pixel.
class Edges {
 public:
  explicit Edges(const PixelAxis& axis) : per_nm_(axis.pixels_per_nm()), count_(axis.count) {
    edge_.resize(std::size_t{axis.count} + 1 + kMore);
    for (std::uint32_t i = 0; i < edge_.size(); ++i) edge_[i] = static_cast<double>(edge(axis, i));
    narrowest_ = static_cast<double>(axis.span);
    for (std::uint32_t i = 0; i < axis.count; ++i) {
      widest_ = std::max(widest_, width(i));
      narrowest_ = std::min(narrowest_, width(i));
    }
    per_width_.resize(edge_.size());
    for (std::uint32_t i = 0; i + 1 < edge_.size(); ++i) per_width_[i] = 1 / width(i);
    per_width_.back() = 1;
  }

  /// A pixel at or before that of `nm` is at nm x per_nm(), one at or behind it at (nm + kBehind) x per_nm(): edges are up to
  /// 1 nm below i pixels.
  double per_nm() const { return per_nm_; }
  static constexpr double kBehind = 1.0625;

  /// kMore edges follow those of the axis, for who reads several at once.
  const double* data() const { return edge_.data(); }
  /// 1 / width(i), and kMore more.
  const double* per_width() const { return per_width_.data(); }
  static constexpr std::uint32_t kMore = 16;

  double operator[](std::uint32_t i) const { return edge_[i]; }
  double width(std::uint32_t i) const { return edge_[i + 1] - edge_[i]; }
  double widest() const { return widest_; }
  double narrowest() const { return narrowest_; }
  std::uint32_t count() const { return count_; }
  std::uint64_t bytes() const { return bytes_held(edge_) + bytes_held(per_width_); }

  /// The pixel in which `nm` lies, or the one before it; the one behind: both without a read, and the nearest ones of the bed.
  std::uint32_t before(double nm) const { return bounded(nm * per_nm_); }
  std::uint32_t behind(double nm) const { return bounded((nm + kBehind) * per_nm_); }

  /// The pixel in which `nm` lies, the one behind if it lies on an edge; the nearest one of the bed.
  std::uint32_t at(double nm) const {
    const double guess = nm * per_nm_;
    auto i = guess <= 0 ? 0 : std::min(static_cast<std::uint32_t>(guess), count() - 1);
    while (i > 0 && edge_[i] > nm) --i;
    while (i + 1 < count() && edge_[i + 1] <= nm) ++i;
    return i;
  }

 private:
  std::uint32_t bounded(double pixel) const {
    return static_cast<std::uint32_t>(std::min(std::max(pixel, 0.0), static_cast<double>(count_ - 1)));
  }

  double per_nm_;
  std::uint32_t count_;
  double widest_ = 0, narrowest_ = 0;
  Buffer<double> edge_, per_width_;
};

// --- what lies behind a piece of a facet, in doubles for all voxels and in rationals for the few that
// doubles do not decide.

template <class Number>
struct Corner {
  Number x, y, z;
};

/// A convex piece of a facet. A triangle that six planes have cut has up to nine corners.
template <class Number>
struct Piece {
  std::array<Corner<Number>, 9> corner;
  std::uint32_t size = 0;
};

/// What of `from` lies on one side of the plane where a coordinate is `limit`: above it, or below.
/// Source: I. Sutherland, G. Hodgman, Reentrant polygon clipping, 1974
template <auto kAxis, bool kAbove, class Number>
void cut(const Piece<Number>& from, const Number& limit, Piece<Number>& to) {
  to.size = 0;
  const auto keeps = [&](const Corner<Number>& c) { return kAbove ? c.*kAxis >= limit : c.*kAxis <= limit; };
  for (std::uint32_t i = 0; i < from.size; ++i) {
    const Corner<Number>& a = from.corner[i];
    const Corner<Number>& b = from.corner[i + 1 == from.size ? 0 : i + 1];
    const bool keeps_a = keeps(a), keeps_b = keeps(b);
    if (keeps_a && to.size < to.corner.size()) to.corner[to.size++] = a;
    if (keeps_a == keeps_b || a.*kAxis == limit || b.*kAxis == limit || to.size >= to.corner.size()) continue;
    const Number share = (limit - a.*kAxis) / (b.*kAxis - a.*kAxis);
    Corner<Number>& c = to.corner[to.size++];
    c.x = a.x + share * (b.x - a.x);
    c.y = a.y + share * (b.y - a.y);
    c.z = a.z + share * (b.z - a.z);
    c.*kAxis = limit;
  }
}

/// Projected along x; positive where +x goes into the solid.
template <class Number>
Number area_along_x(const Corner<Number>& a, const Corner<Number>& b, const Corner<Number>& c) {
  return ((b.z - a.z) * (c.y - a.y) - (b.y - a.y) * (c.z - a.z)) / 2;
}

// ---

/// How far computed corners may lie from where they are, nm, and more: those of facets of 4 m by 4 million roundings.
inline constexpr double kSlack = 1.0 / 1024;

struct SlabFacet {
  Triangle facet;                     // nm, on the bed
  Point3 low;                         // lowest corner of its box
  Nm size;                            // longest side of its box
  bool edgewise;                      // projected along x it has no area
  bool enters;                        // +x goes into the solid
  bool suspect;                       // it meets others (meet/meetings.h)
  std::uint32_t first_row, last_row;  // geometry rows that it may reach; last_row included
  std::array<double, 5> x, y, z;      // of the piece within the layer, from `low`
  std::uint32_t corners;
  double front, back;                              // y that the piece reaches, from `low`
  double area, moment;                             // along x, nm^2 and nm^3; 0 if edgewise
  std::uint32_t first_piece = 0, piece_count = 0;  // its trapezoids, if they are cut already

  /// What lies behind the piece within the layer, up to where x is `end`, nm^3; negative behind facets that +x leaves through.
  double volume_behind(double end) const { return area * (end - low.x) - moment; }
  void find_rows(const Edges& rows);
  /// To where another copy stands.
  void move(const Point3& by, const Edges& rows);
};

/// A facet in a row.
struct RowFacet {
  std::uint32_t first = 0, last = 0;  // columns that it may reach; last included
  std::uint32_t index = 0;            // among those of the layer
};

/// Fills in everything; false if nothing of the facet lies between the heights, or it has no area at all.
bool take_facet(const Triangle& on_bed, bool suspect, std::int64_t bottom, std::int64_t top, const Edges& rows, SlabFacet& out);

// --- the piece of a facet between two of its corners, projected along x. Two edges of the facet's piece within the layer bound
// it, and a plane of one y at each end. So each row of voxels cuts a trapezoid out of it again, by two chords.

/// nm, from the lowest corner of the facet's box.
struct Trapezoid {
  /// An edge: a point of it, and what a step along y adds.
  struct TrapezoidSide {
    double y, x, z, dx, dz;
  };
  TrapezoidSide on, back;             // in the order of the facet's corners downwards, and against it
  double low, high;                   // y at its ends
  double left, right;                 // x that it reaches
  double slope_margin;                // by which x of a chord may be off
  double from_x, from_y;              // the lowest corner, on the bed
  double size;                        // of the facet
  std::uint32_t facet;                // its index in the layer
  std::uint32_t first_row, last_row;  // geometry rows that it may reach; last_row included
  bool edgewise, suspect;             // as SlabFacet has them
  bool level;                         // horizontal

  void find_rows(const Edges& rows);
};

/// Appends the trapezoids of a facet, up to one less than it has corners, from the highest down; one without height if the
/// facet has none.
void cut_trapezoids(const SlabFacet& facet, std::uint32_t index, const Edges& rows, Buffer<Trapezoid>& to);

}  // namespace lamina::coverage
