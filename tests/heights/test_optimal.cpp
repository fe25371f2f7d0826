// The best table, against all tables there are.
#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <algorithm>
#include <array>
#include <random>
#include <tuple>
#include <utility>

#include "tests/heights/surfaces.h"

namespace lamina::heights {
namespace {

using test::range_of;
using test::set_of;

// What a table is judged by, in this order.
struct Verdict {
  std::int64_t largest_miss = 0, missed = 0;
  double cost = 0;
  auto operator<=>(const Verdict&) const = default;
};

struct Facet {
  std::int64_t lo, hi;
  Steepness steepness;
};

// Every stack of thicknesses, by trying each; the rules are those of the header, told again.
class Enumeration {
 public:
  Enumeration(const SurfaceIndex& index, const Options& options, std::int64_t hit, bool measure = false)
      : index_(index), options_(options), top_(index.top), hit_(hit), measure_(measure) {
    for (const PartSurface& part : index.parts) {
      for_each_slope(index, part, 0, 1, [&](Nm lo, Nm hi, Steepness steepness, double) {
        facets_.push_back({lo, hi, steepness});
      });
    }
    if (options.flats) {
      for (const Flat& flat : find_flats(index, options.surface.flat_tolerance, options.min_flat_mm2)) {
        flats_.push_back(flat.height);
      }
    }
    grow();
  }
  Verdict best() const { return best_; }
  std::uint64_t tables() const { return tables_; }
  /// nm, of the best tables; of none if they are not measured
  double min_mean_cusp() const { return min_mean_cusp_; }

 private:
  bool allowed(std::int64_t bottom, Nm thickness) const {
    if (thickness == options_.set.minimum()) return true;
    return std::ranges::none_of(facets_, [&](const Facet& facet) {
      return facet.lo < bottom + thickness && facet.hi > bottom && cusp_of(thickness, facet.steepness) > options_.cusp;
    });
  }
  void check() {
    ++tables_;
    Verdict verdict;
    verdict.cost = static_cast<double>(stack_.size()) - 1;
    if (!options_.flats && stack_.back() < top_) return;
    for (const std::int64_t flat : flats_) {
      // The stack ends at the top, so only its end counts there.
      std::int64_t miss = flat == top_ ? std::abs(stack_.back() - top_) : distance_to_nearest(stack_, flat);
      if (miss <= hit_) continue;
      verdict.largest_miss = std::max(verdict.largest_miss, miss);
      verdict.missed += miss;
    }
    const std::pair end{std::abs(stack_.back() - top_), stack_.back()};
    if (measure_ && (!found_ || std::tie(verdict, end) <= std::tie(best_, best_end_))) {
      const double mean = evaluate(index_, stack_, options_).mean_cusp;
      const bool as_good = found_ && std::tie(verdict, end) == std::tie(best_, best_end_);
      min_mean_cusp_ = as_good ? std::min(min_mean_cusp_, mean) : mean;
      best_end_ = end;
    }
    best_ = found_ ? std::min(best_, verdict) : verdict;
    found_ = true;
  }
  void grow() {
    if (stack_.size() > 1) check();
    if (stack_.back() >= top_) return;
    for (const Nm thickness : options_.set.values) {
      if (!allowed(stack_.back(), thickness)) break;
      stack_.push_back(stack_.back() + thickness);
      grow();
      stack_.pop_back();
    }
  }

  const SurfaceIndex& index_;
  const Options& options_;
  std::int64_t top_, hit_;
  bool measure_;
  double min_mean_cusp_ = 0;
  std::pair<std::int64_t, std::int64_t> best_end_;
  std::vector<Facet> facets_;
  std::vector<std::int64_t> flats_, stack_{0};
  Verdict best_;
  bool found_ = false;
  std::uint64_t tables_ = 0;
};

Verdict verdict_of(const SurfaceIndex& index, const Plan& plan, const Options& options, std::int64_t hit) {
  const std::vector<std::int64_t> boundaries = boundaries_of(plan.table);
  Verdict verdict;
  verdict.cost = plan.table.size();
  if (!options.flats) return verdict;
  for (const Flat& flat : find_flats(index, options.surface.flat_tolerance, options.min_flat_mm2)) {
    const std::int64_t miss =
        flat.height == index.top ? std::abs(boundaries.back() - index.top) : distance_to_nearest(boundaries, flat.height);
    if (miss <= hit) continue;
    verdict.largest_miss = std::max(verdict.largest_miss, miss);
    verdict.missed += miss;
  }
  return verdict;
}

class RandomParts {
 public:
  explicit RandomParts(unsigned seed) : random_(seed) {}
  int whole(int low, int high) { return std::uniform_int_distribution<int>(low, high)(random_); }
  /// Slopes, walls and ledges from the bed to a top between 0.5 and 1.6 mm, on heights of whole `grain` um.
  Mesh part(int grain) {
    std::vector<std::pair<double, double>> profile{{0, 0}};
    double x = 0;
    int z = 0;
    const int top = whole(500, 1600) / grain * grain;
    while (z < top) {
      const int kind = whole(0, 2);
      const int rise = std::min(top - z, whole(1, 400 / grain) * grain);
      if (kind == 0) {
        x += whole(1, 3);
        profile.emplace_back(x, z * 1e-3);  // a ledge
      }
      x += kind == 1 ? 0 : whole(0, 1200) * 1e-3;
      z += rise;
      profile.emplace_back(x, z * 1e-3);
    }
    if (whole(0, 1) == 0) profile.emplace_back(x + 2, top * 1e-3);
    return test::strip(profile);
  }
  ThicknessSet set(int grain) {
    ThicknessSet set;
    const int count = whole(1, 4);
    while (static_cast<int>(set.values.size()) < count) {
      const Nm value = whole(std::max(1, 130 / grain), 420 / grain) * grain * 1000;
      if (std::ranges::find(set.values, value) == set.values.end()) set.values.push_back(value);
    }
    std::ranges::sort(set.values);
    return set;
  }

