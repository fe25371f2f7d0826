// tests/commands/test_layer_boundaries.cpp: faces at the ends of layers are in the layers whose material they bound, with every
// containment.
#include <gtest/gtest.h>

#include <array>
#include <nlohmann/json.hpp>
#include <string>
#include <utility>

#include "tests/commands/program.h"

namespace lamina::test {
namespace {

std::string corners_and_faces(const std::array<double, 6>& box, int before) {
  std::string text;
  for (int corner = 0; corner < 8; ++corner) {
    text += "v";
    for (std::size_t axis = 0; axis < 3; ++axis) text += " " + std::to_string(box[axis + ((corner >> axis & 1) != 0 ? 3 : 0)]);
    text += "\n";
  }
  for (const std::array<int, 4>& face :
       {std::array{1, 3, 4, 2}, {1, 2, 6, 5}, {3, 7, 8, 4}, {1, 5, 7, 3}, {5, 6, 8, 7}, {2, 4, 8, 6}}) {
    text += "f";
    for (const int corner : face) text += " " + std::to_string(corner + before);
    text += "\n";
  }
  return text;
}

TEST(LayerBoundaries, FacesAtTheEndsOfLayersBoundThem) {
  const Directory folder;
  write_text(folder / "cube.obj", corners_and_faces({0, 0, 0, 10, 10, 1}, 0));
  write_text(folder / "table.obj", corners_and_faces({4, 4, 0, 6, 6, 0.5}, 0) + corners_and_faces({0, 0, 0.5, 10, 10, 1}, 8));
  for (const char* containment : {"across", "inside", "outside"}) {
    for (const auto& [part, pixels] : {std::pair{"cube.obj", 100'000}, {"table.obj", 52'000}}) {
      const Outcome outcome = run_lamina({"jet", part, "--bed", "12x12", "--dpi", "254", "--layer", "0.1", "--at", "1,1", "--containment",
                                          containment, "--json", "--overwrite", "-o", "out"},
                                         folder.path());
      ASSERT_EQ(outcome.code, 0) << outcome.err;
      EXPECT_EQ(nlohmann::json::parse(outcome.out)["set_pixels"], pixels) << part << ", " << containment;
    }
  }
}

}  // namespace
}  // namespace lamina::test
