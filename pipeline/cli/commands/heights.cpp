#include <fmt/format.h>

#include <chrono>

#include "pipeline/cli/command.h"
#include "pipeline/cli/keys.h"
#include "pipeline/cli/other_programs.h"
#include "pipeline/job/errors.h"
#include "pipeline/job/file.h"
#include "pipeline/machine/profiles.h"   // is_named
#include "pipeline/manifest/manifest.h"  // title_of
#include "pipeline/plan/layers.h"
#include "pipeline/plan/overhangs.h"
#include "pipeline/report/heights_study.h"
#include "stages/formats/rp3/rp3.h"
#include "stages/support/io/file.h"
#include "stages/support/text/value.h"

namespace lamina::pipeline {
namespace {

// Of [[part]] what changes its shape or height.
constexpr std::string_view kHeightsCommandKeys =
    "layers heights load slice.support_angle_deg part.unit part.bottom_mm part.scale part.rotate_deg part.shrink";

enum class Form { kText, kCsv, kJson, kRp3 };
constexpr Word<Form> kForms[] = {{"text", Form::kText}, {"csv", Form::kCsv}, {"json", Form::kJson}, {"rp3", Form::kRp3}};

CommandSpec heights_spec() {
  CommandSpec spec;
  spec.summary =
      "Computes the layers of parts and prints a table: bottom, thickness, reason, steepest angle and remaining step.\n"
      "lamina jet and lamina slice give the same layers for the same options.";
  spec.operand = "PART";
  spec.operand_meaning = "STL, OBJ or 3MF files (STL and OBJ also gzipped); they replace the parts of --job";
  add_key_options(kHeightsCommandKeys, spec);
  spec.options.insert(
      spec.options.end(),
      {{"--format", "FORMAT", "format of the table: text, csv, json or rp3 (Lima 2009)", "", "Table", words_of(kForms)},
       {"-o,--output", "FILE", "file for the table; default: stdout", "", "Table"},
       {"--compare", "", "compare all modes with these thicknesses and limits", "", "Table"},
       {"--measure", "FILE", "evaluate existing layers: a file with one top in mm per line", "", "Table"},
       {"--plot", "FILE", "plot of thickness over height next to the part, .svg or .png", "", "Table"},
       {"--overwrite", "", "replace a file that lamina did not write", "", "Table"},
       {"--quiet", "", "print only the table and errors", "", "Table"}});
  spec.closing =
      "Examples:\n"
      "  lamina heights boat.3mf --heights optimal --thickness 0.05..0.3 --cusp 0.1\n"
      "  lamina heights boat.3mf --thickness 0.05..0.3 --cusp 0.1 --compare\n"
      "  lamina heights part.stl --heights angle --thickness 0.178,0.254 --facets plane --format rp3\n"
      "  lamina heights part.stl --heights optimal --thickness 0.1,0.2 --plot heights.svg";
  return spec;
}

Status report(const std::string& path, const std::string& text, Context& context) {
  return path.empty() ? context.print(text) : write_file(path, text, {.stream = true});
}

/// The job as requested, and with the values that the command sets by itself.
struct HeightsJob {
  Job requested, studied;
};

Result<HeightsJob> job_of(const Arguments& arguments) {
  Result<Job> read = read_job_options(kHeightsCommandKeys, arguments);
  if (!read) return read.error();
  const Job requested = *read;
  if (read->parts.empty()) return usage("no part; name one or more STL, OBJ or 3MF files");
  // Heights do not depend on the parts' positions or on the size of the bed.
  if (read->bed_mm || read->machine.profile.empty()) read->bed_mm = kLargestBed.size_mm;
  read->dry_run = true;
  // Comparing and measuring need no mode.
  const bool own_way = arguments.has("--compare") || arguments.has("--measure") || read->heights.per_part;
  if (own_way && read->heights.mode == heights::Mode::kUniform && !read->heights.thickness_mm.empty()) {
    read->heights.mode = heights::Mode::kOptimal;
  }
  if (!arguments.has("--compare") && !arguments.has("--measure")) {
    if (Status status = check_needs(Product::kContours, arguments, *read, true); !status) return status.error();
  }
  if (Status status = check_job(*read); !status) return status.error();
  return HeightsJob{requested, std::move(*read)};
}

/// A file of this form holds one unnamed table.
Status check_one_table(const Job& job, const Arguments& arguments) {
  const bool many = arguments.all("--measure").size() > 1;
  if (!arguments.has("--compare") && !job.heights.per_part && !many) return {};
  return usage("--format rp3: holds one table, and {} makes several; leave it out or choose text, csv or json",
               arguments.has("--compare") ? "--compare"
               : job.heights.per_part     ? "--per-part"
                                          : "more than one --measure");
}

std::string rp3_text(const Job& job, const heights::Study& study) {
  std::vector<formats::rp3::LayerSetting> layers;
  for (std::size_t i = 0; i < study.layers(); ++i) layers.push_back({mm(study.thickness(i)), angle(study, i)});
  formats::rp3::Settings settings;
  settings.shrink = job.parts.front().shrink;
  settings.rotation_deg = job.parts.front().rotate_deg;
  return formats::rp3::text_of(layers, settings);
}

/// What hangs in the layers of each table, for tables that are sliced. Of separate tables, those after the first are of one
/// part each.
Result<std::vector<checks::OverhangTally>> overhangs_of(const Job& job, const Scene& scene,
                                                        const std::vector<heights::Study>& studies, bool by_part) {
  std::vector<checks::OverhangTally> tallies;
  for (std::size_t table = 0; table < studies.size(); ++table) {
    const heights::Study& study = studies[table];
    const bool alone = by_part && table > 0 && table <= scene.parts.size();
    std::vector<Instance> instances;
    Box around;
    for (std::size_t i = 0; i < scene.instances.size(); ++i) {
      if (alone && scene.part_of_instance[i] != table - 1) continue;
      instances.push_back(scene.instances[i]);
      around.add(box_of(scene, scene.instances[i]));
    }
    // Positions on the bed are arbitrary here: they are reported from the corner of the parts.
    for (Instance& instance : instances) instance.offset.x -= around.lo.x, instance.offset.y -= around.lo.y;
    std::vector<Layer> layers;
    std::vector<Nm> planes;
    for (std::size_t i = 0; i < study.layers(); ++i) {
      const Layer layer{static_cast<std::uint32_t>(i), static_cast<Nm>(study.boundaries[i]),
                        static_cast<Nm>(study.thickness(i))};
      layers.push_back(layer);
      planes.push_back(plane_of(job, layer, around.hi.z));
    }
    auto tally = tally_overhangs(scene.meshes, instances, job.fill_rule, layers, planes, job.support_angle_deg);
    if (!tally) return tally.error();
    tallies.push_back(std::move(*tally));
  }
  return tallies;
}

std::string table_text(Form form, const Job& job, const Scene& scene, const std::vector<heights::Study>& studies,
                       const std::vector<checks::OverhangTally>& overhangs) {
  StudiedParts parts{{},        scene.height,         text_of(job.heights, job.layer_mm), job.heights.cusp_mm,
                     overhangs, job.support_angle_deg};
  for (const PartSummary& part : scene.parts) parts.paths.push_back(part.path);
  switch (form) {
    case Form::kJson: return json_line(with_schema(parse_json(study_json(parts, studies))));
    case Form::kCsv: return study_csv(parts, studies);
    case Form::kRp3: return rp3_text(job, studies.back());
    case Form::kText: break;
  }
  return studies.size() > 1 ? comparison_page(parts, studies) : study_page(parts, studies.back());
}

/// The options of the tables; given tables need no thickness.
Result<heights::Options> options_of(const Arguments& arguments, const Job& job) {
  if (arguments.has("--compare") || job.heights.per_part || !arguments.has("--measure")) return heights_options(job);
  Job measured = job;
  if (job.heights.thickness_mm.empty()) measured.heights.mode = heights::Mode::kUniform;
  return heights_options(measured);
}

/// The tables selected by the command's options; the last one is drawn.
Result<std::vector<heights::Study>> studies_of(const Arguments& arguments, const Job& job, const heights::SurfaceIndex& index,
                                               const heights::Options& options) {
  std::vector<heights::Study> studies;
  if (arguments.has("--compare") || job.heights.per_part) {
    auto all = arguments.has("--compare") ? study_all_modes(index, options) : study_per_part(index, options);
    if (!all) return all;
    studies = std::move(*all);
  } else if (!arguments.has("--measure")) {
    auto study = heights::study(index, options);
    if (!study) return study.error();
    studies.push_back(std::move(*study));
  }
  for (const std::string& path : arguments.all("--measure")) {
    auto study = study_table(index, options, path);
    if (!study) return study.error();
    studies.push_back(std::move(*study));
  }
  return studies;
}

Outcome run_heights(const Arguments& arguments, Context& context) {
  const std::string output = arguments.text("-o,--output"), plot = arguments.text("--plot");
  Form form = Form::kText;
  if (arguments.has("--format")) {
    if (Status status = at_option("--format", read_word(kForms, arguments.text("--format"), form)); !status) return status;
  }
  if (const Status status = check_plot_name(plot); !status) return status.error();
  const Result<HeightsJob> read = job_of(arguments);
  if (!read) return read.error();
  const Job* const job = &read->studied;
  if (form == Form::kRp3) {
    if (Status status = check_one_table(*job, arguments); !status) return status.error();
  }
  using Clock = std::chrono::steady_clock;
  const auto start = Clock::now();
  const Result<Scene> scene = load_scene(*job, kLargestBed, MeshForm::kOrderedBlocks);
  const std::chrono::duration<double> load = Clock::now() - start;
  if (!scene) return scene.error();

  Result<heights::Options> options = options_of(arguments, *job);
  if (!options) return options.error();
  options->estimates_time = arguments.has("--compare");
  const heights::SurfaceIndex index = index_scene(*job, *scene, *options);
  const std::chrono::duration<double> surface = Clock::now() - start - load;
  const auto studies = studies_of(arguments, *job, index, *options);
  if (!studies) return studies.error();
  if (arguments.has("--save-job")) {
    if (Status status = save_job(arguments.text("--save-job"), read->requested, "heights"); !status) return status.error();
  }
  const bool compares = arguments.has("--compare");
  // Slicing the layers of every mode takes several times as long as deciding them.
  const bool slices = !compares || is_named(*job, "slice.support_angle_deg");
  const auto overhangs =
      slices ? overhangs_of(*job, *scene, *studies, job->heights.per_part && !compares) : std::vector<checks::OverhangTally>();
  if (!overhangs) return overhangs.error();
  const heights::Study& last = studies->back();
  if (Status status = report(output, table_text(form, *job, *scene, *studies, *overhangs), context); !status)
    return status.error();
  std::vector<Warning> warnings;
  // The first of separate tables is the one that the parts would share.
  for (std::size_t table = job->heights.per_part && overhangs->size() > 1 ? 1 : 0; table < overhangs->size(); ++table)
    (*overhangs)[table].warn(job->support_angle_deg, warnings);
  if (!compares && !arguments.has("--quiet")) {
    for (const Warning& warning : warnings) context.say(fmt::format("warning   {}", warning.text));
  }
  if (studies->size() == 1 && !arguments.has("--quiet")) {
    context.say(fmt::format("time      load {:.4f} s, surface {:.4f} s, layers {:.4f} s, measuring them {:.4f} s", load.count(),
                            surface.count(), last.plan_seconds, last.evaluate_seconds));
  }
  if (plot.empty()) return Status();
  return write_plot(plot, draw_study(title_of(scene->parts), scene->meshes, scene->instances, last));
}

}  // namespace

const Command heights_command = {"heights", "adaptive layer heights: list, compare, plot", heights_spec, run_heights};

}  // namespace lamina::pipeline
