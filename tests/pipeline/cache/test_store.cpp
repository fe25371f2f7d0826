// tests/pipeline/cache/test_store.cpp: a cache gives the bytes that were added or nothing, however it was damaged.
#include "pipeline/cache/store.h"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <atomic>
#include <filesystem>
#include <thread>

#include "pipeline/cache/upkeep.h"
#include "tests/commands/program.h"

namespace lamina::pipeline {
namespace {

namespace fs = std::filesystem;
using test::Directory;
using test::read_text;
using test::write_text;

const std::atomic<bool> kNeverStops{false};

std::shared_ptr<JobCache> open_in(const Directory& directory, bool link = false) {
  auto cache = JobCache::open(directory / "cache", link);
  EXPECT_TRUE(cache.ok()) << (cache ? "" : cache.error().message);
  return *cache;
}

/// The one file of objects/ or jobs/.
std::string only_file(const Directory& directory, const std::string& kind) {
  std::string found;
  for (const auto& entry : fs::recursive_directory_iterator(directory / ("cache/" + kind))) {
    if (entry.is_regular_file()) found = entry.path();
  }
  return found;
}

TEST(JobCacheStore, GivesTheBytesThatWereAdded) {
  const Directory directory;
  const auto cache = open_in(directory);
  for (const std::size_t size : {0u, 1u, 1000u, (1u << 20) - 1, 1u << 20, (2u << 20) + 5}) {
    const std::string bytes(size, 'x');
    write_text(directory / "from", bytes);
    const auto digest = cache->add_object(directory / "from");
    ASSERT_TRUE(digest.ok());
    ASSERT_TRUE(cache->fetch(*digest, directory / "to").ok()) << size;
    EXPECT_EQ(read_text(directory / "to"), bytes);
    fs::remove(directory / "to");
  }
}

TEST(JobCacheStore, DetectsEveryDamageOfAnObjectAndRemovesIt) {
  const Directory directory;
  const auto cache = open_in(directory);
  const std::string bytes = "the bytes of a layer";
  const auto add = [&] {
    write_text(directory / "from", bytes);
    return *cache->add_object(directory / "from");
  };
  const FileDigest digest = add();
  std::vector<std::string> others = {"", bytes + "x", bytes.substr(1), std::string(bytes.size(), 'y')};
  for (std::size_t bit = 0; bit < 8 * bytes.size(); ++bit) {
    others.push_back(bytes);
    others.back()[bit / 8] = static_cast<char>(others.back()[bit / 8] ^ 1 << bit % 8);
  }
  for (const std::string& other : others) {
    EXPECT_EQ(add().hash, digest.hash);
    write_text(only_file(directory, "objects"), other);
    const Status status = cache->fetch(digest, directory / "to");
    ASSERT_FALSE(status.ok());
    EXPECT_EQ(status.error().fault, Fault::kInput);
    EXPECT_FALSE(fs::exists(directory / "to"));
    EXPECT_EQ(only_file(directory, "objects"), "");
  }
  EXPECT_EQ(cache->fetch(digest, directory / "to").error().fault, Fault::kInput);  // missing
}

TEST(JobCacheStore, DetectsEveryDamageOfAnEntryAndRemovesIt) {
  const Directory directory;
  const auto cache = open_in(directory);
  const Hash128 key{1, 2};
  const CacheEntry entry{{{"layers/000000.tif", {7, {3, 4}}}}, Json{{"seconds", 1.5}}};
  ASSERT_TRUE(cache->add(key, entry).ok());
  const std::string file = only_file(directory, "jobs"), text = read_text(file);
  const auto found = cache->find(key);
  ASSERT_TRUE(found);
  EXPECT_EQ(found->files.front().name, "layers/000000.tif");
  EXPECT_EQ(found->files.front().digest.bytes, 7u);
  EXPECT_EQ(found->files.front().digest.hash, (Hash128{3, 4}));
  EXPECT_EQ(found->facts.at("seconds").get<double>(), 1.5);
  for (std::size_t at = 0; at < text.size(); ++at) {
    std::string other = text;
    other[at] = static_cast<char>(other[at] ^ 1);
    write_text(file, other);
    EXPECT_FALSE(cache->find(key)) << at;
    EXPECT_FALSE(fs::exists(file)) << at;
    write_text(file, text.substr(0, at));
    EXPECT_FALSE(cache->find(key)) << at;
  }
  write_text(file, text);
  EXPECT_TRUE(cache->find(key));
  // Another job's entry in its position.
  ASSERT_TRUE(cache->add({9, 9}, entry).ok());
  for (const auto& other : fs::recursive_directory_iterator(directory / "cache/jobs")) {
    if (other.is_regular_file() && other.path() != file) fs::rename(other.path(), file);
  }
  EXPECT_FALSE(cache->find(key));
}

TEST(JobCacheStore, LinksAreReadOnlyAndChecked) {
  const Directory directory;
  const auto cache = open_in(directory, true);
  write_text(directory / "from", "bytes");
  const FileDigest digest = *cache->add_object(directory / "from", {}, true);
  ASSERT_TRUE(cache->fetch(digest, directory / "to").ok());
  struct stat facts {};
  ASSERT_EQ(::stat((directory / "to").c_str(), &facts), 0);
  EXPECT_EQ(facts.st_nlink, 3u);
  EXPECT_EQ(facts.st_mode & 0777, 0444u);
  fs::permissions(directory / "to", fs::perms::owner_write, fs::perm_options::add);
  write_text(directory / "to", "other");  // as root or after chmod, a user changes the cache too
  EXPECT_EQ(cache->fetch(digest, directory / "second").error().fault, Fault::kInput);
  EXPECT_FALSE(fs::exists(directory / "second"));
}

TEST(JobCacheStore, RefusesFoldersOfOthers) {
  const Directory directory;
  fs::create_directory(directory / "cache");
  write_text(directory / "cache/letter.txt", "mine");
  const auto cache = JobCache::open(directory / "cache", false);
  ASSERT_FALSE(cache.ok());
  EXPECT_EQ(cache.error().fault, Fault::kUsage);
  EXPECT_NE(cache.error().message.find("letter.txt"), std::string::npos);
}

TEST(JobCacheStore, TrimsTheEntriesThatWereUsedLongestAgo) {
  const Directory directory;
  const auto cache = open_in(directory);
  const std::int64_t now = std::time(nullptr);
  const auto file_of = [&](const std::string& name, std::size_t bytes) {
    write_text(directory / "from", std::string(bytes, name.front()));
    return CachedFile{name, *cache->add_object(directory / "from")};
  };
  const CachedFile shared = file_of("s", 10'000);
  for (std::uint64_t i = 0; i < 4; ++i) {
    ASSERT_TRUE(cache->add({i, i}, {{file_of(std::string(1, static_cast<char>('a' + i)), 10'000), shared}, Json()}).ok());
  }
  const auto entries = cache->entries();
  for (const JobCache::EntryFile& entry : *entries) {
    // The first entry was used last.
    const timespec times[2] = {{now, 0}, {now - static_cast<std::int64_t>(entry.key.low) * 100, 0}};
    const std::string name = hex(entry.key);
    ::utimensat(AT_FDCWD, (directory / ("cache/jobs/" + name.substr(0, 2) + "/" + name)).c_str(), times, 0);
  }
  static_cast<void>(file_of("z", 5'000));  // without an entry, young
  const auto trimmed = trim_cache(*cache, 37'000, now, kNeverStops);
  ASSERT_TRUE(trimmed.ok());
  EXPECT_EQ(trimmed->entries, 2u);
  EXPECT_EQ(trimmed->objects, 2u);
  EXPECT_TRUE(cache->find({0, 0}));
  EXPECT_TRUE(cache->find({1, 1}));
  EXPECT_FALSE(cache->find({2, 2}));
  EXPECT_TRUE(cache->stream(shared.digest, {}).ok());
  EXPECT_EQ(cache->objects()->size(), 4u);
  ASSERT_TRUE(trim_cache(*cache, UINT64_MAX, now + 4000, kNeverStops).ok());
  EXPECT_EQ(cache->objects()->size(), 3u);  // an hour later
  EXPECT_LE(measure_cache(*cache)->bytes, 37'000u);
}

TEST(JobCacheStore, ChecksEntriesAndTheirObjects) {
  const Directory directory;
  const auto cache = open_in(directory);
  write_text(directory / "from", "bytes");
  const FileDigest digest = *cache->add_object(directory / "from");
  ASSERT_TRUE(cache->add({1, 1}, {{{"layers/000000.tif", digest}}, Json()}).ok());
  EXPECT_TRUE(check_cache(*cache, kNeverStops)->damaged.empty());
  write_text(only_file(directory, "objects"), "bytez");
  EXPECT_EQ(check_cache(*cache, kNeverStops)->damaged.size(), 2u);
  EXPECT_TRUE(cache->entries()->empty());
  EXPECT_TRUE(cache->objects()->empty());
}

TEST(JobCacheStore, ContinuesWithoutItsFolder) {
  const Directory directory;
  const auto cache = open_in(directory);
  fs::remove_all(directory / "cache");
  EXPECT_FALSE(cache->find({1, 1}));
  write_text(directory / "from", "bytes");
  const auto digest = cache->add_object(directory / "from");
  ASSERT_TRUE(digest.ok());
  EXPECT_TRUE(cache->fetch(*digest, directory / "to").ok());
  EXPECT_TRUE(JobCache::open(directory / "cache", false).ok());
  // Another process is removing the folder, and has removed its tag.
  fs::remove(directory / "cache/CACHEDIR.TAG");
  EXPECT_TRUE(JobCache::open(directory / "cache", false).ok());
}

TEST(JobCacheStore, ThreadsAddAndFetchTheSameObjects) {
  const Directory directory;
  const auto cache = open_in(directory);
  std::atomic<int> wrong{0};
  std::vector<std::thread> threads;
  for (int t = 0; t < 4; ++t) {
    threads.emplace_back([&, t] {
      for (int i = 0; i < 40; ++i) {
        const std::string from = directory / ("from" + std::to_string(t)), to = directory / ("to" + std::to_string(t));
        const std::string bytes(1000, static_cast<char>('a' + i % 5));
        write_text(from, bytes);
        const auto digest = cache->add_object(from);
        const bool good = digest && cache->fetch(*digest, to) && read_text(to) == bytes;
        wrong += !good;
        fs::remove(to);
      }
    });
  }
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(wrong, 0);
}

TEST(InputDigests, NoticeEveryChangeOfAFile) {
  const Directory directory;
  const std::string file = directory / "part.stl";
  InputDigests digests;
  write_text(file, "one");
  EXPECT_EQ(digests.of(file)->hash, hash_text("one"));
  write_text(file, "two");  // same size, at once
  EXPECT_EQ(digests.of(file)->hash, hash_text("two"));
  struct stat facts {};
  ASSERT_EQ(::stat(file.c_str(), &facts), 0);
  std::this_thread::sleep_for(std::chrono::milliseconds(150));
  EXPECT_EQ(digests.of(file)->hash, hash_text("two"));  // from now on it is known
  write_text(file, "six");
  const timespec times[2] = {facts.st_atim, facts.st_mtim};
  ASSERT_EQ(::utimensat(AT_FDCWD, file.c_str(), times, 0), 0);
  EXPECT_EQ(digests.of(file)->hash, hash_text("six"));  // with the old time of modification
  EXPECT_FALSE(digests.of(directory / "absent").ok());
  EXPECT_FALSE(digests.of(directory.path()).ok());
}

}  // namespace
}  // namespace lamina::pipeline
