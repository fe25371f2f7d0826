// tests/commands/test_nest_orders.cpp: what builds and parts cost, parts that are added to a build, builds that are filled.
#include <gtest/gtest.h>
#include <signal.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <thread>

#include "tests/commands/nesting.h"
#include "tests/load/archives.h"

namespace lamina::test {
namespace {

constexpr const char* kPrices =
    "[cost]\nhour_price = 30\nbinder_price_l = 200\npowder_price_kg = 50\npowder_kg_l = 4.5\npowder_reuse = 0.9\n[powder]\nbase_layers = 7\n";

std::size_t column_of(const CsvCells& table, const std::string& name) {
  return static_cast<std::size_t>(std::ranges::find(table[0], name) - table[0].begin());
}

std::int64_t cents_of(const std::string& text) { return std::llround(std::stod(text) * 100); }

/// The sum of a column of prices, of the lines of a build or of all.
std::int64_t sum_of(const CsvCells& table, const std::string& column, const std::string& build = "") {
  std::int64_t sum = 0;
  for (std::size_t i = 1; i < table.size(); ++i)
    if (build.empty() || table[i].at(column_of(table, "build")) == build)
      sum += cents_of(table[i].at(column_of(table, column)));
  return sum;
}

class NestOrders : public Nesting {
 protected:
  void SetUp() override {
    Nesting::SetUp();
    write_text(folder_ / "prices.toml", kPrices);
    write_text(folder_ / "orders.csv", "file,copies,order\nbar.stl,14,1001\ncube.stl,30,1002\n");
  }
};

// The estimate from 64 layers, next to the run of all.
TEST_F(NestOrders, PricesAddUpAndAreThoseOfTheRun) {
  const Outcome made = run("nest orders.csv --machine nuferbj --preset prices.toml -o week --json --quiet");
  ASSERT_EQ(made.code, 0) << made.err;
  const auto json = nlohmann::json::parse(made.out);
  const CsvCells orders = cells_of(text("week/orders.csv"));
  ASSERT_GE(json.at("builds").size(), 1u);
  std::int64_t of_json = 0;
  for (const auto& price : json.at("prices")) of_json += std::llround(price.at("price").get<double>() * 100);
  EXPECT_EQ(sum_of(orders, "price_EUR"), of_json);
  for (std::size_t b = 1; b <= json.at("builds").size(); ++b) {
    const std::string folder = "week/build-" + std::to_string(b);
    const auto& use = json.at("builds")[b - 1].at("use");
    const std::int64_t whole = std::llround(use.at("cost").get<double>() * 100);
    EXPECT_EQ(sum_of(cells_of(text(folder + "/parts.csv")), "price_EUR"), whole);
    EXPECT_EQ(sum_of(orders, "price_EUR", std::to_string(b)), whole);
    const Outcome run_of_all = run("jet --job " + folder + "/plate.toml --dry-run --json --quiet");
    ASSERT_EQ(run_of_all.code, 0) << run_of_all.err;
    const auto exact = nlohmann::json::parse(run_of_all.out).at("use");
    EXPECT_EQ(use.at("powder_fed_mm3"), exact.at("powder_fed_mm3"));
    for (const char* name : {"print_seconds", "binder_mm3", "powder_bound_mm3", "cost"})
      EXPECT_NEAR(use.at(name).get<double>() / exact.at(name).get<double>(), 1, 0.02) << name;
  }
  // Equal copies in one build pay the same: hours, binder and powder are each divided in whole hundredths.
  const CsvCells parts = cells_of(text("week/build-1/parts.csv"));
  std::map<std::string, std::pair<std::int64_t, std::int64_t>> prices;
  for (std::size_t i = 1; i < parts.size(); ++i) {
    const std::int64_t cents = cents_of(parts[i].at(column_of(parts, "price_EUR")));
    auto& [low, high] = prices.try_emplace(parts[i][4], cents, cents).first->second;
    low = std::min(low, cents), high = std::max(high, cents);
  }
  EXPECT_EQ(prices.size(), 2u) << "of two files";
  for (const auto& [file, price] : prices) EXPECT_LE(price.second - price.first, 3) << file;
}

TEST_F(NestOrders, QuotesWriteNothing) {
  const Outcome made = run("nest orders.csv --machine nuferbj --preset prices.toml --quote-density 10");
  ASSERT_EQ(made.code, 0) << made.err;
  EXPECT_NE(made.err.find("1002, cube.stl: "), std::string::npos) << made.err;
  EXPECT_NE(made.err.find("at 10 %"), std::string::npos) << made.err;
  EXPECT_EQ(run("nest orders.csv --machine nuferbj --quote").code, 0) << "without prices";
  for (const auto& entry : std::filesystem::directory_iterator(folder_.path()))
    EXPECT_FALSE(entry.is_directory()) << entry.path();
}

TEST_F(NestOrders, AddedPartsMoveNothing) {
  ASSERT_EQ(run("nest orders.csv --machine nuferbj --preset prices.toml --builds 1 -o week").code, 0);
  const CsvCells before = cells_of(text("week/build-1/parts.csv"));
  write_box(folder_ / "rush.stl", {0, 0, 0}, {4, 3, 2});
  const Outcome made = run("nest --add rush.stl --copies 2 --into week/build-1");
  ASSERT_EQ(made.code, 0) << made.err;
  const CsvCells after = cells_of(text("week/build-1/parts.csv"));
  ASSERT_EQ(after.size(), before.size() + 2);
  const std::size_t price = column_of(before, "price_EUR");
  for (std::size_t i = 0; i < before.size(); ++i)
    for (std::size_t c = 0; c < price; ++c) EXPECT_EQ(before[i][c], after[i][c]) << i << " " << before[0][c];
  EXPECT_EQ(after.back()[1], "rush-002");
  const CsvCells orders = cells_of(text("week/orders.csv"));
  EXPECT_EQ(orders.back()[column_of(orders, "serials")], "rush-001 rush-002");
  EXPECT_EQ(sum_of(orders, "price_EUR", "1"), sum_of(after, "price_EUR"));
  ASSERT_EQ(run("nest rush.stl --into week/build-1").code, 0);
  const CsvCells third = cells_of(text("week/build-1/parts.csv"));
  EXPECT_EQ(third.back()[1], "rush-003") << "numbers are given once";
  ASSERT_EQ(run("jet --job week/build-1/plate.toml --dry-run --quiet").code, 0);
  // What finds no position changes nothing.
  write_box(folder_ / "plate.stl", {0, 0, 0}, {60, 60, 2});
  const std::string job = text("week/build-1/plate.toml");
  expect_refused("nest --add plate.stl --into week/build-1", 2, "no space in the build; nothing was changed", folder_);
  expect_refused("nest --add rush.stl --into week", 2, "has no plate.toml", folder_);
  expect_refused("nest --add rush.stl", 2, "--into DIR is missing", folder_);
  expect_refused("nest --add rush.stl --into week/build-1 --gap 9", 2, "--gap is that of the build", folder_);
  EXPECT_EQ(text("week/build-1/plate.toml"), job);
}

// The table may have been edited, the build named in another way, and there may be several ways to be wrong.
TEST_F(NestOrders, AddedPartsAreCheckedAgainstTheBuild) {
  write_text(folder_ / "two.csv", "file,copies,order,down,material\nbar.stl,2,A 1,+x,steel\ncube.stl,1,B,,steel\n");
  ASSERT_EQ(run("nest two.csv --bed 200x200 --turns 30 --keep-out 0,0,200,80 -o week").code, 0);
  write_box(folder_ / "rush.stl", {0, 0, 0}, {4, 3, 2});
  ASSERT_EQ(run("nest --add rush.stl --into week/build-1/ --threads 1").code, 0);
  const CsvCells parts = cells_of(text("week/build-1/parts.csv")), orders = cells_of(text("week/orders.csv"));
  ASSERT_EQ(parts.size(), 5u);
  EXPECT_EQ(parts[2][1], "A_1-001") << "serial numbers have no spaces";
  EXPECT_EQ(parts[2][10], "30.000") << "it stands on its end";
  EXPECT_GE(std::stod(parts.back()[6]), 80) << "keep-outs are remembered";
  EXPECT_EQ(orders.back()[column_of(orders, "material")], "steel");
  EXPECT_EQ(orders.back()[column_of(orders, "build")], "1");
  expect_refused("nest --add rush.stl --into week/build-1 --keep-out 0,0,190,190", 2, "reaches into the margin or a keep-out",
                 folder_);
  const std::string list = text("week/build-1/parts.csv");
  write_text(folder_ / "week/build-1/parts.csv", std::string(list).replace(list.find("bar.stl"), 7, "bat.stl"));
  expect_refused("nest --add rush.stl --into week/build-1", 3, "parts.csv:3: is not part 2 of plate.toml", folder_);
}

TEST_F(NestOrders, HighPriorityComesFirstInAnyMaterial) {
  write_text(folder_ / "mixed.csv", "file,copies,priority,material\ncube.stl,3,0,bronze\nbar.stl,3,9,steel\n");
  const Outcome made = run("nest mixed.csv --bed 100x100 --builds 1 --dry-run --json --quiet --fill cube.stl");
  ASSERT_EQ(made.code, 0) << made.err;
  const auto json = nlohmann::json::parse(made.out);
  EXPECT_EQ(json.at("builds")[0].at("material"), "steel");
  EXPECT_GT(json.at("builds")[0].at("parts"), 3) << "and what is left of it is filled";
  EXPECT_EQ(json.at("left_out")[0].at("reason"), "no build of its material in 1 build (--builds)");
  EXPECT_NE(made.err.find("3 of cube.stl: no build of its material"), std::string::npos) << "also without a summary";
}

TEST_F(NestOrders, NothingOfOthersIsReplaced) {
  const std::string table = text("orders.csv");
  expect_refused("nest orders.csv --bed 200x200 -o .", 2, "is read by this call as the order", folder_);
  expect_refused("nest cube.stl --bed 200x200 -o . --overwrite", 2, "is there already, and lamina did not write it", folder_);
  EXPECT_EQ(text("orders.csv"), table);
  ASSERT_EQ(run("nest orders.csv --bed 200x200 -o week").code, 0);
  const std::string job = text("week/build-1/plate.toml"), orders = text("week/orders.csv");
  // A part whose name no job file can hold, and one that fits no build.
  write_box(folder_ / "b\xff.stl", {0, 0, 0}, {4, 3, 2});
  EXPECT_EQ(run("nest b\xff.stl --bed 200x200 -o week --overwrite").code, 2);
  write_box(folder_ / "beam.stl", {0, 0, 0}, {300, 6, 4});
  expect_refused("nest beam.stl --bed 200x200 -o week --overwrite", 3, "no part has a build", folder_);
  EXPECT_EQ(text("week/build-1/plate.toml"), job);
  EXPECT_EQ(text("week/orders.csv"), orders);
  EXPECT_FALSE(std::filesystem::exists(folder_ / "week/.lamina-nest"));
}

TEST_F(NestOrders, AnInterruptedRunLeavesNothing) {
  const auto stop = [&](int process) {
    const auto deadline = std::chrono::steady_clock::now() + std::chrono::seconds(60);
    while (std::chrono::steady_clock::now() < deadline && !std::filesystem::exists(folder_ / "week/.lamina-nest/build-1"))
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    ::kill(process, SIGINT);
  };
  const Outcome made =
      run_lamina(words_of("nest cube.stl --copies 900 --machine nuferbj --threads 1 -o week"), folder_.path(), stop);
  ASSERT_EQ(made.code, 130) << made.err;
  EXPECT_NE(made.err.find("lamina: -o week: interrupted; nothing was written\n"), std::string::npos) << made.err;
  EXPECT_TRUE(std::filesystem::is_empty(folder_ / "week"));
}

TEST_F(NestOrders, FillersTakeWhatIsLeftOfTheBuilds) {
  const auto builds = [&](const std::string& options) {
    const Outcome made = run("nest " + options + " --machine nuferbj --dry-run --json --quiet");
    EXPECT_EQ(made.code, 0) << made.err;
    return nlohmann::json::parse(made.out);
  };
  const auto alone = builds("orders.csv"), filled = builds("orders.csv --fill cube.stl");
  ASSERT_EQ(alone.at("builds").size(), filled.at("builds").size());
  EXPECT_GT(filled.at("copies"), alone.at("copies"));
  EXPECT_TRUE(filled.at("left_out").empty());
  write_box(folder_ / "large.stl", {0, 0, 0}, {40, 40, 2});
  EXPECT_EQ(builds("orders.csv --fill large.stl").at("builds").size(), alone.at("builds").size()) << "orders come first";
  const auto one = builds("--fill cube.stl"), many = builds("cube.stl --copies 999 --builds 1");
  ASSERT_EQ(one.at("builds").size(), 1u);
  EXPECT_EQ(one.at("builds")[0].at("parts"), many.at("builds")[0].at("parts"));
}

TEST_F(NestOrders, OneBuildIsArrangedAndPrintedAtOnce) {
  const Outcome made = run("jet --nest bar.stl cube.stl --copies 6 --machine nuferbj --layer 0.5 --json --quiet -o out");
  ASSERT_EQ(made.code, 0) << made.err;
  EXPECT_EQ(nlohmann::json::parse(made.out).at("parts").size(), 12u);
  expect_refused("jet --nest cube.stl --copies 90 --machine nuferbj -o two", 2, "parts fit the first of", folder_);
  expect_refused("jet --nest cube.stl --at 10,10 --copies 2 --machine nuferbj -o two", 2, "give one copy a position", folder_);
  EXPECT_EQ(run("extrude --nest cube.stl --copies 4 -o part.gcode --quiet").code, 0);
}

TEST_F(NestOrders, ArchivesAreReadAsFolders) {
  const std::string bar = text("bar.stl"), cube = text("cube.stl");
  write_text(folder_ / "order.zip", zip({{"orders.csv", "file,copies\nsub/Bar.STL,2\ncube.stl,3\n"},
                                         {"sub/Bar.STL", bar},
                                         {"cube.stl", cube},
                                         {"readme.txt", "hello"}}));
  ASSERT_EQ(run("nest order.zip --bed 200x200 -o week").code, 0);
  EXPECT_EQ(text("week/parts/sub/Bar.STL"), bar);
  EXPECT_FALSE(std::filesystem::exists(folder_ / "week/parts/readme.txt"));
  EXPECT_EQ(cells_of(text("week/build-1/parts.csv")).size(), 6u);
  EXPECT_EQ(run("export --job week/build-1/plate.toml -o all.3mf --quiet").code, 0);
  write_text(folder_ / "out.zip", zip({{"../cube.stl", cube}}));
  expect_refused("nest out.zip --bed 200x200 -o other", 3, "leads out of its folder", folder_);
  write_text(folder_ / "mac.zip",
             zip({{"cube.stl", cube}, {"__MACOSX/._cube.stl", "x"}, {"o.csv", "file\ncube.stl\n"}, {"__MACOSX/._o.csv", "x"}}));
  EXPECT_EQ(run("nest mac.zip --bed 200x200 --dry-run").code, 0);
  write_text(folder_ / "away.zip", zip({{"cube.stl", cube}, {"o.csv", "file\n" + (folder_ / "bar.stl") + "\n"}}));
  expect_refused("nest away.zip --bed 200x200 --dry-run", 2, "is not in the archive", folder_);
  write_text(folder_ / "none.zip", zip({{"readme.txt", "hello"}}));
  expect_refused("nest none.zip --bed 200x200 -o other", 3, "holds no STL, OBJ, 3MF or CSV file", folder_);
  EXPECT_FALSE(std::filesystem::exists(folder_ / "other"));
}

}  // namespace
}  // namespace lamina::test
