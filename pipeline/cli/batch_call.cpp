#include "pipeline/cli/batch_call.h"

#include <fmt/format.h>

#include "pipeline/cli/command.h"
#include "pipeline/job/file.h"
#include "pipeline/text/json.h"
#include "pipeline/text/json_text.h"
#include "pipeline/text/number_text.h"

namespace lamina::pipeline {
namespace {

/// Collects what a command gives and the first thing that it complains about; what it says to people is not heard.
class CallContext : public Context {
 public:
  CallContext(const ProgressCallback& progress, const std::atomic<bool>& cancel) : progress_(progress), cancel_(cancel) {}
  void say_text(std::string_view) override {}
  int complain(const Error& error) override {
    if (reason.empty()) reason = one_line(error.message);
    return static_cast<int>(error.fault);
  }
  Status print(std::string_view text) override {
    printed_ += text;
    return {};
  }
  Status give(const Json& value) override {
    values_.push_back(value);
    return {};
  }
  void progress(const ProgressEvent& event) override { progress_(event); }
  const std::atomic<bool>& cancel() override { return cancel_; }

  /// The value, several as an array, or the text that was printed.
  Json value() const {
    if (values_.size() > 1) return values_;
    if (!values_.empty()) return values_.front();
    return printed_.empty() ? Json() : Json(printed_);
  }
  std::string reason;

 private:
  const ProgressCallback& progress_;
  const std::atomic<bool>& cancel_;
  std::vector<Json> values_;
  std::string printed_;
};

/// The arguments with what the batch adds; the last one of an option counts.
Arguments with_settings(Arguments arguments, const CommandSpec& spec, const CallSettings& settings) {
  const auto add = [&](std::string_view name, const std::string& text = {}) {
    if (const OptionSpec* option = spec.find(name)) arguments.options.emplace_back(option->flag, text);
  };
  if (!settings.output.empty()) add("--output", settings.output);
  if (!arguments.has("--memory")) add("--memory", fmt::format("{}", settings.layer_bytes));
  // One pool for all: a job's own number of threads would hold for the whole program.
  add("--threads", "0");
  add("--json");
  add("--quiet");
  if (settings.earlier == CallSettings::Earlier::kContinue) add("--resume");
  if (settings.earlier == CallSettings::Earlier::kReplace) add("--overwrite");
  return arguments;
}

CallResult run_call(const Command& command, const Arguments& arguments, const ProgressCallback& progress,
                    const std::atomic<bool>& cancel) {
  CallContext context(progress, cancel);
  const Outcome outcome = run(command, arguments, context);
  CallResult result;
  result.code = outcome.error ? context.complain(*outcome.error) : outcome.code;
  if (result.code != 0) result.reason = context.reason;
  result.value = context.value();
  result.found_whole = outcome.layers_planned == 0 && outcome.layers_kept > 0;
  return result;
}

}  // namespace

Result<Call> read_call(const std::vector<std::string>& words) {
  const std::string& name = words.front();
  const Command* command = find_command(name);
  if (command == nullptr) return Error{Fault::kUsage, unknown_command(name)};
  if (command == &batch_command || command->reads_itself) {
    return Error{Fault::kUsage, fmt::format("'{}' cannot be a job of a batch; run it by itself", name)};
  }
  const CommandSpec spec = spec_of(*command);
  const Result<Arguments> read = read_arguments(spec, {words.begin() + 1, words.end()});
  if (!read) return read.error();
  if (read->help) return Error{Fault::kUsage, "--help is no job"};
  Job planned;
  if (read->has("--job")) {
    if (Status status = read_job(read->text("--job"), planned); !status) return status.error();
  }

  Call call;
  if (const OptionSpec* option = spec.find("--output"); option != nullptr && !read->has("--dry-run")) {
    call.output_of_job_file = !read->has(option->flag);
    call.output = call.output_of_job_file ? planned.output : read->text(option->flag);
    if (command->ending != nullptr) call.ending = command->ending(*read);
    if (!call.ending && option->value.find("DIR") != std::string::npos) call.ending = "";
  }
  call.can_continue = spec.find("--resume") != nullptr && !read->has("--resume");
  call.can_replace = spec.find("--overwrite") != nullptr && !read->has("--overwrite") && !read->has("--resume");
  if (const OptionSpec* memory = spec.find("--memory")) {
    call.layer_bytes = 0;
    if (read->has(memory->flag)) read_bytes(read->text(memory->flag), *call.layer_bytes);  // the command says what is wrong
  }
  call.inputs = read->operands;
  for (const auto& [flag, text] : read->options) {
    if (flag.find("--output") == std::string::npos && !text.empty()) call.inputs.push_back(text);
  }
  if (read->operands.empty()) {
    for (const PartRequest& part : planned.parts) call.inputs.push_back(part.path);
  }
  call.run = [command, spec, arguments = *read](const CallSettings& settings, const ProgressCallback& progress,
                                                const std::atomic<bool>& cancel) {
    return run_call(*command, with_settings(arguments, spec, settings), progress, cancel);
  };
  return call;
}

}  // namespace lamina::pipeline
