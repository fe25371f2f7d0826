// stages/support/io/recent_files.h: what was read of some files, as long as these are the same.
#pragma once

#include <sys/stat.h>

#include <algorithm>
#include <memory>
#include <mutex>
#include <string>
#include <utility>
#include <vector>

namespace lamina {

/// Whether a file is the one that had this status, with the same content.
inline bool is_unchanged(const struct stat& now, const struct stat& before) {
  return now.st_dev == before.st_dev && now.st_ino == before.st_ino && now.st_size == before.st_size &&
         now.st_mtim.tv_sec == before.st_mtim.tv_sec && now.st_mtim.tv_nsec == before.st_mtim.tv_nsec;
}

/// Values of the files that were read last. Thread-safe; a value has the member `stamp`, the status of its file.
template <class Value>
class RecentFiles {
 public:
  /// make(Value&)  reads the file, under a lock; false if it could not: then it is read again next time
  template <class Make>
  std::shared_ptr<const Value> of(const std::string& path, const struct stat& now, const Make& make) {
    const std::lock_guard lock(mutex_);
    for (auto& [name, value] : recent_) {
      if (name == path && is_unchanged(now, value->stamp)) return value;
    }
    auto made = std::make_shared<Value>();
    made->stamp = now;
    const bool keep = make(*made);
    std::erase_if(recent_, [&](const auto& one) { return one.first == path; });
    if (!keep) return made;
    if (recent_.size() >= kRecent) recent_.erase(recent_.begin());
    recent_.emplace_back(path, made);
    return made;
  }

 private:
  static constexpr std::size_t kRecent = 8;
  std::mutex mutex_;
  std::vector<std::pair<std::string, std::shared_ptr<const Value>>> recent_;  // the latest last
};

}  // namespace lamina
