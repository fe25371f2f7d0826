// pipeline/manifest/compare.h: compares a job's files with its manifest.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "pipeline/manifest/manifest.h"
#include "stages/data/status.h"
#include "stages/support/hash/hash.h"

namespace lamina {

/// A message that begins with a file's path, beginning with its name in the directory instead.
std::string in_directory(const std::string& message, const std::string& path, const std::string& name);

/// "", or how the content of a file of the directory differs from its record, as in "NAME: is missing".
/// cost  reads the file once
std::string fault_of_file(const std::string& directory, const std::string& name, const Hash128& hash,
                          std::optional<std::uint64_t> bytes = {});

/// "", or how the shares of a layer's parts do not come to what the layer has, as in "layer 3: its parts ...".
std::string fault_of_shares(const ManifestHead& head, const LayerRecord& record);

/// "", or how a layer of a job of one powder says that pixels lie in another one.
std::string fault_of_one_powder(const LayerRecord& record);

/// Refuses to distinguish several parts if kept layers do not state the part of their pixels. errors  kUsage
Status check_shares_known(const ManifestHead& head, const std::vector<LayerRecord>& kept);

/// Compares contours or toolpaths with their manifest: hash of each layer, in the single file or in per-layer files;
/// layers without gaps; hash of the whole single file; no other layers in layers/.
///
/// directory  of the single file, or of layers/
/// returns    bytes of the files
/// cost       reads every file once, a single file of all layers twice
std::uint64_t compare_paths(const std::string& directory, const Manifest& manifest, Faults& faults);

/// The manifest of a share of a job.
struct ShardRange {
  std::string name;                    // of its file
  std::array<std::uint32_t, 2> shard;  // i of n, i from 0
  std::uint32_t first_layer = 0, last_layer = 0;
};
/// Faults for the shares that are missing. shards  in order, not empty; layers  of the job
void check_shards(const std::vector<ShardRange>& shards, std::uint32_t layers, Faults& faults);

}  // namespace lamina
