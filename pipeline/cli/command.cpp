#include "pipeline/cli/command.h"
#include "pipeline/text/version.h"

#include <fmt/format.h>
#include <malloc.h>

#include <algorithm>
#include <csignal>
#include <exception>
#include <new>

#include "pipeline/cli/console.h"
#include "pipeline/text/names.h"

namespace lamina::pipeline {
namespace {

constexpr Command kCommands[] = {
    {"jet", "binder jetting: exact 1-bit images of every layer of the bed, and a manifest", run_jet_command},
    {"slice", "contours of every layer, and their filling: SVG, CLI, 3MF slices", run_slice_command},
    {"heights", "the layers of a part: thicknesses that fit its slopes and flats, compared, plotted", run_heights_command},
    {"extrude", "material extrusion: toolpaths as G-code or SML, with segmented lines and their pores", run_extrude_command},
    {"info", "what is in a part file, is it closed, and where is it not", run_info_command},
    {"verify", "is a job's directory whole and true to its manifest", run_verify_command},
    {"calibrate", "test pieces of an extrusion printer, and its profile from what was measured on them", run_calibrate_command},
    {"permeability", "Darcy's and Forchheimer's coefficients from flows and pressure drops", run_permeability_command},
    {"merge", "join the shards of a job that was divided", run_merge_command},
    {"machines", "the powder printers that lamina jet writes programs for, and what follows from a profile",
     run_machines_command},
    {"preview", "pictures of a job's layers for people", run_preview_command},
    {"report", "one page about a finished job: layers, plots, warnings, hashes", run_report_command},
    {"batch", "many jobs in one queue, sharing processors and memory, with one summary", run_batch_command},
    {"completion", "makes a shell complete commands and options", run_completion_command},
    {"manual", "manual pages", run_manual_command},
};

std::string program_help() {
  std::string text =
      "lamina plans additive-manufacturing jobs: meshes in, what a machine needs for every layer out.\n\n"
      "Usage: lamina COMMAND [OPTIONS] ...\n\nCommands:\n";
  for (const Command& command : kCommands) text += fmt::format("  {:<13}{}\n", command.name, command.summary);
  text +=
      "\nOptions:\n  -h, --help     this text; lamina COMMAND --help tells all about a command\n"
      "  --version      the version\n\n"
      "Example:\n"
      "  lamina jet bracket.stl --bed 490x380 --dpi 600 --layer 0.05 -o out\n"
      "  lamina verify out\n\n"
      "Exit codes: 0 done, 1 internal error, 2 wrong option or job, 3 bad part file, 4 output could not be written,\n"
      "5 verification failed, 130 interrupted.\n";
  return text;
}

int say_help(const std::string& text) {
  const Status status = print(text);
  return status ? 0 : fail(status.error());
}

int run_command(int argument_count, char** arguments) {
  if (argument_count < 2) {
    say_text(program_help());
    return static_cast<int>(Fault::kUsage);
  }
  const std::string_view name = arguments[1];
  if (name == "-h" || name == "--help" || name == "help") return say_help(program_help());
  if (name == "--version" || name == "version") return say_help(fmt::format("lamina {}\n", version()));
  std::vector<std::string_view> names;
  if (const Command* command = find_command(name)) return command->run({arguments + 2, arguments + argument_count});
  for (const Command& command : kCommands) names.push_back(command.name);
  return fail({Fault::kUsage, fmt::format("'{}' is no command{}; lamina --help lists them", name, suggest(name, names))});
}

}  // namespace

std::span<const Command> commands() { return kCommands; }

const Command* find_command(std::string_view name) {
  const auto found = std::ranges::find(kCommands, name, &Command::name);
  return found == std::end(kCommands) ? nullptr : found;
}

bool Arguments::has(std::string_view flag) const {
  for (const auto& [name, value] : options) {
    if (name == flag) return true;
  }
  return false;
}

std::vector<std::string> Arguments::all(std::string_view flag) const {
  std::vector<std::string> values;
  for (const auto& [name, value] : options) {
    if (name == flag) values.push_back(value);
  }
  return values;
}

std::string Arguments::text(std::string_view flag) const {
  const auto values = all(flag);
  return values.empty() ? std::string() : values.back();
}

namespace {

/// What is freed shall go back to the system: left alone, glibc keeps up to 64 MiB after the first large buffer is freed,
/// and --memory would not be what is resident.
void bound_retained_memory() {
#ifdef __GLIBC__
  mallopt(M_MMAP_THRESHOLD, 2 << 20);
  mallopt(M_TRIM_THRESHOLD, 4 << 20);
#endif
}

}  // namespace

int run_program(int argument_count, char** arguments) {
  bound_retained_memory();
  std::signal(SIGPIPE, SIG_IGN);  // a closed reader is an error of write(), not the end
  std::signal(SIGXFSZ, SIG_IGN);  // and so is a limit on file sizes
  try {
    return run_command(argument_count, arguments);
  } catch (const std::bad_alloc&) {
    return fail({Fault::kInternal, "out of memory; try a smaller --memory, fewer --threads or fewer triangles"});
  } catch (const std::exception& error) {
    return fail({Fault::kInternal, fmt::format("internal error: {}", error.what())});
  } catch (...) {
    return fail({Fault::kInternal, "internal error"});
  }
}

}  // namespace lamina::pipeline
