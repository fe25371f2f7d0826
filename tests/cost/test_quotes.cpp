// Tables of costs: of a job by hand, from the run, from its files, and in its page; their columns add up.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "pipeline/report/job_cost.h"
#include "stages/cost/cost.h"
#include "stages/data/grid.h"
#include "stages/data/machine.h"
#include "tests/commands/program.h"

namespace lamina::cost {
namespace {

using Rows = std::vector<std::vector<std::string>>;

/// The fields of lines that hold no quotes.
Rows fields_of(const std::string& csv) {
  Rows rows;
  for (std::size_t begin = 0; begin < csv.size();) {
    const std::size_t end = csv.find("\r\n", begin);
    std::vector<std::string>& row = rows.emplace_back();
    for (std::size_t from = begin; from <= end;) {
      const std::size_t comma = std::min(csv.find(',', from), end);
      row.push_back(csv.substr(from, comma - from));
      from = comma + 1;
    }
    begin = end + 2;
  }
  return rows;
}

/// Digits of a decimal number, without the point.
std::int64_t units(const std::string& text) {
  std::string digits = text;
  std::erase(digits, '.');
  return digits.empty() ? 0 : std::stoll(digits);
}

void expect_sums(const Rows& rows) {
  for (std::size_t column = 1; column < rows.front().size(); ++column) {
    std::int64_t sum = 0;
    for (std::size_t r = 1; r + 1 < rows.size(); ++r) sum += units(rows[r][column]);
    EXPECT_EQ(sum, units(rows.back()[column])) << rows.front()[column];
  }
}

/// 100 x 50 mm at 254 dpi: a pixel of a layer of 0.1 mm has 1000 pl, 400 of them void; 64 of 80 pl of a drop stay.
constexpr const char* kPrinter = R"([machine]
name = "printer"
[bed]
size_mm = [100, 50]
build_height_mm = 50
[head]
drop_pl = 80
max_drop_sweeps = 8
[mounting]
dpi = 254
[powder]
dose = 1.5
packing = 0.6
evaporates_percent = 20
)";
constexpr const char* kPrices = R"([cost]
hour_price = 36
binder_price_l = 10000
powder_price_kg = 50
powder_kg_l = 4.5
powder_reuse = 0.9
spit_drops = 20000
)";

class Quotes : public ::testing::Test {
 protected:
  Quotes() {
    test::write_text(directory_ / "free.toml", kPrinter);
    test::write_text(directory_ / "printer.toml", std::string(kPrinter) + kPrices);
    test::write_box(directory_ / "a.stl", {0, 0, 0}, {10, 10, 2});
    test::write_box(directory_ / "b.stl", {0, 0, 0}, {5, 5, 4});
  }
  test::Outcome run(const std::string& line) { return test::run_lamina(test::words_of(line), directory_.path()); }
  Rows table(const std::string& name) { return fields_of(test::read_text(directory_ / name)); }

  test::Directory directory_;
};

