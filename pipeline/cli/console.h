// pipeline/cli/console.h: the terminal. A closed reader does not end the program.
#pragma once

#include <chrono>
#include <mutex>
#include <optional>
#include <string_view>

#include "pipeline/cli/command.h"
#include "pipeline/cli/terminal/progress.h"
#include "stages/data/status.h"

namespace lamina::pipeline {

/// The program's own context: stdout, stderr, signals, and a progress bar on a terminal.
class Console : public Context {
 public:
  ~Console() override;
  void say_text(std::string_view text) override;
  int complain(const Error& error) override;
  Status print(std::string_view text) override;
  Status give(const Json& value) override;
  void progress(const ProgressEvent& event) override;
  const std::atomic<bool>& cancel() override;

  bool quiet = false;  // suppresses progress

  /// From here on each line of standard error is a JSON object (--progress json).
  void begin_json();
  /// Prints the last of these lines. returns  the exit code
  int end(int code);

 private:
  void put(const Json& line);
  void put(const ProgressEvent& event);
  std::optional<Progress> progress_;
  bool json_ = false;
  std::mutex writing_;                 // of JSON lines
  std::optional<ProgressEvent> last_;  // as JSON
  std::chrono::steady_clock::time_point begun_ = std::chrono::steady_clock::now(), put_at_;
};

/// Has every signal that ends the program remove its temporary files first, and closed pipes and limits on file sizes come
/// as errors. Ignored signals stay ignored.
void handle_signals();

/// From here on the first signal only sets the cancel flag, so that finished work is kept.
void keep_on_signals();

}  // namespace lamina::pipeline
