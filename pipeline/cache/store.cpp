#include "pipeline/cache/store.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <linux/fs.h>
#include <sys/ioctl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <filesystem>

#include "pipeline/job/errors.h"
#include "stages/support/io/file.h"
#include "stages/support/io/file_reader.h"
#include "stages/support/io/temporary.h"
#include "stages/support/text/json_text.h"
#include "stages/support/text/readable.h"

namespace lamina::pipeline {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view kTag =
    "Signature: 8a477f597d28d172789f06886806bc55\n"
    "# This folder is a cache of lamina, format 1. Its content can be removed at any time.\n";
constexpr std::size_t kMaxEntryBytes = 256u << 20, kPieceBytes = 1u << 20;
constexpr std::int64_t kYoungS = 3600;                                      // of temporary files, which a run may be writing
constexpr std::size_t kSmallBytes = 64u << 10, kMaxSmallBytes = 16u << 20;  // of an object, of all in memory

/// A descriptor that is closed at the end.
class OpenFile {
 public:
  explicit OpenFile(int file) : file_(file) {}
  OpenFile(const OpenFile&) = delete;
  OpenFile& operator=(const OpenFile&) = delete;
  ~OpenFile() {
    if (file_ >= 0) ::close(file_);
  }
  int get() const { return file_; }
  int release() { return std::exchange(file_, -1); }

 private:
  int file_;
};

Error damaged(const Hash128& hash) { return {Fault::kInput, fmt::format("object {} of the cache is damaged", hex(hash))}; }

/// Hashes a file of `bytes` bytes from its start; gives each piece to `take`.
/// returns  whether it has that size and hash. errors  of `take`
Result<bool> check_bytes(int file, const FileDigest& object, const std::function<Status(std::span<const char>)>& take) {
  Buffer<char> piece;
  piece.resize(std::min<std::uint64_t>(object.bytes + 1, kPieceBytes));
  Hasher hasher;
  for (std::uint64_t done = 0;;) {
    const ssize_t got = ::read(file, piece.data(), piece.size());
    if (got < 0 && errno == EINTR) continue;
    if (got < 0) return false;
    done += static_cast<std::uint64_t>(got);
    if (done > object.bytes) return false;
    const std::span<const char> bytes(piece.data(), static_cast<std::size_t>(got));
    hasher.add(std::as_bytes(bytes));
    if (take) {
      if (Status status = take(bytes); !status) return status.error();
    }
    // A short piece is the last one of a regular file.
    if (static_cast<std::size_t>(got) < piece.size()) return done == object.bytes && hasher.take() == object.hash;
  }
}

/// Makes a file that is absent, of these bytes. errors  kOutput
Status make_file(const std::string& path, std::string_view bytes) {
  OpenFile to(::open(path.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC | O_NOFOLLOW, 0666));
  if (to.get() < 0) return write_failure(path, errno);
  int reason = write_all(to.get(), std::as_bytes(std::span(bytes)));
  if (reason == 0 && ::close(to.release()) != 0) reason = errno;
  if (reason == 0) return {};
  ::unlink(path.c_str());
  return write_failure(path, reason);
}

Status read_entry(const std::string& text, const Hash128& key, CacheEntry& entry) try {
  const Error wrong{Fault::kInput, "damaged"};
  const std::size_t line = text.find('\n');
  Hash128 hash;
  if (line == std::string::npos || !read_hex(std::string_view(text).substr(0, line), hash)) return wrong;
  const std::string body = text.substr(line + 1);
  if (hash_text(body) != hash || !json_nests_within(body)) return wrong;
  const Json json = parse_json(body);
  if (json.at("key").text() != hex(key)) return wrong;
  for (const Json& file : json.at("files")) {
    CachedFile& added = entry.files.emplace_back();
    added.name = file.at(0).text();
    file.at(1).get_to(added.digest.bytes);
    if (!read_hex(file.at(2).text(), added.digest.hash)) return wrong;
  }
  entry.facts = json.at("facts");
  return {};
} catch (const JsonError& error) {
  return Error{Fault::kInput, error.what()};
}

std::string entry_text(const Hash128& key, const CacheEntry& entry) {
  Json files = Json::array();
  for (const CachedFile& file : entry.files) {
    files.push_back(Json::array({file.name, file.digest.bytes, hex(file.digest.hash)}));
  }
  const std::string body = json_line(Json{{"key", hex(key)}, {"files", files}, {"facts", entry.facts}});
  return hex(hash_text(body)) + "\n" + body;
}

/// Calls `take` for each file of kind/ab/HEX. errors  kOutput
Status list_files(const std::string& folder, const std::function<void(const Hash128&, const struct stat&)>& take) {
  std::error_code error;
  for (fs::recursive_directory_iterator at(folder, error), end; !error && at != end; at.increment(error)) {
    Hash128 hash;
    struct stat facts {};
    if (!read_hex(at->path().filename().string(), hash)) continue;
    if (::lstat(at->path().c_str(), &facts) == 0 && S_ISREG(facts.st_mode)) take(hash, facts);
  }
  if (error && error != std::errc::no_such_file_or_directory) return failure(Fault::kOutput, "{}: {}", folder, error.message());
  return {};
}

std::uint64_t size_of(const std::string& path) {
  std::error_code error;
  const std::uint64_t size = fs::file_size(path, error);
  return error ? 0 : size;
}

/// Takes the permission to write from a file. returns  whether it has none now
bool protect(const std::string& path) {
  struct stat facts {};
  return ::stat(path.c_str(), &facts) == 0 && ::chmod(path.c_str(), facts.st_mode & 0444) == 0;
}

/// Whether a file or folder of this name may be part of a cache whose tag is missing: it is made or removed right now.
bool is_of_cache(const std::string& name) {
  return name == "jobs" || name == "objects" || name == "hits" || name == "misses" || name.starts_with("CACHEDIR.TAG");
}

Status make_tag(const std::string& folder) {
  std::error_code error;
  fs::create_directories(folder, error);
  if (error) return failure(Fault::kOutput, "{}: {}", folder, error.message());
  return write_file(folder + "/CACHEDIR.TAG", kTag, {.lock = false, .durable = Durable::kNo});
}

}  // namespace

