// pipeline/job/fill.h: the filling settings of a job: section [fill], and key fill of a [[part]].
#pragma once

#include <string_view>
#include <vector>

#include "stages/infill/settings.h"
#include "stages/support/text/changes.h"

namespace lamina::pipeline {

/// The keys of one filling.
using FillSettings = infill::FillSettings;
using FillChanges = Changes<FillSettings>;
using FillRange = Range<FillSettings>;

/// Section [fill].
struct FillRequest {
  FillSettings all;
  std::vector<FillRange> ranges;  // none overlaps another
};

/// Sets the changed keys. A changed distance between lines replaces every earlier setting of that distance.
void apply(const FillChanges& changes, FillSettings& settings);

/// Sets the distances between lines in `changes`.
void set_distances(const std::vector<double>& distance_mm, FillChanges& changes);

/// Whether these settings produce walls or a filling in any layer.
bool fills(const FillSettings& settings);

/// The keys for the distance between lines whose values differ from their defaults; at most one of distance_mm,
/// gap_formula, gap_by_height and gap_mm is valid.
std::vector<std::string_view> distance_keys(const FillSettings& settings);
/// The same for changes: every key that is set, to any value.
std::vector<std::string_view> distance_keys(const FillChanges& changes);

}  // namespace lamina::pipeline
