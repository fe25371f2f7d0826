// tests/load/test_stl_sound.cpp: a file read in one pass is the file as it is read otherwise, and what is not sound goes that
// way.
#include <tbb/global_control.h>

#include <random>

#include "stages/geometry/blocks/mesh_blocks.h"
#include "tests/load/files.h"

namespace lamina::test {
namespace {

load::LoadOptions as_blocks(load::LoadOptions options = {}) {
  options.blocks = true;
  return options;
}

/// The triangles of a mesh as a list, wherever they are.
Buffer<Triangle> all_triangles(const Mesh& mesh) {
  if (!mesh.blocks) return mesh.triangles;
  Buffer<Triangle> all;
  for (std::uint32_t i = 0; i < mesh.blocks->triangle_count(); ++i) {
    all.push_back(mesh.blocks->triangle(i / kClusterSize, i % kClusterSize));
  }
  return all;
}

/// Loads a file both ways and compares all that a job could tell. returns  whether it came as blocks
bool expect_same_either_way(const std::string& path, const load::LoadOptions& options = {}) {
  SCOPED_TRACE(path);
  const Result<Part> list = load::load(path, options), blocks = load::load(path, as_blocks(options));
  const auto message = [](const Result<Part>& part) { return part ? std::string() : part.error().message; };
  EXPECT_EQ(message(list), message(blocks));
  if (!list || !blocks) return false;
  EXPECT_EQ(notes_of(*list), notes_of(*blocks));
  EXPECT_EQ(list->bounds.lo, blocks->bounds.lo);
  EXPECT_EQ(list->bounds.hi, blocks->bounds.hi);
  EXPECT_EQ(list->meshes.size(), blocks->meshes.size());
  bool any = false;
  for (std::size_t m = 0; m < std::min(list->meshes.size(), blocks->meshes.size()); ++m) {
    const Mesh &one = list->meshes[m], &other = blocks->meshes[m];
    EXPECT_EQ(one.name, other.name);
    EXPECT_EQ(one.fingerprint, other.fingerprint);
    EXPECT_EQ(one.closed, other.closed);
    EXPECT_EQ(one.bounds.lo, other.bounds.lo);
    EXPECT_EQ(one.bounds.hi, other.bounds.hi);
    EXPECT_EQ(one.repaired_from, other.repaired_from);
    EXPECT_NEAR(one.volume_mm3, other.volume_mm3, 1e-9 * std::abs(one.volume_mm3));
    EXPECT_EQ(one.capped_share, other.capped_share);
    EXPECT_TRUE(canonical(all_triangles(one)) == canonical(all_triangles(other)));
    any |= other.blocks != nullptr;
  }
  return any;
}

TEST(ReadSoundStl, AClosedFileComesAsBlocks) {
  EXPECT_TRUE(expect_same_either_way(write_file("box.stl", binary_stl(unit_box()))));
  EXPECT_TRUE(expect_same_either_way(write_file("solid.stl", binary_stl(unit_box(), "solid"))));
  EXPECT_TRUE(expect_same_either_way(write_file("stray.stl", binary_stl(unit_box()) + std::string(7, 'x'))));
  EXPECT_TRUE(expect_same_either_way(write_file("zero.stl", binary_stl(unit_box(), "", 0))));
}

TEST(ReadSoundStl, EveryStlOfTheCorpusIsTheSameEitherWay) {
  int blocks = 0;
  for (const auto& file : part_files(std::filesystem::path(LAMINA_TEST_DIR) / "corpus")) {
    if (file.extension() == ".stl") blocks += expect_same_either_way(file.string());
  }
  EXPECT_GE(blocks, 3);
}

TEST(ReadSoundStl, TransformedFilesAreTheSameEitherWay) {
  load::LoadOptions options;
  options.unit_mm = 2.54;
  const std::string path = write_file("box.stl", binary_stl(unit_box()));
  EXPECT_TRUE(expect_same_either_way(path, options));
  options.transform = load::make_transform({1, -1.5, 0.3}, {10, 90, 33}, {1, 1, 1.01});
  EXPECT_TRUE(expect_same_either_way(path, options)) << "mirrored facets are turned over";
}

TEST(ReadSoundStl, WhatIsNotSoundIsReadAgainForItsList) {
  std::vector<FloatTriangle> open = unit_box(), reversed = unit_box(), twice = unit_box(), flat = unit_box(), bad = unit_box();
  open.pop_back();
  for (FloatTriangle& f : reversed) std::swap_ranges(f.begin(), f.begin() + 3, f.begin() + 3);
  twice.insert(twice.end(), reversed.begin(), reversed.end());
  std::vector<FloatTriangle> neighbour = box_facets({50, 0, 0}, {60, 10, 10});
  neighbour.insert(neighbour.end(), twice.begin(), twice.end());
  for (FloatTriangle& f : flat) f[2] = f[5] = f[8] = 1;
  bad[7][3] = NAN;
  load::LoadOptions drop;
  drop.drop_bad = true;
  load::LoadOptions as_is;
  as_is.repair = false;
  const auto file = [](const std::vector<FloatTriangle>& facets, std::int64_t count = -1) {
    return write_file("part.stl", binary_stl(facets, "", count));
  };
  for (const load::LoadOptions& options : {load::LoadOptions(), drop, as_is}) {
    for (const auto& facets : {open, reversed, twice, neighbour, flat, bad})
      EXPECT_FALSE(expect_same_either_way(file(facets), options));
    EXPECT_FALSE(expect_same_either_way(file(unit_box(), 20), options)) << "the header says more";
    EXPECT_FALSE(expect_same_either_way(file(neighbour, 12), options)) << "the header says less";
    EXPECT_FALSE(expect_same_either_way(file({}), options));
    EXPECT_FALSE(expect_same_either_way(write_file("rest.stl", binary_stl(unit_box()) + std::string(777, 'x')), options));
    EXPECT_FALSE(expect_same_either_way(write_file("short.stl", binary_stl(unit_box()).substr(0, 300)), options));
  }
}

TEST(ReadSoundStl, ManyBlocksAreTheSameForEveryNumberOfThreadsAndEveryInstructionSet) {
  std::mt19937 random(11);
  std::vector<FloatTriangle> facets;
  for (int i = 0; i < 1500; ++i) {
    const auto at = [&] { return static_cast<float>(random() % 100'000) / 1000; };
    const float x = at(), y = at(), z = at();
    for (const FloatTriangle& facet : box_facets({x, y, z}, {x + 1, y + at() / 50 + 0.001f, z + 2})) facets.push_back(facet);
  }
  const std::string path = write_file("boxes.stl", binary_stl(facets));
  EXPECT_TRUE(expect_same_either_way(path));
  std::vector<Part> parts;
  for (const std::size_t threads : {1, 2, 16}) {
    const tbb::global_control control(tbb::global_control::max_allowed_parallelism, threads);
    parts.push_back(loaded(path, as_blocks()));
    ASSERT_NE(parts.back().meshes[0].blocks, nullptr);
    EXPECT_EQ(parts.back().meshes[0].volume_mm3, parts[0].meshes[0].volume_mm3);
    EXPECT_EQ(parts.back().meshes[0].fingerprint, parts[0].meshes[0].fingerprint);
    EXPECT_TRUE(all_triangles(parts.back().meshes[0]) == all_triangles(parts[0].meshes[0]));
  }
  for (const Isa isa : {Isa::kPlain, Isa::kAvx2, Isa::kAvx512}) {
    load::LoadOptions options = as_blocks();
    options.isa = isa;  // at most what the processor has
    const Mesh mesh = loaded(path, options).meshes[0];
    EXPECT_EQ(mesh.volume_mm3, parts[0].meshes[0].volume_mm3);
    EXPECT_EQ(mesh.fingerprint, parts[0].meshes[0].fingerprint);
    EXPECT_TRUE(all_triangles(mesh) == all_triangles(parts[0].meshes[0]));
  }
}

// What a reader knew of one file is forgotten at the next: its box, its fingerprint, and that it was open.
TEST(ReadSoundStl, FilesThatShareMemoryAreEachAsIfReadAlone) {
  std::vector<FloatTriangle> open = box_facets({-50, -60, -70}, {80, 90, 99});
  open.pop_back();
  const std::string first = write_file("first.stl", binary_stl(box_facets({0, 0, 0}, {30, 20, 10})));
  const std::string hole = write_file("hole.stl", binary_stl(open));
  const std::string last = write_file("last.stl", binary_stl(unit_box()));
  load::LoadOptions options;
  options.scratch = load::make_scratch();
  EXPECT_TRUE(expect_same_either_way(first, options));
  EXPECT_FALSE(expect_same_either_way(hole, options));
  EXPECT_TRUE(expect_same_either_way(last, options));
}

}  // namespace
}  // namespace lamina::test
