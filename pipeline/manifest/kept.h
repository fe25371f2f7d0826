// pipeline/manifest/kept.h: what an interrupted job of contours or toolpaths has on record, and still holds.
//
// Files a layer wait in a folder beside the begun manifest, until all are there. Then manifest.json of an earlier job goes,
// they get their names, and the new manifest.json comes last: whenever a run is killed, one of the two records holds.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "pipeline/manifest/manifest.h"
#include "stages/data/status.h"

namespace lamina {

/// Refuses records of another job, or of other layers. path  of the manifest, for the error. errors  kUsage
Status check_same_job(const std::string& path, const Manifest& manifest, const ManifestHead& head);

/// The records, from the first on, whose bytes are in one file; none if it does not begin with `start`.
/// cost  reads the file once
std::vector<LayerRecord> records_that_hold(const std::string& file, const std::vector<LayerRecord>& recorded,
                                           std::string_view start);

/// What the records of a directory of contours account for.
struct OnRecord {
  bool finished = false, begun = false;  // manifest.json, and the head of its .part, are there
  bool all_made = false;                 // the begun one has all its layers: the job may have given names
  std::vector<std::string> layers;       // files of manifest.json with the folder, sorted as text
};
OnRecord find_on_record(const std::string& directory);
/// Whether a file of layers/ is one of them. name  without the folder
bool is_on_record(const OnRecord& record, std::string_view name);

/// Gives waiting files their places in another folder, which may be there. errors  kOutput
Status take_waiting(const std::string& waiting, const std::string& folder);

/// Checks, before layers are made, that they will get their places: the folder is absent, or can be written. errors  kOutput
Status check_takes_layers(const std::string& folder);

/// What a directory holds of a job that is to be resumed.
struct KeptJob {
  std::vector<LayerRecord> layers;  // from the first on
  bool finished = false;            // all of the job, under its final names
  std::uint64_t bytes = 0;          // of its files
};

/// Of a job with files a layer, with a package or without files. Layers of a run that was killed while they got their names
/// are brought back to `waiting`, and its torn files go. Links are no files of a job.
/// errors  kUsage: the directory belongs to another job; those of read_manifest
/// cost    reads every file once
Result<KeptJob> find_kept_job(const std::string& directory, const std::string& waiting, const ManifestHead& head);

}  // namespace lamina
