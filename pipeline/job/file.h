// pipeline/job/file.h: jobs as TOML files, and the canonical text that the manifest records.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "pipeline/job/job.h"
#include "stages/data/choices.h"
#include "stages/data/status.h"

namespace lamina::pipeline {

/// Reads a job file over `job`: keys that the file does not name stay as they are; its parts replace the job's.
/// Relative paths in it (of parts, and the output) are relative to the file.
/// Old forms are read too, and told in job.notes.
/// errors  kUsage, one line: file, line, column, key, what is wrong. The job is then undefined.
Status read_job(const std::string& path, Job& job);

/// The same for the text of a job file, as one that a manifest records; `path` is where it would lie.
Status read_job_text(std::string_view text, const std::string& path, Job& job);

/// Sets one key from "section.key=value". part.key sets it for every part, part.2.key for the second one.
/// errors  kUsage, one line that begins with the assignment
Status set_key(Job& job, std::string_view assignment);

/// A key of a job file or of one of its parts, as people are told of it.
struct KeyFacts {
  std::string name, flag, value, preset, meaning;  // "bed.dpi", "--dpi", "DPI|XxY", "1200", ...
  bool decides_images = false;                     // whether another value gives other images
};
/// Every key, those of parts last.
std::vector<KeyFacts> key_facts();

/// The whole job as a TOML file would say it. Paths are written relative to `directory` where they lie below it, else
/// absolute; as they are if `directory` is empty.
std::string job_text(const Job& job, const std::string& directory);

/// Only what decides the bytes of a product, parts by their file names. The same job gives the same text, wherever it
/// runs and however it was asked for.
std::string canonical_job_text(const Job& job, Product product);

/// Writes the resolved job, so that read_job gives it back. errors  kOutput; kUsage if a path is not UTF-8
Status save_job(const std::string& path, const Job& job);

}  // namespace lamina::pipeline
