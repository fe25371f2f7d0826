#include "pipeline/cli/pore_print.h"

#include <fmt/format.h>

#include <vector>

#include "pipeline/cli/pore_stack.h"
#include "pipeline/cli/window_files.h"
#include "pipeline/pores/bead_voxels.h"
#include "pipeline/pores/pore_analysis.h"
#include "pipeline/pores/pore_page.h"
#include "pipeline/pores/predict_flow.h"
#include "stages/support/text/json_value.h"
#include "stages/support/text/readable.h"

namespace lamina::pipeline {
namespace {

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
  return {
      Fault::kInput,
      fmt::format("{}: no bead lies in the window of {:.3f} x {:.3f} x {:.3f} mm around {:.2f}, {:.2f} mm, the middle of the "
                  "print; take a --window that reaches them, or a file of one part",
                  path, mm(box.width()), mm(box.depth()), mm(box.height()), mm(box.middle().x), mm(box.middle().y))};
}

}  // namespace

Outcome predict_print(const Arguments& arguments, Context& context, const std::optional<Box>& part) {
  const std::string& path = arguments.operands.front();
  if (Status status = check_window_files(arguments); !status) return status;
  if (arguments.has("--inertia") && arguments.has("--no-flow"))
    return Error{Fault::kUsage, "--inertia does nothing beside --no-flow; leave one out"};
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
  if (!choice) return Error{choice.error().fault, fmt::format("{}: {}", path, choice.error().message)};
  // Tortuosity and throats take that much; the memory of the flow is checked when its void is known.
  if (const std::uint64_t bytes = 16 * choice->window.voxels(); bytes > request.memory_bytes)
    return Error{Fault::kUsage, fmt::format("{}: {} voxels take {} at least, --memory allows {}; take a larger --voxel or a "
                                            "smaller --window",
                                            path, readable_count(choice->window.voxels()), readable_bytes(bytes),
                                            readable_bytes(request.memory_bytes))};
  double left_out = 0;
  const CutWindow cut_window = [&](const Window& window) { return bead_voxels(*file, *pile, window, rules, &left_out); };
  const bool flows = !arguments.has("--no-flow");
  const auto cut = cut_for(flows, cut_window, choice->window);
  if (!cut) return cut.error();
  const bool empty = set_voxels(cut->front()) == 0;
  if (empty && flows) return nothing_deposited(path, choice->window.box);
  if (left_out > 0.002)
    context.say(
        fmt::format("note: {:.1f} % of what is laid find no room beside their neighbours and are left out", 100 * left_out));
  const PoreRasters rasters{cut->front(), cut->at(flows ? 1 : 0), cut->at(flows ? 2 : 0)};
  const std::atomic<bool>& cancel = context.cancel();
  const Result<PoreReport> report =
      flows ? analyse_pores(rasters, request, [&](double) { return !cancel; }) : pores_alone(rasters.voxels);
  if (!report) return Error{report.error().fault, fmt::format("{}: {}", path, report.error().message)};
  const auto inertia = request.inertia ? inertia_of(rasters, *report, context) : Result(std::optional<Forchheimer>());
  if (!inertia) return inertia.error();
  const Result<PoreAnalysis> analysis = analyse_deposited(*file, *pile, rasters.voxels, cut_window);
  if (!analysis) return analysis.error();
  const auto files = write_window_files(arguments, rasters.voxels, [&] {
    return draw_window(context.shown(path), *choice, *report, rasters.fine, &*file, &*pile);
  });
  if (!files) return files.error();
  if (empty) context.say("note: " + nothing_deposited(path, choice->window.box).message);
  print_warnings(*pile, *report, context);
  context.say(beads->reported);
  if (!arguments.has("--json"))
    return context.print(as_text(*choice, *report) + (*inertia ? as_text(**inertia) : "") + as_text(*analysis) +
                         as_text(*files));
  Json json = as_json(*choice, *report);
  if (*inertia) json["inertia"] = as_json(**inertia);
  add_to(*analysis, json);
  if (!files->empty()) json["files"] = as_json(*files);
  return context.give(json);
}

}  // namespace lamina::pipeline
