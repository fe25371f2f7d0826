// pipeline/job/file.h: jobs as TOML files, and their canonical text for the manifest.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "pipeline/job/job.h"
#include "stages/data/choices.h"
#include "stages/data/status.h"

namespace lamina {
class File;
}  // namespace lamina

namespace lamina::pipeline {

/// Reads a job file into `job`: keys absent from the file keep their values; its parts replace the job's.
/// Relative paths (of parts, profiles, presets and of the output) are relative to the file.
/// errors  kUsage, one line: file, line, column, key, reason. The job is then undefined.
Status read_job(const std::string& path, Job& job);

/// The same for the text of a job file, such as the one in a manifest; `path` is its nominal location.
Status read_job_text(std::string_view text, const std::string& path, Job& job);

/// Sets one key from "section.key=value". part.key sets it for every part, part.2.key for the second one.
/// errors  kUsage, one line that begins with the assignment
Status set_key(Job& job, std::string_view assignment);

/// A key of a job file or of one of its parts, for documentation.
struct KeyFacts {
  std::string name, flag, value, preset, meaning;  // "bed.dpi", "--dpi", "DPI|XxY", "1200", ...
  bool decides_images = false;                     // whether the images depend on it
};
/// Every key, those of parts last.
std::vector<KeyFacts> key_facts();

/// The whole job as TOML. Paths below `directory` are written relative to it, others absolute; all unchanged if
/// `directory` is empty.
std::string job_text(const Job& job, const std::string& directory);

/// Only the keys that decide the bytes of a product, parts and profiles by their file names. Equal jobs give equal texts,
/// independent of host and source.
std::string canonical_job_text(const Job& job, Product product);

/// Writes the resolved job in a form that read_job restores, with the command that runs it in its first line.
/// errors  kOutput; kUsage if a path is not UTF-8
Status save_job(const std::string& path, const Job& job, std::string_view command = "jet");
/// The same, but the file takes its name when it is finished.
Result<File> write_job(const std::string& path, const Job& job, bool durable, std::string_view command);

}  // namespace lamina::pipeline
