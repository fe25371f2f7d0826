// pipeline/output/directory.h: checks and clears a job's directory before a run.
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

/// A manifest in a job's directory, as identified by its name.
struct ManifestFile {
  std::string name;                                   // in the directory
  bool partial = false;                               // ends in .part: an unfinished run
  std::optional<std::array<std::uint32_t, 2>> shard;  // i of n, i from 0
};

/// Name of a job's manifest in its directory of images: manifest.json, or manifest-<i>-of-<n>.json for a shard.
std::string manifest_name(const Job& job);

/// All manifests of a directory, the whole job's first, then by shard; empty if the directory is missing.
std::vector<ManifestFile> find_manifests(const std::string& directory);

/// Parses the name of a layer's file: 000042.tif, 000042-bronze.tif, or either with .part; false for other names.
bool read_layer_file_name(std::string_view name, std::uint32_t& index, bool& partial);
/// The same for the print program of a layer, 000042.gcode.
bool read_program_file_name(std::string_view name, std::uint32_t& index, bool& partial);

/// Checks that a job may write into its directory. Changes nothing, so that it can run before parts are loaded.
///
/// errors  kUsage if layers of an earlier run exist without --resume or --overwrite; a shard may join the other shards
///         of the same split. kOutput if the directory's path is a file, or another run is writing into it
Status check_output(const Job& job);

/// Fails if another run took the directory while this one loaded its parts. errors  kUsage, kOutput
Status check_nobody_came(const Job& job);

/// Fails if a shard's own manifest belongs to another job: a shard keeps all other layers and cannot distinguish other
/// shards' layers from an earlier job's, so the user must clear the directory.
/// errors  kUsage
Status check_shard_replaces_itself(const Job& job, const ManifestHead& head);

/// Call after check_output. Creates the directory and its layers/. With --overwrite, removes the output of an earlier job
/// (a shard: only its own manifest), otherwise the half-written files of an interrupted run.
/// errors  those of check_nobody_came; kOutput with the system's reason
Status prepare_output(const Job& job);

/// Removes half-written files of the layers [first, last), left by a killed run, from directory/layers.
void sweep_partial_files(const std::string& directory, std::uint32_t first = 0, std::uint32_t last = UINT32_MAX);

}  // namespace lamina::pipeline
