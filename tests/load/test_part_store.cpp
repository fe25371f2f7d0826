// tests/load/test_part_store.cpp: parts that jobs share are those that each would read, and no more than fit.
#include "stages/load/part_store.h"

#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <set>
#include <thread>

#include "stages/geometry/blocks/mesh_blocks.h"
#include "tests/load/archives.h"
#include "tests/load/files.h"

namespace lamina {
namespace {

using load::LoadOptions;
using load::PartStore;
using test::corpus;

/// Waits until a file that is written now is older than a step of its clock.
void settle() { std::this_thread::sleep_for(std::chrono::milliseconds(130)); }

LoadOptions sharing(const std::shared_ptr<PartStore>& store, LoadOptions options = {}) {
  options.store = store;
  return options;
}

void expect_equal(const Part& one, const Part& other) {
  ASSERT_EQ(one.meshes.size(), other.meshes.size());
  for (std::size_t i = 0; i < one.meshes.size(); ++i) {
    const Mesh &a = one.meshes[i], &b = other.meshes[i];
    EXPECT_EQ(a.name, b.name);
    EXPECT_EQ(a.fingerprint, b.fingerprint);
    EXPECT_EQ(a.repaired_from, b.repaired_from);
    EXPECT_EQ(a.volume_mm3, b.volume_mm3);
    const auto list = [](const Mesh& mesh) { return mesh.blocks ? list_of(*mesh.blocks) : mesh.triangles; };
    EXPECT_TRUE(list(a) == list(b));
  }
  EXPECT_EQ(test::notes_of(one), test::notes_of(other));
  EXPECT_EQ(one.path, other.path);
}

std::vector<LoadOptions> kinds_of_options() {
  std::vector<LoadOptions> all(8);
  all[1].repair = false;
  all[2].weld_nm = 100;
  all[3].transform = load::make_transform({2, 2, 2}, {0, 0, 30}, {1, 1, 1});
  all[4].blocks = true;
  all[5].blocks = all[5].order = true;
  all[6].unit_mm = 25.4;
  all[7].turn_shells = false;
  return all;
}

TEST(PartStores, PartsAreThoseThatEachJobWouldReadWithAnyOptions) {
  const std::string packed = test::write_file("shared.stl.gz", test::gzip(test::read_file(corpus("dental_crown.stl"))));
  settle();
  const auto store = std::make_shared<PartStore>(1u << 30);
  std::set<std::uint64_t> different;
  for (const std::string& path :
       {corpus("dental_crown.stl"), corpus("broken/cube_missing_corner.stl"), packed, corpus("arrow_scaled_mirrored.3mf"),
        corpus("broken/nist_unwelded_1um.stl"), corpus("cube_gears_17_items.3mf")}) {
    SCOPED_TRACE(path);
    for (const int repetition : {0, 1, 2}) {
      for (const LoadOptions& options : kinds_of_options()) {
        const auto shared = load::load(path, sharing(store, options)), own = load::load(path, options);
        ASSERT_EQ(shared.ok(), own.ok()) << repetition;
        if (own) {
          expect_equal(*shared, *own);
          different.insert(own->meshes[0].fingerprint);
        }
        if (!own) {
          EXPECT_EQ(shared.error().message, own.error().message);
        }
      }
    }
  }
  EXPECT_GE(different.size(), 15u) << "options matter";
  EXPECT_GE(store->hits(), 6u * 8) << "the third time all come from the store";
}

TEST(PartStores, ChangedFilesAreReadAgain) {
  const auto store = std::make_shared<PartStore>(1u << 30);
  const auto cube = [](float size) { return test::gzip(test::binary_stl(test::box_facets({0, 0, 0}, {size, size, size}))); };
  const std::string path = test::write_file("changing.stl.gz", cube(10));
  test::loaded(path, sharing(store));
  EXPECT_EQ(store->bytes(), 0u) << "the file may change within a step of its clock";
  settle();
  for (int i = 0; i < 2; ++i) EXPECT_EQ(test::loaded(path, sharing(store)).bounds.height(), 10'000'000);
  EXPECT_GT(store->bytes(), 0u);
  EXPECT_EQ(store->hits(), 1u);
  for (const float size : {20.f, 30.f}) {
    test::write_file("changing.stl.gz", cube(size));
    EXPECT_EQ(test::loaded(path, sharing(store)).bounds.height(), static_cast<std::int64_t>(size) * 1'000'000);
  }
  EXPECT_EQ(store->hits(), 1u);
  std::filesystem::remove(path);
  EXPECT_FALSE(load::load(path, sharing(store)));
}

TEST(PartStores, ErrorsAreReportedToEachJob) {
  const auto store = std::make_shared<PartStore>(1u << 30);
  for (int i = 0; i < 3; ++i) {
    for (const char* file : {"broken/random_bits.3mf", "broken/empty_file.stl", "broken/nut_nan_inf.stl"}) {
      EXPECT_EQ(test::refusal(corpus(file), sharing(store)), test::refusal(corpus(file))) << file;
    }
  }
}

TEST(PartStores, JobsAtOnceGetTheSameParts) {
  const auto store = std::make_shared<PartStore>(1u << 20);  // less than all
  const std::vector<std::string> paths = {corpus("dental_crown.stl"), corpus("cube_gears_17_items.3mf"),
                                          corpus("broken/cube_missing_corner.stl")};
  std::vector<Part> own;
  for (const std::string& path : paths) own.push_back(test::loaded(path));
  std::atomic<int> equal{0};
  std::vector<std::thread> threads;
  for (std::size_t t = 0; t < 4; ++t) {
    threads.emplace_back([&, t] {
      for (std::size_t i = 0; i < 9; ++i) {
        const std::size_t p = (i + t) % paths.size();
        const auto part = load::load(paths[p], sharing(store));
        equal += part && part->meshes.size() == own[p].meshes.size() && part->meshes[0].triangles == own[p].meshes[0].triangles;
      }
    });
  }
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(equal, 36);
  EXPECT_LE(store->bytes(), 1u << 20);
}

TEST(PartStores, MemoryStaysWithinTheLimitAndReusedPartsStayLongest) {
  PartStore store(100);
  const std::string path = test::write_file("any.stl", "any");
  settle();
  const FileStamp stamp = *file_stamp(path);
  const auto add = [&](const std::string& key, std::uint64_t bytes) {
    store.add(key, path, stamp, std::make_shared<const int>(1), bytes);
    EXPECT_LE(store.bytes(), 100u);
  };
  const auto has = [&](const std::string& key) { return store.find<int>(key, stamp) != nullptr; };
  add("reused", 40);
  EXPECT_TRUE(has("reused"));
  for (int i = 0; i < 10; ++i) add("once " + std::to_string(i), 30);
  EXPECT_TRUE(has("reused"));
  EXPECT_FALSE(has("once 7"));
  EXPECT_TRUE(has("once 8"));
  add("too large", 101);
  EXPECT_FALSE(has("too large"));
  store.limit(75);
  EXPECT_LE(store.bytes(), 75u);
  store.limit(0);
  EXPECT_EQ(store.bytes(), 0u);
  EXPECT_FALSE(has("reused"));
}

TEST(PartStores, OnlyTheFirstVariantOfAFileIsStoredAtOnce) {
  PartStore store(100);
  EXPECT_TRUE(store.wants("file at 0 degrees", "file"));
  EXPECT_FALSE(store.wants("file at 30 degrees", "file"));
  EXPECT_TRUE(store.wants("file at 30 degrees", "file"));
}

}  // namespace
}  // namespace lamina
