// tests/pipeline/watch/test_completeness.cpp: no part of a file counts as the whole file.
#include "pipeline/watch/completeness.h"

#include <gtest/gtest.h>
#include <zlib.h>

#include <filesystem>
#include <fstream>
#include <sstream>

#include "stages/load/load.h"
#include "tests/commands/program.h"

namespace lamina::pipeline {
namespace {

namespace fs = std::filesystem;
using Content = FileEnd::Content;
const std::atomic<bool> kGoOn{false};

std::string gzipped(const std::string& text) {
  z_stream stream{};
  deflateInit2(&stream, 9, Z_DEFLATED, 16 + MAX_WBITS, 9, Z_DEFAULT_STRATEGY);
  std::string packed(deflateBound(&stream, text.size()), '\0');
  stream.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(text.data()));
  stream.avail_in = static_cast<uInt>(text.size());
  stream.next_out = reinterpret_cast<Bytef*>(packed.data());
  stream.avail_out = static_cast<uInt>(packed.size());
  deflate(&stream, Z_FINISH);
  packed.resize(stream.total_out);
  deflateEnd(&stream);
  return packed;
}

class Completeness : public ::testing::Test {
 protected:
  Content of(const std::string& name, std::string_view bytes) {
    test::write_text(directory_ / name, bytes);
    return end_of_file(directory_ / name, kGoOn).content;
  }
  /// The whole file has the length that it states, and every shorter one is incomplete.
  void expect_states_its_length(const std::string& name, const std::string& bytes) {
    EXPECT_EQ(of(name, bytes), Content::kStated) << name;
    for (std::size_t count = 0; count < bytes.size(); count += count < 100 || bytes.size() - count < 100 ? 1 : 7)
      ASSERT_EQ(of(name, std::string_view(bytes).substr(0, count)), Content::kMissing) << name << " cut at " << count;
  }
  std::string box() {
    test::write_box(directory_ / "box.stl", {0, 0, 0}, {1, 2, 3});
    return test::read_text(directory_ / "box.stl");
  }

  test::Directory directory_;
};

TEST_F(Completeness, AFormatThatStatesItsLengthIsWholeAtThatLengthAlone) {
  expect_states_its_length("a.stl", box());
  expect_states_its_length("a.STL.gz", gzipped(box()));
  expect_states_its_length("a.obj.gz", gzipped("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"));
  expect_states_its_length("a.3mf", test::read_text(test::corpus_file("arrow_scaled_mirrored.3mf")));
}

TEST_F(Completeness, AFileThatExpandsBeyondTheBufferIsWhole) {
  std::string zeros = box();
  for (const std::size_t bytes : {262'144u, 262'145u, 1'000'000u}) {
    zeros.resize(bytes);
    EXPECT_EQ(of("a.stl.gz", gzipped(zeros)), Content::kStated) << bytes;
  }
}

TEST_F(Completeness, SeveralMembersMayBeFollowedByMore) {
  EXPECT_EQ(of("a.stl.gz", gzipped(box()) + gzipped("x")), Content::kUnstated);
  EXPECT_EQ(of("a.stl.gz", gzipped(box()) + std::string(10, '\0')), Content::kUnstated);
}

TEST_F(Completeness, TextEndsWithEndsolidOrStatesNothing) {
  const std::string text =
      "solid x\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\n";
  for (std::size_t count = 0; count < text.size(); ++count)
    EXPECT_EQ(of("a.stl", std::string_view(text).substr(0, count)), Content::kMissing) << count;
  EXPECT_EQ(of("a.stl", text + "EndSolid x\n"), Content::kUnstated);
  EXPECT_EQ(of("a.obj", "v 0 0 0\n"), Content::kUnstated);
  EXPECT_EQ(of("a.obj", ""), Content::kMissing);
}

TEST_F(Completeness, WhatIsNoPartIsLeftToTheLoader) {
  EXPECT_EQ(of("a.stl", "<html>" + std::string(200, 'x')), Content::kUnstated);
  EXPECT_EQ(of("a.3mf", "no zip file"), Content::kUnstated);
  EXPECT_EQ(of("a.stl", box() + "more"), Content::kUnstated);
  EXPECT_EQ(of("a.stl.gz", "\x1f\x8b\x08 damaged, not cut"), Content::kUnstated);
}

TEST_F(Completeness, EveryFileOfTheCorpusThatIsPlannedIsWhole) {
  std::ifstream table(test::corpus_file("outcomes.tsv"));
  std::size_t count = 0;
  for (std::string line; std::getline(table, line);) {
    std::istringstream cells(line);
    std::string file, outcome, code;
    cells >> file >> outcome >> code;
    // Its head states more facets than it has.
    if (code != "0" || !load::is_part_name(file) || file == "broken/nut_count_too_high.stl") continue;
    if (!fs::exists(test::corpus_file(file))) continue;
    const FileEnd end = end_of_file(test::corpus_file(file), kGoOn);
    EXPECT_NE(end.content, Content::kMissing) << file << ": " << end.missing;
    ++count;
  }
  EXPECT_GT(count, 20u);
}

}  // namespace
}  // namespace lamina::pipeline