// 80 % of 400 pl are 5 drops of which 64 pl stay, 32 % are 2. Within 1 mm of the edge, a of 100 x 100 pixels has a shell of
// 3600 and a core of 6400: 30,800 drops a layer, 616,000 in 20; b of 50 x 50 has 1600 and 900: 9800, 392,000 in 40.
TEST_F(Quotes, AJobOfShellAndCoreByHand) {
  const std::string job = "a.stl b.stl --machine printer.toml --layer 0.1 --saturation 80 --core-saturation 32 --shell 1";
  const test::Outcome outcome = run("jet " + job + " --quote q.csv --json --quiet -o out");
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  const Rows rows = table("q.csv");
  ASSERT_EQ(rows.size(), 4u);
  expect_sums(rows);
  const std::vector<std::string> head = {"part",           "copies",          "volume_mm3",      "pixels",
                                         "drops",          "binder_ml",       "powder_fed_ml",   "powder_bound_ml",
                                         "powder_left_ml", "powder_bound_g",  "hours",           "hours_percent",
                                         "cost_hours_EUR", "cost_binder_EUR", "cost_powder_EUR", "cost_EUR"};
  EXPECT_EQ(rows[0], head);
  const auto cell = [&](std::size_t row, const std::string& name) {
    return rows[row][static_cast<std::size_t>(std::ranges::find(head, name) - head.begin())];
  };
  EXPECT_EQ(cell(1, "volume_mm3"), "200.000");
  EXPECT_EQ(cell(2, "pixels"), "100000");
  EXPECT_EQ(cell(3, "drops"), "1808000");            // 616,000 + 392,000 + 40 x 20,000
  EXPECT_EQ(cell(3, "binder_ml"), "0.144640");       // x 80 pl
  EXPECT_EQ(cell(1, "binder_ml"), "0.088391");       // x 616 / 1008, not the 2 / 3 of its pixels
  EXPECT_EQ(cell(2, "binder_ml"), "0.056249");       // x 392 / 1008
  EXPECT_EQ(cell(1, "powder_fed_ml"), "12.000000");  // 20 layers x 0.75 ml x 10000 / 12500
  EXPECT_EQ(cell(2, "powder_fed_ml"), "18.000000");  // 20 x 0.75 x 2500 / 12500 + 20 x 0.75
  EXPECT_EQ(cell(2, "powder_bound_g"), "0.450");     // 0.1 ml
  EXPECT_EQ(cell(3, "powder_left_ml"), "29.700000");
  EXPECT_EQ(cell(3, "cost_binder_EUR"), "1.45");  // 1.4464
  EXPECT_EQ(cell(3, "cost_powder_EUR"), "0.74");  // (0.3 + 0.1 x 29.7) ml x 225 a litre = 0.73575
  const auto facts = nlohmann::json::parse(outcome.out);
  EXPECT_EQ(units(cell(3, "cost_hours_EUR")), std::llround(facts["print_seconds"].get<double>()));  // 36 an hour: 0.01 a second
  EXPECT_EQ(facts["use"]["drops"], 1'808'000);

  // The same from a dry run, and from the files by what they make the machine do.
  EXPECT_EQ(run("jet " + job + " --quote dry.csv --dry-run --quiet").code, 0);
  EXPECT_EQ(test::read_text(directory_ / "dry.csv"), test::read_text(directory_ / "q.csv"));
  const test::Outcome verified = run("verify out --quote v.csv --json");
  EXPECT_EQ(verified.code, 0) << verified.err;
  EXPECT_EQ(test::read_text(directory_ / "v.csv"), test::read_text(directory_ / "q.csv"));
  EXPECT_EQ(nlohmann::json::parse(verified.out)["use"], facts["use"]);
  EXPECT_EQ(run("report out -o page.html --quiet").code, 0);
  EXPECT_NE(test::read_text(directory_ / "page.html").find("\"b.stl\",\"1\",\"100.000\",\"100000\""), std::string::npos);
}

TEST_F(Quotes, SharesThatContradictTheJobAreFaults) {
  ASSERT_EQ(run("jet a.stl b.stl --machine printer.toml --layer 1 --saturation 80 --allow-unbound --quiet -o out").code, 0);
  std::string manifest = test::read_text(directory_ / "out/manifest.json");
  const std::size_t drops = manifest.find("{\"drops\": ");
  ASSERT_NE(drops, std::string::npos);
  test::write_text(directory_ / "out/manifest.json", manifest.insert(drops + 10, "9"));
  const test::Outcome outcome = run("verify out");
  EXPECT_EQ(outcome.code, 5);
  EXPECT_NE(outcome.err.find("layer 0: its parts have more drops than the"), std::string::npos) << outcome.err;
}

TEST_F(Quotes, AreRefusedWhereNothingIsKnown) {
  EXPECT_NE(run("jet a.stl --layer 1 --quote q.csv -o out").err.find("--quote: reports the material of a machine"),
            std::string::npos);
  EXPECT_EQ(run("jet a.stl --machine free.toml --layer 1 --quote no/q.csv -o out").code, 4);
  test::write_text(directory_ / "mine.csv", "part;mine\n");
  EXPECT_EQ(run("jet a.stl --machine free.toml --layer 1 --quote mine.csv -o out").code, 2);
  EXPECT_EQ(test::read_text(directory_ / "mine.csv"), "part;mine\n");
  EXPECT_EQ(run("verify one two --quote q.csv").code, 2);
}

