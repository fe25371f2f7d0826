#include <gtest/gtest.h>

#include "stages/formats/extrusion_format.h"

namespace lamina::formats {
namespace {

TEST(Sml, PdLinesFollowTheThicknessOfTheLayerAndTheUseOfThePath) {
  Extruder machine;
  machine.name = "test";
  machine.format = "sml";
  machine.sml.pd = {{0.254, "raster", "PD.08,41;MM;SR800;AC5"},
                    {0.254, "contour", "PD.08,42;MM;SR800;AC5"},
                    {0.178, "raster", "PD.08,29;MM;SR800;AC5"},
                    {0.178, "contour", "PD.08,30;MM;SR800;AC5"}};
  const auto format = make_sml_format(machine);
  Buffer<char> out;
  for (const Layer& layer : {Layer{0, 0, 254'000}, Layer{1, 254'000, 178'000}}) {
    ASSERT_TRUE(format->check(layer).ok());
    const auto moves = format->layer(layer, 2, out);
    moves->deposit({{25'400'000, 0}, {50'800'000, 0}, PathKind::kOuter, true, 508'000, 0.1, 20});
    moves->deposit({{50'800'000, 0}, {50'800'000, 25'400'000}, PathKind::kOuter, false, 508'000, 0.1, 20});
    moves->deposit({{30'000'000, 5'080'000}, {40'000'000, 5'080'000}, PathKind::kRaster, true, 508'000, 0.1, 20});
    EXPECT_NEAR(moves->finish().bead_mm, 25.4 + 25.4 + 10, 1e-9);
  }
  EXPECT_EQ(std::string(out.begin(), out.end()),
            "; layer 1 thickness 0.254 mm\nPZ10;\nPD.08,42;MM;SR800;AC5\nPU1000,0;\nPA2000,0;\nPA2000,1000;\n"
            "PD.08,41;MM;SR800;AC5\nPU1181,200;\nPA1575,200;\n"
            "; layer 2 thickness 0.178 mm\nPZ17;\nPD.08,30;MM;SR800;AC5\nPU1000,0;\nPA2000,0;\nPA2000,1000;\n"
            "PD.08,29;MM;SR800;AC5\nPU1181,200;\nPA1575,200;\n");
  EXPECT_EQ(format->check({7, 0, 300'000}).error().message,
            "layer 7: test has no PD line for a raster of 0.3 mm; its table has 0.254, 0.178");
}

}  // namespace
}  // namespace lamina::formats
