// tests/commands/watch/test_watch.cpp: what comes into a watched folder is planned once, whole, and moved.
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <csignal>
#include <nlohmann/json.hpp>
#include <sstream>
#include <thread>

#include "tests/commands/program.h"

namespace lamina::test {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::json;
using Words = std::vector<std::string>;

class WatchedFolder : public ::testing::Test {
 protected:
  WatchedFolder() { fs::create_directories(directory_ / "in/sub"); }

  Outcome watch(Words more = {}, const std::function<void(int)>& meanwhile = {}) {
    Words words = {"watch",    "in",   "-o",     "out", "--with", "jet --bed 20x20 --dpi 100 --layer 0.5",
                   "--settle", "0.05", "--poll", "0.02"};
    if (!meanwhile) words.push_back("--once");
    words.insert(words.end(), more.begin(), more.end());
    return run_lamina(words, directory_.path(), meanwhile);
  }
  void put_box(const std::string& name, float height = 2) { write_box(directory_ / name, {0, 0, 0}, {5, 5, height}); }
  bool has(const std::string& name) { return fs::exists(directory_ / name); }
  bool wait_for(const std::string& name) {
    for (int i = 0; i < 3000 && !has(name); ++i) std::this_thread::sleep_for(std::chrono::milliseconds(10));
    return has(name);
  }
  /// Events of the record of that kind.
  std::vector<Json> events(const std::string& kind) {
    std::istringstream lines(read_text(directory_ / "out/watch.jsonl"));
    std::vector<Json> found;
    for (std::string line; std::getline(lines, line);) {
      const Json json = Json::parse(line, nullptr, false);
      if (json.is_object() && json["event"] == kind) found.push_back(json);
    }
    return found;
  }
  int layers_of(const std::string& output) {
    return static_cast<int>(Json::parse(read_text(directory_ / (output + "/manifest.json")))["layers"].size());
  }

