#include "pipeline/cli/pore_stack.h"

#include <fmt/format.h>

#include "pipeline/cli/window_files.h"
#include "pipeline/pores/image_stack.h"
#include "pipeline/pores/pore_page.h"
#include "stages/support/text/json_value.h"
#include "stages/support/text/number_text.h"
#include "stages/support/text/readable.h"

namespace lamina::pipeline {
namespace {

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
      return Error{Fault::kUsage, fmt::format("{} is for images without a manifest; that of {} tells it, leave it out", flag,
                                              one_line(folder))};
  }
  return open_stack(folder, *request);
}

Result<std::array<bool, 3>> read_periodic(const Arguments& arguments) {
  std::array<bool, 3> periodic{};
  for (const char axis : arguments.text("--periodic")) {
    if (axis < 'x' || axis > 'z')
      return Error{Fault::kUsage, fmt::format("--periodic: '{}' is not of the axes x, y and z, as in --periodic xy",
                                              one_line(arguments.text("--periodic")))};
    periodic[static_cast<std::size_t>(axis - 'x')] = true;
  }
  return periodic;
}

}  // namespace

std::vector<OptionSpec> stack_options() {
  return {
      {"--pixel", "UM", "of images without a manifest: edge of a pixel, micrometres", "", "Images"},
      {"--layer-um", "UM", "of images without a manifest: distance of layers; default: a pixel", "", "Images"},
      {"--threshold", "N", "of images without a manifest: from which grey on a pixel is bright, of 255", "128", "Images"},
      {"--dark", "", "dark pixels of images without a manifest are the solid, not the bright ones", "", "Images"},
      {"--periodic", "AXES", "along which the window repeats, as in xy; else walls close its sides", "", "Images"},
      {"--scan", "DIR", "of a print of these toolpaths: images to be found in the plan, and compared with it", "", "Images"},
      {"--range", "N", "voxels each way that the scan may be shifted by, in eights", "16", "Images"}};
}

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
    return Error{Fault::kInput,
                 fmt::format("{}: nothing is solid in the window; take a larger --window, and without a manifest "
                             "look at --threshold and --dark",
                             one_line(folder))};
  const std::atomic<bool>& cancel = context.cancel();
  const Result<PoreReport> report = arguments.has("--no-flow") ? pores_alone(window->fine)
                                                               : analyse_pores({window->fine, window->fine, window->coarse, 1},
                                                                               flow, [&](double) { return !cancel; });
  if (!report) return Error{report.error().fault, fmt::format("{}: {}", one_line(folder), report.error().message)};
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

Outcome compare_scan(const Arguments& arguments, Context& context, const formats::GcodeFile& file, const Pile& pile,
                     const bead::DepositionRules* rules) {
  for (const char* flag : {"--voxel", "--periodic", "--solid", "--void", "--plot", "--no-flow", "--inertia", "--memory"})
    if (arguments.has(flag)) return Error{Fault::kUsage, fmt::format("{} does nothing beside --scan; leave it out", flag)};
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
    context.say("note: the scan hardly looks like the plan at any of these shifts; is it turned, or give a larger --range?");
  return arguments.has("--json") ? context.give(as_json(*comparison)) : context.print(as_text(*comparison));
}

}  // namespace lamina::pipeline
