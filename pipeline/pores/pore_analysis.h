// pipeline/pores/pore_analysis.h: the pores that toolpaths leave open, analysed without a flow.
#pragma once

#include <array>
#include <functional>
#include <string>

#include "pipeline/pores/predict_flow.h"
#include "pipeline/pores/window_choice.h"
#include "pipeline/report/summary.h"
#include "stages/data/plot.h"
#include "stages/pores/passages.h"
#include "stages/pores/porosity.h"
#include "stages/pores/sizes.h"
#include "stages/support/text/json_value.h"

namespace lamina::pipeline {

/// Pores as sections through the middle of layers show them, over the whole height of a print.
struct LayerSections {
  std::uint32_t layers = 0;         // analysed, evenly spread
  std::array<double, 2> side_mm{};  // of the analysed window, around the middle of the print
  double voxel_um = 0;
  pores::PoreSizes sizes;
};

struct PoreAnalysis {
  pores::Connected connected;                       // of the window
  std::array<double, 3> throat_mm{};                // as in PoreReport
  std::array<pores::Tortuosity, 3> tortuosities{};  // along x, y, z
  LayerSections sections;
};

/// Cuts a window of the print into voxels.
using CutWindow = std::function<Result<VoxelStack>(const Window&)>;

/// window  as cut
/// errors  of cut
/// cost    O(voxels of the window) some twenty times, 12 bytes a voxel; sections: O(runs) of eight slices of 9 mm
Result<PoreAnalysis> analyse_deposited(const formats::GcodeFile& file, const Pile& pile, const VoxelView& window,
                                       const CutWindow& cut);

/// The report of lamina permeability on a window, without the flow: lines that end with LF.
std::string as_text(const PoreAnalysis& analysis);
/// Adds the same to an object.
void add_to(const PoreAnalysis& analysis, Json& json);

/// Whether a file is one of toolpaths, by how its name ends: .gcode, .gco, .g, .nc.
bool names_toolpaths(const std::string& path);

/// All that can be said of a file of toolpaths without options: what repeats in it, in voxels of 10 um or larger ones.
struct PrintAnalysis {
  double fed_mm3 = 0, density_g_cm3 = 0;  // 0: unknown
  std::uint32_t layers = 0;               // with beads
  std::string beads;                      // where their widths come from
  WindowChoice choice;
  PoreReport pores;  // without a flow
  PoreAnalysis analysis;
};
/// density_g_cm3  of the filament; 0: the file's value
/// sections       none, or where a picture of the window goes
/// errors         kInput: no layer above the bed; of GcodeFile::open(), choose_window() and bead_voxels()
/// cost           reads the file, and some twenty of its layers once more; about a second at 8 million voxels
Result<PrintAnalysis> analyse_print(const std::string& path, double density_g_cm3, Plot* sections = nullptr);
std::string as_text(const PrintAnalysis& print);
Json as_json(const PrintAnalysis& print);

/// The same for a page, with sections of the window as SVG; "" of other files, of those above 16 MB, and where nothing can be
/// said.
struct AnalysisPage {
  std::string text, svg;
};
AnalysisPage analysis_page(const std::string& path);

/// Adds four lines and an object "deposited" to the summary of a toolpath job; none for other files and those above
/// 16 MB, of which lamina info reports the same in more than a second.
/// path  of the file
void add_pores(const std::string& path, Summary& summary);

}  // namespace lamina::pipeline
