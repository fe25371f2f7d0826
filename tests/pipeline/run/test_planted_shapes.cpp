// lamina jet --inspect on shapes with one planted fault each, of several sizes, turned, and moved by parts of a pixel: the
// fault is reported with its part and place. Sound shapes are not accused.
#include <gtest/gtest.h>
#include <unistd.h>

#include <cstdio>
#include <filesystem>
#include <functional>
#include <nlohmann/json.hpp>
#include <random>
#include <string>
#include <vector>

#include "tests/pipeline/run/solid_shapes.h"

namespace lamina {
namespace {

using shapes::box;
using shapes::cylinder;
using shapes::extruded;
using shapes::Outline;
using shapes::Point;
using shapes::Shape;

/// A shape and where its fault is.
struct Planted {
  Shape shape;
  Point fault{};
};

class PlantedShapes : public testing::Test {
 protected:
  static constexpr double kMin = 0.5, kAt = 8;  // mm; the corner of the part on the bed

  void SetUp() override {
    folder_ = std::filesystem::temp_directory_path() / ("lamina-planted-" + std::to_string(::getpid()));
    std::filesystem::create_directories(folder_);
    shapes::box({0, 0, 0}, {3, 3, 1}).write((folder_ / "other.stl").string());
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  /// The inspection of a job with the shape as part 1; part 0 is a sound block.
  nlohmann::json inspect(const Shape& shape, double shift_x, double shift_y, const std::string& options) const {
    shape.write((folder_ / "shape.stl").string());
    std::ofstream(folder_ / "job.toml")
        << "[[part]]\npath = \"other.stl\"\nat_mm = [1, 1]\n[[part]]\npath = \"shape.stl\"\nat_mm = [" << kAt + shift_x << ", "
        << kAt + shift_y << "]\n";
    const std::string command = std::string(LAMINA_PROGRAM) + " jet --job " + (folder_ / "job.toml").string() +
                                " --bed 40x40 --dpi 254 --layer 0.1 --fill-rule positive --min-wall 0.5 --dry-run --inspect "
                                "--json --quiet " +
                                options + " -o " + (folder_ / "out").string();
    std::string out;
    FILE* pipe = popen(command.c_str(), "r");
    char buffer[4096];
    for (std::size_t n; (n = fread(buffer, 1, sizeof buffer, pipe)) > 0;) out.append(buffer, n);
    EXPECT_EQ(pclose(pipe), 0) << command;
    return nlohmann::json::parse(out, nullptr, false)["inspection"];
  }

  /// Whether a finding of the kind is of part 1 and its box, with half a millimetre around, contains the point.
  static bool found(const nlohmann::json& inspection, const std::string& kind, const Point& at) {
    if (!inspection.contains(kind) || inspection[kind]["count"] == 0) return false;
    for (const auto& one : inspection[kind]["locations"]) {
      const auto b = one["box_mm"].get<std::array<double, 4>>();
      const double low = one["layer"].get<double>() * 0.1, high = one["last_layer"].get<double>() * 0.1 + 0.1;
      const bool within = b[0] - 0.5 <= at[0] && at[0] <= b[2] + 0.5 && b[1] - 0.5 <= at[1] && at[1] <= b[3] + 0.5 &&
                          low - 0.5 <= at[2] && at[2] <= high + 0.5;
      const bool local = b[2] - b[0] < 20 && b[3] - b[1] < 20;
      if (within && local && one.value("part", -1) == 1) return true;
    }
    return false;
  }

  std::filesystem::path folder_;
};

/// Outline of a gear.
Outline gear(double radius, int teeth) {
  Outline outline;
  for (int i = 0; i < teeth; ++i) {
    for (const auto& [part, height] : {std::pair(0.0, 0.0), {0.15, 1.0}, {0.35, 1.0}, {0.5, 0.0}}) {
      const double turn = 2 * std::numbers::pi * (i + part) / teeth, r = radius + height;
      outline.push_back({r * std::cos(turn), r * std::sin(turn)});
    }
  }
  return outline;
}

Shape block(double wide = 6, double deep = 6, double high = 4) { return box({0, 0, 0}, {wide, deep, high}); }

TEST_F(PlantedShapes, EachFaultIsReportedWithItsPartAndPosition) {
  // t  width of what is too narrow, 0.2 to 0.35 mm; s  scale of the rest, 0.8 to 1.3
  const struct {
    const char* name;
    const char* kind;
    std::function<Planted(double t, double s)> make;
    bool upright = false;  // turned about the z axis alone
  } cases[] = {
      {"a pin on a block", "thin",
       [](double t, double s) {
         return Planted{block().add(cylinder(t / 2, 3.5, 4 + 3 * s, 3, 3)), {3, 3, 5.5}};
       },
       true},
      {"a pin to the side", "thin",
       [](double t, double s) {
         return Planted{block().add(cylinder(t / 2, -0.5, 4 * s).turned(1, 90).moved(6, 3, 2)), {6 + 2 * s, 3, 2}};
       }},
      {"a fin on a block", "thin",
       [](double t, double s) {
         return Planted{block().add(box({1, 3, 3.5}, {5, 3 + t, 4 + 3 * s})), {3, 3, 5.5}};
       },
       true},
      {"a fin to the side", "thin",
       [](double t, double s) {
         return Planted{block().add(box({5.5, 3, 0}, {6 + 4 * s, 3 + t, 4})), {6 + 2 * s, 3, 2}};
       },
       true},
      {"a shelf", "roofs",
       [](double t, double s) {
         return Planted{block().add(box({5.5, 0, 2}, {6 + 4 * s, 6, 2 + t})), {6 + 2 * s, 3, 2}};
       },
       true},
      {"the floor of a tray", "roofs",
       [](double t, double s) {
         return Planted{block(8 * s, 6).cut(box({1, 1, t}, {8 * s - 1, 5, 5})), {4 * s, 3, 0.1}};
       },
       true},
      {"a plate", "roofs",
       [](double t, double s) {
         return Planted{block(8 * s, 6, t), {4 * s, 3, 0.1}};
       },
       true},
      {"a slot", "gaps",
       [](double t, double s) {
         return Planted{block(8, 6).cut(box({4, 1, 1}, {4 + t, 1 + 4 * s, 5})), {4.1, 3, 3}};
       },
       true},
      {"a slot through to the side", "gaps",
       [](double t, double s) {
         return Planted{block(8, 6).cut(box({4, 6 - 4 * s, -1}, {4 + t, 7, 5})), {4.1, 4.5, 2}};
       },
       true},
      {"a gap below a roof", "gaps",
       [](double t, double s) {
         return Planted{block(8, 6).cut(box({2 - s, -1, 2}, {9, 7, 2 + t})), {4, 3, 2.1}};
       },
       true},
      {"a slot between pixels", "gaps",
       [](double t, double s) {
         return Planted{block(8, 6).cut(box({4, 1, 0.5}, {4 + t / 5, 1 + 4 * s, 5})), {4, 3, 2}};
       },
       true},
      {"a gap between layers", "gaps",
       [](double t, double s) {
         return Planted{block(8, 6).cut(box({4 - 2 * s, -1, 2}, {9, 7, 2 + t / 5})), {5, 3, 2}};
       },
       true},
      {"a hollow with a fine drain at the side", "drains",
       [](double t, double s) {
         return Planted{
             block(8, 8, 5).cut(box({4 - 2 * s, 2, 1}, {4 + 2 * s, 6, 4})).cut(box({-1, 4, 2}, {4 - 2 * s, 4 + t, 2 + t})),
             {4, 4, 2.5}};
       }},
      {"a ball with a fine drain below", "drains",
       [](double t, double s) {
         return Planted{shapes::sphere(3 + s, 0, 0, 4.5).cut(shapes::sphere(1 + s, 0, 0, 4.5)).cut(cylinder(t / 2, -1, 4.5)),
                        {0, 0, 4.5}};
       }},
      {"a closed hollow", "hollows",
       [](double, double s) {
         return Planted{block(6, 6, 4).cut(box({3 - s, 2, 1}, {3 + s, 4, 3})), {3, 3, 2}};
       }},
      {"blocks that meet in an edge", "contacts",
       [](double, double s) {
         return Planted{block(3 * s, 3).add(box({3 * s, 3, 0}, {6 * s, 6, 4})).add(box({0, 0, 0}, {3 * s, 3, 1})),
                        {3 * s, 3, 2}};
       },
       true},
      {"blocks that meet in a neck", "contacts",
       [](double t, double s) {
         return Planted{block(3 * s, 3)
                            .add(box({3 * s, 0, 0}, {6 * s, 3, 4}).moved(0.3, 2.9 - t, 0))
                            .add(box({3 * s - 1, 3 - t, 0}, {3 * s + 1, 3, 4})),
                        {3 * s, 3, 2}};
       },
       true},
      {"a beam above the rest", "islands",
       [](double t, double s) {
         return Planted{block().add(box({2, 2, 5}, {2 + 4 * s, 2 + 2 * t, 5.6})), {3.5, 2, 5.2}};
       },
       true},
      {"a beam above the rest, as a body that falls off", "loose",
       [](double t, double s) {
         return Planted{block().add(box({2, 2, 5}, {2 + 4 * s, 2 + 2 * t, 5.6})), {3.5, 2, 5.2}};
       },
       true},
  };
  std::mt19937 random(17);
  const auto draw = [&](double low, double high) { return std::uniform_real_distribution<>(low, high)(random); };
  for (const auto& [name, kind, make, upright] : cases) {
    for (int turn = 0; turn < 6; ++turn) {
      const double t = draw(0.2, 0.35), s = draw(0.8, 1.3), angle = turn < 2 ? 0 : draw(0, 90);
      Planted planted = make(t, s);
      // On a side, or turned about z.
      const bool tipped = !upright && turn % 2 == 1;
      if (tipped) {
        planted.shape = planted.shape.turned(0, 90);
        planted.fault = Shape::turned_point(planted.fault, 0, 90);
      }
      planted.shape = planted.shape.turned(2, angle);
      planted.fault = Shape::turned_point(planted.fault, 2, angle);
      const Point low = planted.shape.lowest();
      const double x = draw(0, 0.1), y = draw(0, 0.1);
      const Point at{planted.fault[0] - low[0] + kAt + x, planted.fault[1] - low[1] + kAt + y, planted.fault[2] - low[2]};
      const auto inspection = inspect(planted.shape, x, y, turn % 2 == 0 ? "--engine rays" : "--engine contours --threads 3");
      EXPECT_TRUE(found(inspection, kind, at))
          << name << ", " << t << " mm, scale " << s << ", turned by " << angle << (tipped ? ", tipped" : "") << ", at "
          << at[0] << " " << at[1] << " " << at[2] << "\n"
          << inspection.dump();
    }
  }
}

TEST_F(PlantedShapes, SoundPartsAreNotAccused) {
  const auto lattice = [](double strut, double gap) {
    Shape shape;
    const double pitch = strut + gap;
    for (int i = 0; i < 4; ++i) {
      for (int k = 0; k < 4; ++k) {
        const double u = i * pitch, v = k * pitch, end = 3 * pitch + strut;
        shape.add(box({u, v, 0}, {u + strut, v + strut, end}));
        shape.add(box({u, 0, v}, {u + strut, end, v + strut}));
        shape.add(box({0, u, v}, {end, u + strut, v + strut}));
      }
    }
    return shape;
  };
  const auto tube = [](double outer, double wall) { return cylinder(outer, 0, 6).cut(cylinder(outer - wall, 0, 6)); };
  const struct {
    const char* name;
    Shape shape;
  } parts[] = {
      {"a block", block()},
      {"a plate of 1.5 times the minimum", block(10, 8, 1.5 * kMin)},
      {"a plate of twice the minimum", block(10, 8, 2 * kMin)},
      {"a wall of 1.5 times the minimum", block(10, 1.5 * kMin, 6)},
      {"a ring of 1.5 times the minimum", tube(4, 1.5 * kMin)},
      {"a ring of twice the minimum", tube(3, 2 * kMin)},
      {"a sphere", shapes::sphere(4, 0, 0, 4)},
      {"a gear", extruded(gear(4, 10), 0, 3)},
      {"a cone", cylinder(3, 0, 6, 0, 0, 0)},
      {"a blunt cone", cylinder(3, 0, 6, 0, 0, 0.4)},
      {"a cone upside down", cylinder(1, 0, 5, 0, 0, 4)},
      {"a pyramid", extruded({{0, 0}, {6, 0}, {6, 6}, {0, 6}}, 0, 6, 0)},
      {"a roof with a ridge", extruded({{0, 0}, {6, 0}, {3, 5}}, 0, 8).turned(0, 90)},
      {"a triangle with sharp corners", extruded({{0, 0}, {8, 0}, {2, 5}}, 0, 4)},
      {"a torus", shapes::torus(4, 1)},
      {"a pin of 1.5 times the minimum", block().add(cylinder(0.75 * kMin, 3, 9, 3, 3))},
      {"a hexagonal nut", extruded(shapes::circle(4, 0, 0, 6), 0, 3).cut(cylinder(2, 0, 3))},
      {"a lattice", lattice(1.5 * kMin, 2 * kMin)},
      {"a wide slot", block(8, 6).cut(box({4, 1, 1}, {4 + 1.5 * kMin, 5, 5}))},
      {"a wide gap", block(8, 6).cut(box({2, 0, 2}, {8, 6, 2 + 1.5 * kMin}))},
      {"a hollow with wide drains", block(8, 8, 5).cut(box({2, 2, 1}, {6, 6, 4})).cut(box({0, 3.3, 1.8}, {2, 4.7, 3.2}))},
      {"a dumb-bell", block(4, 4).add(box({3, 1.5, 1}, {9, 2.5, 2})).add(block(4, 4).moved(8, 0, 0))},
      {"a stair", block(6, 6, 1).add(box({0, 2, 0}, {6, 6, 2})).add(box({0, 4, 0}, {6, 6, 3}))},
      {"engraved text", block(8, 6).cut(box({2, 2, 3.7}, {6, 2.3, 5}))},
  };
  std::mt19937 random(23);
  const auto draw = [&](double low, double high) { return std::uniform_real_distribution<>(low, high)(random); };
  for (const auto& [name, shape] : parts) {
    for (int turn = 0; turn < 5; ++turn) {
      const double tilt = turn == 2 ? 90 : turn == 4 ? draw(20, 70) : 0, angle = turn < 2 ? 0 : draw(0, 90);
      const Shape turned = shape.turned(0, tilt).turned(2, angle);
      const auto inspection = inspect(turned, draw(0, 0.1), draw(0, 0.1), "");
      for (const char* kind : {"islands", "loose", "hollows", "drains", "thin", "roofs", "gaps", "contacts"}) {
        // Teeth of a tipped gear have nothing below.
        if (tilt > 0 && kind == std::string("islands")) continue;
        EXPECT_EQ(inspection[kind]["count"], 0)
            << name << ", tipped by " << tilt << ", turned by " << angle << ": " << kind << "\n"
            << inspection[kind].dump();
      }
    }
  }
}

}  // namespace
}  // namespace lamina
