// tests/commands/test_cache.cpp: jobs from a cache have the files of jobs that ran, in every state of the cache.
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/stat.h>

#include <nlohmann/json.hpp>

#include "pipeline/cache/store.h"
#include "tests/commands/program.h"

namespace lamina::test {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::json;

class CachedJobs : public ::testing::Test {
 protected:
  CachedJobs() {
    write_box(directory_ / "part.stl", {0, 0, 0}, {6, 4, 3});
    fs::copy_file(directory_ / "part.stl", directory_ / "copy.stl");
  }

  /// Runs a job with the cache. returns  what the summary states of the cache
  std::string run(const std::string& line, int code = 0) {
    const Outcome outcome = run_lamina(words_of(line + " --json --quiet --cache cache"), directory_.path());
    EXPECT_EQ(outcome.code, code) << line << "\n" << outcome.err;
    const Json json = Json::parse(outcome.out, nullptr, false);
    return json.is_object() ? json.value("cache", "none") : "";
  }
  void plain(const std::string& line) {
    const Outcome outcome = run_lamina(words_of(line + " --quiet"), directory_.path());
    EXPECT_EQ(outcome.code, 0) << line << "\n" << outcome.err;
  }
  std::string tree(const std::string& name) { return tree_text(directory_ / name); }
  void expect_same(const std::string& one, const std::string& other) { EXPECT_TRUE(tree(one) == tree(other)) << one; }

