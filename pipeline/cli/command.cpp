#include "pipeline/cli/command.h"

#include <fmt/format.h>
#include <malloc.h>
#include <sys/resource.h>

#include <algorithm>
#include <array>
#include <exception>
#include <map>

#include "pipeline/cli/console.h"
#include "pipeline/cli/outputs.h"
#include "pipeline/job/errors.h"
#include "stages/data/shortage.h"
#include "stages/support/io/file.h"
#include "stages/support/io/temporary.h"
#include "stages/support/text/json_text.h"
#include "stages/support/text/readable.h"
#include "stages/support/text/version.h"

namespace lamina::pipeline {
namespace {

constexpr const Command* kCommands[] = {
    &jet_command,    &slice_command,     &heights_command,  &extrude_command,      &info_command,   &export_command,
    &verify_command, &calibrate_command, &compare_command,  &permeability_command, &design_command, &merge_command,
    &stream_command, &convert_command,   &machines_command, &preview_command,      &report_command, &batch_command,
    &watch_command,  &cache_command,     &nest_command,     &completion_command,   &manual_command};

std::string program_help() {
  std::string text =
      "lamina slices parts for powder printers (exact bitmaps, print programs) and filament printers (toolpaths).\n\n"
      "Usage: lamina COMMAND [OPTIONS] ...\n\nCommands:\n";
  for (const Command* command : kCommands) text += fmt::format("  {:<14}{}\n", command->name, command->summary);
  text +=
      "\nlamina help COMMAND, or lamina COMMAND --help, explains a command; --help-all lists all of its options.\n\n"
      "Options:\n  -h, --help      this text\n  --version       the version\n\n"
      "Example:\n"
      "  lamina jet bracket.stl --bed 490x380 --dpi 600 --layer 0.05 -o out\n"
      "  lamina verify out\n"
      "  lamina extrude bracket.stl --machine marlin --walls 2 --fill raster --line-distance 2 -o bracket.gcode\n\n"
      "Exit codes: 0 done, 1 internal error, 2 wrong option or job, 3 bad part file or an empty job, 4 output could not be\n"
      "written, 5 verification failed, a warning with --strict or a target not met, 6 out of memory, 130 interrupted.\n";
  return text;
}

/// Makes glibc return freed memory to the system: by default it keeps up to 64 MiB after the first large free, and
/// resident memory would exceed --memory.
void bound_retained_memory() {
#ifdef __GLIBC__
  // Where address space is short, an arena a thread does not fit, and each allocation would try again in vain.
  rlimit space{};
  if (getrlimit(RLIMIT_AS, &space) == 0 && space.rlim_cur < 2ull << 30) mallopt(M_ARENA_MAX, 1);
  mallopt(M_MMAP_THRESHOLD, 2 << 20);
  mallopt(M_TRIM_THRESHOLD, 4 << 20);
#endif
}

}  // namespace

Json with_schema(const Json& value) {
  Json whole{{"schema", kJsonSchema}};
  whole.update(value);
  return whole;
}

void Context::say(std::string_view line) { say_text(one_line(line) + "\n"); }

void Answer::say(std::string_view line) {
  if (arguments_.has("--quiet") || !status_) return;
  if (arguments_.has("--json")) return context_.say(line);
  status_ = context_.print(one_line(line) + "\n");
}

void complain_of(const Faults& faults, const std::string& directory, Context& context) {
  for (const std::string& fault : faults.faults)
    context.complain({Fault::kVerification, fmt::format("{}: {}", directory, fault)});
  if (faults.fault_count > faults.faults.size()) {
    context.complain(
        {Fault::kVerification, fmt::format("{}: and {} more", directory, faults.fault_count - faults.faults.size())});
  }
}

std::span<const Command* const> commands() { return kCommands; }

const Command* find_command(std::string_view name) {
  const auto found = std::ranges::find(kCommands, name, &Command::name);
  return found == std::end(kCommands) ? nullptr : *found;
}

std::string unknown_command(std::string_view name) {
  std::vector<std::string_view> names;
  for (const Command* command : kCommands) names.push_back(command->name);
  const std::string near = suggest(name, names);
  return fmt::format("unknown command '{}'{}", name.substr(0, 80), near.empty() ? "; lamina --help lists them" : near);
}

CommandSpec spec_of(const Command& command) {
  CommandSpec spec = command.spec();
  spec.name = command.name;
  spec.brief = command.summary;
  // Each heading once, in order of first occurrence; options without one come first, those of research last.
  std::map<std::string, std::size_t> positions{{"", 0}, {"Research", spec.options.size() + 1}};
  for (const OptionSpec& option : spec.options) positions.try_emplace(option.group, positions.size());
  std::ranges::stable_sort(spec.options, {}, [&](const OptionSpec& option) { return positions[option.group]; });
  return spec;
}

std::vector<CommandSpec> all_specs() {
  std::vector<CommandSpec> specs;
  for (const Command* command : kCommands) specs.push_back(spec_of(*command));
  return specs;
}

Outcome run(const Command& command, const Arguments& arguments, Context& context) {
  try {
    if (Status status = check_outputs(command.name, arguments); !status) return status;
    return command.run(arguments, context);
  } catch (const std::exception& error) {
    if (is_shortage(error)) return shortage(error);
    return failure(Fault::kInternal, "internal error: {}", error.what());
  } catch (...) {
    return failure(Fault::kInternal, "internal error");
  }
}

Outcome run_command(const Command& command, const std::vector<std::string>& words, Console& console) {
  Arguments arguments;
  arguments.given = words;
  if (!command.reads_itself) {
    Result<Arguments> read = read_arguments(spec_of(command), words);
    if (!read) return read.error();
    if (read->help) return console.print(*read->help);
    arguments = std::move(*read);
  }
  console.quiet = arguments.has("--quiet");
  const std::string progress = arguments.text("--progress");
  if (!progress.empty() && progress != "auto" && progress != "json")
    return at_option("--progress", fmt::format("'{}' is no kind of progress; give auto or json", one_line(progress)));
  if (progress == "json") console.begin_json();
  return run(command, arguments, console);
}

Outcome run_lamina(const std::vector<std::string>& words, Console& console) {
  bound_retained_memory();
  if (words.empty()) {
    console.say_text(program_help());
    return static_cast<int>(Fault::kUsage);
  }
  const std::string& name = words.front();
  if (name == "help" && words.size() > 2) return usage("help: name one command");
  if (name == "help" && words.size() == 2) {
    const Command* about = find_command(words[1]);
    return about != nullptr ? run_command(*about, {"--help"}, console) : Error{Fault::kUsage, unknown_command(words[1])};
  }
  if (name == "-h" || name == "--help" || name == "help") return console.print(program_help());
  if (name == "--version" || name == "version") return console.print(fmt::format("lamina {}\n", version()));
  const Command* command = find_command(name);
  if (command == nullptr) return Error{Fault::kUsage, unknown_command(name)};
  return run_command(*command, {words.begin() + 1, words.end()}, console);
}

namespace {

/// Address space that the libraries take when they start. oneTBB waits for itself for ever if it gets none then.
constexpr std::uint64_t kStartBytes = 4 << 20;

/// Memory may run out where no exception may pass. Finished layers are on record by then.
[[noreturn]] void end_without_memory() {
  try {
    if (const auto current = std::current_exception()) std::rethrow_exception(current);
  } catch (const std::exception& error) {
    if (!is_shortage(error)) std::abort();
    std::array<char, 160> line;
    const auto end = fmt::format_to_n(line.data(), line.size(),
                                      "lamina: out of memory: needs more than {} MiB of address space; give a smaller --memory "
                                      "or fewer --threads\n",
                                      needed_address_space() >> 20);
    lamina::write_all(2, std::as_bytes(std::span(line.data(), end.size)));
    std::_Exit(static_cast<int>(Fault::kMemory));
  } catch (...) {
  }
  std::abort();
}

}  // namespace

int run_program(int argument_count, char** arguments, Program program) {
  handle_signals();
  std::set_terminate(end_without_memory);
  Console console;
  try {
    if (const Status memory = check_address_space(kStartBytes); !memory) return console.end(console.complain(memory.error()));
    const Outcome outcome = program({arguments + std::min(argument_count, 1), arguments + argument_count}, console);
    for (const std::string& left : take_left_behind()) console.say("lamina: note: " + left);
    return console.end(outcome.error ? console.complain(*outcome.error) : outcome.code);
  } catch (const std::exception& error) {
    if (is_shortage(error)) return console.end(console.complain(shortage(error)));
    return console.end(console.complain({Fault::kInternal, fmt::format("internal error: {}", error.what())}));
  }
}

}  // namespace lamina::pipeline
