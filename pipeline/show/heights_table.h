// pipeline/show/heights_table.h: layers and what they do to the surface, as text, CSV, JSON and .rp3.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "pipeline/show/heights_study.h"
#include "stages/write/rp3/rp3.h"

namespace lamina::pipeline {

std::string heights_page(const Job& job, const Scene& scene, const HeightsStudy& study);
/// The layers of all studies, one after the other; the first column names the study.
std::string heights_csv(const Scene& scene, const std::vector<HeightsStudy>& studies);
nlohmann::ordered_json heights_json(const Job& job, const Scene& scene, const std::vector<HeightsStudy>& studies);
std::string heights_rp3(const HeightsStudy& study, const write::rp3::Settings& settings);
/// One line a study.
std::string comparison_page(const std::vector<HeightsStudy>& studies);

}  // namespace lamina::pipeline
