#include "pipeline/cli/job_call.h"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <memory>
#include <mutex>
#include <utility>

#include "pipeline/cache/store.h"
#include "pipeline/cli/command.h"
#include "pipeline/cli/outputs.h"
#include "pipeline/job/errors.h"
#include "pipeline/job/file.h"
#include "pipeline/machine/profiles.h"  // is_named
#include "stages/formats/images/layer_images.h"
#include "stages/support/io/file.h"
#include "stages/support/text/escape.h"
#include "stages/support/text/json_value.h"
#include "stages/support/text/number_text.h"
#include "stages/support/text/readable.h"

namespace lamina::pipeline {
namespace {

/// Collects a command's results and its first error; discards its messages.
class CallContext : public Context {
 public:
  CallContext(JobCache* cache, std::shared_ptr<load::PartStore> loaded, const ProgressCallback& progress,
              const std::atomic<bool>& cancel)
      : cache_(cache), loaded_(std::move(loaded)), progress_(progress), cancel_(cancel) {}
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
  JobCache* cache() override { return cache_; }
  std::shared_ptr<load::PartStore> loaded() override { return loaded_; }

  /// The single value, an array of several, or the printed text.
  Json value() const {
    if (values_.size() > 1) return values_;
    if (!values_.empty()) return values_.front();
    return printed_.empty() ? Json() : Json(printed_);
  }
  std::string reason;

