// tests/load/test_diagnose.cpp: diagnose() compared with one that uses ordered maps.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <random>
#include <set>
#include <tuple>

#include "stages/load/diagnosis/sound_survey.h"
#include "stages/load/repair/diagnose.h"
#include "stages/load/repair/geometry.h"

namespace lamina {
namespace {

using Walk = std::pair<std::uint32_t, bool>;  // a facet, and whether it goes from the lower point to the higher
using Positions = std::vector<std::pair<std::uint32_t, Point3>>;

struct SlowKind {
  std::vector<std::tuple<std::uint32_t, Point3, Point3>> all;
  Positions first(std::size_t maximum) {
    std::sort(all.begin(), all.end());
    Positions positions;
    for (const auto& [triangle, p, q] : all)
      if (positions.size() < maximum) positions.push_back({triangle, {(p.x + q.x) / 2, (p.y + q.y) / 2, (p.z + q.z) / 2}});
    return positions;
  }
};

struct SlowDiagnosis {
  SlowKind open, non_manifold, misoriented, duplicate;
  std::size_t vertices = 0, edges = 0, shells = 0;
  bool balanced = true;
};

bool uses_a_point_twice(const Triangle& t) { return t.a == t.b || t.b == t.c || t.c == t.a; }

/// The corners from the least on; of those that use a point twice, in order.
std::array<Point3, 3> turned(const Triangle& t) {
  std::array<Point3, 3> corners{t.a, t.b, t.c};
  if (uses_a_point_twice(t))
    std::sort(corners.begin(), corners.end());
  else
    std::rotate(corners.begin(), std::min_element(corners.begin(), corners.end()), corners.end());
  return corners;
}

/// with_shells  takes time as the square of the triangles
SlowDiagnosis slow(const std::vector<Triangle>& triangles, bool with_shells = true) {
  SlowDiagnosis result;
  std::set<Point3> points;
  std::set<std::array<Point3, 3>> detected;
  std::map<std::pair<Point3, Point3>, std::vector<Walk>> edges;
  std::vector<std::uint32_t> shell(triangles.size());
  for (std::uint32_t i = 0; i < triangles.size(); ++i) {
    const Triangle& t = triangles[i];
    shell[i] = i;
    points.insert({t.a, t.b, t.c});
    if (!detected.insert(turned(t)).second) result.duplicate.all.push_back({i, t.a, t.a});
    if (uses_a_point_twice(t)) continue;
    for (const auto& [p, q] : {std::pair{t.a, t.b}, {t.b, t.c}, {t.c, t.a}}) edges[std::minmax(p, q)].push_back({i, p < q});
  }
  result.vertices = points.size(), result.edges = edges.size();
  for (const auto& [edge, walks] : edges) {
    int surplus = 0;
    for (const Walk& walk : walks) surplus += walk.second ? 1 : -1;
    result.balanced = result.balanced && surplus == 0;
    const std::tuple position{walks[0].first, edge.first, edge.second};
    if (walks.size() == 1) result.open.all.push_back(position);
    if (walks.size() > 2) result.non_manifold.all.push_back(position);
    if (walks.size() == 2 && surplus != 0) result.misoriented.all.push_back(position);
    for (const Walk& walk : walks) {
      if (!with_shells) break;
      const std::uint32_t from = shell[walk.first], to = shell[walks[0].first];
      for (std::uint32_t& number : shell) number = number == from ? to : number;
    }
  }
  std::set<std::uint32_t> shells;
  for (std::uint32_t i = 0; i < triangles.size(); ++i)
    if (!uses_a_point_twice(triangles[i])) shells.insert(shell[i]);
  result.shells = shells.size();
  return result;
}

Positions positions_of(const load::Diagnosis::Finding& finding) {
  Positions positions;
  for (const auto& position : finding.first) positions.push_back({position.triangle, position.at});
  return positions;
}

/// Facets between points of a small lattice, so that everything that may be wrong with a mesh is.
TEST(Diagnose, FindsInFacetsAtRandomWhatOrderedMapsFind) {
  std::mt19937 random(5);
  for (int round = 0; round < 60; ++round) {
    const auto side = static_cast<unsigned>(2 + random() % 4), count = static_cast<unsigned>(1 + random() % 200);
    const auto coordinate = [&] { return static_cast<Nm>(1000 * (random() % side)) - 1000; };
    const auto point = [&] { return Point3{coordinate(), coordinate(), coordinate()}; };
    std::vector<Triangle> triangles;
    for (unsigned i = 0; i < count; ++i) {
      const Triangle t{point(), point(), point()};
      triangles.push_back(t);
      if (random() % 3 == 0) triangles.push_back({t.b, t.c, t.a});
      if (random() % 3 == 0) triangles.push_back({t.c, t.b, t.a});
    }
    Mesh mesh;
    mesh.triangles.assign(triangles.begin(), triangles.end());
    SlowDiagnosis expected = slow(triangles);
    const load::Diagnosis found = load::diagnose(mesh, 4);
    EXPECT_EQ(found.vertices, expected.vertices);
    EXPECT_EQ(found.edges, expected.edges);
    EXPECT_EQ(found.shells, expected.shells);
    EXPECT_EQ(found.balanced, expected.balanced);
    for (auto [finding, kind] : {std::pair{&found.open_edges, &expected.open},
                                 {&found.non_manifold_edges, &expected.non_manifold},
                                 {&found.misoriented_edges, &expected.misoriented},
                                 {&found.duplicate_facets, &expected.duplicate}}) {
      EXPECT_EQ(finding->count, kind->all.size()) << round;
      EXPECT_EQ(positions_of(*finding), kind->first(4)) << round;
    }
    const load::Diagnosis alone = load::diagnose_alone(mesh, 4);
    EXPECT_EQ(positions_of(alone.open_edges), positions_of(found.open_edges));
    EXPECT_EQ(positions_of(alone.duplicate_facets), positions_of(found.duplicate_facets));
    EXPECT_EQ(alone.volume_mm3, found.volume_mm3);
    EXPECT_EQ(alone.shells_apart, found.shells_apart);
    if (alone.shells_apart) triangles.clear();
    EXPECT_TRUE(std::ranges::equal(mesh.triangles, triangles)) << round;
  }
}

void take_bounds(Mesh& mesh) {
  for (const Triangle& t : mesh.triangles)
    for (const Point3& corner : {t.a, t.b, t.c}) mesh.bounds.add(corner);
}

/// Lists of more than one task processes, whose memory goes back piece by piece; in the order of the mesh and in none.
TEST(Diagnose, InTheMemoryOfTheListFindsTheSameAndGivesItBackWhereShellsMayOverlap) {
  std::mt19937 random(3);
  for (const auto& [rise, shuffled] : {std::pair{0, false}, {5, false}, {0, true}, {5, true}}) {
    Mesh mesh;
    for (Nm i = 0; i < 50'000; ++i) {  // tetrahedra side by side, or each a little higher within the next one's box
      const Nm x = rise == 0 ? 20 * i : i, z = rise * i;
      const Point3 p{x, 0, z}, q{x + 10, 0, z}, r{x, 10, z}, s{x, 0, z + 10};
      for (const Triangle& t : {Triangle{p, r, q}, {p, q, s}, {q, r, s}, {r, p, s}}) mesh.triangles.push_back(t);
    }
    if (shuffled) std::shuffle(mesh.triangles.begin(), mesh.triangles.end(), random);
    take_bounds(mesh);
    const Buffer<Triangle> list = mesh.triangles;
    const load::Diagnosis found = load::diagnose(mesh), alone = load::diagnose_alone(mesh);
    EXPECT_EQ(found.shells, 50'000u);
    EXPECT_EQ(alone.shells, found.shells);
    EXPECT_EQ(alone.edges, found.edges);
    EXPECT_EQ(alone.vertices, found.vertices);
    EXPECT_EQ(alone.volume_mm3, found.volume_mm3);
    EXPECT_EQ(alone.shells_apart, rise == 0);
    EXPECT_TRUE(rise == 0 ? mesh.triangles.empty() : std::ranges::equal(mesh.triangles, list));
  }
}

/// A torus, strip after strip: several chunks, most of whose edges lie within one.
std::vector<Triangle> torus_in_order(int around, int across) {
  const auto point = [&](int i, int j) {
    const double u = 6.283185307179586 * (i % around) / around, v = 6.283185307179586 * (j % across) / across;
    const double r = 20e6 + 5e6 * std::cos(v);
    return Point3{static_cast<Nm>(r * std::cos(u)), static_cast<Nm>(r * std::sin(u)), static_cast<Nm>(5e6 * std::sin(v))};
  };
  std::vector<Triangle> triangles;
  for (int i = 0; i < around; ++i) {
    for (int j = 0; j < across; ++j) {
      const Point3 a = point(i, j), b = point(i + 1, j), c = point(i + 1, j + 1), d = point(i, j + 1);
      triangles.push_back({a, b, c});
      triangles.push_back({a, c, d});
    }
  }
  return triangles;
}

load::Diagnosis diagnosis_of(const std::vector<Triangle>& triangles) {
  Mesh mesh;
  mesh.triangles.assign(triangles.begin(), triangles.end());
  take_bounds(mesh);
  return load::diagnose(mesh, 50);
}

void expect_same_counts(const load::Diagnosis& one, const load::Diagnosis& other) {
  EXPECT_EQ(one.vertices, other.vertices);
  EXPECT_EQ(one.edges, other.edges);
  EXPECT_EQ(one.shells, other.shells);
  EXPECT_EQ(one.inverted_shells, other.inverted_shells);
  EXPECT_EQ(one.volume_mm3, other.volume_mm3);
  EXPECT_EQ(one.outward_mm3, other.outward_mm3);
  EXPECT_EQ(one.shells_apart, other.shells_apart);
  EXPECT_EQ(one.shell_ends, other.shell_ends);
  EXPECT_EQ(one.balanced, other.balanced);
  EXPECT_EQ(one.bounds.lo, other.bounds.lo);
  EXPECT_EQ(one.bounds.hi, other.bounds.hi);
  for (const auto kind : {&load::Diagnosis::open_edges, &load::Diagnosis::non_manifold_edges,
                          &load::Diagnosis::misoriented_edges, &load::Diagnosis::duplicate_facets})
    EXPECT_EQ((one.*kind).count, (other.*kind).count);
}

/// The first of what is wrong, in the order of the list.
void expect_positions(const load::Diagnosis& found, const std::vector<Triangle>& list) {
  SlowDiagnosis expected = slow(list, false);
  EXPECT_EQ(positions_of(found.open_edges), expected.open.first(50));
  EXPECT_EQ(positions_of(found.non_manifold_edges), expected.non_manifold.first(50));
  EXPECT_EQ(positions_of(found.misoriented_edges), expected.misoriented.first(50));
  EXPECT_EQ(positions_of(found.duplicate_facets), expected.duplicate.first(50));
}

/// Facets of a list in no order are processed in a spatial one.
TEST(Diagnose, ListsInAnyOrderFindTheSame) {
  std::mt19937 random(8);
  for (int faults = 0; faults < 3; ++faults) {
    std::vector<Triangle> triangles = torus_in_order(250, 40);
    for (int i = 0; i < 40 * faults; ++i) {
      const auto any = [&] { return static_cast<std::size_t>(random() % triangles.size()); };
      const std::size_t at = any(), near = std::min(at + random() % 3, triangles.size() - 1);
      switch (random() % 5) {
        case 0: std::swap(triangles[at].b, triangles[at].c); break;
        case 1: triangles[at] = triangles[near]; break;
        case 2: triangles[at].b = triangles[any()].a; break;
        case 3: triangles[at].b = triangles[at].a; break;
        default: triangles.push_back(triangles[at]); break;  // a chunk elsewhere has its edges too
      }
    }
    const load::Diagnosis in_order = diagnosis_of(triangles);
    EXPECT_EQ(in_order.balanced, faults == 0);
    std::vector<Triangle> shuffled = triangles;
    std::shuffle(shuffled.begin(), shuffled.end(), random);
    expect_same_counts(in_order, diagnosis_of(shuffled));
    expect_positions(in_order, triangles);
    expect_positions(diagnosis_of(shuffled), shuffled);
  }
}

constexpr std::size_t kChunk = 4096;

std::optional<load::Diagnosis> survey_of(std::span<const Triangle> list) {
  load::SoundSurvey survey;
  for (std::size_t first = 0; first < list.size(); first += kChunk)
    if (!survey.inspect(list.subspan(first, std::min(kChunk, list.size() - first)))) return std::nullopt;
  return survey.finish();
}

std::vector<Triangle> moved(std::vector<Triangle> list, Point3 by) {
  for (Triangle& t : list)
    for (Point3* p : {&t.a, &t.b, &t.c}) *p = {p->x + by.x, p->y + by.y, p->z + by.z};
  return list;
}

std::vector<Triangle> joined(std::vector<Triangle> list, const std::vector<Triangle>& more) {
  list.insert(list.end(), more.begin(), more.end());
  return list;
}

TEST(SoundSurvey, SaysOfSoundMeshesWhatDiagnosisSays) {
  std::mt19937 random(9);
  std::vector<Triangle> list = torus_in_order(250, 40);
  const load::Diagnosis alone = diagnosis_of(list);
  ASSERT_GT(alone.volume_mm3, 0);
  const auto wide = static_cast<Nm>(alone.bounds.width() + 1000);
  list = joined(list, moved(torus_in_order(100, 20), {wide, 0, 0}));
  list.push_back({list[7].a, list[7].b, list[7].a});  // without area, in no shell
  std::vector<Triangle> shuffled = list;
  std::shuffle(shuffled.begin(), shuffled.end(), random);
  const load::Diagnosis expected = diagnosis_of(list);
  EXPECT_EQ(expected.shells, 2u);
  for (const std::vector<Triangle>& one : {list, shuffled}) {
    const std::optional<load::Diagnosis> found = survey_of(one);
    ASSERT_TRUE(found);
    expect_same_counts(expected, *found);
    EXPECT_EQ(found->volume_mm3, expected.volume_mm3);
    EXPECT_EQ(found->outward_mm3, expected.outward_mm3);
    EXPECT_EQ(found->shells_apart, expected.shells_apart);
    EXPECT_EQ(found->shell_ends, expected.shell_ends);
  }
}

TEST(SoundSurvey, TakesNoMeshWithAFaultForSound) {
  std::mt19937 random(10);
  const std::vector<Triangle> torus = torus_in_order(250, 40);
  for (int run = 0; run < 60; ++run) {
    std::vector<Triangle> list = torus;
    const std::size_t at = random() % list.size();
    switch (run % 5) {
      case 0: std::swap(list[at].b, list[at].c); break;
      case 1: list.erase(list.begin() + static_cast<std::ptrdiff_t>(at)); break;
      case 2: list.push_back(list[at]); break;
      case 3: list.push_back({list[at].a, list[at].c, list[at].b}); break;
      default: list.insert(list.end(), 2, {list[at].a, list[at].b, list[at].a}); break;
    }
    if (run % 2 == 1) std::shuffle(list.begin(), list.end(), random);
    EXPECT_FALSE(survey_of(list)) << run;
  }
  std::vector<Triangle> inside_out = torus;
  for (Triangle& t : inside_out) std::swap(t.b, t.c);
  EXPECT_FALSE(survey_of(inside_out));
  EXPECT_FALSE(survey_of(joined(torus, moved(inside_out, {400'000'000, 0, 0}))));
  EXPECT_FALSE(survey_of(std::vector<Triangle>{{{0, 0, 0}, {5, 0, 0}, {0, 5, 5}}, {{0, 0, 0}, {0, 5, 5}, {5, 0, 0}}}));
}

/// Each of two tetrahedra is sound; together an edge has four sides, of which each chunk has two that fit.
TEST(SoundSurvey, DetectsAnEdgeOfFourSidesThatIsClosedInTwoChunks) {
  const Point3 p{0, 0, 0}, q{0, 0, 9000};
  const auto tetrahedron = [&](Point3 r, Point3 s) {
    return std::vector<Triangle>{{p, r, q}, {p, q, s}, {q, r, s}, {p, s, r}};
  };
  const std::vector<Triangle> one = tetrahedron({9000, 0, 0}, {0, 9000, 0}), other = tetrahedron({-9000, 0, 0}, {0, -9000, 0});
  const std::vector<Triangle> torus = moved(torus_in_order(250, 40), {400'000'000, 0, 0});
  ASSERT_TRUE(survey_of(torus));
  for (const auto& each : {one, other}) ASSERT_TRUE(survey_of(joined(each, torus)));
  EXPECT_FALSE(survey_of(joined(one, other)));
  EXPECT_FALSE(survey_of(joined(joined(one, torus), other)));
  // The first two facets of each meet at the edge, whose ends are on the rim of their chunk.
  for (const Nm apart : {0, 50'000}) {
    const std::vector<Triangle> far = moved(other, {-apart, 0, 0});
    load::SoundSurvey survey;
    for (const std::vector<Triangle>& each : {one, far})
      for (const std::size_t first : {0, 2}) ASSERT_TRUE(survey.inspect(std::span(each).subspan(first, 2)));
    EXPECT_EQ(survey.finish().has_value(), apart > 0);
  }
}

/// Where the numbers of a normal begin to need more than 64 bits.
TEST(Diagnose, AreasAndVolumesOfTheLargestFacetsAreExact) {
  constexpr Nm kHigh = 2'147'000'000;
  for (const Nm lo : {-kHigh, 0, 300'000'000}) {
    const Triangle t{{lo, lo, 0}, {kHigh, lo, 1}, {lo, kHigh, -1}};
    const load::Int128 side = load::Int128{kHigh} - lo;
    EXPECT_TRUE(load::doubled_area(t) == (std::array<load::Int128, 3>{-side, side, side * side})) << lo;
    EXPECT_TRUE(load::has_area(t));
    EXPECT_FALSE(load::has_area({t.a, t.b, t.a}));
    EXPECT_TRUE(load::sixfold_volume(t, {lo, lo, -kHigh}) == side * side * kHigh) << lo;
  }
}

/// A strip of steps that is longer than what one task processes, and a fan whose middle is in all of its facets.
TEST(Diagnose, StripsAndFansOfManyFacetsAreOneShell) {
  Mesh strip, fan;
  constexpr Nm kFacets = 60'000;
  for (Nm i = 0; i < kFacets; ++i) {
    const Point3 p{i, i % 2, 0}, q{i + 1, (i + 1) % 2, 0}, r{i + 2, i % 2, 0};
    strip.triangles.push_back(i % 2 == 0 ? Triangle{p, q, r} : Triangle{q, p, r});
    fan.triangles.push_back({{0, 0, 1000}, {i, 1, 0}, {i + 1, 1, 0}});
  }
  load::Diagnosis found = load::diagnose(strip);
  EXPECT_EQ(found.shells, 1u);
  EXPECT_EQ(found.vertices, kFacets + 2u);
  EXPECT_EQ(found.edges, 2u * kFacets + 1);
  EXPECT_EQ(found.open_edges.count, kFacets + 2u);
  EXPECT_EQ(found.misoriented_edges.count, 0u);
  found = load::diagnose(fan);
  EXPECT_EQ(found.shells, 1u);
  EXPECT_EQ(found.open_edges.count, kFacets + 2u);
  EXPECT_EQ(found.misoriented_edges.count + found.non_manifold_edges.count, 0u);
}

}  // namespace
}  // namespace lamina
