#include "stages/raster/scan.h"

#include <algorithm>
#include <cstdlib>
#include <cstring>

namespace lamina::raster {
namespace {

/// Rows hold few crossings, and engines find them nearly in order, so insertion is quick; a row that turns out to be
/// in disorder is handed to the standard sort.
void sort_row(std::uint32_t* begin, std::uint32_t* end) {
  std::ptrdiff_t patience = 64 + 8 * (end - begin);
  for (std::uint32_t* i = begin + 1; i < end; ++i) {
    const std::uint32_t value = *i;
    std::uint32_t* hole = i;
    while (hole != begin && hole[-1] > value) {
      *hole = hole[-1];
      --hole;
    }
    *hole = value;
    patience -= i - hole;
    if (patience < 0) {
      std::sort(begin, end);
      return;
    }
  }
}

/// Writes the changes of one sorted row behind `change`, returns their end. The winding number starts at 0 on the left;
/// where two crossings meet in one column, what is between them is empty and leaves no change.
template <FillRule kRule>
std::uint32_t* write_changes(const std::uint32_t* crossing, const std::uint32_t* end, std::uint32_t* change) {
  const std::uint32_t* const row_begin = change;
  std::int32_t winding = 0;
  bool solid = false;
  for (; crossing != end; ++crossing) {
    winding += (*crossing & 1) != 0 ? 1 : -1;
    if (is_solid(kRule, winding) == solid) continue;
    solid = !solid;
    const std::uint32_t column = *crossing >> 1;
    if (change != row_begin && change[-1] == column) {
      --change;
    } else {
      *change++ = column;
    }
  }
  return change;
}

}  // namespace

void ScanConverter::place_segments(std::span<const Segment> segments, std::uint32_t first_row, std::uint32_t rows) {
  place_.assign(std::size_t{rows} + 1, 0);
  for (const Segment& segment : segments) {
    ++place_[segment.first_row - first_row];
    --place_[segment.last_row - first_row];
  }
  for (const Closing& closing : closing_) {
    ++place_[closing.row - first_row];
    --place_[closing.row - first_row + 1];
  }
  std::uint32_t in_row = 0, total = 0;
  for (std::uint32_t row = 0; row < rows; ++row) {
    in_row += place_[row];
    place_[row] = total;
    total += in_row;
  }
  place_[rows] = total;
  set_crossings(total);
}

void ScanConverter::fill_crossings(const PixelSampling& sampling, const Segment& segment, std::span<const PlacedMesh> placed,
                                   Nm plane, std::uint32_t first_row) {
  std::uint32_t* const place = place_.data();
  std::uint32_t* const crossing = crossing_.data();
  const Nm* const centre = sampling.row_centre.data();
  const std::uint32_t enters = (segment.flags & Segment::kEnters) != 0 ? 1 : 0;
  const auto exact = [&](std::uint32_t row) {
    const PlacedMesh& source = placed[segment.instance];
    const Triangle facet = source.mesh->triangle(segment.cluster, segment.flags & Segment::kLane);
    const ExactTriangle triangle(on_bed(facet.a, source.offset), on_bed(facet.b, source.offset),
                                 on_bed(facet.c, source.offset));
    return static_cast<std::uint32_t>(exact_column(sampling.x, triangle, centre[row], plane));
  };
  const auto put = [&](std::uint32_t row, std::uint32_t column) { crossing[place[row - first_row]++] = column * 2 + enters; };

  if ((segment.flags & Segment::kUpright) != 0) {
    const std::uint32_t column = exact(segment.first_row);
    for (std::uint32_t row = segment.first_row; row < segment.last_row; ++row) put(row, column);
    return;
  }
  if ((segment.flags & Segment::kExact) != 0) {
    for (std::uint32_t row = segment.first_row; row < segment.last_row; ++row) put(row, exact(row));
    return;
  }
  const double undecided = 2 * sampling.near_x;
  const double y = centre[segment.first_row];
  for (std::uint32_t row = segment.first_row; row < segment.last_row; ++row) {
    const double guess = segment.column + segment.columns_per_nm * (centre[row] - y);
    auto column = static_cast<std::uint32_t>(static_cast<std::int32_t>(guess));
    if (guess - static_cast<std::int32_t>(column) < undecided) [[unlikely]]
      column = exact(row);
    put(row, column);
  }
}

void ScanConverter::close_open_parts(const PixelSampling& sampling, std::span<const Segment> segments,
                                     std::span<const PlacedMesh> placed, Nm plane, std::uint32_t first_row, std::uint32_t rows,
                                     LayerReport& report) {
  of_open_parts_.clear();
  closing_.clear();
  if (std::ranges::all_of(placed, [](const PlacedMesh& part) { return part.mesh->closed; })) return;
  for (const Segment& segment : segments) {
    if (!placed[segment.instance].mesh->closed) of_open_parts_.push_back(segment);
  }
  std::ranges::sort(of_open_parts_, {}, &Segment::instance);
  Buffer<Closing> closings;  // closing_ stays empty while the crossings of single parts are placed
  for (auto begin = of_open_parts_.begin(); begin != of_open_parts_.end();) {
    const auto end =
        std::find_if(begin, of_open_parts_.end(), [&](const Segment& segment) { return segment.instance != begin->instance; });
    const std::span<const Segment> part(begin, end);
    place_segments(part, first_row, rows);
    for (const Segment& segment : part) fill_crossings(sampling, segment, placed, plane, first_row);
    for (std::uint32_t row = 0; row < rows; ++row) {
      std::int32_t winding = 0;
      std::uint32_t last = 0;
      for (std::uint32_t i = row == 0 ? 0 : place_[row - 1]; i < place_[row]; ++i) {
        winding += (crossing_[i] & 1) != 0 ? 1 : -1;
        last = std::max(last, crossing_[i] >> 1);
      }
      const std::uint32_t closing = last * 2 + (winding < 0 ? 1 : 0);
      closings.insert(closings.end(), static_cast<std::size_t>(std::abs(winding)), {first_row + row, closing});
    }
    begin = end;
  }
  closing_ = std::move(closings);
  if (closing_.empty()) return;
  capped_.assign(rows, 0);
  for (const Closing& closing : closing_) capped_[closing.row - first_row] = 1;
  report.open_rows += static_cast<std::uint32_t>(std::ranges::count(capped_, 1));
  report.first_open_row = std::ranges::min(closing_, {}, &Closing::row).row;  // bands come from the back
}

void ScanConverter::report_caps(std::span<const Segment> segments, std::uint32_t first_row, std::uint32_t rows,
                                LayerReport& report) {
  capped_.assign(rows, 0);
  report.first_capped_row = first_row + rows;  // bands come from the back, so any row of this one is lower
  for (const Segment& segment : segments) {
    if ((segment.flags & Segment::kCap) == 0) continue;
    std::memset(capped_.data() + (segment.first_row - first_row), 1, segment.last_row - segment.first_row);
    if (segment.first_row < report.first_capped_row) {
      report.first_capped_row = segment.first_row;
      report.first_capped_instance = segment.instance;
    }
  }
  report.capped_rows += static_cast<std::uint32_t>(std::ranges::count(capped_, 1));
}

void ScanConverter::append_rows(const PixelSampling& sampling, std::span<const Segment> segments,
                                std::span<const PlacedMesh> placed, Nm plane, FillRule rule, std::uint32_t first_row,
                                std::uint32_t last_row, Runs& out, LayerReport& report) {
  const std::uint32_t rows = last_row - first_row;
  const std::size_t out_rows = out.row_offset.size();
  const auto out_changes = static_cast<std::uint32_t>(out.change.size());
  out.row_offset.resize(out_rows + rows);
  std::uint32_t* row_end = out.row_offset.data() + out_rows;
  if (segments.empty()) {
    std::fill_n(row_end, rows, out_changes);
    return;
  }

  close_open_parts(sampling, segments, placed, plane, first_row, rows, report);
  place_segments(segments, first_row, rows);
  for (const Closing& closing : closing_) crossing_[place_[closing.row - first_row]++] = closing.crossing;
  bool any_cap = false;
  for (const Segment& segment : segments) {
    fill_crossings(sampling, segment, placed, plane, first_row);
    any_cap |= (segment.flags & Segment::kCap) != 0;
  }
  report.segments += static_cast<std::uint32_t>(segments.size());
  report.crossings += crossing_.size();
  if (any_cap) report_caps(segments, first_row, rows, report);

  out.change.resize(out_changes + crossing_.size());  // a change has a crossing of its own
  std::uint32_t* const changes = out.change.data();
  std::uint32_t* change = changes + out_changes;
  for (std::uint32_t row = rows; row-- > 0;) {
    std::uint32_t* const begin = crossing_.data() + (row == 0 ? 0 : place_[row - 1]);
    std::uint32_t* const end = crossing_.data() + place_[row];
    if (begin != end) {
      sort_row(begin, end);
      const std::uint32_t* const row_begin = change;
      switch (rule) {
        case FillRule::kNonzero: change = write_changes<FillRule::kNonzero>(begin, end, change); break;
        case FillRule::kPositive: change = write_changes<FillRule::kPositive>(begin, end, change); break;
        case FillRule::kEvenOdd: change = write_changes<FillRule::kEvenOdd>(begin, end, change); break;
      }
      change -= (change - row_begin) & 1;  // an open mesh that says it is closed: runs stay pairs all the same
    }
    *row_end++ = static_cast<std::uint32_t>(change - changes);
  }
  out.change.resize(static_cast<std::size_t>(change - changes));
}

}  // namespace lamina::raster