TEST_F(Quotes, KeptLayersThatSayNothingAreNoTable) {
  const std::string job = "jet a.stl b.stl --machine free.toml --layer 1 --quiet -o out";
  ASSERT_EQ(run(job).code, 0);
  test::expect_refused(job + " --resume --quote q.csv", 2, "4 layers of an earlier run do not say which part", directory_);
  EXPECT_EQ(run(job + " --overwrite --quote q.csv").code, 0);
  EXPECT_EQ(run(job + " --resume --quote again.csv").code, 0);
  EXPECT_EQ(test::read_text(directory_ / "again.csv"), test::read_text(directory_ / "q.csv"));
  // A job of both kinds of layers is reported as such.
  std::string manifest = test::read_text(directory_ / "out/manifest.json");
  const std::size_t list = manifest.find("\"part_pixels\": ["), end = manifest.find("]", list);
  ASSERT_NE(end, std::string::npos);
  const std::size_t comma = manifest.rfind(',', list);
  test::write_text(directory_ / "out/manifest.json", manifest.erase(comma, end + 1 - comma));
  const test::Outcome verified = run("verify out");
  EXPECT_NE(verified.out.find("1 layers do not say whose"), std::string::npos) << verified.out << verified.err;
  EXPECT_EQ(nlohmann::json::parse(run("verify out --json").out)["use"]["unknown_layers"], 1);
}

TEST_F(Quotes, NeverReplaceFilesOfTheJob) {
  const std::string job = "jet a.stl --machine free.toml --layer 1 --quiet --overwrite ";
  ASSERT_EQ(run(job + "-o out").code, 0);
  for (const char* file :
       {"out/manifest.json", "out/program/machine.toml", "out/layers/new.csv", "out/manifest-1-of-2.json.part"}) {
    test::expect_refused(job + "-o out --quote " + file, 2, "is among the files of the job in out", directory_);
    test::expect_refused(std::string("verify out --overwrite --quote ") + file, 2, "", directory_);
  }
  test::expect_refused("verify out/ --quote out/program/new.csv", 2, "is among the files of the job", directory_);
  EXPECT_EQ(run("verify out --quote out/quote.csv").code, 0);
  test::expect_refused("verify out out --quote q.csv", 2, "is of one directory; verify them one by one", directory_);
  test::expect_refused("verify out --quick --quote q.csv", 2, "remove --quick", directory_);
}

TEST_F(Quotes, PartsAreNamedAlikeAndApart) {
  std::filesystem::create_directory(directory_ / "in");
  test::write_box(directory_ / "in/a.stl", {0, 0, 0}, {5, 5, 4});
  ASSERT_EQ(run("jet a.stl in/a.stl --machine printer.toml --layer 1 --quiet --quote q.csv -o out").code, 0);
  ASSERT_EQ(run("verify out --quote v.csv").code, 0);
  EXPECT_EQ(test::read_text(directory_ / "v.csv"), test::read_text(directory_ / "q.csv"));
  EXPECT_EQ(table("q.csv")[1][0], "a.stl");
  EXPECT_EQ(table("q.csv")[2][0], "a.stl (2)");
}