Result<std::shared_ptr<JobCache>> JobCache::open(const std::string& folder, bool link) {
  std::error_code error;
  fs::create_directories(folder, error);
  if (error) return failure(Fault::kOutput, "{}: {}", folder, error.message());
  const std::string tag = folder + "/CACHEDIR.TAG";
  if (!fs::exists(tag, error)) {
    for (fs::directory_iterator at(folder, error), end; !error && at != end; at.increment(error)) {
      const std::string name = at->path().filename().string();
      if (!is_of_cache(name))
        return usage("{}: contains {}, and is not a cache of lamina; name a new folder", folder, one_line(name));
    }
    if (error) return failure(Fault::kOutput, "{}: {}", folder, error.message());
    if (Status status = make_tag(folder); !status) return status.error();
  }
  const Result<std::string> text = read_file(tag, {.fault = Fault::kOutput, .max_bytes = 4096});
  if (!text) return text.error();
  if (*text != kTag) return usage("{}: is not a cache of this version of lamina; name another folder", folder);
  if (::access(folder.c_str(), W_OK | X_OK) != 0)
    return failure(Fault::kOutput, "{}: {}; the cache cannot be written", folder, std::strerror(errno));
  return std::shared_ptr<JobCache>(new JobCache(folder, link));
}

Status JobCache::check_apart(const std::string& folder, const std::string& output) {
  std::error_code ignored;
  const auto whole = [&](const std::string& path) {
    const fs::path found = fs::weakly_canonical(fs::absolute(path, ignored), ignored);
    return found.has_filename() ? found : found.parent_path();
  };
  const fs::path cache = whole(folder), other = whole(output);
  const auto is_in = [](const fs::path& inner, const fs::path& outer) {
    return std::mismatch(outer.begin(), outer.end(), inner.begin(), inner.end()).first == outer.end();
  };
  if (output.empty() || (!is_in(cache, other) && !is_in(other, cache))) return {};
  return usage("--cache {}: cache and output are in one another; name another folder", one_line(folder));
}

std::string JobCache::position(const char* kind, const Hash128& hash) const {
  const std::string name = hex(hash);
  return fmt::format("{}/{}/{}/{}", folder_, kind, name.substr(0, 2), name);
}

Status JobCache::make_folder_of(const std::string& path) const {
  // A cache that was removed meanwhile begins anew, with its tag.
  if (::access((folder_ + "/CACHEDIR.TAG").c_str(), F_OK) != 0) {
    if (Status status = make_tag(folder_); !status) return status;
  }
  std::error_code error;
  const fs::path folder = fs::path(path).parent_path();
  fs::create_directories(folder, error);
  return error ? failure(Fault::kOutput, "{}: {}", folder.string(), error.message()) : Status();
}

std::optional<CacheEntry> JobCache::inspect(const Hash128& key) {
  const Result<std::string> text =
      read_file(position("jobs", key), {.fault = Fault::kInput, .max_bytes = kMaxEntryBytes, .any_bytes = true});
  if (!text) return std::nullopt;
  CacheEntry entry;
  if (read_entry(*text, key, entry)) return entry;
  remove(key);
  return std::nullopt;
}

