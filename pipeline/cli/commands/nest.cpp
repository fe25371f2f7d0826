#include <fmt/format.h>
#include <tbb/global_control.h>

#include <algorithm>
#include <array>
#include <filesystem>
#include <iterator>
#include <optional>

#include "pipeline/cli/command.h"
#include "pipeline/cli/console.h"
#include "pipeline/cli/keys.h"
#include "pipeline/cli/outputs.h"
#include "pipeline/job/errors.h"
#include "pipeline/nest/add_to_build.h"
#include "pipeline/nest/nest_files.h"
#include "pipeline/nest/nest_report.h"
#include "pipeline/nest/order_files.h"
#include "pipeline/nest/plate.h"
#include "pipeline/output/temporary_folder.h"
#include "pipeline/plan/plan.h"
#include "stages/load/load.h"
#include "stages/support/text/readable.h"

namespace lamina::pipeline {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view kNestKeys =
    "bed.size_mm bed.margin_mm placement machine.profile machine.presets load run.output run.threads part.unit part.scale part.rotate_deg "
    "part.shrink";

bool quotes(const Arguments& arguments) { return arguments.has("--quote") || arguments.has("--quote-density"); }

CommandSpec nest_spec() {
  CommandSpec spec;
  spec.summary =
      "Arranges the parts of orders in as many builds as needed: a job and a parts list for each, and the orders with\n"
      "serial numbers. Parts are put by their outlines from above, in several turns, a gap apart and out of the margin.\n"
      "An order is a CSV file with the columns file, copies, order, customer, due, priority, group, fixed, turns, down,\n"
      "keep_apart_mm, material and note; other columns are kept.";
  spec.operand = "ORDERS|PART";
  spec.operand_meaning =
      "one CSV file of orders, or a ZIP file of a table and parts; or STL, OBJ or 3MF files and directories of them, as in bracket_x12.stl";
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
                       {"--keep-out", "X0,Y0,X1,Y1|FILE", "box in mm, or mesh, that stays free; repeatable", "", "Orders"},
                       {"--fill", "PART", "part that fills the builds of the orders; repeatable", "", "Orders"},
                       {"--add", "FILE", "part or table to add to the build of --into; repeatable", "", "Orders"},
                       {"--into", "DIR", "build to add to; its parts stay where they are", "", "Orders"},
                       {"--overwrite", "", "replace the builds of an earlier run", "", "Run"},
                       {"--quote", "", "print hours, material and prices; write no job", "", "Run"},
                       {"--quote-density", "PERCENT", "--quote, and prices at a box fill of PERCENT", "", "Run"},
                       {"--dry-run", "", "print the result and write nothing", "", "Run"},
                       progress_option(),
                       {"--json", "", "print the result as one JSON object on stdout", "", "Run"},
                       {"--quiet", "", "print errors only", "", "Run"}});
  spec.closing =
      "Examples:\n"
      "  lamina nest orders.csv --machine production-1200 -o week\n"
      "  lamina nest part.stl bracket.stl --copies 40,12 --machine nuferbj -o plates\n"
      "  lamina nest --add rush.stl --into week/build-1\n"
      "  lamina nest orders.csv --machine marlin --builds 2 --keep-out 0,0,40,30 -o plates\n";
  return spec;
}

/// Sets the copies of part files. errors  kUsage
Status read_copies(const Arguments& arguments, OrderTable& table) {
  if (!arguments.has("--copies")) return {};
  std::vector<std::uint32_t> copies;
  if (Status status =
          at_option("--copies", read_value(arguments.text("--copies"), {1, 1'000'000, "", true, 1, 1'000'000}, copies));
      !status)
    return status;
  if (copies.size() != 1 && copies.size() != table.rows.size())
    return usage("--copies: has {} numbers for {} part files; give one, or one of each", copies.size(), table.rows.size());
  for (std::size_t i = 0; i < table.rows.size(); ++i) table.rows[i].copies = copies[copies.size() == 1 ? 0 : i];
  return {};
}

