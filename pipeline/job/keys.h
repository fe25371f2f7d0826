// pipeline/job/keys.h: every key of a job file, once: its name, its flag, how it is read and how it is written.
//
// Options (cli/keys.h), job files, --set, --save-job, manifests and the help are made from these two tables.
#pragma once

#include <span>
#include <string_view>

#include "pipeline/job/job.h"
#include "stages/data/choices.h"
#include "stages/text/key.h"

namespace lamina::pipeline {

using JobKey = Key<Job>;
using PartKey = Key<PartRequest>;

/// The products that a key decides: two jobs that differ there are different jobs.
namespace decides {
inline constexpr unsigned images = bit(Product::kImages), contours = bit(Product::kContours), moves = bit(Product::kMoves);
inline constexpr unsigned all = images | contours | moves;
}  // namespace decides

/// All keys of a job, the groups below one after the other; keys of a section stand together.
std::span<const JobKey> job_keys();
std::span<const PartKey> part_keys();

// --- the groups, one file each: job/<group>.cpp
std::span<const JobKey> bed_keys();
std::span<const JobKey> heights_keys();
std::span<const JobKey> place_keys();
std::span<const JobKey> image_keys();
std::span<const JobKey> slice_keys();
std::span<const JobKey> fill_keys();
std::span<const JobKey> extrude_keys();
std::span<const JobKey> segment_keys();
std::span<const JobKey> load_keys();
std::span<const JobKey> machine_keys();
std::span<const JobKey> dose_keys();
std::span<const JobKey> run_keys();

// --- tables inside of sections
std::span<const Key<FillSettings>> fill_settings_keys();
std::span<const Key<SegmentSettings>> segment_settings_keys();

/// Reads a table of keys of a filling. At most one of them may say how far lines lie from each other.
/// returns "" or what is wrong; at  where
std::string read_fill_changes(const TomlValue& table, FillChanges& changes, Place& at);
std::string fill_changes_text(const FillChanges& changes);

/// An array of tables { from_mm, to_mm, material }. returns "" or what is wrong; at  where
std::string read_material_ranges(const TomlValue& list, std::vector<MaterialRange>& ranges, Place& at);
std::string material_ranges_text(const std::vector<MaterialRange>& ranges);

/// Words that --fill of lamina extrude takes beside those of fill.pattern.
std::string read_fill_rule(std::string_view text, FillRule& rule);

}  // namespace lamina::pipeline
