// stages/heights/study/study_text.h: layers and what they do to the surface, as text, CSV and JSON.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "stages/heights/study/study.h"

namespace lamina::heights {

/// What is told of the parts beside their studies.
struct StudiedParts {
  std::vector<std::string> paths;  // of each part
  std::int64_t height = 0;         // nm, of all
  std::string way;                 // how layers are decided: "of 0.1..0.3 mm, optimal"
  double cusp_limit_mm = 0;
};

/// "given" for somebody else's layers.
std::string_view reason(const Study& study, std::size_t layer);
/// Degrees: the slope that the layer looked at when it was decided, or else the flattest one in it.
double angle(const Study& study, std::size_t layer);

std::string study_page(const StudiedParts& parts, const Study& study);
/// The layers of all studies, one after the other; the first column names the study.
std::string study_csv(const StudiedParts& parts, const std::vector<Study>& studies);
/// One JSON object on a line.
std::string study_json(const StudiedParts& parts, const std::vector<Study>& studies);
/// One line a study.
std::string comparison_page(const std::vector<Study>& studies);

}  // namespace lamina::heights
