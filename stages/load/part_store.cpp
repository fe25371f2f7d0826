#include "stages/load/part_store.h"

#include <iterator>
#include <utility>

namespace lamina::load {
namespace {

constexpr std::size_t kMaxRequested = 1u << 16;  // names that are remembered; then all are forgotten

}  // namespace

void PartStore::limit(std::uint64_t max_bytes) {
  const std::lock_guard lock(mutex_);
  max_bytes_ = max_bytes;
  trim();
}

std::uint64_t PartStore::bytes() const {
  const std::lock_guard lock(mutex_);
  return bytes_;
}

std::uint64_t PartStore::hits() const {
  const std::lock_guard lock(mutex_);
  return hits_;
}

std::shared_ptr<const void> PartStore::find_value(const std::string& key, const FileStamp& stamp) {
  const std::lock_guard lock(mutex_);
  const auto found = entries_.find(key);
  if (found == entries_.end()) return {};
  const Entries::iterator entry = found->second;
  if (entry->stamp != stamp) {
    remove(entry);
    return {};
  }
  reused_.splice(reused_.begin(), entry->reused ? reused_ : fresh_, entry);
  entry->reused = true;
  ++hits_;
  return entry->value;
}

bool PartStore::wants(const std::string& key, const std::string& path) {
  const std::lock_guard lock(mutex_);
  if (requested_.size() > kMaxRequested) requested_.clear();
  const bool is_first = requested_.insert(path).second, is_again = !requested_.insert(key).second;
  return is_first || is_again;
}

void PartStore::add(const std::string& key, const std::string& path, const FileStamp& stamp, std::shared_ptr<const void> value,
                    std::uint64_t bytes) {
  if (!stamp.settled || file_stamp(path) != stamp) return;
  const std::lock_guard lock(mutex_);
  if (bytes > max_bytes_) return;
  if (const auto earlier = entries_.find(key); earlier != entries_.end()) remove(earlier->second);
  fresh_.push_front({key, stamp, std::move(value), bytes, false});
  entries_.emplace(fresh_.front().key, fresh_.begin());
  bytes_ += bytes;
  trim();
}

void PartStore::remove(Entries::iterator entry) {
  bytes_ -= entry->bytes;
  entries_.erase(entry->key);
  (entry->reused ? reused_ : fresh_).erase(entry);
}

void PartStore::trim() {
  while (bytes_ > max_bytes_) remove(std::prev(fresh_.size() > 1 || reused_.empty() ? fresh_.end() : reused_.end()));
}

}  // namespace lamina::load
