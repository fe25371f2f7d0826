// tests/commands/test_pages.cpp: a job whose layers are pages of a TIFF file has the files of the job in folders, also after
// any interruption.
#include <gtest/gtest.h>
#include <signal.h>
#include <unistd.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <random>

#include "stages/support/io/container.h"
#include "stages/support/io/file_reader.h"
#include "stages/support/io/paged.h"
#include "tests/commands/program.h"

namespace lamina::test {
namespace {

namespace fs = std::filesystem;

const std::string kPlainPages = "jet part.stl --bed 40x40 --dpi 300 --layer 0.1",
                  kPagesWithProgram = "jet part.stl --machine jet1000 --layer 0.1", kAsPages = " --container tiff --quiet",
                  kTwoPowders =
                      "jet part.stl part.stl --material steel,bronze --machine nuferbj --vat-rule majority --layer 0.2";

class PagedJobs : public ::testing::Test {
 protected:
  PagedJobs() { write_box(directory_ / "part.stl", {0, 0, 0}, {6, 4, 3}); }

  Outcome lamina(const std::string& line, int code = 0) {
    Outcome outcome = run_lamina(words_of(line), directory_.path());
    EXPECT_EQ(outcome.code, code) << line << "\n" << outcome.err;
    return outcome;
  }
  std::string text(const std::string& name) { return read_text(directory_ / name); }

  std::string program_name(const std::string& paged) {
    for (const std::string& name : files_below(directory_ / paged)) {
      if (name.starts_with("program.")) return name;
    }
    return {};
  }

  /// The files that paths lead to are those of the job in folders, and the program is the concatenation of its parts.
  void expect_files_of(const std::string& paged, const std::string& folder) {
    EXPECT_EQ(text(paged + "/manifest.json"), text(folder + "/manifest.json"));
    std::string program;
    for (const char* below : {"/layers", "/program"}) {
      std::vector<std::string> names = names_in_folder(directory_ / (paged + below));
      std::vector<std::string> expected = files_below(directory_ / (folder + below));
      std::ranges::sort(names);
      EXPECT_EQ(names, expected);
      for (const std::string& name : expected) {
        const auto content = read_file(directory_ / (paged + below + "/" + name), {});
        EXPECT_TRUE(content && *content == text(folder + below + "/" + name)) << name;
        if (name.starts_with("0")) program += text(folder + below + "/" + name);
      }
      if (below[1] == 'l') program.clear();
    }
    for (const std::string& name : files_below(directory_ / paged)) {
      if (name.starts_with("program."))
        EXPECT_NE(text(paged + "/" + name).find(program), std::string::npos);
      else
        EXPECT_TRUE(name == "layers.tif" || name == "machine.toml" || name == "manifest.json" || name == "inspection.json")
            << name;
    }
  }

