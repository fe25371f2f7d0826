#include <fmt/format.h>
#include <tbb/global_control.h>

#include <algorithm>
#include <charconv>
#include <filesystem>
#include <optional>

#include "pipeline/cli/command.h"
#include "pipeline/cli/console.h"
#include "pipeline/cli/keys.h"
#include "pipeline/job/errors.h"
#include "pipeline/nest/nest_files.h"
#include "pipeline/plan/plan.h"
#include "stages/support/text/readable.h"

namespace lamina::pipeline {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view kNestKeys =
    "bed.size_mm bed.margin_mm placement machine.profile machine.presets load run.output run.threads part.unit part.scale part.rotate_deg "
    "part.shrink";

CommandSpec nest_spec() {
  CommandSpec spec;
  spec.summary =
      "Arranges the parts of orders in as many builds as needed: a job and a parts list for each, and the orders with\n"
      "serial numbers. Parts are put by their outlines from above, in several turns, a gap apart and out of the margin.\n"
      "An order is a CSV file with the columns file, copies, order, customer, due, priority, group, fixed, turns, down,\n"
      "keep_apart_mm, material and note; other columns are kept.";
  spec.operand = "ORDERS|PART";
  spec.operand_meaning = "one CSV file of orders; or STL, OBJ or 3MF files and directories of them, as in bracket_x12.stl";
  add_key_options(kNestKeys, spec);
  std::erase_if(spec.options, [](const OptionSpec& option) { return option.flag == "--save-job"; });  // builds are jobs
  for (OptionSpec& option : spec.options) {
    if (option.flag != "-o,--output") continue;
    option.value = "DIR";
    option.meaning = "directory of the builds";
  }
  spec.options.insert(spec.options.end(),
                      {{"--copies", "N,...", "copies of each part file; one number: of all", "", "Orders"},
                       {"--turns", "DEG,...", "allowed turns about z in degrees", "0,90,180,270", "Orders"},
                       {"--builds", "N|auto", "max number of builds", "auto", "Orders"},
                       {"--keep-out", "X0,Y0,X1,Y1", "box on the bed in mm that stays free; repeatable", "", "Orders"},
                       {"--overwrite", "", "replace the builds of an earlier run", "", "Run"},
                       {"--dry-run", "", "print the result and write nothing", "", "Run"},
                       {"--json", "", "print the result as one JSON object on stdout", "", "Run"},
                       {"--quiet", "", "print errors only", "", "Run"}});
  spec.closing =
      "Examples:\n"
      "  lamina nest orders.csv --machine production-1200 -o week\n"
      "  lamina nest part.stl bracket.stl --copies 40,12 --machine nuferbj -o plates\n"
      "  lamina nest orders.csv --machine marlin --builds 2 --keep-out 0,0,40,30 -o plates\n";
  return spec;
}

bool is_part(const fs::path& path) {
  std::string name = lower_case(path.filename().string());
  if (name.ends_with(".gz")) name.resize(name.size() - 3);
  return name.ends_with(".stl") || name.ends_with(".obj") || name.ends_with(".3mf");
}

/// 12 of "bracket_x12.stl"; 1 without it.
std::uint32_t copies_in_name(const fs::path& path) {
  std::string stem = path.stem().string();
  if (lower_case(path.extension().string()) == ".gz") stem = fs::path(stem).stem().string();
  const std::size_t at = stem.rfind("_x");
  std::uint32_t copies = 0;
  if (at == std::string::npos) return 1;
  const auto [end, error] = std::from_chars(stem.data() + at + 2, stem.data() + stem.size(), copies);
  return error == std::errc() && end == stem.data() + stem.size() && copies > 0 ? copies : 1;
}

/// The rows of part files and directories. errors  kUsage
Result<OrderTable> rows_of_parts(const Arguments& arguments) {
  OrderTable table;
  for (const std::string& operand : arguments.operands) {
    std::error_code error;
    std::vector<fs::path> files{operand};
    if (fs::is_directory(operand, error)) {
      files.clear();
      for (const auto& entry : fs::recursive_directory_iterator(operand, error))
        if (entry.is_regular_file(error) && is_part(entry.path())) files.push_back(entry.path());
      std::ranges::sort(files);
      if (files.empty()) return usage("{}: has no part files", operand);
    }
    for (const fs::path& file : files) {
      OrderRow& row = table.rows.emplace_back();
      row.path = file.string();
      row.copies = copies_in_name(file);
    }
  }
  if (!arguments.has("--copies")) return table;
  std::vector<std::uint32_t> copies;
  if (Status status =
          at_option("--copies", read_value(arguments.text("--copies"), {1, 1'000'000, "", true, 1, 1'000'000}, copies));
      !status)
    return status.error();
  if (copies.size() != 1 && copies.size() != table.rows.size())
    return usage("--copies: has {} numbers for {} part files; give one, or one of each", copies.size(), table.rows.size());
  for (std::size_t i = 0; i < table.rows.size(); ++i) table.rows[i].copies = copies[copies.size() == 1 ? 0 : i];
  return table;
}

Result<OrderTable> read_operands(const Arguments& arguments) {
  const auto is_table = [](const std::string& name) { return lower_case(fs::path(name).extension().string()) == ".csv"; };
  if (arguments.operands.empty()) return usage("no orders; name a CSV file, or part files");
  if (std::ranges::none_of(arguments.operands, is_table)) return rows_of_parts(arguments);
  if (arguments.operands.size() > 1) return usage("{}: is not alone; name one CSV file, or part files", arguments.operands[0]);
  if (arguments.has("--copies")) return usage("--copies: is for part files; the table has a column copies");
  return read_orders(arguments.operands[0]);
}

/// The space of a job's machine, or of its bed. errors  kUsage
Result<NestSpace> space_of(const Job& job, std::string_view& command, std::string& name) {
  auto resolved = resolve(job, Product::kImages);
  command = "jet";
  if (!resolved) {
    if (auto moves = resolve(job, Product::kMoves)) {
      resolved = std::move(moves);
      command = "extrude";
    }
  }
  if (!resolved) return resolved.error();
  NestSpace space;
  space.bed = {nm_of(resolved->bed.size_mm[0]), nm_of(resolved->bed.size_mm[1]), nm_of(resolved->bed.margin_mm), false};
  space.height = kNmReach;
  if (resolved->printer && resolved->printer->machine) {
    const Machine& machine = resolved->printer->machine->machine;
    name = machine.name;
    space.bed.round = machine.bed.shape == BedShape::kRound;
    space.height = nm_of(machine.bed.build_height_mm);
  }
  if (resolved->extruder) {
    name = resolved->extruder->machine.name;
    space.height = nm_of(resolved->extruder->machine.bed.build_height_mm);
  }
  space.gap = nm_of(job.gap_mm);
  return space;
}

Status read_space_options(const Arguments& arguments, NestSpace& space) {
  std::vector<double> turns{0, 90, 180, 270};
  if (Status status = arguments.read("--turns", {0, 359.999, " degrees", false, 1, 360}, turns); !status) return status;
  for (const double turn : turns) space.turns.push_back(std::llround(turn * 1e6));
  std::ranges::sort(space.turns);
  space.turns.erase(std::unique(space.turns.begin(), space.turns.end()), space.turns.end());
  if (arguments.has("--builds") && arguments.text("--builds") != "auto") {
    if (Status status = arguments.read("--builds", {1, 100'000}, space.max_builds); !status) return status;
  }
  for (const std::string& text : arguments.all("--keep-out")) {
    std::array<double, 4> box{};
    if (Status status = at_option("--keep-out", read_value(text, {0, 10'000, " mm"}, box)); !status) return status;
    if (!(box[0] < box[2] && box[1] < box[3]))
      return usage("--keep-out: {}: is no box X0,Y0,X1,Y1 with X0 < X1 and Y0 < Y1", text);
    space.keep_out.push_back({nm_of(box[0]), nm_of(box[1]), nm_of(box[2]), nm_of(box[3])});
  }
  return {};
}

Outcome run_nest(const Arguments& arguments, Context& context) {
  Arguments options = arguments;
  options.operands.assign(1, arguments.operands.empty() ? std::string() : arguments.operands.front());  // stands for all parts
  const Result<Job> job = read_job_options(kNestKeys, options);
  if (!job) return job.error();
  if (job->output.empty() && !arguments.has("--dry-run")) return usage("-o DIR is missing; name a directory for the builds");
  const auto table = read_operands(arguments);
  if (!table) return table.error();
  if (!table->faults.empty()) {
    constexpr std::size_t kShown = 1000;
    for (std::size_t i = 0; i < std::min(kShown, table->faults.size()); ++i) context.say(table->faults[i]);
    return Error{Fault::kInput, fmt::format("{}: has {} fault{}; nothing was written", arguments.operands[0],
                                            table->faults.size(), table->faults.size() == 1 ? "" : "s")};
  }
  if (table->rows.empty()) return Error{Fault::kInput, fmt::format("{}: has no parts", arguments.operands[0])};
  std::string_view command;
  std::string machine;
  auto space = space_of(*job, command, machine);
  if (!space) return space.error();
  if (Status status = read_space_options(arguments, *space); !status) return status;
  std::optional<tbb::global_control> threads;
  if (job->threads > 0) threads.emplace(tbb::global_control::max_allowed_parallelism, job->threads);
  const auto plan = nest_orders(table->rows, *space, *job);
  if (!plan) return plan.error();
  if (!arguments.has("--dry-run")) {
    keep_on_signals();  // builds without their list of orders are removed
    Status status =
        write_nest(job->output, arguments.has("--overwrite"), *plan, *table, *job, command, machine, context.cancel());
    if (!status) return status;
  }
  if (!arguments.has("--quiet")) context.say_text(text_of(nest_lines(*plan, *table)));
  if (arguments.has("--json")) return context.give(nest_json(*plan, *table));
  return {};
}

}  // namespace

const Command nest_command = {"nest", "arrange the parts of orders in builds: jobs, parts lists, serial numbers", nest_spec,
                              run_nest};

}  // namespace lamina::pipeline