 private:
  JobCache* const cache_;
  const std::shared_ptr<load::PartStore> loaded_;
  const ProgressCallback& progress_;
  const std::atomic<bool>& cancel_;
  std::vector<Json> values_;
  std::string printed_;
};

/// The arguments with the batch's additions; the last occurrence of an option counts.
Arguments with_settings(Arguments arguments, const CommandSpec& spec, const CallSettings& settings, const std::string& sync) {
  const auto add = [&](std::string_view name, const std::string& text = {}) {
    if (const OptionSpec* option = spec.find(name)) arguments.options.emplace_back(option->flag, text);
  };
  if (!settings.output.empty()) add("--output", settings.output);
  if (settings.synced_later) {
    add("--sync", "off");
  } else if (!sync.empty() && !arguments.has("--sync")) {
    add("--sync", sync);
  }
  // Info takes a limit for images alone.
  const bool takes_memory = spec.name != "info" || std::ranges::any_of(arguments.operands, formats::names_images);
  if (takes_memory && !arguments.has("--memory")) add("--memory", fmt::format("{}", settings.layer_bytes));
  // All jobs share one pool, so a job's own thread count would apply to the whole program.
  add("--threads", "0");
  add("--json");
  add("--quiet");
  if (settings.earlier == CallSettings::Earlier::kContinue) add("--resume");
  if (settings.earlier == CallSettings::Earlier::kReplace) add("--overwrite");
  return arguments;
}

BatchResult run_call(const Command& command, const Arguments& arguments, CallContext& context) {
  const Outcome outcome = run(command, arguments, context);
  BatchResult result;
  result.code = outcome.error ? context.complain(*outcome.error) : outcome.code;
  if (result.code != 0) result.reason = context.reason;
  result.value = context.value();
  result.digested = outcome.files.has_value();
  if (outcome.files) result.output = *outcome.files;
  result.recognized = outcome.layers_planned == 0 && outcome.layers_kept > 0;
  return result;
}

/// The arguments of a command, made once: many jobs have the same.
const CommandSpec& spec_for(const Command& command) {
  static std::mutex mutex;
  static std::map<const Command*, CommandSpec> specs;
  const std::lock_guard lock(mutex);
  const auto [found, is_new] = specs.try_emplace(&command);
  if (is_new) found->second = spec_of(command);
  return found->second;
}

/// As read_arguments(), by a reader that no other thread uses now; it is kept for the next call.
Result<Arguments> read_by_idle_reader(const Command& command, const std::vector<std::string>& words) {
  static std::mutex mutex;
  static std::map<const Command*, std::vector<std::unique_ptr<ArgumentReader>>> idle;
  std::unique_ptr<ArgumentReader> reader;
  {
    const std::lock_guard lock(mutex);
    if (auto& readers = idle[&command]; !readers.empty()) {
      reader = std::move(readers.back());
      readers.pop_back();
    }
  }
  if (!reader) reader = std::make_unique<ArgumentReader>(spec_for(command));
  Result<Arguments> read = reader->read(words);
  const std::lock_guard lock(mutex);
  idle[&command].push_back(std::move(reader));
  return read;
}

/// A command line of a batch.
struct CommandLine {
  const Command* command;
  const CommandSpec& spec;
  Arguments arguments;
};

/// Reads a command line: any command but batch, watch and preview. errors  kUsage: no such command, wrong arguments
Result<CommandLine> read_command_line(const std::vector<std::string>& words) {
  const std::string& name = words.front();
  const Command* command = find_command(name);
  if (command == nullptr) return Error{Fault::kUsage, unknown_command(name)};
  if (command == &batch_command || command == &watch_command || command->reads_itself)
    return usage("'{}' cannot be a job of a batch; run it by itself", name);
  const CommandSpec& spec = spec_for(*command);
  Result<Arguments> read = read_by_idle_reader(*command, {words.begin() + 1, words.end()});
  if (!read) return read.error();
  if (read->help) return usage("--help is no job");
  return CommandLine{command, spec, std::move(*read)};
}

/// What was read of a command line: the number of options, of each its number in the spec and its text, and the operands.
PackedWords packed(const CommandLine& line) {
  std::vector<std::string> words{std::to_string(line.arguments.options.size())};
  for (const auto& [flag, text] : line.arguments.options) {
    const auto option = std::ranges::find(line.spec.options, flag, &OptionSpec::flag);
    words.push_back(std::to_string(option - line.spec.options.begin()));
    words.push_back(text);
  }
  words.insert(words.end(), line.arguments.operands.begin(), line.arguments.operands.end());
  return words;
}

/// The command line of a job that is not refused.
CommandLine unpacked(const BatchJob& job) {
  std::vector<std::string> given = job.entry.words.unpacked();
  const Command* const command = find_command(given.front());
  CommandLine line{command, spec_for(*command), {}};
  const std::vector<std::string> words = job.parsed.unpacked();
  const std::size_t options = 1 + 2 * std::stoul(words.front());
  for (std::size_t i = 1; i < options; i += 2)
    line.arguments.options.emplace_back(line.spec.options[std::stoul(words[i])].flag, words[i + 1]);
  line.arguments.operands.assign(words.begin() + static_cast<std::ptrdiff_t>(options), words.end());
  line.arguments.given.assign(given.begin() + 1, given.end());
  return line;
}

/// The word of --container, of an assignment or of the job file; the last one counts.
std::string container_of(const Arguments& arguments, const Job& planned) {
  if (arguments.has("--container")) return arguments.text("--container");
  constexpr std::string_view kAssigned = "run.container=";
  std::string word = planned.container == Container::kZip ? "zip" : "";
  for (const std::string& assignment : arguments.all("--set")) {
    if (assignment.starts_with(kAssigned)) word = assignment.substr(kAssigned.size());
  }
  std::erase(word, '"');
  return word;
}

}  // namespace

Result<std::shared_ptr<JobCache>> open_cache(const Arguments& arguments, Context& context) {
  if (!arguments.has("--cache")) {
    if (arguments.has("--cache-link")) return at_option("--cache-link", "needs --cache FOLDER").error();
    return std::shared_ptr<JobCache>();
  }
  const std::string folder = arguments.text("--cache");
  if (Status status = JobCache::check_apart(folder, arguments.text("-o,--output")); !status) return status.error();
  auto cache = JobCache::open(folder, arguments.has("--cache-link"));
  if (cache || cache.error().fault != Fault::kOutput) return cache;
  context.say("note: --cache " + cache.error().message + "; jobs run without it");
  return std::shared_ptr<JobCache>();
}

void add_container(std::vector<BatchEntry>& entries, const std::string& kind) {
  constexpr const char* kOption = "--container";
  for (BatchEntry& entry : entries) {
    if (kind.empty()) return;
    std::vector<std::string> words = entry.words.unpacked();
    const Command* const command = words.empty() ? nullptr : find_command(words.front());
    if (command == nullptr || command->reads_itself || spec_for(*command).find(kOption) == nullptr) continue;
    if (std::ranges::any_of(words, [&](const std::string& word) { return word.starts_with(kOption); })) continue;
    words.insert(words.begin() + 1, {kOption, kind});
    entry.words = words;
  }
}

Result<Call> read_call(const std::vector<std::string>& words) {
  const Result<CommandLine> line = read_command_line(words);
  if (!line) return line.error();
  const auto& [command, spec, arguments] = *line;
  const Arguments* const read = &arguments;
  Job planned;
  if (read->has("--job")) {
    if (names_stream(read->text("--job"))) return usage("--job: a job of a batch cannot read standard input; name a file");
    if (Status status = read_job(read->text("--job"), planned); !status) return status.error();
  }

  const std::string container = spec.find("--container") != nullptr ? container_of(*read, planned) : std::string();
  Call call;
  if (const OptionSpec* option = spec.find("--output"); option != nullptr && !read->has("--dry-run")) {
    call.output_of_job_file = !read->has(option->flag);
    call.output = call.output_of_job_file ? planned.output : read->text(option->flag);
    if (command->ending != nullptr) call.ending = command->ending(*read);
    if (!call.ending && option->value.find("DIR") != std::string::npos) call.ending = "";
    if (container == "zip") {
      call.output = output_of(std::move(call.output), Container::kZip);
      call.ending = ".zip";
    }
  }
  call.can_continue = spec.find("--resume") != nullptr && !read->has("--resume");
  call.can_replace = spec.find("--overwrite") != nullptr && !read->has("--overwrite") && !read->has("--resume");
  if (const OptionSpec* memory = spec.find("--memory")) {
    call.layer_bytes = 0;
    if (read->has(memory->flag)) read_bytes(read->text(memory->flag), *call.layer_bytes);  // the command reports errors
  }
  const bool sets_sync =
      std::ranges::any_of(read->all("--set"), [](const std::string& assignment) { return assignment.starts_with("run.sync"); });
  call.names_sync = read->has("--sync") || is_named(planned, "run.sync") || sets_sync || spec.find("--sync") == nullptr;
  if (spec.find("--layer") != nullptr) {
    call.layer_mm = planned.layer_mm;
    if (read->has("--layer")) read_number(read->text("--layer"), 1e-6, 1e6, "", call.layer_mm);
  }
  call.parsed = packed(*line);
  call.inputs = read->operands;
  for (const auto& [flag, text] : read->options) {
    if (flag.find("--output") != std::string::npos || text.empty()) continue;
    call.inputs.push_back(text);
    if (is_output_option(flag)) call.side_output = flag + " " + text;
  }
  if (read->operands.empty()) {
    for (const PartRequest& part : planned.parts) call.inputs.push_back(part.path);
  }
  return call;
}

PackedWords without_outputs(const BatchJob& job) {
  CommandLine line = unpacked(job);
  std::erase_if(line.arguments.options, [](const auto& option) { return is_output_option(option.first); });
  return packed(line);
}

RunJob job_runner(const std::string& sync, std::shared_ptr<load::PartStore> loaded, std::shared_ptr<JobCache> cache) {
  return [sync, loaded = std::move(loaded), cache = std::move(cache)](const BatchJob& job, const CallSettings& settings,
                                                                      const ProgressCallback& progress,
                                                                      const std::atomic<bool>& cancel) {
    const CommandLine line = unpacked(job);
    CallContext context(cache.get(), loaded, progress, cancel);
    return run_call(*line.command, with_settings(line.arguments, line.spec, settings, sync), context);
  };
}

}  // namespace lamina::pipeline
