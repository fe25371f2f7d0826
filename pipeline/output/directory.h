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
#include "stages/write/file.h"
#include "stages/write/leftovers.h"
#include "stages/write/manifest/manifest.h"
#include "stages/write/temporary.h"

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

/// Takes the index off a layer's file name: the digits that lamina writes, 000042 or 1234567; false for other names.
bool take_layer_index(std::string_view& name, std::uint32_t& index);
/// Parses the name of a layer's file: 000042.tif, 000042-bronze.tif, or of a temporary file of one; false for others.
bool read_layer_file_name(std::string_view name, std::uint32_t& index, bool& partial);
/// The same for the print program of a layer, 000042.gcode.
bool read_program_file_name(std::string_view name, std::uint32_t& index, bool& partial);

/// Checks that a job may write into its directory. Changes nothing, so that it can run before parts are loaded.
///
/// errors  kUsage if layers of an earlier run exist without --resume or --overwrite; a shard may join the other shards
///         of the same split. kOutput if the directory's path is a file, or another run is writing into it
Status check_output(const Job& job);

/// Whether layers or print programs are there, whosever they are.
bool holds_layers(const std::string& directory);

/// Whether an output directory is there. errors  kOutput if its path is a file
Result<bool> is_directory(const std::string& output);

/// Creates the directory and claims it for the rest of the run, or for the job's shard of it. Fails if another run took it
/// while this one loaded its parts. errors  kUsage, kOutput
Result<write::Claim> claim_output(const Job& job, write::MadeFolders& made);

/// Fails if a manifest in a shard's directory belongs to another job. Of its own: a shard keeps all other layers and cannot
/// distinguish other shards' layers from an earlier job's, so the user must clear the directory. Of another shard: the two
/// would never be merged.
/// errors  kUsage; those of read_manifest for a finished manifest
Status check_shard_fits(const Job& job, const ManifestHead& head);

/// Fails if layers/ or program/ of a job's directory is a link that leads out of it.
/// errors  kOutput
Status check_stays_inside(const std::string& directory);

/// Call after check_output. Claims the directory and creates its layers/. With --overwrite, removes the output of an
/// earlier job (a shard: only its own manifest), otherwise only the half-written files of an interrupted run.
/// errors  those of claim_output; kOutput with the system's reason
Result<write::Claim> prepare_output(const Job& job, write::MadeFolders& made);

/// How a layer's file is written in a claimed directory.
write::FileOptions layer_file_options(const Job& job);

/// Removes all layers and print programs of a directory; its folders stay.
/// errors  kOutput with the system's reason
Status remove_layers(const std::string& directory);

/// Removes half-written files of the layers [first, last), left by a killed run, from directory/layers.
void sweep_partial_files(const std::string& directory, std::uint32_t first = 0, std::uint32_t last = UINT32_MAX);

}  // namespace lamina::pipeline
