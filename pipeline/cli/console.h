// pipeline/cli/console.h: the terminal. A reader that has gone away is no reason to crash.
#pragma once

#include <optional>
#include <string_view>

#include "pipeline/cli/command.h"
#include "stages/data/status.h"
#include "stages/text/progress.h"

namespace lamina::pipeline {

/// The program's own context: stdout, stderr, signals, and a progress bar on a terminal.
class Console : public Context {
 public:
  ~Console() override;
  void say_text(std::string_view text) override;
  int complain(const Error& error) override;
  Status print(std::string_view text) override;
  Status give(const nlohmann::ordered_json& value) override;
  void progress(const ProgressEvent& event) override;
  const std::atomic<bool>& cancel() override;

  bool quiet = false;  // no progress is told

 private:
  std::optional<Progress> progress_;
};

/// There is something to keep: the first signal only sets the flag from here on.
void keep_on_signals();

}  // namespace lamina::pipeline
