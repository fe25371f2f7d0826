#include "pipeline/batch/shares.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>
#include <optional>
#include <random>
#include <set>
#include <thread>

#include "stages/support/io/journal.h"
#include "tests/commands/program.h"

namespace lamina::pipeline {
namespace {

/// Costs over three orders of magnitude, of jobs of some parts in random order; loads up to the mean of these.
std::vector<CostedJob> random_jobs(std::mt19937& random, std::size_t count, std::uint32_t parts) {
  std::uniform_real_distribution<> exponent(0, 3);
  std::uniform_int_distribution<std::uint32_t> part(0, parts - 1), load(0, 150'000);
  std::vector<CostedJob> jobs(count);
  for (CostedJob& job : jobs) {
    job = {static_cast<std::uint64_t>(1000 * std::pow(10, exponent(random))), {1, part(random)}};
    job.load = load(random) / (1 + job.part.low);
  }
  return jobs;
}

/// By the rule: the largest load of each part that a share has, once, and the costs of the jobs.
std::vector<std::uint64_t> sums_of(const std::vector<CostedJob>& jobs, const std::vector<DividedJob>& divided,
                                   std::uint32_t count) {
  std::vector<std::uint64_t> sums(count);
  std::map<std::uint64_t, std::uint64_t> loads;
  std::set<std::pair<std::uint64_t, std::uint32_t>> loaded;
  for (const CostedJob& job : jobs) loads[job.part.low] = std::max(loads[job.part.low], job.load);
  for (std::size_t i = 0; i < jobs.size(); ++i) {
    const bool first = loaded.emplace(jobs[i].part.low, divided[i].share).second;
    const std::uint64_t cost = jobs[i].cost + (first ? loads[jobs[i].part.low] : 0);
    EXPECT_EQ(divided[i].cost, cost) << i;
    sums.at(divided[i].share - 1) += cost;
  }
  return sums;
}

std::vector<std::uint32_t> shares_of(const std::vector<DividedJob>& divided) {
  std::vector<std::uint32_t> shares;
  for (const DividedJob& job : divided) shares.push_back(job.share);
  return shares;
}

double mean_of(const std::vector<std::uint64_t>& sums) {
  return static_cast<double>(std::accumulate(sums.begin(), sums.end(), std::uint64_t{0})) / static_cast<double>(sums.size());
}

TEST(Shares, WithoutLargeJobsTheLongestShareIsUpTo105PercentOfTheMean) {
  std::mt19937 random(7);
  int counted = 0;
  for (int round = 0; round < 400; ++round) {
    const auto parts = static_cast<std::uint32_t>(1 + random() % 300), count = static_cast<std::uint32_t>(1 + random() % 40);
    const std::vector<CostedJob> jobs = random_jobs(random, 1 + random() % 4000, parts);
    const std::vector<std::uint64_t> sums = sums_of(jobs, divide_jobs(jobs, count), count);
    const auto whole = [](const CostedJob& job) { return job.cost + 150'000; };
    const double mean = mean_of(sums), largest = static_cast<double>(whole(std::ranges::max(jobs, {}, whole)));
    if (largest > 0.05 * mean) continue;
    ++counted;
    EXPECT_LE(static_cast<double>(std::ranges::max(sums)), 1.05 * mean) << jobs.size() << " jobs, " << count << " shares";
  }
  EXPECT_GT(counted, 100);
}

TEST(Shares, TenThousandJobsInTwentySharesAreBalanced) {
  std::mt19937 random(20);
  const std::vector<CostedJob> jobs = random_jobs(random, 10'000, 200);
  const std::vector<std::uint64_t> sums = sums_of(jobs, divide_jobs(jobs, 20), 20);
  EXPECT_LE(static_cast<double>(std::ranges::max(sums)), 1.05 * mean_of(sums));
  EXPECT_EQ(divide_jobs(jobs, 20), divide_jobs(jobs, 20));
}

TEST(Shares, APartOfUpToATwentiethOfAShareIsInOneShare) {
  std::vector<CostedJob> jobs;
  for (std::uint32_t round = 0; round < 4; ++round) {
    for (std::uint32_t part = 0; part < 160; ++part) jobs.push_back({100, {0, part + 1}});
  }
  const std::vector<std::uint32_t> shares = shares_of(divide_jobs(jobs, 8));  // 160 parts in 8 shares: each is 1/20 of a share
  for (std::size_t i = 160; i < jobs.size(); ++i) EXPECT_EQ(shares[i], shares[i - 160]);
  EXPECT_EQ(std::set<std::uint32_t>(shares.begin(), shares.end()).size(), 8u);
}

TEST(Shares, DearPiecesComeFirstAndEqualOnesByNumber) {
  // Hand-calculated: 9 goes to share 1, 7 to share 2, 5 to 2 (7 < 9), 4 to 1 (9 < 12), 2 to 2 (12 < 13).
  const std::vector<CostedJob> jobs = {{2, {0, 1}}, {9, {0, 2}}, {5, {0, 3}}, {7, {0, 4}}, {4, {0, 5}}};
  EXPECT_EQ(shares_of(divide_jobs(jobs, 2)), (std::vector<std::uint32_t>{2, 1, 2, 2, 1}));
  const std::vector<CostedJob> equal(5, {1, {}});
  EXPECT_EQ(shares_of(divide_jobs(equal, 3)), (std::vector<std::uint32_t>{1, 2, 3, 1, 2}));
  EXPECT_EQ(shares_of(divide_jobs(equal, 1)), std::vector<std::uint32_t>(5, 1));
  EXPECT_EQ(divide_jobs({}, 3), std::vector<DividedJob>());
}

TEST(Shares, APartIsLoadedAgainWhereThatIsCheaperThanToWait) {
  // Hand-calculated, 2 shares: loading takes 10, each of 3 jobs 4; a piece is one job. The first goes to share 1 (14). The
  // second would end at 18 there, at 14 in share 2, which loads the part as well; the third ends at 18 in share 1.
  std::vector<CostedJob> jobs(3, {4, {0, 1}, 10});
  EXPECT_EQ(divide_jobs(jobs, 2), (std::vector<DividedJob>{{1, 14}, {2, 14}, {1, 4}}));
  // A job of another part, the dearest, is in share 1 (21). The three end at 14, 18 and 22 in share 2, not at 35 in share 1.
  jobs.push_back({20, {0, 2}, 1});
  EXPECT_EQ(divide_jobs(jobs, 2), (std::vector<DividedJob>{{2, 14}, {2, 4}, {2, 4}, {1, 21}}));
  jobs.assign(6, {4, {0, 1}, 10});
  EXPECT_EQ(sums_of(jobs, divide_jobs(jobs, 2), 2), (std::vector<std::uint64_t>{22, 22}));
}

TEST(Shares, CostGrowsWithTheFilesAndTheLayersAndNamesOfOneFileAreOnePart) {
  const test::Directory directory;
  test::write_text(directory / "small.stl", std::string(100'000, 'x'));
  test::write_text(directory / "large.stl", std::string(900'000, 'x'));
  test::write_text(directory / "job.toml", "x");
  FileCosts costs;
  const auto cost_of = [&](std::vector<std::string> inputs, double layer_mm) {
    Call call;
    call.inputs = std::move(inputs);
    call.layer_mm = layer_mm;
    return costs.of(call);
  };
  const CostedJob small = cost_of({directory / "small.stl"}, 0.1), large = cost_of({directory / "large.stl"}, 0.1);
  EXPECT_GT(large.cost, 5 * small.cost);
  EXPECT_EQ(cost_of({directory / "small.stl"}, 0.05).cost, 2 * small.cost);
  EXPECT_NE(small.part, large.part);
  EXPECT_EQ(cost_of({"600", directory / "job.toml", directory / "./small.stl", directory / "large.stl"}, 0.1).part, small.part);
  EXPECT_EQ(cost_of({"nowhere.stl"}, 0).part, Hash128());
  EXPECT_GT(cost_of({}, 0).cost, 0u);
  EXPECT_LE(cost_of({directory / "large.stl"}, 1e-6).cost, kMaxJobCost);
}

SharePlan plan_of(const std::vector<std::string>& words, std::uint32_t shares, const std::vector<std::string>& with = {"jet"}) {
  std::vector<BatchJob> jobs;
  for (const std::string& word : words) {
    BatchJob& job = jobs.emplace_back();
    job.number = static_cast<std::uint32_t>(jobs.size());
    job.entry = {"list.txt:" + std::to_string(jobs.size()), word, std::vector<std::string>{"jet", word}};
    job.output = word;
  }
  return plan_shares(jobs, std::vector<CostedJob>(jobs.size()), shares, with, "test");
}

TEST(Shares, ThePlanIsReadAsItWasWrittenAndAnyChangedByteIsDamage) {
  const test::Directory directory;
  const std::string out = directory.path().string();
  const SharePlan plan = plan_of({"a", "b\tc", "d"}, 2, {"jet", "--dpi", "6\n00"});
  const auto agreed = agree_on_plan(out, plan, false);
  ASSERT_TRUE(agreed);
  const auto read = read_plan(out);
  ASSERT_TRUE(read) << read.error().message;
  EXPECT_EQ(read->costs(), (std::vector<std::uint64_t>{2, 1}));
  EXPECT_EQ(read->with, plan.with);
  EXPECT_EQ(read->generation, agreed->generation);
  ASSERT_EQ(read->jobs.size(), 3u);
  EXPECT_EQ(read->jobs[1].source, "list.txt:2");
  const std::string text = test::read_text(plan_path(out));
  for (std::size_t i = 0; i < text.size(); i += 3) {
    std::string other = text;
    other[i] = other[i] == '1' ? '2' : '1';
    test::write_text(plan_path(out), other);
    const auto damaged = read_plan(out);
    ASSERT_FALSE(damaged) << i;
    EXPECT_EQ(damaged.error().fault, Fault::kVerification);
    EXPECT_NE(damaged.error().message.find("shares.tsv: is damaged"), std::string::npos) << damaged.error().message;
    test::write_text(plan_path(out), text.substr(0, i));
    EXPECT_FALSE(read_plan(out)) << i;
  }
  test::write_text(plan_path(out), "");
  EXPECT_EQ(agree_on_plan(out, plan, false).error().fault, Fault::kVerification);
  EXPECT_TRUE(agree_on_plan(out, plan, true));
  EXPECT_EQ(read_plan(out)->jobs.size(), 3u);
}

TEST(Shares, APlanThatDiffersIsRefusedWithTheFirstDifference) {
  const test::Directory directory;
  const std::string out = directory.path().string();
  ASSERT_TRUE(agree_on_plan(out, plan_of({"a", "b", "c"}, 2), false));
  EXPECT_TRUE(agree_on_plan(out, plan_of({"a", "b", "c"}, 2), false));
  SharePlan older = plan_of({"a", "b", "c"}, 2);
  older.version = "0.0.1";
  const std::pair<SharePlan, std::string> cases[] = {
      {plan_of({"a", "b", "c"}, 3), "divides the batch into 2 shares, not 3"},
      {plan_of({"a", "b", "c"}, 2, {"slice"}), "the shares have --with [\"jet\"], not [\"slice\"]"},
      {older, "a worker of another version"},
      {plan_of({"a", "x", "y"}, 2), "list.txt:2: job 2 differs from"},
      {plan_of({"a", "b", "c", "d"}, 2), "list.txt:4: job 4 is not in"},
      {plan_of({"a", "b"}, 2), "list.txt:3: job 3 is missing; it is in"}};
  for (const auto& [plan, reported] : cases) {
    const auto agreed = agree_on_plan(out, plan, false);
    ASSERT_FALSE(agreed) << reported;
    EXPECT_EQ(agreed.error().fault, Fault::kUsage);
    EXPECT_NE(agreed.error().message.find(reported), std::string::npos) << agreed.error().message;
    EXPECT_NE(agreed.error().message.find("shares.tsv"), std::string::npos) << agreed.error().message;
  }
  const auto replaced = agree_on_plan(out, plan_of({"x"}, 3), true);
  ASSERT_TRUE(replaced);
  EXPECT_EQ(read_plan(out)->shares, 3u);
}

TEST(Shares, ManyProcessesThatStartTogetherAgreeOnOnePlan) {
  const test::Directory directory;
  const std::string out = directory.path().string();
  const SharePlan plan = plan_of({"a", "b", "c"}, 2);
  std::vector<std::optional<Result<SharePlan>>> agreed(48);
  std::vector<std::thread> processes;
  for (auto& result : agreed) processes.emplace_back([&] { result.emplace(agree_on_plan(out, plan, false)); });
  for (std::thread& process : processes) process.join();
  const Hash128 generation = read_plan(out)->generation;
  for (const auto& result : agreed) {
    ASSERT_TRUE(*result) << result->error().message;
    EXPECT_EQ((*result)->generation, generation);
  }
}

TEST(Shares, OfAMergedBatchAFileGoesOnceTheShareThatHoldsItEnds) {
  const test::Directory directory;
  const std::string out = directory.path().string(), record = directory / "batch-1-of-2.jsonl";
  test::write_text(record, "{}\n");
  for (const char* name : {"shares.tsv.lamina-aaaaaaaaaaaaa.part", "summary-1-of-2.json.lamina-aaaaaaaaaaaaa.part",
                           "batch.jsonl", "other.lamina-aaaaaaaaaaaaa.part"})
    test::write_text(directory / name, "");
  std::optional<Result<Journal>> held(Journal::open(record, "is held"));
  ASSERT_TRUE(*held);
  EXPECT_FALSE(remove_shares(out));
  std::thread share([&] {
    std::this_thread::sleep_for(std::chrono::milliseconds(300));
    held.reset();
  });
  const Status removed = remove_merged_shares(out);
  share.join();
  EXPECT_TRUE(removed) << removed.error().message;
  EXPECT_EQ(test::files_below(directory.path()), (std::vector<std::string>{"batch.jsonl", "other.lamina-aaaaaaaaaaaaa.part"}));
  // Shares that are planned again meanwhile stay.
  test::write_text(record, "{}\n");
  ASSERT_TRUE(agree_on_plan(out, plan_of({"a"}, 2), false));
  EXPECT_TRUE(remove_merged_shares(out));
  EXPECT_TRUE(has_shares(out));
}

TEST(Shares, FilesOfABatchAreRecognizedByName) {
  for (const char* name : {"batch.jsonl", "summary.json", "summary.tsv.part", "shares.tsv", "batch-1-of-2.jsonl",
                           "summary-10-of-1000.tsv", "summary-1-of-1.json.part"})
    EXPECT_TRUE(is_batch_file(name)) << name;
  for (const char* name : {"batch", "batch-1-of-2", "batch-3-of-2.jsonl", "batch-a-of-2.jsonl", "batch--of-.jsonl",
                           "batch-.jsonl", "batch-1-of-2.json", "summary-1.json", "part", "shares.tsv2"})
    EXPECT_FALSE(is_batch_file(name)) << name;
}

}  // namespace
}  // namespace lamina::pipeline
