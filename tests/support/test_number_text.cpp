#include <gtest/gtest.h>

#include <random>

#include "stages/support/text/number_text.h"
#include "stages/support/text/readable.h"
#include "stages/support/text/value.h"

namespace lamina::pipeline {
namespace {

TEST(NumberText, OnlyWholeFiniteTextsAreNumbers) {
  double value = -7;
  for (const char* text : {"",     " ",  "nan", "NaN",  "-nan", "inf", "-inf", "infinity", "1e999", "1,5",
                           "12mm", " 1", "1 ",  "0x10", "+1",   "--1", "1e",   ".",        "1_000", "1\n"}) {
    EXPECT_FALSE(read_number(text, -1e300, 1e300, "", value).empty()) << '\'' << text << '\'';
    EXPECT_EQ(value, -7) << text;
  }
  for (const auto& [text, right] : {std::pair{"1", 1.0}, {"-0", 0.0}, {".5", 0.5}, {"5.", 5.0}, {"1e-3", 1e-3}}) {
    EXPECT_EQ(read_number(text, -10, 10, "", value), "") << text;
    EXPECT_EQ(value, right) << text;
    EXPECT_FALSE(std::signbit(value) && value == 0) << "-0 would write another job than 0";
  }
}

TEST(NumberText, LimitsAreInclusiveAndReported) {
  double value = 0;
  EXPECT_EQ(read_number("2", 2, 3, " mm", value), "");
  EXPECT_EQ(read_number("3", 2, 3, " mm", value), "");
  EXPECT_NE(read_number("3.0001", 2, 3, " mm", value).find("from 2 to 3 mm"), std::string::npos);
}

TEST(NumberText, WrittenNumbersReadBackAsTheSameBits) {
  std::mt19937_64 random(1);
  std::uniform_real_distribution<double> exponent(-9, 9);
  for (int i = 0; i < 10'000; ++i) {
    const double value = std::pow(10, exponent(random));
    double back = 0;
    ASSERT_EQ(read_number(number_text(value), 0, 1e10, "", back), "");
    ASSERT_EQ(back, value);
  }
}

TEST(NumberText, WholeNumbersMayBeWrittenAsDecimalsButHaveNoFraction) {
  std::int64_t value = 0;
  EXPECT_EQ(read_whole("600.0", 1, 1000, value), "");
  EXPECT_EQ(value, 600);
  EXPECT_NE(read_whole("600.5", 1, 1000, value), "");
  EXPECT_NE(read_whole("1e30", 1, 1000, value), "");
  EXPECT_NE(read_whole("0", 1, 1000, value), "");
}

TEST(NumberText, PairsTakeAnXOrACommaAndTriplesMayBeOneNumber) {
  std::array<double, 2> pair{};
  const Limits limits{0, 1000};
  EXPECT_EQ(read_value("490x380", limits, pair), "");
  EXPECT_EQ(pair, (std::array<double, 2>{490, 380}));
  EXPECT_EQ(read_value("1,2.5", limits, pair), "");
  EXPECT_EQ(pair, (std::array<double, 2>{1, 2.5}));
  for (const char* text : {"490", "1x2x3", "x", "1x", "x1", "1xnan", ""}) {
    EXPECT_NE(read_value(text, limits, pair), "") << text;
  }
  std::array<double, 3> triple{};
  EXPECT_EQ(read_value("2", {0, 9, "", true}, triple), "");
  EXPECT_EQ(triple, (std::array<double, 3>{2, 2, 2}));
  EXPECT_NE(read_value("2", {0, 9, "", false}, triple), "");
  EXPECT_NE(read_value("1,2", {0, 9, "", true}, triple), "");
}

TEST(NumberText, BytesTakeBinarySuffixes) {
  const std::pair<const char*, std::uint64_t> sizes[] = {
      {"1", 1}, {"1K", 1024}, {"256M", 256u << 20}, {"1G", 1u << 30}, {"1g", 1u << 30}, {"1.5GiB", 3ull << 29}, {"7B", 7}};
  for (const auto& [text, right] : sizes) {
    std::uint64_t bytes = 0;
    EXPECT_EQ(read_bytes(text, bytes), "") << text;
    EXPECT_EQ(bytes, right) << text;
  }
  std::uint64_t bytes = 0;
  for (const char* text : {"", "0", "-1", "G", "nan", "infG", "1T", "1GG", "1e99"}) {
    EXPECT_NE(read_bytes(text, bytes), "") << text;
  }
}

TEST(NumberText, LayerRangesMayBeOpen) {
  std::array<std::uint32_t, 2> range{};
  EXPECT_EQ(read_layer_range("3:7", range), "");
  EXPECT_EQ(range, (std::array<std::uint32_t, 2>{3, 7}));
  EXPECT_EQ(read_layer_range(":7", range), "");
  EXPECT_EQ(range, (std::array<std::uint32_t, 2>{0, 7}));
  EXPECT_EQ(read_layer_range("3:", range), "");
  EXPECT_EQ(range, (std::array<std::uint32_t, 2>{3, UINT32_MAX}));
  for (const char* text : {"", "3", "7:3", "3:3", "-1:3", "a:b", "1:2:3", "0:4294967296", "1.5:3"}) {
    EXPECT_NE(read_layer_range(text, range), "") << text;
  }
}

TEST(NumberText, ShardsCountFromOne) {
  std::array<std::uint32_t, 2> shard{};
  EXPECT_EQ(read_shard("1/4", shard), "");
  EXPECT_EQ(shard, (std::array<std::uint32_t, 2>{0, 4}));
  EXPECT_EQ(read_shard("4/4", shard), "");
  EXPECT_EQ(shard, (std::array<std::uint32_t, 2>{3, 4}));
  for (const char* text : {"0/4", "5/4", "1", "1/0", "1/2/3", "/", "-1/4"}) EXPECT_NE(read_shard(text, shard), "") << text;
}

TEST(NearestName, MistypedNamesFindTheirOriginalAndNonsenseFindsNothing) {
  const std::vector<std::string_view> known = {"--dpi", "--layer", "--layers", "--overwrite"};
  EXPECT_NE(suggest("--dip", known).find("'--dpi'"), std::string::npos);
  EXPECT_NE(suggest("--overwirte", known).find("'--overwrite'"), std::string::npos);
  EXPECT_EQ(suggest("--frobnicate-everything", known), "");
  EXPECT_EQ(suggest(std::string(1'000'000, 'x'), known), "");
}

}  // namespace
}  // namespace lamina::pipeline