std::optional<CacheEntry> JobCache::find(const Hash128& key) {
  std::optional<CacheEntry> entry = inspect(key);
  // Its last use; a failure only ages it.
  if (entry) ::utimensat(AT_FDCWD, position("jobs", key).c_str(), nullptr, AT_SYMLINK_NOFOLLOW);
  return entry;
}

bool JobCache::try_link(const std::string& object, const std::string& path) {
  if (::link(object.c_str(), path.c_str()) == 0) return true;
  const int reason = errno;
  if (reason == EEXIST || reason == ENOENT) return false;
  if (reason != EMLINK && link_.exchange(false)) {
    const std::lock_guard lock(mutex_);
    notes_.push_back(fmt::format("cache {}: {}; files are copied, not linked", folder_,
                                 reason == EXDEV ? "is on another file system" : std::strerror(reason)));
  }
  return false;
}

void JobCache::note_not_added(const Error& reason) {
  if (full_.exchange(true)) return;
  const std::lock_guard lock(mutex_);
  notes_.push_back(fmt::format("cache {}: jobs were not added: {}", folder_, one_line(reason.message)));
}

std::vector<std::string> JobCache::take_notes() {
  const std::lock_guard lock(mutex_);
  return std::exchange(notes_, {});
}

Result<std::shared_ptr<const std::string>> JobCache::small_object(const FileDigest& object) {
  {
    const std::lock_guard lock(mutex_);
    const auto found = small_.find(object.hash);
    if (found != small_.end()) return found->second;
  }
  std::string read;
  const auto take = [&](std::span<const char> piece) {
    read.append(piece.data(), piece.size());
    return Status();
  };
  if (Status status = stream(object, take); !status) return status.error();
  auto bytes = std::make_shared<const std::string>(std::move(read));
  const std::lock_guard lock(mutex_);
  if (!small_.try_emplace(object.hash, bytes).second) return bytes;
  small_order_.push_back(object.hash);
  small_bytes_ += bytes->size();
  while (small_bytes_ > kMaxSmallBytes) {
    const auto oldest = small_.find(small_order_.front());
    small_bytes_ -= oldest->second->size();
    small_.erase(oldest);
    small_order_.pop_front();
  }
  return bytes;
}

Status JobCache::copy_object(int from, const FileDigest& object, const std::string& path, unsigned mode) {
  OpenFile to(::open(path.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC | O_NOFOLLOW, mode));
  if (to.get() < 0) return write_failure(path, errno);
  const bool cloned = object.bytes >= kPieceBytes && ::ioctl(to.get(), FICLONE, from) == 0;
  const auto write = [&](std::span<const char> bytes) {
    const int reason = write_all(to.get(), std::as_bytes(bytes));
    return reason == 0 ? Status() : Status(write_failure(path, reason));
  };
  const Result<bool> whole = cloned ? check_bytes(from, object, {}) : check_bytes(from, object, write);
  if (!whole) return whole.error();
  if (!*whole) return damaged(object.hash);
  return ::close(to.release()) == 0 ? Status() : Status(write_failure(path, errno));
}

Status JobCache::fetch(const FileDigest& object, const std::string& path) {
  if (!link_ && object.bytes <= kSmallBytes) {
    const auto bytes = small_object(object);
    return bytes ? make_file(path, **bytes) : bytes.error();
  }
  const std::string source = position("objects", object.hash);
  const OpenFile from(::open(source.c_str(), O_RDONLY | O_CLOEXEC | O_NOFOLLOW));
  if (from.get() < 0) return damaged(object.hash);
  Status status;
  if (link_ && object.bytes > 0 && protect(source) && try_link(source, path)) {
    // The name is linked before the bytes are read, so that both are of the same file.
    const OpenFile linked(::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NOFOLLOW));
    const Result<bool> whole = check_bytes(linked.get(), object, {});
    if (!whole || !*whole) status = damaged(object.hash);
  } else {
    status = copy_object(from.get(), object, path, 0666);
  }
  if (status) return status;
  ::unlink(path.c_str());
  if (status.error().fault == Fault::kInput) remove_object(object.hash);
  return status;
}

Status JobCache::stream(const FileDigest& object, const std::function<Status(std::span<const char>)>& take) {
  const OpenFile from(::open(position("objects", object.hash).c_str(), O_RDONLY | O_CLOEXEC | O_NOFOLLOW));
  const Result<bool> whole = from.get() < 0 ? Result<bool>(false) : check_bytes(from.get(), object, take);
  if (!whole) return whole.error();
  if (*whole) return {};
  remove_object(object.hash);
  return damaged(object.hash);
}

