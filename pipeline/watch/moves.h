// pipeline/watch/moves.h: gives results and planned parts their final names; nothing is overwritten.
#pragma once

#include <optional>
#include <string>
#include <system_error>

#include "pipeline/watch/record.h"
#include "stages/data/status.h"

namespace lamina::pipeline {

/// The endings of a part or job file: ".stl.gz", ".toml".
std::string endings_of(const std::string& path);

/// Moves a file into a folder, under its relative name, or the first free of NAME-2, NAME-3, ... To another file system it is
/// copied, synced and removed; an equal copy that a killed run left counts.
/// returns  its new path; nothing if it is no longer the file of the input, which then stays
/// errors   kOutput with the system's reason
Result<std::optional<std::string>> move_input(const std::string& from, const WatchedInput& input, const std::string& folder);

/// Where an earlier run moved an input to, by its stamp, else by its content; nothing if it is not in the folder.
std::optional<std::string> find_moved(const WatchedInput& input, const std::string& folder);

/// A free name for the result of a job, or for its error: root/NAME, else NAME-2, ... Sets job.stem.
void choose_stem(WatchedJob& job);

/// The final path of the result, of the error of a failed job, or "".
std::string result_path(const WatchedJob& job);

/// Whether the result of a planned job is neither in its work folder nor at its name: the output directory was replaced.
bool is_lost(const WatchedJob& job);

/// Moves the result of a planned job from its work folder to its name, or writes its error, and removes the work folder. May be
/// repeated after a kill.
/// again    records the job once more, when its name was taken meanwhile
/// errors   kOutput; of `again`
Status publish(WatchedJob& job, const std::function<Status(const WatchedJob&)>& again);

/// Makes a folder for unfinished work, while others are removed. returns  the system's reason if it cannot
std::error_code make_work(const std::string& work);
/// Removes a folder of unfinished work, and the folder of these if it is empty.
void remove_work(const std::string& work);

}  // namespace lamina::pipeline
