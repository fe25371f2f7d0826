// Every body of the kernels against integers and against the plain one, bit for bit.
#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <cstring>
#include <random>

#include "stages/geometry/isa.h"
#include "stages/raster/kernels/kernels.h"
#include "stages/raster/scan.h"
#include "tests/raster/shapes.h"

namespace lamina::test {
namespace {

using raster::ExactTriangle;
using raster::Kernels;
using raster::SegmentRows;
using raster::Segments;

std::vector<Isa> isas_here() {
  std::vector<Isa> isas;
  for (Isa isa : {Isa::kPlain, Isa::kAvx2, Isa::kAvx512}) {
    if (usable_isa(isa)) isas.push_back(isa);
  }
  return isas;
}

/// What random clusters are made of: any corners on the bed; corners on centres and planes; facets nearly level, nearly along a
/// row, nearly across; needles.
enum class Kind { kAny, kOnCentres, kFlat, kAlongRows, kUpright, kNear, kHuge };
constexpr Kind kKinds[] = {Kind::kAny,     Kind::kOnCentres, Kind::kFlat, Kind::kAlongRows,
                           Kind::kUpright, Kind::kNear,      Kind::kHuge};

struct Bed {
  PixelGrid grid;
  Nm plane;
};

Bed bed_for(Kind kind) {
  if (kind == Kind::kOnCentres) return {{{254, 6'000'000}, {508, 5'000'000}}, 500'000};
  if (kind == Kind::kHuge) return {{{120, 2'147'000'000}, {150, 2'147'000'000}}, 1'000'000'007};
  return {{{1200, 30'000'000}, {600, 25'000'000}}, 1'000'000};
}

Point3 corner_of(Kind kind, const Bed& bed, const Point3& near, std::mt19937& random) {
  const auto below = [&](std::int64_t limit) { return static_cast<Nm>(random() % static_cast<std::uint64_t>(limit)); };
  switch (kind) {
    case Kind::kOnCentres: return {50'000 + 100'000 * below(58), 25'000 + 50'000 * below(98), 250'000 * below(8)};
    case Kind::kHuge: return {below(2'147'000'000), below(2'147'000'000), below(2'147'000'000)};
    case Kind::kFlat: return {below(30'000'000), below(25'000'000), bed.plane - 10 + below(130)};  // and just beyond what counts as in the plane
    case Kind::kAlongRows: return {below(30'000'000), near.y + below(90'000), below(2'000'000)};
    case Kind::kUpright: return {near.x + below(2), below(25'000'000), below(2'000'000)};
    case Kind::kNear: {  // ends within a nanometre or so of row centres, crossings of column centres
      const std::int64_t row = below(bed.grid.rows() - 1), column = below(bed.grid.columns() - 1);
      return {static_cast<Nm>(bed.grid.x.centre(column)) - 1 + below(3), static_cast<Nm>(bed.grid.y.centre(row)) - 1 + below(3),
              bed.plane + (random() % 2 == 0 ? 0 : kPlaneReach) + below(6) - 3};
    }
    case Kind::kAny: break;
  }
  return {below(30'000'000), below(25'000'000), below(2'000'000)};
}

/// Unconnected facets, in the frame of a mesh that is placed at the offset.
Mesh random_facets(Kind kind, const Bed& bed, const Point3& offset, unsigned seed, std::uint32_t count) {
  std::mt19937 random(seed);
  Triangles facets;
  for (std::uint32_t i = 0; i < count; ++i) {
    const Point3 near{static_cast<Nm>(random() % 29'000'000), static_cast<Nm>(random() % 24'000'000), 0};
    const auto corner = [&] {
      const Point3 p = corner_of(kind, bed, near, random);
      return Point3{p.x - offset.x, p.y - offset.y, p.z - offset.z};
    };
    const Point3 a = corner(), b = corner(), c = corner();
    facets.push_back({a, b, c});
  }
  return make_mesh(facets);
}

/// The same corners, but each is the first of one facet, the second of another and the third of another again: blocks store
/// vertices once.
Mesh as_strip(const Mesh& apart) {
  std::vector<Point3> corners;
  for (const Triangle& t : apart.triangles) corners.insert(corners.end(), {t.a, t.b, t.c});
  Triangles facets;
  for (std::size_t i = 0; i < apart.triangles.size(); ++i) facets.push_back({corners[i], corners[i + 1], corners[i + 2]});
  return make_mesh(facets);
}

/// Clusters on a bed that they do not leave, as parts at one place: instances take turns, where there are two.
struct PlacedClusters {
  Point3 offset;
  raster::ClusteredMesh mesh;
  std::vector<raster::PlacedMesh> placed;
  raster::ClusterVisits visits;

  PlacedClusters(Kind kind, const Bed& bed, unsigned seed, std::uint32_t clusters, bool strip, std::uint32_t instances)
      : offset(seed % 2 == 0 ? Point3{0, 0, 0} : Point3{1'234'567, 7'654'321, 111'111}),
        mesh(clusters_of(random_facets(kind, bed, offset, seed, clusters * kClusterSize), strip)),
        placed(instances, {&mesh, offset}) {
    EXPECT_EQ(mesh.blocks->indexed(0).cluster != nullptr, strip);
    for (std::uint32_t i = 0; i < mesh.cluster_count(); ++i) {
      for (std::uint32_t k = 0; k < placed.size(); ++k) visits.push_back({i, (i / 3 + k) % instances});
    }
  }

  static raster::ClusteredMesh clusters_of(Mesh facets, bool strip) {
    if (strip) facets = as_strip(facets);
    return raster::make_clusters({&facets, 1}).front();
  }
};

Segments cut(const Kernels& kernels, const raster::PixelSampling& sampling, const PlacedClusters& part, Nm plane,
             std::array<std::uint32_t, 2> rows) {
  Segments segments;
  raster::cut_clusters({kernels, sampling, part.placed, plane, rows[0], rows[1]}, part.visits, segments);
  return segments;
}

/// Crossings, sorted: of each the row, the column and whether it enters, from the highest bits to the lowest.
using Crossings = std::vector<std::uint64_t>;

std::uint64_t crossing_at(std::int64_t row, std::int64_t column, bool enters) {
  return static_cast<std::uint64_t>(row) << 32 | static_cast<std::uint64_t>(column) << 1 | (enters ? 1 : 0);
}

/// Facet by facet and row by row, in integers alone.
Crossings exact_crossings(const raster::PixelSampling& sampling, const PlacedClusters& part, Nm plane,
                          std::array<std::uint32_t, 2> rows) {
  Crossings all;
  const std::uint32_t facets = part.mesh.cluster_count() * kClusterSize;
  for (std::uint32_t i = 0; i < facets * part.placed.size(); ++i) {
    const ExactTriangle t = raster::exact_triangle({i % facets, i / facets}, part.placed, plane);
    std::vector<std::int64_t> ends;
    const Point3 corners[] = {t.a, t.b, t.c, t.a};
    for (int k = 0; k < 3; ++k) {
      if ((corners[k].z > plane) == (corners[k + 1].z > plane)) continue;
      ends.push_back(raster::exact_row(sampling.y, corners[k], corners[k + 1], plane));
    }
    if (ends.empty()) continue;
    const auto [first, last] = std::minmax(ends[0], ends[1]);
    for (std::int64_t row = std::max<std::int64_t>(first, rows[0]); row < std::min<std::int64_t>(last, rows[1]); ++row) {
      const std::int64_t column =
          raster::exact_column(sampling.x, t, sampling.row_centre[static_cast<std::size_t>(row)], plane);
      all.push_back(crossing_at(row, column, t.nx < 0));
    }
  }
  std::sort(all.begin(), all.end());
  return all;
}

Crossings filled(const Kernels& kernels, const raster::PixelSampling& sampling, const PlacedClusters& part,
                 const Segments& segments, Nm plane, std::array<std::uint32_t, 2> rows) {
  const std::uint32_t count = rows[1] - rows[0];
  std::vector<std::uint32_t> position(count), in_row(count);
  for (std::size_t i = 0; i < segments.size; ++i) {
    for (std::uint32_t row = segments.rows[i].first; row < segments.rows[i].end(); ++row) ++in_row[row - rows[0]];
  }
  std::uint32_t total = 0;
  for (std::uint32_t row = 0; row < count; ++row) {
    position[row] = total;
    total += in_row[row];
  }
  std::vector<std::uint32_t> crossing(total, UINT32_MAX);
  kernels.fill({sampling, segments, part.placed, plane, rows[0], position.data(), crossing.data()});
  Crossings all;
  for (std::uint32_t row = 0, i = 0; row < count; ++row) {
    EXPECT_EQ(position[row], i + in_row[row]) << "row " << row;
    for (; i < position[row]; ++i) all.push_back(crossing_at(row + rows[0], crossing[i] >> 1, (crossing[i] & 1) != 0));
  }
  std::sort(all.begin(), all.end());
  return all;
}

template <class T>
void expect_same_bits(const Buffer<T>& a, const Buffer<T>& b, std::size_t size, const char* what) {
  EXPECT_EQ(std::memcmp(a.data(), b.data(), size * sizeof(T)), 0) << what;
}

TEST(Kernels, CutAndFillAsIntegersDoAndWithTheSameBitsInEveryBody) {
  for (Kind kind : kKinds) {
    const Bed bed = bed_for(kind);
    const raster::PixelSampling sampling(bed.grid);
    const std::uint32_t rows = bed.grid.rows();
    std::size_t crossings = 0;
    // One kind has few crossings: more facets than are found at a time, of two blocks.
    const unsigned seeds = kind == Kind::kAlongRows ? 7 : 6;
    for (unsigned seed = 0; seed < seeds; ++seed) {
      const std::uint32_t clusters = seed < 2 ? 1 : seed < 6 ? 12 : 300;
      const PlacedClusters part(kind, bed, seed, clusters, seed >= 4, seed == 4 || seed == 5 ? 2 : 1);
      for (const std::array<std::uint32_t, 2> band : {std::array{0u, rows}, std::array{rows / 3, rows / 3 + rows / 5}}) {
        const Crossings expected = exact_crossings(sampling, part, bed.plane, band);
        const Segments plain = cut(raster::kernels_for(Isa::kPlain), sampling, part, bed.plane, band);
        crossings += expected.size();
        for (Isa isa : isas_here()) {
          SCOPED_TRACE(testing::Message() << isa_name(isa) << ", kind " << static_cast<int>(kind) << ", seed " << seed);
          const Kernels& kernels = raster::kernels_for(isa);
          const Segments segments = cut(kernels, sampling, part, bed.plane, band);
          ASSERT_EQ(segments.size, plain.size);
          expect_same_bits(segments.column, plain.column, plain.size, "columns");
          expect_same_bits(segments.columns_per_nm, plain.columns_per_nm, plain.size, "slopes");
          expect_same_bits(segments.rows, plain.rows, plain.size, "rows");
          expect_same_bits(segments.origin, plain.origin, plain.size, "origins");
          ASSERT_TRUE(filled(kernels, sampling, part, segments, bed.plane, band) == expected);
        }
      }
    }
    EXPECT_GT(crossings, 100u) << "kind " << static_cast<int>(kind);
  }
}

TEST(Kernels, RowsAreWhatSortingAndTheRuleSay) {
  std::mt19937 random(3);
  constexpr std::uint32_t kSizes[] = {0,  1,  2,  3,  4,  5,  6,  7,  8,   9,   12,  15,  16,  17,  24,  31,  32,
                                      33, 40, 48, 63, 64, 65, 66, 96, 127, 128, 129, 200, 255, 256, 300, 513, 1000};
  for (int turn = 0; turn < 6; ++turn) {
    // Directions that alternate in the order of columns, all different; any directions; columns that meet.
    std::vector<std::uint32_t> crossing, end;
    for (std::uint32_t size : kSizes) {
      std::vector<std::uint32_t> row(size);
      std::uint32_t column = 0, direction = random() % 2;
      for (std::uint32_t& one : row) {
        column += static_cast<std::uint32_t>(turn == 0 ? 1 : turn < 4 ? 1 + random() % 100 : random() % 3);
        direction = turn < 3 ? direction ^ 1 : random() % 2;
        one = column * 2 + direction;
      }
      if (turn % 3 == 2) {  // a part inside another, each in order: every other crossing, then the rest
        std::vector<std::uint32_t> apart;
        for (std::size_t first : {0u, 1u}) {
          for (std::size_t i = first; i < row.size(); i += 2) apart.push_back(row[i]);
        }
        row = std::move(apart);
      } else {
        std::shuffle(row.begin(), row.end(), random);
      }
      crossing.insert(crossing.end(), row.begin(), row.end());
      end.push_back(static_cast<std::uint32_t>(crossing.size()));
    }
    for (FillRule rule : {FillRule::kNonzero, FillRule::kPositive, FillRule::kEvenOdd}) {
      std::vector<std::uint32_t> expected, expected_end;
      for (std::size_t r = end.size(); r-- > 0;) {
        std::vector<std::uint32_t> row(crossing.begin() + (r == 0 ? 0 : end[r - 1]), crossing.begin() + end[r]);
        std::ranges::sort(row);
        // What lies between two neighbouring columns that differ is solid or not; runs stay pairs.
        std::vector<std::uint32_t> changes;
        std::int32_t winding = 0;
        for (std::size_t i = 0; i < row.size(); ++i) {
          winding += (row[i] & 1) != 0 ? 1 : -1;
          if (i + 1 < row.size() && row[i] >> 1 == row[i + 1] >> 1) continue;
          if (is_solid(rule, winding) != (changes.size() % 2 == 1)) changes.push_back(row[i] >> 1);
        }
        changes.resize(changes.size() / 2 * 2);
        expected.insert(expected.end(), changes.begin(), changes.end());
        expected_end.push_back(static_cast<std::uint32_t>(expected.size()));
      }
      for (Isa isa : isas_here()) {
        SCOPED_TRACE(testing::Message() << isa_name(isa) << ", turn " << turn << ", rule " << static_cast<int>(rule));
        std::vector<std::uint32_t> rows = crossing, changes(crossing.size() + raster::RowsTask::kMoreCrossings),
                                   row_end(end.size());
        rows.resize(crossing.size() + raster::RowsTask::kMoreCrossings);
        const std::uint32_t* const last =
            raster::kernels_for(isa).rows({rows.data(), end.data(), static_cast<std::uint32_t>(end.size()), rule,
                                           changes.data(), changes.data(), row_end.data()});
        changes.resize(static_cast<std::size_t>(last - changes.data()));
        ASSERT_EQ(row_end, expected_end);
        ASSERT_EQ(changes, expected);
      }
    }
  }
}

}  // namespace
}  // namespace lamina::test
