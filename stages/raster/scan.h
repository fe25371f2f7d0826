// stages/raster/scan.h: segments of a layer become runs.
#pragma once

#include <cstdint>
#include <span>

#include "stages/data/buffer.h"
#include "stages/data/choices.h"
#include "stages/data/runs.h"
#include "stages/raster/clusters.h"
#include "stages/raster/kernels/kernels.h"
#include "stages/raster/segment.h"

namespace lamina::raster {

using ClusterVisits = Buffer<ClusterVisit>;

/// What a layer told besides its runs.
struct LayerReport {
  std::uint32_t segments = 0;
  std::uint64_t crossings = 0;
  std::uint32_t capped_rows = 0;  // rows in which a facet that repair added is crossed
  std::uint32_t open_rows = 0;    // rows in which the crossings of a part do not add up to zero: it was not repaired
  std::uint32_t first_capped_row = 0, first_open_row = 0;  // geometry rows; the lowest, if there is any
  std::uint32_t first_capped_instance = 0;                 // of the facet that closes that row
  std::uint64_t scratch_bytes = 0;

  /// Adds the crossings and rows of another solid of the layer; places come from the first solid that has any.
  void add_solid(const LayerReport& solid);
};

/// Scan conversion of one band of rows at a time: count (by differences, a segment costs two additions), scan, fill,
/// then each row is sorted and the fill rule decides where it changes. Keeps its buffers from band to band.
///
/// Where a part is open (Mesh::closed), a row whose crossings of that part do not add up to zero is closed at the last
/// of them: whatever lies beside the part is drawn as if the part ended there.
class ScanConverter {
 public:
  /// Appends rows last_row - 1 down to first_row (image order) to `out`; `segments` lie within these rows.
  void append_rows(const Kernels& kernels, const PixelSampling& sampling, const Segments& segments,
                   std::span<const PlacedMesh> placed, Nm plane, FillRule rule, std::uint32_t first_row, std::uint32_t last_row,
                   Runs& out, LayerReport& report);

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

  /// Unset crossings of a band; an eighth more room where it has to grow, so that bytes() follows what bands need.
  void set_crossings(std::size_t count) {
    if (count > crossing_.capacity()) {
      crossing_ = {};
      crossing_.reserve(count + count / 8);
    }
    crossing_.resize(count);
  }
  void sort_segments(const Segments& segments, std::uint32_t first_row, std::uint32_t rows);
  void fill(const Kernels& kernels, const PixelSampling& sampling, const Segments& segments, std::span<const PlacedMesh> placed,
            Nm plane, std::uint32_t first_row);
  void close_open_parts(const Kernels& kernels, const PixelSampling& sampling, const Segments& segments,
                        std::span<const PlacedMesh> placed, Nm plane, std::uint32_t first_row, std::uint32_t rows,
                        LayerReport& report);
  void close_part(std::uint32_t first_row, std::uint32_t rows, Buffer<Closing>& closings) const;
  void report_caps(const Segments& segments, std::span<const PlacedMesh> placed, std::uint32_t first_row, std::uint32_t rows,
                   LayerReport& report);

  Buffer<std::uint32_t> position_;       // per geometry row of the band: where its next crossing goes
  Buffer<std::uint32_t> crossing_;       // column * 2 + (1 if it enters), row by row
  std::size_t crossings_ = 0;            // of the band; crossing_ is longer
  Buffer<std::uint8_t> capped_;          // per geometry row of the band
  Buffer<std::uint32_t> of_open_parts_;  // segments of the band, by part
  Segments of_part_;                     // of one of them
  Buffer<Closing> closing_;              // of the band
};

}  // namespace lamina::raster
