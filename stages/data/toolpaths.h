// stages/data/toolpaths.h: where a bead is laid in one layer, in the order in which it is laid, and its straight pieces on
// their way to a file: these are never stored, only passed on.
#pragma once

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
  kLink      // short way from the end of one raster line to the start of the next, along the edge of the filled region
};

/// Line number of walls and links.
inline constexpr std::int32_t kNoLine = INT32_MIN;

/// Borrowed toolpaths of one layer. A path is laid without a stop; from the end of one to the start of the next the
/// nozzle travels.
///
/// offset  paths + 1 entries, first 0, last point.size(); path p owns point[offset[p] .. offset[p + 1]), two or more
/// point   nm on the bed. A closed path ends with its first point repeated.
/// kind, width, line   one entry a point: they belong to the stretch from that point to the next one of its path. The
///         last point of a path starts no stretch and repeats the entries before it.
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
  /// Ends the path whose points were added.
  void close() { offset.push_back(static_cast<std::uint32_t>(point.size())); }
};

enum class Thickness : std::uint8_t {
  kReference,  // as wide as walls and continuous lines
  kThick,      // wide enough to touch the neighbouring lines
  kThin        // leaves pores beside it
};

/// A straight piece of a layer's toolpaths, in the order in which they are laid.
struct Stretch {
  Point2 from, to;  // nm; never equal
  PathKind kind;
  Thickness thickness;
  Nm width;           // of the stored path: the reference width
  std::int32_t line;  // kNoLine if none
  bool jump;          // the nozzle travels to `from`, which is not where the stretch before ended
};

/// What a machine is told of a stretch.
struct BeadMove {
  Point2 from, to;  // nm
  PathKind kind;
  bool jump;
  Nm width;         // nm, that the bead is expected to have: a tag for viewers
  double area_mm2;  // cross-section of what is extruded: volume / length
  double speed_mm_s;
};

/// Segmented lines as they were laid. A piece is a line, or what holes leave of it, that is divided.
struct SegmentCounts {
  std::uint64_t pieces = 0;
  std::uint64_t stretches = 0;  // points of the lists of Fukuda 2020: the start of a piece and its marks
  std::uint64_t thin = 0;
  std::uint64_t points() const { return stretches + pieces; }  // with the ends of pieces
  std::uint64_t lines = 0;  // segmented lines, divided or not; a line cut by holes counts once

  void add(const SegmentCounts& other) {
    pieces += other.pieces;
    stretches += other.stretches;
    thin += other.thin;
    lines += other.lines;
  }
};

/// Void share of what was planned: of the volume within the contours, by three ways to know what beads are.
struct PlannedPorosity {
  double solid_mm3 = 0;     // area within the contours x thickness, over all layers
  double extruded_mm3 = 0;  // rounded rectangles: what is fed
  double ellipses_mm3 = 0;  // the same beads as ellipses
  double measured_mm3 = 0;  // rounded rectangles with the widths that were measured
  double by_extrusion() const { return 1 - extruded_mm3 / solid_mm3; }
  double by_ellipses() const { return 1 - ellipses_mm3 / solid_mm3; }
  double by_widths() const { return 1 - measured_mm3 / solid_mm3; }

  void add(const PlannedPorosity& other) {
    solid_mm3 += other.solid_mm3;
    extruded_mm3 += other.extruded_mm3;
    ellipses_mm3 += other.ellipses_mm3;
    measured_mm3 += other.measured_mm3;
  }
};

/// A straight move of a toolpath file that lays a bead.
struct LaidBead {
  Point2 from, to;     // nm on the bed
  Nm width;            // nm
  std::uint32_t type;  // what it is for, as the file numbers it
};

}  // namespace lamina
