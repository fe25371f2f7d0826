#include "tests/commands/job_folder.h"

#include <algorithm>
#include <filesystem>

namespace lamina::test {

void JobFolder::done(const std::string& line) const {
  const Outcome outcome = lamina(line);
  ASSERT_EQ(outcome.code, 0) << line << "\n" << outcome.err;
}

nlohmann::json JobFolder::facts(const std::string& line) const {
  const Outcome outcome = lamina(line + " --json --quiet");
  EXPECT_EQ(outcome.code, 0) << line << "\n" << outcome.err;
  return outcome.code == 0 ? nlohmann::json::parse(outcome.out) : nlohmann::json();
}

nlohmann::json JobFolder::expect_same_however_made(const std::string& job) const {
  const std::string made = job + " --quiet -o ";
  done(made + "one");
  done("verify one --quiet");
  for (const char* how : {" --threads 1 --engine contours", " --threads 8 --engine both --memory 64K"}) {
    done(made + "other --overwrite" + how);
    EXPECT_TRUE(tree("other") == tree("one")) << job << how;
  }
  for (const char* shard : {"1/3", "2/3", "3/3"}) done(made + "shards --shard " + shard);
  done("merge shards -o shards --quiet");
  EXPECT_TRUE(tree("shards") == tree("one")) << job;
  std::string begun = read_text(folder_ / "one/manifest.json");
  const std::size_t fifth = begun.find("\n{\"index\": 4");
  EXPECT_NE(fifth, std::string::npos) << "five layers or more are wanted: " << job;
  begun.resize(std::min(fifth, begun.size()));
  std::filesystem::remove(folder_ / "one/manifest.json");
  write_text(folder_ / "one/manifest.json.part", begun + "\n");
  const nlohmann::json resumed = facts(job + " -o one --resume");
  EXPECT_TRUE(tree("one") == tree("shards")) << job;
  return resumed;
}

}  // namespace lamina::test
