// What the registry says a file has at most is what the memory budget relies on.
#include <gtest/gtest.h>

#include <random>

#include "stages/formats/image_format.h"

namespace lamina::test {
namespace {

/// Rows of random runs, from none to one in every second pixel.
Runs random_runs(std::uint32_t columns, std::uint32_t rows, double density, unsigned seed) {
  std::mt19937 random(seed);
  Runs runs;
  runs.columns = columns;
  runs.row_offset.push_back(0);
  for (std::uint32_t r = 0; r < rows; ++r) {
    for (std::uint32_t column = 0; column <= columns; ++column) {
      if (static_cast<double>(random()) < density * 4294967295.0) runs.change.push_back(column);
    }
    if ((runs.change.size() - runs.row_offset.back()) % 2 != 0) runs.change.pop_back();
    runs.row_offset.push_back(static_cast<std::uint32_t>(runs.change.size()));
  }
  return runs;
}

TEST(ImageFormats, NoFileIsLargerThanItsBound) {
  for (const formats::ImageFormat& format : formats::image_formats()) {
    const auto encoder = format.make_encoder();
    for (const std::uint32_t columns : {1u, 63u, 700u, 20'000u}) {
      for (const double density : {0.0, 0.001, 0.05, 0.5, 1.0}) {
        const Runs runs = random_runs(columns, 300, density, columns);
        formats::Bytes file;
        ASSERT_TRUE(encoder->encode(runs, 600, 600, file).ok());
        const std::uint64_t maximum = format.max_bytes(columns, 300, runs.change.size());
        EXPECT_LE(file.size(), maximum) << format.id << ", " << columns << " columns, density " << density;
        // What is allocated for it counts; formats that compress hardly ever come near their bound.
        if (format.id == "tiff-none" || format.id == "pbm") {
          EXPECT_LE(file.capacity(), maximum) << format.id;
        }
      }
    }
  }
}

}  // namespace
}  // namespace lamina::test
