// pipeline/job/keys.h: the table of all keys of a job file: name, flag, reader and writer.
//
// Options (cli/keys.h), job files, --set, --save-job, manifests and the help are generated from these two tables.
#pragma once

#include <span>
#include <string_view>

#include "pipeline/job/job.h"
#include "stages/data/choices.h"
#include "stages/support/text/key.h"

namespace lamina::pipeline {

using JobKey = Key<Job>;
using PartKey = Key<PartRequest>;

/// The products whose bytes depend on a key: a different value makes a different job.
namespace decides {
inline constexpr unsigned images = bit(Product::kImages), contours = bit(Product::kContours), moves = bit(Product::kMoves);
inline constexpr unsigned all = images | contours | moves;
}  // namespace decides

/// All keys of a job in the order of the groups below; the keys of a section are adjacent.
std::span<const JobKey> job_keys();
std::span<const PartKey> part_keys();

// --- the tables of pipeline/job/fill.cpp
std::span<const JobKey> fill_keys();
std::span<const JobKey> segment_keys();
std::span<const Key<FillSettings>> fill_settings_keys();
std::span<const Key<SegmentSettings>> segment_settings_keys();

/// Reads a table of filling keys. At most one of them may set the distance between lines.
/// returns "" or an error message; at  its place
std::string read_fill_changes(const TomlValue& table, FillChanges& changes, TextPosition& at);
std::string fill_changes_text(const FillChanges& changes);

inline constexpr Limits kBleedUm{-10'000, 10'000, " um", true};
/// Reads a number of per cent or a formula of x, y and z. returns "" or an error message; at  its place
std::string read_saturation(const TomlValue& value, std::optional<Saturation>& percent, TextPosition& at);
std::string saturation_text(const std::optional<Saturation>& percent);
/// Reads an array of tables { from_mm, to_mm, material }. returns "" or an error message; at  its place
std::string read_material_ranges(const TomlValue& list, std::vector<MaterialRange>& ranges, TextPosition& at);
std::string material_ranges_text(const std::vector<MaterialRange>& ranges);
/// Reads a rule for shells that overlap.
std::string read_fill_rule(std::string_view text, FillRule& rule);

}  // namespace lamina::pipeline
