// tests/pipeline/pores/test_pore_drawing.cpp: the picture of a print's pores, from its toolpaths to PNG.
#include <gtest/gtest.h>
#include <png.h>
#include <tbb/global_control.h>

#include <algorithm>
#include <fstream>

#include "pipeline/pores/pore_page.h"
#include "stages/formats/plot/plot.h"
#include "stages/support/io/other_program.h"
#include "tests/commands/program.h"

namespace lamina {
namespace {

/// Four layers of lines 0.8 mm apart, alternating along x and y.
void write_grid_of_lines(const std::string& path) {
  std::ofstream file(path);
  file << "G21\nG90\nM83\n";
  for (int layer = 1; layer <= 4; ++layer) {
    file << ";LAYER_CHANGE\n;Z:" << 0.3 * layer << "\n;HEIGHT:0.3\nG1 Z" << 0.3 * layer << " F600\n;WIDTH:0.5\n";
    for (int line = 0; line < 12; ++line) {
      const double at = 10 + 0.8 * line;
      if (layer % 2 == 0)
        file << "G0 X10 Y" << at << "\nG1 X18.8 Y" << at << " E1 F900\n";
      else
        file << "G0 X" << at << " Y10\nG1 X" << at << " Y18.8 E1 F900\n";
    }
  }
}

/// Of a cell that repeats: 0.8 mm a side, two layers.
struct Pictured {
  formats::GcodeFile file;
  pipeline::Pile pile;
  pipeline::WindowChoice choice;
  VoxelStack voxels, fine, coarse;
  pipeline::PoreReport report;
  Plot plot;
};
Pictured pictured(const std::string& path, bool flow) {
  Result<formats::GcodeFile> file = formats::GcodeFile::open(path);
  EXPECT_TRUE(file.ok());
  Result<pipeline::Pile> pile = pipeline::pile_of(*file);
  EXPECT_TRUE(pile.ok());
  Pictured all{std::move(*file), std::move(*pile), {}, {}, {}, {}, {}, {}};
  pipeline::Window& window = all.choice.window;
  window.box.add(Point3{13'800'000, 13'800'000, static_cast<Nm>(all.pile.layers[1].low)});
  window.box.add(Point3{14'600'000, 14'600'000, static_cast<Nm>(all.pile.layers[2].high)});
  window.count = {24, 24, 18};
  window.periodic = {true, true, true};
  all.choice.first_layer = 1;
  all.choice.layers = 2;
  const auto cut = [&](const pipeline::Window& in) { return *pipeline::bead_voxels(all.file, all.pile, in); };
  all.voxels = cut(window);
  all.fine = cut(finer(window, pipeline::kFiner));
  all.coarse = cut(finer(with_half_as_many_voxels(window), pipeline::kFiner));
  pipeline::FlowRequest request;
  request.section = flow;
  Result<pipeline::PoreReport> report =
      pipeline::analyse_pores({all.voxels, all.fine, all.coarse}, request, [](double) { return true; });
  EXPECT_TRUE(report.ok());
  all.report = std::move(*report);
  Result<Plot> plot = pipeline::draw_window(path, all.choice, all.report, all.fine, &all.file, &all.pile);
  EXPECT_TRUE(plot.ok());
  all.plot = std::move(*plot);
  return all;
}

bool contains_text(const Plot& plot, const std::string& words) {
  return std::ranges::any_of(plot.texts, [&](const Plot::Text& text) { return text.line.find(words) != std::string::npos; });
}

TEST(PoreDrawing, ShowsTheFlowAlongZAndTheLayersThatItPasses) {
  test::Directory folder;
  write_grid_of_lines(folder / "lines.gcode");
  const Pictured all = pictured(folder / "lines.gcode", true);
  ASSERT_TRUE(all.report.section);
  EXPECT_EQ(all.report.section->across.normal, 2) << "though more flows along the lines";
  double sum = 0;
  for (const float value : all.report.section->across.value) sum += value;
  EXPECT_NEAR(sum / (24 * 24), 1, 0.02) << "what passes the throat passes every plane";
  EXPECT_EQ(all.plot.images.size(), 5u);
  EXPECT_TRUE(contains_text(all.plot, "lines.gcode: k1 "));
  EXPECT_TRUE(contains_text(all.plot, "D along z"));
  EXPECT_TRUE(contains_text(all.plot, "repeats along x, y, z"));
  const auto has = [](const Plot::Image& image, std::uint8_t pixel) { return std::ranges::count(image.pixels, pixel) > 0; };
  EXPECT_TRUE(has(all.plot.images[3], 4)) << "middles of beads";
  EXPECT_TRUE(has(all.plot.images[4], 0) || has(all.plot.images[4], 1));
}

/// However the flow was turned to be solved: velocities lie where the void of the window is, which nothing mirrors onto itself.
TEST(PoreDrawing, VelocitiesLieInTheVoidOfTheWindow) {
  test::Directory folder;
  write_grid_of_lines(folder / "lines.gcode");
  const Pictured all = pictured(folder / "lines.gcode", true);
  ASSERT_TRUE(all.report.section);
  const VoxelView window = all.voxels.view();
  for (const Plane& plane : {all.report.section->across, all.report.section->along}) {
    const auto normal = static_cast<std::size_t>(plane.normal), column = static_cast<std::size_t>(column_axis(plane.normal)),
               row = static_cast<std::size_t>(row_axis(plane.normal));
    std::size_t wrong = 0, mirrored = 0;
    for (std::uint32_t r = 0; r < plane.rows; ++r)
      for (std::uint32_t c = 0; c < plane.columns; ++c) {
        std::array<std::uint32_t, 3> at{};
        at[normal] = plane.at;
        at[column] = c;
        at[row] = r;
        const auto changes = window.row(at[1], at[2]);
        const bool solid = (std::ranges::upper_bound(changes, at[0]) - changes.begin()) % 2 == 1;
        wrong += solid == (plane.value[c + std::size_t{plane.columns} * r] != 0) ? 1 : 0;
        mirrored += solid == (plane.value[plane.columns - 1 - c + std::size_t{plane.columns} * r] != 0) ? 1 : 0;
      }
    EXPECT_LT(wrong, plane.value.size() / 10) << "voxels at walls may be both";
    EXPECT_GT(mirrored, plane.value.size() / 5);
  }
}

TEST(PoreDrawing, WithoutAFlowSolidAndVoidAreDrawn) {
  test::Directory folder;
  write_grid_of_lines(folder / "lines.gcode");
  const Pictured all = pictured(folder / "lines.gcode", false);
  EXPECT_FALSE(all.report.section);
  EXPECT_EQ(all.plot.images.size(), 2u);
  EXPECT_FALSE(contains_text(all.plot, "k1"));
}

TEST(PoreDrawing, IsTheSameForAnyNumberOfThreads) {
  test::Directory folder;
  write_grid_of_lines(folder / "lines.gcode");
  std::vector<std::string> files;
  for (const std::size_t threads : {1, 2, 5}) {
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
    files.push_back(formats::plot_svg(pictured(folder / "lines.gcode", true).plot));
  }
  EXPECT_TRUE(files[0] == files[1] && files[0] == files[2]);
}

/// lamina-preview draws what the plot says, pixel by pixel.
TEST(PoreDrawing, PreviewDrawsThePngInTheColoursOfThePlot) {
  test::Directory folder;
  write_grid_of_lines(folder / "lines.gcode");
  const Plot plot = pictured(folder / "lines.gcode", true).plot;
  const auto file = filter("lamina-preview", "--plot", formats::plot_json(plot));
  ASSERT_TRUE(file.ok());
  png_image image{};
  image.version = PNG_IMAGE_VERSION;
  ASSERT_NE(png_image_begin_read_from_memory(&image, file->data(), file->size()), 0);
  image.format = PNG_FORMAT_RGB;
  std::vector<std::uint8_t> read(PNG_IMAGE_SIZE(image));
  ASSERT_NE(png_image_finish_read(&image, nullptr, read.data(), 0, nullptr), 0);
  for (const Plot::Image& part : plot.images) {
    std::size_t other = 0;
    for (std::size_t i = 0; i < part.pixels.size(); ++i) {
      const std::size_t columns = static_cast<std::size_t>(part.columns), x = static_cast<std::size_t>(part.left) + i % columns,
                        y = static_cast<std::size_t>(part.top) + i / columns;
      const std::uint8_t* rgb = &read[3 * (x + y * image.width)];
      const auto colour = static_cast<long>(rgb[0] << 16 | rgb[1] << 8 | rgb[2]);
      other += colour != std::stol(part.colours[part.pixels[i]], nullptr, 16) ? 1 : 0;
    }
    EXPECT_EQ(other, 0u);
  }
  // What is no plot is refused.
  Plot wrong = plot;
  wrong.images[0].pixels[7] = 255;
  wrong.images[0].colours.resize(10);
  EXPECT_FALSE(filter("lamina-preview", "--plot", formats::plot_json(wrong)).ok());
}

}  // namespace
}  // namespace lamina
