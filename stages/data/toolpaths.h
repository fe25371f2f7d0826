// stages/data/toolpaths.h: beads of one layer in the order of deposition, and their straight pieces on their way to a file:
// these are never stored, only passed on.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <span>

#include "stages/data/buffer.h"
#include "stages/data/contours.h"  // Point2
#include "stages/data/units.h"

namespace lamina {

/// What a stretch of bead is for.
enum class PathKind : std::uint8_t {
  kOuter,    // wall along the surface of the part, of outer contours and of holes alike
  kInner,    // further walls inside it
  kRaster,   // a line of a raster, or of another pattern of open lines
  kContour,  // a closed curve that fills: concentric offsets
  kLink,     // short way from the end of one raster line to the start of the next, along the edge of the filled region
  kSkirt,    // around all parts, before the first bead of any: never stored, only moved
  kSolid,    // a line or link of what is solid in a part of lower density
  kSupport   // of a raft: never stored, only moved
};
inline constexpr std::size_t kPathKinds = 8;

/// Whether beads are deposited in addition to the parts.
constexpr bool is_auxiliary(PathKind kind) { return kind == PathKind::kSkirt || kind == PathKind::kSupport; }

/// Line number of walls and links.
inline constexpr std::int32_t kNoLine = INT32_MIN;

/// Borrowed toolpaths of one layer. A path is deposited without a stop; from the end of one to the start of the next the nozzle
/// travels.
///
/// offset  paths + 1 entries, first 0, last point.size(); path p owns point[offset[p] .. offset[p + 1]), two or more
/// point   nm on the bed. A closed path ends with its first point repeated.
/// kind, width, line   one entry a point: they belong to the segment from that point to the next one of its path. The last
///         point of a path starts no segment and repeats the entries before it.
/// width   nm of bead, > 0
/// line    number of the raster line in its layer, counted across over the part, the same in every layer with one angle
///         (negative before the first line); the pieces into which holes cut a line share it. Even lines run along the
///         raster's direction, odd ones against it. Closed curves that fill are counted from the surface inwards, all
///         of one depth alike. kNoLine for walls and links.
struct ToolpathsView {
  std::span<const std::uint32_t> offset;
  std::span<const Point2> point;
  std::span<const PathKind> kind;
  std::span<const Nm> width;
  std::span<const std::int32_t> line;

  std::uint32_t size() const { return offset.empty() ? 0 : static_cast<std::uint32_t>(offset.size() - 1); }
  std::span<const Point2> operator[](std::uint32_t p) const { return point.subspan(offset[p], offset[p + 1] - offset[p]); }
};

/// Owned toolpaths; 17 bytes a point.
struct Toolpaths {
  Buffer<std::uint32_t> offset{0};
  Buffer<Point2> point;
  Buffer<PathKind> kind;
  Buffer<Nm> width;
  Buffer<std::int32_t> line;

  std::uint32_t size() const { return static_cast<std::uint32_t>(offset.size() - 1); }
  ToolpathsView view() const { return {offset, point, kind, width, line}; }
  operator ToolpathsView() const { return view(); }

  void clear() {
    offset.assign(1, 0);
    point.clear();
    kind.clear();
    width.clear();
    line.clear();
  }
  void add(Point2 at, PathKind of, Nm bead_width, std::int32_t line_number = kNoLine) {
    point.push_back(at);
    kind.push_back(of);
    width.push_back(bead_width);
    line.push_back(line_number);
  }
  /// Appends paths [first, last) of these once more, moved.
  void append_moved(std::uint32_t first, std::uint32_t last, Point2 by) {
    const std::size_t begin = offset[first], count = offset[last] - begin, before = point.size();
    const auto repeat = [&](auto& list) {
      list.resize(before + count);
      std::copy_n(list.begin() + static_cast<std::ptrdiff_t>(begin), count, list.begin() + static_cast<std::ptrdiff_t>(before));
    };
    repeat(point), repeat(kind), repeat(width), repeat(line);
    for (std::size_t i = before; i < before + count; ++i) point[i] = {point[i].x + by.x, point[i].y + by.y};
    for (std::uint32_t p = first; p < last; ++p) offset.push_back(static_cast<std::uint32_t>(offset[p + 1] - begin + before));
  }
  /// Ends the path whose points were added.
  void close() { offset.push_back(static_cast<std::uint32_t>(point.size())); }
};

/// Length of all paths, mm.
inline double length_mm(const ToolpathsView& paths) {
  double sum = 0;
  for (std::uint32_t p = 0; p < paths.size(); ++p) {
    for (std::uint32_t i = paths.offset[p]; i + 1 < paths.offset[p + 1]; ++i) {
      const Point2 a = paths.point[i], b = paths.point[i + 1];
      sum += std::hypot(static_cast<double>(b.x) - a.x, static_cast<double>(b.y) - a.y);
    }
  }
  return sum * 1e-6;
}

enum class Thickness : std::uint8_t {
  kReference,  // as wide as walls and continuous lines
  kThick,      // wide enough to touch the neighbouring lines
  kThin        // leaves pores next to it
};

/// A straight piece of a layer's toolpaths, in the order in which they are deposited.
struct PathInterval {
  Point2 from, to;  // nm; never equal
  PathKind kind;
  Thickness thickness;
  Nm width;               // of the stored path: the reference width
  std::int32_t line;      // kNoLine if none
  bool jump;              // the nozzle travels to `from`, which is not where the stretch before ended
  std::uint32_t run = 0;  // index of the stored point where its line, curve or wall begins
};

/// The command for a segment.
struct BeadMove {
  Point2 from, to;  // nm
  PathKind kind;
  bool jump;
  Nm width;         // nm, that the bead is expected to have: a tag for viewers
  double area_mm2;  // cross-section of the bead: volume / length
  double speed_mm_s;
  bool begins = false;  // a wall, line, curve or link begins
};

/// The bead that a move has deposited.
struct DepositedMove {
  double length_mm, volume_mm3;
};

/// Segmented lines as deposited. A piece is a line, or what holes leave of it, that is divided.
struct SegmentCounts {
  std::uint64_t pieces = 0;
  std::uint64_t intervals = 0;  // points of the lists of Fukuda 2020: the start of a piece and its marks
  std::uint64_t thin = 0;
  std::uint64_t points() const { return intervals + pieces; }  // with the ends of pieces
  std::uint64_t lines = 0;  // segmented lines, divided or not; a line cut by holes counts once

