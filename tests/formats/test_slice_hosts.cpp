// tests/formats/test_slice_hosts.cpp: slices as the hosts of powder printers and old controllers read them. The readers follow
// the hosts' sources, not our description of the format.
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <map>
#include <regex>
#include <sstream>

#include "stages/formats/cli/cli.h"
#include "stages/formats/slice_format.h"
#include "stages/formats/svg/svg.h"

namespace lamina::test {
namespace {

using namespace lamina::formats;

constexpr Nm kMillimetre = 1'000'000;

/// A square with a hole, an island in the hole, and a second body; 20 x 20 mm at 30, 40 of the bed.
struct Slices {
  SliceHead head;
  Contours contours;
  std::vector<std::uint32_t> body;

  Slices() {
    square(30, 40, 20, true);
    square(33, 43, 14, false);
    square(38, 48, 4, true);
    square(51, 40, 5, true);
    body = {0, 3, 4};
    finish();
  }
  void finish() {
    head.parts = {"first.stl", "second.stl"};
    head.layers = 2;
    head.program = "lamina <test>";
    for (const Point2 p : contours.point) head.bounds.add(Point3{p.x, p.y, 0});
    head.bounds.add(Point3{30 * kMillimetre, 40 * kMillimetre, 300'000});
    head.top = 300'000;
  }
  void square(Nm x, Nm y, Nm side, bool outer) {
    std::vector<Point2> points{{x, y}, {x + side, y}, {x + side, y + side}, {x, y + side}};
    if (!outer) std::swap(points[1], points[3]);
    for (const Point2 p : points) contours.point.push_back({p.x * kMillimetre, p.y * kMillimetre});
    contours.close();
  }
  SliceLayer layer(std::uint32_t index) const {
    return {{index, static_cast<Nm>(index * 150'000), 150'000, LayerReason::kUniform}, contours, body, {}, {}};
  }
  std::string file(const SliceEncoder& encoder) const {
    Buffer<char> out;
    encoder.head(head, out);
    for (std::uint32_t i = 0; i < head.layers; ++i) {
      EXPECT_TRUE(encoder.check(head, layer(i)).ok());
      encoder.layer(head, layer(i), out);
    }
    encoder.tail(head, out);
    return {out.begin(), out.end()};
  }
};

double shoelace(const std::vector<std::array<double, 2>>& points) {
  double doubled = 0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const auto& a = points[i];
    const auto& b = points[(i + 1) % points.size()];
    doubled += a[0] * b[1] - a[1] * b[0];
  }
  return doubled / 2;
}

/// The Oasis controller (Yvo de Haas), ImageConverter.py, SVGGetData, SVGLayerToArray, ArrayAddPolygon and ArrayConvert, as
/// kept in ZoeJ9/Oasis_3DPrinter at 8dd0087: it tests how lines begin, cuts attributes at quotes, takes slic3r:z times a
/// million, and toggles a pixel for every edge that a column meets.
struct Oasis {
  double width = 0, height = 0, dpi = 600;
  std::vector<std::string> names;
  std::vector<double> heights;
  std::vector<std::vector<std::vector<std::array<double, 2>>>> polygons;  // by layer

  /// Name and value pairs as the host cuts them: what lies before a quote, and what lies up to the next one.
  static std::map<std::string, std::string> attributes(std::string_view rest) {
    std::map<std::string, std::string> found;
    for (std::size_t quote; (quote = rest.find('"')) != rest.npos;) {
      std::string name(rest.substr(0, quote));
      name.erase(0, name.find_first_not_of(" \t\n"));
      rest.remove_prefix(quote + 1);
      const std::size_t end = std::min(rest.find('"'), rest.size());
      found[name] = std::string(rest.substr(0, end));
      rest.remove_prefix(std::min(end + 1, rest.size()));
    }
    return found;
  }

  explicit Oasis(const std::string& file) {
    std::istringstream stream(file);
    bool inside = false;
    for (std::string line; std::getline(stream, line);) {
      if (line.starts_with("<svg ")) {
        auto svg = attributes(std::string_view(line).substr(5));
        width = std::stod(svg["width="]);
        height = std::stod(svg["height="]);
      }
      if (line.starts_with("  <g ")) {
        auto group = attributes(std::string_view(line).substr(5));
        names.push_back(group["id="]);
        heights.push_back(std::stod(group["slic3r:z="]) * 1e6);
        polygons.emplace_back();
        inside = true;
      }
      if (inside && line.starts_with("    <polygon ")) {
        std::istringstream points(attributes(std::string_view(line).substr(13))["points="]);
        auto& polygon = polygons.back().emplace_back();
        for (std::string pair; std::getline(points, pair, ' ');) {
          const std::size_t comma = pair.find(',');
          polygon.push_back({std::stod(pair.substr(0, comma)), std::stod(pair.substr(comma + 1))});
        }
      }
      if (line.starts_with("  </g>")) inside = false;
    }
  }

  /// mm2 of the pixels that are printed.
  double printed(std::size_t layer) const {
    const double pixel = 25.4 / dpi;
    const int columns = static_cast<int>(width / pixel) + 1, rows = static_cast<int>(height / pixel) + 1;
    std::vector<std::vector<bool>> toggles(columns, std::vector<bool>(rows));
    for (const auto& polygon : polygons[layer]) {
      for (std::size_t i = 0; i < polygon.size(); ++i) {
        std::array<double, 2> a = polygon[(i + polygon.size() - 1) % polygon.size()], b = polygon[i];
        if (a[0] >= b[0]) std::swap(a, b);
        if (a[0] == b[0]) continue;
        for (int x = static_cast<int>(a[0] / pixel); x <= static_cast<int>(b[0] / pixel); ++x) {
          if (x * pixel < a[0] || x * pixel > b[0]) continue;
          const int y = static_cast<int>((a[1] + (b[1] - a[1]) * (x * pixel - a[0]) / (b[0] - a[0])) / pixel);
          if (x < columns && y >= 0 && y < rows) toggles[x][y] = !toggles[x][y];
        }
      }
    }
    int set = 0;
    for (const auto& column : toggles) {
      bool on = false;
      for (const bool toggle : column) set += (on ^= toggle);
    }
    return set * pixel * pixel;
  }
};

/// ezrec/BrundleFab-software e3e11de, fab/__init__.py, SVGRender: groups in order of slic3r:z times a million; the polygons of
/// type contour are filled, then those of type hole are cleared; runs of blanks and commas separate numbers.
struct BrundleFab {
  struct Group {
    double z;
    std::vector<std::vector<std::array<double, 2>>> contours, holes;
  };
  std::vector<Group> groups;

  explicit BrundleFab(const std::string& file) {
    const std::regex group("<g ([^>]*)>([^]*?)</g>"), polygon("<polygon ([^>]*)/>"), attribute("([\\w:]+)=\"([^\"]*)\"");
    const auto attributes_of = [&](const std::string& tag) {
      std::map<std::string, std::string> found;
      for (std::sregex_iterator a(tag.begin(), tag.end(), attribute), end; a != end; ++a) found[(*a)[1]] = (*a)[2];
      return found;
    };
    for (std::sregex_iterator g(file.begin(), file.end(), group), end; g != end; ++g) {
      Group& one = groups.emplace_back();
      one.z = std::stod(attributes_of((*g)[1])["slic3r:z"]) * 1e6;
      const std::string inside = (*g)[2];
      for (std::sregex_iterator p(inside.begin(), inside.end(), polygon); p != end; ++p) {
        auto found = attributes_of((*p)[1]);
        auto& list = found["slic3r:type"] == "contour" ? one.contours : one.holes;
        EXPECT_TRUE(found["slic3r:type"] == "contour" || found["slic3r:type"] == "hole");
        std::istringstream numbers(std::regex_replace(found["points"], std::regex("[ ,]+"), " "));
        auto& points = list.emplace_back();
        for (double x, y; numbers >> x >> y;) points.push_back({x, y});
      }
    }
  }
};

TEST(SvgPolygon, LinesAreThoseOfSlic3rsExport) {
  Slices slices;
  slices.contours.point[0].x += 7;  // nanometres have an exponent in Perl
  const std::string file = slices.file(*make_svg_polygon_encoder());
  EXPECT_TRUE(file.starts_with(
      "<?xml version=\"1.0\" encoding=\"UTF-8\" standalone=\"yes\"?>\n"
      "<!DOCTYPE svg PUBLIC \"-//W3C//DTD SVG 1.0//EN\" \"http://www.w3.org/TR/2001/REC-SVG-20010904/DTD/svg10.dtd\">\n"
      "<svg width=\"26\" height=\"20\" xmlns=\"http://www.w3.org/2000/svg\" xmlns:svg=\"http://www.w3.org/2000/svg\" "
      "xmlns:xlink=\"http://www.w3.org/1999/xlink\" xmlns:slic3r=\"http://slic3r.org/namespaces/slic3r\">\n"
      "  <!-- \n  Generated using lamina &lt;test&gt;\n   -->\n"
      "  <g id=\"layer0\" slic3r:z=\"7.5e-08\">\n"
      "    <polygon slic3r:type=\"contour\" points=\"7e-06,0 20,0 20,20 0,20\" style=\"fill: white\" />\n"
      "    <polygon slic3r:type=\"hole\" points=\"3,3 3,17 17,17 17,3\" style=\"fill: black\" />\n"
      "    <polygon slic3r:type=\"contour\" points=\"21,0 26,0 26,5 21,5\" style=\"fill: white\" />\n"))
      << file;
  EXPECT_TRUE(file.ends_with("points=\"8,8 12,8 12,12 8,12\" style=\"fill: white\" />\n  </g>\n</svg>\n"));
  EXPECT_NE(file.find("  <g id=\"layer1\" slic3r:z=\"2.25e-07\">\n"), std::string::npos);
}

TEST(SvgPolygon, TheOasisControllerReadsItsLayersAndPrintsTheirAreas) {
  const Slices slices;
  const Oasis host(slices.file(*make_svg_polygon_encoder()));
  EXPECT_EQ(host.width, 26);
  EXPECT_EQ(host.height, 20);
  EXPECT_EQ(host.names, (std::vector<std::string>{"layer0", "layer1"}));
  ASSERT_EQ(host.heights.size(), 2u);
  EXPECT_NEAR(host.heights[0], 0.075, 1e-12);
  EXPECT_NEAR(host.heights[1], 0.225, 1e-12);
  for (std::size_t layer = 0; layer < 2; ++layer) {
    ASSERT_EQ(host.polygons[layer].size(), 4u);
    double area = 0;
    for (const auto& polygon : host.polygons[layer]) area += shoelace(polygon);
    EXPECT_NEAR(area, 400 - 196 + 16 + 25, 1e-9);
    EXPECT_NEAR(host.printed(layer), 245, 172 * 25.4 / 600) << "a pixel along the edges";
  }
  const Oasis plain(slices.file(*make_svg_encoder()));
  EXPECT_TRUE(plain.names.empty()) << "the other SVG is not for it";
}

TEST(SvgPolygon, BrundleFabsHostReadsContoursAndHoles) {
  const BrundleFab host(Slices().file(*make_svg_polygon_encoder()));
  ASSERT_EQ(host.groups.size(), 2u);
  EXPECT_NEAR(host.groups[1].z, 0.225, 1e-12);
  ASSERT_EQ(host.groups[0].contours.size(), 3u);
  ASSERT_EQ(host.groups[0].holes.size(), 1u);
  EXPECT_NEAR(shoelace(host.groups[0].contours[0]), 400, 1e-9);
  EXPECT_NEAR(shoelace(host.groups[0].holes[0]), -196, 1e-9);
}

/// Whether a reader that paints one polygon over the other ends with white at x, y.
bool painted_white(const std::string& file, double x, double y) {
  const Oasis host(file);  // the polygons in the order of the file
  bool white = false;
  for (const auto& polygon : host.polygons[0]) {
    bool inside = false;
    for (std::size_t i = 0; i < polygon.size(); ++i) {
      const auto &a = polygon[i], &b = polygon[(i + 1) % polygon.size()];
      if ((a[1] <= y) != (b[1] <= y) && x < a[0] + (b[0] - a[0]) * (y - a[1]) / (b[1] - a[1])) inside = !inside;
    }
    if (inside) white = shoelace(polygon) > 0;
  }
  return white;
}

TEST(SvgPolygon, IslandsSurviveReadersThatPaintInOrder) {
  Slices slices;
  slices.contours.clear();
  slices.square(38, 48, 4, true);  // the island first, as shells stand in a part
  slices.square(34, 44, 12, true);
  slices.square(36, 46, 8, false);
  slices.square(30, 40, 20, true);
  slices.square(33, 43, 14, false);
  slices.body = {0, 1, 5};
  slices.finish();
  const std::string file = slices.file(*make_svg_polygon_encoder());
  EXPECT_TRUE(painted_white(file, 1.5, 1.5)) << "the outer wall";
  EXPECT_FALSE(painted_white(file, 3.5, 3.5));
  EXPECT_TRUE(painted_white(file, 5, 5)) << "the wall in its hole";
  EXPECT_FALSE(painted_white(file, 7, 7));
  EXPECT_TRUE(painted_white(file, 10, 10)) << "the island in that one's hole";
}

/// CLI 2.0, binary: u16 commands 128 (z), 129 (id, dir, n, n points) and 131 (id, n, n lines), all of unsigned 16 bits in
/// units.
struct ShortCli {
  double unit = 0;
  std::vector<double> z;
  std::vector<double> area;  // by layer
  std::vector<std::uint32_t> ids, hatches;

  explicit ShortCli(const std::string& file) {
    EXPECT_TRUE(file.starts_with("$$HEADERSTART\n$$BINARY\n$$UNITS/"));
    unit = std::stod(file.substr(file.find("$$UNITS/") + 8));
    std::size_t at = file.find("$$HEADEREND") + 11;
    const auto take = [&] {
      std::uint16_t value = 0;
      EXPECT_LE(at + 2, file.size());
      std::memcpy(&value, file.data() + at, 2);
      at += 2;
      return value;
    };
    while (at + 2 <= file.size()) {
      const std::uint16_t command = take();
      if (command == 128) {
        z.push_back(take() * unit);
        area.push_back(0);
        hatches.push_back(0);
      } else if (command == 129) {
        ids.push_back(take());
        const std::uint16_t direction = take();
        std::vector<std::array<double, 2>> points;
        for (int n = take(); n > 0; --n) {
          const double x = take() * unit, y = take() * unit;
          points.push_back({x, y});
        }
        if (direction == 2) continue;
        EXPECT_EQ(points.front(), points.back());
        points.pop_back();
        EXPECT_EQ(shoelace(points) > 0, direction == 1);
        area.back() += shoelace(points);
      } else if (command == 131) {
        take();
        const std::uint16_t count = take();
        hatches.back() += count;
        at += 8u * count;
      } else {
        ADD_FAILURE() << "command " << command << " before byte " << at;
        return;
      }
    }
    EXPECT_EQ(at, file.size());
  }
};

TEST(Cli16, IsReadBackByTheSpecificationInItsUnit) {
  const Slices slices;
  const std::string file = slices.file(*make_cli_16_encoder({}));
  EXPECT_NE(file.find("$$UNITS/0.001000\n"), std::string::npos) << "60 mm reach up to 60,000 of them";
  EXPECT_NE(file.find("$$DIMENSION/30,40,0,56,60,0.3\n"), std::string::npos) << "in mm regardless of the unit";
  const ShortCli read(file);
  EXPECT_EQ(read.z.size(), 2u);
  EXPECT_NEAR(read.z[0], 0.15, 1e-9);
  EXPECT_NEAR(read.z[1], 0.3, 1e-9);
  EXPECT_NEAR(read.area[0], 245, 1e-6);
  EXPECT_EQ(read.ids, (std::vector<std::uint32_t>{1, 1, 1, 2, 1, 1, 1, 2}));
}

TEST(Cli16, PointsThatFallTogetherAndContoursThatVanishAreLeftOut) {
  Slices slices;
  for (const Point2 p : {Point2{0, 0}, {100, 0}, {100, 100}, {0, 100}}) slices.contours.point.push_back(p);  // 0.1 um
  slices.contours.close();
  for (const Point2 p : {Point2{0, 0}, {200, 0}, {kMillimetre, 0}, {kMillimetre, kMillimetre}, {300, 300}})
    slices.contours.point.push_back(p);
  slices.contours.close();
  slices.body.back() = 6;
  const ShortCli read(slices.file(*make_cli_16_encoder({true})));
  EXPECT_EQ(read.z.size(), 3u) << "the empty first layer";
  EXPECT_EQ(read.z[0], 0);
  EXPECT_NEAR(read.area[1], 245.5, 1e-6);
  EXPECT_EQ(read.ids.size(), 10u);
}

TEST(Cli16, UnitsReachTheFarthestPointAndNoFarther) {
  for (const auto& [far, unit] :
       {std::pair{65.535, "0.001000"}, {65.536, "0.002000"}, {200.0, "0.005000"}, {2000.0, "0.050000"}}) {
    Slices slices;
    slices.head.bounds.hi.x = static_cast<Nm>(std::llround(far * 1e6));
    Buffer<char> out;
    make_cli_16_encoder({})->head(slices.head, out);
    EXPECT_NE(std::string(out.begin(), out.end()).find(std::string("$$UNITS/") + unit + "\n"), std::string::npos) << far;
  }
}

TEST(Cli16, FillingsBecomeCommandsOfNoMoreThan65535Lines) {
  Slices slices;
  Toolpaths paths;
  for (int i = 0; i < 70'001; ++i)
    paths.add({30 * kMillimetre + (i % 2) * kMillimetre, 40 * kMillimetre + i * 100}, PathKind::kRaster, 400'000, 1);
  paths.close();
  SliceLayer layer = slices.layer(0);
  const std::vector<std::uint32_t> path_body{0, 1, 1};
  layer.paths = paths;
  layer.path_body = path_body;
  Buffer<char> out;
  const auto encoder = make_cli_16_encoder({});
  encoder->head(slices.head, out);
  ASSERT_TRUE(encoder->check(slices.head, layer).ok());
  encoder->layer(slices.head, layer, out);
  EXPECT_EQ(ShortCli({out.begin(), out.end()}).hatches[0], 70'000u);
}

TEST(Cli16, WhatDoesNotFitIsRefusedInALineThatSaysWhatToDo) {
  const auto refused = [](const Slices& slices, const SliceLayer& layer) {
    const Status status = make_cli_16_encoder({})->check(slices.head, layer);
    return status.ok() ? std::string() : status.error().message;
  };
  Slices slices;
  SliceLayer thin = slices.layer(0);
  thin.layer = {0, 0, 400, LayerReason::kUniform};
  EXPECT_NE(refused(slices, thin).find("0.0004 mm of thickness are lost in the unit of 0.001 mm"), std::string::npos);
  Slices left;
  left.contours.point[0].x = -1;
  EXPECT_NE(refused(left, left.layer(0)).find("--at"), std::string::npos);
  Slices right;
  right.contours.point[0].x = 70 * kMillimetre;
  EXPECT_NE(refused(right, right.layer(0)).find("70"), std::string::npos);
  Slices many;
  for (int i = 0; i < 65'535; ++i) many.contours.point.push_back({30 * kMillimetre + i, 40 * kMillimetre});
  many.contours.close();
  many.body.back() = 5;
  EXPECT_NE(refused(many, many.layer(0)).find("--tolerance"), std::string::npos);
  EXPECT_EQ(refused(slices, slices.layer(1)), "");
}

TEST(SliceFormats, EveryWordHasAnExtensionAndAWriter) {
  for (const SliceFormat& format : slice_formats()) {
    EXPECT_EQ(find_slice_format(format.id), &format);
    EXPECT_EQ(format.make == nullptr, format.id == "3mf" || format.id == "null") << format.id;
    EXPECT_TRUE(format.make == nullptr || format.make({}) != nullptr);
  }
  EXPECT_EQ(find_slice_format("SVG"), nullptr);
}

}  // namespace
}  // namespace lamina::test
