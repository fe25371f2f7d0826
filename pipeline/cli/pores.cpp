#include "pipeline/cli/pores.h"

#include <fmt/format.h>

#include <filesystem>
#include <functional>
#include <string>

#include "pipeline/cli/other_programs.h"
#include "pipeline/cli/outputs.h"
#include "pipeline/job/errors.h"
#include "pipeline/pores/bead_voxels.h"
#include "pipeline/pores/image_stack.h"
#include "pipeline/pores/pore_analysis.h"
#include "pipeline/pores/pore_page.h"
#include "pipeline/pores/predict_flow.h"
#include "stages/data/plot.h"
#include "stages/data/status.h"
#include "stages/data/voxels.h"
#include "stages/formats/voxels/image.h"
#include "stages/formats/voxels/surface_stl.h"
#include "stages/support/text/json_value.h"
#include "stages/support/text/number_text.h"
#include "stages/support/text/readable.h"
#include "stages/support/text/version.h"

namespace lamina::pipeline {
namespace {

// --- files

/// One file that was written.
struct WindowFile {
  std::string path, content;  // "solid", "void" or "sections"
  std::uint64_t bytes = 0, facets = 0;
};

namespace fs = std::filesystem;
using formats::voxels::VoxelPhase;

struct Choice {
  const char *flag, *content;
  VoxelPhase side;
};
constexpr Choice kChoices[] = {{"--solid", "solid", VoxelPhase::kSolid}, {"--void", "void", VoxelPhase::kVoid}};

bool is_stl(const std::string& path) { return lower_case(fs::path(path).extension().string()) == ".stl"; }

/// errors  kUsage: an ending of no format; kOutput: no such folder
Status check_window_files(const Arguments& arguments) {
  if (Status status = check_plot_name(arguments.text("--plot")); !status) return status;
  for (const Choice& choice : kChoices) {
    if (!arguments.has(choice.flag)) continue;
    const std::string path = arguments.text(choice.flag), reported = one_line(path);
    if (!is_stl(path) && !formats::voxels::image_kind(path))
      return usage("{} {}: end the name with .nrrd, .mha, .vti or .stl", choice.flag, reported);
    if (Status status = check_folder(choice.flag, path); !status) return status;
  }
  return {};
}

/// Writes the requested outputs; files get their names when all of them are complete.
/// draw    makes the plot of --plot
/// errors  kOutput; kInput: more facets than an STL file counts
Result<std::vector<WindowFile>> write_window_files(const Arguments& arguments, const VoxelView& window,
                                                   const std::function<Result<Plot>()>& draw) {
  std::vector<WindowFile> written;
  std::vector<File> files;
  const auto begin = [&](const char* flag, const char* content) -> Result<File*> {
    written.push_back({arguments.text(flag), content, 0, 0});
    auto file = File::open(written.back().path);
    if (!file) return file.error();
    files.push_back(std::move(*file));
    return &files.back();
  };
  for (const Choice& choice : kChoices) {
    if (!arguments.has(choice.flag)) continue;
    const auto file = begin(choice.flag, choice.content);
    if (!file) return file.error();
    WindowFile& one = written.back();
    if (is_stl(one.path)) {
      const auto counts = formats::voxels::write_surface(**file, window, choice.side, version());
      if (!counts) return failure(counts.error().fault, "{} {}: {}", choice.flag, one_line(one.path), counts.error().message);
      one.facets = counts->facets;
    } else if (Status status =
                   formats::voxels::write_image(**file, window, choice.side, *formats::voxels::image_kind(one.path), version());
               !status) {
      return status.error();
    }
  }
  if (arguments.has("--plot")) {
    const auto file = begin("--plot", "sections");
    if (!file) return file.error();
    const auto plot = draw();
    const auto text = plot ? plot_text(written.back().path, *plot) : plot.error();
    if (!text) return text.error();
    if (Status status = (*file)->append(*text); !status) return status.error();
  }
  for (std::size_t i = 0; i < files.size(); ++i) {
    const auto whole = files[i].finish();
    if (!whole) return whole.error();
    written[i].bytes = whole->bytes;
  }
  return written;
}

/// A line each, which ends with LF.
std::string as_text(const std::vector<WindowFile>& files) {
  std::string text;
  for (const WindowFile& file : files) {
    text += fmt::format("file      {}: the {}, {}{}\n", one_line(file.path), file.content, readable_bytes(file.bytes),
                        file.facets > 0 ? fmt::format(", {} facets", readable_count(file.facets)) : "");
  }
  return text;
}

Json as_json(const std::vector<WindowFile>& files) {
  Json json = Json::array();
  for (const WindowFile& file : files) {
    json.push_back({{"path", file.path}, {"content", file.content}, {"bytes", file.bytes}});
    if (file.facets > 0) json.back()["facets"] = file.facets;
  }
  return json;
}

/// What there is to report of a window without a flow through it.
PoreReport pores_alone(const VoxelView& window) {
  PoreReport report;
  report.voxels = window.voxels();
  report.empty = window.voxels() - set_voxels(window);
  report.porosity = pores::porosity(window);
  report.surface_per_mm = pores::specific_surface(window).crofton;
  return report;
}

// --- layer images

Result<StackRequest> read_request(const Arguments& arguments) {
  StackRequest request;
  std::int64_t threshold = request.threshold;
  for (const Status& status :
       {arguments.read("--pixel", {0.05, 1000}, request.pixel_um), arguments.read("--layer-um", {0.05, 5000}, request.layer_um),
        arguments.read("--threshold", {1, 255}, threshold)}) {
    if (!status) return status.error();
  }
  request.threshold = static_cast<int>(threshold);
  request.dark = arguments.has("--dark");
  return request;
}

/// The folder's images by its manifest, or by the options. errors  kUsage: both
Result<ImageStack> open_images(const std::string& folder, const Arguments& arguments) {
  const Result<StackRequest> request = read_request(arguments);
  if (!request) return request.error();
  for (const char* flag : {"--pixel", "--layer-um", "--threshold", "--dark"}) {
    if (arguments.has(flag) && has_manifest(folder))
      return usage("{} is for images without a manifest; that of {} states it, remove the option", flag, one_line(folder));
  }
  return open_stack(folder, *request);
}

Result<std::array<bool, 3>> read_periodic(const Arguments& arguments) {
  std::array<bool, 3> periodic{};
  for (const char axis : arguments.text("--periodic")) {
    if (axis < 'x' || axis > 'z')
      return usage("--periodic: '{}' is not of the axes x, y and z, as in --periodic xy",
                   one_line(arguments.text("--periodic")));
    periodic[static_cast<std::size_t>(axis - 'x')] = true;
  }
  return periodic;
}

/// The window that --window and --voxel request. voxel_um  where --voxel is not given
/// errors  kUsage
Result<WindowRequest> read_window_request(const Arguments& arguments, double voxel_um) {
  WindowRequest selection;
  selection.voxel_um = voxel_um;
  if (Status status = arguments.read("--voxel", {1, 500}, selection.voxel_um); !status) return status.error();
  if (!arguments.has("--window")) return selection;
  const std::string text = arguments.text("--window");
  const auto parts = split(text, ",");
  for (std::size_t a = 0; a < 3; ++a) {
    const std::string wrong = parts.size() != 3 ? "want three lengths in mm, as in --window 2,3,0.6"
                                                : read_number(parts[a], 0.05, 100, " mm", selection.size_mm[a]);
    if (Status status = at_option("--window", wrong); !status) return status.error();
  }
  return selection;
}

/// Toolpaths compared with the scan of --scan. rules  of bead_voxels()
Outcome compare_scan(const Arguments& arguments, Context& context, const formats::GcodeFile& file, const Pile& pile,
                     const bead::DepositionRules* rules) {
  for (const char* flag : {"--voxel", "--periodic", "--solid", "--void", "--plot", "--no-flow", "--inertia", "--memory"})
    if (arguments.has(flag)) return usage("{} has no effect with --scan; remove it", flag);
  std::uint32_t range = 16;
  if (Status status = arguments.read("--range", {1, 200}, range); !status) return status;
  range = (range + 7) / 8 * 8;  // that coarse voxels hold it
  const Result<WindowRequest> selection = read_window_request(arguments, 0);
  if (!selection) return selection.error();
  const Result<ImageStack> scan = open_images(arguments.text("--scan"), arguments);
  if (!scan) return scan.error();
  const auto comparison = compare_with_scan(file, pile, *scan, selection->size_mm, range, rules);
  if (!comparison) return comparison.error();
  if (!comparison->found())
    context.say("note: the scan hardly matches the plan at any of these shifts; check its rotation or use a larger --range");
  return arguments.has("--json") ? context.give(as_json(*comparison)) : context.print(as_text(*comparison));
}

// --- toolpaths

/// The window in its voxels and, for a flow, in those that it is computed with.
Result<std::vector<VoxelStack>> cut_for(bool flow, const CutWindow& cut, const Window& window) {
  std::vector<VoxelStack> all;
  for (const Window& in : {window, finer(window, kFiner), finer(with_half_as_many_voxels(window), kFiner)}) {
    if (!flow && !all.empty()) break;
    Result<VoxelStack> voxels = cut(in);
    if (!voxels) return voxels.error();
    all.push_back(std::move(*voxels));
  }
  return all;
}

/// None where there is nothing to report; a note says so.
Result<std::optional<Forchheimer>> inertia_of(const PoreRasters& rasters, const PoreReport& report, Context& context) {
  const std::atomic<bool>& cancel = context.cancel();
  Result<Forchheimer> found = analyse_inertia(rasters, report, [&](double) { return !cancel; });
  if (!found && found.error().fault != Fault::kInput) return found.error();
  if (!found) context.say("note: " + found.error().message);
  if (found && !found->settled) context.say("note: the fastest flow found no steady state; k2 is of those before");
  return found ? std::optional(std::move(*found)) : std::nullopt;
}

void print_warnings(const Pile& pile, const PoreReport& report, Context& context) {
  if (pile.skipped > 0) {
    context.say(
        fmt::format("note: {} layers that do not lie above those before are left out, as of parts printed one after the other",
                    pile.skipped));
  }
  for (const std::optional<Darcy>& darcy : report.flow) {
    if (darcy && !darcy->resolved) context.say("note: voxels are too coarse for the pores; take a smaller --voxel");
    if (darcy && darcy->residual > 1e-2) context.say("note: the flow was not solved to its end; take a smaller --window");
  }
}

Error nothing_deposited(const std::string& path, const Box& box) {
  return failure(Fault::kInput,
                 "{}: no bead lies in the window of {:.3f} x {:.3f} x {:.3f} mm around {:.2f}, {:.2f} mm, the middle of the "
                 "print; take a --window that reaches them, or a file of one part",
                 path, mm(box.width()), mm(box.depth()), mm(box.height()), mm(box.middle().x), mm(box.middle().y));
}

}  // namespace

std::vector<OptionSpec> window_file_options() {
  return {{"--solid", "FILE", "write the solid as voxels (.nrrd, .mha, .vti) or surface (.stl)", "", "Result"},
          {"--void", "FILE", "write the void as voxels (.nrrd, .mha, .vti) or surface (.stl)", "", "Result"},
          {"--no-flow", "", "analyse pores and write files without computing the flow", "", "Result"}};
}

std::vector<OptionSpec> stack_options() {
  return {{"--pixel", "UM", "images without a manifest: pixel size in micrometres", "", "Images"},
          {"--layer-um", "UM", "images without a manifest: layer thickness in micrometres; default: --pixel", "", "Images"},
          {"--threshold", "N", "images without a manifest: min grey of bright pixels, 1 to 255", "128", "Images"},
          {"--dark", "", "images without a manifest: dark pixels are solid", "", "Images"},
          {"--periodic", "AXES", "axes with periodic boundaries, as in xy; default: walls", "", "Images"},
          {"--scan", "DIR", "images of a scan of the print, compared with the toolpaths", "", "Images"},
          {"--range", "N", "max shift of the scan in voxels, rounded up to a multiple of 8", "16", "Images"}};
}

Outcome predict_stack(const Arguments& arguments, Context& context) {
  const std::string& folder = arguments.operands.front();
  FlowRequest flow;
  if (Status status = check_window_files(arguments); !status) return status;
  flow.section = arguments.has("--plot");
  if (Status status = arguments.read("--memory", read_bytes, flow.memory_bytes); !status) return status;
  const Result<std::array<bool, 3>> periodic = read_periodic(arguments);
  if (!periodic) return periodic.error();
  const Result<WindowRequest> selection = read_window_request(arguments, 0);
  if (!selection) return selection.error();
  const Result<ImageStack> stack = open_images(folder, arguments);
  if (!stack) return stack.error();
  const Result<StackWindow> window = window_of_stack(*stack, *selection, *periodic);
  if (!window) return window.error();
  if (!arguments.has("--no-flow") && set_voxels(window->fine) == 0)
    return failure(Fault::kInput,
                   "{}: nothing is solid in the window; take a larger --window, and without a manifest "
                   "check --threshold and --dark",
                   one_line(folder));
  const std::atomic<bool>& cancel = context.cancel();
  const Result<PoreReport> report = arguments.has("--no-flow") ? pores_alone(window->fine)
                                                               : analyse_pores({window->fine, window->fine, window->coarse, 1},
                                                                               flow, [&](double) { return !cancel; });
  if (!report) return failure(report.error().fault, "{}: {}", one_line(folder), report.error().message);
  const auto files = write_window_files(
      arguments, window->fine, [&] { return draw_window(context.shown(folder), window->choice, *report, window->fine); });
  if (!files) return files.error();
  for (const std::optional<Darcy>& darcy : report->flow) {
    if (darcy && !darcy->resolved)
      context.say("note: voxels twice as large say something else; the images are coarse for these pores");
  }
  if (!arguments.has("--json")) return context.print(as_text(window->choice, *report) + as_text(*files));
  Json json = as_json(window->choice, *report);
  if (!files->empty()) json["files"] = as_json(*files);
  return context.give(json);
}

Outcome predict_print(const Arguments& arguments, Context& context, const std::optional<Box>& part) {
  const std::string& path = arguments.operands.front();
  if (Status status = check_window_files(arguments); !status) return status;
  FlowRequest request;
  request.inertia = arguments.has("--inertia");
  request.section = arguments.has("--plot");
  if (Status status = arguments.read("--memory", read_bytes, request.memory_bytes); !status) return status.error();
  const Result<formats::GcodeFile> file = formats::GcodeFile::open(path);
  if (!file) return file.error();
  const Result<Pile> pile = pile_of(*file);
  if (!pile) return pile.error();
  if (pile->layers.empty()) return Error{Fault::kInput, path + ": no layer lies above z = 0; heights count from the bed"};
  const Result<BeadRules> beads = bead_rules(*file, arguments.text("--beads"), arguments.text("--machine"));
  if (!beads) return beads.error();
  const bead::DepositionRules* rules = beads->rules ? &*beads->rules : nullptr;
  if (arguments.has("--scan")) return compare_scan(arguments, context, *file, *pile, rules);
  Result<WindowRequest> selection = read_window_request(arguments, 10);
  if (!selection) return selection.error();
  selection->part = part;
  const Result<WindowChoice> choice = choose_window(*file, *pile, *selection);
  if (!choice) return failure(choice.error().fault, "{}: {}", path, choice.error().message);
  // Tortuosity and throats take that much; the memory of the flow is checked when its void is known.
  if (const std::uint64_t bytes = 16 * choice->window.voxels(); bytes > request.memory_bytes)
    return usage("{}: {} voxels take {} at least, --memory allows {}; take a larger --voxel or a smaller --window", path,
                 readable_count(choice->window.voxels()), readable_bytes(bytes), readable_bytes(request.memory_bytes));
  double left_out = 0;
  const CutWindow cut_window = [&](const Window& window) { return bead_voxels(*file, *pile, window, rules, &left_out); };
  const bool flows = !arguments.has("--no-flow");
  const auto cut = cut_for(flows, cut_window, choice->window);
  if (!cut) return cut.error();
  const bool empty = set_voxels(cut->front()) == 0;
  if (empty && flows) return nothing_deposited(path, choice->window.box);
  if (left_out > 0.002)
    context.say(fmt::format("note: {:.1f} % of the deposited volume has no space next to its neighbours and is left out",
                            100 * left_out));
  const PoreRasters rasters{cut->front(), cut->at(flows ? 1 : 0), cut->at(flows ? 2 : 0)};
  const std::atomic<bool>& cancel = context.cancel();
  const Result<PoreReport> report =
      flows ? analyse_pores(rasters, request, [&](double) { return !cancel; }) : pores_alone(rasters.voxels);
  if (!report) return failure(report.error().fault, "{}: {}", path, report.error().message);
  const auto inertia = request.inertia ? inertia_of(rasters, *report, context) : Result(std::optional<Forchheimer>());
  if (!inertia) return inertia.error();
  const Result<PoreAnalysis> analysis = analyse_deposited(*file, *pile, rasters.voxels, cut_window);
  if (!analysis) return analysis.error();
  const auto files = write_window_files(arguments, rasters.voxels, [&] {
    return draw_window(context.shown(path), *choice, *report, rasters.fine, &*file, &*pile);
  });
  if (!files) return files.error();
  if (empty) context.say("note: " + nothing_deposited(path, choice->window.box).message);
  if (!choice->window.periodic[0] || !choice->window.periodic[1])
    context.say("note: no period along x or y: walls close the window, and k1 is not that of the filling; use a wider part");
  print_warnings(*pile, *report, context);
  context.say(beads->reported);
  for (const Warning& warning : beads->warnings) context.say_text(fmt::format("warning   {}\n", one_line(warning.text)));
  const Darcy* along = beads->depends_on_acceleration && report->flow[2] ? &*report->flow[2] : nullptr;
  const K1Range range = along ? k1_range(along->k_m2[2] / segment::kDarcy, along->error_m2[2] / segment::kDarcy) : K1Range();
  const std::string accuracy =
      along ? fmt::format("accuracy  k1 along z is {:.3g} to {:.3g} D with voxels and acceleration (docs/theory/pores.md)\n",
                          range.low, range.high)
            : "";
  if (!arguments.has("--json"))
    return context.print(as_text(*choice, *report) + accuracy + (*inertia ? as_text(**inertia) : "") + as_text(*analysis) +
                         as_text(*files));
  Json json = as_json(*choice, *report);
  if (*inertia) json["inertia"] = as_json(**inertia);
  add_to(*analysis, json);
  json["warnings"] = warnings_json(beads->warnings);
  if (along) json["k1_range_darcy"] = {range.low, range.high};
  if (!files->empty()) json["files"] = as_json(*files);
  return context.give(json);
}

}  // namespace lamina::pipeline
