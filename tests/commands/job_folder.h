// tests/commands/job_folder.h: a directory in which the real program makes jobs, and the ways of making one that must not
// differ.
#pragma once

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <string>

#include "tests/commands/program.h"

namespace lamina::test {

class JobFolder : public testing::Test {
 protected:
  Outcome lamina(const std::string& line) const { return run_lamina(words_of(line), folder_.path()); }
  /// The call succeeds.
  void done(const std::string& line) const;
  /// The same, with its --json report.
  nlohmann::json facts(const std::string& line) const;
  /// Names and contents of all files of a job.
  std::string tree(const std::string& output) const { return tree_text(folder_.path() / output); }

  /// The job is the same with any threads, engine and memory, as merged shards, and resumed after its fourth layer; verify
  /// takes it. job  a call of jet without --output returns  what the resumed run reports; the job lies in `one`, and again in
  /// `other` and `shards`
  nlohmann::json expect_same_however_made(const std::string& job) const;

  Directory folder_;
};

}  // namespace lamina::test