  Directory directory_;
};

TEST_F(PagedJobs, HaveTheFilesOfFolders) {
  const std::string doses = "jet part.stl --machine jet1000 --layer 0.3 --saturation 60 --inspect";
  for (const std::string& job : {kPlainPages + " --layers 3:9 --title box", kPlainPages + " --levels 16 --format tiff-4", doses,
                                 kTwoPowders, kPagesWithProgram + " --heights cusp --thickness 0.05..0.2",
                                 std::string("jet part.stl --bed 1500x1500 --dpi 600 --layer 0.5")}) {
    lamina(job + " -o out --quiet");
    lamina(job + " -o paged" + kAsPages);
    expect_files_of("paged", "out");
    lamina(job + " -o other --threads 1 --sync layer" + kAsPages);
    EXPECT_TRUE(tree_text(directory_ / "paged") == tree_text(directory_ / "other")) << job;
    EXPECT_EQ(lamina("verify paged --json").code, 0);
    const bool big = job.find("1500") != std::string::npos;
    EXPECT_EQ(text("paged/layers.tif")[2], big ? '\x2b' : '\x2a') << "BigTIFF where the job may exceed 4 GiB";
    for (const char* name : {"out", "paged", "other"}) fs::remove_all(directory_ / name);
  }
}

TEST_F(PagedJobs, AreReadLikeFolders) {
  lamina(kPagesWithProgram + " -o out --quiet");
  lamina(kPagesWithProgram + " -o box" + kAsPages);
  const auto answer = [&](const std::string& name) {
    lamina("stream " + name + " -o " + name + ".planes --quiet");
    lamina("report " + name + " -o " + name + ".html --quiet");
    lamina("preview " + name + " -o " + name + ".png --quiet");
    lamina("merge " + name + " -o " + name + "2 --quiet");
    std::string all = lamina("verify " + name).out + text(name + ".planes") + text(name + ".html") + text(name + ".png");
    for (std::size_t at = all.find(name + ": "); at != std::string::npos; at = all.find(name + ": ")) all.erase(at, 3);
    return all + tree_text(directory_ / (name + "2"));
  };
  EXPECT_TRUE(answer("box") == answer("out"));
  lamina("jet box -o again --machine jet1000 --quiet");
  for (const std::string& name : files_below(directory_ / "out/layers"))
    EXPECT_TRUE(text("again/layers/" + name) == text("out/layers/" + name)) << name;
  expect_refused("stream box -o new.planes --consume", 2, "without --container tiff", directory_);
}

TEST_F(PagedJobs, ContinueAfterAnyInterruptionWithTheSameBytes) {
  std::mt19937 draw(7);
  for (const std::string& job : {kPlainPages, kTwoPowders, kPagesWithProgram + " --inspect"}) {
    lamina(job + " -o whole" + kAsPages);
    const std::string whole = tree_text(directory_ / "whole");
    for (int trial = 0; trial < 12; ++trial) {
      fs::copy(directory_ / "whole", directory_ / "out");
      for (const std::string& name : files_below(directory_ / "out")) {
        const std::string content = text("out/" + name);
        if (name == "machine.toml" || (trial % 4 == 3 && name != "manifest.json")) continue;  // killed while names were given
        fs::remove(directory_ / ("out/" + name));
        if (name != "inspection.json")
          write_text(directory_ / ("out/" + name + ".part"), content.substr(0, draw() % (content.size() + 1)));
      }
      lamina(job + " -o out --resume" + kAsPages);
      ASSERT_TRUE(tree_text(directory_ / "out") == whole) << job << ", trial " << trial;
      fs::remove_all(directory_ / "out");
    }
    fs::remove_all(directory_ / "whole");
  }
}

TEST_F(PagedJobs, ContinueAfterKills) {
  const std::string job = kPagesWithProgram + " --sync layer";
  lamina(job + " -o whole" + kAsPages);
  std::mt19937 draw(3);
  for (int kill_number = 0; kill_number < 50; ++kill_number) {
    run_lamina(words_of(job + " -o out --resume" + kAsPages), directory_.path(), [&](int process) {
      ::usleep(static_cast<useconds_t>(draw() % 60'000));
      ::kill(process, SIGKILL);
    });
  }
  lamina(job + " -o out --resume" + kAsPages);
  EXPECT_TRUE(tree_text(directory_ / "out") == tree_text(directory_ / "whole"));
}

TEST_F(PagedJobs, KeepWhatIsWhole) {
  lamina(kPagesWithProgram + " -o out" + kAsPages);
  const std::string whole = tree_text(directory_ / "out");
  const auto kept = [&] {
    return nlohmann::json::parse(lamina(kPagesWithProgram + " -o out --container tiff --json --resume").out)
        .at("layers_kept")
        .get<int>();
  };
  EXPECT_EQ(kept(), 30);
  const auto pages = read_pages(directory_ / "out/layers.tif");
  ASSERT_TRUE(pages.ok());
  fs::resize_file(directory_ / "out/layers.tif", pages->pages[20].end() - 8);
  EXPECT_EQ(kept(), 20) << "layers before the cut";
  EXPECT_TRUE(tree_text(directory_ / "out") == whole);
}

TEST_F(PagedJobs, DamageIsFoundAndMadeAgain) {
  lamina(kPagesWithProgram + " -o out" + kAsPages);
  const std::string whole = tree_text(directory_ / "out"), layers = text("out/layers.tif"),
                    program = text("out/program.planes.zst");
  const auto pages = read_pages(directory_ / "out/layers.tif");
  ASSERT_TRUE(pages.ok());
  const JobPage& page = pages->pages[17];
  const auto expect_found = [&](const std::string& name, std::string content, std::size_t at, const std::string& words) {
    content[at] = static_cast<char>(content[at] ^ 1);
    write_text(directory_ / name, content);
    const std::string found = lamina("verify out", 5).err;
    EXPECT_NE(found.find(words), std::string::npos) << found;
    lamina(kPagesWithProgram + " -o out --resume" + kAsPages);
    EXPECT_TRUE(tree_text(directory_ / "out") == whole) << name;
  };
  expect_found("out/layers.tif", layers, page.file + page.content.bytes / 2, "layers/000017.tif");
  expect_found("out/layers.tif", layers, page.directory + 12, "layers/000017.tif");
  expect_found("out/layers.tif", layers, page.directory, "000017.tif");
  expect_found("out/program.planes.zst", program, page.content.program_offset + 20, "program/000017.planes.zst");
  write_text(directory_ / "out/program.old", "");
  EXPECT_NE(lamina("verify out", 5).err.find("program.old: no manifest names it"), std::string::npos);
}

TEST_F(PagedJobs, FilesThatAreNotOfTheJobAreNeitherContinuedNorReplaced) {
  const std::string job = kPagesWithProgram + kAsPages + " -o out";
  lamina(job);
  lamina(kPagesWithProgram + kAsPages + " -o other --rotate 0,0,90");
  const std::string whole = text("out/layers.tif"), program = fs::path(program_name("out")).filename();
  std::string damaged = whole;
  damaged[damaged.size() * 3 / 4] ^= 1;
  write_text(directory_ / "out/layers.tif", damaged);
  for (const std::string& name : {std::string("layers.tif"), program}) {
    fs::copy_file(directory_ / ("other/" + name), directory_ / ("out/" + name + ".part"));
    expect_refused(job + " --resume", 2, "are both there", directory_);
    fs::remove(directory_ / ("out/" + name + ".part"));
  }
  fs::rename(directory_ / "out/layers.tif", directory_ / "real.tif");
  fs::create_symlink("../real.tif", directory_ / "out/layers.tif");
  expect_refused(job + " --resume", 4, "is a link", directory_);
  EXPECT_TRUE(fs::exists(directory_ / "out/manifest.json"));
  fs::remove(directory_ / "out/layers.tif");
  fs::rename(directory_ / "real.tif", directory_ / "out/layers.tif");
  lamina(job + " --resume");
  EXPECT_TRUE(text("out/layers.tif") == whole);
  fs::create_directory(directory_ / "out/layers");
  EXPECT_NE(lamina("verify out", 5).err.find("out/layers: hides what out/layers.tif contains"), std::string::npos);
}

TEST_F(PagedJobs, AJobThatCannotBeginLeavesNoRecord) {
  fs::create_directories(directory_ / "out/layers.tif.part");
  lamina(kPlainPages + kAsPages + " -o out", 4);
  EXPECT_FALSE(fs::exists(directory_ / "out/manifest.json.part"));
  fs::remove(directory_ / "out/layers.tif.part");
  lamina(kPlainPages + kAsPages + " -o out");
}

TEST_F(PagedJobs, ShardsOfLayersAreMergedIntoADirectory) {
  lamina(kPagesWithProgram + " -o whole --quiet");
  lamina(kPagesWithProgram + " -o s1 --layers :12" + kAsPages);
  lamina(kPagesWithProgram + " -o s2 --layers 12:" + kAsPages);
  lamina("merge s1 s2 -o merged --quiet");
  EXPECT_TRUE(tree_text(directory_ / "merged") == tree_text(directory_ / "whole"));
  expect_refused("merge s1 s2 -o s1", 2, "nothing is merged", directory_);
}

TEST_F(PagedJobs, ABatchWritesADirectoryForEachJob) {
  write_text(directory_ / "jobs.txt", kPlainPages + "\ninfo part.stl\n");
  lamina("batch jobs.txt -o out --container tiff --quiet");
  EXPECT_TRUE(fs::exists(directory_ / "out/part/layers.tif"));
  lamina("verify out --quiet");
  const std::string again = lamina("batch jobs.txt -o out --container tiff --resume").err;
  EXPECT_NE(again.find("kept"), std::string::npos) << again;
}

TEST_F(PagedJobs, WhatIsThereIsKept) {
  lamina(kPlainPages + " -o paged" + kAsPages);
  lamina(kPlainPages + " -o folders --quiet");
  fs::create_directory(directory_ / "mine");
  write_text(directory_ / "mine/layers.tif", "mine");
  expect_refused(kPlainPages + " -o paged" + kAsPages, 2, "a finished job", directory_);
  expect_refused(kPlainPages + " -o paged --resume", 2, "with --container tiff", directory_);
  expect_refused(kPlainPages + " -o folders --resume" + kAsPages, 2, "does not write", directory_);
  expect_refused(kPlainPages + " -o mine" + kAsPages, 2, "is there already", directory_);
  expect_refused(kPlainPages + " --dpi 301 -o paged --resume" + kAsPages, 2, "belongs to another job", directory_);
  expect_refused(kPlainPages + " -o new --format png" + kAsPages, 2, "--format png", directory_);
  expect_refused(kPlainPages + " -o new --shard 1/2" + kAsPages, 2, "--shard", directory_);
  const std::string paged = tree_text(directory_ / "paged"), folders = tree_text(directory_ / "folders");
  lamina(kPlainPages + " -o folders --overwrite" + kAsPages);
  EXPECT_TRUE(tree_text(directory_ / "folders") == paged) << "nothing of the other kind is left";
  lamina(kPlainPages + " -o paged --overwrite --quiet");
  EXPECT_TRUE(tree_text(directory_ / "paged") == folders);
}

}  // namespace
}  // namespace lamina::test
