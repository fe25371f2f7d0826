// tests/commands/test_container.cpp: a job in one ZIP file has the files of the job in a directory, also after any
// interruption.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <nlohmann/json.hpp>
#include <random>

#include "pipeline/output/job_container.h"
#include "stages/support/io/container.h"
#include "stages/support/io/file_reader.h"
#include "tests/commands/program.h"

namespace lamina::test {
namespace {

namespace fs = std::filesystem;

const std::string kBoxJob = "jet part.stl --bed 40x40 --dpi 300 --layer 0.1",
                  kWithProgram = "jet part.stl --machine jet1000 --layer 0.1";

class Containers : public ::testing::Test {
 protected:
  Containers() { write_box(directory_ / "part.stl", {0, 0, 0}, {6, 4, 3}); }

  Outcome lamina(const std::string& line, int code = 0) {
    Outcome outcome = run_lamina(words_of(line), directory_.path());
    EXPECT_EQ(outcome.code, code) << line << "\n" << outcome.err;
    return outcome;
  }
  std::string text(const std::string& name) { return read_text(directory_ / name); }

  /// The files of the container are those of the directory, with the same bytes.
  void expect_files_of(const std::string& container, const std::string& folder) {
    const auto entries = read_entries(directory_ / container);
    ASSERT_TRUE(entries.ok());
    std::vector<std::string> names;
    for (const ContainerEntry& entry : *entries) {
      names.push_back(entry.name);
      const auto content = read_file(directory_ / (container + "/" + entry.name), {});
      ASSERT_TRUE(content.ok()) << entry.name;
      EXPECT_TRUE(*content == text(folder + "/" + entry.name)) << entry.name;
    }
    std::ranges::sort(names);
    EXPECT_EQ(names, files_below(directory_ / folder));
  }

