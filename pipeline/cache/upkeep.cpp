#include "pipeline/cache/upkeep.h"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <set>
#include <utility>

#include "pipeline/job/errors.h"

namespace lamina::pipeline {
namespace {

Error interrupted() { return {Fault::kInterrupted, "interrupted; the cache is valid"}; }

/// Objects with the number of entries that need them.
struct Use {
  std::uint64_t bytes = 0;
  std::int64_t made_s = 0;
  std::uint32_t entries = 0;
};
using Uses = std::map<Hash128, Use, HashLess>;

/// The objects of an entry, each once.
std::set<Hash128, HashLess> objects_of(const CacheEntry& entry) {
  std::set<Hash128, HashLess> objects;
  for (const CachedFile& file : entry.files) objects.insert(file.digest.hash);
  return objects;
}

}  // namespace

Result<CacheSize> measure_cache(const JobCache& cache) {
  const auto entries = cache.entries();
  if (!entries) return entries.error();
  const auto objects = cache.objects();
  if (!objects) return objects.error();
  CacheSize size{entries->size(), objects->size(), 0, cache.hits(), cache.misses(), 0, 0};
  for (const JobCache::EntryFile& entry : *entries) {
    size.bytes += entry.bytes;
    size.oldest_use_s = size.oldest_use_s == 0 ? entry.used_s : std::min(size.oldest_use_s, entry.used_s);
    size.newest_use_s = std::max(size.newest_use_s, entry.used_s);
  }
  for (const JobCache::ObjectFile& object : *objects) size.bytes += object.bytes;
  return size;
}

Result<TrimmedCache> trim_cache(JobCache& cache, std::uint64_t max_bytes, std::int64_t now_s, const std::atomic<bool>& cancel) {
  cache.remove_leftovers(now_s);
  auto entries = cache.entries();
  if (!entries) return entries.error();
  const auto objects = cache.objects();
  if (!objects) return objects.error();
  Uses uses;
  std::uint64_t bytes = 0;
  for (const JobCache::ObjectFile& object : *objects) {
    uses[object.hash] = {object.bytes, object.made_s, 0};
    bytes += object.bytes;
  }
  TrimmedCache trimmed;
  std::vector<std::set<Hash128, HashLess>> needs(entries->size());
  std::ranges::sort(*entries, {}, &JobCache::EntryFile::used_s);
  for (std::size_t i = 0; i < entries->size(); ++i) {
    if (cancel) return interrupted();
    bytes += (*entries)[i].bytes;
    const auto entry = cache.inspect((*entries)[i].key);
    if (!entry) continue;
    needs[i] = objects_of(*entry);
    for (const Hash128& hash : needs[i]) {
      const auto found = uses.find(hash);
      if (found != uses.end()) ++found->second.entries;
    }
  }
  const auto remove = [&](Uses::iterator use) {
    cache.remove_object(use->first);
    bytes -= use->second.bytes;
    trimmed.bytes += use->second.bytes;
    ++trimmed.objects;
    return uses.erase(use);
  };
  for (auto use = uses.begin(); use != uses.end();) {
    use = use->second.entries == 0 && now_s - use->second.made_s > JobCache::kYoungSeconds ? remove(use) : std::next(use);
  }
  for (std::size_t i = 0; i < entries->size() && bytes > max_bytes; ++i) {
    if (cancel) return interrupted();
    cache.remove((*entries)[i].key);  // before its objects: a job that finds it must find them
    bytes -= (*entries)[i].bytes;
    trimmed.bytes += (*entries)[i].bytes;
    ++trimmed.entries;
    for (const Hash128& hash : needs[i]) {
      const auto use = uses.find(hash);
      if (use != uses.end() && --use->second.entries == 0) remove(use);
    }
  }
  return trimmed;
}

Result<CheckedCache> check_cache(JobCache& cache, const std::atomic<bool>& cancel) {
  using State = JobCache::ObjectState;
  const auto entries = cache.entries();  // before the objects: those of entries that are added meanwhile are there
  if (!entries) return entries.error();
  const auto objects = cache.objects();
  if (!objects) return objects.error();
  CheckedCache checked;
  std::map<Hash128, std::uint64_t, HashLess> whole;
  for (const JobCache::ObjectFile& object : *objects) {
    if (cancel) return interrupted();
    const State state = cache.check({object.bytes, object.hash});
    if (state == State::kMissing) continue;  // trimmed meanwhile
    ++checked.objects;
    checked.bytes += object.bytes;
    if (state == State::kWhole) whole[object.hash] = object.bytes;
    if (state == State::kDamaged) checked.damaged.push_back(fmt::format("object {}: its bytes are others", hex(object.hash)));
  }
  for (const JobCache::EntryFile& file : *entries) {
    if (cancel) return interrupted();
    if (!cache.has_entry(file.key)) continue;
    ++checked.entries;
    checked.bytes += file.bytes;
    const auto entry = cache.inspect(file.key);
    if (!entry) {
      checked.damaged.push_back(fmt::format("entry {}: is damaged", hex(file.key)));
      continue;
    }
    const auto missing = std::ranges::find_if(entry->files, [&](const CachedFile& needed) {
      const auto found = whole.find(needed.digest.hash);
      if (found != whole.end()) return found->second != needed.digest.bytes;
      return cache.check(needed.digest) != State::kWhole;
    });
    if (missing == entry->files.end() || !cache.has_entry(file.key)) continue;
    cache.remove(file.key);
    checked.damaged.push_back(fmt::format("entry {}: {} is missing or damaged", hex(file.key), missing->name));
  }
  return checked;
}

}  // namespace lamina::pipeline
