// stages/support/io/leftovers.h: what must not stay behind: temporary files at a signal, folders of a job that is
// refused, and what could not be removed.
#pragma once

#include <string>
#include <system_error>
#include <vector>

namespace lamina::write {

/// The folders that a run has made itself.
class MadeFolders {
 public:
  /// Makes a folder and those above it. returns  the system's reason if it cannot
  std::error_code make(const std::string& folder);
  /// Removes those that are empty.
  void take_back();

 private:
  std::vector<std::string> made_;  // the deepest last
};

/// Has a file removed by remove_watched(). name  outlives forget(). returns  for forget(); -1 if too many are watched
int watch(const char* name);
/// Does not return once remove_watched() runs: the name may be in use.
void forget(int watched);
/// Removes all watched files. Call before the process ends without destructors; safe in a signal handler.
void remove_watched();

/// Removes a file, or notes why not. Absent is as good.
void remove_or_note(const std::string& path);
void note_left_behind(const std::string& path, int reason);
/// One line for each file that could not be removed, since the last call; from any thread.
std::vector<std::string> take_left_behind();

}  // namespace lamina::write
