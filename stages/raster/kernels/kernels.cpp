#include "stages/raster/kernels/kernels.h"

#include <algorithm>
#include <bit>
#include <cstdlib>

#include "stages/raster/kernels/bodies.h"

namespace lamina::raster {
namespace {

template <FillRule kRule>
std::uint32_t* changes_by(const std::uint32_t* crossing, const std::uint32_t* end, std::uint32_t* change) {
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

std::uint32_t crossing_of(const FillTask& task, std::size_t segment, const ExactTriangle& triangle, std::uint32_t row) {
  const std::int64_t column = exact_column(task.sampling.x, triangle, task.sampling.row_centre[row], task.plane);
  return static_cast<std::uint32_t>(column) * 2 + (task.segments.rows[segment].is(SegmentRows::kEnters) ? 1 : 0);
}

}  // namespace

const Kernels& kernels_for([[maybe_unused]] Isa isa) {
  static constexpr Kernels kPlain{Isa::kPlain, plain::find, plain::cut_found,  plain::gather_listed, plain::cut,
                                  plain::fill, plain::rows, plain::load_sides, plain::raise_tents};
#if defined(LAMINA_WIDE_KERNELS)
  static constexpr Kernels kAvx2{Isa::kAvx2, avx2::find, avx2::cut_found,   avx2::gather_listed, avx2::cut,
                                 avx2::fill, avx2::rows, plain::load_sides, avx2::raise_tents};
  static constexpr Kernels kAvx512{Isa::kAvx512, avx512::find, avx512::cut_found,  avx512::gather_listed, avx512::cut,
                                   avx512::fill, avx512::rows, avx512::load_sides, avx512::raise_tents};
  if (isa == Isa::kAvx512) return kAvx512;
  if (isa == Isa::kAvx2) return kAvx2;
#endif
  return kPlain;
}

std::uint32_t exact_end(const PixelSampling& sampling, Nm tip_y, Nm up, Nm edge_y, Nm edge_z) {
  return static_cast<std::uint32_t>(exact_row(sampling.y, {0, tip_y, 0}, {0, tip_y + edge_y, edge_z}, up));
}

void note_level(const CutTask& task, const Nm* number, std::uint32_t lanes, const std::uint32_t* instance) {
  for (; lanes != 0; lanes &= lanes - 1) {
    const auto i = static_cast<std::uint32_t>(std::countr_zero(lanes));
    const auto of = [&](std::uint32_t which) { return std::int64_t{number[which * CutFacets::kStride + i]}; };
    const std::int64_t tip = -of(CutFacets::kUp), left = tip + of(CutFacets::kLeftZ), right = tip + of(CutFacets::kRightZ);
    if (!LevelFace::is_level(tip, left, right)) continue;
    const std::int64_t left_y = of(CutFacets::kLeftY), right_y = of(CutFacets::kRightY), tip_y = of(CutFacets::kTipY);
    const PixelAxis& axis = task.sampling.y;
    const std::int64_t row = axis.first_at_or_beyond(tip_y + std::min({std::int64_t{0}, left_y, right_y}));
    if (row < task.row_begin || row >= task.row_end) continue;
    if (axis.centre(row) > tip_y + std::max({std::int64_t{0}, left_y, right_y})) continue;  // engines need not find it
    const std::int64_t area = of(CutFacets::kLeftX) * right_y - left_y * of(CutFacets::kRightX);
    Buffer<LevelFace>& faces = task.out.level;
    auto face = std::ranges::find(faces, instance[i], &LevelFace::owner);
    if (face == faces.end()) face = faces.insert(face, LevelFace{0, task.plane, instance[i]});
    face->add(static_cast<std::uint64_t>(std::abs(area)));
  }
}

std::uint32_t exact_crossing(const FillTask& task, std::size_t segment, std::uint32_t row) {
  return crossing_of(task, segment, exact_triangle(task.segments.origin[segment], task.placed, task.plane), row);
}

/// A facet whose x does not change with y has one column for all rows.
FourWords decide_near(const FillTask& task, std::size_t segment, std::uint32_t row, std::uint32_t left, std::uint32_t near,
                      FourWords value) {
  const ExactTriangle triangle = exact_triangle(task.segments.origin[segment], task.placed, task.plane);
  const std::uint32_t in_first = triangle.ny == 0 ? crossing_of(task, segment, triangle, row) : 0;
  for (std::uint32_t k = 0; k < std::min(left, 4u); ++k) {
    if ((near >> k & 1) == 0) continue;
    value[k] = triangle.ny == 0 ? in_first : crossing_of(task, segment, triangle, row + k);
  }
  return value;
}

std::uint32_t* write_changes(FillRule rule, const std::uint32_t* crossing, const std::uint32_t* end, std::uint32_t* change) {
  std::uint32_t* last = change;
  switch (rule) {
    case FillRule::kNonzero: last = changes_by<FillRule::kNonzero>(crossing, end, change); break;
    case FillRule::kPositive: last = changes_by<FillRule::kPositive>(crossing, end, change); break;
    case FillRule::kEvenOdd: last = changes_by<FillRule::kEvenOdd>(crossing, end, change); break;
  }
  return last - ((last - change) & 1);  // an open mesh that says it is closed: runs stay pairs all the same
}

void fill_exactly(const FillTask& task, std::size_t segment) {
  const SegmentRows rows = task.segments.rows[segment];
  std::uint32_t value = exact_crossing(task, segment, rows.first);
  for (std::uint32_t row = rows.first; row < rows.end(); ++row) {
    if (!rows.is(SegmentRows::kUpright)) value = exact_crossing(task, segment, row);
    task.crossing[task.position[row - task.first_row]++] = value;
  }
}

}  // namespace lamina::raster
