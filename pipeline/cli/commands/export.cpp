#include <fmt/format.h>

#include <filesystem>

#include "pipeline/cli/command.h"
#include "pipeline/cli/keys.h"
#include "pipeline/job/errors.h"
#include "pipeline/job/file.h"
#include "pipeline/output/scene_3mf.h"
#include "pipeline/plan/plan.h"
#include "pipeline/report/summary.h"
#include "stages/formats/stl/mesh_stl.h"
#include "stages/formats/threemf/threemf.h"
#include "stages/support/io/file.h"
#include "stages/support/text/json_value.h"
#include "stages/support/text/readable.h"
#include "stages/support/text/version.h"

namespace lamina::pipeline {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view kExportKeys = "bed.size_mm bed.margin_mm placement load run.output part";

CommandSpec export_spec() {
  CommandSpec spec;
  spec.summary =
      "Writes the parts of a job as they are planned: repaired, scaled, rotated, shrunk and placed on the bed, with all\n"
      "copies. 3MF is exact to the nanometre and shares the mesh of copies. STL rounds coordinates to floats; the summary\n"
      "reports the largest error.";
  spec.operand = "PART";
  spec.operand_meaning = "STL, OBJ or 3MF files (STL and OBJ also gzipped); they replace the parts of --job";
  add_key_options(kExportKeys, spec);
  for (OptionSpec& option : spec.options) {
    if (option.flag != "-o,--output") continue;
    option.value = "FILE";
    option.meaning = "STL file, or 3MF if the name ends in .3mf; -: STL on stdout";
  }
  spec.options.insert(spec.options.end(), {{"--overwrite", "", "replace an existing file", "", "Run"},
                                           {"--json", "", "print the result as one JSON object on stdout", "", "Run"},
                                           {"--quiet", "", "print errors only", "", "Run"}});
  spec.closing =
      "Examples:\n"
      "  lamina export bracket.stl -o fixed.3mf                         with the repairs, which are reported\n"
      "  lamina export part.obj --unit inch --rotate 90,0,0 -o upright.stl\n"
      "  lamina export a.stl b.3mf --copies 12 --bed 400x400 -o bed.3mf   the bed as lamina jet would plan it\n"
      "  lamina export --job job.toml -o - | gzip > bed.stl.gz\n";
  return spec;
}

enum class MeshFormat { kStl, k3mf };

Result<MeshFormat> format_of(const std::string& output) {
  if (output.empty()) return usage("-o FILE is missing; name a .stl or .3mf file, or - for STL on stdout");
  const std::string ending = lower_case(fs::path(output).extension().string());
  if (ending == ".3mf") return MeshFormat::k3mf;
  if (ending == ".stl" || ending.empty() || is_stream(output)) return MeshFormat::kStl;
  return usage("-o {}: end the name with .stl or .3mf", output);
}

/// The bed on which a product of the job would stand.
Result<Bed> bed_of(const Job& job) {
  if (job.machine.profile.empty()) return bare_bed(job);
  auto resolved = resolve(job, Product::kImages);
  if (!resolved) resolved = resolve(job, Product::kMoves);
  return resolved ? Result<Bed>(resolved->bed) : resolved.error();
}

struct Exported {
  FileDigest file;
  std::uint64_t triangles = 0, left_out = 0;  // left out: of two equal corners, which enclose nothing
  double volume_mm3 = 0, rounding_mm = 0;
};

Result<Exported> write_meshes(const Scene& scene, MeshFormat format, const std::string& output) {
  Exported exported;
  for (const Instance& instance : scene.instances) exported.volume_mm3 += scene.meshes[instance.mesh].volume_mm3;
  auto file = File::open(output, {.stream = format == MeshFormat::kStl});
  if (!file) return file.error();
  if (format == MeshFormat::kStl) {
    const auto counts = formats::stl::write_stl(*file, scene.meshes, scene.instances, fmt::format("lamina {}", version()));
    if (!counts) return counts.error();
    exported.triangles = counts->triangles;
    exported.rounding_mm = counts->rounding_mm;
  } else {
    const auto counts = write_scene_3mf(*file, scene);
    if (!counts) return counts.error();
    exported.left_out = counts->degenerate;
    for (const Instance& instance : scene.instances) exported.triangles += scene.meshes[instance.mesh].triangles.size();
  }
  auto whole = file->finish();
  if (!whole) return whole.error();
  exported.file = *whole;
  return exported;
}

std::string page_of(const Scene& scene, const Exported& exported, const std::string& output, MeshFormat format) {
  Summary::Lines lines = part_lines(scene.parts);
  lines.emplace_back(
      "file", fmt::format("{}: {} in {} place{}, {} triangles, {:.3f} cm3 in all", one_line(output),
                          readable_bytes(exported.file.bytes), scene.instances.size(), scene.instances.size() == 1 ? "" : "s",
                          readable_count(exported.triangles), exported.volume_mm3 / 1000));
  if (format == MeshFormat::kStl) {
    lines.emplace_back("rounding",
                       fmt::format("{:.3g} nm at most, by the floats of STL; 3MF is exact", exported.rounding_mm * 1e6));
  }
  if (exported.left_out > 0) {
    lines.emplace_back("left out", fmt::format("{} facets of two equal corners", readable_count(exported.left_out)));
  }
  return text_of(lines);
}

Json json_of(const Scene& scene, const Exported& exported, const std::string& output, MeshFormat format) {
  Json json = {{"command", "export"},
               {"output", output},
               {"format", format == MeshFormat::kStl ? "stl" : "3mf"},
               {"files", 1},
               {"bytes_written", exported.file.bytes},
               {"meshes", scene.meshes.size()},
               {"instances", scene.instances.size()},
               {"triangles", exported.triangles},
               {"left_out", exported.left_out},
               {"volume_mm3", exported.volume_mm3},
               {"rounding_mm", exported.rounding_mm},
               {"parts", Json::array()}};
  for (const PartSummary& part : scene.parts) json["parts"].push_back(part_json(part));
  return json;
}

Outcome run_export(const Arguments& arguments, Context& context) {
  const Result<Job> job = read_job_options(kExportKeys, arguments);
  if (!job) return job.error();
  if (job->parts.empty()) return usage("no part to write; name one or more STL, OBJ or 3MF files");
  const std::string& output = job->output;
  const Result<MeshFormat> format = format_of(output);
  if (!format) return format.error();
  if (Status status = *format == MeshFormat::k3mf ? formats::check_3mf_date() : Status(); !status) return status;
  if (Status status = check_needs(Product::kContours, arguments, *job); !status) return status;
  if (Status status = check_job(*job); !status) return status;
  if (is_file(output) && !arguments.has("--overwrite"))
    return usage("{}: is there already; replace it with --overwrite, or name another file", output);
  const Result<Bed> bed = bed_of(*job);
  if (!bed) return bed.error();
  const Result<Scene> scene = load_scene(*job, *bed, *format == MeshFormat::kStl ? MeshForm::kOrderedBlocks : MeshForm::kLists);
  if (!scene) return scene.error();
  if (arguments.has("--save-job")) {
    if (Status status = save_job(arguments.text("--save-job"), *job, "export"); !status) return status;
  }
  const Result<Exported> exported = write_meshes(*scene, *format, output);
  if (!exported) return exported.error();
  if (!arguments.has("--quiet")) context.say_text(page_of(*scene, *exported, output, *format));
  if (arguments.has("--json")) return context.give(json_of(*scene, *exported, output, *format));
  return {};
}

std::string export_ending(const Arguments&) { return ".stl"; }

}  // namespace

const Command export_command = {
    "export", "write parts as loaded, repaired and placed: STL or 3MF", export_spec, run_export, false, export_ending};

}  // namespace lamina::pipeline
