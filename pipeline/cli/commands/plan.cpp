// lamina jet, slice and extrude: the commands that plan a job, as one function and three rows of data.
#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>

#include "pipeline/cache/cached_run.h"
#include "pipeline/cli/command.h"
#include "pipeline/cli/job_call.h"
#include "pipeline/cli/keys.h"
#include "pipeline/cli/outputs.h"
#include "pipeline/job/errors.h"
#include "pipeline/job/file.h"
#include "pipeline/machine/profiles.h"
#include "pipeline/nest/plate.h"
#include "pipeline/plan/plan.h"
#include "pipeline/pores/pore_analysis.h"
#include "pipeline/run/run.h"
#include "stages/formats/image_format.h"
#include "stages/support/io/file.h"
#include "stages/support/text/json_value.h"
#include "stages/support/text/number_text.h"

namespace lamina::pipeline {
namespace {

constexpr std::string_view kNames[] = {"jet", "slice", "extrude"};  // by product

/// The differences between the commands.
struct PlanCommand {
  Product product;
  std::string_view keys;                  // of the job, as options
  std::string_view basic;                 // options of the short help
  std::string_view summary;               // what it does, for the help
  std::span<const OptionSpec> own;        // switches of the row, among --resume, --overwrite and --dry-run
  std::span<const OptionSpec> overrides;  // help texts that replace those of keys: value, meaning, preset if not ""
  std::string (*closing)();               // notes and examples
  bool divided = false;                   // supports --shard
  /// Applies the command line before the job is checked. errors  kUsage
  Status (*complete)(const Arguments&, Job&);
};

/// Replaces a key's help texts by those of the row.
void override_words(std::span<const OptionSpec> overrides, CommandSpec& spec) {
  for (const OptionSpec& other : overrides) {
    const auto option = std::ranges::find(spec.options, other.flag, &OptionSpec::flag);
    if (!other.value.empty()) option->value = other.value;
    if (!other.meaning.empty()) option->meaning = other.meaning;
    if (!other.preset.empty()) option->preset = other.preset;
  }
}

CommandSpec plan_spec(const PlanCommand& row) {
  CommandSpec spec;
  spec.summary = row.summary;
  spec.basic = split(row.basic, " ");
  spec.operand = "PART";
  spec.operand_meaning = "STL, OBJ or 3MF files (STL and OBJ also gzipped); they replace the parts of --job";
  add_key_options(row.keys, spec);
  override_words(row.overrides, spec);
  if (const auto machine = std::ranges::find(spec.options, "--machine", &OptionSpec::flag); machine != spec.options.end()) {
    machine->words = names_of(row.product == Product::kMoves ? shipped_extruders() : shipped_machines());
    if (row.product == Product::kMoves) machine->group = "Machine";
  }
  if (const auto material = std::ranges::find(spec.options, "--material", &OptionSpec::flag);
      material != spec.options.end() && row.product == Product::kMoves) {
    material->words = names_of(shipped_materials());
  }
  if (!row.divided) spec.absent = {{"--shard", kNoShards}};
  spec.options.insert(spec.options.end(), row.own.begin(), row.own.end());
  const bool rastered = row.product == Product::kImages;  // else no limit is known
  spec.options.push_back(
      {"--timing", "", rastered ? "break down the run time and compare it with the hardware limit" : "break down the run time",
       "", "Run"});
  if (row.product != Product::kContours) {
    spec.options.push_back({"--cache", "FOLDER", "take the files of an equal job from a cache, or add them", "", "Run"});
    spec.options.push_back({"--cache-link", "", "make read-only hard links to the cache, no copies", "", "Run"});
  }
  spec.options.push_back(progress_option());
  spec.options.push_back({"--json", "", "print the result as one JSON object on stdout", "", "Run"});
  spec.options.push_back({"--quiet", "", "print errors only", "", "Run"});
  spec.more = row.closing;
  return spec;
}

/// What a job file leaves to the printer, one line for each.
std::vector<std::string> notes_on_defaults(const std::string& path, const Job& job) {
  const std::string file = path == "-" ? "the job" : path;
  std::vector<std::string> notes;
  if (!is_named(job, "fill.walls")) {
    notes.push_back(
        fmt::format("{} names no fill.walls: the default is {}; write walls = 0 for none", file, job.fill.all.walls));
  }
  if (!is_named(job, "layers.thickness_mm") && job.heights.thickness_mm.empty()) {
    notes.push_back(fmt::format("{} names no layers.thickness_mm: layers are {:g} mm, by the printer", file, job.layer_mm));
  }
  return notes;
}

/// cache  nullptr: the job runs. errors  those of run()
Result<CachedRun> run_or_take(JobCache* cache, Resolved resolved, const ProgressCallback& progress,
                              const std::atomic<bool>& cancel) {
  if (cache != nullptr) return run_with_cache(*cache, std::move(resolved), progress, cancel);
  Result<Summary> summary = run(std::move(resolved), progress, cancel);
  return summary ? CachedRun{std::move(*summary), {}} : Result<CachedRun>(summary.error());
}

/// The output, of a container with links followed: they lead to the file that grows, and to its record.
std::string followed_output(const Job& job) {
  std::string output = output_of(job.output, job.container);
  if (job.container == Container::kNone) return output;
  const auto target = find_target(output);
  return target && !target->file.empty() ? target->file : output;
}

Outcome plan(const PlanCommand& row, const Arguments& arguments, Context& context) {
  Result<Job> job = read_job_options(row.keys, arguments);
  if (!job) return job.error();
  job->resume = arguments.has("--resume");
  job->overwrite = arguments.has("--overwrite");
  job->dry_run = arguments.has("--dry-run");
  job->timing = arguments.has("--timing");
  job->quote = arguments.has("--quote");
  job->json = arguments.has("--json");
  job->quiet = arguments.has("--quiet");
  job->leave_to_machine = true;
  job->loaded = context.loaded();
  job->output = followed_output(*job);
  if (Status status = row.complete(arguments, *job); !status) return status;
  if (Status status = check_needs(row.product, arguments, *job); !status) return status;
  if (Status status = check_job(*job); !status) return status;
  if (!job->quiet) {
    for (const std::string& note : notes_on_needs(row.product, arguments, *job)) context.say("note: " + note);
  }
  if (arguments.has("--nest")) {
    if (Status status = nest_job(row.product, *job); !status) return status;
  }
  Result<Resolved> resolved = resolve(*job, row.product);
  if (!resolved) return resolved.error();
  std::vector<std::string> left;
  if (resolved->extruder) {
    if (Status status = check_machine_needs(resolved->extruder->machine, arguments); !status) return status;
    if (arguments.has("--job")) left = notes_on_defaults(arguments.text("--job"), resolved->job);
  }
  if (resolved->printer && resolved->printer->machine) {
    if (Status status = check_machine_needs(resolved->printer->machine->machine, arguments); !status) return status;
  }
  std::optional<File> file;  // takes its name once the job is planned
  if (arguments.has("--save-job")) {
    Job saved = resolved->job;
    if (saved.bed_mm || saved.machine.profile.empty()) saved.bed_mm = resolved->bed.size_mm;
    auto begun = write_job(arguments.text("--save-job"), saved, true, kNames[static_cast<int>(row.product)]);
    if (!begun) return begun.error();
    file.emplace(std::move(*begun));
  }
  Status kept;
  const auto keep_job = [&] {
    if (!file) return;
    if (auto done = file->finish(); !done) kept = done.error();
    file.reset();
  };
  const bool reports_pores =
      row.product == Product::kMoves && resolved->job.segment.any() && !job->dry_run && (!job->quiet || job->json);
  const auto progress = [&](const ProgressEvent& event) {
    if (event.stage == ProgressEvent::Stage::kLayers) keep_job();
    context.progress(event);
  };
  const auto own_cache = open_cache(arguments, context);
  if (!own_cache) return own_cache.error();
  JobCache* const cache = *own_cache ? own_cache->get() : context.cache();
  Result<CachedRun> finished = run_or_take(cache, std::move(*resolved), progress, context.cancel());
  if (!finished) return finished.error();
  Summary* const summary = &finished->summary;
  if (*own_cache && !job->quiet) {
    for (const std::string& note : (*own_cache)->take_notes()) context.say("note: " + note);
  }
  keep_job();
  if (!kept) return kept.error();
  if (reports_pores) add_pores(summary->output, *summary);
  if (Status status = write_quote(arguments, summary->quote); !status) return status.error();
  if (!job->quiet) {
    for (const std::string& note : left) context.say("note: " + note);
    context.say_text(summary->text());
  }
  if (job->json) {
    if (Status status = context.give(parse_json(summary->json())); !status) return status.error();
  }
  Outcome outcome;
  outcome.layers_planned = summary->layers_planned;
  outcome.layers_kept = summary->layers_kept;
  outcome.files = finished->files;
  return outcome;
}

// --- lamina jet

constexpr std::string_view kJetKeys =
    "bed layers heights placement image machine dose fill segment.fill segment.rule segment.thick_mm segment.thin_mm "
    "segment.continuous_lines segment.spacing_sc_mm segment.spacing_cc_mm segment.gap_mm segment.shift_mm "
    "segment.thick_width_mm segment.thin_width_mm load run part";

constexpr std::string_view kJetBasic =
    "--output --bed --dpi --layer --machine --copies --at --rotate --scale --unit --heights --format --levels "
    "--saturation --inspect --job --resume --memory";

const OptionSpec kJetSwitches[] = {
    {"--nest", "", "arrange parts by their outlines, turned about z, in one build; see lamina nest", "", "Parts"},
    {"--material", "NAME|NAME,...", "powder of all parts, or one per part in order", "", "Machine and binder"},
    {"--quote", "CSV", "write material and cost per part as CSV (with --machine)", "", "Machine and binder"},
    {"--resume", "", "continue an interrupted job; layers with a valid hash are kept", "", "Run"},
    {"--overwrite", "", "replace an earlier job in the directory", "", "Run"},
    {"--dry-run", "", "report material and printing time without writing output", "", "Run"}};

std::string jet_closing() {
  std::string text = "Formats:\n";
  for (const auto& format : formats::image_formats()) text += fmt::format("  {:<16}{}\n", format.id, format.description);
  for (const auto& format : formats::level_formats()) text += fmt::format("  {:<16}{}\n", format.id, format.description);
  return text +
         "\nLengths are mm, angles degrees. Part options apply to all parts; a job file sets them for each.\n\n"
         "Examples:\n"
         "  lamina jet bracket.stl -o out                                  a part in the middle of the bed\n"
         "  lamina jet a.stl b.3mf --bed 400x400 --dpi 600 --copies 12 -o out\n"
         "  lamina jet part.obj --unit inch --rotate 0,0,90 --shrink 1.02,1.02,1.025 -o out\n"
         "  lamina jet a.stl b.stl --material steel,bronze --machine nuferbj --vat-rule majority -o out\n"
         "  lamina jet a.stl b.stl --machine mine.toml --dry-run --quote quote.csv     what they cost, for the office\n"
         "  lamina jet part.stl --layers 100:110 --format png -o ten       ten layers only\n"
         "  lamina jet part.stl --shard 1/4 -o out                         a quarter; then lamina merge out -o out\n"
         "  lamina jet part.stl --fill segmented --thin 1.5 --shell 1 -o out   pores planned by the filling, in a solid shell\n"
         "  lamina jet part.stl --dpi 600 --save-job job.toml --dry-run    write the job, plan nothing\n"
         "  lamina jet --job job.toml -o out --resume";
}

Status complete_jet(const Arguments& arguments, Job& job) {
  if (arguments.has("--quote") && job.machine.profile.empty())
    return at_option("--quote", "reports the material of a machine; add --machine");
  if (Status status = check_folder("--quote", arguments.text("--quote")); !status) return status;
  if (!arguments.has("--material")) return {};
  const Status status = set_materials(arguments.text("--material"), job);
  return status ? status : Error{Fault::kUsage, "--material: " + status.error().message};
}

PlanCommand jet_row() {
  return {Product::kImages,
          kJetKeys,
          kJetBasic,
          "Plans a binder-jet job: an exact 1-bit image of every layer of the bed, from layers/000000.tif at the bottom,\n"
          "and a manifest.json. The same parts and options give the same bytes on every computer.",
          kJetSwitches,
          {},
          jet_closing,
          true,
          complete_jet};
}

// --- lamina slice

constexpr std::string_view kSliceKeys =
    "bed.size_mm bed.margin_mm layers heights placement image.fill load run.output run.threads run.memory run.sync run.layers "
    "run.strict run.allow_empty slice fill segment.fill part";

constexpr std::string_view kSliceBasic =
    "--output --layer --format --walls --pattern --bead --line-distance --angle --copies --rotate --scale --unit "
    "--heights --tolerance --job --resume";

const OptionSpec kSliceSwitches[] = {{"--resume", "", "continue an interrupted job; complete layers are kept", "", "Run"},
                                     {"--overwrite", "", "replace an earlier job in the directory", "", "Run"},
                                     {"--dry-run", "", "load and place the parts without writing output", "", "Run"}};

const OptionSpec kSliceWords[] = {{"--tolerance", "", "", "0", ""}};

/// A slice job saves its job file next to its manifest.
Status complete_slice(const Arguments& arguments, Job& job) {
  if (arguments.text("--fill") == "segmented")
    return at_option("--fill", "segmented lines are of lamina extrude and lamina jet");
  const InputFile requested = {arguments.text("--job"), "the job file"};
  const std::string kept = job.output + "/job.toml";
  return check_outputs({&requested, 1}, {&kept, 1});
}

std::string slice_closing() {
  return "Lengths are mm, angles degrees. Keys of a filling that have no option are set by --set fill.KEY=VALUE, between\n"
         "heights by fill.range, for one part by part.fill; docs/reference/filling.md has all of them.\n\n"
         "Examples:\n"
         "  lamina slice bracket.stl --layer 0.1 -o out                      out/bracket.svg\n"
         "  lamina slice bracket.stl --layer 0.05 --format cli-binary -o out\n"
         "  lamina slice a.stl b.stl --layer 0.2 --format 3mf -o out\n"
         "  lamina slice part.stl --layer 0.3 --walls 1 --pattern raster --bead 0.4 --bead-gap 0.12 --angle 90 -o out\n"
         "  lamina slice part.stl --layer 0.3 --pattern raster --stagger 0,0.26 --gap-formula '0.1+0.6*h' -o out";
}

PlanCommand slice_row() {
  return {Product::kContours,
          kSliceKeys,
          kSliceBasic,
          "Slices parts into closed contours in exact nanometres, outer ones counter-clockwise, holes clockwise. Writes\n"
          "SVG, CLI or 3MF slices, with a filling if a pattern or walls are requested.",
          kSliceSwitches,
          kSliceWords,
          slice_closing,
          false,
          complete_slice};
}

// --- lamina extrude

constexpr std::string_view kExtrudeKeys =
    "bed.margin_mm layers heights placement machine.profile fill image.fill segment extrude load slice.tolerance_um "
    "slice.support_angle_deg run.output run.threads run.memory run.sync run.layers run.strict run.allow_empty part";

constexpr std::string_view kExtrudeBasic =
    "--output --machine --layer --walls --density --pattern --top-layers --bottom-layers --fill --bead --print-speed --skirt "
    "--copies --at --rotate --scale --unit --heights --job --resume";

const OptionSpec kExtrudeSwitches[] = {
    {"--nest", "", "arrange parts by their outlines, turned about z, in one build; see lamina nest", "", "Parts"},
    {"--resume", "", "continue an interrupted job; complete layers are kept", "", "Run"},
    {"--overwrite", "", "replace an existing file", "", "Run"},
    {"--dry-run", "", "report material and printing time without writing output", "", "Run"}};

const OptionSpec kExtrudeWords[] = {
    {"-o,--output", "FILE", "toolpath file, as in part.gcode or part.sml", "", ""},
    {"--machine", "", "extrusion printer: a name listed below, or a profile in TOML", "marlin", ""},
    {"--layer", "", "", "half of the nozzle", ""},
    {"--tolerance", "", "", "10", ""},
    {"--walls", "", "", "2; with a pattern 1", ""},
    {"--density", "", "", "20, of a grid, unless a pattern is given", ""}};

std::string extrude_closing() {
  std::string text = "Machines:\n";
  for (const ShippedProfile& shipped : shipped_extruders()) {
    const auto profile = find_extruder(std::string(shipped.name));
    text += fmt::format("  {:<16}{}\n", shipped.name, profile ? profile->machine.description : "");
  }
  text += fmt::format("\nMaterials:\n  {}\n", fmt::join(names_of(shipped_materials()), ", "));
  return text +
         "\nThe defaults are two walls, a grid of 20 % with solid tops and bottoms, and layers of half the nozzle diameter; for SML,\n"
         "the first thickness of its table. With --fill or --pattern: one wall, no solid tops. Lengths are mm, angles degrees.\n"
         "docs/reference/extrude.md has the profiles and the file formats, docs/reference/segmented.md the segmented filling.\n\n"
         "Examples:\n"
         "  lamina extrude bracket.stl --machine marlin -o bracket.gcode\n"
         "  lamina extrude bracket.stl --machine marlin --density 15 --pattern gyroid --top-layers 5 -o bracket.gcode\n"
         "  lamina extrude bracket.stl --machine marlin --layer 0.2 --walls 2 --fill raster --bead-gap 1 -o bracket.gcode\n"
         "  lamina extrude part.stl --machine anet-a8 --layer 0.3 --fill segmented --angle 90 --angle-step 0 -o part.gcode\n"
         "  lamina extrude part.stl --machine anet-a8 --layer 0.3 --fill segmented --extrusion 125 --thin 2 -o part.gcode\n"
         "  lamina extrude part.stl --machine fdm-2000 --layer 0.254 --bead 0.508 --fill raster -o part.sml";
}

Status complete_extrude(const Arguments&, Job& job) {
  if (job.segment.all.on && job.fill.all.pattern == infill::Pattern::kNone) job.fill.all.pattern = infill::Pattern::kRaster;
  complete_filling(job);
  if (job.output.empty() && !job.dry_run) return usage("-o FILE is missing; name the file for the toolpaths, or use --dry-run");
  std::error_code ignored;
  if (job.output.empty() || (!std::filesystem::is_directory(job.output, ignored) && !job.output.ends_with('/'))) return {};
  return usage("-o {}: names a directory; name a file in it, as in {}", job.output,
               (std::filesystem::path(job.output) / "part.gcode").string());
}

/// Extension of the output file named by a batch.
std::string extrude_ending(const Arguments& arguments) {
  Job job;
  if (arguments.has("--job")) static_cast<void>(read_job(arguments.text("--job"), job));  // the command reports errors
  if (arguments.has("--machine")) job.machine.profile = arguments.text("--machine");
  job.extrude.material.clear();  // decides no format
  const auto profile = resolve_extruder(job);
  return profile && profile->machine.format == "sml" ? ".sml" : ".gcode";
}

PlanCommand extrude_row() {
  return {Product::kMoves,
          kExtrudeKeys,
          kExtrudeBasic,
          "Plans toolpaths for a material extrusion printer: walls, filling and segmented lines as G-code or SML. Reports\n"
          "the planned pores. The same parts and options give the same bytes.",
          kExtrudeSwitches,
          kExtrudeWords,
          extrude_closing,
          false,
          complete_extrude};
}

template <PlanCommand (*kRow)()>
CommandSpec spec_of_row() {
  return plan_spec(kRow());
}

template <PlanCommand (*kRow)()>
Outcome plan_row(const Arguments& arguments, Context& context) {
  return plan(kRow(), arguments, context);
}

}  // namespace

const Command jet_command = {"jet", "binder jetting: exact layer bitmaps and print programs", spec_of_row<jet_row>,
                             plan_row<jet_row>};
const Command slice_command = {"slice", "contours of every layer, with fillings: SVG, CLI, 3MF slices", spec_of_row<slice_row>,
                               plan_row<slice_row>};
const Command extrude_command = {"extrude",
                                 "material extrusion: toolpaths as G-code or SML, with porous fillings",
                                 spec_of_row<extrude_row>,
                                 plan_row<extrude_row>,
                                 false,
                                 extrude_ending};

}  // namespace lamina::pipeline
