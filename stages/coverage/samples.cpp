#include "stages/coverage/samples.h"

#include <algorithm>

namespace lamina::coverage {
namespace {

using Wide = __int128;

/// Sixteenths of a nanometre: there every sample is whole.
constexpr std::int64_t kParts = 2 * kSamples;

std::int64_t sample_position(std::int64_t begin, std::int64_t end, std::int64_t k) {
  return kParts * begin + (2 * k + 1) * (end - begin);
}

struct SamplePoint {
  std::int64_t x, y, z;  // sixteenths
};

SamplePoint position(const Point3& p) { return {kParts * p.x, kParts * p.y, kParts * p.z}; }

/// Whether the edge meets height z at or before y; exactly one of its ends is above z.
bool meets_before(const SamplePoint& p, const SamplePoint& q, std::int64_t y, std::int64_t z) {
  const SamplePoint &low = p.z <= z ? p : q, &high = p.z <= z ? q : p;
  return static_cast<Wide>(high.y - low.y) * (z - low.z) <= static_cast<Wide>(y - low.y) * (high.z - low.z);
}

}  // namespace

void Samples::cross(const SlabFacet& facet, const Strip& strip, const PixelAxis& columns, const Edges& edges) {
  const SamplePoint a = position(facet.facet.a), b = position(facet.facet.b), c = position(facet.facet.c);
  const Point3 &p = facet.facet.a, &q = facet.facet.b, &r = facet.facet.c;
  const std::int64_t ux = std::int64_t{q.x} - p.x, uy = std::int64_t{q.y} - p.y, uz = std::int64_t{q.z} - p.z;
  const std::int64_t vx = std::int64_t{r.x} - p.x, vy = std::int64_t{r.y} - p.y, vz = std::int64_t{r.z} - p.z;
  const std::int64_t nx = uy * vz - uz * vy, ny = uz * vx - ux * vz, nz = ux * vy - uy * vx;
  for (std::int64_t l = 0; l < kSamples; ++l) {
    const std::int64_t z = sample_position(strip.z0, strip.z1, l);
    const bool low_a = a.z <= z, low_b = b.z <= z, low_c = c.z <= z;
    if (low_a == low_b && low_b == low_c) continue;
    const bool alone_b = low_b != low_a && low_b != low_c, alone_c = low_c != low_a && low_c != low_b;
    const SamplePoint& alone = alone_b ? b : alone_c ? c : a;
    const SamplePoint& one = alone_b ? c : alone_c ? a : b;
    const SamplePoint& other = alone_b ? a : alone_c ? b : c;
    for (std::int64_t k = 0; k < kSamples; ++k) {
      const std::int64_t y = sample_position(strip.y0, strip.y1, k);
      if (meets_before(alone, one, y, z) == meets_before(alone, other, y, z)) continue;
      if (nx == 0) continue;
      // x = a.x - (ny (y - a.y) + nz (z - a.z)) / nx; the first whole sixteenth at or beyond it.
      Wide fall = static_cast<Wide>(ny) * (y - a.y) + static_cast<Wide>(nz) * (z - a.z);
      fall = nx < 0 ? -fall : fall;
      const Wide divisor = nx < 0 ? -static_cast<Wide>(nx) : static_cast<Wide>(nx);
      const auto x = a.x - static_cast<std::int64_t>(floor_div(fall, divisor));
      std::uint32_t column = edges.at(static_cast<double>(x) / kParts);
      std::int64_t s = 0;
      const std::int64_t begin = edge(columns, column), end = edge(columns, column + 1);
      while (s < kSamples && sample_position(begin, end, s) < x) ++s;
      const std::int64_t sample = (std::int64_t{column} - first_) * kSamples + s;
      crossing_.push_back({static_cast<std::uint32_t>(l * kSamples + k), nx < 0 ? 1 : -1,
                           static_cast<std::uint64_t>(std::max<std::int64_t>(sample, 0))});
    }
  }
}

void Samples::count(const Strip& strip, const PixelAxis& columns, const Edges& edges, std::int64_t winding, FillRule fill,
                    std::span<const SlabFacet> facets, std::span<const RowFacet> span, std::uint32_t first, std::uint32_t end) {
  first_ = first;
  end_ = end;
  crossing_.clear();
  count_.assign(end - first, {});
  for (const RowFacet& of_row : span) {
    if (!facets[of_row.index].edgewise) cross(facets[of_row.index], strip, columns, edges);
  }
  std::sort(crossing_.begin(), crossing_.end());
  const auto add = [&](SampleCount& count, std::int64_t wound, std::uint64_t samples) {
    if (is_solid(fill, static_cast<std::int32_t>(wound))) count.solid = static_cast<std::uint16_t>(count.solid + samples);
    if (wound < 0 || wound > 1) count.others = static_cast<std::uint16_t>(count.others + samples);
  };
  const std::uint64_t samples = std::uint64_t{end - first} * kSamples;
  std::size_t next = 0;
  for (std::uint32_t line = 0; line < kSamples * kSamples; ++line) {
    std::int64_t wound = winding;
    std::uint64_t at = 0;
    while (at < samples) {
      for (; next < crossing_.size() && crossing_[next].line == line && crossing_[next].sample <= at; ++next) {
        wound += crossing_[next].sign;
      }
      const bool more = next < crossing_.size() && crossing_[next].line == line;
      const std::uint64_t stop = more ? std::min(samples, crossing_[next].sample) : samples;
      while (at < stop) {
        const std::uint64_t column_end = std::min(stop, (at / kSamples + 1) * kSamples);
        add(count_[at / kSamples], wound, column_end - at);
        at = column_end;
      }
    }
    while (next < crossing_.size() && crossing_[next].line == line) ++next;
  }
}

}  // namespace lamina::coverage
