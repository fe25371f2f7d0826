#include "pipeline/pores/pore_analysis.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <exception>
#include <filesystem>

#include "pipeline/pores/bead_voxels.h"
#include "pipeline/pores/pore_page.h"
#include "stages/formats/plot/plot.h"
#include "stages/pores/passages.h"
#include "stages/segment/segmentation.h"
#include "stages/support/text/readable.h"

namespace lamina::pipeline {
namespace {

namespace fs = std::filesystem;

constexpr Nm kBond = static_cast<Nm>(segment::kBondGap * 1e6);
constexpr std::uint32_t kMaxSections = 8;
constexpr std::int64_t kMaxContact = 1'000'000;    // nm, of two adjacent beads
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

constexpr std::uintmax_t kMaxBytes = 16'000'000;  // of a file that is analysed without a request
constexpr int kBins = 8;                          // about so many of a histogram

pores::Distribution histogram(const pores::PoreSizes& sizes, bool of_lengths) {
  double maximum = 0;
  for (const pores::Pore& pore : sizes.pores) maximum = std::max(maximum, of_lengths ? pore.length_mm : pore.width_mm);
  if (!(maximum > 0)) return {};
  const double bin = tick_step(maximum, kBins);
  const auto bins = static_cast<std::uint32_t>(std::floor(maximum / bin)) + 1;
  return of_lengths ? pores::lengths(sizes, bin, bins) : pores::widths(sizes, bin, bins);
}

std::string range_of(const pores::Distribution& values, std::size_t bin) {
  const int digits = std::clamp(static_cast<int>(std::ceil(-std::log10(values.bin) - 1e-9)), 0, 6);
  return fmt::format("{:.{}f} to {:.{}f}", static_cast<double>(bin) * values.bin, digits,
                     static_cast<double>(bin + 1) * values.bin, digits);
}
double percent_of(const pores::Distribution& values, std::size_t bin) {
  return 100 * static_cast<double>(values.bins[bin]) / static_cast<double>(values.count);
}

std::string histogram_lines(const char* name, const pores::Distribution& values) {
  if (values.count == 0) return {};
  std::string text = fmt::format("  {}  {:.3f} mm on average, {:.3f} to {:.3f}, standard deviation {:.3f}\n", name, values.mean,
                                 values.minimum, values.maximum, values.deviation);
  for (std::size_t i = 0; i < values.bins.size(); ++i) {
    if (values.bins[i] == 0) continue;
    text += fmt::format("    {}  {:>7} {:>5.1f} %\n", range_of(values, i), values.bins[i], percent_of(values, i));
  }
  return text;
}

/// Mean and histogram on a line.
std::string histogram_line(const pores::Distribution& values) {
  std::string text = fmt::format("{:.3f} mm on average, standard deviation {:.3f}", values.mean, values.deviation);
  for (std::size_t i = 0; i < values.bins.size(); ++i)
    if (values.bins[i] > 0) text += fmt::format("; {} mm {:.1f} %", range_of(values, i), percent_of(values, i));
  return text;
}

std::string connected_text(const pores::Connected& connected) {
  return fmt::format("{:.2f} % if beads within {:g} mm are bonded, {:.2f} % if those that touch are not",
                     100 * connected.bonded_share(), segment::kBondGap, 100 * connected.unbonded_share());
}

Json as_json(const pores::Distribution& values) {
  return {{"mean", values.mean}, {"deviation", values.deviation}, {"min", values.minimum}, {"max", values.maximum},
          {"bin", values.bin},   {"counts", values.bins}};
}

std::string sections_text(const LayerSections& sections) {
  const pores::PoreSizes& sizes = sections.sizes;
  const std::string inspected =
      fmt::format("{} in the middle, {:.1f} x {:.1f} mm",
                  sections.layers == 1 ? "a section of the layer" : fmt::format("sections of {} layers", sections.layers),
                  sections.side_mm[0], sections.side_mm[1]);
  const std::string cut = sizes.cut == 0 ? "" : fmt::format("; {} more reach the edge", readable_count(sizes.cut));
  std::string text = fmt::format("pores     {} in {}{}\n", readable_count(sizes.pores.size()), inspected, cut);
  return text + histogram_lines("width ", histogram(sizes, false)) + histogram_lines("length", histogram(sizes, true));
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
  const std::string ending = lower_case(fs::path(path).extension().string());
  return ending == ".gcode" || ending == ".gco" || ending == ".g" || ending == ".nc";
}

Result<PrintAnalysis> analyse_print(const std::string& path, double density_g_cm3, Plot* sections) {
  const Result<formats::GcodeFile> file = formats::GcodeFile::open(path);
  if (!file) return file.error();
  const Result<Pile> pile = pile_of(*file);
  if (!pile) return pile.error();
  if (pile->layers.empty()) return Error{Fault::kInput, path + ": no layer is above z = 0; heights count from the bed"};
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

std::string as_text(const PoreAnalysis& analysis) {
  std::string text = "connected " + connected_text(analysis.connected) + "\n";
  for (std::size_t a = 0; a < 3; ++a) {
    const pores::Tortuosity& way = analysis.tortuosities[a];
    text += way.reached == 0
                ? fmt::format("paths     along {}: not connected\n", "xyz"[a])
                : fmt::format("paths     along {}: {:.3f} times as long as the window, {:.3f} to {:.3f}; throat {:.3f} mm\n",
                              "xyz"[a], way.mean, way.minimum, way.maximum, analysis.throat_mm[a]);
  }
  return text + sections_text(analysis.sections);
}

void add_to(const PoreAnalysis& analysis, Json& json) {
  json["connected"] = {{"bonded", analysis.connected.bonded_share()},
                       {"unbonded", analysis.connected.unbonded_share()},
                       {"bond_gap_mm", segment::kBondGap}};
  json["tortuosity"] = Json::array();
  for (std::size_t a = 0; a < 3; ++a) {
    const pores::Tortuosity& way = analysis.tortuosities[a];
    json["tortuosity"].push_back({{"along", std::string(1, "xyz"[a])},
                                  {"tortuosity", way.mean},
                                  {"min", way.minimum},
                                  {"max", way.maximum},
                                  {"throat_mm", analysis.throat_mm[a]}});
  }
  const LayerSections& sections = analysis.sections;
  json["pores"] = {{"sections", sections.layers},
                   {"section_mm", sections.side_mm},
                   {"voxel_um", sections.voxel_um},
                   {"count", sections.sizes.pores.size()},
                   {"cut", sections.sizes.cut},
                   {"width_mm", as_json(histogram(sections.sizes, false))},
                   {"length_mm", as_json(histogram(sections.sizes, true))}};
}

std::string as_text(const PrintAnalysis& print) {
  const std::string weight =
      print.density_g_cm3 > 0
          ? fmt::format(", {:.2f} g of {:.3g} g/cm3", print.fed_mm3 * 1e-3 * print.density_g_cm3, print.density_g_cm3)
          : ", filament of unknown density; add --density";
  return fmt::format("fed       {:.1f} mm3 in {} layer{}{}\nbeads     {}\n", print.fed_mm3, print.layers,
                     print.layers == 1 ? "" : "s", weight, print.beads) +
         as_text(print.choice, print.pores) + as_text(print.analysis);
}

Json as_json(const PrintAnalysis& print) {
  Json json = as_json(print.choice, print.pores);
  json.erase("command");
  json.erase("flow");
  json["fed_mm3"] = print.fed_mm3;
  if (print.density_g_cm3 > 0) {
    json["density_g_cm3"] = print.density_g_cm3;
    json["fed_g"] = print.fed_mm3 * 1e-3 * print.density_g_cm3;
  }
  json["layers"] = print.layers;
  json["beads"] = print.beads;
  add_to(print.analysis, json);
  return json;
}

AnalysisPage analysis_page(const std::string& path) {
  std::error_code ignored;
  if (!names_toolpaths(path) || !fs::is_regular_file(path, ignored) || fs::file_size(path, ignored) > kMaxBytes) return {};
  Plot sections;
  const Result<PrintAnalysis> print = analyse_print(path, 0, &sections);
  return print ? AnalysisPage{as_text(*print), formats::plot_svg(sections)} : AnalysisPage();
}

void add_pores(const std::string& path, Summary& summary) {
  std::error_code ignored;
  if (!names_toolpaths(path) || !fs::is_regular_file(path, ignored)) return;
  if (fs::file_size(path, ignored) > kMaxBytes) {
    summary.results.emplace_back("void", "not analysed in a file this large; run lamina info");
    return;
  }
  const Result<PrintAnalysis> print = [&]() -> Result<PrintAnalysis> {
    try {
      return analyse_print(path, 0);
    } catch (const std::exception& fault) {  // the file is whole: an error in its report must not end the command
      return Error{Fault::kInput, std::string("cannot be analysed: ") + fault.what()};
    }
  }();
  if (!print) return summary.results.emplace_back("void", print.error().message), void();
  const Box& box = print->choice.window.box;
  const auto& repeats = print->choice.window.periodic;
  const PoreAnalysis& analysis = print->analysis;
  summary.results.emplace_back(
      "void", fmt::format("{:.2f} % of {:.3f} x {:.3f} x {:.3f} mm in the middle{}; connected {}",
                          100 * print->pores.porosity.total(), mm(box.width()), mm(box.depth()), mm(box.height()),
                          repeats[0] && repeats[1] && repeats[2] ? ", which repeat" : "", connected_text(analysis.connected)));
  std::string tortuosities = fmt::format("surface {:.2f} mm2 a mm3", print->pores.surface_per_mm);
  for (std::size_t a = 0; a < 3; ++a) {
    tortuosities += analysis.tortuosities[a].reached == 0
                        ? fmt::format("; nothing leads along {}", "xyz"[a])
                        : fmt::format("; along {} paths {:.3f} times as long, throat {:.3f} mm", "xyz"[a],
                                      analysis.tortuosities[a].mean, analysis.throat_mm[a]);
  }
  summary.results.emplace_back("paths", std::move(tortuosities));
  const pores::PoreSizes& sizes = analysis.sections.sizes;
  if (!sizes.pores.empty()) {
    summary.results.emplace_back("widths", histogram_line(histogram(sizes, false)));
    summary.results.emplace_back("lengths", histogram_line(histogram(sizes, true)));
  }
  Json& deposited = summary.facts["deposited"] = as_json(*print);
  // The plan's own sums: numbers of the file are rounded.
  deposited["fed_mm3"] = summary.facts.at("filament_mm3");
  deposited["fed_g"] = summary.facts.at("filament_g");
}

}  // namespace lamina::pipeline
