// tests/formats/test_mesh3mf.cpp: meshes as 3MF, read back by the loader, and the ZIP file around them by libzip.
#include <gtest/gtest.h>
#include <unistd.h>
#include <zip.h>

#include <algorithm>
#include <filesystem>
#include <fstream>

#include "stages/formats/threemf/threemf.h"
#include "stages/formats/zip/zip.h"
#include "stages/load/load.h"

namespace lamina::test {
namespace {

namespace fs = std::filesystem;
using namespace lamina::formats;

class Mesh3mf : public ::testing::Test {
 protected:
  fs::path folder_ = fs::temp_directory_path() / ("lamina_mesh3mf_" + std::to_string(::getpid()));
  std::string path_ = (folder_ / "a.3mf").string();
  void SetUp() override { fs::create_directories(folder_); }
  void TearDown() override { fs::remove_all(folder_); }
  std::string bytes() const {
    std::ifstream file(path_, std::ios::binary);
    return {std::istreambuf_iterator<char>(file), {}};
  }
};

std::vector<Triangle> tetrahedron(Nm size) {
  const Point3 o{-1, -2'000'001, 0}, x{size, 0, 0}, y{0, size, 0}, z{0, 0, size};
  return {{o, y, x}, {o, x, z}, {o, z, y}, {x, y, z}};
}

TEST_F(Mesh3mf, IsReadBackToTheNanometre) {
  auto small = tetrahedron(1'234'567'891);
  small.push_back({small[0].a, small[0].a, small[0].b});  // a triangle that 3MF forbids
  const auto other = tetrahedron(5'000'000);
  const std::vector<Mesh3mfObject> objects{{"a <&\"\xff\x01>", small}, {"", other}};
  const std::vector<Instance> instances{{0, {0, 0, 0}}, {1, {7, -12'345'678, 2'000'000'000}}, {1, {0, 0, 1}}};
  std::string first;
  for (int run = 0; run < 2; ++run) {
    auto file = File::open(path_);
    ASSERT_TRUE(file.ok()) << file.error().message;
    const auto counts = write_mesh_3mf(*file, objects, instances, "lamina test");
    ASSERT_TRUE(counts.ok()) << counts.error().message;
    EXPECT_EQ(counts->vertices, 8u);
    EXPECT_EQ(counts->triangles, 8u);
    EXPECT_EQ(counts->degenerate, 1u);
    ASSERT_TRUE(file->finish().ok());
    if (run == 0) first = bytes();
  }
  EXPECT_EQ(bytes(), first);
  const Result<Part> part = load::load(path_, {});
  ASSERT_TRUE(part.ok()) << part.error().message;
  ASSERT_EQ(part->meshes.size(), 2u);
  ASSERT_EQ(part->instances.size(), 3u);
  small.pop_back();
  EXPECT_TRUE(std::ranges::equal(part->meshes[0].triangles, small));
  EXPECT_NE(part->meshes[0].name.find("object 1 \"a <&\"?\?>\""), std::string::npos) << part->meshes[0].name;
  const Point3 second = part->instances[1].offset;
  EXPECT_EQ(part->meshes[1].bounds.lo.z + second.z, 2'000'000'000);
  EXPECT_EQ(part->meshes[1].bounds.lo.y + second.y, -2'000'001 - 12'345'678);
}

TEST_F(Mesh3mf, AnObjectWithoutTrianglesIsRefused) {
  auto file = File::open(path_);
  const std::vector<Mesh3mfObject> objects{{"sheet", {}}};
  const std::vector<Instance> instances{{0, {0, 0, 0}}};
  const auto counts = write_mesh_3mf(*file, objects, instances, "lamina test");
  ASSERT_FALSE(counts.ok());
  EXPECT_EQ(counts.error().fault, Fault::kInput);
}

TEST_F(Mesh3mf, PackagesBeginWithTheirTypesAndHaveARealDate) {
  auto file = File::open(path_);
  const auto triangles = tetrahedron(9'000'000);
  const std::vector<Mesh3mfObject> objects{{"t", triangles}};
  const std::vector<Instance> instances{{0, {0, 0, 0}}};
  ASSERT_TRUE(write_mesh_3mf(*file, objects, instances, "lamina test").ok());
  ASSERT_TRUE(file->finish().ok());
  const std::string zipped = bytes();
  EXPECT_EQ(zipped.substr(30, 19), "[Content_Types].xml");
  EXPECT_EQ(zipped.substr(4, 2), std::string("\x14\0", 2)) << "version 2.0: no Zip64";
  EXPECT_EQ(zipped.substr(10, 4), std::string("\0\0\x21\0", 4)) << "1 January 1980, 0:00";
  EXPECT_EQ(zipped.find("PK\x06\x06"), std::string::npos);
}

TEST_F(Mesh3mf, TheDateIsThatOfReproducibleBuilds) {
  const auto date = [](int year, int month, int day, int hour, int minute, int second) {
    return static_cast<ZipDate>(year - 1980) << 25 |
           static_cast<ZipDate>(month << 21 | day << 16 | hour << 11 | minute << 5 | second / 2);
  };
  EXPECT_EQ(*zip_date(nullptr), date(1980, 1, 1, 0, 0, 0));
  EXPECT_EQ(*zip_date(""), kFirstZipDate);
  EXPECT_EQ(*zip_date("1709251199"), date(2024, 2, 29, 23, 59, 58)) << "date -u -d @1709251199";
  EXPECT_EQ(*zip_date("0"), kFirstZipDate) << "before what a ZIP file knows";
  EXPECT_EQ(*zip_date("99999999999"), date(2107, 12, 31, 23, 59, 58)) << "behind it";
  EXPECT_FALSE(zip_date("yesterday").ok());
  EXPECT_FALSE(zip_date("12x").ok());
}

TEST_F(Mesh3mf, LargeFilesAreZip64) {
  const std::string text(300'000, 'x');
  {
    auto file = File::open(path_);
    ZipWriter zip(*file, kFirstZipDate, 200);
    for (const char* name : {"one", "two"}) {
      std::vector<Deflated> pieces(2);
      for (Deflated& piece : pieces) ASSERT_TRUE(deflate_onto(piece, text).ok());
      ASSERT_TRUE(zip.add(name, pieces).ok());
    }
    ASSERT_TRUE(zip.finish().ok());
    ASSERT_TRUE(file->finish().ok());
  }
  EXPECT_NE(bytes().find("PK\x06\x06"), std::string::npos);
  int code = 0;
  zip_t* const archive = zip_open(path_.c_str(), ZIP_RDONLY | ZIP_CHECKCONS, &code);
  ASSERT_NE(archive, nullptr) << code;
  zip_file_t* const entry = zip_fopen(archive, "two", 0);
  ASSERT_NE(entry, nullptr);
  std::string read(2 * text.size() + 1, '\0');
  EXPECT_EQ(zip_fread(entry, read.data(), read.size()), static_cast<zip_int64_t>(2 * text.size()));
  EXPECT_EQ(read.substr(0, 2 * text.size()), text + text);
  zip_fclose(entry);
  zip_discard(archive);
}

}  // namespace
}  // namespace lamina::test
