// Boxes that touch are one body: against the transitive closure, pair by pair.
#include <gtest/gtest.h>

#include <random>
#include <vector>

#include "stages/geometry/boxes.h"
#include "stages/slice/bodies.h"

namespace lamina::slice {
namespace {

Box box(Nm x, Nm y, Nm z, Nm side) {
  Box made;
  made.add(Point3{x, y, z});
  made.add(Point3{x + side, y + side, z + side});
  return made;
}

TEST(Bodies, TouchingFacesAreOneBodyAndANanometreApartAreTwo) {
  EXPECT_EQ(group_touching(std::vector{box(0, 0, 0, 10), box(10, 0, 0, 10)}), (std::vector<std::uint32_t>{0, 0}));
  EXPECT_EQ(group_touching(std::vector{box(0, 0, 0, 10), box(11, 0, 0, 10)}), (std::vector<std::uint32_t>{0, 1}));
  EXPECT_EQ(group_touching(std::vector{box(0, 0, 0, 10), box(0, 0, 11, 10)}), (std::vector<std::uint32_t>{0, 1}));
  EXPECT_EQ(group_touching(std::vector{grown(box(0, 0, 0, 10), 1), box(11, 0, 0, 10)}), (std::vector<std::uint32_t>{0, 0}));
  EXPECT_EQ(group_touching(std::vector{grown(box(0, 0, 0, 10), 1), box(0, 0, 11, 10)}), (std::vector<std::uint32_t>{0, 1}));
  EXPECT_EQ(group_touching(std::vector{Box(), Box()}), (std::vector<std::uint32_t>{0, 1}));
}

TEST(Bodies, AreTheClosureOfTouchingAndNumberedByTheirFirstBox) {
  std::mt19937 random(3);
  for (int run = 0; run < 200; ++run) {
    std::vector<Box> boxes(1 + random() % 25);
    for (Box& one : boxes) {
      const auto at = [&] { return static_cast<Nm>(random() % 60); };
      const Nm x = at(), y = at(), z = at();
      one = box(x, y, z, static_cast<Nm>(1 + random() % 15));
    }
    std::vector<std::uint32_t> wanted(boxes.size());
    std::uint32_t bodies = 0;
    for (std::size_t i = 0; i < boxes.size(); ++i) wanted[i] = UINT32_MAX;
    for (std::size_t first = 0; first < boxes.size(); ++first) {
      if (wanted[first] != UINT32_MAX) continue;
      std::vector<std::size_t> open{first};
      wanted[first] = bodies;
      while (!open.empty()) {
        const std::size_t from = open.back();
        open.pop_back();
        for (std::size_t to = 0; to < boxes.size(); ++to) {
          if (wanted[to] != UINT32_MAX || !touch(boxes[from], boxes[to])) continue;
          wanted[to] = bodies;
          open.push_back(to);
        }
      }
      ++bodies;
    }
    EXPECT_EQ(group_touching(boxes), wanted) << "run " << run;
  }
}

}  // namespace
}  // namespace lamina::slice
