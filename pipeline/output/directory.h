// pipeline/output/directory.h: checks and clears a job's directory before a run.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "pipeline/job/job.h"
#include "pipeline/manifest/layer_files.h"
#include "pipeline/manifest/manifest.h"
#include "pipeline/plan/plan.h"
#include "stages/data/status.h"
#include "stages/support/io/file.h"
#include "stages/support/io/temporary.h"

namespace lamina::pipeline {

/// Name of a job's manifest in its directory of images: manifest.json, or manifest-<i>-of-<n>.json for a shard.
std::string manifest_name(const Job& job);

/// Checks that a job may write into its directory. Changes nothing, so that it can run before parts are loaded.
///
/// errors  kUsage if layers of an earlier run exist without --resume or --overwrite; a shard may join the other shards
///         of the same split. kOutput if the directory's path is a file, or another run is writing into it
Status check_output(const Job& job);

/// Where the files of a folder of the job, layers or program, wait until all are there. A job that claims the directory removes
/// what a killed run left in it.
std::string waiting_folder(const Job& job, std::string_view folder);

/// Whether an output directory is there. errors  kOutput if its path is a file, or it cannot be made
Result<bool> is_directory(const Job& job);

/// Creates the directory and claims it for the rest of the run, or for the job's shard of it. Fails if another run took it
/// while this one loaded its parts. errors  kUsage, kOutput
Result<Claim> claim_output(const Job& job, MadeFolders& made);

/// Removes the manifests of earlier jobs, but for those of other shards and the claimed one. errors  kOutput
Status remove_manifests(const Job& job);

/// Fails if a manifest in a shard's directory belongs to another job. Of its own: a shard keeps all other layers and cannot
/// distinguish other shards' layers from an earlier job's, so the user must clear the directory. Of another shard: the two
/// would never be merged.
/// errors  kUsage; those of read_manifest for a finished manifest
Status check_shard_fits(const Job& job, const ManifestHead& head);

/// Call after check_output. Claims the directory and creates its layers/. With --overwrite, removes the output of an
/// earlier job (a shard: only its own manifest), otherwise only the half-written files of an interrupted run.
/// errors  those of claim_output; kOutput with the system's reason
Result<Claim> prepare_output(const Job& job, MadeFolders& made);

/// Some layers of a job, [first, last).
struct LayersOfJob {
  const ManifestHead* head;
  std::uint32_t first, last;
};

/// The files in layers/ and program/ of a directory, by name, that none of the jobs writes for those layers.
std::vector<std::string> stray_files(const std::string& directory, std::span<const LayersOfJob> jobs);

/// Fails if files in layers/ or program/ are not of the job: all but half-written ones, or only those named like layers,
/// programs and their frames. errors  kUsage, with the first file
Status check_no_strays(const std::string& directory, const LayersOfJob& job, bool all);

/// How a layer's file is written in a claimed directory.
FileOptions layer_file_options(const Job& job);

// --- finds the intact layers of an interrupted job.

/// Reads a manifest (finished or partial) and hashes the files it names.
///
/// directory  of the files; a container too
/// finished   path of the finished manifest
/// returns  the records, in layer order, of complete and unchanged files; empty without a manifest
/// errors   kUsage if the manifest belongs to another job (names the key that differs) or covers layers outside this run
/// cost     reads every finished file once, in parallel
Result<std::vector<LayerRecord>> layers_that_hold(const std::string& directory, const std::string& finished,
                                                  const ManifestHead& head);

// --- the manifest keys common to all products.

/// The manifest head of a plan, without product-specific keys.
ManifestHead plan_head(const Plan& plan);

}  // namespace lamina::pipeline