/// Adds the rows of --fill. errors  kUsage
Status read_fillers(const Arguments& arguments, OrderTable& table) {
  const auto fillers = rows_of_parts(arguments.all("--fill"));
  if (!fillers) return fillers.error();
  for (OrderRow row : fillers->rows) {
    row.fills = true;
    row.copies = 1'000'000;  // of which those with a position stay
    table.rows.push_back(std::move(row));
  }
  return {};
}

/// unpacked  where an archive is unpacked
Result<OrderTable> read_operands(const Arguments& arguments, const std::vector<std::string>& names,
                                 const std::string& unpacked) {
  auto orders = read_named_orders(names, unpacked);
  if (!orders) return orders.error();
  if (arguments.has("--copies") && !orders->of_parts)
    return usage("--copies: is for part files; the table has a column copies");
  if (Status status = read_copies(arguments, orders->table); !status) return status.error();
  return std::move(orders->table);
}

/// Says the faults of a table. errors  kInput if it has any
Status check_faults(const OrderTable& table, const std::string& name, Context& context) {
  constexpr std::size_t kShown = 1000;
  for (std::size_t i = 0; i < std::min(kShown, table.faults.size()); ++i) context.say(table.faults[i]);
  if (!table.faults.empty())
    return failure(Fault::kInput, "{}: has {} fault{}; nothing was written", name, table.faults.size(),
                   table.faults.size() == 1 ? "" : "s");
  return table.rows.empty() ? Status(failure(Fault::kInput, "{}: has no parts", name)) : Status();
}

/// The space of a job's machine, or of its bed. errors  kUsage
Result<NestSpace> space_of(const Job& job, NestOutput& output) {
  auto resolved = resolve(job, Product::kImages);
  if (!resolved) {
    if (auto moves = resolve(job, Product::kMoves)) resolved = std::move(moves);
  }
  if (!resolved) return resolved.error();
  output.product = resolved->product;
  NestSpace space = nest_space(*resolved);
  output.machine = space.machine;
  return space;
}

