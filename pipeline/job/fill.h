// pipeline/job/fill.h: how layers are to be filled, as a job says it: section [fill], and fill of a [[part]].
#pragma once

#include <string_view>
#include <vector>

#include "stages/infill/settings.h"
#include "stages/text/changes.h"

namespace lamina::pipeline {

/// The keys of one filling.
using FillSettings = infill::Settings;
using FillChanges = Changes<FillSettings>;
using FillRange = Range<FillSettings>;

/// Section [fill].
struct FillRequest {
  FillSettings all;
  std::vector<FillRange> ranges;  // none overlaps another
};

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
