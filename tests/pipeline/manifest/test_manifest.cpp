#include <gtest/gtest.h>

#include <filesystem>
#include <nlohmann/json.hpp>
#include <set>
#include <tuple>

#include "pipeline/job/file.h"
#include "pipeline/machine/profiles.h"
#include "pipeline/manifest/layer_files.h"
#include "pipeline/manifest/manifest.h"
#include "pipeline/manifest/manifest_text.h"
#include "stages/program/dialect.h"
#include "stages/support/hash/hash.h"
#include "stages/support/text/version.h"
#include "tests/commands/program.h"

namespace lamina::pipeline {
namespace {

using test::Directory;

constexpr std::uint32_t kLayers = 150;

ManifestHead head_of(const Job& job, const std::vector<PartSummary>& parts, std::uint32_t layers, std::uint32_t first,
                     std::uint32_t last) {
  ManifestHead head;
  head.version = version();
  head.job_toml = canonical_job_text(job, Product::kImages);
  head.format = job.format;
  head.extension = ".tif";
  head.fill_rule = "nonzero";
  head.mirror = "none";
  head.grid = resolve_powder_printer(job)->grid;
  head.layer_count = layers;
  head.first_layer = first;
  head.last_layer = last;
  head.parts = parts;
  for (PartSummary& part : head.parts) part.path = std::filesystem::path(part.path).filename().string();
  return head;
}

ManifestHead some_head(std::uint32_t first = 0, std::uint32_t last = kLayers) {
  Job job;
  job.parts.push_back({.path = "/far/away/bracket \"x\" \\ \xff.stl"});
  PartSummary part;
  part.path = job.parts[0].path;
  part.triangles = 123;
  part.fingerprint = 0xfedcba9876543210;
  part.bounds = {{-1, 2'147'483'647, 3}, {999'999, 2'147'483'647, 1'000'001}};
  part.notes = {{true, "a \"hole\"\nclosed"}, {false, "plain"}};
  return head_of(job, {part}, kLayers, first, last);
}

LayerRecord record(std::uint32_t index) {
  LayerRecord r;
  r.layer = {index, static_cast<Nm>(index * 50'000), 50'000, LayerReason::kUniform};
  r.bytes = 1000 + index;
  r.set_pixels = 0xffffffffffffull - index;
  r.capped_rows = index % 3;
  r.hash = {index * 0x9e3779b97f4a7c15ull, ~std::uint64_t{index}};
  return r;
}

void write_manifest(const std::string& path, const ManifestHead& head, bool finish = true) {
  auto writer = ManifestWriter::open(path, head, {});
  ASSERT_TRUE(writer.ok()) << writer.error().message;
  for (std::uint32_t i = head.first_layer; i < head.last_layer; ++i) ASSERT_TRUE(writer->append(record(i)).ok());
  ASSERT_TRUE((finish ? writer->finish() : writer->flush()).ok());
}

void expect_records(const Manifest& manifest, std::uint32_t first, std::uint32_t last) {
  ASSERT_EQ(manifest.layers.size(), last - first);
  for (std::uint32_t i = first; i < last; ++i) {
    const LayerRecord &got = manifest.layers[i - first], right = record(i);
    EXPECT_EQ(got.layer.index, right.layer.index);
    EXPECT_EQ(got.layer.bottom, right.layer.bottom);
    EXPECT_EQ(got.layer.thickness, right.layer.thickness);
    EXPECT_EQ(got.bytes, right.bytes);
    EXPECT_EQ(got.set_pixels, right.set_pixels);
    EXPECT_EQ(got.capped_rows, right.capped_rows);
    EXPECT_EQ(got.hash, right.hash);
  }
}

TEST(Manifest, WhatIsWrittenIsRead) {
  const Directory directory;
  const ManifestHead head = some_head();
  write_manifest(directory / "manifest.json", head);
  const auto manifest = read_manifest(directory / "manifest.json");
  ASSERT_TRUE(manifest.ok()) << manifest.error().message;
  EXPECT_TRUE(manifest->complete);
  EXPECT_EQ(manifest->head.id(), head.id());
  EXPECT_EQ(difference(manifest->head, head), "");
  EXPECT_EQ(manifest->head.parts[0].bounds.lo, head.parts[0].bounds.lo);
  EXPECT_EQ(manifest->head.parts[0].bounds.hi, head.parts[0].bounds.hi);
  EXPECT_EQ(manifest->head.grid.columns(), head.grid.columns());
  expect_records(*manifest, 0, kLayers);
  EXPECT_EQ(test::files_below(directory.path()), std::vector<std::string>{"manifest.json"});
}

/// A head of two materials whose pixels get up to three drops.
ManifestHead head_of_drops(const std::string& format, std::uint32_t maximum) {
  ManifestHead head = some_head();
  head.format = format;
  head.extension = ".tif";
  head.machine = "m";
  head.dialect = "raw";
  head.program_extension = program::find_dialect("raw")->extension;
  head.materials = {{"steel", 0}, {"bronze-drop2", 1}};
  head.max_drops = maximum;
  return head;
}

// Names of a material's drops are no other material's, and numbers of layers come back.
TEST(Manifest, OfDropsOfMaterialsIsReadAsItIsWritten) {
  for (const auto& [format, maximum, images] :
       {std::tuple{"tiff-g4", 3u, 6u}, {"tiff-8", 3u, 2u}, {"tiff-g4", 1u, 2u}, {"tiff-8", 1u, 2u}}) {
    const Directory directory;
    const ManifestHead head = head_of_drops(format, maximum);
    ASSERT_EQ(head.named_images(), images);
    std::set<std::string> names;
    for (std::size_t i = 0; i < images; ++i) {
      const std::string file = layer_file_name(7, head.extension, head.image_name(i)).substr(7);
      names.insert(file);
      std::uint32_t index = 0;
      bool partial = true;
      EXPECT_TRUE(read_layer_file_name(file, index, partial) && index == 7 && !partial) << file;
    }
    EXPECT_EQ(names.size(), images);
    auto writer = ManifestWriter::open(directory / "manifest.json", head, {});
    ASSERT_TRUE(writer.ok()) << writer.error().message;
    const bool reported = head.drops_of_materials();
    for (std::uint32_t i = 0; i < kLayers; ++i) {
      LayerRecord made = record(i);
      made.images.resize(images);
      made.set_pixels = reported ? 40 + i : 0;
      made.max_drops = reported || head.grey_drops() ? maximum : 1;
      made.drops = 5;
      made.bytes = 0;
      for (std::size_t m = 0; m < images; ++m) {
        made.images[m].bytes = 10 + m, made.images[m].set_pixels = 100 * m + i, made.images[m].unfed_pixels = m;
        made.images[m].drops = head.grey_drops() ? 1000 + m : 0;
        made.bytes += made.images[m].bytes;
        if (!reported) made.set_pixels += made.images[m].set_pixels;
      }
      ASSERT_TRUE(writer->append(made).ok());
    }
    ASSERT_TRUE(writer->finish().ok());
    const auto manifest = read_manifest(directory / "manifest.json");
    ASSERT_TRUE(manifest.ok()) << manifest.error().message;
    EXPECT_EQ(manifest->head.id(), head.id());
    for (const LayerRecord& read : manifest->layers) {
      ASSERT_EQ(read.images.size(), images);
      std::uint64_t bytes = 0, set = 0;
      for (std::size_t m = 0; m < images; ++m) {
        bytes += 10 + m, set += 100 * m + read.layer.index;
        EXPECT_EQ(read.images[m].set_pixels, 100 * m + read.layer.index);
        EXPECT_EQ(read.images[m].drops, head.grey_drops() ? 1000 + m : 0);
      }
      EXPECT_EQ(read.bytes, bytes);
      EXPECT_EQ(read.set_pixels, reported ? 40 + read.layer.index : set);
      EXPECT_EQ(read.max_drops, reported || head.grey_drops() ? maximum : 1);
      EXPECT_EQ(read.pixels_of_materials(2)[1], 100 * images / 2 + read.layer.index);
    }
  }
  const Directory directory;
  ManifestHead many = head_of_drops("tiff-g4", 3);
  many.materials.push_back({"third", 1});  // of a machine with two vats
  many.last_layer = many.first_layer;
  ASSERT_TRUE(ManifestWriter::open(directory / "manifest.json", many, {})->finish().ok());
  EXPECT_NE(read_manifest_head(directory / "manifest.json").error().message.find("max_drops"), std::string::npos);
}

TEST(Manifest, IsJsonForEverybody) {
  const Directory directory;
  write_manifest(directory / "manifest.json", some_head());
  const auto json = nlohmann::json::parse(test::read_text(directory / "manifest.json"), nullptr, false);
  ASSERT_FALSE(json.is_discarded());
  EXPECT_EQ(json["layers"].size(), kLayers);
  EXPECT_EQ(json["layers"][42]["file"], "layers/000042.tif");
  EXPECT_EQ(json["parts"][0]["path"], "bracket \"x\" \\ \xef\xbf\xbd.stl");
}

TEST(Manifest, PoresOfRangesAreReadAsTheyAreWritten) {
  ManifestHead head;
  head.product = Product::kMoves;
  head.file = "a.gcode";
  PathFacts facts;
  facts.deposited.pores.closed = 9;
  facts.by_range.resize(2);
  facts.by_range[0] = {12.5, {.closed = 7, .length_mm = 7.25, .crossing = 4, .crossed = 1}};
  facts.by_range[1] = {100.0 / 3, {.closed = 2, .edges = 5}};
  const auto line_of = [&](const PathFacts& paths) {
    std::string line;
    LineWriter out(line);
    const LayerRecord written = record(3);
    describe_line(out, head, written, paths);
    return line;
  };
  LayerRecord layer;
  PathFacts read;
  const std::string line = line_of(facts);
  LineReader in(line);
  describe_line(in, head, layer, read);
  ASSERT_TRUE(in.good() && in.ended()) << in.what() << line;
  EXPECT_EQ(nlohmann::json::parse(line, nullptr, false)["ranges"].size(), 2u);
  ASSERT_EQ(read.by_range.size(), 2u);
  EXPECT_EQ(read.by_range[1].area_mm2, facts.by_range[1].area_mm2);
  EXPECT_EQ(read.by_range[1].pores.edges, 5u);
  EXPECT_EQ(read.by_range[0].pores.length_mm, 7.25);
  EXPECT_EQ(line_of(read), line);
  facts.by_range.clear();
  EXPECT_EQ(line_of(facts).find("ranges"), std::string::npos) << "records of other jobs are as before";
}

TEST(Manifest, ShardWithoutLayersIsWhole) {
  const Directory directory;
  write_manifest(directory / "manifest.json", some_head(7, 7));
  const auto manifest = read_manifest(directory / "manifest.json");
  ASSERT_TRUE(manifest.ok()) << manifest.error().message;
  EXPECT_TRUE(manifest->complete);
  EXPECT_FALSE(nlohmann::json::parse(test::read_text(directory / "manifest.json"), nullptr, false).is_discarded());
}

TEST(Manifest, IdIsTheSameForEveryRangeAndAnotherForEveryOtherJob) {
  EXPECT_EQ(some_head(0, 3).id(), some_head(5, 9).id());
  ManifestHead head = some_head();
  head.layer_count += 1;
  EXPECT_NE(head.id(), some_head().id());
  head = some_head();
  head.parts[0].fingerprint ^= 1;
  EXPECT_NE(head.id(), some_head().id());
  EXPECT_NE(difference(head, some_head()).find("geometry of bracket"), std::string::npos);
  Job job;
  job.layer_mm = 0.1;
  job.parts.resize(1);
  head = head_of(job, {}, 1, 0, 1);
  EXPECT_NE(difference(head, some_head()).find("layers.thickness_mm = 0.1, was 0.05"), std::string::npos);

  // A key that one of them lacks is named, wherever it stands.
  ManifestHead younger = some_head();
  younger.job_toml.insert(younger.job_toml.find("cusp_mm"), "sort = \"b\"\n");
  EXPECT_EQ(difference(younger, some_head()),
            "heights.sort = \"b\", of which it says nothing: it was not set, or another build of lamina wrote it");
  EXPECT_EQ(difference(some_head(), younger), "heights.sort is set no more, or another build of lamina wrote it");
}

TEST(Manifest, EveryTruncationOfAPartialOneGivesItsWholeLines) {
  const Directory directory;
  write_manifest(directory / "manifest.json", some_head(), false);
  const std::string whole = test::read_text(directory / "manifest.json.part");
  const std::size_t head_end = whole.find("\"layers\": [") + std::string("\"layers\": [").size();
  const std::size_t tail = whole.size() - 400;
  for (std::size_t size = tail; size <= whole.size(); ++size) {
    test::write_text(directory / "torn.json.part", whole.substr(0, size));
    const auto manifest = read_manifest(directory / "torn.json.part");
    ASSERT_TRUE(manifest.ok()) << manifest.error().message;
    EXPECT_FALSE(manifest->complete);
    const auto lines = static_cast<std::size_t>(std::ranges::count(whole.substr(head_end, size - head_end), '}'));
    ASSERT_EQ(manifest->layers.size(), lines) << size;
  }
  for (std::size_t size = 0; size < head_end; size += 7) {
    test::write_text(directory / "torn.json.part", whole.substr(0, size));
    const auto manifest = read_manifest(directory / "torn.json.part");
    ASSERT_FALSE(manifest.ok()) << size;
    EXPECT_EQ(manifest.error().fault, Fault::kVerification);
  }
}

TEST(Manifest, EveryTruncationOfAFinishedOneIsAnError) {
  const Directory directory;
  write_manifest(directory / "manifest.json", some_head(0, 3));
  const std::string whole = test::read_text(directory / "manifest.json");
  // Without its last line end it is still whole.
  for (std::size_t size = 0; size + 1 < whole.size(); size += size + 300 < whole.size() ? 5 : 1) {
    test::write_text(directory / "torn.json", whole.substr(0, size));
    EXPECT_FALSE(read_manifest(directory / "torn.json").ok()) << size;
  }
}

TEST(Manifest, ChangedBytesOfItsHeadAreNoticed) {
  const Directory directory;
  write_manifest(directory / "manifest.json", some_head(0, 3));
  const std::string whole = test::read_text(directory / "manifest.json");
  const std::size_t range = whole.find("\"range\""), keys_end = whole.find("\"layers\": [");
  for (std::size_t at = 0; at < range; at += 3) {
    std::string changed = whole;
    changed[at] = changed[at] == '7' ? '8' : '7';
    test::write_text(directory / "changed.json", changed);
    const auto manifest = read_manifest(directory / "changed.json");
    EXPECT_FALSE(manifest.ok()) << at << ": " << changed.substr(at - std::min<std::size_t>(at, 20), 40);
  }
  EXPECT_LT(range, keys_end);
}

TEST(Manifest, OfAnotherVersionIsRefused) {
  const Directory directory;
  write_manifest(directory / "manifest.json", some_head(0, 3));
  std::string other = test::read_text(directory / "manifest.json");
  const std::string version = "\"manifest\": " + std::to_string(kManifestVersion);
  ASSERT_NE(other.find(version), std::string::npos);
  other.replace(other.find(version), version.size(), "\"manifest\": 1");
  test::write_text(directory / "manifest.json", other);
  const auto manifest = read_manifest(directory / "manifest.json");
  ASSERT_FALSE(manifest.ok());
  EXPECT_NE(manifest.error().message.find("by another version of lamina"), std::string::npos) << manifest.error().message;
}

// As the head of an older build had keys of other names: its id is that of its own lines.
TEST(Manifest, OfAnotherBuildIsDistinguishedFromOneThatWasChanged) {
  const Directory directory;
  write_manifest(directory / "manifest.json", some_head(0, 3));
  const std::string whole = test::read_text(directory / "manifest.json");
  const auto with = [&](const std::string& key, const std::string& other, bool own_id) {
    std::string text = whole;
    const std::string quoted = "\"" + key + "\": ";
    EXPECT_NE(text.find(quoted), std::string::npos) << key;
    text.replace(text.find(quoted), quoted.size(), "\"" + other + "\": ");
    const std::size_t id = text.find("\"id\": \"");
    if (own_id) text.replace(id + 7, 32, hex(hash_text(std::string_view(text).substr(0, id))));
    test::write_text(directory / "other.json", text);
    const auto manifest = read_manifest(directory / "other.json");
    EXPECT_FALSE(manifest.ok());
    return manifest ? "" : manifest.error().message;
  };
  for (const char* key : {"fill_rule", "mirror", "columns"}) {  // read, and not read
    const std::string built = with(key, "other_key", true), changed = with(key, "other_key", false);
    EXPECT_NE(built.find("was written by another version of lamina"), std::string::npos) << built;
    EXPECT_NE(built.find("or plan the job again with --overwrite"), std::string::npos) << built;
    EXPECT_EQ(changed.find("another version"), std::string::npos) << changed;
  }
}

TEST(Manifest, KeptRecordsComeFirstAndNoLayerIsSkipped) {
  const Directory directory;
  write_manifest(directory / "whole.json", some_head());
  std::vector<LayerRecord> kept;
  for (std::uint32_t i = 0; i < 130; ++i) kept.push_back(record(i));
  auto writer = ManifestWriter::open(directory / "resumed.json", some_head(), kept);
  ASSERT_TRUE(writer.ok());
  const auto so_far = read_manifest(directory / "resumed.json.part");
  ASSERT_TRUE(so_far.ok());
  expect_records(*so_far, 0, 130);
  EXPECT_FALSE(writer->append(record(131)).ok());
  EXPECT_FALSE(writer->append(record(129)).ok());
  EXPECT_FALSE(writer->finish().ok());
  for (std::uint32_t i = 130; i < kLayers; ++i) ASSERT_TRUE(writer->append(record(i)).ok());
  EXPECT_FALSE(writer->append(record(kLayers)).ok());
  ASSERT_TRUE(writer->finish().ok());
  EXPECT_EQ(test::read_text(directory / "resumed.json"), test::read_text(directory / "whole.json"));
}

TEST(Manifest, FileHoldsAllButTheLastLinesWhileItGrows) {
  const Directory directory;
  auto writer = ManifestWriter::open(directory / "manifest.json", some_head(), {});
  ASSERT_TRUE(writer.ok());
  for (std::uint32_t i = 0; i < kLayers; ++i) {
    ASSERT_TRUE(writer->append(record(i)).ok());
    const auto manifest = read_manifest(directory / "manifest.json.part");
    ASSERT_TRUE(manifest.ok());
    ASSERT_LT(i + 1 - manifest->layers.size(), 64u);
  }
}

TEST(Manifest, SecondRunInTheSameDirectoryIsRefusedWhileTheFirstWrites) {
  const Directory directory;
  {
    auto first = ManifestWriter::open(directory / "manifest.json", some_head(), {});
    ASSERT_TRUE(first.ok());
    const auto second = ManifestWriter::open(directory / "manifest.json", some_head(), {});
    ASSERT_FALSE(second.ok());
    EXPECT_EQ(second.error().fault, Fault::kOutput);
    for (std::uint32_t i = 0; i < kLayers; ++i) ASSERT_TRUE(first->append(record(i)).ok());
    ASSERT_TRUE(first->flush().ok());
  }
  EXPECT_TRUE(ManifestWriter::open(directory / "manifest.json", some_head(), {}).ok());
}

TEST(Hash, KnownValuesAndFiles) {
  // xxhsum -H2 of nothing, and of "lamina".
  EXPECT_EQ(hex(hash_bytes({})), "99aa06d3014798d86001c324468d497f");
  const Directory directory;
  const std::string text(1'000'003, 'x');
  test::write_text(directory / "x", text);
  const auto digest = digest_file(directory / "x");
  ASSERT_TRUE(digest.ok());
  EXPECT_EQ(digest->bytes, text.size());
  EXPECT_EQ(digest->hash, hash_bytes(std::as_bytes(std::span(text))));
  Hash128 back;
  EXPECT_TRUE(read_hex(hex(digest->hash), back));
  EXPECT_EQ(back, digest->hash);
  EXPECT_FALSE(read_hex("zz", back));
  EXPECT_FALSE(read_hex(std::string(32, 'g'), back));
  EXPECT_FALSE(digest_file(directory / "absent").ok());
}

}  // namespace
}  // namespace lamina::pipeline
