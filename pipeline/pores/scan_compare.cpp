#include "pipeline/pores/scan_compare.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "stages/pores/surface.h"
#include "stages/support/text/json_value.h"

namespace lamina::pipeline {
namespace {

double porosity_of(const VoxelView& box) {
  return 1 - static_cast<double>(set_voxels(box)) / static_cast<double>(box.voxels());
}

/// The window in the middle of the print, in voxels as large as the scan's.
Result<Window> window_of_plan(const formats::GcodeFile& file, const Pile& pile, const ImageStack& scan,
                              const std::array<double, 3>& size_mm, std::uint32_t range) {
  Box print = file.box();
  const std::array<std::int64_t, 3> low{print.lo.x, print.lo.y, pile.layers.front().low};
  const std::array<std::int64_t, 3> high{print.hi.x, print.hi.y, pile.layers.back().high};
  Window window;
  std::array<std::int64_t, 3> from{}, to{};
  for (std::size_t a = 0; a < 3; ++a) {
    const double print_mm = mm(high[a] - low[a]), edge = scan.edge[a];
    const double scan_mm = (scan.size[a] > 2 * range ? scan.size[a] - 2.0 * range : 0) * edge * 1e-6;
    const double side = size_mm[a] > 0 ? size_mm[a] : std::min({2.0, print_mm, scan_mm});
    if (side > print_mm + 1e-9)
      return Error{Fault::kUsage, fmt::format("--window: {:.3f} mm along {} are more than the print has: {:.3f} mm", side,
                                              "xyz"[a], print_mm)};
    window.count[a] = static_cast<std::uint32_t>(side * 1e6 / edge + 1e-6);
    if (side > scan_mm + 1e-9 || window.count[a] == 0)
      return Error{
          Fault::kUsage,
          fmt::format("--scan: its images have {:.3f} mm along {} beside {} voxels each way to search in; take a smaller "
                      "--window or --range",
                      scan_mm, "xyz"[a], range)};
    from[a] = (low[a] + high[a]) / 2 - std::llround(window.count[a] * edge / 2);
    to[a] = from[a] + std::llround(window.count[a] * edge);
  }
  window.box.add(Point3{static_cast<Nm>(from[0]), static_cast<Nm>(from[1]), static_cast<Nm>(from[2])});
  window.box.add(Point3{static_cast<Nm>(to[0]), static_cast<Nm>(to[1]), static_cast<Nm>(to[2])});
  if (window.voxels() > std::uint64_t{1} << 31)
    return Error{Fault::kUsage, "--window: has more than 2^31 voxels of the scan; take a smaller one"};
  return window;
}

}  // namespace

Result<ScanComparison> compare_with_scan(const formats::GcodeFile& file, const Pile& pile, const ImageStack& scan,
                                         const std::array<double, 3>& size_mm, std::uint32_t range,
                                         const bead::DepositionRules* rules) {
  const Result<Window> window = window_of_plan(file, pile, scan, size_mm, range);
  if (!window) return window.error();
  if (const auto& count = window->count; range > 16 && std::min({count[0], count[1], count[2]}) < 16)
    return Error{Fault::kUsage, "--range: above 16 the window has to be 16 voxels thick at least; give a larger --window"};
  const Result<VoxelStack> plan = bead_voxels(file, pile, *window, rules);
  if (!plan) return plan.error();
  if (set_voxels(*plan) == 0)
    return Error{Fault::kInput,
                 "no bead lies in the middle of the print, where it is compared with the scan; take a --window "
                 "that reaches them, or a file of one part"};
  std::array<std::uint32_t, 3> low{}, count{};
  for (std::size_t a = 0; a < 3; ++a) {
    count[a] = window->count[a] + 2 * range;
    low[a] = (scan.size[a] - count[a]) / 2;
  }
  const Result<VoxelStack> around = formats::cut_box(scan, low, count);
  if (!around) return around.error();
  ScanComparison comparison;
  comparison.window = *window;
  comparison.range = range;
  comparison.match = pores::find_shift(*plan, *around, range);
  for (std::size_t a = 0; a < 3; ++a) {
    comparison.shift_mm[a] = comparison.match.shift[a] * scan.edge[a] * 1e-6;
    low[a] += static_cast<std::uint32_t>(static_cast<std::int64_t>(range) + comparison.match.shift[a]);
  }
  const Result<VoxelStack> found = formats::cut_box(scan, low, window->count);
  if (!found) return found.error();
  comparison.plan_porosity = porosity_of(*plan);
  comparison.scan_porosity = porosity_of(*found);
  comparison.surface_per_mm = (pores::specific_surface(*plan).crofton + pores::specific_surface(*found).crofton) / 2;
  if (comparison.surface_per_mm > 0)
    comparison.wall_mm = (comparison.plan_porosity - comparison.scan_porosity) / comparison.surface_per_mm;
  return comparison;
}

std::string as_text(const ScanComparison& c) {
  const Box& box = c.window.box;
  const auto share = [&](std::uint64_t voxels) {
    return 100 * static_cast<double>(voxels) / static_cast<double>(c.window.voxels());
  };
  return fmt::format(
      "window    {:.3f} x {:.3f} x {:.3f} mm around {:.2f}, {:.2f}, {:.2f} mm of the plan, {} x {} x {} voxels\n"
      "shift     {:+.3f}, {:+.3f}, {:+.3f} mm of the scan ({:+}, {:+}, {:+} voxels, of {} searched each way)\n"
      "porosity  {:.2f} % planned, {:.2f} % scanned\n"
      "walls     {:+.4f} mm out of the plan's: a bead between two is {:+.4f} mm wide of plan, by porosity and {:.2f} mm2 a mm3\n"
      "voxels    {:.2f} % differ: {:.2f} % solid in the plan alone, {:.2f} % in the scan alone\n",
      mm(box.width()), mm(box.depth()), mm(box.height()), mm(box.middle().x), mm(box.middle().y), mm(box.middle().z),
      c.window.count[0], c.window.count[1], c.window.count[2], c.shift_mm[0], c.shift_mm[1], c.shift_mm[2], c.match.shift[0],
      c.match.shift[1], c.match.shift[2], c.range, 100 * c.plan_porosity, 100 * c.scan_porosity, c.wall_mm, 2 * c.wall_mm,
      c.surface_per_mm, share(c.match.differing()), share(c.match.only_small), share(c.match.only_large));
}

Json as_json(const ScanComparison& c) {
  const Box& box = c.window.box;
  return {{"command", "permeability"},
          {"window_mm", {mm(box.width()), mm(box.depth()), mm(box.height())}},
          {"voxels", c.window.count},
          {"shift_voxels", c.match.shift},
          {"shift_mm", c.shift_mm},
          {"range_voxels", c.range},
          {"porosity_plan", c.plan_porosity},
          {"porosity_scan", c.scan_porosity},
          {"surface_per_mm", c.surface_per_mm},
          {"wall_mm", c.wall_mm},
          {"width_mm", 2 * c.wall_mm},
          {"differing", c.differing()},
          {"found", c.found()},
          {"plan_alone_voxels", c.match.only_small},
          {"scan_alone_voxels", c.match.only_large}};
}

}  // namespace lamina::pipeline
