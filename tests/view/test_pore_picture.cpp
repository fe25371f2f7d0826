// tests/view/test_pore_picture.cpp: sections as pictures: what is where, how much of it, and how colours rise.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>

#include "stages/pores/porosity.h"
#include "stages/view/pore_picture.h"
#include "tests/pores/boxes.h"

namespace lamina {
namespace {

using pores::testing::stack_of;
using pores::testing::Voxels;

constexpr double kSolidX = 12;

/// A slit along y and z, 8 of 20 voxels wide, of 0.1 mm each; a cavity in the solid.
VoxelStack slit(std::array<bool, 3> periodic) {
  return stack_of(
      Voxels(20, 20, 10).fill([](auto x, auto y, auto z) { return x < kSolidX && !(x == 5 && y == 10 && (z == 3 || z == 4)); }),
      periodic, {100'000, 100'000, 100'000});
}

view::PorePicture picture_of(const VoxelStack& solid, const VoxelStack& through) {
  view::PorePicture picture;
  picture.solid = solid;
  picture.through = through;
  picture.position = {15, 10, 4};
  return picture;
}

double count(const Plot::Image& image, std::uint8_t pixel) {
  return static_cast<double>(std::ranges::count(image.pixels, pixel));
}

bool says(const Plot& plot, const std::string& words) {
  return std::ranges::any_of(plot.texts, [&](const Plot::Text& text) { return text.line.find(words) != std::string::npos; });
}

TEST(PorePicture, SolidVoidThatLeadsThroughAndCavitiesHaveTheirShares) {
  const VoxelStack solid = slit({}), through = pores::void_through(solid, 2);
  const Plot plot = view::draw_pores(picture_of(solid, through));
  ASSERT_EQ(plot.images.size(), 2u) << "no flow: no colours";
  const Plot::Image& across = plot.images[0];
  const auto all = static_cast<double>(across.pixels.size());
  EXPECT_NEAR(count(across, 2) / all, 8 / 20.0, 1e-9);
  EXPECT_NEAR(count(across, 3) / all, 1 / 400.0, 1e-9);
  EXPECT_NEAR(count(across, 0) / all, 239 / 400.0, 1e-9);
  EXPECT_EQ(plot.images[1].pixels.size() * 2, across.pixels.size()) << "half as high as deep, at one scale";
  const auto along_at = [&](std::uint32_t x, std::uint32_t z) {
    return plot.images[1].pixels[540 * (270 - z * 27 - 14) + x * 27 + 13];
  };
  EXPECT_EQ(along_at(5, 3), 3) << "z upwards";
  EXPECT_EQ(along_at(5, 6), 0);
  EXPECT_TRUE(says(plot, "solid 59.95 %"));
  EXPECT_TRUE(says(plot, "connected along z 40.00 %"));
  EXPECT_TRUE(says(plot, "other void 0.05 %"));
}

/// 2 mm on 540 pixels.
TEST(PorePicture, TheBarOfLengthsIsAsLongAsItSays) {
  const VoxelStack solid = slit({}), through = pores::void_through(solid, 2);
  const Plot plot = view::draw_pores(picture_of(solid, through));
  EXPECT_TRUE(says(plot, "0.5 mm"));
  EXPECT_NEAR(plot.boxes.front().width, 0.5 * 540 / 2, 1e-9);
  EXPECT_TRUE(says(plot, "across z, z = 0.450 mm"));
  EXPECT_TRUE(says(plot, "along z, y = 1.050 mm"));
}

/// Four cells around the place, which is in the middle.
TEST(PorePicture, WhatRepeatsIsDrawnAroundThePosition) {
  const VoxelStack solid = slit({true, true, true}), through = pores::void_through(solid, 2);
  const Plot plot = view::draw_pores(picture_of(solid, through));
  const Plot::Image& across = plot.images[0];
  ASSERT_EQ(across.columns, 540);
  EXPECT_NEAR(count(across, 2) / (540.0 * 540.0), 8 / 20.0, 0.005);
  // The slit, 12 to 20 of 20, begins 3.5 voxels left of the middle of voxel 15.
  const auto row = across.pixels.begin() + 100 * 540;
  const auto middle = row + 270;
  EXPECT_NEAR(static_cast<double>(std::find(middle, row + 540, 0) - middle), 4.5 * 13.5, 1.01);
  EXPECT_NEAR(static_cast<double>(std::find(std::reverse_iterator(middle), std::reverse_iterator(row), 0) -
                                  std::reverse_iterator(middle)),
              3.5 * 13.5, 1.01);
  EXPECT_TRUE(std::equal(row, row + 270, row + 270)) << "twice the same";
}

/// 0.3, 0.3 and 0.4 mm of 1; beads along y at x = 0.5 mm.
TEST(PorePicture, LayersAndTheMiddlesOfBeadsAreReported) {
  const VoxelStack solid = slit({}), through = pores::void_through(solid, 2);
  view::PorePicture picture = picture_of(solid, through);
  picture.layer_tops_mm = {0.3, 0.6, 1};  // the cavity lies in the second one
  picture.corner_mm = {100, 50, 2};
  picture.lines = {{Point2{100'500'000, 40'000'000}, Point2{100'500'000, 60'000'000}},
                   {Point2{101'500'000, 50'000'000}, Point2{101'500'000, 52'000'000}}};
  const Plot plot = view::draw_pores(picture);
  const Plot::Image &across = plot.images[0], &along = plot.images[1];
  EXPECT_NEAR(count(along, 1) / (count(along, 0) + count(along, 1)), 34 / 118.0, 1e-9);
  EXPECT_EQ(count(across, 4), 540 - 27) << "all along y but the cavity, none on the void";
  EXPECT_EQ(across.pixels[540 * 100 + 135], 4);
}

TEST(PorePicture, VelocityIsReadOffTheScale) {
  const VoxelStack solid = slit({}), through = pores::void_through(solid, 2);
  view::PorePicture picture = picture_of(solid, through);
  Plane across{2, 4, 20, 20, {}}, along{1, 10, 20, 10, {}};
  across.value.assign(400, 0.0f);
  along.value.assign(200, 0.0f);
  for (std::size_t i = 0; i < 400; ++i)
    if (i % 20 >= 12) across.value[i] = static_cast<float>(i % 20 - 11);  // 1 to 8
  picture.across = &across;
  picture.along = &along;
  const Plot plot = view::draw_pores(picture);
  ASSERT_EQ(plot.images.size(), 5u) << "two by velocity, their scale, and two of solid and void";
  const Plot::Image &flow = plot.images[0], &scale = plot.images[2];
  const auto middle_of = [&](std::uint32_t voxel) { return flow.pixels[270 * 540 + voxel * 27 + 13]; };
  EXPECT_EQ(middle_of(3), 0) << "solid";
  EXPECT_EQ(middle_of(19), scale.pixels.front()) << "the fastest";
  // Half of the range has the colour in the middle of the scale.
  const auto half = scale.pixels[scale.pixels.size() / 2];
  EXPECT_NEAR(middle_of(15), half, 3);
  EXPECT_TRUE(says(plot, "v / mean"));
}

/// Luminance as IEC 61966-2-1 has it: a copy in greys has the same order.
TEST(ColourScale, EveryStepIsLighter) {
  const auto luminance = [](const std::string& rgb) {
    const auto light = [&](std::size_t at) {
      const double value = static_cast<double>(std::strtol(rgb.substr(at, 2).c_str(), nullptr, 16)) / 255;
      return value <= 0.04045 ? value / 12.92 : std::pow((value + 0.055) / 1.055, 2.4);
    };
    return 0.2126 * light(0) + 0.7152 * light(2) + 0.0722 * light(4);
  };
  // CIE lightness rises by equal steps, within a third of one.
  const auto lightness = [&](double share) { return 116 * std::cbrt(luminance(view::scale_colour(share))) - 16; };
  const double step = (lightness(1) - lightness(0)) / 20;
  EXPECT_GT(step, 3.5);
  for (int i = 0; i < 20; ++i) EXPECT_NEAR(lightness((i + 1) / 20.0) - lightness(i / 20.0), step, step / 3) << i;
}

}  // namespace
}  // namespace lamina
