// The pages of pore_analysis.h.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <exception>
#include <filesystem>

#include "pipeline/pores/pore_analysis.h"
#include "pipeline/pores/pore_page.h"
#include "stages/data/plot.h"
#include "stages/formats/plot/plot.h"
#include "stages/segment/pore_geometry.h"
#include "stages/segment/predict.h"
#include "stages/support/text/json_value.h"
#include "stages/support/text/readable.h"

namespace lamina::pipeline {
namespace {

namespace fs = std::filesystem;

constexpr std::uintmax_t kMaxBytes = 16'000'000;  // of a file that is looked at without being asked
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
  return {{"mean", values.mean}, {"deviation", values.deviation}, {"least", values.minimum}, {"most", values.maximum},
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

std::string as_text(const PoreAnalysis& inspection) {
  std::string text = "connected " + connected_text(inspection.connected) + "\n";
  for (std::size_t a = 0; a < 3; ++a) {
    const pores::Tortuosity& way = inspection.paths[a];
    text += way.reached == 0
                ? fmt::format("ways      along {}: none leads through\n", "xyz"[a])
                : fmt::format("ways      along {}: {:.3f} times as long as the window, {:.3f} to {:.3f}; throat {:.3f} mm\n",
                              "xyz"[a], way.mean, way.minimum, way.maximum, inspection.throat_mm[a]);
  }
  return text + sections_text(inspection.sections);
}

void add_to(const PoreAnalysis& inspection, Json& json) {
  json["connected"] = {{"bonded", inspection.connected.bonded_share()},
                       {"unbonded", inspection.connected.unbonded_share()},
                       {"bond_gap_mm", segment::kBondGap}};
  json["ways"] = Json::array();
  for (std::size_t a = 0; a < 3; ++a) {
    const pores::Tortuosity& way = inspection.paths[a];
    json["ways"].push_back({{"along", std::string(1, "xyz"[a])},
                            {"tortuosity", way.mean},
                            {"least", way.minimum},
                            {"most", way.maximum},
                            {"throat_mm", inspection.throat_mm[a]}});
  }
  const LayerSections& sections = inspection.sections;
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
          : ", of a filament whose density nothing tells; give --density";
  return fmt::format("fed       {:.1f} mm3 in {} layer{}{}\nbeads     {}\n", print.fed_mm3, print.layers,
                     print.layers == 1 ? "" : "s", weight, print.beads) +
         as_text(print.choice, print.pores) + as_text(print.inspection);
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
  add_to(print.inspection, json);
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
    summary.results.emplace_back("void", "of a file this large: lamina info tells it");
    return;
  }
  const Result<PrintAnalysis> print = [&]() -> Result<PrintAnalysis> {
    try {
      return analyse_print(path, 0);
    } catch (const std::exception& fault) {  // the file is whole: what is told of it must not end the command
      return Error{Fault::kInput, std::string("cannot be told: ") + fault.what()};
    }
  }();
  if (!print) return summary.results.emplace_back("void", print.error().message), void();
  const Box& box = print->choice.window.box;
  const auto& repeats = print->choice.window.periodic;
  const PoreAnalysis& inspection = print->inspection;
  summary.results.emplace_back(
      "void",
      fmt::format("{:.2f} % of {:.3f} x {:.3f} x {:.3f} mm in the middle{}; connected {}", 100 * print->pores.porosity.total(),
                  mm(box.width()), mm(box.depth()), mm(box.height()),
                  repeats[0] && repeats[1] && repeats[2] ? ", which repeat" : "", connected_text(inspection.connected)));
  std::string paths = fmt::format("surface {:.2f} mm2 a mm3", print->pores.surface_per_mm);
  for (std::size_t a = 0; a < 3; ++a) {
    paths += inspection.paths[a].reached == 0 ? fmt::format("; nothing leads along {}", "xyz"[a])
                                              : fmt::format("; along {} ways {:.3f} times as long, throat {:.3f} mm", "xyz"[a],
                                                            inspection.paths[a].mean, inspection.throat_mm[a]);
  }
  summary.results.emplace_back("ways", std::move(paths));
  const pores::PoreSizes& sizes = inspection.sections.sizes;
  if (!sizes.pores.empty()) {
    summary.results.emplace_back("widths", histogram_line(histogram(sizes, false)));
    summary.results.emplace_back("lengths", histogram_line(histogram(sizes, true)));
  }
  summary.facts["deposited"] = as_json(*print);
}

}  // namespace lamina::pipeline
