// pipeline/report/heights_study.h: layer tables and their effect on the surface, as text, CSV, JSON and plot.
#pragma once

#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "stages/checks/overhang_tally.h"
#include "stages/data/mesh.h"
#include "stages/data/plot.h"
#include "stages/heights/evaluate.h"

namespace lamina::pipeline {

/// Settings of layers for messages: "of 0.05 mm", "of 0.05..0.3 mm, optimal, steps up to 0.1 mm".
std::string text_of(const heights::Settings& settings, double layer_mm);

/// The peaks that were passed over, as "2 heights with horizontal facets ..."; empty if there are none.
std::string small_peaks_text(const heights::Plan& plan, double min_flat_mm2);

/// Facts about the parts, in addition to their studies.
struct StudiedParts {
  std::vector<std::string> paths;  // of each part
  std::int64_t height = 0;         // nm, of all
  std::string way;                 // how layers are decided: "of 0.1..0.3 mm, optimal"
  double cusp_limit_mm = 0;
  std::vector<checks::OverhangTally> overhangs;  // of each table; empty if they are not sliced
  double support_angle_deg = 0;
};

/// The reason for a layer; "given" for a given table.
std::string_view reason(const heights::Study& study, std::size_t layer);
/// Degrees: the slope that decided the layer, or else the flattest slope in it.
double angle(const heights::Study& study, std::size_t layer);

std::string study_page(const StudiedParts& parts, const heights::Study& study);
/// The layers of all studies in sequence; the first column names the study.
std::string study_csv(const StudiedParts& parts, const std::vector<heights::Study>& studies);
/// One JSON object on a line.
std::string study_json(const StudiedParts& parts, const std::vector<heights::Study>& studies);
/// One line per study.
std::string comparison_page(const StudiedParts& parts, const std::vector<heights::Study>& studies);

/// title  of the parts
/// errors  none
/// cost  O(triangles * rows they span + layers)
Plot draw_study(const std::string& title, std::span<const Mesh> meshes, std::span<const Instance> instances,
                const heights::Study& study);

}  // namespace lamina::pipeline
