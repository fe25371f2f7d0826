// The PNG encoder's own deflate: zlib inflates it to the rows of bits, whatever changes in them.
#include <gtest/gtest.h>
#include <zlib.h>

#include <cstring>

#include "stages/formats/images/image.h"
#include "stages/formats/png/image_data.h"
#include "stages/geometry/bits.h"
#include "tests/formats/images.h"

namespace lamina::formats {
namespace {

using testing::Row;

std::uint32_t big_endian(const Bytes& file, std::size_t at) {
  std::uint32_t value = 0;
  for (std::size_t i = 0; i < 4; ++i) value = value << 8 | static_cast<std::uint32_t>(file[at + i]);
  return value;
}

/// The content of every IDAT chunk of a PNG; checks and order of chunks are looked at on the way.
std::vector<Bytes> image_chunks(const Bytes& file) {
  std::vector<Bytes> chunks;
  std::string names;
  for (std::size_t at = 8; at < file.size();) {
    const std::uint32_t length = big_endian(file, at);
    const std::string name(reinterpret_cast<const char*>(&file[at + 4]), 4);
    if (names.empty() || name != "IDAT" || !names.ends_with("IDAT")) names += name;
    const auto* checked = reinterpret_cast<const Bytef*>(&file[at + 4]);
    EXPECT_EQ(big_endian(file, at + 8 + length), ::crc32(0, checked, length + 4)) << name << " at " << at;
    if (name == "IDAT") chunks.emplace_back(file.begin() + at + 8, file.begin() + at + 8 + length);
    at += 12 + length;
  }
  EXPECT_EQ(names, "IHDRPLTEpHYsIDATIEND");
  return chunks;
}

/// The rows that zlib finds, with its Adler-32, are those of the runs once the filter is taken back.
::testing::AssertionResult holds(const Bytes& file, const RunsView& runs) {
  Bytes stream;
  for (const Bytes& chunk : image_chunks(file)) stream.insert(stream.end(), chunk.begin(), chunk.end());
  const std::size_t stride = row_bytes(runs.columns);
  std::vector<std::byte> filtered((stride + 1) * runs.rows()), row(stride), expected(stride);
  uLongf length = filtered.size();
  const int result = ::uncompress(reinterpret_cast<Bytef*>(filtered.data()), &length,
                                  reinterpret_cast<const Bytef*>(stream.data()), stream.size());
  if (result != Z_OK) return ::testing::AssertionFailure() << "zlib says " << result;
  if (length != filtered.size()) return ::testing::AssertionFailure() << length << " of " << filtered.size() << " bytes";
  for (std::uint32_t r = 0; r < runs.rows(); ++r) {
    const std::byte* here = filtered.data() + r * (stride + 1);
    const int filter = static_cast<int>(here[0]);
    if (filter != 0 && filter != 2) return ::testing::AssertionFailure() << "filter " << filter;
    for (std::size_t i = 0; i < stride; ++i) {
      row[i] = static_cast<std::byte>(static_cast<unsigned>(here[1 + i]) + (filter == 2 ? static_cast<unsigned>(row[i]) : 0));
    }
    expand_row(runs.row(r), expected);
    if (row != expected) return ::testing::AssertionFailure() << "row " << r << " of " << runs.rows() << " differs";
  }
  return ::testing::AssertionSuccess();
}

::testing::AssertionResult holds(const Runs& runs) { return holds(testing::encoded(*find_image_format("png"), runs), runs); }

TEST(PngData, ARunMovesFromAnywhereToAnywhereInThreeBytes) {
  constexpr std::uint32_t kColumns = 22;
  std::vector<Row> runs, rows;
  for (std::uint32_t begin = 0; begin < kColumns; ++begin) {
    for (std::uint32_t end = begin + 1; end <= kColumns; ++end) runs.push_back({begin, end});
  }
  for (const Row& above : runs) {
    for (const Row& below : runs) rows.insert(rows.end(), {above, below});
  }
  EXPECT_TRUE(holds(testing::image_of(kColumns, rows)));
}

TEST(PngData, RandomRowsOfManyWidthsAndDensitiesComeBack) {
  std::mt19937 random(5);
  for (const std::uint32_t columns : {1u, 2u, 8u, 15u, 16u, 17u, 255u, 2063u, 2064u, 2065u, 4725u, 33'333u}) {
    EXPECT_TRUE(holds(testing::random_image(columns, columns, 300))) << columns;
    std::vector<Row> rows;
    for (int r = 0; r < 60; ++r) rows.push_back(testing::random_row(random, columns, r < 20 ? 1 : r < 40 ? 7 : 900));
    EXPECT_TRUE(holds(testing::image_of(columns, rows))) << columns;
  }
}

TEST(PngData, AWallOfEveryThicknessAtEveryPositionComesBack) {
  // Zeros of every number up to two rows: literals, matches, words of zeros alone and with an edge behind them.
  std::vector<Row> rows;
  constexpr std::uint32_t kColumns = 9'700;
  for (std::uint32_t column = 3; column + 8 < kColumns; column += 8) {
    rows.push_back({column, column + 1 + column % 7});
    rows.push_back({column + 1, column + 2 + column % 7});
    if (column % 5 == 0) rows.emplace_back();
  }
  EXPECT_TRUE(holds(testing::image_of(kColumns, rows)));
}

TEST(PngData, TheWidestRowsComeBack) {
  for (const std::uint32_t columns : {262'136u, 262'137u, 262'144u, 262'145u, kMaxPixelsASide}) {
    const Row full{0, columns}, dots{7, 8, 70'000, 70'001, columns - 1, columns}, none;
    EXPECT_TRUE(holds(testing::image_of(columns, {full, full, none, none, dots, dots, full, dots, none}))) << columns;
    EXPECT_TRUE(holds(testing::image_of(columns, {none}))) << columns;
  }
}

TEST(PngData, WhiteAboveBetweenAndBelowCostsABitInAHundredBytes) {
  constexpr std::uint32_t kColumns = 70'000, kRows = 1'000;  // beyond the zeros that are written at once
  for (const std::uint32_t set : {0u, 1u, 500u, kRows - 1, kRows}) {
    std::vector<Row> rows(kRows);
    if (set < kRows) rows[set] = {40'000, 40'007};
    const Runs runs = testing::image_of(kColumns, rows);
    const Bytes file = testing::encoded(*find_image_format("png"), runs);
    EXPECT_TRUE(holds(file, runs)) << set;
    EXPECT_LT(file.size(), 300 + kRows * row_bytes(kColumns) / 1000) << set;
  }
}

TEST(PngData, ARowLikeTheOneAboveAddsNothingButItsFilter) {
  const Row row{100, 2'000, 2'500, 2'501, 4'000, 4'001};
  const std::size_t few =
      testing::encoded(*find_image_format("png"), testing::image_of(4'725, std::vector<Row>(1'000, row))).size();
  const Runs many = testing::image_of(4'725, std::vector<Row>(9'000, row));
  const Bytes file = testing::encoded(*find_image_format("png"), many);
  EXPECT_TRUE(holds(file, many));
  EXPECT_LT(file.size() - few, 8'000 * 4);  // 591 bytes each
}

TEST(PngData, ChunksAreBoundedAndAllButTheLastAreFull) {
  const Runs runs = testing::image_of(20'000, [] {
    std::mt19937 random(9);
    std::vector<Row> rows;
    for (int r = 0; r < 1'500; ++r) rows.push_back(testing::random_row(random, 20'000, 60));
    return rows;
  }());
  const Bytes file = testing::encoded(*find_image_format("png"), runs);
  EXPECT_TRUE(holds(file, runs));
  const std::vector<Bytes> chunks = image_chunks(file);
  ASSERT_GT(chunks.size(), 5u);
  for (const Bytes& chunk : chunks) EXPECT_LT(chunk.size(), png::kChunkBytes + 4'000);
  for (std::size_t i = 0; i + 1 < chunks.size(); ++i) EXPECT_GE(chunks[i].size(), png::kChunkBytes);
}

TEST(PngData, NoiseGrowsLittleBeyondItsBits) {
  std::mt19937 random(3);
  std::vector<Row> rows;
  for (int r = 0; r < 400; ++r) {
    Row row;
    bool before = false;
    for (std::uint32_t column = 0; column < 4'000; ++column) {
      const bool now = random() % 2 == 0;
      if (now != before) row.push_back(column);
      before = now;
    }
    if (before) row.push_back(4'000);
    rows.push_back(row);
  }
  const Runs runs = testing::image_of(4'000, rows);
  const Bytes file = testing::encoded(*find_image_format("png"), runs);
  EXPECT_TRUE(holds(file, runs));
  EXPECT_LT(file.size(), 400 * 500 * 12 / 10);
}

}  // namespace
}  // namespace lamina::formats