  Directory directory_;
};

TEST_F(Containers, HaveTheFilesOfADirectory) {
  for (const std::string& job :
       {kBoxJob, kBoxJob + " --levels 16 --format png", kWithProgram + " --saturation 60 --inspect",
        kBoxJob + " --layers 3:9 --title box", kWithProgram + " --heights cusp --thickness 0.05..0.2"}) {
    lamina(job + " -o out --quiet");
    lamina(job + " -o out --container zip --quiet");
    expect_files_of("out.zip", "out");
    const std::string unpack = "cd '" + directory_.path().string() + "' && python3 -m zipfile -e out.zip unpacked";
    ASSERT_EQ(std::system(unpack.c_str()), 0) << "Python checks the sums";
    EXPECT_TRUE(tree_text(directory_ / "unpacked") == tree_text(directory_ / "out")) << job;
    fs::remove_all(directory_ / "unpacked");
    lamina(job + " -o other.zip --container zip --threads 1 --sync layer --quiet");
    EXPECT_TRUE(text("out.zip") == text("other.zip")) << job;
    fs::remove_all(directory_ / "out");
    for (const char* name : {"out.zip", "other.zip"}) fs::remove(directory_ / name);
    EXPECT_EQ(files_below(directory_.path()), std::vector<std::string>{"part.stl"}) << "nothing is left next to it";
  }
}

TEST_F(Containers, AreReadLikeDirectories) {
  lamina(kWithProgram + " -o out --quiet");
  lamina(kWithProgram + " -o packed.zip --container zip --quiet");
  const auto answer = [&](const std::string& line, const std::string& name) {
    std::string out = lamina(line).out;
    for (std::size_t at = out.find(name); at != std::string::npos; at = out.find(name)) out.replace(at, name.size(), "JOB");
    return out;
  };
  EXPECT_EQ(answer("verify packed.zip", "packed.zip"), answer("verify out", "out"));
  lamina("stream packed.zip -o one.planes --quiet");
  lamina("stream out -o two.planes --quiet");
  EXPECT_TRUE(text("one.planes") == text("two.planes"));
  lamina("report packed.zip -o one.html --quiet");
  lamina("report out -o two.html --quiet");
  EXPECT_TRUE(text("one.html") == text("two.html"));
}

TEST_F(Containers, ContinueAfterAnyInterruptionWithTheSameBytes) {
  std::mt19937 draw(7);
  for (const std::string& job : {kBoxJob, kWithProgram + " --inspect"}) {
    lamina(job + " -o whole.zip --container zip --quiet");
    const std::string whole = text("whole.zip"), manifest = text("whole.zip/manifest.json");
    const auto content = read_file(directory_ / "whole.zip/manifest.json", {});
    ASSERT_TRUE(content.ok());
    for (int trial = 0; trial < 12; ++trial) {
      write_text(directory_ / "out.zip.part", whole.substr(0, draw() % (whole.size() + 1)));
      write_text(directory_ / "out.zip.json.part", content->substr(0, draw() % (content->size() + 1)));
      lamina(job + " -o out.zip --container zip --quiet --resume");
      ASSERT_TRUE(text("out.zip") == whole) << job << ", trial " << trial;
      EXPECT_FALSE(fs::exists(directory_ / "out.zip.part"));
      EXPECT_FALSE(fs::exists(directory_ / "out.zip.json.part"));
      fs::remove(directory_ / "out.zip");
    }
    fs::remove(directory_ / "whole.zip");
  }
}

TEST_F(Containers, KeepWhatIsWhole) {
  lamina(kBoxJob + " -o whole.zip --container zip --quiet");
  const auto kept = [&] {
    const auto json = nlohmann::json::parse(lamina(kBoxJob + " -o whole.zip --container zip --json --resume").out);
    return json.at("layers_kept").get<int>();
  };
  EXPECT_EQ(kept(), 30);
  const auto entries = read_entries(directory_ / "whole.zip");
  const auto content = read_file(directory_ / "whole.zip/manifest.json", {});
  ASSERT_TRUE(entries.ok() && content.ok());
  const std::string whole = text("whole.zip");
  write_text(directory_ / "whole.zip.part", whole.substr(0, (*entries)[20].header + 5));
  write_text(directory_ / "whole.zip.json.part", *content);
  fs::remove(directory_ / "whole.zip");
  EXPECT_EQ(kept(), 20) << "layers before the cut";
  EXPECT_TRUE(text("whole.zip") == whole);
}

TEST_F(Containers, DamageIsFoundAndMadeAgain) {
  lamina(kWithProgram + " -o out.zip --container zip --quiet");
  const std::string whole = text("out.zip");
  const auto entries = read_entries(directory_ / "out.zip");
  ASSERT_TRUE(entries.ok());
  const ContainerEntry& entry = (*entries)[entries->size() / 2];
  std::string damaged = whole;
  damaged[entry.header + 30 + entry.name.size() + entry.bytes / 2] ^= 1;
  write_text(directory_ / "out.zip", damaged);
  EXPECT_NE(lamina("verify out.zip", 5).err.find(entry.name), std::string::npos);
  lamina(kWithProgram + " -o out.zip --container zip --quiet --resume");
  EXPECT_TRUE(text("out.zip") == whole);
  write_text(directory_ / "out.zip", whole.substr(0, whole.size() - 30));
  EXPECT_NE(lamina("verify out.zip", 5).err.find("its end is missing"), std::string::npos);
}

TEST_F(Containers, ShardsAreMergedIntoADirectoryOrAContainer) {
  lamina(kWithProgram + " -o whole.zip --container zip --quiet");
  lamina(kWithProgram + " -o whole --quiet");
  for (const char* shard : {"1/3", "2/3", "3/3"})
    lamina(kWithProgram + " -o s" + std::string(shard, 1) + " --container zip --quiet --shard " + shard);
  lamina("merge s1.zip s2.zip s3.zip -o merged --quiet");
  EXPECT_TRUE(tree_text(directory_ / "merged") == tree_text(directory_ / "whole"));
  lamina("merge s1.zip s2.zip s3.zip -o merged.zip --quiet");
  EXPECT_TRUE(text("merged.zip") == text("whole.zip"));
  EXPECT_NE(lamina("merge s1.zip s3.zip -o gap.zip", 5).err.find("are in no shard"), std::string::npos);
  EXPECT_FALSE(fs::exists(directory_ / "gap.zip"));
  // A byte of a shard that changed is not carried into the whole job.
  const auto entries = read_entries(directory_ / "s2.zip");
  ASSERT_TRUE(entries.ok());
  const ContainerEntry& entry = (*entries)[4];
  std::string damaged = text("s2.zip");
  damaged[entry.header + 30 + entry.name.size() + entry.bytes / 2] ^= 1;
  write_text(directory_ / "s2.zip", damaged);
  EXPECT_NE(lamina("merge s1.zip s2.zip s3.zip -o damaged.zip", 5).err.find(entry.name), std::string::npos);
  EXPECT_FALSE(fs::exists(directory_ / "damaged.zip"));
}

TEST_F(Containers, ABatchWritesAFileForEachJob) {
  write_text(directory_ / "jobs.txt", kBoxJob + "\n" + kBoxJob + " -o named\ninfo part.stl\n");
  lamina("batch jobs.txt -o out --container zip --quiet");
  const std::vector<std::string> expected{"batch.jsonl", "named.zip", "part.zip", "summary.json", "summary.tsv"};
  EXPECT_EQ(files_below(directory_ / "out"), expected);
  lamina("verify out --quiet");
  const std::string again = lamina("batch jobs.txt -o out --container zip --resume").err;
  EXPECT_NE(again.find("kept"), std::string::npos) << again;
}

TEST_F(Containers, ResumeKeepsWhatIsNotOfTheJob) {
  const std::string container = " --container zip --quiet";
  lamina(kBoxJob + " -o out" + container + " --shard 1/2");
  expect_refused(kBoxJob + " -o out --resume --shard 2/2" + container, 2, "contains no manifest-2-of-2.json", directory_);
  expect_refused(kBoxJob + " -o out --resume" + container, 2, "contains no manifest.json", directory_);
  write_text(directory_ / "mine.zip.part", "a download that another program has begun");
  expect_refused(kBoxJob + " -o mine" + container, 2, "is no unfinished container", directory_);
  write_text(directory_ / "package.zip.part", "PK\x03\x04" + std::string(26, '\0') + "3D/3dmodel.model and much more");
  for (const std::string& line : {kBoxJob + container + " -o package", std::string("merge out.zip -o package.zip")})
    EXPECT_NE(run_lamina(words_of(line), directory_.path()).code, 0);
  EXPECT_TRUE(text("package.zip.part").ends_with("and much more"));
  // The begun job of a name is not replaced by a merge.
  lamina(kBoxJob + " -o other" + container + " --shard 2/2");
  lamina(kWithProgram + " -o begun" + container);
  write_text(directory_ / "begun.zip.json.part", *read_file(directory_ / "begun.zip/manifest.json", {}));
  fs::rename(directory_ / "begun.zip", directory_ / "begun.zip.part");
  expect_refused("merge out.zip other.zip -o begun.zip", 2, "an interrupted job", directory_);
}

TEST_F(Containers, SumsAndNamesThatUnpackersCheckAreChecked) {
  lamina(kBoxJob + " -o out --container zip --quiet");
  const std::string whole = text("out.zip");
  const auto entries = read_entries(directory_ / "out.zip");
  const auto manifest = read_file(directory_ / "out.zip/manifest.json", {});
  ASSERT_TRUE(entries.ok() && manifest.ok());
  std::string damaged = whole;
  damaged[(*entries)[10].header + 14] ^= 4;  // the CRC-32 before the data
  write_text(directory_ / "out.zip", damaged);
  EXPECT_NE(lamina("verify out.zip", 5).err.find((*entries)[10].name), std::string::npos);
  fs::remove(directory_ / "out.zip");
  write_text(directory_ / "out.zip.part", damaged);
  write_text(directory_ / "out.zip.json.part", *manifest);
  lamina(kBoxJob + " -o out --container zip --quiet --resume");
  EXPECT_TRUE(text("out.zip") == whole);
  // A second file of one name: unpackers take the last one.
  std::string twice = whole;
  for (std::size_t at = twice.find("000003.tif"); at != std::string::npos; at = twice.find("000003.tif")) twice[at + 5] = '2';
  write_text(directory_ / "out.zip", twice);
  EXPECT_NE(lamina("verify out.zip", 5).err.find("occurs twice"), std::string::npos);
}

TEST_F(Containers, WhatUnpackersRefuseIsDamaged) {
  lamina(kBoxJob + " -o out --container zip --quiet");
  const std::string whole = text("out.zip");
  const std::size_t first = whole.find("PK\x01\x02"), last = whole.rfind("PK\x01\x02"), end = whole.rfind("PK\x05\x06");
  // Version needed, encrypted, first disk; disks, entries on this disk, size of the directory (APPNOTE 4.3.12, 4.3.16).
  for (const std::size_t at : {first + 6, first + 8, last + 8, last + 34, end + 4, end + 6, end + 8, end + 12, end + 16}) {
    std::string damaged = whole;
    damaged[at] ^= at == first + 6 ? '\x80' : 1;
    write_text(directory_ / "out.zip", damaged);
    lamina("verify out.zip --quiet", 5);
    expect_refused(kBoxJob + " -o out --container zip --resume", 5, "make it again with --overwrite", directory_);
  }
  EXPECT_EQ(files_below(directory_.path()), (std::vector<std::string>{"out.zip", "part.stl"}));
}

TEST_F(Containers, EntriesBelowAFolderOrOutsideAreNamed) {
  lamina(kBoxJob + " -o out --container zip --quiet");
  std::string file = text("out.zip");  // the entry and the directory name it; between them, the manifest does
  for (const std::size_t at : {file.find("layers/000003.tif"), file.rfind("layers/000003.tif")})
    file.replace(at, 17, "layers/0/../3.tif");
  write_text(directory_ / "out.zip", file);
  EXPECT_NE(lamina("verify out.zip", 5).err.find("layers/0/../3.tif: no manifest names it"), std::string::npos);
}

TEST_F(Containers, AMergeMakesADamagedWholeAgainAndCopiesNoDamage) {
  for (const char* shard : {"1", "2"})
    lamina(kBoxJob + " --container zip --quiet -o s" + shard + ".zip --shard " + shard + "/2");
  lamina("merge s1.zip s2.zip -o all.zip --quiet");
  const std::string whole = text("all.zip");
  std::string damaged = whole;
  damaged[damaged.find("layers/000003.tif") + 40] ^= 1;
  write_text(directory_ / "all.zip", damaged);
  lamina("merge s1.zip s2.zip -o all.zip --quiet");
  EXPECT_TRUE(text("all.zip") == whole);
  std::string shard = text("s1.zip");
  shard[shard.find("layers/000003.tif") + 40] ^= 1;
  write_text(directory_ / "s1.zip", shard);
  EXPECT_NE(lamina("merge s1.zip s2.zip -o folder", 5).err.find("layers/000003.tif"), std::string::npos);
}

TEST_F(Containers, NamesOfNoFileAreRefused) {
  for (const char* name : {".", "..", "-", "/dev/null"})
    expect_refused(kBoxJob + " --container zip -o " + name, 2, "end its name with .zip", directory_);
  lamina(kBoxJob + " --container zip --quiet -o a.zip/");
  lamina(kBoxJob + " --container zip --quiet -o b.ZIP");
  fs::create_symlink("c-target.zip", directory_ / "c.zip");
  lamina(kBoxJob + " --container zip --quiet -o c");
  EXPECT_TRUE(text("a.zip") == text("b.ZIP"));
  EXPECT_TRUE(text("a.zip") == text("c-target.zip"));
  EXPECT_TRUE(fs::is_symlink(directory_ / "c.zip"));
}

TEST_F(Containers, WhatIsThereIsKept) {
  lamina(kBoxJob + " -o out.zip --container zip --quiet");
  write_text(directory_ / "mine.zip", "mine");
  fs::create_directory(directory_ / "folder.zip");
  const std::string container = " --container zip";
  expect_refused(kBoxJob + " -o out.zip" + container, 2, "a finished job", directory_);
  expect_refused(kBoxJob + " -o mine.zip" + container, 2, "is there already", directory_);
  expect_refused(kBoxJob + " -o mine.zip --resume" + container, 2, "is no container", directory_);
  expect_refused(kBoxJob + " -o folder.zip" + container, 4, "is a directory", directory_);
  expect_refused(kBoxJob + " --dpi 301 -o out.zip --resume" + container, 2, "belongs to another job", directory_);
  expect_refused("stream out.zip -o out.zip", 2, "out.zip", directory_);
  write_text(directory_ / "out.zip.json.part", *read_file(directory_ / "out.zip/manifest.json", {}));
  fs::remove(directory_ / "out.zip");
  expect_refused(kBoxJob + " -o out.zip" + container, 2, "an interrupted job", directory_);
}

}  // namespace
}  // namespace lamina::test
