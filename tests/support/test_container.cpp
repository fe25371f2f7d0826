// tests/support/test_container.cpp: files in a ZIP file are read as in a folder, and a damaged one gives an error, never other
// bytes than were stored.
#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <random>

#include "stages/formats/zip/zip.h"
#include "stages/support/io/container.h"
#include "stages/support/io/file.h"
#include "stages/support/io/file_reader.h"
#include "tests/commands/program.h"

namespace lamina {
namespace {

using test::Directory;

const std::map<std::string, std::string> kStored = {{"layers/000000.tif", std::string(1000, 'a')},
                                                    {"layers/000001.tif", ""},
                                                    {"manifest.json", "{}"},
                                                    {"program/start.x", "go"}};

/// Writes the files above. zip64_from  as of ZipWriter
void write_container(const std::string& path, std::uint64_t zip64_from = UINT32_MAX) {
  auto file = File::open(path);
  ASSERT_TRUE(file.ok());
  formats::ZipWriter writer(*file, formats::kFirstZipDate, zip64_from);
  for (const auto& [name, content] : kStored) {
    const auto bytes = std::as_bytes(std::span(content));
    ASSERT_TRUE(writer.store(name, bytes, formats::crc_of(bytes)).ok());
  }
  ASSERT_TRUE(writer.finish().ok());
  ASSERT_TRUE(file->finish().ok());
}

std::vector<std::string> sorted(std::vector<std::string> names) {
  std::ranges::sort(names);
  return names;
}

TEST(PathsThroughAContainer, LeadToItsFiles) {
  const Directory folder;
  for (const std::uint64_t zip64_from : {std::uint64_t{UINT32_MAX}, std::uint64_t{0}}) {
    write_container(folder / "job.zip", zip64_from);
    EXPECT_TRUE(is_container(folder / "job.zip"));
    for (const auto& [name, content] : kStored) {
      const std::string path = folder / ("job.zip/" + name);
      EXPECT_TRUE(is_file(path)) << name;
      EXPECT_EQ(entry_bytes(path), content.size());
      const auto read = read_file(path, {});
      ASSERT_TRUE(read.ok()) << read.error().message;
      EXPECT_TRUE(*read == content) << name;
    }
    EXPECT_EQ(*read_file(folder / "job.zip/layers/../manifest.json", {}), "{}");
    EXPECT_EQ(sorted(names_in_folder(folder / "job.zip/layers")), (std::vector<std::string>{"000000.tif", "000001.tif"}));
    EXPECT_EQ(names_in_folder(folder / "job.zip"), std::vector<std::string>{"manifest.json"});
    const auto absent = read_file(folder / "job.zip/layers/000002.tif", {});
    EXPECT_NE(absent.error().message.find("no such file"), std::string::npos) << absent.error().message;
    EXPECT_FALSE(is_file(folder / "job.zip/layers"));
  }
}

TEST(PathsThroughAContainer, LeadNowhereInOtherFiles) {
  const Directory folder;
  test::write_text(folder / "text", "no ZIP file, though longer than the head of one");
  EXPECT_FALSE(is_container(folder / "text"));
  EXPECT_FALSE(is_file(folder / "text/manifest.json"));
  EXPECT_TRUE(names_in_folder(folder / "text").empty());
  EXPECT_FALSE(read_entries(folder / "text").ok());
}

TEST(PathsThroughAContainer, FollowAFileThatIsReplaced) {
  const Directory folder;
  write_container(folder / "job.zip");
  EXPECT_EQ(*read_file(folder / "job.zip/program/start.x", {}), "go");
  std::string other = test::read_text(folder / "job.zip");
  const std::size_t at = other.find("go");
  other.replace(at, 2, "on");
  test::write_text(folder / "other.zip", other);
  std::filesystem::rename(folder / "other.zip", folder / "job.zip");
  EXPECT_EQ(*read_file(folder / "job.zip/program/start.x", {}), "on");
}

TEST(UnfinishedContainers, HaveTheWholeEntriesBeforeTheirEnd) {
  const Directory folder;
  for (const std::uint64_t zip64_from : {std::uint64_t{UINT32_MAX}, std::uint64_t{0}}) {
    write_container(folder / "job.zip", zip64_from);
    const std::string whole = test::read_text(folder / "job.zip");
    std::uint64_t directory = 0;
    const auto all = read_entries(folder / "job.zip", &directory);
    ASSERT_TRUE(all.ok());
    ASSERT_EQ(all->size(), kStored.size());
    for (std::size_t bytes = 0; bytes <= whole.size(); bytes += bytes < 1300 && bytes > 60 && bytes < 1000 ? 97 : 1) {
      test::write_text(folder / "job.zip.part", std::string_view(whole).substr(0, bytes));
      std::uint64_t end = 0;
      const auto entries = read_entries(folder / "job.zip.part", &end);
      ASSERT_TRUE(entries.ok());
      const auto expected = static_cast<std::size_t>(std::ranges::count_if(*all, [&](const ContainerEntry& entry) {
        const std::size_t number = static_cast<std::size_t>(&entry - all->data());
        return bytes >= (number + 1 < all->size() ? (*all)[number + 1].header : directory);
      }));
      ASSERT_EQ(entries->size(), expected) << bytes;
      EXPECT_EQ(end, expected == 0 ? 0 : expected < all->size() ? (*all)[expected].header : directory);
    }
  }
}

TEST(DamagedContainers, GiveAnErrorOrTheStoredNumberOfBytes) {
  const Directory folder;
  write_container(folder / "whole.zip");
  const std::string whole = test::read_text(folder / "whole.zip");
  std::mt19937 draw(3);
  for (int trial = 0; trial < 3000; ++trial) {
    std::string damaged = whole;
    const int changes = 1 + static_cast<int>(draw() % 4);
    for (int i = 0; i < changes; ++i) {
      std::size_t at = draw() % damaged.size();
      if (at >= 60 && at < 1000) at = damaged.size() - 1 - at % 400;  // heads and directory, more than data
      damaged[at] = static_cast<char>(draw() % 3 == 0 ? 0xff : draw());
    }
    if (draw() % 5 == 0) damaged.resize(draw() % damaged.size());
    test::write_text(folder / "job.zip", damaged);
    test::write_text(folder / "job.zip.part", damaged);
    for (const std::string& path : {folder / "job.zip", folder / "job.zip.part"}) {
      const auto entries = read_entries(path);
      if (!entries) continue;
      for (const ContainerEntry& entry : *entries) {
        const auto content = read_file(path + "/" + entry.name, {});
        EXPECT_LE(content ? content->size() : 0, damaged.size());
      }
    }
  }
}

}  // namespace
}  // namespace lamina