  Directory directory_;
};

const std::string kSmallJet = " --bed 40x40 --dpi 300 --layer 0.1";

TEST_F(CachedJobs, FilesEqualThoseOfASeparateRunAlsoUnderOtherNames) {
  for (const std::string& options : {kSmallJet, std::string(" --machine jet1000 --layer 0.1 --saturation 60"),
                                     kSmallJet + " --levels 16 --format png", kSmallJet + " --layers 3:9 --title box"}) {
    fs::remove_all(directory_ / "cache");
    for (const char* name : {"first", "second", "third", "plain", "plain_copy"}) fs::remove_all(directory_ / name);
    EXPECT_EQ(run("jet part.stl" + options + " -o first"), "added") << options;
    EXPECT_EQ(run("jet part.stl" + options + " -o second"), "hit") << options;
    EXPECT_EQ(run("jet copy.stl" + options + " -o third --threads 1 --sync off"), "hit") << options;
    plain("jet part.stl" + options + " -o plain");
    plain("jet copy.stl" + options + " -o plain_copy");
    expect_same("first", "plain");
    expect_same("second", "plain");
    expect_same("third", "plain_copy");
  }
}

TEST_F(CachedJobs, ToolpathsEqualThoseOfASeparateRun) {
  EXPECT_EQ(run("extrude part.stl --layer 0.3 -o out/first.gcode", 4), "");  // no folder
  for (const char* folder : {"out", "plain"}) fs::create_directory(directory_ / folder);
  EXPECT_EQ(run("extrude part.stl --layer 0.3 -o out/first.gcode"), "added");
  EXPECT_EQ(run("extrude part.stl --layer 0.3 -o out/second.gcode"), "hit");
  EXPECT_EQ(run("extrude copy.stl --layer 0.3 -o out/third.gcode"), "added");  // the file has the name of the part
  EXPECT_EQ(run("extrude part.stl --layer 0.3 -o out/second.gcode", 2), "");
  EXPECT_EQ(run("extrude part.stl --layer 0.3 -o out/second.gcode --overwrite"), "hit");
  plain("extrude part.stl --layer 0.3 -o plain/first.gcode");
  plain("extrude part.stl --layer 0.3 -o plain/second.gcode");
  plain("extrude copy.stl --layer 0.3 -o plain/third.gcode");
  expect_same("out", "plain");
}

TEST_F(CachedJobs, TheSummaryIsThatOfTheRunButForTheRun) {
  std::string open = read_text(directory_ / "part.stl");  // a triangle less
  open[80] = 11;
  open.resize(open.size() - 50);
  write_text(directory_ / "open.stl", open);
  write_text(directory_ / "hole.stl", open);
  const auto summary = [&](const std::string& line) {
    const Outcome outcome = run_lamina(words_of(line + kSmallJet + " --json --quiet"), directory_.path());
    EXPECT_EQ(outcome.code, 0) << line << "\n" << outcome.err;
    Json json = Json::parse(outcome.out, nullptr, false);
    for (const char* key : {"output", "cache", "seconds", "layers_per_second", "pixels_per_second", "layers_planned",
                            "mesh_bytes", "index_bytes", "peak_layer_bytes", "peak_resident_bytes", "max_layers_in_flight"})
      json.erase(key);
    return json;
  };
  summary("jet open.stl -o first --cache cache");
  const Json hit = summary("jet hole.stl -o second --cache cache"), run = summary("jet hole.stl -o third");
  EXPECT_EQ(hit.dump(), run.dump());
  EXPECT_NE(run.dump().find("hole.stl"), std::string::npos);
  // A strict job with warnings takes nothing.
  ASSERT_FALSE(run["warnings"].empty());
  EXPECT_EQ(run_lamina(words_of("jet open.stl -o strict --strict --quiet --cache cache" + kSmallJet), directory_.path()).code,
            5);
}

TEST_F(CachedJobs, DamageIsDetectedAndReplaced) {
  plain("jet part.stl" + kSmallJet + " -o plain");
  run("jet part.stl" + kSmallJet + " -o first");
  std::vector<std::string> files;
  for (const std::string& name : files_below(directory_ / "cache")) {
    if (name.starts_with("jobs/") || name.starts_with("objects/")) files.push_back(name);
  }
  ASSERT_GE(files.size(), 3u);  // the entry, the manifest, and the image of all layers
  int number = 0;
  for (std::size_t f = 0; f < files.size(); ++f) {
    const std::string& file = files[f];
    for (const int kind : {0, 1, 2, 3}) {
      const std::string path = directory_ / ("cache/" + file);
      std::string bytes = read_text(path);
      if (kind == 0) bytes[bytes.size() / 2] = static_cast<char>(bytes[bytes.size() / 2] ^ 4);
      if (kind == 1) bytes.resize(bytes.size() / 2);
      if (kind == 2) bytes = read_text(directory_ / ("cache/" + files[(f + 1) % files.size()]));
      if (kind == 3) {
        fs::remove(path);
      } else {
        write_text(path, bytes);
      }
      const std::string output = "out" + std::to_string(number++);
      EXPECT_EQ(run("jet part.stl" + kSmallJet + " -o " + output), "added") << file << " " << kind;
      expect_same(output, "plain");
      EXPECT_EQ(run("jet part.stl" + kSmallJet + " -o " + output + "-again"), "hit") << file << " " << kind;
      expect_same(output + "-again", "plain");
      fs::remove_all(directory_ / output);
      fs::remove_all(directory_ / (output + "-again"));
    }
  }
}

TEST_F(CachedJobs, AnEntryWithoutAllItsFilesIsNoHit) {
  plain("jet part.stl --machine jet1000 --layer 0.5 -o plain");
  run("jet part.stl --machine jet1000 --layer 0.5 -o first");
  const auto cache = pipeline::JobCache::open(directory_ / "cache", false);
  ASSERT_TRUE(cache.ok());
  const auto entries = (*cache)->entries();
  ASSERT_EQ(entries->size(), 1u);
  const auto entry = (*cache)->inspect(entries->front().key);
  ASSERT_TRUE(entry);
  ASSERT_GT(entry->files.size(), 12u);  // 6 layers and programs, the frame of the program, the machine, the manifest
  for (std::size_t i = 0; i < entry->files.size(); ++i) {
    pipeline::CacheEntry less = *entry;
    less.files.erase(less.files.begin() + static_cast<std::ptrdiff_t>(i));
    ASSERT_TRUE((*cache)->add(entries->front().key, less).ok());
    const std::string output = "out" + std::to_string(i);
    EXPECT_EQ(run("jet part.stl --machine jet1000 --layer 0.5 -o " + output), "added") << entry->files[i].name;
    expect_same(output, "plain");
  }
}

TEST_F(CachedJobs, OutputsAreProtectedAsByARun) {
  run("jet part.stl" + kSmallJet + " -o out");
  EXPECT_EQ(run("jet part.stl" + kSmallJet + " -o out", 2), "");
  EXPECT_EQ(run("jet part.stl" + kSmallJet + " -o out --overwrite"), "hit");
  EXPECT_EQ(run("jet part.stl" + kSmallJet + " -o out --resume"), "added");  // it runs, and keeps its layers
  fs::create_directories(directory_ / "user/layers");
  fs::create_directories(directory_ / "third/program");
  write_text(directory_ / "user/layers/000001.tif", "mine");
  const std::string before = tree("user");
  run("jet part.stl" + kSmallJet + " -o user", 2);
  EXPECT_TRUE(tree("user") == before);
  // Other files in the folders of a job are not added.
  write_text(directory_ / "third/program/notes.txt", "mine");
  EXPECT_NE(run("jet copy.stl --layer 0.2 --machine jet1000 -o third --overwrite"), "added");
  // A part that changes is another job.
  write_box(directory_ / "part.stl", {0, 0, 0}, {6, 4, 2});
  EXPECT_EQ(run("jet part.stl" + kSmallJet + " -o fourth"), "added");
  EXPECT_EQ(files_below(directory_ / "fourth/layers").size(), 20u);
}

TEST_F(CachedJobs, LinksAreReadOnlyNamesOfTheCache) {
  run("jet part.stl" + kSmallJet + " -o first --cache-link");
  EXPECT_EQ(run("jet part.stl" + kSmallJet + " -o second --cache-link"), "hit");
  plain("jet part.stl" + kSmallJet + " -o plain");
  expect_same("second", "plain");
  struct stat facts {};
  ASSERT_EQ(::stat((directory_ / "second/layers/000000.tif").c_str(), &facts), 0);
  EXPECT_GE(facts.st_nlink, 3u);
  EXPECT_EQ(facts.st_mode & 0222, 0u);
  expect_refused("jet part.stl -o third --cache-link", 2, "--cache", directory_);
}

TEST_F(CachedJobs, ABatchTakesEqualJobsFromTheCache) {
  write_text(directory_ / "list.txt",
             "jet part.stl -o a\njet copy.stl -o b\njet part.stl -o c --layers 0:3\njet copy.stl -o d\n");
  write_text(directory_ / "absent.txt", "jet absent.stl -o a\n");
  const auto batch = [&](const std::string& line, int code = 0) {
    const Outcome outcome = run_lamina(words_of("batch " + line + " --jobs 1 --quiet"), directory_.path());
    EXPECT_EQ(outcome.code, code) << outcome.err;
  };
  batch("list.txt -o cached --cache cache");
  batch("list.txt -o plain");
  const Json summary = Json::parse(read_text(directory_ / "cached/summary.json"));
  std::vector<std::string> results;
  for (const Json& job : summary["jobs"]) results.push_back(job["result"]["cache"]);
  EXPECT_EQ(results, (std::vector<std::string>{"added", "hit", "added", "hit"}));
  for (const char* job : {"a", "b", "c", "d"}) expect_same(std::string("cached/") + job, std::string("plain/") + job);
  batch("list.txt -o cached --cache cache --resume");
  batch("absent.txt -o failed --cache cache", 3);
}

TEST_F(CachedJobs, AKilledRunFromTheCacheLeavesNothingThatSeemsWhole) {
  run("jet part.stl --bed 40x40 --dpi 300 --layer 0.01 -o first");
  plain("jet part.stl --bed 40x40 --dpi 300 --layer 0.01 -o plain");
  for (int trial = 0; trial < 10; ++trial) {
    const std::string line = "jet part.stl --bed 40x40 --dpi 300 --layer 0.01 -o out --cache cache --quiet";
    run_lamina(words_of(line), directory_.path(), [&](int process) {
      ::usleep(static_cast<useconds_t>(2000 + 3000 * trial));
      ::kill(process, SIGKILL);
    });
    if (fs::exists(directory_ / "out/manifest.json")) expect_same("out", "plain");
    const Outcome resumed = run_lamina(words_of(line + " --resume"), directory_.path());
    EXPECT_EQ(resumed.code, 0) << resumed.err;
    expect_same("out", "plain");
    fs::remove_all(directory_ / "out");
  }
}

TEST_F(CachedJobs, TheCommandReportsTrimsAndVerifies) {
  run("jet part.stl" + kSmallJet + " -o first");
  run("jet part.stl" + kSmallJet + " -o second");
  const auto report = [&](const std::string& line, int code = 0) {
    const Outcome outcome = run_lamina(words_of("cache " + line + " --json"), directory_.path());
    EXPECT_EQ(outcome.code, code) << outcome.err;
    return Json::parse(outcome.out, nullptr, false);
  };
  Json json = report("cache");
  EXPECT_EQ(json["entries"], 1);
  EXPECT_EQ(json["hits"], 1);
  EXPECT_EQ(json["misses"], 1);
  EXPECT_TRUE(report("cache --verify")["damaged"].empty());
  write_text(directory_ / ("cache/" + files_below(directory_ / "cache/objects").front().insert(0, "objects/")), "other");
  EXPECT_EQ(report("cache --verify", 5)["damaged"].size(), 2u);
  EXPECT_EQ(report("cache")["entries"], 0);
  run("jet part.stl" + kSmallJet + " -o third");
  json = report("cache --max-size 1");
  EXPECT_EQ(json["entries"], 0);
  expect_refused("cache first", 2, "no cache", directory_);
  expect_refused("cache", 2, "name one folder", directory_);
  expect_refused("jet part.stl -o x --cache first", 2, "not a cache", directory_);
  expect_refused("jet part.stl -o x --cache x/cache", 2, "in one another", directory_);
  expect_refused("batch part.stl -o cache/out --cache cache", 2, "in one another", directory_);
}

}  // namespace
}  // namespace lamina::test
