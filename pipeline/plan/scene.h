// pipeline/plan/scene.h: the parts of a job, loaded and standing on the bed.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "pipeline/job/job.h"
#include "stages/data/mesh.h"
#include "stages/data/status.h"
#include "stages/load/load.h"

namespace lamina::pipeline {

/// What the manifest and the summary say of one [[part]].
struct PartSummary {
  std::string path;
  std::uint32_t copies = 1;
  std::uint64_t triangles = 0;  // of the file, once
  std::uint64_t fingerprint = 0;
  Box bounds;  // nm, of the first copy, on the bed
  std::vector<Note> notes;
};

/// Meshes in the coordinates of their file, and instances whose offset brings them into the frame of the bed:
/// x from its left edge, y from its front edge, z from its surface; every coordinate within the bed and within int32.
struct Scene {
  std::vector<Mesh> meshes;
  std::vector<Instance> instances;
  std::vector<PartSummary> parts;
  std::vector<std::uint32_t> part_of_instance;  // index into parts
  std::int64_t height = 0;                      // nm, highest point of all; > 0
};

/// How a part of a job is to be read.
load::LoadOptions load_options(const Job& job, const PartRequest& request);

/// Loads the parts of a job (equal files with equal transforms once) and places them.
///
/// Parts and copies with a given position stand there, copies of them stacked along x by their width and the gap.
/// The others are arranged in rows from the front left, in the order of the job and gap_mm apart, and that block is
/// centred on the bed, all in whole nm.
/// errors  kUsage if a part does not fit the bed (by how much, and what would help); kInput from load
Result<Scene> load_scene(const Job& job);

}  // namespace lamina::pipeline
