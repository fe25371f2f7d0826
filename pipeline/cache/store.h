// pipeline/cache/store.h: a folder of finished jobs, from which equal jobs take their files.
//
//      CACHEDIR.TAG      marks the folder for backup programs and for lamina
//      jobs/ab/KEY       an entry: the files of a job, each with its hash, and what the job reported
//      objects/ab/HASH   the bytes of a file, under their XXH3-128
//      hits, misses      a byte each
//
// Nothing in it is trusted: an entry and an object are hashed when they are read, and removed if they differ from their
// names. Everything appears by rename, so that any number of processes may use, trim or remove the folder at the same time;
// what is missing is planned again.
#pragma once

#include <atomic>
#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "pipeline/cache/input_digests.h"
#include "stages/data/status.h"
#include "stages/support/hash/hash.h"
#include "stages/support/text/json_value.h"

namespace lamina::pipeline {

struct CachedFile {
  std::string name;  // by which the writer of the entry knows it
  FileDigest digest;
};

struct CacheEntry {
  std::vector<CachedFile> files;
  Json facts;  // for the writer of the entry
};

/// For maps of hashes.
struct HashLess {
  bool operator()(const Hash128& a, const Hash128& b) const { return std::pair(a.high, a.low) < std::pair(b.high, b.low); }
};

class JobCache {
 public:
  /// A file without an entry, or a temporary one, may belong to a running job up to this age.
  static constexpr std::int64_t kYoungSeconds = 3600;

  /// Opens a folder, which is made if it is absent.
  /// link    files of jobs become hard links, without write permission, where the file system allows it
  /// errors  kUsage: the folder contains something else. kOutput: it cannot be made or written
  static Result<std::shared_ptr<JobCache>> open(const std::string& folder, bool link);

  const std::string& folder() const { return folder_; }
  InputDigests& inputs() { return inputs_; }

  // --- any thread; a process per call is as good
  /// The entry of a job, which counts as used. Nothing if there is none; a damaged one is removed. cost  reads one file
  std::optional<CacheEntry> find(const Hash128& key);
  /// The same, but it does not count as used.
  std::optional<CacheEntry> inspect(const Hash128& key);
  /// Makes `path`, which is absent, of the bytes of an object, compared with their hash before it is complete.
  /// errors  kInput: the object is missing or damaged; it is gone then, and so is `path`. kOutput: `path` cannot be written
  Status fetch(const FileDigest& object, const std::string& path);
  /// Gives the bytes of an object to `take`, piece by piece. errors  of `take`; kInput, as of fetch(), after all pieces
  Status stream(const FileDigest& object, const std::function<Status(std::span<const char>)>& take);
  /// The file of an object, to be read after stream() has accepted it.
  std::string file_of(const FileDigest& object) const { return position("objects", object.hash); }
  enum class ObjectState { kWhole, kDamaged, kMissing };
  /// Reads an object; a damaged one is removed.
  ObjectState check(const FileDigest& object);
  /// Adds the bytes of a file.
  /// may_link  the file may become a name of the object, without write permission
  /// errors    kOutput; kInput: the file is not the one of `expected`
  Result<FileDigest> add_object(const std::string& path, const std::optional<FileDigest>& expected = {}, bool may_link = false);
  /// Adds an entry whose objects are there. errors  kOutput
  Status add(const Hash128& key, const CacheEntry& entry);
  /// Removes an entry whose objects are damaged.
  void remove(const Hash128& key);
  void count(bool hit);
  /// errors  kUsage: the output is in the cache, or the cache in the output
  static Status check_apart(const std::string& folder, const std::string& output);

  // --- what to report, once for each cache
  /// Notes that files were not added; the first reason counts. From now on nothing is added.
  void note_not_added(const Error& reason);
  bool is_full() const { return full_; }
  /// Notes since the last call, a line each: no hard links were possible, jobs were not added.
  std::vector<std::string> take_notes();

  // --- upkeep
  struct EntryFile {
    Hash128 key;
    std::uint64_t bytes = 0;
    std::int64_t used_s = 0;  // since 1970
  };
  struct ObjectFile {
    Hash128 hash;
    std::uint64_t bytes = 0;
    std::int64_t made_s = 0;
  };
  /// All that is there, in no order. errors  kOutput: a folder cannot be read
  Result<std::vector<EntryFile>> entries() const;
  Result<std::vector<ObjectFile>> objects() const;
  std::uint64_t hits() const;
  std::uint64_t misses() const;
  void remove_object(const Hash128& hash);
  bool has_entry(const Hash128& key) const;
  /// Removes temporary files of killed runs, which are older than an hour. now_s  since 1970
  void remove_leftovers(std::int64_t now_s);

 private:
  JobCache(std::string folder, bool link) : folder_(std::move(folder)), link_(link) {}
  std::string position(const char* kind, const Hash128& hash) const;
  Status make_folder_of(const std::string& path) const;
  bool try_link(const std::string& object, const std::string& path);
  Status copy_object(int from, const FileDigest& object, const std::string& path, unsigned mode);
  Result<std::shared_ptr<const std::string>> small_object(const FileDigest& object);

  std::string folder_;
  std::atomic<bool> link_, full_{false};
  std::mutex mutex_;
  std::vector<std::string> notes_;  // guarded by mutex_, as what follows
  /// Small objects that were read and checked, for jobs that come often; the oldest go.
  std::map<Hash128, std::shared_ptr<const std::string>, HashLess> small_;
  std::deque<Hash128> small_order_;
  std::size_t small_bytes_ = 0;
  InputDigests inputs_;
};

}  // namespace lamina::pipeline
