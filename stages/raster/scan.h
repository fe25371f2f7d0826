// stages/raster/scan.h: clusters that an engine found become segments, and these become runs.
#pragma once

#include <cstdint>
#include <span>

#include "stages/data/buffer.h"
#include "stages/data/choices.h"
#include "stages/data/runs.h"
#include "stages/raster/kernels/kernels.h"
#include "stages/raster/segment.h"

namespace lamina::raster {

using ClusterVisits = Buffer<ClusterVisit>;

/// Geometry rows [first_row, last_row) of a layer, which are drawn at once.
struct RowBand {
  const Kernels& kernels;
  const PixelSampling& sampling;
  std::span<const PlacedMesh> placed;
  Nm plane;  // on the bed
  std::uint32_t first_row, last_row;

  std::uint32_t rows() const { return last_row - first_row; }
};

/// Appends the segments of the clusters' facets in the rows of the band.
/// out  has capacity for as many as there are facets that the plane cuts and kClusterSize more, else it grows
void cut_clusters(const RowBand& band, std::span<const ClusterVisit> visits, Segments& out);

/// What a layer reported besides its runs.
struct LayerReport {
  std::uint32_t segments = 0;
  std::uint64_t crossings = 0;
  std::uint32_t capped_rows = 0;  // rows in which a facet that repair added is crossed
  std::uint32_t open_rows = 0;    // rows in which the crossings of a part do not add up to zero: it was not repaired
  std::uint32_t first_capped_row = 0, first_open_row = 0;  // geometry rows; the lowest, if there is any
  std::uint32_t first_capped_instance = 0;                 // of the facet that closes that row
  LevelFace level;                                         // the largest, if any
  std::uint64_t scratch_bytes = 0;

  /// Adds the crossings and rows of another solid of the layer; rows to report come from the first solid that has any.
  void add_solid(const LayerReport& solid);
};

/// Scan conversion of one band of rows at a time: count (by differences, a segment costs two additions), scan, fill,
/// then each row is sorted and the fill rule decides where it changes. Keeps its buffers from band to band.
///
/// Where a part is open (Mesh::closed), a row whose crossings of that part do not add up to zero is closed at the last
/// of them: the row beyond is drawn as if the part ended there.
class ScanConverter {
 public:
  /// Appends the band's rows, the last one first (image order), to `out`; `segments` lie within these rows.
  void append_rows(const RowBand& band, const Segments& segments, FillRule rule, Runs& out, LayerReport& report);

  std::uint64_t bytes() const {
    return bytes_held(position_) + bytes_held(crossing_) + bytes_held(capped_) + bytes_held(of_open_parts_) + of_part_.bytes() +
           bytes_held(closing_);
  }

 private:
  /// What makes the crossings of an open part add up to zero in a row.
  struct Closing {
    std::uint32_t row;       // geometry row
    std::uint32_t crossing;  // column * 2 + (1 if it enters)
  };

  /// Puts the crossings of the segments, and those of closing_, row by row.
  void fill(const RowBand& band, const Segments& segments);
  void close_open_parts(const RowBand& band, const Segments& segments, LayerReport& report);
  void close_part(const RowBand& band, Buffer<Closing>& closings) const;
  void report_caps(const RowBand& band, const Segments& segments, LayerReport& report);

  Buffer<std::uint32_t> position_;       // per geometry row of the band: where its next crossing goes
  Buffer<std::uint32_t> crossing_;       // column * 2 + (1 if it enters), row by row
  std::size_t crossings_ = 0;            // of the band; crossing_ is longer
  Buffer<std::uint8_t> capped_;          // per geometry row of the band
  Buffer<std::uint32_t> of_open_parts_;  // segments of the band, by part
  Segments of_part_;                     // of one of them
  Buffer<Closing> closing_;              // of the band
};

}  // namespace lamina::raster
