// What stencils cover along chains of runs, and columns up to a height, against pixels one by one.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <random>
#include <string>
#include <vector>

#include "stages/checks/chains.h"
#include "stages/checks/recent_pixels.h"
#include "stages/checks/short_spans.h"
#include "stages/checks/simple_chains.h"
#include "stages/checks/sliding_window.h"
#include "stages/checks/thin.h"
#include "stages/geometry/combine.h"
#include "tests/checks/volume.h"

namespace lamina::checks {
namespace {

std::uint32_t drawn(std::mt19937& random, std::uint32_t below) { return static_cast<std::uint32_t>(random() % below); }

/// Layers of noise, or of boxes that move from layer to layer.
Volume moving_shapes(std::mt19937& random, std::uint32_t columns, std::uint32_t rows, std::uint32_t layers,
                     std::uint32_t percent) {
  Volume volume{columns, rows, layers, std::vector<std::uint8_t>(std::size_t{columns} * rows * layers, 0)};
  for (std::uint32_t box = 0; percent == 0 && box < 5; ++box) {
    const std::uint32_t left = drawn(random, columns), top = drawn(random, rows), wide = 1 + drawn(random, columns / 2),
                        high = 1 + drawn(random, rows / 2), bottom = drawn(random, layers), up = 1 + drawn(random, layers);
    for (std::uint32_t l = bottom; l < std::min(layers, bottom + up); ++l) {
      for (std::uint32_t r = top; r < std::min(rows, top + high); ++r) {
        for (std::uint32_t c = left + (l + r) % 3; c < std::min(columns, left + wide); ++c)
          volume.set[(std::size_t{l} * rows + r) * columns + c] = 1;
      }
    }
  }
  for (auto& pixel : volume.set) {
    if (drawn(random, 100) < percent) pixel = 1;
  }
  return volume;
}

std::string text_of(const RunsView& runs) {
  std::string text;
  for (std::uint32_t r = 0; r < runs.rows(); ++r) {
    for (const std::uint32_t change : runs.row(r)) text += std::to_string(change) + " ";
    text += "\n";
  }
  return text;
}

/// Of pixels, those of the window that the stencil covers from a set one, or whose stencil covers a set one.
Runs covered(const Volume& image, const Stencil& stencil, bool corners, const PixelBox& window, bool gaps) {
  Volume result{image.columns, image.rows, 1, std::vector<std::uint8_t>(std::size_t{image.columns} * image.rows, 0)};
  for (std::uint32_t r = window.top; r < window.bottom; ++r) {
    for (std::uint32_t c = window.left; c < window.right; ++c) {
      bool any = false;
      for (std::uint32_t j = 0; j < stencil.rows.size(); ++j) {
        for (std::uint32_t k = stencil.rows[j].first; k <= stencil.rows[j].last; ++k) {
          const std::int64_t column = corners ? std::int64_t{c} + k : std::int64_t{c} - k,
                             row = corners ? std::int64_t{r} + j : std::int64_t{r} - j;
          any = any || image.at(column, row, 0);
        }
      }
      result.set[std::size_t{r} * image.columns + c] = any != gaps ? 1 : 0;
    }
  }
  return result.layer(0);
}

TEST(Chains, CoverWhatTheirPixelsDo) {
  std::mt19937 random(7);
  const PixelGrid grid{PixelAxis(254, 10 * kNmPerMm), PixelAxis(254, 10 * kNmPerMm)};
  const Stencils stencils(grid, 1'300'000);
  Chains chains;  // the same for all, as for layers
  Runs result;
  for (int k = 0; k < 300; ++k) {
    const Volume image = moving_shapes(random, 37, 29, 1, k % 3 == 0 ? 0 : k % 3 == 1 ? 4 : 60);
    const std::uint32_t left = drawn(random, 20), top = drawn(random, 15);
    const PixelBox window{left, left + drawn(random, 38 - left), top, top + drawn(random, 30 - top)};
    ASSERT_TRUE(chains.find(image.layer(0), static_cast<std::uint32_t>(stencils.at(stencils.count() - 1).rows.size())));
    for (int turn = 0; turn < 4; ++turn) {
      const Stencil stencil = stencils.at(drawn(random, stencils.count()));
      const bool corners = turn % 2 == 1, gaps = turn / 2 == 1;
      chains.spread(stencil.steps, corners, window, gaps, result);
      ASSERT_EQ(text_of(result), text_of(covered(image, stencil, corners, window, gaps)))
          << k << " corners " << corners << " gaps " << gaps;
    }
  }
}

/// Chains of noise are short: it is opened row by row, with the same result.
TEST(Chains, LeaveNoiseToRows) {
  std::mt19937 random(8);
  const Volume noise = moving_shapes(random, 500, 500, 1, 92);
  const PixelGrid grid{PixelAxis(254, 50 * kNmPerMm), PixelAxis(254, 50 * kNmPerMm)};
  const Stencils stencils(grid, 600'000);
  const Stencil stencil = stencils.at(stencils.count() - 1);
  Chains chains;
  ASSERT_FALSE(chains.find(noise.layer(0), 100));
  Volume more = noise;
  for (auto& pixel : more.set) pixel = random() % 4 == 0 ? 1 : 0;
  ASSERT_FALSE(chains.find(more.layer(0), static_cast<std::uint32_t>(stencil.rows.size())));
  for (std::uint32_t r = 100; r < 300; ++r) std::fill_n(more.set.begin() + r * 500 + 50, 200 + r % 7, std::uint8_t{1});
  ThinScratch scratch;
  Runs opened;
  open(more.layer(0), stencil, scratch, opened);
  const PixelBox all{0, 500, 0, 500};
  Volume outside = more;
  for (auto& pixel : outside.set) pixel = pixel == 0 ? 1 : 0;
  const Runs not_fits = covered(outside, stencil, true,
                                {0, 500 - stencil.columns + 1, 0, 501 - static_cast<std::uint32_t>(stencil.rows.size())}, true);
  Volume fits{500, 500, 1, std::vector<std::uint8_t>(250000, 0)};
  for (std::uint32_t r = 0; r < 500; ++r) {
    const auto row = not_fits.view().row(r);
    for (std::size_t i = 0; i < row.size(); i += 2)
      std::fill_n(fits.set.begin() + r * 500 + row[i], row[i + 1] - row[i], std::uint8_t{1});
  }
  EXPECT_EQ(text_of(opened), text_of(covered(fits, stencil, false, all, false)));
}

/// Long shapes that lean, split and meet, with rough sides and thin places.
Volume leaning_shapes(std::mt19937& random, std::uint32_t columns, std::uint32_t rows) {
  Volume volume{columns, rows, 1, std::vector<std::uint8_t>(std::size_t{columns} * rows, 0)};
  for (int shape = 0; shape < 5; ++shape) {
    const std::uint32_t first = drawn(random, rows), last = std::min(rows, first + rows / 2 + drawn(random, rows)),
                        wide = 2 + drawn(random, 30), rough = drawn(random, 3), eighths = drawn(random, 12);
    const auto set = static_cast<std::uint8_t>(shape % 3 == 2 ? 0 : 1);
    std::int64_t left = drawn(random, columns) * 8;
    for (std::uint32_t r = first; r < last; ++r, left += static_cast<std::int64_t>(eighths) - 6) {
      const std::int64_t begin = left / 8 + drawn(random, rough + 1), end = begin + wide + drawn(random, rough + 1);
      for (std::int64_t c = std::max<std::int64_t>(0, begin); c < std::min<std::int64_t>(columns, end); ++c)
        volume.set[r * columns + static_cast<std::uint32_t>(c)] = set;
    }
  }
  return volume;
}

/// What simple chains leave open is added: the sum is that of all pixels.
TEST(SimpleChains, OpenAndErodeLikeChainsOfAnyForm) {
  std::mt19937 random(11);
  const PixelGrid grid{PixelAxis(254, 20 * kNmPerMm), PixelAxis(254, 20 * kNmPerMm)};
  const Stencils stencils(grid, 1'300'000);
  SimpleChains simple;  // the same for all, as for layers
  ThinScratch scratch;
  Runs context, opened, of_context, whole, expected, found;
  std::uint32_t simply = 0;
  for (int k = 0; k < 150; ++k) {
    const Volume shapes = leaning_shapes(random, 90, 700);
    const Runs image = shapes.layer(0);
    const Stencil stencil = stencils.at(4 + drawn(random, stencils.count() - 4));
    const PixelBox window{0, 90, 0, 700};
    SCOPED_TRACE(k);
    simple.find(image);
    simply += simple.open(stencil.steps) ? 1 : 0;
    simple.context(image, context);
    open(context, stencil, scratch, opened);
    combine(context, opened, SetOperation::kDifference, of_context);
    simple.finish(image, context, of_context, 0, found);
    open(image, stencil, scratch, whole);
    combine(image, whole, SetOperation::kDifference, expected);
    ASSERT_EQ(text_of(found), text_of(expected));
    simple.erode(stencil.steps);
    simple.context(image, context);
    erode(context, {0, 90, 0, context.view().rows()}, stencil, scratch, of_context);
    simple.finish(image, context, of_context, stencil.rows.front().first, found);
    erode(image, window, stencil, scratch, expected);
    ASSERT_EQ(text_of(found), text_of(expected));
  }
  EXPECT_GT(simply, 20u);  // so many pay
}

class ColumnHeights : public testing::Test {
 protected:
  /// The height of the column of set pixels that ends with this one; `endless` where it begins with the first layer.
  static std::int64_t height(const Volume& volume, std::uint32_t c, std::uint32_t r, std::uint32_t l, bool endless) {
    std::int64_t layers = 0;
    while (volume.at(c, r, std::int64_t{l} - layers)) ++layers;
    return endless && layers == std::int64_t{l} + 1 ? 1000 : layers;
  }
};

/// Pixels that are set in all of the last layers, or in any of them.
Runs pixels_of_last(const Volume& volume, std::uint32_t first, std::uint32_t last, bool all) {
  Volume result{volume.columns, volume.rows, 1, std::vector<std::uint8_t>(std::size_t{volume.columns} * volume.rows)};
  for (std::uint32_t i = 0; i < result.set.size(); ++i) {
    bool set = all;
    for (std::uint32_t l = first; l <= last; ++l) {
      const bool one = volume.at(i % volume.columns, i / volume.columns, l);
      set = all ? set && one : set || one;
    }
    result.set[i] = set ? 1 : 0;
  }
  return result.layer(0);
}

TEST(SlidingWindows, GiveWhatTheirImagesShareAndTheirUnion) {
  std::mt19937 random(9);
  for (int k = 0; k < 40; ++k) {
    const Volume volume = moving_shapes(random, 23, 11, 40, k % 3 == 0 ? 0 : k % 3 == 1 ? 30 : 85);
    const std::uint32_t layers = 1 + drawn(random, 35);  // of the window
    SlidingWindow all(SetOperation::kIntersection), any(SetOperation::kUnion);
    std::uint32_t first = 0;
    for (std::uint32_t l = 0; l < volume.layers; ++l) {
      if (k % 4 == 1 && drawn(random, 20) == 0) first = l;  // all others are forgotten at once
      first = std::max(first, l + 1 < layers ? 0 : l + 1 - layers);
      const Runs image = volume.layer(l);
      // The last one stays, even if it should not.
      if (k % 8 == 2) first = l;
      const std::int64_t from = k % 8 == 2 ? 3 * std::int64_t{l} : 3 * std::int64_t{first} - (k % 2 == 0 ? 1 : 3);
      all.add(3 * l, image, from);
      any.add(3 * l, image, from);
      ASSERT_EQ(text_of(all.combined()), text_of(pixels_of_last(volume, first, l, true))) << k << " layer " << l;
      ASSERT_EQ(text_of(any.combined()), text_of(pixels_of_last(volume, first, l, false))) << k << " layer " << l;
    }
  }
}

/// Unions are larger than their images, and no buffer of one is kept for an image.
TEST(SlidingWindows, HoldAboutWhatTheyNeed) {
  for (const bool apart : {false, true}) {
    SlidingWindow any(SetOperation::kUnion);
    Runs image;
    image.columns = 100'000;
    image.row_offset = {0, 40};
    image.change.resize(40);
    for (std::uint32_t l = 0; l < 800; ++l) {
      for (std::uint32_t i = 0; i < 40; ++i) image.change[i] = 5000 * (i / 2) + (apart ? 4 * l : 0) + i % 2;
      const std::uint64_t need = any.need(image);
      any.add(l, image, std::int64_t{l} - 200);
      if (l > 20) {
        ASSERT_LE(any.bytes(), 2 * need) << l;
      }
    }
  }
}

TEST(RecentPixels, AreOfTheWindowAndOfNoMoreThanAQuarterBeyond) {
  std::mt19937 random(12);
  for (int k = 0; k < 40; ++k) {
    const Volume volume = moving_shapes(random, 23, 11, 60, k % 3 == 0 ? 0 : k % 3 == 1 ? 30 : 85);
    const std::uint32_t window = 4 + drawn(random, 30);
    RecentPixels recent;
    for (std::uint32_t l = 0; l < volume.layers; ++l) {
      recent.forget(std::int64_t{l} - window, window);
      recent.add({l, static_cast<Nm>(l), 1}, volume.layer(l));
      const auto first = static_cast<std::uint32_t>(recent.bottom());
      ASSERT_LE(first, l < window ? 0 : l - window);
      if (l >= 2 * window) {
        ASSERT_GE(first + window + window / 4, l);
      }
      ASSERT_EQ(text_of(recent.all()), text_of(pixels_of_last(volume, first, l, true))) << k << " layer " << l;
      ASSERT_EQ(text_of(recent.any()), text_of(pixels_of_last(volume, first, l, false))) << k << " layer " << l;
    }
  }
}

/// Of material and of powder, where the height takes few layers and where it takes many.
TEST_F(ColumnHeights, OfShortOnesAreThoseOfPixels) {
  std::mt19937 random(10);
  const PixelBox window{2, 21, 1, 10};
  for (int k = 0; k < 120; ++k) {
    const std::uint32_t layers = 16;
    const Volume volume = moving_shapes(random, 23, 11, layers, k % 3 == 0 ? 0 : k % 3 == 1 ? 30 : 85);
    const std::int64_t height_nm = k % 2 == 0 ? 1 + drawn(random, 60) : 100 + drawn(random, 100);
    Volume powder = volume;
    std::vector<Nm> bottom(1, 0);
    for (std::uint32_t l = 0; l < layers; ++l) {
      bottom.push_back(bottom.back() + 5 + static_cast<Nm>(drawn(random, 10)));
      for (std::uint32_t i = 0; i < 253; ++i) {
        const bool within = i % 23 >= window.left && i % 23 < window.right && i / 23 >= window.top && i / 23 < window.bottom;
        powder.set[l * 253 + i] = within && volume.set[l * 253 + i] == 0 ? 1 : 0;
      }
    }
    ShortSpans columns(height_nm);
    for (std::uint32_t l = 0; l <= layers; ++l) {
      SCOPED_TRACE(std::to_string(k) + " layer " + std::to_string(l));
      const Layer layer{l, bottom[l], 1};
      if (l < layers) {
        columns.add(layer, volume.layer(l), window);
      } else {
        columns.finish(layer);
      }
      for (const bool set : {true, false}) {
        if (l == layers && !set) continue;
        const Volume& of = set ? volume : powder;
        std::vector<std::int64_t> ended(253, -1), expected(253, -1);
        for (std::uint32_t i = 0; i < 253; ++i) {
          const std::int64_t below = l == 0 ? 0 : height(of, i % 23, i / 23, l - 1, !set);
          if (of.at(i % 23, i / 23, l) || below == 0 || below > l) continue;
          const std::int64_t first = l - below;
          if (bottom[l] - bottom[static_cast<std::size_t>(first)] < height_nm) expected[i] = first;
        }
        std::uint32_t before = 0;
        for (const ColumnSpan& span : set ? columns.solid() : columns.powder()) {
          EXPECT_LT(bottom[l] - span.bottom, height_nm);
          EXPECT_EQ(span.bottom, bottom[span.first_layer]);
          EXPECT_GE(span.row * 23 + span.begin, before);
          before = span.row * 23 + span.end;
          for (std::uint32_t c = span.begin; c < span.end; ++c) ended[span.row * 23 + c] = span.first_layer;
        }
        ASSERT_EQ(ended, expected) << (set ? "material" : "powder");
      }
    }
  }
}

}  // namespace
}  // namespace lamina::checks