 private:
  std::mt19937 random_;
};

TEST(OptimalHeights, NoTableIsBetterThanTheOneFound) {
  RandomParts random(20241);
  std::uint64_t tables = 0, all_hit = 0, missed = 0, without_flats = 0;
  for (int round = 0; round < 1500; ++round) {
    const int grain = std::array{1, 10, 10, 50}[static_cast<std::size_t>(round % 4)];
    const Mesh mesh = random.part(random.whole(0, 1) == 0 ? grain : 1);
    Options options;
    options.mode = Mode::kOptimal;
    options.set = random.set(grain);
    options.cusp = random.whole(60, 400) * 1000;
    options.flats = random.whole(0, 4) > 0;
    options.min_flat_mm2 = random.whole(0, 1) == 0 ? 1 : 15;
    const SurfaceIndex index = test::index_of(mesh);
    const std::int64_t hit = std::min<std::int64_t>(options.surface.flat_tolerance, options.set.step() / 2);
    const Enumeration all(index, options, hit);
    const Result<Plan> plan = plan_heights(index, options);
    ASSERT_TRUE(plan.ok());
    const Verdict found = verdict_of(index, *plan, options, hit);
    ASSERT_EQ(found.largest_miss, all.best().largest_miss) << "round " << round;
    ASSERT_EQ(found.missed, all.best().missed) << "round " << round;
    ASSERT_EQ(found.cost, all.best().cost) << "round " << round;
    ASSERT_EQ(plan->largest_miss, found.largest_miss) << "round " << round;
    tables += all.tables();
    (options.flats ? found.missed > 0 ? missed : all_hit : without_flats) += 1;
  }
  // Each of the ways through the search was taken often.
  EXPECT_GT(tables, 50'000u);
  EXPECT_GT(all_hit, 50u);
  EXPECT_GT(missed, 100u);
  EXPECT_GT(without_flats, 100u);
}

TEST(OptimalHeights, ThicknessesWithoutACommonStepAreTriedAtEveryHeightTheyReach) {
  RandomParts random(7);
  for (int round = 0; round < 4; ++round) {
    const Mesh mesh = random.part(10);
    Options options;
    options.mode = Mode::kOptimal;
    options.set.values = {150'001 + random.whole(0, 999), 210'013 + random.whole(0, 9999), 333'333};
    options.cusp = random.whole(60, 400) * 1000;
    const SurfaceIndex index = test::index_of(mesh);
    const Result<Plan> plan = plan_heights(index, options);
    ASSERT_TRUE(plan.ok());
    const std::int64_t hit = options.set.step() / 2;
    const Enumeration all(index, options, hit);
    EXPECT_EQ(verdict_of(index, *plan, options, hit), all.best()) << "round " << round;
  }
  // 40 mm of 1 nm steps are too many to list one by one; the sums of two thicknesses are few.
  Options options;
  options.mode = Mode::kOptimal;
  options.set.values = {200'000, 333'333};
  options.cusp = 400'000;
  const SurfaceIndex index = test::index_of(test::strip({{0, 0}, {1, 0}, {1, 40}, {0, 40}}));
  const Result<Plan> plan = plan_heights(index, options);
  ASSERT_TRUE(plan.ok());
  EXPECT_LE(std::abs(plan->table.top() - 40'000'000), 1000);  // 3 of 333333 are nearly 5 of 200000
  EXPECT_EQ(plan->table.size(), 120u);                        // 40 nm short
}

TEST(OptimalHeights, MinTimeWeighsLayersByTheirSection) {
  // A wide foot and a thin mast: a layer of the foot takes far longer.
  const Mesh mesh = test::strip({{0, 0}, {40, 0}, {40, 1}, {2, 1}, {2, 2}, {0, 2}, {0, 0}});
  Options options;
  options.mode = Mode::kOptimal;
  options.set = set_of({0.2, 0.3, 0.5});
  options.cusp = 500'000;
  options.time = {1, 0.1};
  const SurfaceIndex index = test::index_of(mesh);
  const Result<Plan> plan = plan_heights(index, options);
  ASSERT_TRUE(plan.ok());
  const Evaluation evaluation = evaluate(index, boundaries_of(plan->table), options);
  // Two layers of 400 mm2 and two of 20 mm2.
  EXPECT_NEAR(evaluation.seconds, 4 + 0.1 * (2 * 400 + 2 * 20), 1e-6);
  // A slope in the foot forbids thick layers there; the least time then is in as few as it allows.
  options.flats = false;
  const Result<Plan> free = plan_heights(index, options);
  EXPECT_LE(evaluate(index, boundaries_of(free->table), options).seconds, evaluation.seconds);
}

TEST(OptimalHeights, NeverMoreLayersThanTheOtherModesAtTheSameLimit) {
  RandomParts random(99);
  for (int round = 0; round < 300; ++round) {
    const SurfaceIndex index = test::index_of(random.part(1));
    Options options;
    options.set = range_of(0.05, 0.3, 0.001);
    options.cusp = random.whole(50, 200) * 1000;
    options.flats = false;
    std::array<std::uint32_t, 3> layers{};
    for (const Mode mode : {Mode::kOptimal, Mode::kCusp, Mode::kStepwise}) {
      options.mode = mode;
      const Result<Plan> plan = plan_heights(index, options);
      ASSERT_TRUE(plan.ok());
      layers[mode == Mode::kOptimal ? 0 : mode == Mode::kCusp ? 1 : 2] = plan->table.size();
      const Evaluation evaluation = evaluate(index, boundaries_of(plan->table), options);
      for (std::uint32_t i = 0; i < plan->table.size(); ++i) {
        if (plan->table[i].thickness > options.set.minimum()) {
          ASSERT_LE(evaluation.layers[i].cusp, options.cusp) << "way " << int(mode) << ", layer " << i;
        }
      }
    }
    EXPECT_LE(layers[0], layers[1]);
    EXPECT_LE(layers[0], layers[2]);
    // The rule of angles, held to the step that it leaves.
    options.mode = Mode::kAngle;
    const Result<Plan> angle = plan_heights(index, options);
    const Evaluation left = evaluate(index, boundaries_of(angle->table), options);
    if (angle->table.top() < index.top) continue;
    options.mode = Mode::kOptimal;
    options.cusp = static_cast<Nm>(std::max<std::int64_t>(left.largest_cusp, 1));
    EXPECT_LE(plan_heights(index, options)->table.size(), angle->table.size());
  }
}

TEST(OptimalHeights, FlatsThatWobbleAreHitOnce) {
  std::mt19937 random(3);
  Mesh mesh;
  const auto z = [&](double height) { return test::nm(height) + static_cast<Nm>(random() % 900) - 450; };
  for (const double height : {0.7315, 2.2, 5.0}) {
    for (int i = 0; i < 200; ++i) {  // a floor of triangles whose corners are off by up to 0.45 um
      const Nm x = i * 100'000;
      mesh.triangles.push_back({{x, 0, z(height)}, {x + 100'000, 0, z(height)}, {x, 100'000'000, z(height)}});
    }
  }
  mesh.triangles.push_back({{0, 0, 0}, {0, 1'000'000, 0}, {0, 0, test::nm(5)}});
  for (const Triangle& t : mesh.triangles) {
    for (const Point3& p : {t.a, t.b, t.c}) mesh.bounds.add(p);
  }
  Options options;
  options.mode = Mode::kOptimal;
  options.set = range_of(0.05, 0.3, 0.001);
  const SurfaceIndex index = test::index_of(mesh);
  const Result<Plan> plan = plan_heights(index, options);
  const Evaluation evaluation = evaluate(index, boundaries_of(plan->table), options);
  EXPECT_EQ(evaluation.flats.size(), 3u);
  EXPECT_EQ(evaluation.flats_missed, 0u);
  EXPECT_EQ(plan->table.size(), 18u);  // 3 + 5 + 10
}

TEST(OptimalHeights, AmongTheFewestLayersTheMeanStepIsMinimal) {
  // 1 mm of wall, then 0.5 mm of slope that allows 0.3: thin layers belong on the slope.
  Options options;
  options.mode = Mode::kOptimal;
  options.set = set_of({0.2, 0.3});
  options.cusp = 300'000;
  const SurfaceIndex index = test::index_of(test::strip({{0, 0}, {0, 1.2}, {0.5, 1.6}}));
  EXPECT_EQ(test::thicknesses(plan_heights(index, options)->table), (std::vector<double>{0.3, 0.3, 0.3, 0.3, 0.2, 0.2}));
}

TEST(OptimalHeights, OfAllTablesOfTheFewestLayersTheOneFoundHasTheMinimalMeanStep) {
  RandomParts random(5);
  int choices = 0;
  for (int round = 0; round < 250; ++round) {
    const SurfaceIndex index = test::index_of(random.part(round % 2 == 0 ? 10 : 1));
    Options options;
    options.mode = Mode::kOptimal;
    const Nm minimum = random.whole(18, 26) * 10'000, step = random.whole(1, 3) * 10'000;
    for (Nm value = minimum; value <= minimum + 5 * step; value += step) options.set.values.push_back(value);
    options.cusp = random.whole(60, 400) * 1000;
    options.flats = random.whole(0, 2) > 0;
    const std::int64_t hit = std::min<std::int64_t>(options.surface.flat_tolerance, options.set.step() / 2);
    const Enumeration all(index, options, hit, true);
    const Result<Plan> plan = plan_heights(index, options);
    ASSERT_TRUE(plan.ok());
    ASSERT_EQ(verdict_of(index, *plan, options, hit), all.best()) << "round " << round;
    choices += all.best().largest_miss == 0 && options.set.size() > 1;
    EXPECT_NEAR(evaluate(index, boundaries_of(plan->table), options).mean_cusp, all.min_mean_cusp(), 1e-6 * all.min_mean_cusp())
        << "round " << round;
  }
  EXPECT_GT(choices, 40);
}

TEST(OptimalHeights, TableDoesNotDependOnTheNumberOfThreads) {
  const std::string path = test::model("3DBenchy.3mf");
  if (path.empty()) GTEST_SKIP() << "LAMINA_MODELS is not set: no real parts";
  Options options;
  options.mode = Mode::kOptimal;
  options.set = range_of(0.05, 0.3, 0.001);
  std::vector<double> first;
  double mean = 0;
  for (const int threads : {1, 2, 7}) {
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, static_cast<std::size_t>(threads));
    const SurfaceIndex index = test::index_of_file(path);
    const Result<Plan> plan = plan_heights(index, options);
    const Evaluation evaluation = evaluate(index, boundaries_of(plan->table), options);
    if (first.empty()) {
      first = test::thicknesses(plan->table);
      mean = evaluation.mean_cusp;
    }
    EXPECT_EQ(test::thicknesses(plan->table), first) << threads;
    EXPECT_EQ(evaluation.mean_cusp, mean) << threads;
  }
}

TEST(OptimalHeights, RealPartsKeepTheStepAndHitEveryFlat) {
  const std::string path = test::model("");
  if (path.empty()) GTEST_SKIP() << "LAMINA_MODELS is not set: no real parts";
  for (const char* name : {"3DBenchy.3mf", "nist_am_test_artifact_v3b.stl", "fdm_test_kickstarter_autodesk.stl",
                           "stanford_bunny.stl", "am_coin_embossed_text.stl"}) {
    const SurfaceIndex index = test::index_of_file(path + name);
    Options options;
    options.set = range_of(0.05, 0.3, 0.001);
    options.min_flat_mm2 = 5;
    std::array<Evaluation, 2> evaluations;
    std::array<std::uint32_t, 2> layers{};
    for (const Mode mode : {Mode::kOptimal, Mode::kCusp}) {
      options.mode = mode;
      const Result<Plan> plan = plan_heights(index, options);
      ASSERT_TRUE(plan.ok()) << name;
      const std::size_t i = mode == Mode::kOptimal ? 0 : 1;
      layers[i] = plan->table.size();
      evaluations[i] = evaluate(index, boundaries_of(plan->table), options);
      for (std::uint32_t layer = 0; layer < plan->table.size(); ++layer) {
        if (plan->table[layer].thickness == options.set.minimum()) continue;
        EXPECT_LE(evaluations[i].layers[layer].cusp, options.cusp) << name << ", layer " << layer;
      }
    }
    EXPECT_EQ(evaluations[0].flats_missed, 0u) << name;
    EXPECT_LE(std::abs(evaluations[0].top_miss), 500) << name;
    // More layers than greed only for the flats that greed misses.
    EXPECT_LE(layers[0], layers[1] + evaluations[1].flats_missed) << name;
  }
}

}  // namespace
}  // namespace lamina::heights