// What is spat by the program is in its drops; what the host spits is added: 4 layers x 20,000.
TEST_F(Quotes, ThePageHasTheRowsOfTheFiles) {
  test::write_text(directory_ / "spits.toml",
                   std::string(kPrinter) + kPrices + "[maintenance]\nspit_layers = 1\nspit_drops = 50\nspit_mm = [-40, 5]\n");
  ASSERT_EQ(run("jet a.stl b.stl --machine spits.toml --layer 1 --quiet --quote q.csv -o out").code, 0);
  const test::Outcome verified = run("verify out --quote v.csv");
  ASSERT_EQ(verified.code, 0) << verified.err;
  EXPECT_NE(verified.out.find("ml of binder with cost.spit_drops, "), std::string::npos) << verified.out;
  const auto spat = nlohmann::json::parse(run("verify out --json").out)["replay"];
  EXPECT_GT(spat["spat_drops"], 0);
  const Rows rows = table("v.csv");
  EXPECT_EQ(rows[3][4], std::to_string(spat["drops"].get<std::int64_t>() + spat["spat_drops"].get<std::int64_t>() + 80'000));
  EXPECT_EQ(table("q.csv"), rows);
  ASSERT_EQ(run("report out -o page.html --quiet").code, 0);
  const std::string page = test::read_text(directory_ / "page.html");
  const std::size_t begin = page.find("[[\"part\",\"copies\""), end = page.find("]]", begin);
  ASSERT_NE(end, std::string::npos);
  EXPECT_EQ(nlohmann::json::parse(page.substr(begin, end + 2 - begin)).get<Rows>(), rows);
}

// Without prices money and grams are empty, and parts are still reported separately.
TEST_F(Quotes, AmountsNeedNoPrices) {
  ASSERT_EQ(run("jet a.stl b.stl --machine free.toml --layer 1 --quote q.csv --dry-run --quiet").code, 0);
  const Rows rows = table("q.csv");
  ASSERT_EQ(rows.size(), 4u);
  expect_sums(rows);
  EXPECT_EQ(rows[1][3], "20000");
  EXPECT_EQ(rows[2][4], "10000");
  for (const std::size_t column : {9u, 12u, 13u, 14u, 15u}) EXPECT_EQ(rows[3][column], "") << column;
}

TEST(QuoteTable, FieldsAreQuotedAndNamesAreNoFormulas) {
  Machine machine;
  machine.cost.currency = "a,b";
  Tally tally(machine, {PixelAxis(254, 10'000'000), PixelAxis(254, 10'000'000)}, 3);
  const std::uint64_t pixels[] = {1, 1, 1};
  tally.add(100'000, 1'000'000, 3, 3, pixels);
  const QuotedPart parts[] = {{"=1+1", 1}, {"a \"b\", c.stl", 2}, {"line\nbreak", 3}};
  const Rows rows = quote_rows(tally.quote(), machine.cost, parts);
  expect_sums(rows);
  EXPECT_EQ(rows[1][0], "./=1+1");
  EXPECT_EQ(rows[4][1], "6");
  const std::string text = csv_text(rows);
  EXPECT_NE(text.find("\r\n\"a \"\"b\"\", c.stl\",2,"), std::string::npos);
  EXPECT_NE(text.find(",\"cost_a,b\"\r\n"), std::string::npos);
  EXPECT_EQ(std::ranges::count(text, '\n'), 5);
}

// A part of half the binder pays half of it, though both have as many pixels.
TEST(QuoteTable, PartsPayForTheirDrops) {
  Machine machine;
  machine.head.drop_pl = 100;
  machine.cost.binder_price_l = 1e6;
  Tally tally(machine, {PixelAxis(254, 100'000'000), PixelAxis(254, 50'000'000)}, 2);
  const std::uint64_t pixels[] = {1'000, 1'000}, drops[] = {4'000, 2'000};
  tally.add(100'000, 2'000'000, 6'000, 2'000, pixels, drops);
  tally.add(100'000, 2'000'000, 3'000, 2'000, pixels);  // drops unknown: as the pixels
  const Quote quote = tally.quote();
  EXPECT_EQ(quote.job.binder_nl, 900);
  EXPECT_EQ(quote.parts[0].drops, 5'500u);
  EXPECT_EQ(quote.parts[0].binder_nl, 550);
  EXPECT_EQ(quote.parts[1].binder_nl, 350);
  EXPECT_EQ(quote.parts[0].binder_cents, 55);
  EXPECT_EQ(quote.parts[1].microseconds, 2'000'000);
  EXPECT_EQ(quote.unknown_layers, 0u);
  tally.add(100'000, 2'000'000, 3'000, 2'000, {});
  EXPECT_EQ(tally.quote().unknown_layers, 1u);
}

}  // namespace
}  // namespace lamina::cost
