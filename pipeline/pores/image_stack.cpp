#include "pipeline/pores/image_stack.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <memory>

#include "pipeline/check/job_files.h"
#include "pipeline/job/file.h"
#include "stages/data/levels.h"
#include "stages/data/shortage.h"
#include "stages/formats/images/image.h"
#include "stages/pores/rows.h"
#include "stages/pores/surface.h"
#include "stages/support/text/readable.h"

namespace lamina::pipeline {
namespace {

namespace fs = std::filesystem;

constexpr std::int64_t kMaxSlices = 4'000'000;

/// A manifest of lamina begins with the version of lamina that wrote it.
bool begun_by_lamina(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  std::string head;
  for (char c = 0; head.size() < 10 && file.get(c);)
    if (c != ' ' && c != '\n' && c != '\r') head += c;
  return head == "{\"lamina\":";
}

/// Voxels along z: as thick as the thinnest layer, from the bottom of the first to the top of the last.
void slice_layers(const std::vector<LayerRecord>& layers, ImageStack& stack) {
  Nm thinnest = layers.front().layer.thickness;
  for (const LayerRecord& record : layers) thinnest = std::min(thinnest, record.layer.thickness);
  const std::int64_t low = layers.front().layer.bottom;
  const std::int64_t height = std::int64_t{layers.back().layer.bottom} + layers.back().layer.thickness - low;
  thinnest = static_cast<Nm>(std::max<std::int64_t>({thinnest, 1, height / kMaxSlices}));
  for (std::uint32_t l = 0; l < layers.size(); ++l) {
    const std::int64_t top = std::int64_t{layers[l].layer.bottom} + layers[l].layer.thickness;
    while (low + (2 * static_cast<std::int64_t>(stack.layer_of.size()) + 1) * thinnest / 2 < top) stack.layer_of.push_back(l);
  }
  stack.size[2] = static_cast<std::uint32_t>(stack.layer_of.size());
  stack.edge[2] = thinnest;
}

/// Pixels that get no drop because drops are few are no pores. errors  kInput: the images leave some out
Status check_all_filled(const std::string& folder, const Manifest& manifest) {
  const ManifestHead& head = manifest.head;
  if (head.geometry || (head.full_level() > 0 && !head.grey_drops())) return {};  // or shares of voxels
  Job job;
  const bool known = read_job_text(head.job_toml, folder + "/manifest.json", job).ok();
  std::uint64_t without = 0, filled = 0;
  for (const LayerRecord& record : manifest.layers) {
    filled += record.filled_pixels();
    if (record.filled_pixels() > record.set_pixels) without += record.filled_pixels() - record.set_pixels;
  }
  const bool thinned = known && job.dose.core < 1;
  const bool rounded = known && head.levels > 0 && !job.dose.dithered && !job.dose.saturation_percent;
  const bool shares = head.levels > 0 && !rounded;  // of which full voxels are counted, and any is set that has a drop
  if (!thinned && !shares && (without == 0 || rounded)) return {};
  const std::string what =
      thinned  ? fmt::format("{:.4g} % of the pixels of its cores get no drop (--core)", 100 * (1 - job.dose.core))
      : shares ? "fill fractions of voxels are dithered into drops (--levels)"
               : fmt::format("{} of {} pixels that are to be filled get no drop (--saturation)", without, filled);
  const std::string as_they_are =
      head.named_images() > 0
          ? ""
          : fmt::format(", or name {}/layers with --pixel, --layer-um and --dark to take its pixels as they are",
                        one_line(folder));
  return Error{Fault::kInput,
               fmt::format("{}: {}, which is no pore; plan the job again without that{}", one_line(folder), what, as_they_are)};
}

/// The solid of a layer: of shares of voxels those that are half full or more.
Result<Runs> solid_of_layer(const std::string& folder, const ManifestHead& head, const LayerRecord& record) {
  auto picture = picture_of_layer(folder, head, record, ExpectedDrops());
  if (!picture) return picture.error();
  const std::uint8_t full = head.full_level();
  if (full == 0 || head.grey_drops()) return std::move(picture->front());
  Levels levels;
  auto image = formats::levels(folder + "/" + layer_images(head, record).front().name, full, levels);
  if (!image) return image.error();
  threshold_levels(levels, static_cast<std::uint8_t>((full + 1) / 2), image->runs);
  return std::move(image->runs);
}

Result<ImageStack> stack_of_job(const std::string& folder) {
  auto manifest = read_manifest(folder + "/manifest.json");
  if (!manifest) return of_input(manifest.error());
  const auto job = std::make_shared<const Manifest>(std::move(*manifest));
  const ManifestHead& head = job->head;
  if (head.product != Product::kImages || head.extension.empty() || job->layers.empty())
    return Error{Fault::kInput, folder + ": its job wrote no images; name a folder of lamina jet, or of images"};
  if (Status status = check_all_filled(folder, *job); !status) return status.error();
  ImageStack stack;
  stack.path = folder;
  slice_layers(job->layers, stack);
  stack.size = {head.grid.columns(), head.grid.rows(), stack.size[2]};
  stack.edge = {1 / head.grid.x.pixels_per_nm(), 1 / head.grid.y.pixels_per_nm(), stack.edge[2]};
  stack.part = stack.size;
  if (!head.parts.empty() && !head.parts.front().bounds.empty()) {
    const Box& box = head.parts.front().bounds;
    const std::int64_t bottom = job->layers.front().layer.bottom;
    const std::array<std::int64_t, 3> low{box.lo.x, box.lo.y, box.lo.z - bottom}, high{box.hi.x, box.hi.y, box.hi.z - bottom};
    for (std::size_t a = 0; a < 3; ++a) {
      const auto voxel = [&](std::int64_t nm) {
        return static_cast<std::uint32_t>(
            std::clamp(std::round(static_cast<double>(nm) / stack.edge[a]), 0.0, 1.0 * stack.size[a]));
      };
      stack.part_low[a] = voxel(low[a]);
      stack.part[a] = voxel(high[a]) - stack.part_low[a];
    }
  }
  stack.read = [job, folder](std::uint32_t layer) -> Result<Runs> {
    return solid_of_layer(folder, job->head, job->layers[layer]);
  };
  return stack;
}

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
          fmt::format("--scan: its images leave {:.3f} mm along {} with a search range of {} voxels each way; take a smaller "
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

bool has_manifest(const std::string& folder) {
  return begun_by_lamina(folder + "/manifest.json") || begun_by_lamina(folder + "/manifest.json.part");
}

Result<ImageStack> open_stack(const std::string& folder, const StackRequest& request) {
  if (begun_by_lamina(folder + "/manifest.json")) return stack_of_job(folder);
  if (has_manifest(folder)) return Error{Fault::kInput, folder + ": the job is not finished; end it with --resume first"};
  return formats::stack_of_images(folder, request);
}

Result<StackWindow> window_of_stack(const ImageStack& stack, const WindowRequest& selection,
                                    const std::array<bool, 3>& periodic) {
  std::array<std::uint32_t, 3> factor{}, low{}, count{}, twice{};
  std::uint64_t voxels = 1;
  for (std::size_t a = 0; a < 3; ++a) {
    const double edge = stack.edge[a], part_mm = stack.part[a] * edge * 1e-6;
    factor[a] = static_cast<std::uint32_t>(std::clamp(std::round(1e3 * selection.voxel_um / edge), 1.0, 1000.0));
    const double requested_mm = selection.size_mm[a] > 0 ? selection.size_mm[a] : std::min(2.0, part_mm);
    const auto wanted = static_cast<std::uint32_t>(std::min(4e9, std::round(requested_mm * 1e6 / edge)));
    if (wanted > stack.part[a])
      return Error{Fault::kUsage, fmt::format("--window: {:.3f} mm along {} are more than the images have: {:.3f} mm",
                                              requested_mm, "xyz"[a], part_mm)};
    // Whole blocks of those that the error is taken from.
    twice[a] = wanted >= 2 * factor[a] ? 2 : 1;
    count[a] = wanted / (twice[a] * factor[a]) * (twice[a] * factor[a]);
    if (count[a] == 0)
      return Error{Fault::kUsage,
                   fmt::format("--window: contains no voxel of {:.4g} um along {}; take a larger one or a smaller "
                               "--voxel",
                               factor[a] * edge * 1e-3, "xyz"[a])};
    low[a] = stack.part_low[a] + (stack.part[a] - count[a]) / 2;
    voxels *= count[a];
  }
  if (voxels > std::uint64_t{1} << 31)
    return Error{Fault::kUsage, "--window: has more than 2^31 voxels of the images; take a smaller one"};
  Result<VoxelStack> box = formats::cut_box(stack, low, count);
  if (!box) return box.error();
  box->periodic = periodic;
  StackWindow window;
  window.fine = factor == std::array<std::uint32_t, 3>{1, 1, 1} ? std::move(*box) : pores::coarser(*box, factor);
  window.coarse = pores::coarser(window.fine, twice);
  window.choice.window.count = window.fine.view().size();
  window.choice.window.periodic = periodic;
  window.choice.first_layer = stack.layer_of[low[2]];
  window.choice.layers = stack.layer_of[low[2] + count[2] - 1] - window.choice.first_layer + 1;
  const auto corner = [&](const std::array<std::uint32_t, 3>& more) {
    const auto at = [&](std::size_t a) { return static_cast<Nm>(std::llround((low[a] + more[a]) * stack.edge[a])); };
    return Point3{at(0), at(1), at(2)};
  };
  window.choice.window.box.add(corner({}));
  window.choice.window.box.add(corner(count));
  return window;
}

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
                 "no bead is in the middle of the print, where it is compared with the scan; take a --window "
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
