// pipeline/job/fill.h: how layers are to be filled, as a job says it: section [fill], and fill of a [[part]].
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "pipeline/text/key_form.h"
#include "stages/infill/parameters.h"

namespace lamina::pipeline {

/// The keys of one filling, lengths in mm, angles in degrees. Lists are taken in turn.
struct FillSettings {
  infill::Pattern pattern = infill::Pattern::kNone;
  double width_mm = 0.4;
  double wall_width_mm = 0;  // 0: like width_mm
  std::uint32_t walls = 0;
  std::uint32_t loops = 1;
  double angle_deg = 45, angle_step_deg = 90;
  std::uint32_t build_layers = 1;
  std::vector<double> gap_mm{0};
  std::vector<double> distance_mm;
  std::uint32_t group = 1;
  std::string gap_by_height;  // "0:0.75, 6:0.1, 12:0.75"
  std::string gap_formula;
  std::vector<double> stagger_mm{0};
  bool stagger_every_layer = false;
  std::optional<double> first_line_mm, end_inset_mm, link_mm;
  double shortest_mm = 0;
  double cell_mm = 2;
};

/// Section [fill].
struct FillRequest {
  FillSettings all;
  std::string by_height;  // "2.7:3 gap_mm=0 angle_deg=90; 5.7:6 pattern=contour": other keys from one height to another
};

/// One key of a filling.
struct FillKey {
  std::string_view name, flag, value, meaning;
  std::string (*read)(std::string_view text, FillSettings& settings);
  std::string (*write)(const FillSettings& settings);
  KeyForm form;
};
std::span<const FillKey> fill_settings_keys();

/// Sets keys from "gap_mm=0 angle_deg=90". What these say of the distances between lines takes the place of what held
/// before. returns "" or what is wrong
std::string read_fill_changes(std::string_view text, FillSettings& settings);

/// The keys that say how far lines lie from each other and are not as they are without being set; at most one of
/// distance_mm, gap_formula, gap_by_height and gap_mm can hold.
std::vector<std::string_view> distance_keys(const FillSettings& settings);

}  // namespace lamina::pipeline
