// pipeline/manifest/layer_files.h: names of the files in a job's directory, and finding and removing them.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "stages/data/status.h"

namespace lamina {

/// A manifest in a job's directory, as identified by its name.
struct ManifestFile {
  std::string name;                                   // in the directory
  bool partial = false;                               // ends in .part: an unfinished run
  std::optional<std::array<std::uint32_t, 2>> shard;  // i of n, i from 0
};

/// All manifests of a directory, the whole job's first, then by shard; empty if the directory is missing.
std::vector<ManifestFile> find_manifests(const std::string& directory);

/// Whether a file, there or not, is or would be one of a job's directory: a manifest, layers.tif, or anything in layers/ or program/. Names
/// are followed through links.
bool lies_in_job(const std::string& file, const std::string& directory);

/// Takes the index off a layer's file name: the digits that lamina writes, 000042 or 1234567; false for other names.
bool take_layer_index(std::string_view& name, std::uint32_t& index);
/// Parses the name of a layer's file: 000042.tif, 000042-bronze.tif, or of a temporary file of one; false for others.
bool read_layer_file_name(std::string_view name, std::uint32_t& index, bool& partial);
/// The same for the print program of a layer, 000042.gcode.
bool read_program_file_name(std::string_view name, std::uint32_t& index, bool& partial);

/// Whether a file in a job's directory, program/000042.gcode, has the name of a layer, a program or its frame of any job.
bool is_job_file_name(const std::filesystem::path& name);

/// Layers and print programs of any earlier job, half-written ones too.
std::vector<std::filesystem::path> layer_files(const std::string& directory);
/// Whether such or other files of programs are there, whosever they are.
bool holds_layers(const std::string& directory);

/// Fails if layers/ or program/ of a job's directory is a link that leads out of it.
/// errors  kOutput
Status check_stays_inside(const std::string& directory);

/// Removes all layers and print programs of a directory, in folders or in pages; its folders stay.
/// errors  kOutput with the system's reason
Status remove_layers(const std::string& directory);

/// Removes half-written files of the layers [first, last), left by a killed run, from directory/layers.
void sweep_partial_files(const std::string& directory, std::uint32_t first = 0, std::uint32_t last = UINT32_MAX);

}  // namespace lamina
