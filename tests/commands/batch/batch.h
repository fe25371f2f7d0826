// tests/commands/batch/batch.h: what the tests of `lamina batch` share.
#pragma once

#include <gtest/gtest.h>

#include <filesystem>
#include <functional>
#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "tests/commands/program.h"

namespace lamina::test {

namespace fs = std::filesystem;
using Json = nlohmann::json;
using Words = std::vector<std::string>;

class JobsInBatch : public ::testing::Test {
 protected:
  Outcome lamina(const Words& arguments, const std::function<void(int)>& watch = {}) {
    return run_lamina(arguments, directory_.path(), watch);
  }

  Json summary(const std::string& batch) {
    return Json::parse(read_text(directory_ / (batch + "/summary.json")), nullptr, false);
  }

  std::vector<std::string> outcomes(const std::string& batch) {
    std::vector<std::string> names;
    const Json json = summary(batch);
    for (const Json& job : json["jobs"]) names.push_back(job["outcome"]);
    return names;
  }

  // What the jobs wrote: all but what the batch says of itself.
  std::string tree(const std::string& batch) {
    std::string text;
    for (const auto& entry : fs::directory_iterator(directory_ / batch)) {
      if (entry.is_directory()) trees_[entry.path().filename()] = tree_text(entry.path());
    }
    for (auto& [name, files] : trees_) text += name + "\n" + files;
    trees_.clear();
    return text;
  }

  void write_boxes(int count) {
    for (int i = 0; i < count; ++i) {
      const float side = static_cast<float>(4 + i);
      write_box(directory_ / ("part" + std::to_string(10 + i) + ".stl"), {0, 0, 0}, {side, side, 2});
    }
  }

  std::map<std::string, std::string> trees_;
  Directory directory_;
};

inline const Words kSmall = {"--with", "jet --bed 60x60 --dpi 300 --layer 0.1", "--quiet"};

inline Words batch_of(Words words, const Words& more = kSmall) {
  words.insert(words.begin(), "batch");
  words.insert(words.end(), more.begin(), more.end());
  return words;
}

}  // namespace lamina::test
