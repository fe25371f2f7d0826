// tests/formats/test_slice_files.cpp: SVG, CLI and 3MF slices, read back by readers that share no code with the writers.
#include <gtest/gtest.h>

#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>
#include <zip.h>

#include <bit>
#include <cmath>
#include <csignal>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <regex>
#include <sstream>

#include "stages/formats/cli/cli.h"
#include "stages/formats/slice_format.h"
#include "stages/formats/svg/svg.h"
#include "stages/formats/threemf/threemf.h"
#include "stages/support/text/decimal.h"

namespace lamina::test {
namespace {

namespace fs = std::filesystem;
using namespace lamina::formats;

constexpr Nm kMm = 1'000'000;

/// Two layers of two bodies: a square with a hole, and a triangle; the second layer of the second body is empty, and the
/// first layer of the first body has a filling.
struct Job {
  SliceHead head;
  std::vector<Contours> contours{2};
  std::vector<std::vector<std::uint32_t>> body;
  std::vector<Toolpaths> paths{2};
  std::vector<std::vector<std::uint32_t>> path_body;
  std::vector<SliceLayer> layers;

  Job() {
    head.parts = {"a,b/c $$x <&\"> -- .stl", "second.stl"};
    head.bounds.add(Point3{5 * kMm, 7 * kMm, 0});
    head.bounds.add(Point3{40 * kMm, 27 * kMm, 600'001});
    head.layers = 2;
    head.program = "lamina test";
    for (std::uint32_t layer = 0; layer < 2; ++layer) {
      Contours& c = contours[layer];
      const Nm odd = layer == 0 ? 0 : 1;  // the last nanometre has to survive in text
      for (const Point2 p : {Point2{5 * kMm, 7 * kMm}, {25 * kMm + odd, 7 * kMm}, {25 * kMm, 27 * kMm}, {5 * kMm, 27 * kMm}})
        c.point.push_back(p);
      c.close();
      for (const Point2 p : {Point2{10 * kMm, 12 * kMm}, {10 * kMm, 17 * kMm}, {15 * kMm, 12'500'000}}) c.point.push_back(p);
      c.close();
      if (layer == 0) {
        for (const Point2 p : {Point2{30 * kMm, 8 * kMm}, {40 * kMm, 8'123'456}, {35 * kMm, 20 * kMm}}) c.point.push_back(p);
        c.close();
        Toolpaths& t = paths[layer];
        t.add({6 * kMm, 8 * kMm}, PathKind::kRaster, 400'000, 0);
        t.add({24 * kMm, 8 * kMm}, PathKind::kLink, 400'000);
        t.add({24 * kMm, 9 * kMm}, PathKind::kRaster, 400'000, 1);
        t.add({6 * kMm, 9 * kMm}, PathKind::kRaster, 400'000, 1);
        t.close();
      }
      body.push_back({0, 2, layer == 0 ? 3u : 2u});
      path_body.push_back({0, paths[layer].size(), paths[layer].size()});
    }
    for (std::uint32_t layer = 0; layer < 2; ++layer) {
      layers.push_back({{layer, static_cast<Nm>(layer * 300'000), layer == 0 ? 300'000 : 300'001, LayerReason::kUniform},
                        contours[layer],
                        body[layer],
                        paths[layer],
                        path_body[layer]});
    }
  }

  std::string file(const SliceEncoder& encoder) const {
    Buffer<char> out;
    encoder.head(head, out);
    for (const SliceLayer& layer : layers) encoder.layer(head, layer, out);
    encoder.tail(head, out);
    return {out.begin(), out.end()};
  }
};

Nm nm_of_text(const std::string& text) { return static_cast<Nm>(std::llround(std::stod(text) * 1e6)); }

std::vector<std::string> split_at(const std::string& text, char separator) {
  std::vector<std::string> pieces;
  std::stringstream stream(text);
  for (std::string piece; std::getline(stream, piece, separator);) pieces.push_back(piece);
  return pieces;
}

TEST(Decimal, MillimetresAreExactAndHaveNoMoreDigitsThanTheyNeed) {
  const auto text = [](std::int64_t nm) {
    char capacity[kMaxDecimal];
    return std::string(capacity, put_mm(nm, capacity));
  };
  EXPECT_EQ(text(0), "0");
  EXPECT_EQ(text(-1), "-0.000001");
  EXPECT_EQ(text(12'500'000), "12.5");
  EXPECT_EQ(text(100'000'000), "100");
  EXPECT_EQ(text(2'147'483'647), "2147.483647");
  EXPECT_EQ(text(INT64_MIN), "-9223372036854.775808");
}

TEST(WriteSvg, EveryPointAndAttributeIsReadBack) {
  const Job job;
  const std::string svg = job.file(*make_svg_encoder());
  EXPECT_NE(svg.find("<svg width=\"35\" height=\"20\""), std::string::npos);
  EXPECT_NE(svg.find("xmlns:slic3r=\"http://slic3r.org/namespaces/slic3r\" viewport-fill=\"black\""), std::string::npos);
  EXPECT_NE(svg.find("<g id=\"layer1\" slic3r:z=\"0.600001\" slic3r:slice-z=\"0.45\" slic3r:layer-height=\"0.300001\">"),
            std::string::npos);
  const std::regex group("<g id=\"layer(\\d+)\"[^>]*>([^]*?)</g>"),
      path("<path d=\"([^\"]*)\" style=\"fill: white;[^\"]*fill-type: evenodd");
  std::uint32_t layer = 0;
  for (std::sregex_iterator it(svg.begin(), svg.end(), group), end; it != end; ++it, ++layer) {
    EXPECT_EQ((*it)[1].str(), std::to_string(layer));
    const std::string inside = (*it)[2].str();
    std::vector<Point2> points;
    std::uint32_t contours = 0;
    for (std::sregex_iterator p(inside.begin(), inside.end(), path); p != end; ++p) {
      for (const std::string& contour : split_at((*p)[1].str(), 'z')) {
        std::stringstream stream(contour);
        std::string x, y;
        if (!(stream >> x)) continue;
        EXPECT_EQ(x, "M");
        ++contours;
        while (stream >> x >> y) points.push_back({nm_of_text(x) + 5 * kMm, 27 * kMm - nm_of_text(y)});
      }
    }
    EXPECT_EQ(contours, job.contours[layer].size());
    EXPECT_TRUE(std::ranges::equal(points, job.contours[layer].point)) << "layer " << layer;
  }
  EXPECT_EQ(layer, 2u);
  EXPECT_NE(
      svg.find(
          "class=\"raster\" style=\"fill: none; stroke: #2980b9; stroke-linecap: round; stroke-linejoin: round; stroke-width: 0.4\""),
      std::string::npos);
  EXPECT_NE(svg.find("class=\"a,b/c $$x &lt;&amp;&quot;&gt; -&#45; .stl\""), std::string::npos) << "names are escaped";
}

/// What a CLI file says: for each layer its z, and its polylines and hatches.
struct CliPolyline {
  std::uint32_t id, direction;
  std::vector<std::array<double, 2>> points;
};
struct CliLayer {
  double z;
  std::vector<CliPolyline> polylines;
  std::uint32_t hatches = 0;
};

std::vector<CliLayer> read_cli_ascii(const std::string& text) {
  std::vector<CliLayer> layers;
  bool geometry = false;
  for (const std::string& line : split_at(text, '\n')) {
    if (line == "$$GEOMETRYSTART") geometry = true;
    if (!geometry) continue;
    const std::size_t slash = line.find('/');
    const std::string name = line.substr(0, slash);
    const std::vector<std::string> fields =
        slash == std::string::npos ? std::vector<std::string>() : split_at(line.substr(slash + 1), ',');
    if (name == "$$LAYER") layers.push_back({std::stod(fields[0]), {}});
    if (name == "$$HATCHES") layers.back().hatches += static_cast<std::uint32_t>(std::stoul(fields[1]));
    if (name != "$$POLYLINE") continue;
    CliPolyline polyline{
        static_cast<std::uint32_t>(std::stoul(fields[0])), static_cast<std::uint32_t>(std::stoul(fields[1])), {}};
    EXPECT_EQ(fields.size(), 3 + 2 * std::stoul(fields[2]));
    for (std::size_t i = 3; i + 1 < fields.size(); i += 2)
      polyline.points.push_back({std::stod(fields[i]), std::stod(fields[i + 1])});
    layers.back().polylines.push_back(std::move(polyline));
  }
  return layers;
}

std::vector<CliLayer> read_cli_binary(const std::string& text) {
  std::vector<CliLayer> layers;
  std::size_t at = text.find("$$HEADEREND") + 11;  // the payload follows at once
  const auto take = [&]<class T>(T) {
    T value;
    std::memcpy(&value, text.data() + at, sizeof value);
    at += sizeof value;
    return value;
  };
  while (at < text.size()) {
    const std::uint16_t command = take(std::uint16_t{});
    if (command == 127) {
      layers.push_back({take(float{}), {}});
    } else if (command == 130) {
      CliPolyline polyline{take(std::uint32_t{}), take(std::uint32_t{}), {}};
      for (std::uint32_t count = take(std::uint32_t{}); count > 0; --count) {
        const float x = take(float{}), y = take(float{});
        polyline.points.push_back({x, y});
      }
      layers.back().polylines.push_back(std::move(polyline));
    } else if (command == 132) {
      take(std::uint32_t{});
      const std::uint32_t count = take(std::uint32_t{});
      at += 16u * count;
      layers.back().hatches += count;
    } else {
      ADD_FAILURE() << "command " << command << " at byte " << at;
      break;
    }
  }
  EXPECT_EQ(at, text.size());
  return layers;
}

TEST(WriteCli, TextAndBinaryAreReadBackWithBothConventionsOfZ) {
  const Job job;
  for (const bool binary : {false, true}) {
    for (const bool empty_first : {false, true}) {
      const std::string file = job.file(*make_cli_encoder(binary, {empty_first}));
      EXPECT_TRUE(file.starts_with(
          binary ? "$$HEADERSTART\n$$BINARY\n$$UNITS/1.000000\n$$VERSION/200\n$$LABEL/1,a_b_c __x <&\"> -- .stl\n"
                 : "$$HEADERSTART\n$$ASCII\n$$UNITS/1.000000\n$$VERSION/200\n$$LABEL/1,a_b_c __x <&\"> -- .stl\n"));
      EXPECT_NE(
          file.find("\n$$DIMENSION/5,7,0,40,27,0.600001\n$$LAYERS/" + std::to_string(empty_first ? 3 : 2) + "\n$$HEADEREND"),
          std::string::npos);
      std::vector<CliLayer> layers = binary ? read_cli_binary(file) : read_cli_ascii(file);
      ASSERT_EQ(layers.size(), empty_first ? 3u : 2u);
      if (empty_first) {
        EXPECT_EQ(layers[0].z, 0);
        EXPECT_TRUE(layers[0].polylines.empty());
        layers.erase(layers.begin());
      }
      EXPECT_EQ(layers[0].hatches, 2u);
      for (std::uint32_t layer = 0; layer < 2; ++layer) {
        const double top = layer == 0 ? 0.3 : 0.600001;
        if (binary)
          EXPECT_EQ(layers[layer].z, static_cast<double>(static_cast<float>(top)));
        else
          EXPECT_EQ(layers[layer].z, top);
        std::uint32_t closed = 0;
        for (const CliPolyline& polyline : layers[layer].polylines) {
          if (polyline.direction == 2) continue;
          const std::span<const Point2> expected = job.contours[layer][closed];
          EXPECT_EQ(polyline.id, closed < 2 ? 1u : 2u);
          EXPECT_EQ(polyline.direction, closed == 1 ? 0u : 1u) << "outer 1, inner 0";
          ASSERT_EQ(polyline.points.size(), expected.size() + 1);
          EXPECT_EQ(polyline.points.front(), polyline.points.back()) << "closed: the first point comes again";
          for (std::size_t i = 0; i < expected.size(); ++i) {
            const double slack = binary ? 2e-6 : 1e-12;
            EXPECT_NEAR(polyline.points[i][0], expected[i].x * 1e-6, slack);
            EXPECT_NEAR(polyline.points[i][1], expected[i].y * 1e-6, slack);
          }
          ++closed;
        }
        EXPECT_EQ(closed, job.contours[layer].size());
      }
    }
  }
}

std::string zip_member(const std::string& path, const char* name) {
  int code = 0;
  zip_t* archive = zip_open(path.c_str(), ZIP_RDONLY, &code);
  if (archive == nullptr) return {};
  zip_stat_t stat;
  std::string text;
  if (zip_stat(archive, name, 0, &stat) == 0) {
    text.resize(stat.size);
    zip_file_t* file = zip_fopen(archive, name, 0);
    if (zip_fread(file, text.data(), stat.size) != static_cast<zip_int64_t>(stat.size)) text.clear();
    zip_fclose(file);
  }
  zip_close(archive);
  return text;
}

TEST(Write3mfSlices, ADateThatIsNoneIsReportedBeforeAnythingIsMade) {
  ::setenv("SOURCE_DATE_EPOCH", "yesterday", 1);
  const bool made = Slice3mfWriter::make(Job().head).ok();
  ::unsetenv("SOURCE_DATE_EPOCH");
  EXPECT_FALSE(made);
}

TEST(Write3mfSlices, PackageHoldsStacksThatSayWhatTheSlicesAreAndIsTheSameEveryTime) {
  const Job job;
  const fs::path folder = fs::temp_directory_path() / ("lamina_slices_" + std::to_string(::getpid()));
  fs::create_directories(folder);
  std::string bytes[2];
  for (std::string& one : bytes) {
    auto writer = Slice3mfWriter::make(job.head);
    ASSERT_TRUE(writer.ok()) << writer.error().message;
    for (const SliceLayer& layer : job.layers) ASSERT_TRUE(writer->add(layer).ok());
    auto package = writer->write((folder / "a.3mf").string());
    ASSERT_TRUE(package.ok()) << package.error().message;
    ASSERT_TRUE(package->finish().ok());
    EXPECT_FALSE(fs::exists(folder / "a.3mf.part"));
    std::ifstream file(folder / "a.3mf", std::ios::binary);
    one.assign(std::istreambuf_iterator<char>(file), {});
  }
  EXPECT_EQ(bytes[0], bytes[1]);
  const std::string model = zip_member((folder / "a.3mf").string(), "3D/3dmodel.model");
  fs::remove_all(folder);
  EXPECT_NE(model.find("requiredextensions=\"s\""), std::string::npos);
  EXPECT_NE(model.find("transform=\"1 0 0 0 1 0 0 0 1 5 7 0\""), std::string::npos) << model;
  EXPECT_NE(model.find("s:meshresolution=\"lowres\""), std::string::npos);
  const std::regex stack("<s:slicestack id=\"(\\d+)\" zbottom=\"([^\"]+)\">([^]*?)</s:slicestack>"),
      slice("<s:slice ztop=\"([^\"]+)\"(/>|>([^]*?)</s:slice>)"), vertex("<s:vertex x=\"([^\"]+)\" y=\"([^\"]+)\""),
      polygon("<s:polygon startv=\"(\\d+)\">([^]*?)</s:polygon>"), segment("v2=\"(\\d+)\"");
  std::uint32_t stacks = 0;
  for (std::sregex_iterator s(model.begin(), model.end(), stack), end; s != end; ++s, ++stacks) {
    const std::string slices = (*s)[3].str();
    std::uint32_t layer = 0;
    for (std::sregex_iterator l(slices.begin(), slices.end(), slice); l != end; ++l, ++layer) {
      EXPECT_NEAR(std::stod((*l)[1].str()), layer == 0 ? 0.3 : 0.600001, 1e-7);
      const std::string inside = (*l)[3].str();
      std::vector<std::array<double, 2>> vertices;
      for (std::sregex_iterator v(inside.begin(), inside.end(), vertex); v != end; ++v)
        vertices.push_back({std::stod((*v)[1]), std::stod((*v)[2])});
      std::uint32_t contour = job.body[layer][stacks];
      for (std::sregex_iterator p(inside.begin(), inside.end(), polygon); p != end; ++p, ++contour) {
        std::vector<std::size_t> indices{std::stoul((*p)[1])};
        const std::string segments = (*p)[2].str();
        for (std::sregex_iterator i(segments.begin(), segments.end(), segment); i != end; ++i)
          indices.push_back(std::stoul((*i)[1]));
        EXPECT_EQ(indices.front(), indices.back()) << "closed";
        const std::span<const Point2> expected = job.contours[layer][contour];
        ASSERT_EQ(indices.size(), expected.size() + 1);
        for (std::size_t i = 0; i < expected.size(); ++i) {
          // Counted from the item's place on the bed.
          EXPECT_EQ(std::llround((vertices[indices[i]][0] + 5) * 1e6), expected[i].x);
          EXPECT_EQ(std::llround((vertices[indices[i]][1] + 7) * 1e6), expected[i].y);
        }
      }
      EXPECT_EQ(contour, job.body[layer][stacks + 1]);
    }
    EXPECT_EQ(layer, 2u) << "an empty slice is there too";
  }
  EXPECT_EQ(stacks, 2u);
}

TEST(Write3mfSlices, AFileThatMayNotGrowIsAnErrorAndLeavesNothing) {
  const Job job;
  const std::string path = fs::temp_directory_path() / ("lamina_limited_" + std::to_string(::getpid()) + ".3mf");
  const pid_t child = ::fork();
  if (child == 0) {
    std::signal(SIGXFSZ, SIG_IGN);
    const rlimit limit{512, 512};
    ::setrlimit(RLIMIT_FSIZE, &limit);
    auto writer = Slice3mfWriter::make(job.head);
    for (const SliceLayer& layer : job.layers) {
      if (!writer->add(layer)) ::_exit(1);
    }
    const auto package = writer->write(path);
    ::_exit(!package && package.error().message.find("File too large") != std::string::npos ? 0 : 2);
  }
  int result = -1;
  ASSERT_EQ(::waitpid(child, &result, 0), child);
  EXPECT_EQ(result, 0);
  EXPECT_FALSE(fs::exists(path) || fs::exists(path + ".part"));
}

}  // namespace
}  // namespace lamina::test
