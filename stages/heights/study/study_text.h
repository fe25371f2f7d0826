// stages/heights/study/study_text.h: layers and their effect on the surface, as text, CSV and JSON.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "stages/heights/study/study.h"

namespace lamina::heights {

/// Facts about the parts, in addition to their studies.
struct StudiedParts {
  std::vector<std::string> paths;  // of each part
  std::int64_t height = 0;         // nm, of all
  std::string way;                 // how layers are decided: "of 0.1..0.3 mm, optimal"
  double cusp_limit_mm = 0;
};

/// The reason for a layer; "given" for a given table.
std::string_view reason(const Study& study, std::size_t layer);
/// Degrees: the slope that decided the layer, or else the flattest slope in it.
double angle(const Study& study, std::size_t layer);

std::string study_page(const StudiedParts& parts, const Study& study);
/// The layers of all studies in sequence; the first column names the study.
std::string study_csv(const StudiedParts& parts, const std::vector<Study>& studies);
/// One JSON object on a line.
std::string study_json(const StudiedParts& parts, const std::vector<Study>& studies);
/// One line per study.
std::string comparison_page(const std::vector<Study>& studies);

}  // namespace lamina::heights
