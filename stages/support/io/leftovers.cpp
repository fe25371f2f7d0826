#include "stages/support/io/leftovers.h"

#include <fmt/format.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <mutex>
#include <utility>

namespace lamina::write {
namespace {

// A signal handler may touch nothing but lock-free atomics.
std::array<std::atomic<const char*>, 1024> watched;
std::atomic<bool> removing{false};
static_assert(std::atomic<const char*>::is_always_lock_free);

std::mutex notes_mutex;
std::vector<std::string> notes;

}  // namespace

std::error_code MadeFolders::make(const std::string& folder) {
  namespace fs = std::filesystem;
  std::error_code error;
  std::vector<std::string> absent;
  for (fs::path place = folder; !place.empty() && !fs::exists(fs::symlink_status(place, error)); place = place.parent_path()) {
    if (place.has_filename()) absent.push_back(place.string());
  }
  fs::create_directories(folder, error);
  if (!error) made_.insert(made_.end(), absent.rbegin(), absent.rend());
  return error;
}

void MadeFolders::take_back() {
  for (; !made_.empty(); made_.pop_back()) ::rmdir(made_.back().c_str());  // fails if something is in it
}

int watch(const char* name) {
  for (std::size_t i = 0; i < watched.size(); ++i) {
    const char* free = nullptr;
    if (watched[i].load(std::memory_order_relaxed) == nullptr && watched[i].compare_exchange_strong(free, name)) {
      return static_cast<int>(i);
    }
  }
  return -1;
}

void forget(int which) {
  if (which < 0) return;
  watched[static_cast<std::size_t>(which)].store(nullptr);
  while (removing) ::pause();  // the process is about to end
}

void remove_watched() {
  removing = true;
  for (std::atomic<const char*>& slot : watched) {
    if (const char* name = slot.load()) ::unlink(name);
  }
}

void remove_or_note(const std::string& path) {
  if (::unlink(path.c_str()) != 0 && errno != ENOENT) note_left_behind(path, errno);
}

void note_left_behind(const std::string& path, int reason) {
  const std::lock_guard lock(notes_mutex);
  notes.push_back(fmt::format("{}: temporary file that could not be removed: {}", path, std::strerror(reason)));
}

std::vector<std::string> take_left_behind() {
  const std::lock_guard lock(notes_mutex);
  return std::exchange(notes, {});
}

}  // namespace lamina::write