  void add(const SegmentCounts& other) {
    pieces += other.pieces;
    intervals += other.intervals;
    thin += other.thin;
    lines += other.lines;
  }
};

/// The pores next to thin segments as deposited. A side of a thin segment is a pore where a line runs alongside all of it,
/// where the thick segments at both of its ends reach that line, and where a gap stays open between.
struct PoreCounts {
  std::uint64_t closed = 0;            // pores
  std::uint64_t open = 0;              // sides whose thick segments do not reach the next line: a channel
  std::uint64_t filled = 0;            // sides without room: round ends meet, or the thin stretch touches its neighbour
  std::uint64_t edges = 0;             // sides along walls, and at ends of lines without a thick stretch
  double length_mm = 0, width_mm = 0;  // sums over `closed`
  double distance_mm = 0;              // centre to centre, sum over `open`
  std::uint64_t crossing = 0;          // thin stretches with a turned layer above them, if pores are to cross
  std::uint64_t crossed = 0;           // those that lie under a thin stretch of that layer

  void add(const PoreCounts& other) {
    closed += other.closed;
    open += other.open;
    filled += other.filled;
    edges += other.edges;
    length_mm += other.length_mm;
    width_mm += other.width_mm;
    distance_mm += other.distance_mm;
    crossing += other.crossing;
    crossed += other.crossed;
  }
};

/// Stretches that end before the machine has reached their speed.
struct ShortIntervals {
  std::uint64_t count = 0;
  double shortest_mm = 0;                       // of them; 0 without any
  double reached_mm_s = 0, commanded_mm_s = 0;  // of the one that becomes fastest: its speed, and the commanded one

  void add(const ShortIntervals& other) {
    if (other.count == 0) return;
    shortest_mm = count == 0 ? other.shortest_mm : std::min(shortest_mm, other.shortest_mm);
    count += other.count;
    if (other.reached_mm_s <= reached_mm_s) return;
    reached_mm_s = other.reached_mm_s;
    commanded_mm_s = other.commanded_mm_s;
  }
};

/// Void share of what was planned: of the volume within the contours.
struct PlannedPorosity {
  double solid_mm3 = 0;     // area within the contours x thickness, over all layers
  double extruded_mm3 = 0;  // of the parts' beads: as extruded, the machine's declared error included
  double measured_mm3 = 0;  // stadia of the widths that were measured
  double by_extrusion() const { return 1 - extruded_mm3 / solid_mm3; }
  double by_widths() const { return 1 - measured_mm3 / solid_mm3; }

  void add(const PlannedPorosity& other) {
    solid_mm3 += other.solid_mm3;
    extruded_mm3 += other.extruded_mm3;
    measured_mm3 += other.measured_mm3;
  }
};

/// All that is counted while the moves of a layer are deposited.
struct DepositedSums {
  SegmentCounts segments;
  PlannedPorosity porosity;
  PoreCounts pores;
  ShortIntervals shorts;

  void add(const DepositedSums& other) {
    segments.add(other.segments);
    porosity.add(other.porosity);
    pores.add(other.pores);
    shorts.add(other.shorts);
  }
};

/// A straight move of a toolpath file that deposits a bead.
struct DepositedBead {
  Point2 from, to;     // nm on the bed
  Nm width;            // nm
  std::uint32_t type;  // what it is for, as the file numbers it
};

/// What was commanded for one.
struct BeadFeed {
  double volume_mm3;              // fed along it
  double speed_mm_s;              // of the head; 0: not stated
  bool joined;                    // it begins where the bead before ended, and nothing was moved in between
  double primed_mm3 = 0;          // fed since the bead before, retractions and what took them back together
  double acceleration_mm_s2 = 0;  // commanded; 0: not stated
};

}  // namespace lamina
