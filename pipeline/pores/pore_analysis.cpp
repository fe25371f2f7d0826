#include "pipeline/pores/pore_analysis.h"

#include <algorithm>
#include <cmath>
#include <filesystem>

#include "pipeline/pores/bead_rules.h"
#include "pipeline/pores/pore_drawing.h"
#include "stages/pores/throat.h"
#include "stages/segment/pore_geometry.h"
#include "stages/support/text/readable.h"

namespace lamina::pipeline {
namespace {

constexpr Nm kBond = static_cast<Nm>(segment::kBondGap * 1e6);
constexpr std::uint32_t kMaxSections = 8;
constexpr std::int64_t kMaxContact = 1'000'000;    // nm, of two beads one beside the other
constexpr std::int64_t kMaxSide = 9'000'000;       // nm, of a section
constexpr double kVoxelUm = 10, kMaxVoxels = 8e6;  // of a window

/// The middle of a layer, from the middle of the print as far as it goes.
Window section_of(const formats::GcodeFile& file, const Pile::PileLayer& layer) {
  const Box& print = file.box();
  const auto middle = print.middle();
  const auto half_x = static_cast<Nm>(std::clamp<std::int64_t>(print.width(), 1000, kMaxSide) / 2);
  const auto half_y = static_cast<Nm>(std::clamp<std::int64_t>(print.depth(), 1000, kMaxSide) / 2);
  const auto low = static_cast<Nm>(layer.low + (layer.high - layer.low) / 2 - 1);
  Window window;
  window.box.add(Point3{middle.x - half_x, middle.y - half_y, low});
  window.box.add(Point3{middle.x + half_x, middle.y + half_y, low + 2});
  const auto count = [](Nm half) { return static_cast<std::uint32_t>(std::max(1L, std::lround(2 * half / (1e3 * kVoxelUm)))); };
  window.count = {count(half_x), count(half_y), 1};
  return window;
}

Result<LayerSections> sections_of(const formats::GcodeFile& file, const Pile& pile, const CutWindow& cut) {
  LayerSections sections;
  sections.layers = std::min(kMaxSections, static_cast<std::uint32_t>(pile.layers.size()));
  VoxelStack all;
  for (std::uint32_t n = 0; n < sections.layers; ++n) {
    const Window window = section_of(file, pile.layers[(2 * n + 1) * pile.layers.size() / (2 * sections.layers)]);
    const Result<VoxelStack> slice = cut(window);
    if (!slice) return slice.error();
    if (n == 0) {
      all = VoxelStack(slice->nx, slice->ny, slice->edge);
      sections.side_mm = {mm(window.box.width()), mm(window.box.depth())};
      sections.voxel_um = slice->edge[0] * 1e-3;
    }
    all.append(RunsView{slice->nx, slice->row_offset, slice->change});
  }
  sections.sizes = pores::pore_sizes(pores::bond(all, kBond));
  return sections;
}

}  // namespace

Result<PoreAnalysis> analyse_deposited(const formats::GcodeFile& file, const Pile& pile, const VoxelView& window,
                                       const CutWindow& cut) {
  PoreAnalysis analysis;
  const Pile::PileLayer& layer = pile.layers[pile.layers.size() / 2];
  analysis.connected = pores::connected(window, kBond, static_cast<Nm>(std::min((layer.high - layer.low) / 2, kMaxContact)));
  if (set_voxels(window) > 0) {
    analysis.throat_mm = pores::throats(window, pores::whole(window), {true, true, true});
    for (int axis = 0; axis < 3; ++axis)
      analysis.tortuosities[static_cast<std::size_t>(axis)] = pores::tortuosity(window, pores::whole(window), axis);
  }
  Result<LayerSections> sections = sections_of(file, pile, cut);
  if (!sections) return sections.error();
  analysis.sections = std::move(*sections);
  return analysis;
}

bool names_toolpaths(const std::string& path) {
  const std::string ending = lower_case(std::filesystem::path(path).extension().string());
  return ending == ".gcode" || ending == ".gco" || ending == ".g" || ending == ".nc";
}

Result<PrintAnalysis> analyse_print(const std::string& path, double density_g_cm3, Plot* sections) {
  const Result<formats::GcodeFile> file = formats::GcodeFile::open(path);
  if (!file) return file.error();
  const Result<Pile> pile = pile_of(*file);
  if (!pile) return pile.error();
  if (pile->layers.empty()) return Error{Fault::kInput, path + ": no layer lies above z = 0; heights count from the bed"};
  PrintAnalysis print;
  print.fed_mm3 = file->fed_mm3();
  print.density_g_cm3 = density_g_cm3 > 0 ? density_g_cm3 : file->density_g_cm3();
  print.layers = static_cast<std::uint32_t>(pile->layers.size());
  WindowRequest target{kVoxelUm, {}};
  const auto of_file = [&](const Error& error) { return Error{error.fault, path + ": " + error.message}; };
  Result<WindowChoice> choice = choose_window(*file, *pile, target);
  if (!choice) return of_file(choice.error());
  if (const double many = static_cast<double>(choice->window.voxels()) / kMaxVoxels; many > 1) {
    target.voxel_um *= std::cbrt(many);
    choice = choose_window(*file, *pile, target);
    if (!choice) return of_file(choice.error());
  }
  print.choice = std::move(*choice);
  Result<BeadRules> beads = bead_rules(*file, "", "");
  if (!beads) return beads.error();
  print.beads = beads->reported;
  const CutWindow cut = [&](const Window& window) {
    return bead_voxels(*file, *pile, window, beads->rules ? &*beads->rules : nullptr);
  };
  Result<VoxelStack> voxels = cut(print.choice.window);
  if (!voxels && beads->rules) {  // beads upon each other
    beads = bead_rules(*file, "stated", "");
    if (!beads) return beads.error();
    print.beads = beads->reported;
    voxels = cut(print.choice.window);
  }
  if (!voxels) return voxels.error();
  print.pores.voxels = voxels->view().voxels();
  print.pores.empty = print.pores.voxels - set_voxels(*voxels);
  print.pores.porosity = pores::porosity(*voxels);
  print.pores.surface_per_mm = pores::specific_surface(*voxels).crofton;
  Result<PoreAnalysis> analysis = analyse_deposited(*file, *pile, *voxels, cut);
  if (!analysis) return analysis.error();
  print.analysis = std::move(*analysis);
  print.pores.throat_mm = print.analysis.throat_mm;
  if (sections != nullptr) {
    Result<Plot> plot = draw_window(path, print.choice, print.pores, *voxels, &*file, &*pile);
    if (!plot) return plot.error();
    *sections = std::move(*plot);
  }
  return print;
}

}  // namespace lamina::pipeline
