// Whole jobs of the real program: divided, interrupted, killed, resumed, merged and verified.
#include <gtest/gtest.h>
#include <signal.h>
#include <unistd.h>

#include <chrono>
#include <csignal>
#include <nlohmann/json.hpp>
#include <thread>

#include "tests/commands/program.h"

namespace lamina::test {
namespace {

namespace fs = std::filesystem;

class Jobs : public ::testing::Test {
 protected:
  Jobs() { write_box(directory_ / "part.stl", {0, 0, 0}, {20, 10, 5}); }

  Outcome lamina(const std::vector<std::string>& arguments) { return run_lamina(arguments, directory_.path()); }

  // A small job into `output`.
  Outcome jet(const std::string& output, std::vector<std::string> more = {}) {
    more.insert(more.begin(), {"jet", "part.stl", "--bed", "40x30", "--dpi", "300", "--layer", "0.1", "--quiet", "-o", output});
    return lamina(more);
  }

  std::string tree(const std::string& name) { return tree_text(directory_ / name); }

  Directory directory_;
};

TEST_F(Jobs, SavedJobGivesTheSameManifest) {
  ASSERT_EQ(
      jet("out", {"--copies", "2", "--rotate", "0,0,30", "--scale", "0.5", "--mirror", "x", "--save-job", "job.toml"}).code, 0);
  ASSERT_EQ(lamina({"jet", "--job", "job.toml", "-o", "again", "--quiet"}).code, 0);
  EXPECT_EQ(tree("again"), tree("out"));
  fs::create_directory(directory_ / "sub");
  fs::rename(directory_ / "job.toml", directory_ / "sub/job.toml");
  fs::copy_file(directory_ / "part.stl", directory_ / "sub/part.stl");
  ASSERT_EQ(lamina({"jet", "--job", "sub/job.toml", "--quiet"}).code, 0);
  EXPECT_EQ(tree("sub/out"), tree("out"));
}

TEST_F(Jobs, JsonIsOneObjectOnStandardOutput) {
  const Outcome outcome = jet("out", {"--json"});
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_EQ(outcome.err, "");
  const auto json = nlohmann::json::parse(outcome.out, nullptr, false);
  ASSERT_FALSE(json.is_discarded()) << outcome.out;
  EXPECT_EQ(json["layers_planned"], 50);
  EXPECT_EQ(json["columns"], 473);
  EXPECT_EQ(json["parts"][0]["triangles"], 12);
  EXPECT_NEAR(json["volume_mm3"].get<double>(), 20 * 10 * 5, 10);
  const Outcome verified = lamina({"verify", "--json", "--quiet", "out"});
  EXPECT_EQ(verified.code, 0);
  EXPECT_EQ(nlohmann::json::parse(verified.out)["layers"], 50);
}

TEST_F(Jobs, QuietJobThatSucceedsSaysNothing) {
  const Outcome outcome = jet("out");
  EXPECT_EQ(outcome.code, 0);
  EXPECT_EQ(outcome.out + outcome.err, "");
}

TEST_F(Jobs, DryRunWritesNothing) {
  const Outcome outcome = lamina({"jet", "part.stl", "--dry-run", "-o", "out"});
  EXPECT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_FALSE(fs::exists(directory_ / "out"));
  EXPECT_NE(outcome.err.find("nothing was written"), std::string::npos);
  for (const char* command : {"jet", "slice"}) {
    const Json json = Json::parse(lamina({command, "part.stl", "--dry-run", "--json", "--quiet", "-o", "out"}).out);
    EXPECT_GT(json["seconds"]["layers_estimate"].get<double>(), 0) << command;
    EXPECT_EQ(json["layers_planned"], 0);
  }
  EXPECT_FALSE(fs::exists(directory_ / "out"));
}

TEST_F(Jobs, ShardsMergeIntoTheUndividedJobInOneDirectoryOrSeveral) {
  ASSERT_EQ(jet("whole").code, 0);
  for (int i = 1; i <= 3; ++i) {
    ASSERT_EQ(jet("shared", {"--shard", std::to_string(i) + "/3"}).code, 0);
    ASSERT_EQ(jet("own" + std::to_string(i), {"--shard", std::to_string(i) + "/3"}).code, 0);
  }
  EXPECT_EQ(lamina({"verify", "shared"}).code, 0);
  const std::string before = tree("own2");
  ASSERT_EQ(lamina({"merge", "own3", "own1", "own2", "-o", "joined"}).code, 0);
  EXPECT_EQ(tree("joined"), tree("whole"));
  EXPECT_EQ(tree("own2"), before);
  ASSERT_EQ(lamina({"merge", "own3", "own1", "own2", "-o", "joined"}).code, 0) << "merging again changes nothing";
  EXPECT_EQ(tree("joined"), tree("whole"));
  ASSERT_EQ(lamina({"merge", "shared", "-o", "shared"}).code, 0);
  EXPECT_EQ(tree("shared"), tree("whole"));
  EXPECT_EQ(lamina({"verify", "shared", "joined"}).code, 0);
}

TEST_F(Jobs, RangesMergeAndMoreShardsThanLayersDoToo) {
  ASSERT_EQ(jet("whole").code, 0);
  ASSERT_EQ(jet("a", {"--layers", ":20"}).code, 0);
  ASSERT_EQ(jet("b", {"--layers", "20:"}).code, 0);
  ASSERT_EQ(lamina({"merge", "a", "b", "-o", "joined"}).code, 0);
  EXPECT_EQ(tree("joined"), tree("whole"));
  ASSERT_EQ(jet("thin", {"--layer", "2.5"}).code, 0);
  for (int i = 1; i <= 5; ++i) ASSERT_EQ(jet("many", {"--layer", "2.5", "--shard", std::to_string(i) + "/5"}).code, 0);
  ASSERT_EQ(lamina({"merge", "many", "-o", "many"}).code, 0);
  EXPECT_EQ(tree("many"), tree("thin"));
}

TEST_F(Jobs, MergeSaysWhatIsMissing) {
  for (int i = 1; i <= 3; ++i) ASSERT_EQ(jet("own" + std::to_string(i), {"--shard", std::to_string(i) + "/3"}).code, 0);
  ASSERT_EQ(jet("two", {"--shard", "1/2"}).code, 0);
  ASSERT_EQ(jet("other", {"--shard", "2/3", "--dpi", "200"}).code, 0);
  const auto refused = [&](std::vector<std::string> arguments, const std::string& words) {
    arguments.insert(arguments.begin(), "merge");
    arguments.insert(arguments.end(), {"-o", "joined"});
    const Outcome outcome = lamina(arguments);
    EXPECT_EQ(outcome.code, 5) << outcome.err;
    EXPECT_EQ(outcome.error_lines(), 1u) << outcome.err;
    EXPECT_NE(outcome.err.find(words), std::string::npos) << outcome.err;
    EXPECT_FALSE(fs::exists(directory_ / "joined/manifest.json"));
  };
  refused({"own1", "own3"}, "layers 16 to 32 of 50");
  refused({"own1", "own2"}, "layers 33 to 49 of 50");
  refused({"own2", "own3"}, "layers 0 to 15 of 50");
  refused({"two", "own2", "own3"}, "contains layer 16 that");
  refused({"own1", "other", "own3"}, "another job");
  fs::remove(directory_ / "own2/layers/000020.tif");
  refused({"own1", "own2", "own3"}, "own2/layers/000020.tif: is missing");
  fs::rename(directory_ / "own3/manifest-3-of-3.json", directory_ / "own3/manifest-3-of-3.json.part");
  refused({"own1", "own2", "own3"}, "not finished");
}

TEST_F(Jobs, AShardOfAnotherJobIsRefusedBeforeItPlans) {
  ASSERT_EQ(jet("out", {"--shard", "1/3"}).code, 0);
  const std::string before = tree("out");
  const Outcome outcome = jet("out", {"--shard", "2/3", "--dpi", "200"});
  EXPECT_EQ(outcome.code, 2) << outcome.err;
  EXPECT_EQ(outcome.error_lines(), 1u) << outcome.err;
  EXPECT_NE(outcome.err.find("manifest-1-of-3.json: is a shard of another job (bed.dpi"), std::string::npos) << outcome.err;
  EXPECT_EQ(tree("out"), before);
}

TEST_F(Jobs, VerifyNamesTheShardsThatAreMissing) {
  const auto verified = [&](const std::string& words) {
    const Outcome outcome = lamina({"verify", "out"});
    EXPECT_EQ(outcome.code, words.empty() ? 0 : 5) << outcome.err;
    EXPECT_NE(outcome.err.find(words), std::string::npos) << outcome.err;
    if (!words.empty()) {
      EXPECT_EQ(outcome.error_lines(), 1u) << outcome.err;
    }
  };
  ASSERT_EQ(jet("out", {"--shard", "3/4"}).code, 0);
  const Outcome both = lamina({"verify", "out"});
  EXPECT_EQ(both.code, 5);
  EXPECT_NE(both.err.find("shards 1/4 to 2/4 are missing, with layers 0 to 24"), std::string::npos) << both.err;
  EXPECT_NE(both.err.find("shard 4/4 is missing, with layers 37 to 49"), std::string::npos) << both.err;
  ASSERT_EQ(jet("out", {"--shard", "1/4"}).code, 0);
  ASSERT_EQ(jet("out", {"--shard", "4/4"}).code, 0);
  verified("shard 2/4 is missing");
  ASSERT_EQ(jet("out", {"--shard", "2/4"}).code, 0);
  verified("");
}

TEST_F(Jobs, AMergeThatIsDoneAlreadySaysSo) {
  for (int i = 1; i <= 3; ++i) ASSERT_EQ(jet("out", {"--shard", std::to_string(i) + "/3"}).code, 0);
  const std::string last = read_text(directory_ / "out/manifest-3-of-3.json");
  ASSERT_EQ(lamina({"merge", "out", "-o", "out"}).code, 0);
  const std::string merged = tree("out");
  for (const bool interrupted : {false, true}) {
    if (interrupted) write_text(directory_ / "out/manifest-3-of-3.json", last);  // killed while it removed them
    const Outcome outcome = lamina({"merge", "out", "-o", "out"});
    EXPECT_EQ(outcome.code, 0) << outcome.err;
    EXPECT_NE(outcome.err.find("is whole already, 50 layers"), std::string::npos) << outcome.err;
    EXPECT_EQ(tree("out"), merged);
  }
  if (::geteuid() != 0) {
    fs::permissions(directory_ / "out", fs::perms::owner_read | fs::perms::owner_exec);
    EXPECT_EQ(lamina({"merge", "out", "-o", "out"}).code, 0) << "nothing is to be written";
    fs::permissions(directory_ / "out", fs::perms::owner_all);
  }
  fs::remove(directory_ / "out/layers/000020.tif");
  EXPECT_EQ(lamina({"merge", "out", "-o", "out"}).code, 5);
}

TEST_F(Jobs, MergeReplacesNoOtherJob) {
  ASSERT_EQ(jet("own", {"--shard", "1/1"}).code, 0);
  ASSERT_EQ(jet("other", {"--dpi", "200"}).code, 0);
  const std::string before = tree("other");
  EXPECT_EQ(lamina({"merge", "own", "-o", "other"}).code, 2);
  EXPECT_EQ(tree("other"), before);
}

TEST_F(Jobs, MergeReplacesNoLayersOfUnknownOrigin) {
  for (const std::string i : {"1", "2"}) {
    ASSERT_EQ(lamina(words_of("jet part.stl --layer 1 --machine hp45 --quiet --shard " + i + "/2 -o own" + i)).code, 0);
  }
  for (const std::string name : {"layers/000000.tif", "layers/000900.png", "program/machine.toml"}) {
    fs::remove_all(directory_ / "mine");
    fs::create_directories((directory_.path() / "mine" / name).parent_path());
    write_text(directory_.path() / "mine" / name, "precious");
    expect_refused("merge own1 own2 -o mine", 2, "mine: contains layers without a manifest; name another directory",
                   directory_);
  }
  fs::remove_all(directory_ / "mine");
  fs::create_directories(directory_ / "mine/layers");
  write_text(directory_ / "mine/notes.txt", "mine");
  EXPECT_EQ(lamina({"merge", "own1", "own2", "-o", "mine"}).code, 0) << "other files are no layers";
}

TEST_F(Jobs, AMergeThatWasCutShortGoesOn) {
  ASSERT_EQ(jet("whole").code, 0);
  for (const std::string i : {"1", "2"}) ASSERT_EQ(jet("own" + i, {"--shard", i + "/2"}).code, 0);
  // The second shard lacks a file: all of the first is there by then.
  const fs::path lost = directory_ / "own2/layers/000040.tif", kept = directory_ / "kept.tif";
  fs::rename(lost, kept);
  EXPECT_EQ(lamina({"merge", "own1", "own2", "-o", "joined"}).code, 5);
  EXPECT_TRUE(fs::exists(directory_ / "joined/layers/000000.tif"));
  EXPECT_TRUE(fs::exists(directory_ / "joined/manifest.json.part")) << "as after a kill";
  EXPECT_EQ(lamina({"merge", "own1", "own2", "-o", "joined"}).code, 5) << "and again";
  const std::string before = tree("own1");
  EXPECT_EQ(lamina({"merge", "own1", "own2", "-o", "own1"}).code, 5);
  EXPECT_FALSE(fs::exists(directory_ / "own1/manifest.json.part")) << "the shard can continue";
  EXPECT_NE(tree("own1"), before);
  fs::rename(kept, lost);
  for (const std::string output : {"joined", "own1"}) {
    const Outcome outcome = lamina({"merge", "own1", "own2", "-o", output});
    EXPECT_EQ(outcome.code, 0) << outcome.err;
    EXPECT_EQ(tree(output), tree("whole"));
  }
}

TEST_F(Jobs, SharesOfContoursAreNotMerged) {
  const auto refused_by = [&](const std::vector<std::string>& more) {
    for (const auto& [output, layers] : {std::pair<std::string, std::string>{"a", ":5"}, {"b", "5:"}}) {
      std::vector<std::string> slice{"slice", "part.stl", "--layer", "0.5", "--layers", layers, "-o", output, "--quiet"};
      slice.insert(slice.end(), more.begin(), more.end());
      ASSERT_EQ(lamina(slice).code, 0);
    }
    for (const std::string output : {"joined", "a"}) {
      expect_refused("merge a b -o " + output, 5, "plan all layers in one run", directory_);
    }
  };
  refused_by({});
  refused_by({"--file-a-layer", "--overwrite"});
  EXPECT_FALSE(fs::exists(directory_ / "joined"));
}

TEST_F(Jobs, VerifyFindsEveryKindOfDamage) {
  ASSERT_EQ(jet("out").code, 0);
  ASSERT_EQ(lamina({"verify", "out"}).code, 0);
  const auto found = [&](const std::string& words) {
    const Outcome outcome = lamina({"verify", "out", "--json"});
    EXPECT_EQ(outcome.code, 5);
    EXPECT_NE(outcome.err.find(words), std::string::npos) << outcome.err;
    EXPECT_EQ(outcome.error_lines(), 1u) << outcome.err;
    EXPECT_EQ(nlohmann::json::parse(outcome.out)["fault_count"], 1);
  };
  const fs::path layer = directory_ / "out/layers/000007.tif";
  const std::string whole = read_text(layer);
  std::string changed = whole;
  changed[changed.size() / 2] ^= 1;
  write_text(layer, changed);
  found("layers/000007.tif: its content is not what was written");
  write_text(layer, whole.substr(0, whole.size() - 1));
  found("layers/000007.tif: " + std::to_string(whole.size() - 1) + " bytes, the manifest says");
  fs::remove(layer);
  found("layers/000007.tif: is missing");
  write_text(layer, whole);
  write_text(directory_ / "out/layers/000050.tif", whole);
  found("layers/000050.tif: no manifest names it");
  fs::remove(directory_ / "out/layers/000050.tif");
  write_text(directory_ / "out/layers/notes.txt", "");
  found("layers/notes.txt");
  fs::remove(directory_ / "out/layers/notes.txt");
  EXPECT_EQ(lamina({"verify", "out"}).code, 0);
  // A manifest that states another number of pixels: every byte is in place, the picture is not.
  std::string manifest = read_text(directory_ / "out/manifest.json");
  const std::size_t at = manifest.find("\"set_pixels\": ", manifest.find("000007.tif")) + 14;
  manifest[at] = manifest[at] == '1' ? '2' : '1';
  write_text(directory_ / "out/manifest.json", manifest);
  found("set pixels, the manifest says");
  EXPECT_EQ(lamina({"verify", "--quick", "out"}).code, 0);
}

TEST_F(Jobs, VerifyReportsTheFirstTwentyFaultsInLayerOrderAndCountsTheRest) {
  ASSERT_EQ(jet("out").code, 0);
  for (const std::string& name : files_below(directory_ / "out/layers"))
    fs::remove(directory_ / "out/layers/" / fs::path(name));
  const Outcome outcome = lamina({"verify", "out"});
  EXPECT_EQ(outcome.code, 5);
  EXPECT_EQ(outcome.error_lines(), 21u);
  EXPECT_LT(outcome.err.find("000000.tif"), outcome.err.find("000001.tif"));
  EXPECT_NE(outcome.err.find("and 30 more"), std::string::npos) << outcome.err;
}

TEST_F(Jobs, ResumeOfAFinishedJobMendsWhatIsDamaged) {
  ASSERT_EQ(jet("out").code, 0);
  const std::string right = tree("out");
  fs::remove(directory_ / "out/layers/000007.tif");
  write_text(directory_ / "out/layers/000030.tif", "garbage");
  const Outcome outcome = jet("out", {"--resume", "--json"});
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_EQ(tree("out"), right);
  EXPECT_EQ(nlohmann::json::parse(outcome.out)["layers_kept"], 48);
}

// --- a job of 2000 layers, stopped in the middle

class Interrupted : public Jobs {
 protected:
  std::vector<std::string> long_job(const std::string& output) {
    return {"jet", "part.stl", "--bed", "40x40", "--dpi", "600", "--layer", "0.0025", "--threads", "1", "-o", output};
  }

