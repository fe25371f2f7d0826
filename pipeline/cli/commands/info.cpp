#include <fmt/format.h>

#include <algorithm>

#include "pipeline/cli/command.h"
#include "pipeline/cli/keys.h"
#include "pipeline/job/errors.h"
#include "pipeline/manifest/manifest.h"
#include "pipeline/plan/overhangs.h"
#include "pipeline/plan/scene.h"
#include "pipeline/pores/pore_analysis.h"
#include "pipeline/report/overhang_observer.h"
#include "pipeline/report/part_info.h"
#include "stages/formats/images/layer_images.h"
#include "stages/formats/images/stack_info.h"
#include "stages/slice/slice.h"
#include "stages/support/text/json_value.h"
#include "stages/support/text/number_text.h"
#include "stages/support/text/readable.h"

namespace lamina::pipeline {
namespace {

CommandSpec info_spec() {
  CommandSpec spec;
  spec.summary =
      "Checks and describes part files, G-code and layer images: mesh size, volume, open edges and their repair by lamina\n"
      "jet; extruded volume and pores of G-code; size, resolution, numbering and gaps of images. No file is written.";
  spec.operand = "PART|GCODE|STACK";
  spec.operand_meaning =
      "STL, OBJ or 3MF files (STL and OBJ also gzipped), toolpaths as in part.gcode, or layer images (folders or files)";
  const std::vector<std::string_view> units = {"mm", "cm", "m", "um", "inch", "foot"}, modes = {"auto", "winding", "off"};
  spec.options = {{"--unit", "UNIT", "unit of STL and OBJ files: mm, cm, m, um, inch or foot", "mm", "", units},
                  {"--scale", "S|X,Y,Z", "scale factor, or one per axis of the file; negative: mirrored", "1", ""},
                  {"--rotate", "X,Y,Z", "rotation in degrees about x, then y, then z, after scaling", "0,0,0", ""},
                  {"--drop-bad", "", "drop facets with NaN or infinite coordinates", "", ""},
                  {"--repair", "MODE", "repair of open meshes: auto, winding (approximate) or off", "auto", "", modes},
                  {"--weld", "UM", "max gap to weld in micrometres; 5 is doubled as needed", "5", ""},
                  {"--support-angle", "DEG", "report overhangs above this angle in degrees (0: wall)", "", ""},
                  {"--threshold", "N", "images: pixels with a grey below N are set, 1 to 255", "128", ""},
                  {"--memory", "SIZE", "memory limit for images in flight: 256M, 1G", "1G", ""},
                  {"--density", "G/CM3", "filament density in g/cm3, if the toolpath file states none", "", ""},
                  {"--json", "", "print one JSON object per part on stdout", "", ""}};
  spec.closing =
      "Examples:\n"
      "  lamina info bracket.stl\n"
      "  lamina info --unit inch housing.stl\n"
      "  lamina info part.gcode                     volume fed, weight, porosity, pores by width and length\n"
      "  lamina info slices/                        images: pages, dpi, numbers that are missing, set pixels\n"
      "  lamina info --json *.stl | jq -r 'select(.closed | not) | .path'";
  return spec;
}

Status report_print(const std::string& path, double density_g_cm3, const Arguments& arguments, Context& context) {
  const Result<PrintAnalysis> print = analyse_print(path, density_g_cm3);
  if (!print) return print.error();
  if (!arguments.has("--json")) return context.print(one_line(path) + "\n" + as_text(*print));
  Json json = {{"path", path}};
  json.update(as_json(*print));
  return context.give(json);
}

/// errors  kInput: some images cannot be read
Status report_images(const std::string& path, int threshold, std::uint64_t memory, const Arguments& arguments,
                     Context& context) {
  const auto reported = images_on_record(path);
  if (!reported) return reported.error();
  const Result<formats::StackInfo> info = formats::inspect_stack(reported->path, threshold, memory);
  if (!info) return info.error();
  Json json = formats::as_json(*info);
  std::string text = formats::as_text(*info);
  if (reported->thickness > 0) {
    text += fmt::format("  {:<12}{} mm each from {} mm on, by the manifest{}{}{}\n", "layers",
                        number_text(mm(reported->thickness)), number_text(mm(reported->bottom)),
                        reported->levels > 0 ? fmt::format("; fill fractions of voxels in {} levels", reported->levels) : "",
                        reported->geometry ? "; geometry before the dose" : "",
                        reported->mirror.empty() || reported->mirror == "none" ? "" : "; mirrored " + reported->mirror);
    json["layers"] = {
        {"thickness_mm", mm(reported->thickness)}, {"bottom_mm", mm(reported->bottom)}, {"levels", reported->levels}};
  } else {
    text +=
        fmt::format("  {:<12}no manifest of lamina states the layer thickness; jet needs --layer or part.layer_mm\n", "layers");
    json["layers"] = nullptr;
  }
  const Status status = arguments.has("--json") ? context.give(json) : context.print(text);
  if (!status || info->unreadable == 0) return status;
  return failure(Fault::kInput, "{}: {} of {} images cannot be read", one_line(path), info->unreadable, info->images);
}

/// What hangs over air in a part as planned: sampled in layers of 0.2 mm, thicker ones if it has more than 500 of them.
struct PartOverhangs {
  checks::OverhangTally tally;
  double layer_mm = 0;
};

Result<PartOverhangs> overhangs_of(const std::string& path, const load::LoadOptions& options, double angle_deg) {
  const Result<Part> part = load::load(path, options);
  if (!part) return part.error();
  constexpr std::int64_t kThinnest = 200'000, kMaxLayers = 500, kStep = 1000;  // nm, layers, nm
  const std::int64_t height = std::max<std::int64_t>(part->bounds.height(), 1);
  const auto thickness = static_cast<Nm>(std::max(kThinnest, ceil_div(ceil_div(height, kMaxLayers), kStep) * kStep));
  std::vector<Instance> instances = part->instances;
  for (Instance& instance : instances) instance.offset.z -= part->bounds.lo.z;
  std::vector<Layer> layers;
  std::vector<Nm> planes;
  for (std::uint32_t i = 0; std::int64_t{i} * thickness < height; ++i) {
    layers.push_back({i, static_cast<Nm>(i * std::int64_t{thickness}), thickness});
    planes.push_back(layers.back().plane_below(height));
  }
  auto tally = tally_overhangs(part->meshes, instances, FillRule::kNonzero, layers, planes, angle_deg);
  if (!tally) return tally.error();
  return PartOverhangs{std::move(*tally), mm(thickness)};
}

/// Adds the overhangs to the page of a part, if they are requested.
Status add_overhangs(const std::string& path, const load::LoadOptions& options, const Arguments& arguments, double angle_deg,
                     Context& context, std::string& page) {
  if (!arguments.has("--support-angle")) return {};
  const auto overhangs = overhangs_of(path, options, angle_deg);
  if (!overhangs) return overhangs.error();
  if (arguments.has("--json")) {
    Json json = parse_json(page);
    json["overhangs"] = overhangs_json(overhangs->tally, angle_deg);
    json["overhangs"]["layer_mm"] = overhangs->layer_mm;
    page = json_line(json);
  } else {
    page += fmt::format("\n  overhangs            {:.2f} mm2 flatter than {} degrees, in layers of {} mm\n",
                        overhangs->tally.area_mm2(), number_text(angle_deg), number_text(overhangs->layer_mm));
  }
  std::vector<Warning> warnings;
  overhangs->tally.warn(angle_deg, warnings);
  for (const Warning& warning : warnings) context.say(fmt::format("warning   {}: {}", one_line(path), warning.text));
  return {};
}

/// errors  kUsage: an option that is of none of the operands
Status check_flags(const Arguments& arguments) {
  const auto any = [&](auto names) { return std::ranges::any_of(arguments.operands, names); };
  const bool parts = any([](const std::string& path) { return !names_toolpaths(path) && !formats::names_images(path); });
  if (arguments.has("--density") && !any(names_toolpaths))
    return at_option("--density", "is of toolpaths; parts have no filament");
  if (arguments.has("--threshold") && !any(formats::names_images))
    return at_option("--threshold", "is of layer images; leave it out");
  if (arguments.has("--memory") && !any(formats::names_images))
    return at_option("--memory", "is of layer images; leave it out");
  for (const char* flag : {"--unit", "--scale", "--rotate", "--drop-bad", "--repair", "--weld", "--support-angle"})
    if (arguments.has(flag) && !parts) return at_option(flag, "is of parts, not of toolpaths or images");
  return {};
}

Outcome run_info(const Arguments& arguments, Context& context) {
  if (arguments.operands.empty()) return usage("no part; name an STL, OBJ or 3MF file");
  // Read as lamina jet reads them.
  const Result<Job> job = read_job_options("part load", arguments);
  if (!job) return job.error();
  if (Status status = check_needs(Product::kImages, arguments, *job); !status) return status;
  double density_g_cm3 = 0;
  if (Status status = arguments.read("--density", {0.1, 25}, density_g_cm3); !status) return status;
  std::int64_t threshold = 128;
  if (Status status = arguments.read("--threshold", {1, 255}, threshold); !status) return status;
  std::uint64_t memory = std::uint64_t{1} << 30;
  if (Status status = arguments.read("--memory", read_bytes, memory); !status) return status;
  double angle_deg = 45;
  if (Status status = arguments.read("--support-angle", {0, 89, " degrees"}, angle_deg); !status) return status;
  if (Status status = check_flags(arguments); !status) return status;
  int code = 0;
  const bool json = arguments.has("--json");
  for (const PartRequest& part : job->parts) {
    Status status;
    if (names_toolpaths(part.path)) {
      status = report_print(part.path, density_g_cm3, arguments, context);
    } else if (formats::names_images(part.path)) {
      status = report_images(part.path, static_cast<int>(threshold), memory, arguments, context);
    } else {
      auto page = (json ? describe_part_json : describe_part_text)(part.path, load_options(*job, part), slice::surplus_areas);
      if (page) {
        if (status = add_overhangs(part.path, load_options(*job, part), arguments, angle_deg, context, *page); !status) {
          code = std::max(code, context.complain(status.error()));
        }
        if (status = json ? context.give(parse_json(*page)) : context.print(*page); !status) return status.error();
        continue;
      }
      status = page.error();
    }
    if (!status) code = std::max(code, context.complain(status.error()));
  }
  return code;
}

}  // namespace

const Command info_command = {"info", "check a mesh file; describe images, toolpaths and manifests", info_spec, run_info};

}  // namespace lamina::pipeline
