// pipeline/output/directory.h: what may lie in a job's directory before it runs, and what it is cleared of.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "pipeline/job/job.h"
#include "stages/data/status.h"
#include "stages/write/manifest/manifest.h"

namespace lamina::pipeline {

/// A manifest in a job's directory, by its name.
struct ManifestFile {
  std::string name;                                   // in the directory
  bool partial = false;                               // ends in .part: a run that has not finished
  std::optional<std::array<std::uint32_t, 2>> shard;  // i of n, i from 0
};

/// Name of a job's manifest in its directory of images: manifest.json, or manifest-<i>-of-<n>.json for a shard.
std::string manifest_name(const Job& job);

/// All manifests of a directory, the whole job's first, then by shard; none if there is no such directory.
std::vector<ManifestFile> find_manifests(const std::string& directory);

/// Reads the name of a layer's file, 000042.tif, 000042-bronze.tif or either with .part; false if it is none.
bool read_layer_file_name(std::string_view name, std::uint32_t& index, bool& partial);
/// The same for the print program of a layer, 000042.gcode.
bool read_program_file_name(std::string_view name, std::uint32_t& index, bool& partial);

/// Whether a job may write into its directory: nothing is touched, so that a refusal comes before parts are loaded.
///
/// errors  kUsage if layers of an earlier run are there and neither --resume nor --overwrite is asked for; a shard may
///         join the other shards of the same split. kOutput if a file stands in place of the directory, or
///         another run writes into it right now
Status check_output(const Job& job);

/// Whether another run took the directory while this one loaded its parts. errors  kUsage, kOutput
Status check_nobody_came(const Job& job);

/// A shard leaves the layers of other shards alone, and cannot tell them from those of an earlier job: where its own
/// manifest is of another job, the directory has to be cleared first.
/// errors  kUsage
Status check_shard_replaces_itself(const Job& job, const ManifestHead& head);

/// After check_output: creates the directory and its layers/, and clears it: with --overwrite of all that an earlier
/// job left (a shard: of its own manifest), else of files that an interrupted run left half written.
/// errors  those of check_nobody_came; kOutput with the system's reason
Status prepare_output(const Job& job);

/// Removes half-written files of the layers [first, last) from directory/layers: what a killed run leaves behind.
void sweep_partial_files(const std::string& directory, std::uint32_t first = 0, std::uint32_t last = UINT32_MAX);

}  // namespace lamina::pipeline
