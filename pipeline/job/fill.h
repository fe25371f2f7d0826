// pipeline/job/fill.h: how layers are to be filled, as a job says it: section [fill], and fill of a [[part]].
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "pipeline/text/changes.h"
#include "stages/infill/parameters.h"

namespace lamina::pipeline {

struct Place;
struct TomlValue;
template <class Target>
struct Key;

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
  std::vector<std::array<double, 2>> gap_by_height;  // height above the part's bottom, increasing, and gap
  std::string gap_formula;
  std::vector<double> stagger_mm{0};
  bool stagger_every_layer = false;
  std::optional<double> first_line_mm, end_inset_mm, link_mm;
  double shortest_mm = 0;
  double cell_mm = 2;
};

using FillChanges = Changes<FillSettings>;
using FillRange = Range<FillSettings>;

/// Section [fill].
struct FillRequest {
  FillSettings all;
  std::vector<FillRange> ranges;  // none overlaps another
};

/// The keys of one filling, in the order of a job file.
std::span<const Key<FillSettings>> fill_settings_keys();

/// Reads a table of keys. At most one of them may say how far lines lie from each other. returns "" or what is wrong
std::string read_fill_changes(const TomlValue& table, FillChanges& changes, Place& at);
std::string fill_changes_text(const FillChanges& changes);

/// Sets the keys of changes. What these say of the distances between lines takes the place of what held before.
void apply(const FillChanges& changes, FillSettings& settings);

/// Gives changes the distances between lines.
void set_distances(const std::vector<double>& distance_mm, FillChanges& changes);

/// Whether any layer gets walls or a filling by these settings.
bool fills(const FillSettings& settings);

/// The keys that say how far lines lie from each other and are not as they are without being set; at most one of
/// distance_mm, gap_formula, gap_by_height and gap_mm can hold.
std::vector<std::string_view> distance_keys(const FillSettings& settings);
/// The same of changes: those that are set, whatever to.
std::vector<std::string_view> distance_keys(const FillChanges& changes);

}  // namespace lamina::pipeline