  // Sends a signal once `layers` files are there.
  Outcome stopped(const std::vector<std::string>& arguments, const std::string& output, std::size_t layers, int signal_number) {
    return run_lamina(arguments, directory_.path(), [&](int process) {
      const auto deadline = std::chrono::steady_clock::now() + std::chrono::seconds(60);
      while (std::chrono::steady_clock::now() < deadline && files_below(directory_ / (output + "/layers")).size() < layers) {
        std::this_thread::sleep_for(std::chrono::milliseconds(1));
      }
      ::kill(process, signal_number);
    });
  }
};

TEST_F(Interrupted, CtrlCKeepsFinishedLayersAndSaysHowToGoOn) {
  const Outcome outcome = stopped(long_job("out"), "out", 5, SIGINT);
  ASSERT_EQ(outcome.code, 130) << outcome.err;
  EXPECT_NE(outcome.err.find("--resume"), std::string::npos) << outcome.err;
  EXPECT_EQ(outcome.err.find("lamina:"), outcome.err.rfind("lamina:"));
  for (const std::string& name : files_below(directory_ / "out/layers")) EXPECT_TRUE(name.ends_with(".tif")) << name;
  const Outcome verified = lamina({"verify", "out"});
  EXPECT_EQ(verified.code, 5);
  EXPECT_NE(verified.err.find("job was interrupted after layer"), std::string::npos) << verified.err;
  EXPECT_NE(verified.err.find("--resume"), std::string::npos);
  EXPECT_EQ(verified.error_lines(), 1u) << verified.err;
  const Outcome refused = lamina(long_job("out"));
  EXPECT_EQ(refused.code, 2) << refused.err;
}

TEST_F(Interrupted, KilledJobsResumeToTheSameBytes) {
  std::vector<std::string> job = long_job("whole");
  job.push_back("--quiet");
  ASSERT_EQ(lamina(job).code, 0);
  const std::string right = tree("whole");
  for (const std::size_t layers : {0, 1, 40, 500}) {
    fs::remove_all(directory_ / "out");
    job = long_job("out");
    job.push_back("--quiet");
    const Outcome killed = stopped(job, "out", layers, SIGKILL);
    EXPECT_EQ(killed.code, 128 + SIGKILL);
    job.push_back("--resume");
    const Outcome resumed = lamina(job);
    ASSERT_EQ(resumed.code, 0) << resumed.err;
    EXPECT_EQ(tree("out") == right, true) << "killed after " << layers << " layers";
  }
}

TEST_F(Interrupted, SecondRunInTheSameDirectoryIsRefusedAndHarmsNothing) {
  const std::vector<std::string> job = long_job("out");
  const Outcome first = run_lamina(job, directory_.path(), [&](int process) {
    const auto deadline = std::chrono::steady_clock::now() + std::chrono::seconds(60);
    while (std::chrono::steady_clock::now() < deadline && files_below(directory_ / "out/layers").size() < 5) {
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
    ::kill(process, SIGSTOP);  // on a busy machine it could end before the second one begins
    for (const char* how : {"--resume", "--overwrite"}) {
      std::vector<std::string> second = job;
      second.push_back(how);
      const Outcome refused = lamina(second);
      EXPECT_EQ(refused.code, 4) << refused.err;
      EXPECT_NE(refused.err.find("another run"), std::string::npos) << refused.err;
      EXPECT_EQ(refused.error_lines(), 1u) << refused.err;
    }
    ::kill(process, SIGCONT);
  });
  EXPECT_EQ(first.code, 0) << first.err;
  EXPECT_EQ(lamina({"verify", "out"}).code, 0);
}

TEST_F(Interrupted, TerminationAndAClosedTerminalAreInterruptionsToo) {
  EXPECT_EQ(stopped(long_job("out"), "out", 2, SIGTERM).code, 130);
  std::signal(SIGHUP, SIG_DFL);  // a program that finds it ignored, as under nohup, leaves it so
  const Outcome outcome = stopped(long_job("closed"), "closed", 2, SIGHUP);
  EXPECT_EQ(outcome.code, 130);
  EXPECT_NE(outcome.err.find("--resume"), std::string::npos) << outcome.err;
}

}  // namespace
}  // namespace lamina::test
