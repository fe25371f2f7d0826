// stages/load/part_store.h: loaded parts and unpacked files that many jobs of one process use.
#pragma once

#include <cstdint>
#include <list>
#include <memory>
#include <mutex>
#include <string>
#include <string_view>
#include <unordered_map>
#include <unordered_set>

#include "stages/support/io/file.h"

namespace lamina::load {

/// Immutable results of reading files, under keys with all options that decide them. A file that changed is read again. If two
/// jobs request the same at once, both read it, so that no thread waits for another one. Any thread may call it.
/// cost  a search by key; the values are shared
class PartStore {
 public:
  explicit PartStore(std::uint64_t max_bytes) : max_bytes_(max_bytes) {}

  /// Removes what exceeds the new limit: values that were never used again first, then those used longest ago.
  void limit(std::uint64_t max_bytes);
  std::uint64_t bytes() const;
  std::uint64_t hits() const;

  /// The value of a key that was made of the file in this state; null if there is none. T  of add() under this key
  template <class T>
  std::shared_ptr<const T> find(const std::string& key, const FileStamp& stamp) {
    return std::static_pointer_cast<const T>(find_value(key, stamp));
  }
  /// Whether a part is worth a copy: the first one of its file, and any that is requested again. The variants of a file, such
  /// as one part at many angles, would displace what is used again.
  bool wants(const std::string& key, const std::string& path);
  /// Stores a value, unless it exceeds the limit. stamp  of the file before it was read. bytes  of the value
  /// The file must be the same after reading, and older than the resolution of its times.
  void add(const std::string& key, const std::string& path, const FileStamp& stamp, std::shared_ptr<const void> value,
           std::uint64_t bytes);

 private:
  struct Stored {
    std::string key;
    FileStamp stamp;
    std::shared_ptr<const void> value;
    std::uint64_t bytes;
    bool reused;
  };
  using Entries = std::list<Stored>;

  std::shared_ptr<const void> find_value(const std::string& key, const FileStamp& stamp);
  void remove(Entries::iterator entry);
  void trim();

  mutable std::mutex mutex_;  // guards all
  std::uint64_t max_bytes_, bytes_ = 0, hits_ = 0;
  Entries fresh_, reused_;  // last used first
  std::unordered_map<std::string_view, Entries::iterator> entries_;
  std::unordered_set<std::string> requested_;  // keys and paths
};

}  // namespace lamina::load