Status read_keep_outs(const std::vector<std::string>& texts, NestSpace& space) {
  for (const std::string& text : texts) {
    if (load::is_part_name(text)) {
      space.keep_out_files.push_back(text);
      continue;
    }
    std::array<double, 4> box{};
    if (Status status = at_option("--keep-out", read_value(text, {0, 10'000, " mm"}, box)); !status) return status;
    if (!(box[0] < box[2] && box[1] < box[3]))
      return usage("--keep-out: {}: is no box X0,Y0,X1,Y1 with X0 < X1 and Y0 < Y1, and no mesh", text);
    space.keep_out.push_back({nm_of(box[0]), nm_of(box[1]), nm_of(box[2]), nm_of(box[3])});
  }
  return {};
}

Status read_space_options(const Arguments& arguments, NestSpace& space) {
  std::vector<double> turns;
  if (Status status = arguments.read("--turns", {0, 359.999, " degrees", false, 1, 360}, turns); !status) return status;
  if (!turns.empty()) space.turns.clear();
  for (const double turn : turns) space.turns.push_back(std::llround(turn * 1e6));
  std::ranges::sort(space.turns);
  space.turns.erase(std::unique(space.turns.begin(), space.turns.end()), space.turns.end());
  if (arguments.has("--builds") && arguments.text("--builds") != "auto") {
    if (Status status = arguments.read("--builds", {1, 100'000}, space.max_builds); !status) return status;
  }
  return read_keep_outs(arguments.all("--keep-out"), space);
}

/// The value of --quote-density, or 0. errors  kUsage
Result<double> density_of(const Arguments& arguments) {
  double percent = 0;
  if (!arguments.has("--quote-density")) return percent;
  if (Status status = arguments.read("--quote-density", {0.01, 100, " %"}, percent); !status) return status.error();
  return percent;
}

/// Prints the result; what is left out in any case. errors  kOutput
Outcome give(const Arguments& arguments, double density, const NestPlan& plan, const OrderTable& table, Context& context) {
  Summary::Lines lines = arguments.has("--quiet") ? left_lines(plan, table) : nest_lines(plan, table);
  if (quotes(arguments) && !arguments.has("--quiet")) {
    std::ranges::move(price_lines(plan, table), std::back_inserter(lines));
    if (density > 0) std::ranges::move(density_lines(plan, table, density), std::back_inserter(lines));
  }
  if (!lines.empty()) context.say_text(text_of(lines));
  if (arguments.has("--json")) return context.give(nest_json(plan, table, density));
  return {};
}

/// Refuses orders.csv and files of builds that are read by this call. errors  kUsage
Status check_inputs(const Arguments& arguments, const OrderTable& table, const std::string& directory) {
  std::vector<InputFile> inputs;
  for (const std::string& operand : arguments.operands) inputs.push_back({operand, "the order"});
  for (const std::string& file : arguments.all("--keep-out")) inputs.push_back({file, "a keep-out"});
  inputs.push_back({arguments.text("--job"), "the job file"});
  for (const OrderRow& row : table.rows) inputs.push_back({row.path, "a part"});
  return check_outputs(inputs, files_of_nest(directory));
}

/// Adds rows to a build: of its material, loaded as its first part, rotated as --rotate says. errors  kUsage
Status add_rows(const Arguments& arguments, std::vector<OrderRow> rows, WrittenBuild& build) {
  std::uint32_t request = 0;
  if (arguments.has("--rotate")) {
    PartRequest settings = build.job.parts.front();
    if (Status status = arguments.read("--rotate", {-360, 360, " degrees"}, settings.rotate_deg); !status) return status;
    request = static_cast<std::uint32_t>(build.job.parts.size());
    build.job.parts.push_back(std::move(settings));
  }
  for (OrderRow& row : rows) {
    if (!row.material.empty() && row.material != build.material)
      return usage("{}: is of material '{}', and the build of '{}'", one_line(row.path), one_line(row.material),
                   one_line(build.material));
    if (row.fixed_mm) return usage("{}: has a position; parts that are added have none", one_line(row.path));
    row.material = build.material;
    row.request = request;
    build.table.rows.push_back(std::move(row));
  }
  return {};
}

/// A keep-out that is named from any directory.
std::string whole_keep_out(const std::string& text) {
  std::error_code error;
  return load::is_part_name(text) ? fs::weakly_canonical(text, error).string() : text;
}

/// Adds parts to a build that is there.
Outcome add_parts(const Arguments& arguments, Context& context) {
  if (!arguments.has("--into")) return usage("--add: --into DIR is missing; name the directory of a build, as week/build-1");
  for (const OptionSpec& option : nest_spec().options) {
    const std::string flag = option.flag.substr(option.flag.find("--"));
    constexpr std::array kUsed{"--into",  "--add",           "--copies",  "--turns", "--keep-out", "--threads",
                               "--quote", "--quote-density", "--dry-run", "--progress", "--json", "--quiet"};
    if (arguments.has(flag) && std::ranges::find(kUsed, flag) == kUsed.end())
      return usage("--into: {} is that of the build; leave it out", flag);
  }
  const auto density = density_of(arguments);
  if (!density) return density.error();
  std::vector<std::string> names = arguments.operands;
  for (const std::string& part : arguments.all("--add")) names.push_back(part);
  if (names.empty()) return usage("--into: no part; name one with --add FILE");
  const std::string folder = arguments.text("--into");
  if (std::ranges::any_of(names, is_archive)) return usage("--add: unpack the archive, and name its files");
  auto added = read_operands(arguments, names, {});
  if (!added) return added.error();
  if (Status status = check_faults(*added, names[0], context); !status) return status.error();
  auto build = read_build(folder);
  if (!build) return build.error();
  OrderTable& table = build->table;
  const std::size_t before = table.rows.size();
  if (Status status = add_rows(arguments, std::move(added->rows), *build); !status) return status.error();
  NestOutput output{folder, true};
  output.keep_outs = build->keep_outs;
  for (const std::string& keep_out : arguments.all("--keep-out")) output.keep_outs.push_back(whole_keep_out(keep_out));
  auto space = space_of(build->job, output);
  if (!space) return space.error();
  if (Status status = read_space_options(arguments, *space); !status) return status.error();
  if (Status status = read_keep_outs(build->keep_outs, *space); !status) return status.error();
  space->max_builds = 1;
  space->into = true;
  std::uint32_t count = 0;
  if (Status status = arguments.read("--threads", {0, 4096}, count); !status) return status.error();
  std::optional<tbb::global_control> threads;
  if (count > 0) threads.emplace(tbb::global_control::max_allowed_parallelism, count);
  auto plan = nest_orders(table.rows, *space, build->job);
  if (!plan) return plan.error();
  if (plan->builds.empty() || plan->builds[0].copies.size() == before)
    return usage("{}: {}; nothing was changed", one_line(names[0]),
                 plan->left_out.empty() ? "has no copies" : plan->left_out[0].reason);
  plan->builds[0].name = one_line(fs::path(whole_path(folder)).filename().string());
  keep_on_signals();
  const auto progress = [&](const ProgressEvent& event) { context.progress(event); };
  Status status;
  if (quotes(arguments)) {
    status = quote_builds(output.product, table.rows, build->job, progress, context.cancel(), *plan);
  } else if (!arguments.has("--dry-run")) {
    status = write_added(output, table, before, build->job, *plan);
  }
  return status ? give(arguments, *density, *plan, table, context) : Outcome(status.error());
}

Outcome run_nest(const Arguments& arguments, Context& context) {
  Arguments options = arguments;
  options.operands.assign(1, arguments.operands.empty() ? std::string() : arguments.operands.front());  // stands for all parts
  if (arguments.has("--into") || arguments.has("--add")) return add_parts(arguments, context);
  const Result<Job> job = read_job_options(kNestKeys, options);
  if (!job) return job.error();
  const bool writes = !arguments.has("--dry-run") && !quotes(arguments);
  if (job->output.empty() && writes) return usage("-o DIR is missing; name a directory for the builds");
  const auto density = density_of(arguments);
  if (!density) return density.error();
  if (arguments.operands.empty() && !arguments.has("--fill")) return usage("no orders; name a CSV file, or part files");
  std::optional<TemporaryFolder> temporary;
  NestOutput output{job->output, arguments.has("--overwrite")};
  if (!arguments.operands.empty() && is_archive(arguments.operands[0])) {
    if (!temporary.emplace("nest").status()) return temporary->status().error();
    output.unpacked = temporary->file("parts");
  }
  auto table = read_operands(arguments, arguments.operands, output.unpacked);
  if (!table) return table.error();
  if (Status status = read_fillers(arguments, *table); !status) return status.error();
  if (Status status = check_faults(*table, arguments.operands.empty() ? "--fill" : arguments.operands[0], context); !status)
    return status.error();
  if (Status status = writes ? check_inputs(arguments, *table, job->output) : Status(); !status) return status.error();
  auto space = space_of(*job, output);
  if (!space) return space.error();
  if (Status status = read_space_options(arguments, *space); !status) return status.error();
  for (const std::string& keep_out : arguments.all("--keep-out")) output.keep_outs.push_back(whole_keep_out(keep_out));
  std::optional<tbb::global_control> threads;
  if (job->threads > 0) threads.emplace(tbb::global_control::max_allowed_parallelism, job->threads);
  auto plan = nest_orders(table->rows, *space, *job);
  if (!plan) return plan.error();
  if (plan->builds.empty()) {
    const LeftOut& first = plan->left_out.front();
    return failure(Fault::kInput, "{}: {}; no part has a build, and nothing was written", one_line(table->rows[first.row].path),
                   first.reason);
  }
  count_fillers(*plan, table->rows);
  const auto progress = [&](const ProgressEvent& event) { context.progress(event); };
  Status status;
  if (quotes(arguments)) {
    status = quote_builds(output.product, table->rows, *job, progress, context.cancel(), *plan);
  } else if (!arguments.has("--dry-run")) {
    keep_on_signals();  // builds without their list of orders are removed
    status = write_nest(output, *table, *job, progress, context.cancel(), *plan);
  }
  if (!status) return status;
  return give(arguments, *density, *plan, *table, context);
}

}  // namespace

const Command nest_command = {"nest", "arrange the parts of orders in builds: jobs, parts lists, serial numbers", nest_spec,
                              run_nest};

}  // namespace lamina::pipeline