JobCache::ObjectState JobCache::check(const FileDigest& object) {
  const OpenFile from(::open(position("objects", object.hash).c_str(), O_RDONLY | O_CLOEXEC | O_NOFOLLOW));
  if (from.get() < 0 && errno == ENOENT) return ObjectState::kMissing;
  const Result<bool> whole = from.get() < 0 ? Result<bool>(false) : check_bytes(from.get(), object, {});
  if (whole && *whole) return ObjectState::kWhole;
  remove_object(object.hash);
  return ObjectState::kDamaged;
}

Result<FileDigest> JobCache::add_object(const std::string& path, const std::optional<FileDigest>& expected, bool may_link) {
  const Result<FileDigest> digest = digest_file(path);
  if (!digest) return failure(Fault::kInput, "{}", digest.error().message);
  if (expected && (expected->bytes != digest->bytes || expected->hash != digest->hash))
    return failure(Fault::kInput, "{}: was changed after it was written", path);
  const std::string object = position("objects", digest->hash);
  // An object that is there is as good as new: trimming keeps it for a while.
  if (size_of(object) == digest->bytes && ::utimensat(AT_FDCWD, object.c_str(), nullptr, AT_SYMLINK_NOFOLLOW) == 0)
    return digest;
  if (Status status = make_folder_of(object); !status) return status.error();
  const std::string fresh = temporary_name(object);
  const int watched = watch(fresh.c_str());
  Status status;
  if (link_ && may_link && digest->bytes > 0 && try_link(path, fresh)) {
    if (!protect(fresh)) status = write_failure(fresh, errno);
  } else {
    const OpenFile from(::open(path.c_str(), O_RDONLY | O_CLOEXEC));
    status = from.get() < 0 ? failure(Fault::kInput, "{}: {}", path, std::strerror(errno))
                            : copy_object(from.get(), *digest, fresh, 0444);
  }
  if (status && ::rename(fresh.c_str(), object.c_str()) != 0) status = write_failure(object, errno);
  remove_or_note(fresh);
  forget(watched);
  return status ? digest : Result<FileDigest>(status.error());
}

Status JobCache::add(const Hash128& key, const CacheEntry& entry) {
  const std::string path = position("jobs", key);
  if (Status status = make_folder_of(path); !status) return status;
  return write_file(path, entry_text(key, entry), {.lock = false, .follow = false, .durable = Durable::kNo});
}

bool JobCache::has_entry(const Hash128& key) const { return ::access(position("jobs", key).c_str(), F_OK) == 0; }

void JobCache::remove_leftovers(std::int64_t now_s) {
  for (const char* kind : {"/jobs", "/objects"}) {
    std::error_code error;
    for (fs::recursive_directory_iterator at(folder_ + kind, error), end; !error && at != end; at.increment(error)) {
      struct stat facts {};
      if (named_by_temporary(at->path().filename().string()).empty() || ::lstat(at->path().c_str(), &facts) != 0) continue;
      if (S_ISREG(facts.st_mode) && now_s - facts.st_mtim.tv_sec > kYoungSeconds) ::unlink(at->path().c_str());
    }
  }
}

void JobCache::remove(const Hash128& key) { ::unlink(position("jobs", key).c_str()); }
void JobCache::remove_object(const Hash128& hash) { ::unlink(position("objects", hash).c_str()); }

void JobCache::count(bool hit) {
  const std::string path = folder_ + (hit ? "/hits" : "/misses");
  const OpenFile file(::open(path.c_str(), O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC | O_NOFOLLOW, 0666));
  if (file.get() >= 0) static_cast<void>(write_all(file.get(), std::as_bytes(std::span(".", 1))));
}

std::uint64_t JobCache::hits() const { return size_of(folder_ + "/hits"); }
std::uint64_t JobCache::misses() const { return size_of(folder_ + "/misses"); }

Result<std::vector<JobCache::EntryFile>> JobCache::entries() const {
  std::vector<EntryFile> found;
  const Status status = list_files(folder_ + "/jobs", [&](const Hash128& hash, const struct stat& facts) {
    found.push_back({hash, static_cast<std::uint64_t>(facts.st_size), facts.st_mtim.tv_sec});
  });
  return status ? Result(std::move(found)) : status.error();
}

Result<std::vector<JobCache::ObjectFile>> JobCache::objects() const {
  std::vector<ObjectFile> found;
  const Status status = list_files(folder_ + "/objects", [&](const Hash128& hash, const struct stat& facts) {
    found.push_back({hash, static_cast<std::uint64_t>(facts.st_size), facts.st_mtim.tv_sec});
  });
  return status ? Result(std::move(found)) : status.error();
}

}  // namespace lamina::pipeline
