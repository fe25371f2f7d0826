// tests/commands/batch/test_batch.cpp: many jobs in one queue: each ends as it would alone, regardless of the others.
#include <gtest/gtest.h>

#include <algorithm>
#include <fstream>
#include <iterator>
#include <sstream>

#include "tests/commands/batch/batch.h"

namespace lamina::test {
namespace {

TEST_F(JobsInBatch, EveryFileOfTheCorpusEndsAsTheTableSaysAndAsItWouldAlone) {
  const fs::path corpus = fs::path(LAMINA_TEST_DIR) / "corpus";
  ASSERT_EQ(
      lamina(batch_of({corpus, "-o", "out"}, {"--with", "jet --bed 400x400 --dpi 60 --layer 1 --allow-empty", "--quiet"})).code,
      3);
  std::map<std::string, std::string> expected;
  std::ifstream table(corpus / "outcomes.tsv");
  for (std::string line; std::getline(table, line);) {
    std::istringstream cells(line);
    std::string file, outcome, code;
    cells >> file >> outcome >> code;
    expected[file] = code;
  }
  const Json json = summary("out");
  std::size_t done = 0;
  for (const Json& job : json["jobs"]) {
    const std::string file = fs::path(job["source"].get<std::string>()).lexically_relative(corpus);
    ASSERT_TRUE(expected.contains(file)) << file;
    EXPECT_EQ(std::to_string(job["code"].get<int>()), expected[file]) << file << ": " << job["reason"];
    EXPECT_EQ(job["code"] == 0, job["reason"] == "") << file;
    if (job["code"] != 0) continue;
    EXPECT_GT(job["result"]["layers_planned"], 0);
    if (done++ % 4 != 0) continue;
    ASSERT_EQ(lamina({"jet", corpus / file, "--bed", "400x400", "--dpi", "60", "--layer", "1", "--allow-empty", "--quiet", "-o",
                      "alone", "--overwrite"})
                  .code,
              0);
    EXPECT_EQ(tree_text(directory_ / "alone"), tree_text(directory_ / ("out/" + job["output"].get<std::string>()))) << file;
  }
  EXPECT_EQ(json["done"], done);
  EXPECT_EQ(json["jobs_total"], json["jobs"].size());
  EXPECT_LT(json["peak_resident_bytes"], json["memory_budget_bytes"]);
}

TEST_F(JobsInBatch, ListsJobFilesAndDirectoriesMakeOneQueueInOrder) {
  write_boxes(2);
  fs::create_directories(directory_ / "more/deep");
  write_box(directory_ / "more/deep/p.stl", {0, 0, 0}, {5, 5, 1});
  write_box(directory_ / "more/p.STL", {0, 0, 0}, {5, 5, 1});
  write_text(directory_ / "more/notes.txt", "no job");
  write_text(directory_ / "job.toml", "[bed]\nsize_mm=[40,40]\ndpi=100\n[[part]]\npath='part10.stl'\n");
  write_text(directory_ / "list.txt",
             "# comment\n\nlamina jet part10.stl --bed 40x40 --dpi 100 -o 'own place'\ninfo part11.stl\n"
             "jet part10.stl --bed 40x40 --dpi 100\njet part10.stl --bed 40x40 --dpi 100 --dry-run\n");
  const Outcome outcome = lamina(batch_of({"list.txt", "job.toml", "more", "part11.stl", "-o", "out"}));
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  const Json json = summary("out");
  Words outputs;
  for (const Json& job : json["jobs"]) outputs.push_back(job["output"]);
  EXPECT_EQ(outputs, (Words{"own place", "", "part10", "", "job", "deep_p", "p", "part11"}));
  EXPECT_EQ(json["jobs"][0]["source"], "list.txt:3");
  EXPECT_TRUE(json["jobs"][1]["result"].is_object());
  EXPECT_EQ(json["jobs"][3]["result"]["dry_run"], true);
  for (const char* name : {"own place", "job", "deep_p"})
    EXPECT_EQ(lamina({"verify", "out/" + std::string(name), "--quiet"}).code, 0) << name;
  const std::string table = read_text(directory_ / "out/summary.tsv");
  EXPECT_EQ(std::ranges::count(table, '\n'), 9);
}

TEST_F(JobsInBatch, ASavedJobIsRunByTheCommandThatSavedIt) {
  write_boxes(1);
  fs::create_directories(directory_ / "jobs");
  const Words part = {"part10.stl", "--layer", "0.254", "--quiet", "--save-job"};
  const auto save = [&](Words words, const std::string& name, const Words& more) {
    words.insert(words.end(), part.begin(), part.end());
    words.push_back("jobs/" + name);
    words.insert(words.end(), more.begin(), more.end());
    const Outcome outcome = lamina(words);
    EXPECT_EQ(outcome.code, 0) << outcome.err;
  };
  save({"extrude"}, "beads.toml", {"--dry-run"});
  save({"extrude", "--machine", "fdm-2000"}, "lines.toml", {"--dry-run"});
  save({"slice", "--format", "cli"}, "cuts.toml", {"--dry-run"});
  save({"jet", "--dpi", "100", "--bed", "40x40"}, "images.toml", {"--dry-run"});
  write_text(directory_ / "jobs/other.toml",
             "# A job of lamina. Run it with: lamina frobnicate --job FILE\n\n[bed]\ndpi = 100\n");
  const Outcome outcome = lamina({"batch", "jobs", "-o", "out", "--quiet"});
  EXPECT_EQ(outcome.code, 2) << outcome.err;
  const Json json = summary("out");
  ASSERT_EQ(json["jobs"].size(), 5u);
  for (const auto& [position, output] : {std::pair{0, "beads.gcode"}, {1, "cuts"}, {2, "images"}, {3, "lines.sml"}}) {
    const Json& job = json["jobs"][static_cast<std::size_t>(position)];
    EXPECT_EQ(job["outcome"], "done") << job;
    EXPECT_EQ(job["output"], output);
  }
  EXPECT_NE(json["jobs"][4]["reason"].get<std::string>().find("frobnicate"), std::string::npos) << json["jobs"][4];
  EXPECT_NE(read_text(directory_ / "out/beads.gcode").find(";FLAVOR:"), std::string::npos);
}

TEST_F(JobsInBatch, AnyCommandIsAJobAndGivesItsValue) {
  write_boxes(2);
  write_text(directory_ / "list.txt",
             "slice part10.stl --layer 0.5 -o s\nextrude part10.stl --layer 0.2\nextrude part10.stl --machine fdm-2000\n"
             "heights part10.stl --layer 0.5\ninfo part10.stl part11.stl\ninfo nowhere.stl part10.stl gone.stl\n"
             "extrude part11.stl --layer 0.2 -o beads.gcode\nmanual jet -o pages\n");
  const Outcome outcome = lamina({"batch", "list.txt", "-o", "out", "--json", "--quiet"});
  EXPECT_EQ(outcome.code, 3) << outcome.err;
  EXPECT_EQ(std::ranges::count(outcome.out, '\n'), 1);
  const Json json = summary("out"), jobs = json["jobs"];
  EXPECT_EQ(Json::parse(outcome.out), json);
  Words outputs;
  for (const Json& job : jobs) outputs.push_back(job["output"]);
  EXPECT_EQ(outputs, (Words{"s", "part10.gcode", "part10.sml", "", "", "", "beads.gcode", "pages"}));
  for (const int i : {0, 1, 2, 6}) {
    EXPECT_GT(jobs[i]["result"]["layers_planned"], 0) << i;
    EXPECT_GT(jobs[i]["files"], 0) << i;
  }
  EXPECT_EQ(jobs[0]["result"]["command"], "slice");
  EXPECT_TRUE(jobs[3]["result"].is_string());
  ASSERT_EQ(jobs[4]["result"].size(), 2u);
  EXPECT_EQ(jobs[4]["result"][1]["path"], "part11.stl");
  // What can be said is said, and the reason is what went wrong first.
  EXPECT_EQ(jobs[5]["result"]["path"], "part10.stl");
  EXPECT_NE(jobs[5]["reason"].get<std::string>().find("nowhere.stl"), std::string::npos) << jobs[5]["reason"];
  ASSERT_EQ(lamina({"extrude", "part11.stl", "--layer", "0.2", "--quiet", "-o", "alone.gcode"}).code, 0);
  EXPECT_EQ(read_text(directory_ / "out/beads.gcode"), read_text(directory_ / "alone.gcode"));
}

TEST_F(JobsInBatch, WhatIsWrongWithOneJobIsOneLineAndTheRestIsUnharmed) {
  write_boxes(1);
  write_text(directory_ / "missing.toml", "[[part]]\npath='nowhere.stl'\n");
  write_text(directory_ / "wrong.toml", "[bed]\ndpy=3\n");
  write_text(directory_ / "file", "");
  fs::create_directories(directory_ / "half");
  write_text(directory_ / "half/manifest.json.part", "{\n");  // a job that is not finished
  write_text(directory_ / "list.txt",
             "jet part10.stl --bed 60x60 --dpi 0 -o a\njott part10.stl\njet --job missing.toml -o b\n"
             "jet --job wrong.toml\nbatch list.txt -o x\npreview out -o x.png\njet part10.stl --help\n"
             "jet part10.stl --bed 60x60 --dpi 100 -o " +
                 directory_ / "file/deeper" +
                 "\nverify nothing\nreport half -o page.html\n"
                 "jet part10.stl --bed 60x60 --dpi 100 -o good\n");
  const Outcome outcome = lamina({"batch", "list.txt", "-o", "out"});
  EXPECT_EQ(outcome.code, 2);
  const Json json = summary("out");
  const int codes[] = {2, 2, 3, 2, 2, 2, 2, 4, 2, 5, 0};
  ASSERT_EQ(json["jobs"].size(), std::size(codes));
  for (std::size_t i = 0; i < std::size(codes); ++i) {
    const std::string reason = json["jobs"][i]["reason"];
    EXPECT_EQ(json["jobs"][i]["code"], codes[i]) << i << " " << reason;
    EXPECT_EQ(reason.empty(), codes[i] == 0) << i;
    EXPECT_NE(outcome.err.find(reason), std::string::npos) << reason;
  }
  EXPECT_EQ(lamina({"verify", "out/good"}).code, 0);
  // Each says where it is wrong and what to do.
  EXPECT_EQ(json["jobs"][2]["reason"],
            "missing.toml:2:6: part.path: nowhere.stl: no such file; correct it (relative paths start at the job file)");
  EXPECT_EQ(json["jobs"][9]["reason"], "half: the job is not finished; complete it with --resume first");
}

TEST_F(JobsInBatch, WrongBatchesAreRefusedInOneLineBeforeAnythingRuns) {
  write_boxes(2);
  fs::create_directories(directory_ / "empty");
  write_text(directory_ / "empty.txt", "\n# nothing\n");
  write_text(directory_ / "quote.txt", "jet 'part10.stl\n");
  write_text(directory_ / "same.txt", "jet part10.stl -o a\njet part11.stl -o b/../a/\n");
  write_text(directory_ / "nested.txt", "jet part10.stl -o a\njet part11.stl -o a-b\njet part11.stl -o a/layers/c\n");
  write_text(directory_ / "own.txt", "jet part10.stl -o .\n");
  // Where the batch does not let its jobs write: out of its directory, and its own files.
  write_text(directory_ / "away.txt", "jet part10.stl -o a\njet part11.stl -o a/../../keep\n");
  write_text(directory_ / "above.txt", "jet part10.stl -o ..\n");
  write_text(directory_ / "record.txt", "jet part10.stl -o a\njet part11.stl -o batch.jsonl\n");
  write_text(directory_ / "summary.txt", "jet part10.stl -o b/../summary.json/\n");
  write_text(directory_ / "table.txt", "jet part10.stl -o " + directory_ / "out/summary.tsv/deep/er" + "\n");
  const std::pair<Words, std::string> cases[] = {
      {{"away.txt"}, "away.txt:2: -o leads out of out, to keep"},
      {{"above.txt"}, "has to be an absolute path"},
      {{"record.txt"}, "record.txt:2: writes into out/batch.jsonl, which belongs to the batch"},
      {{"summary.txt"}, "out/summary.json, which belongs"},
      {{"table.txt"}, "out/summary.tsv, which belongs"},
      {{"empty.txt"}, "no job in it"},
      {{"empty"}, "no part"},
      {{"quote.txt"}, "quote.txt:1: a ' is not closed"},
      {{"same.txt"}, "same.txt:1 and same.txt:2: both write into"},
      {{"nested.txt"}, "nested.txt:1 and nested.txt:3"},
      {{"own.txt"}, "belongs to the batch"},
      {{"gone.txt"}, "gone.txt: no such file or directory; name a list"},
      {{}, "no jobs"},
      {{"part10.stl", "--memory", "x"}, "--memory"},
      {{"part10.stl", "--jobs", "-1"}, "--jobs"},
      {{"part10.stl", "--time-limit", "0"}, "--time-limit"},
      {{"part10.stl", "--resume", "--overwrite"}, "exclude each other"},
      {{"part10.stl", "--with", " "}, "--with"}};
  for (auto [words, said] : cases) {
    words.insert(words.end(), {"-o", "out"});
    const Outcome outcome = lamina(batch_of(words, {}));
    EXPECT_EQ(outcome.code, 2) << outcome.err;
    EXPECT_EQ(outcome.error_lines(), 1u) << outcome.err;
    EXPECT_NE(outcome.err.find(said), std::string::npos) << outcome.err;
    EXPECT_FALSE(fs::exists(directory_ / "out"));
  }
  EXPECT_FALSE(fs::exists(directory_ / "keep"));
  EXPECT_EQ(lamina(batch_of({"part10.stl"}, {})).code, 2);
}

TEST_F(JobsInBatch, NamesOfPartsAreNoReasonToWriteOverTheBatchAndAbsoluteOutputsLieAnywhere) {
  write_boxes(1);
  fs::copy_file(directory_ / "part10.stl", directory_ / "summary.json.stl");
  write_text(directory_ / "list.txt", "jet part10.stl --bed 60x60 --dpi 100 -o " + directory_ / "keep" + "\n");
  const Outcome outcome = lamina(batch_of({"summary.json.stl", "list.txt", "-o", "./out"}));
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_EQ(outcome.err, "");
  EXPECT_EQ(summary("out")["jobs"][0]["output"], "summary.json-2");
  EXPECT_EQ(lamina({"verify", "keep", "--quiet"}).code, 0);
}

TEST_F(JobsInBatch, PartsThatJobsShareAreThoseOfSeparateRuns) {
  const std::string corpus = LAMINA_TEST_DIR "/corpus/";
  const Words parts = {corpus + "dental_crown.stl", corpus + "broken/cube_missing_corner.stl",
                       corpus + "cube_gears_17_items.3mf", corpus + "broken/nut_nan_inf.stl"};
  const Words options = {"",
                         "--dpi 200",
                         "--no-repair --allow-empty",
                         "--weld 50",
                         "--scale 2",
                         "--rotate 0,0,30",
                         "--drop-bad",
                         "--fill-rule evenodd",
                         "--copies 2",
                         "--engine contours"};
  Words lines;
  std::string list;
  for (int round = 0; round < 2; ++round) {
    for (const std::string& part : parts) {
      for (const std::string& option : options) {
        lines.push_back("jet " + part + " --bed 300x300 --dpi 60 --layer 1 " + option);
        list += lines.back() + " -o " + std::to_string(lines.size()) + "\n";
      }
    }
  }
  write_text(directory_ / "list.txt", list);
  lamina({"batch", "list.txt", "-o", "out", "--jobs", "2", "--quiet"});
  const Json json = summary("out");
  ASSERT_EQ(json["jobs"].size(), lines.size());
  for (std::size_t i = 0; i < lines.size(); ++i) {
    SCOPED_TRACE(lines[i]);
    const Json &job = json["jobs"][i], &twin = json["jobs"][(i + lines.size() / 2) % lines.size()];
    EXPECT_EQ(job["reason"], twin["reason"]);
    EXPECT_EQ(job["hash"], twin["hash"]);
    if (i >= lines.size() / 2) continue;
    std::istringstream stream(lines[i] + " --quiet --overwrite --json -o alone");
    const Outcome alone = lamina({std::istream_iterator<std::string>(stream), {}});
    EXPECT_EQ(job["code"], alone.code) << alone.err;
    if (alone.code != 0) {
      EXPECT_NE(alone.err.find(job["reason"].get<std::string>()), std::string::npos) << alone.err;
      continue;
    }
    EXPECT_EQ(tree_text(directory_ / "alone"), tree_text(directory_ / ("out/" + std::to_string(i + 1))));
    EXPECT_EQ(job["result"]["warnings"], Json::parse(alone.out)["warnings"]);
    EXPECT_EQ(job["result"]["parts"], Json::parse(alone.out)["parts"]);
  }
}

TEST_F(JobsInBatch, QuietItStillSaysWhichJobsFail) {
  write_boxes(1);
  write_text(directory_ / "list.txt", "jet part10.stl --bed 60x60 --dpi 100 -o a\njet nowhere.stl -o b\n");
  const Outcome outcome = lamina({"batch", "list.txt", "-o", "out", "--quiet"});
  EXPECT_EQ(outcome.code, 3);
  EXPECT_EQ(outcome.error_lines(), 1u) << outcome.err;
  EXPECT_EQ(outcome.err.find("lamina: list.txt:2: "), 0u) << outcome.err;
  EXPECT_NE(outcome.err.find("nowhere.stl"), std::string::npos) << outcome.err;
}

TEST_F(JobsInBatch, TimeLimitStopsOneJobAndFailFastAll) {
  write_boxes(2);
  // Short jobs take hundredths of the limit, and seconds under a sanitizer on a busy machine.
  write_text(directory_ / "list.txt",
             "jet part10.stl --bed 60x60 --dpi 100 -o a\n"
             "jet part10.stl --bed 400x400 --dpi 1200 --layer 0.00001 --format png -o long\n"
             "jet part11.stl --bed 60x60 --dpi 100 -o b\n");
  const Outcome outcome = lamina({"batch", "list.txt", "-o", "out", "--jobs", "1", "--time-limit", "2"});
  EXPECT_EQ(outcome.code, 3);  // of a job that failed: the batch was not interrupted
  EXPECT_EQ(outcomes("out"), (Words{"done", "time limit", "done"}));
  EXPECT_EQ(summary("out")["jobs"][1]["reason"], "took longer than its time limit of 2 s");
  EXPECT_EQ(summary("out")["jobs"][1]["code"], 3);
  EXPECT_NE(outcome.err.find("3: 2 done, 1 failed\n"), std::string::npos) << outcome.err;
  EXPECT_NE(outcome.err.find("time limit list.txt:2: took longer than its time limit of 2 s\n"), std::string::npos)
      << outcome.err;
  write_text(directory_ / "fast.txt", "jet part10.stl --bed 60x60 --dpi 100 -o a\njet nowhere.stl -o c\njet part11.stl -o d\n");
  EXPECT_EQ(lamina({"batch", "fast.txt", "-o", "fast", "--jobs", "1", "--fail-fast", "--quiet"}).code, 3);
  EXPECT_EQ(outcomes("fast"), (Words{"done", "failed", "not run"}));
  EXPECT_FALSE(fs::exists(directory_ / "fast/d"));
}

TEST_F(JobsInBatch, JobsBeginOnlyWhenTheirNeedFitsAndALargerOneRunsAlone) {
  write_boxes(6);
  std::string list;
  for (int i = 10; i < 16; ++i) {
    list += "jet part" + std::to_string(i) + ".stl --bed 60x60 --dpi 300 --memory " + (i == 13 ? "500M" : "40M") + "\n";
  }
  write_text(directory_ / "list.txt", list);
  ASSERT_EQ(lamina({"batch", "list.txt", "-o", "out", "--jobs", "6", "--memory", "120M", "--quiet"}).code, 0);
  const Json json = summary("out");
  EXPECT_LE(json["max_running"], 2);
  EXPECT_GT(json["max_need_bytes"], 500ull << 20);
  EXPECT_LT(json["max_need_bytes"], 530ull << 20);                   // alone
#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)  // whose shadow memory counts
  EXPECT_LT(json["peak_resident_bytes"], 120ull << 20);
#endif
}

}  // namespace
}  // namespace lamina::test
