// stages/support/io/temporary.h: files that grow until they take their name, and who may write them.
//
// NAME.lamina-XXXXXXXXXXXXX.part  a temporary file next to NAME, of an unpredictable name
// NAME.part                       a part that an interrupted run leaves for the next one to continue
//
// Both are created exclusively, never through a link, and locked as long as they grow. A lock ends with its process: an
// unlocked temporary file is what a killed run left, and the next run that writes NAME removes it. File systems without
// locks have one writer at a time by agreement; files stay whole even there, because no two temporary files are the same.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <system_error>
#include <vector>

#include "stages/data/status.h"

namespace lamina {

/// NAME.part
std::string part_of(const std::string& file);

/// The name without the ending of a temporary file, or "" if it is of no temporary file.
std::string_view named_by_temporary(std::string_view name);

/// A name of a temporary file of this one. cost  no system call
std::string temporary_name(const std::string& target);

struct Temporary {
  int file = -1;  // to be written
  std::string name;
};

/// path    for errors
/// lock    held until the descriptor is closed; without it, the caller has a Claim and removes what killed runs left
/// errors  kOutput: the system's reason; another run writes the same file
/// cost    locked: reads the names in the folder
Result<Temporary> create_temporary(const std::string& path, const std::string& target, bool lock);

/// Creates NAME.part and locks it; one that a killed run left is removed first.
/// errors  as create_temporary; a link or no file is in its place
Result<int> create_part(const std::string& path, const std::string& part);

/// Opens and locks a NAME.part of at least `size` bytes.
/// errors  as create_part; it is absent or shorter
Result<int> take_part(const std::string& path, const std::string& part, std::uint64_t size);

/// Holds a file, or the directory whose manifest it is, from before anything in it is examined, removed or written: of two
/// runs that begin in the same instant one is refused. NAME.part is the lock; it is made, empty, if it is absent.
class Claim {
 public:
  /// reported  named by errors
  /// errors  as create_part
  static Result<Claim> take(const std::string& path, const std::string& reported);
  Claim(Claim&&) noexcept;
  Claim& operator=(Claim&&) = delete;
  /// Lets go. Removes a NAME.part that is of claims only and that nothing has replaced.
  ~Claim();

  /// Whether NAME.part was there before; an empty one is what a claim of a killed run left.
  bool found() const;
  /// NAME.part is about to be replaced by a file that is locked too, and belongs to that file from now on.
  void hand_over();

 private:
  struct State;
  explicit Claim(std::unique_ptr<State> state);
  std::unique_ptr<State> state_;
};

/// Changes nothing. errors  kOutput if another run writes this file
Status check_not_being_written(const std::string& path);

/// Removes what killed runs left of files in a folder: temporary files without a lock.
/// is_of  says which, by the name of the file that they were to become; no run writes such files without locks
void remove_leftovers(const std::string& folder, const std::function<bool(std::string_view)>& is_of);

// --- what must not stay behind: temporary files at a signal, folders of a job that is
// refused, and what could not be removed.

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

}  // namespace lamina