  Directory directory_;
};

TEST_F(WatchedFolder, PartsArePlannedAndMovedWithTheirFolders) {
  put_box("in/a.stl");
  put_box("in/sub/b.stl", 3);
  write_text(directory_ / "in/notes.txt", "no part");
  put_box("in/.hidden.stl");
  put_box("in/c.stl.part");
  const Outcome outcome = watch();
  EXPECT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_EQ(files_below(directory_ / "in"), (Words{".hidden.stl", "c.stl.part", "done/a.stl", "done/sub/b.stl", "notes.txt"}));
  for (const char* name : {"a", "sub/b"})
    EXPECT_EQ(run_lamina({"verify", "out/" + std::string(name)}, directory_.path()).code, 0);
  EXPECT_EQ(layers_of("out/sub/b"), 6);
  EXPECT_FALSE(has("out/.watch"));
  // The same bytes as those of a run without a watcher.
  EXPECT_EQ(run_lamina(words_of("jet in/done/a.stl --bed 20x20 --dpi 100 --layer 0.5 -o alone"), directory_.path()).code, 0);
  EXPECT_EQ(tree_text(directory_ / "out/a"), tree_text(directory_ / "alone"));
}

TEST_F(WatchedFolder, ASecondPartOfANameOverwritesNothing) {
  put_box("in/a.stl");
  EXPECT_EQ(watch().code, 0);
  put_box("in/a.stl", 4);
  EXPECT_EQ(watch().code, 0);
  EXPECT_EQ(files_below(directory_ / "in"), (Words{"done/a-2.stl", "done/a.stl"}));
  EXPECT_EQ(layers_of("out/a"), 4);
  EXPECT_EQ(layers_of("out/a-2"), 8);
}

TEST_F(WatchedFolder, AResultIsNeverPutAmongTheFilesOfAnother) {
  put_box("in/sub.stl");
  EXPECT_EQ(watch().code, 0);
  put_box("in/sub/b.stl");
  EXPECT_EQ(watch().code, 0);
  EXPECT_TRUE(has("out/sub-2/b/manifest.json"));
  EXPECT_EQ(run_lamina({"verify", "out/sub"}, directory_.path()).code, 0);
}

TEST_F(WatchedFolder, ToolpathsAndValuesAreResultsToo) {
  put_box("in/a.stl");
  EXPECT_EQ(watch({"--with", "extrude --layer 0.2"}).code, 0);
  EXPECT_TRUE(has("out/a.gcode"));
  put_box("in/b.stl");
  const Outcome outcome = watch({"--with", "info", "--json"});
  EXPECT_EQ(outcome.code, 0) << outcome.err;
  const Json json = Json::parse(outcome.out);
  EXPECT_EQ(json["part"], "b.stl");
  EXPECT_EQ(json["outcome"], "done");
  EXPECT_EQ(json["output"], "");
  EXPECT_EQ(json["result"].value("closed", false), true);
  EXPECT_EQ(files_below(directory_ / "out"), (Words{"a.gcode", "a.gcode.json", "watch.jsonl"}));
}

TEST_F(WatchedFolder, AFailedPartHasItsErrorUnderItsName) {
  write_text(directory_ / "in/a.obj", "v 0 0 0\n");
  put_box("in/b.stl");
  const Outcome outcome = watch({"--quiet"});
  EXPECT_EQ(outcome.code, 3);
  EXPECT_EQ(outcome.error_lines(), 1u) << outcome.err;
  EXPECT_EQ(files_below(directory_ / "in"), (Words{"done/b.stl", "failed/a.obj"}));
  const std::string error = read_text(directory_ / "out/a.error.txt");
  EXPECT_EQ(std::ranges::count(error, '\n'), 1);
  EXPECT_NE(error.find("a.obj"), std::string::npos);
  EXPECT_NE(outcome.err.find(error), std::string::npos) << outcome.err;
  EXPECT_FALSE(has("out/a"));
}

TEST_F(WatchedFolder, AnIncompleteFileWaitsAndIsReportedOnce) {
  put_box("whole.stl");
  const std::string bytes = read_text(directory_ / "whole.stl");
  write_text(directory_ / "in/a.stl", bytes.substr(0, 300));
  const Outcome outcome = watch();
  EXPECT_EQ(outcome.code, 3);
  EXPECT_NE(outcome.err.find("in/a.stl: incomplete: 300 of 684 bytes"), std::string::npos) << outcome.err;
  EXPECT_EQ(files_below(directory_ / "in"), Words{"a.stl"});
  EXPECT_TRUE(events("begun").empty());
  write_text(directory_ / "in/a.stl", bytes);
  EXPECT_EQ(watch().code, 0);
  EXPECT_EQ(files_below(directory_ / "in"), Words{"done/a.stl"});
}

TEST_F(WatchedFolder, AJobFileNextToAPartIsItsJob) {
  put_box("in/a.stl");
  put_box("in/b.stl");
  write_text(directory_ / "in/a.toml", "[bed]\nsize_mm = [10, 10]\ndpi = 50\n[layers]\nthickness_mm = 1\n");
  EXPECT_EQ(watch().code, 0);
  EXPECT_EQ(files_below(directory_ / "in"), (Words{"done/a.stl", "done/a.toml", "done/b.stl"}));
  EXPECT_EQ(layers_of("out/a"), 2);
  EXPECT_EQ(layers_of("out/b"), 4);
}

TEST_F(WatchedFolder, AJobFileThatNamesPartsIsAJobOfAllOfThem) {
  put_box("in/a.stl");
  put_box("in/sub/b.stl", 3);
  put_box("outside.stl", 4);
  write_text(directory_ / "in/both.toml",
             "[bed]\nsize_mm = [40, 40]\ndpi = 50\n[layers]\nthickness_mm = 1\n"
             "[[part]]\npath = 'a.stl'\n[[part]]\npath = 'sub/b.stl'\n[[part]]\npath = '../outside.stl'\n");
  write_text(directory_ / "in/again.toml",
             "[bed]\nsize_mm = [40, 40]\ndpi = 50\n[layers]\nthickness_mm = 1\n[[part]]\npath = 'a.stl'\n");
  EXPECT_EQ(watch().code, 0);
  EXPECT_EQ(files_below(directory_ / "in"), (Words{"done/a.stl", "done/again.toml", "done/both.toml", "done/sub/b.stl"}));
  EXPECT_TRUE(has("outside.stl"));
  EXPECT_EQ(layers_of("out/both"), 4);
  EXPECT_EQ(layers_of("out/again"), 2);
  EXPECT_FALSE(has("out/a"));
}

TEST_F(WatchedFolder, AJobWaitsForItsParts) {
  write_text(directory_ / "in/job.toml", "[[part]]\npath = 'later.stl'\n");
  write_text(directory_ / "in/lonely.toml", "[bed]\ndpi = 50\n");
  const Outcome outcome = watch();
  EXPECT_EQ(outcome.code, 3) << outcome.err;
  EXPECT_NE(outcome.err.find("in/job.toml: waiting for in/later.stl"), std::string::npos) << outcome.err;
  EXPECT_NE(outcome.err.find("in/lonely.toml: names no part"), std::string::npos) << outcome.err;
  EXPECT_TRUE(events("begun").empty());
  write_text(directory_ / "in/broken.toml", "[bed]\ndpi = = 50\n");
  put_box("in/broken.stl");
  put_box("in/later.stl");
  fs::remove(directory_ / "in/lonely.toml");
  EXPECT_EQ(watch({"--memory", "48M"}).code, 2);
  EXPECT_EQ(files_below(directory_ / "in"),
            (Words{"done/job.toml", "done/later.stl", "failed/broken.stl", "failed/broken.toml"}));
  EXPECT_NE(read_text(directory_ / "out/broken.error.txt").find("broken.toml:2"), std::string::npos);
}

TEST_F(WatchedFolder, APartThatIsRemovedIsWaitedForAgain) {
  write_text(directory_ / "in/job.toml", "[layers]\nthickness_mm = 1\n[[part]]\npath = 'a.stl'\n[[part]]\npath = 'b.stl'\n");
  put_box("in/a.stl");
  const Outcome outcome = watch({"--jobs", "1"}, [&](int process) {
    EXPECT_TRUE(wait_for("out/watch.jsonl"));
    for (int i = 0; i < 3; ++i) {
      std::this_thread::sleep_for(std::chrono::milliseconds(150));
      fs::remove(directory_ / "in/a.stl");
      std::this_thread::sleep_for(std::chrono::milliseconds(150));
      put_box("in/a.stl");
    }
    put_box("in/b.stl");
    EXPECT_TRUE(wait_for("in/done/job.toml"));
    ::kill(process, SIGTERM);
  });
  EXPECT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_EQ(layers_of("out/job"), 2);
}

TEST_F(WatchedFolder, AJobFileStaysUntilAllItsPartsArePlanned) {
  put_box("in/a.stl", 8);
  write_text(directory_ / "in/a.obj",  // a tetrahedron of 2 mm, planned for longer than the folder is left unread
             "v 0 0 0\nv 5 0 0\nv 0 5 0\nv 0 0 2\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n");
  write_text(directory_ / "in/a.toml", "[bed]\nsize_mm = [20, 20]\ndpi = 2400\n[layers]\nthickness_mm = 0.002\n");
  const Outcome outcome = watch({"--jobs", "2"});
  EXPECT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_TRUE(events("dropped").empty());
  EXPECT_EQ(files_below(directory_ / "in"), (Words{"done/a.obj", "done/a.stl", "done/a.toml"}));
  EXPECT_EQ(layers_of("out/a") + layers_of("out/a-2"), 5000);
}

TEST_F(WatchedFolder, PartsWaitForAJobFileThatMayNameThem) {
  write_text(directory_ / "in/sub/job.toml", "");
  put_box("in/sub/a.stl");
  put_box("in/b.stl");
  const Outcome outcome = watch();
  EXPECT_EQ(outcome.code, 3);
  EXPECT_NE(outcome.err.find("in/sub/job.toml: incomplete: it is empty"), std::string::npos) << outcome.err;
  EXPECT_EQ(files_below(directory_ / "in"), (Words{"done/b.stl", "sub/a.stl", "sub/job.toml"}));
  write_text(directory_ / "in/sub/job.toml", "[layers]\nthickness_mm = 1\n[[part]]\npath = 'a.stl'\n");
  EXPECT_EQ(watch().code, 0);
  EXPECT_EQ(layers_of("out/sub/job"), 2);
  EXPECT_FALSE(has("out/sub/a"));
}

TEST_F(WatchedFolder, AFolderHasSettingsOfItsOwn) {
  put_box("in/a.stl");
  put_box("in/sub/b.stl");
  fs::create_directories(directory_ / "in/sub/deep");
  put_box("in/sub/deep/c.stl");
  write_text(
      directory_ / "in/sub/watch.toml",
      "with = \"jet --bed 20x20 --dpi 100 --layer 1\"\noutput = \"../../elsewhere\"\nthen = \"echo $LAMINA_PART > then.txt\"\n");
  write_text(directory_ / "in/sub/deep/watch.toml", "with = \"extrude --layer 0.2\"\nthen = \"\"\n");
  const Outcome outcome = watch();
  EXPECT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_EQ(layers_of("out/a"), 4);
  EXPECT_EQ(layers_of("elsewhere/b"), 2);
  EXPECT_TRUE(has("elsewhere/deep/c.gcode"));
  EXPECT_EQ(read_text(directory_ / "then.txt"), fs::weakly_canonical(directory_ / "in/done/sub/b.stl").string() + "\n");
  EXPECT_TRUE(has("in/sub/watch.toml"));
}

TEST_F(WatchedFolder, PartsWaitForTheCorrectionOfTheirSettings) {
  put_box("in/a.stl");
  put_box("in/sub/b.stl");
  for (const auto& [text, words] :
       {std::pair{"\nwiht = \"jet\"\n", "in/sub/watch.toml:2:8: wiht: unknown key; did you mean 'with'?"},
        {"settle_s = \"soon\"\n", "in/sub/watch.toml:1:12: settle_s: "},
        {"with = \"batch\"\n", "'batch' cannot be a job"},
        {"with = \"jet -o x\"\n", "has -o"},
        {"with = \"jet --machine nuferbj --quote q.csv\"\n", "with: --quote q.csv: is one file for all parts"},
        {"with = \"jet --dip 3\"\n", "--dip"},
        {"output = \".\"\n", "is in the watched folder"},
        {"", "in/sub/watch.toml: is empty or incomplete"},
        {"with = [\n", "in/sub/watch.toml:"}}) {
    write_text(directory_ / "in/sub/watch.toml", text);
    const Outcome outcome = watch({"--quiet"});
    EXPECT_EQ(outcome.code, 2) << text;
    EXPECT_NE(outcome.err.find(words), std::string::npos) << outcome.err;
    EXPECT_EQ(outcome.error_lines(), 1u) << outcome.err;
    EXPECT_TRUE(has("in/sub/b.stl"));
  }
  write_text(directory_ / "in/sub/watch.toml", "settle_s = 0.1\n");
  fs::permissions(directory_ / "in/sub/watch.toml", fs::perms::others_write, fs::perm_options::add);
  EXPECT_NE(watch().err.find("other users may write it"), std::string::npos);
  fs::permissions(directory_ / "in/sub/watch.toml", fs::perms::others_write, fs::perm_options::remove);
  EXPECT_EQ(watch().code, 0);
  EXPECT_EQ(files_below(directory_ / "in"), (Words{"done/a.stl", "done/sub/b.stl", "sub/watch.toml"}));
}

TEST_F(WatchedFolder, TheCommandAfterAJobKnowsItsResult) {
  put_box("in/a.stl");
  write_text(directory_ / "in/b.obj", "v 0 0 0\n");
  ::setenv("LAMINA_OF_USER", "own", 1);
  ::setenv("LAMINA_CODE", "old", 1);
  const Outcome outcome = watch(
      {"--json", "--then",
       "test \"$LAMINA_OF_USER\" = own && echo \"$LAMINA_CODE|$LAMINA_OUTPUT|$LAMINA_PART|$LAMINA_ERROR\" >> then.txt; echo chatter; exit 7"});
  EXPECT_EQ(outcome.code, 3);
  const std::string text = read_text(directory_ / "then.txt"), top = fs::weakly_canonical(directory_.path()).string();
  EXPECT_NE(text.find("0|" + top + "/out/a|" + top + "/in/done/a.stl|\n"), std::string::npos) << text;
  EXPECT_NE(text.find("3||" + top + "/in/failed/b.obj|in/b.obj"), std::string::npos) << text;
  std::istringstream lines(outcome.out);
  int count = 0;
  for (std::string line; std::getline(lines, line); ++count) EXPECT_EQ(Json::parse(line)["then_code"], 7);
  EXPECT_EQ(count, 2);
  EXPECT_NE(outcome.err.find("--then ended with exit code 7"), std::string::npos);
  EXPECT_EQ(watch().code, 0);
  EXPECT_EQ(events("planned").size(), 2u);
}

TEST_F(WatchedFolder, PartsMayGoToAnotherFileSystem) {
  struct stat here {
  }, there{};
  ::stat(directory_.path().c_str(), &here);
  std::string other;
  for (const char* folder : {"/dev/shm", "/tmp", "/var/tmp"}) {
    if (::stat(folder, &there) == 0 && here.st_dev != there.st_dev) other = folder;
  }
  if (other.empty()) GTEST_SKIP() << "one file system";
  const std::string shm = other + "/lamina-test-" + std::to_string(::getpid());
  put_box("in/sub/a.stl");
  const std::string bytes = read_text(directory_ / "in/sub/a.stl");
  EXPECT_EQ(watch({"--done", shm}).code, 0);
  put_box("in/sub/a.stl", 3);
  EXPECT_EQ(watch({"--done", shm}).code, 0);
  EXPECT_EQ(files_below(shm), (Words{"sub/a-2.stl", "sub/a.stl"}));
  EXPECT_EQ(read_text(shm + "/sub/a.stl"), bytes);
  EXPECT_TRUE(files_below(directory_ / "in").empty());
  fs::remove_all(shm);
}

TEST_F(WatchedFolder, WrongUseIsRefusedWithOneLine) {
  put_box("in/a.stl");
  for (const auto& [line, words] : {std::pair{"watch in -o in/out", "is in the watched folder"},
                                    {"watch in -o .", "contains the watched folder"},
                                    {"watch in -o in", "is in the watched folder"},
                                    {"watch nowhere -o out", "nowhere: No such file"},
                                    {"watch in/a.stl -o out", "is a file"},
                                    {"watch in", "-o DIR is missing"},
                                    {"watch -o out", "name one folder"},
                                    {"watch in -o out --with jett", "unknown command"},
                                    {"watch in -o out --with watch", "cannot be a job"},
                                    {"watch in -o out --done in", "is the watched folder"},
                                    {"watch in -o out --settle -1", "--settle"}})
    expect_refused(line, 2, words, directory_);
  write_text(directory_ / "list.txt", "watch in -o other\n");
  EXPECT_EQ(run_lamina(words_of("batch list.txt -o made"), directory_.path()).code, 2);
}

TEST_F(WatchedFolder, ARunningWatcherPlansWhatComesAndEndsWithItsSignal) {
  fs::create_directories(directory_ / "next");
  for (const int signal : {SIGTERM, SIGINT}) {
    const std::string name = signal == SIGTERM ? "a" : "b";
    const Outcome outcome = watch({}, [&](int process) {
      EXPECT_TRUE(wait_for("out/watch.jsonl"));
      put_box("new.stl");
      fs::rename(directory_ / "new.stl", directory_ / ("in/" + name + ".stl"));
      EXPECT_TRUE(wait_for("in/done/" + name + ".stl"));
      // Neither the folder nor the output takes a second watcher.
      EXPECT_EQ(run_lamina({"watch", "in", "-o", "other", "--once"}, directory_.path()).code, 4);
      EXPECT_EQ(run_lamina({"watch", "next", "-o", "out", "--once"}, directory_.path()).code, 4);
      EXPECT_EQ(run_lamina({"watch", "next", "-o", "other", "--once"}, directory_.path()).code, 0);
      EXPECT_EQ(run_lamina({"watch", "in/sub", "-o", "third", "--once"}, directory_.path()).code, 2);
      fs::create_directories(directory_ / ("in/later-" + name));
      put_box("in/later-" + name + "/c.stl");
      EXPECT_TRUE(wait_for("in/done/later-" + name + "/c.stl"));
      ::kill(process, signal);
    });
    EXPECT_EQ(outcome.code, 0) << outcome.err;
  }
  EXPECT_EQ(run_lamina({"watch", "in/sub", "-o", "out", "--once"}, directory_.path()).code, 2);
}

TEST_F(WatchedFolder, AResultOfAPartThatWasReplacedIsDiscarded) {
  const Outcome outcome = watch({"--with", "jet --bed 20x20 --dpi 2400 --layer 0.01 --sync off"}, [&](int process) {
    put_box("new.stl", 12);
    put_box("newer.stl", 1);
    fs::rename(directory_ / "new.stl", directory_ / "in/a.stl");
    EXPECT_TRUE(wait_for("out/.watch"));
    fs::rename(directory_ / "newer.stl", directory_ / "in/a.stl");
    EXPECT_TRUE(wait_for("in/done/a.stl"));
    ::kill(process, SIGTERM);
  });
  EXPECT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_EQ(events("dropped").size(), 1u);
  EXPECT_EQ(layers_of("out/a"), 100);
  EXPECT_FALSE(has("out/a-2"));
  EXPECT_EQ(files_below(directory_ / "in"), Words{"done/a.stl"});
}

TEST_F(WatchedFolder, AKilledWatcherContinuesItsPartAndItsCommand) {
  put_box("in/a.stl", 12);
  const Words with = {"--with", "jet --bed 20x20 --dpi 2400 --layer 0.005 --sync off"};
  // The size of the record of finished layers.
  const auto recorded = [&] {
    std::error_code gone;
    std::uintmax_t bytes = 0;
    for (fs::recursive_directory_iterator at(directory_ / "out/.watch", gone), end; !gone && at != end; at.increment(gone)) {
      if (at->path().filename() == "manifest.json.part") bytes = fs::file_size(at->path(), gone);
    }
    return gone ? 0 : bytes;
  };
  const auto kill_with_layers = [&](int process) {
    for (int i = 0; i < 10'000 && recorded() < 10'000; ++i) std::this_thread::sleep_for(std::chrono::milliseconds(2));
    ::kill(process, SIGKILL);
  };
  EXPECT_EQ(watch(with, kill_with_layers).code, 128 + SIGKILL);
  EXPECT_FALSE(has("out/a"));
  // Killed within the command after the job: it runs again, the part is not planned again.
  Words slow = with;
  slow.insert(slow.end(), {"--then", "echo x >> then.txt; test -e go || exec sleep 1000"});
  const auto kill_in_command = [&](int process) {
    EXPECT_TRUE(wait_for("then.txt"));
    ::kill(process, SIGKILL);
  };
  EXPECT_EQ(watch(slow, kill_in_command).code, 128 + SIGKILL);
  write_text(directory_ / "go", "");
  EXPECT_EQ(watch(slow).code, 0);
  EXPECT_EQ(read_text(directory_ / "then.txt"), "x\nx\n");
  ASSERT_EQ(events("planned").size(), 1u);
  EXPECT_GT(events("planned")[0]["result"].value("layers_kept", 0), 0);
  EXPECT_EQ(events("ended").size(), 1u);
  EXPECT_FALSE(has("out/.watch"));
  EXPECT_EQ(layers_of("out/a"), 2400);
  EXPECT_EQ(files_below(directory_ / "in"), Words{"done/a.stl"});
}

// The states between two steps, as a kill leaves them; the next run begins in another directory.
TEST_F(WatchedFolder, EveryStepOfAKilledWatcherIsContinued) {
  fs::create_directories(directory_ / "elsewhere");
  const std::string then = "test -e \"$LAMINA_PART\" && echo x >> " + directory_ / "then.txt";
  const auto run = [&] {
    return run_lamina({"watch", "../in/", "-o", "../out", "--with", "jet --bed 20x20 --dpi 100 --layer 0.5", "--settle", "0.02",
                       "--poll", "0.02", "--once", "--then", then},
                      directory_ / "elsewhere");
  };
  for (const std::string last :
       {"started", "begun", "planned", "planned and published", "planned and moved", "moved", "then"}) {
    fs::remove_all(directory_ / "out");
    fs::remove_all(directory_ / "in");
    fs::remove(directory_ / "then.txt");
    fs::create_directories(directory_ / "in/sub");
    put_box("in/sub/a.stl");
    ASSERT_EQ(run().code, 0);
    const std::string before = tree_text(directory_ / "out/sub/a"), work = events("begun")[0]["work"];
    std::istringstream lines(read_text(directory_ / "out/watch.jsonl"));
    std::string kept;
    for (std::string line; std::getline(lines, line);) {
      kept += line + "\n";
      if (line.find("\"event\":\"" + last.substr(0, last.find(' ')) + "\"") != std::string::npos) break;
    }
    write_text(directory_ / "out/watch.jsonl", kept + "{\"event\":\"mov");  // torn
    if (last != "planned and moved" && last != "moved" && last != "then")
      fs::rename(directory_ / "in/done/sub/a.stl", directory_ / "in/sub/a.stl");
    if (last == "planned" || last == "begun") {
      fs::create_directories(work);
      fs::rename(directory_ / "out/sub/a", work + "/a");
    }
    if (last == "started") fs::remove_all(directory_ / "out/sub");
    ASSERT_EQ(run().code, 0) << last;
    EXPECT_EQ(files_below(directory_ / "in"), Words{"done/sub/a.stl"}) << last;
    EXPECT_EQ(tree_text(directory_ / "out/sub/a"), before) << last;
    EXPECT_EQ(events("planned").size(), 1u) << last;
    EXPECT_EQ(events("ended").size(), 1u) << last;
    EXPECT_EQ(files_below(directory_ / "out").size(), files_below(directory_ / "out/sub/a").size() + 1) << last;
    EXPECT_EQ(read_text(directory_ / "then.txt"), "x\nx\n") << last;
  }
}

/// The record up to the first event of a kind, as a kill leaves it.
std::string record_up_to(const std::string& text, const std::string& event) {
  const std::size_t at = text.find("\"event\":\"" + event + "\"");
  return text.substr(0, text.find('\n', at) + 1);
}

TEST_F(WatchedFolder, APartWhoseResultIsLostIsPlannedAgain) {
  put_box("in/a.stl");
  ASSERT_EQ(watch().code, 0);
  const std::string whole = tree_text(directory_ / "out/a");
  // Killed before the result was published; then the output directory is renamed, and the work folder is elsewhere.
  const std::string work = events("begun")[0]["work"];
  write_text(directory_ / "out/watch.jsonl", record_up_to(read_text(directory_ / "out/watch.jsonl"), "planned"));
  fs::create_directories(work);
  fs::rename(directory_ / "out/a", work + "/a");
  fs::rename(directory_ / "in/done/a.stl", directory_ / "in/a.stl");
  fs::rename(directory_ / "out", directory_ / "other");
  const Outcome again = watch({"-o", "other"});
  EXPECT_EQ(again.code, 0) << again.err;
  EXPECT_NE(again.err.find("the result is gone"), std::string::npos) << again.err;
  EXPECT_TRUE(tree_text(directory_ / "other/a") == whole);
  EXPECT_TRUE(has("in/done/a.stl"));
}

TEST_F(WatchedFolder, AContinuedJobReportsItsFiles) {
  put_box("in/a.stl");
  ASSERT_EQ(watch().code, 0);
  const Json planned = events("planned")[0];
  write_text(directory_ / "out/watch.jsonl", record_up_to(read_text(directory_ / "out/watch.jsonl"), "moved"));
  const Json job = Json::parse(watch({"--json"}).out);
  for (const char* name : {"files", "bytes", "hash"}) EXPECT_EQ(job[name], planned[name]) << job;
  EXPECT_GT(job["files"], 0);
}

TEST_F(WatchedFolder, AFolderThatCannotBeWrittenToIsWaitedFor) {
  put_box("in/a.stl");
  write_text(directory_ / "in/watch.toml", "output = \"/proc/no folder\"\n");
  const Outcome refused = watch();
  EXPECT_EQ(refused.code, 4) << refused.err;
  EXPECT_EQ(files_below(directory_ / "in"), (Words{"a.stl", "watch.toml"}));
  EXPECT_TRUE(events("planned").empty());
  EXPECT_NE(refused.err.find("in/a.stl: "), std::string::npos) << refused.err;
  fs::remove(directory_ / "in/watch.toml");
  EXPECT_EQ(watch().code, 0);
  EXPECT_EQ(files_below(directory_ / "in"), Words{"done/a.stl"});
}

TEST_F(WatchedFolder, ResultsOfTwoWatchersWithOneRootAreWhole) {
  for (const char* watcher : {"a", "b"}) {
    const std::string own = directory_ / watcher;
    fs::create_directories(own + "/in");
    put_box(std::string(watcher) + "/in/part.stl", 10);
    write_text(own + "/in/watch.toml", "output = \"" + (directory_ / "shared") + "\"\n");
    fs::last_write_time(own + "/in/part.stl", fs::file_time_type::clock::now() - std::chrono::hours(1));
  }
  fs::last_write_time(directory_ / "b/in/part.stl", fs::last_write_time(directory_ / "a/in/part.stl"));
  const auto run = [&](const char* watcher) {
    return run_lamina(
        {"watch", "in", "-o", "out", "--once", "--settle", "0.05", "--with", "jet --bed 20x20 --dpi 600 --layer 0.02"},
        directory_ / watcher);
  };
  Outcome other;
  std::thread second([&] { other = run("b"); });
  const Outcome one = run("a");
  second.join();
  EXPECT_EQ(one.code + other.code, 0) << one.err << other.err;
  for (const char* name : {"shared/part", "shared/part-2"})
    EXPECT_EQ(run_lamina({"verify", name}, directory_.path()).code, 0) << name;
}

TEST_F(WatchedFolder, AFolderThatIsMadeAnewIsHeldToo) {
  const Outcome outcome = watch({}, [&](int) {
    EXPECT_TRUE(wait_for("out/watch.jsonl"));
    fs::remove_all(directory_ / "in");
    fs::create_directories(directory_ / "in");
    put_box("in/a.stl");
    EXPECT_TRUE(wait_for("in/done/a.stl"));
    EXPECT_EQ(run_lamina({"watch", "in", "-o", "second", "--once"}, directory_.path()).code, 4);
    fs::remove_all(directory_ / "out");
    put_box("in/b.stl");  // its record cannot be written: the watcher ends
  });
  EXPECT_EQ(outcome.code, 4);
  EXPECT_NE(outcome.err.find("was removed or replaced"), std::string::npos) << outcome.err;
}

TEST_F(WatchedFolder, LongNamesAreShortened) {
  const std::string name(248, 'x');
  for (int copy = 0; copy < 2; ++copy) {
    put_box("in/" + name + ".stl", copy == 0 ? 2 : 3);
    write_text(directory_ / ("in/" + std::string(247, 'y') + ".obj"), "v 0 0 0\nf 1 2 3\n");
    EXPECT_EQ(watch({"--with", copy == 0 ? "jet --bed 20x20 --dpi 100 --layer 0.5" : "extrude --layer 0.2"}).code, 3);
  }
  int done = 0, failed = 0;
  for (const std::string& file : files_below(directory_ / "in")) ++(file.starts_with("done/") ? done : failed);
  EXPECT_EQ(done, 2);
  EXPECT_EQ(failed, 2);
}

TEST_F(WatchedFolder, NamesThatARecordCannotContainAreRefused) {
  fs::create_directories(directory_ / "in\xff");
  for (const Words& words :
       {Words{"watch", "in\xff", "-o", "out", "--once"}, Words{"watch", "in", "-o", "out\xfe", "--once"}}) {
    const Outcome refused = run_lamina(words, directory_.path());
    EXPECT_EQ(refused.code, 2);
    EXPECT_NE(refused.err.find("not in UTF-8"), std::string::npos) << refused.err;
  }
}

TEST_F(WatchedFolder, ALinkToTheFolderLeadsToTheSameParts) {
  fs::create_symlink("in", directory_ / "link");
  put_box("in/a.stl");
  write_text(directory_ / "in/job.toml", "[[part]]\npath = \"" + (directory_ / "in/a.stl") + "\"\n");
  const Outcome outcome = run_lamina(
      {"watch", "link", "-o", "out", "--once", "--settle", "0.05", "--with", "jet --bed 20x20 --dpi 100 --layer 0.5"},
      directory_.path());
  EXPECT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_TRUE(has("out/job/manifest.json"));
  EXPECT_FALSE(has("out/a"));
}

TEST_F(WatchedFolder, ALongRecordIsReplacedByWhatIsUnfinished) {
  put_box("in/a.stl");
  put_box("in/b.stl");
  ASSERT_EQ(watch({"--then", "echo x >> then.txt"}).code, 0);
  std::string record = read_text(directory_ / "out/watch.jsonl");
  record.resize(record.rfind("{\"event\":\"ended\""));  // killed within the command
  record.insert(0, std::string(17 << 20, 'x') + "\n");
  write_text(directory_ / "out/watch.jsonl", record);
  write_text(directory_ / "out/watch.jsonl.part", "of a kill");
  EXPECT_EQ(watch().code, 0);
  EXPECT_EQ(read_text(directory_ / "then.txt"), "x\nx\nx\n");
  EXPECT_EQ(read_text(directory_ / "out/watch.old.jsonl"), record);
  EXPECT_EQ(events("begun").size() + events("planned").size() + events("moved").size(), 3u);
  EXPECT_EQ(events("ended").size(), 1u);
  EXPECT_FALSE(has("out/watch.jsonl.part"));
}

TEST_F(WatchedFolder, UnfinishedWorkOfAPartThatIsGoneIsRemoved) {
  put_box("in/a.stl", 12);
  EXPECT_EQ(watch({"--with", "jet --bed 20x20 --dpi 1200 --layer 0.005"},
                  [&](int process) {
                    EXPECT_TRUE(wait_for("out/.watch"));
                    ::kill(process, SIGKILL);
                  })
                .code,
            128 + SIGKILL);
  fs::remove(directory_ / "in/a.stl");
  EXPECT_EQ(watch().code, 0);
  EXPECT_EQ(files_below(directory_ / "out"), Words{"watch.jsonl"});
  EXPECT_FALSE(has("out/.watch"));
}

TEST_F(WatchedFolder, ACommandAfterAJobEndsAtItsTimeLimitOrAtAStopEvenIfItIgnoresSignals) {
  const std::string waits = "echo $$ > then.txt; while test ! -e go; do sleep 0.1; done";
  const auto still_runs = [&] { return ::kill(static_cast<pid_t>(std::stol(read_text(directory_ / "then.txt"))), 0) == 0; };
  put_box("in/a.stl");
  Outcome outcome = watch({"--then", waits, "--then-limit", "0.1"});
  EXPECT_EQ(outcome.code, 0);
  EXPECT_NE(outcome.err.find("a.stl: --then ended with exit code 124 (time limit)"), std::string::npos) << outcome.err;
  EXPECT_EQ(events("ended").at(0)["then_code"], 124);
  EXPECT_FALSE(still_runs());
  fs::remove(directory_ / "then.txt");
  put_box("in/b.stl");
  outcome = watch({"--then", "trap '' TERM; " + waits, "--then-limit", "0"}, [&](int process) {
    EXPECT_TRUE(wait_for("then.txt"));
    ::kill(process, SIGTERM);
  });
  EXPECT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_EQ(events("ended").size(), 1u);
  EXPECT_FALSE(still_runs());
  write_text(directory_ / "go", "");
}

TEST_F(WatchedFolder, AJobThatTakesTooLongFailsAndItsCommandRuns) {
  put_box("in/a.stl", 12);
  const Outcome outcome = watch({"--with", "jet --bed 20x20 --dpi 2400 --layer 0.0002 --sync off", "--time-limit", "0.2",
                                 "--then", "sleep 0.5; echo $LAMINA_CODE > then.txt"});
  EXPECT_EQ(outcome.code, 3) << outcome.err;
  EXPECT_EQ(read_text(directory_ / "out/a.error.txt"), "took longer than its time limit of 0.2 s\n");
  EXPECT_EQ(read_text(directory_ / "then.txt"), "3\n");
  EXPECT_EQ(files_below(directory_ / "in"), Words{"failed/a.stl"});
  EXPECT_FALSE(has("out/.watch"));
}

TEST_F(WatchedFolder, AStopInterruptsACommandAfterAJobAndRunsItAgain) {
  put_box("in/a.stl");
  const Words slow = {"--then", "echo x >> then.txt; test -e go || sleep 1000"};
  EXPECT_EQ(watch(slow,
                  [&](int process) {
                    EXPECT_TRUE(wait_for("then.txt"));
                    ::kill(process, SIGTERM);
                  })
                .code,
            0);
  write_text(directory_ / "go", "");
  EXPECT_EQ(watch(slow).code, 0);
  EXPECT_EQ(read_text(directory_ / "then.txt"), "x\nx\n");
}

}  // namespace
}  // namespace lamina::test
