// pipeline/watch/settings.h: how the parts of a folder are planned: from the options, and from the watch.toml of folders.
#pragma once

#include <string>
#include <vector>

#include "pipeline/batch/job.h"
#include "stages/data/status.h"

namespace lamina::pipeline {

inline constexpr const char* kWatchFile = "watch.toml";

/// Of a folder and the folders below it.
struct FolderSettings {
  std::vector<std::string> with;  // command and options for parts
  std::string then;               // shell command after each job; "": none
  double settle_seconds = 2;
  std::string output;  // directory of results
  std::string folder;  // whose name is left out of those of results, relative to the watched folder
};

/// The absolute path, without "." and ".."; "" of "".
std::string full_path(const std::string& path);

/// Checks a command for parts. errors  kUsage: no command, wrong options, a command or option that a watched folder cannot have
Status check_with(const std::vector<std::string>& with, const ReadCall& read);

/// Refuses an output below the watched folder, or above it. errors  kUsage
Status check_output(const std::string& output, const std::string& root);

/// Reads the watch.toml of a folder: with, then, settle_s and output, which is relative to the file; other settings stay.
/// The file runs commands: it must belong to the user of this process or to root, and be writable by no one else.
/// errors  kUsage, one line: file, line, key, reason
Status read_watch_file(const std::string& path, const std::string& root, const ReadCall& read, FolderSettings& settings);

}  // namespace lamina::pipeline
