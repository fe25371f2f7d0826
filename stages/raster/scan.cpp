#include "stages/raster/scan.h"

#include <algorithm>
#include <cstdlib>
#include <cstring>

namespace lamina::raster {

void LayerReport::add_solid(const LayerReport& solid) {
  if (capped_rows == 0) {
    first_capped_row = solid.first_capped_row;
    first_capped_instance = solid.first_capped_instance;
  }
  if (open_rows == 0) first_open_row = solid.first_open_row;
  crossings += solid.crossings;
  capped_rows += solid.capped_rows;
  open_rows += solid.open_rows;
}

void ScanConverter::sort_segments(const Segments& segments, std::uint32_t first_row, std::uint32_t rows) {
  position_.assign(std::size_t{rows} + 1, 0);
  std::uint32_t* const position = position_.data();
  for (std::size_t i = 0; i < segments.size; ++i) {
    const SegmentRows segment = segments.rows[i];
    ++position[segment.first - first_row];
    --position[segment.end() - first_row];
  }
  for (const Closing& closing : closing_) {
    ++position[closing.row - first_row];
    --position[closing.row - first_row + 1];
  }
  std::uint32_t in_row = 0, total = 0;
  for (std::uint32_t row = 0; row < rows; ++row) {
    in_row += position[row];
    position[row] = total;
    total += in_row;
  }
  crossings_ = total;
  set_crossings(std::size_t{total} + RowsTask::kMoreCrossings);
}

void ScanConverter::fill(const Kernels& kernels, const PixelSampling& sampling, const Segments& segments,
                         std::span<const PlacedMesh> placed, Nm plane, std::uint32_t first_row) {
  kernels.fill({sampling, segments, placed, plane, first_row, position_.data(), crossing_.data()});
}

/// The crossings that close the part whose crossings are filled in.
void ScanConverter::close_part(std::uint32_t first_row, std::uint32_t rows, Buffer<Closing>& closings) const {
  for (std::uint32_t row = 0; row < rows; ++row) {
    std::int32_t winding = 0;
    std::uint32_t last = 0;
    for (std::uint32_t i = row == 0 ? 0 : position_[row - 1]; i < position_[row]; ++i) {
      winding += (crossing_[i] & 1) != 0 ? 1 : -1;
      last = std::max(last, crossing_[i] >> 1);
    }
    const std::uint32_t closing = last * 2 + (winding < 0 ? 1 : 0);
    closings.insert(closings.end(), static_cast<std::size_t>(std::abs(winding)), {first_row + row, closing});
  }
}

void ScanConverter::close_open_parts(const Kernels& kernels, const PixelSampling& sampling, const Segments& segments,
                                     std::span<const PlacedMesh> placed, Nm plane, std::uint32_t first_row, std::uint32_t rows,
                                     LayerReport& report) {
  of_open_parts_.clear();
  closing_.clear();
  if (std::ranges::all_of(placed, [](const PlacedMesh& part) { return part.mesh->closed; })) return;
  const auto instance_of = [&](std::uint32_t i) { return segments.origin[i].instance; };
  for (std::uint32_t i = 0; i < segments.size; ++i) {
    if (!placed[instance_of(i)].mesh->closed) of_open_parts_.push_back(i);
  }
  std::ranges::sort(of_open_parts_, {}, instance_of);
  of_part_.size = 0;
  of_part_.ensure_capacity(of_open_parts_.size());
  Buffer<Closing> closings;  // closing_ stays empty while the crossings of single parts are placed
  for (auto i = of_open_parts_.begin(); i != of_open_parts_.end();) {
    const std::uint32_t instance = instance_of(*i);
    of_part_.size = 0;
    for (; i != of_open_parts_.end() && instance_of(*i) == instance; ++i) of_part_.append(segments, *i);
    sort_segments(of_part_, first_row, rows);
    fill(kernels, sampling, of_part_, placed, plane, first_row);
    close_part(first_row, rows, closings);
  }
  closing_ = std::move(closings);
  if (closing_.empty()) return;
  capped_.assign(rows, 0);
  for (const Closing& closing : closing_) capped_[closing.row - first_row] = 1;
  report.open_rows += static_cast<std::uint32_t>(std::ranges::count(capped_, 1));
  report.first_open_row = std::ranges::min(closing_, {}, &Closing::row).row;  // bands come from the back
}

void ScanConverter::report_caps(const Segments& segments, std::span<const PlacedMesh> placed, std::uint32_t first_row,
                                std::uint32_t rows, LayerReport& report) {
  if (std::ranges::all_of(placed, [](const PlacedMesh& part) { return part.mesh->first_cap == part.mesh->cluster_count(); })) {
    return;
  }
  capped_.clear();
  for (std::size_t i = 0; i < segments.size; ++i) {
    const SegmentOrigin& origin = segments.origin[i];
    if (origin.facet / kClusterSize < placed[origin.instance].mesh->first_cap) continue;
    if (capped_.empty()) {
      capped_.assign(rows, 0);
      report.first_capped_row = first_row + rows;  // bands come from the back, so any row of this one is lower
    }
    const SegmentRows segment = segments.rows[i];
    std::memset(capped_.data() + (segment.first - first_row), 1, segment.count());
    if (segment.first < report.first_capped_row) {
      report.first_capped_row = segment.first;
      report.first_capped_instance = origin.instance;
    }
  }
  report.capped_rows += static_cast<std::uint32_t>(std::ranges::count(capped_, 1));
}

void ScanConverter::append_rows(const Kernels& kernels, const PixelSampling& sampling, const Segments& segments,
                                std::span<const PlacedMesh> placed, Nm plane, FillRule rule, std::uint32_t first_row,
                                std::uint32_t last_row, Runs& out, LayerReport& report) {
  const std::uint32_t rows = last_row - first_row;
  const std::size_t out_rows = out.row_offset.size(), out_changes = out.change.size();
  out.row_offset.resize(out_rows + rows);
  std::uint32_t* const row_end = out.row_offset.data() + out_rows;
  if (segments.size == 0) {
    std::fill_n(row_end, rows, static_cast<std::uint32_t>(out_changes));
    return;
  }

  close_open_parts(kernels, sampling, segments, placed, plane, first_row, rows, report);
  sort_segments(segments, first_row, rows);
  for (const Closing& closing : closing_) crossing_[position_[closing.row - first_row]++] = closing.crossing;
  fill(kernels, sampling, segments, placed, plane, first_row);
  report.segments += static_cast<std::uint32_t>(segments.size);
  report.crossings += crossings_;
  report_caps(segments, placed, first_row, rows, report);

  out.change.resize(out_changes + crossings_ + RowsTask::kMoreCrossings);  // a change has a crossing of its own
  std::uint32_t* const changes = out.change.data();
  const std::uint32_t* const end =
      kernels.rows({crossing_.data(), position_.data(), rows, rule, changes, changes + out_changes, row_end});
  out.change.resize(static_cast<std::size_t>(end - changes));
}

}  // namespace lamina::raster
