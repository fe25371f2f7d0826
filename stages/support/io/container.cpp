#include "stages/support/io/container.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/mman.h>
#include <sys/sendfile.h>
#include <sys/stat.h>
#include <unistd.h>
#include <zlib.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <memory>
#include <span>
#include <string_view>
#include <utility>

#include "stages/support/io/paged.h"
#include "stages/support/io/recent_files.h"

namespace lamina {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view kEntry = "PK\x03\x04", kInDirectory = "PK\x01\x02", kEnd = "PK\x05\x06", kEnd64 = "PK\x06\x06",
                           kLocator64 = "PK\x06\x07", kManifest = "manifest.json", kOfShard = "manifest-";
constexpr std::size_t kEntryHead = 30, kDirectoryHead = 46, kEndBytes = 22, kEnd64Bytes = 56, kLocatorBytes = 20;
constexpr std::uint64_t kMaxDirectory = 256ull << 20, kMaxCopied = 1ull << 30;  // bytes
constexpr std::string_view kUnreadable = "cannot be read";
constexpr std::uint64_t kUtf8 = 1 << 11;   // flag of a name
constexpr std::uint64_t kMaxVersion = 63;  // needed to extract; 45: Zip64

class Descriptor {
 public:
  explicit Descriptor(int file) : file_(file) {}
  Descriptor(Descriptor&& other) noexcept : file_(other.release()) {}
  Descriptor& operator=(Descriptor&& other) noexcept {
    std::swap(file_, other.file_);
    return *this;
  }
  ~Descriptor() {
    if (file_ >= 0) ::close(file_);
  }
  int get() const { return file_; }
  int release() { return std::exchange(file_, -1); }

 private:
  int file_;
};

bool read_at(int file, std::uint64_t offset, std::span<char> to) {
  while (!to.empty()) {
    const ssize_t got = ::pread(file, to.data(), to.size(), static_cast<off_t>(offset));
    if (got < 0 && errno == EINTR) continue;
    if (got <= 0) return false;
    to = to.subspan(static_cast<std::size_t>(got));
    offset += static_cast<std::uint64_t>(got);
  }
  return true;
}

std::uint64_t little(std::string_view bytes, std::size_t at, std::size_t count) {
  std::uint64_t number = 0;
  for (std::size_t i = count; i-- > 0;) number = number << 8 | static_cast<unsigned char>(bytes[at + i]);
  return number;
}

/// Replaces the numbers that are 0xFFFFFFFF by those of the Zip64 field. false: it lacks one of them
bool widen(std::string_view extra, std::span<std::uint64_t* const> numbers) {
  std::string_view field;
  while (extra.size() >= 4) {
    const auto size = static_cast<std::size_t>(little(extra, 2, 2));
    if (size > extra.size() - 4) return false;
    if (little(extra, 0, 2) == 1) field = extra.substr(4, size);
    extra.remove_prefix(4 + size);
  }
  for (std::uint64_t* const number : numbers) {
    if (*number != UINT32_MAX) continue;
    if (field.size() < 8) return false;
    *number = little(field, 0, 8);
    field.remove_prefix(8);
  }
  return true;
}

/// Whether unpackers read an entry: not encrypted, of no later version. at  of the version, which the flags follow
bool is_plain(std::string_view head, std::size_t at) {
  return little(head, at, 2) <= kMaxVersion && (little(head, at + 2, 2) & ~kUtf8) == 0;
}

/// What precedes the data of an entry.
struct EntryHead {
  ContainerEntry entry;
  std::uint64_t data = 0;  // offset
  std::uint64_t packed = 0;
  bool stored = false;
};

/// Nothing if no whole entry begins there. file_bytes  of the container
std::optional<EntryHead> read_head(int file, std::uint64_t offset, std::uint64_t file_bytes) {
  std::array<char, kEntryHead> fixed{};
  if (offset > file_bytes || file_bytes - offset < fixed.size() || !read_at(file, offset, fixed)) return std::nullopt;
  const std::string_view head(fixed.data(), fixed.size());
  if (!head.starts_with(kEntry)) return std::nullopt;
  const auto name = static_cast<std::size_t>(little(head, 26, 2)), extra = static_cast<std::size_t>(little(head, 28, 2));
  std::string text(name + extra, '\0');
  if (!read_at(file, offset + kEntryHead, text)) return std::nullopt;
  EntryHead found;
  found.entry = {text.substr(0, name), static_cast<std::uint32_t>(little(head, 14, 4)), little(head, 22, 4), offset};
  found.packed = little(head, 18, 4);
  found.data = offset + kEntryHead + text.size();
  if (!widen(std::string_view(text).substr(name), std::array{&found.entry.bytes, &found.packed})) return std::nullopt;
  if (found.data > file_bytes || found.packed > file_bytes - found.data) return std::nullopt;
  found.stored = is_plain(head, 4) && little(head, 8, 2) == 0 && found.packed == found.entry.bytes;
  return found;
}

/// Whether an entry is a folder, as other programs write.
bool is_folder(const ContainerEntry& entry) { return entry.name.ends_with('/'); }

/// The whole entries of a file without a directory.
std::vector<ContainerEntry> walk(int file, std::uint64_t file_bytes, std::uint64_t& end) {
  std::vector<ContainerEntry> entries;
  end = 0;
  constexpr std::size_t kMaxEntries = kMaxDirectory / kDirectoryHead;  // of a directory that is read
  while (auto head = read_head(file, end, file_bytes)) {
    if (!head->stored || entries.size() == kMaxEntries) break;
    end = head->data + head->packed;
    if (!is_folder(head->entry)) entries.push_back(std::move(head->entry));
  }
  return entries;
}

/// Position, size and number of entries of the directory.
struct DirectoryRange {
  std::uint64_t offset = 0, bytes = 0, entries = 0;
};

std::optional<DirectoryRange> find_directory(int file, std::uint64_t file_bytes) {
  std::string tail(static_cast<std::size_t>(std::min<std::uint64_t>(file_bytes, kEndBytes + kLocatorBytes + UINT16_MAX)), '\0');
  if (!read_at(file, file_bytes - tail.size(), tail)) return std::nullopt;
  // The signature may also occur in the comment and in the numbers of the record.
  std::size_t at = tail.rfind(kEnd);
  const auto ends_there = [&] {
    return tail.size() - at >= kEndBytes && little(tail, at + 20, 2) == tail.size() - at - kEndBytes;
  };
  while (at != std::string::npos && !ends_there()) at = at == 0 ? std::string::npos : tail.rfind(kEnd, at - 1);
  if (at == std::string::npos) return std::nullopt;
  DirectoryRange range{little(tail, at + 16, 4), little(tail, at + 12, 4), little(tail, at + 10, 2)};
  std::uint64_t end = file_bytes - tail.size() + at;
  bool one_disk = little(tail, at + 4, 4) == 0 && little(tail, at + 8, 2) == range.entries;
  const bool wide = range.offset == UINT32_MAX || range.bytes == UINT32_MAX || range.entries == UINT16_MAX;
  if (wide && at >= kLocatorBytes && std::string_view(tail).substr(at - kLocatorBytes).starts_with(kLocator64)) {
    std::array<char, kEnd64Bytes> record{};
    const std::uint64_t position = end = little(tail, at - kLocatorBytes + 8, 8);
    if (position > file_bytes || file_bytes - position < record.size() || !read_at(file, position, record)) return std::nullopt;
    const std::string_view text(record.data(), record.size());
    if (!text.starts_with(kEnd64)) return std::nullopt;
    range = {little(text, 48, 8), little(text, 40, 8), little(text, 32, 8)};
    one_disk = one_disk && little(text, 16, 8) == 0 && little(text, 24, 8) == range.entries &&
               little(text, 14, 2) <= kMaxVersion && little(tail, at - kLocatorBytes + 4, 4) == 0 &&
               little(tail, at - kLocatorBytes + 16, 4) == 1;
  }
  // Nothing is between the directory and the records of its end.
  if (!one_disk || range.offset + range.bytes != end) return std::nullopt;
  if (range.bytes > std::min(file_bytes, kMaxDirectory) || range.offset > file_bytes - range.bytes) return std::nullopt;
  return range.entries <= range.bytes / kDirectoryHead ? std::optional(range) : std::nullopt;
}

/// "", or what is wrong with the directory.
std::string read_directory(int file, std::uint64_t file_bytes, std::vector<ContainerEntry>& entries, std::uint64_t& end) {
  const auto range = find_directory(file, file_bytes);
  if (!range) return "is no ZIP file, or its end is missing";
  std::string text(static_cast<std::size_t>(range->bytes), '\0');
  if (!read_at(file, range->offset, text)) return std::string(kUnreadable);
  std::string_view rest = text;
  for (std::uint64_t i = 0; i < range->entries; ++i) {
    if (rest.size() < kDirectoryHead || !rest.starts_with(kInDirectory)) return "its directory is damaged";
    const auto name = static_cast<std::size_t>(little(rest, 28, 2)), extra = static_cast<std::size_t>(little(rest, 30, 2)),
               comment = static_cast<std::size_t>(little(rest, 32, 2));
    if (rest.size() - kDirectoryHead < name + extra + comment) return "its directory is damaged";
    ContainerEntry entry{std::string(rest.substr(kDirectoryHead, name)), static_cast<std::uint32_t>(little(rest, 16, 4)),
                         little(rest, 24, 4), little(rest, 42, 4)};
    std::uint64_t packed = little(rest, 20, 4);
    if (!widen(rest.substr(kDirectoryHead + name, extra), std::array{&entry.bytes, &packed, &entry.header}))
      return "its directory is damaged";
    const std::size_t next = kDirectoryHead + name + extra + comment;
    if (is_folder(entry)) {
      rest.remove_prefix(next);
      continue;
    }
    if (little(rest, 10, 2) != 0 || packed != entry.bytes)
      return fmt::format("{} is compressed; unpack the file and name the folder", entry.name);
    if (!is_plain(rest, 6) || little(rest, 34, 2) != 0) return "its directory is damaged";
    if (entry.header > range->offset || entry.bytes > range->offset - entry.header) return "its directory is damaged";
    entries.push_back(std::move(entry));
    rest.remove_prefix(next);
  }
  if (!rest.empty()) return "its directory is damaged";
  std::ranges::sort(entries, {}, &ContainerEntry::header);
  for (std::size_t i = 0; i < entries.size(); ++i) {
    const std::uint64_t limit = i + 1 < entries.size() ? entries[i + 1].header : range->offset, from = entries[i].header;
    if (limit - from < kEntryHead + entries[i].name.size() + entries[i].bytes)
      return entries[i].name + " overlaps another entry";
  }
  end = range->offset;
  return {};
}

bool begins_like_container(int file, std::uint64_t bytes) {
  std::array<char, 4> magic{};
  return bytes >= kEntryHead && read_at(file, 0, magic) && std::string_view(magic.data(), 4) == kEntry;
}

bool is_unfinished(std::string_view path) { return path.ends_with(".part"); }

/// The entries of a container by their names.
struct Index {
  struct stat stamp {};
  std::vector<ContainerEntry> entries;  // sorted by name
  std::string fault;

  /// manifest.json, or manifest-2-of-5.json
  bool has_manifest() const {
    const auto at = std::ranges::lower_bound(entries, kOfShard, {}, &ContainerEntry::name);
    const bool shard = at != entries.end() && at->name.starts_with(kOfShard) && at->name.ends_with(".json");
    return shard || find(kManifest) != nullptr;
  }
  const ContainerEntry* find(std::string_view name) const {
    const auto at = std::ranges::lower_bound(entries, name, {}, &ContainerEntry::name);
    return at != entries.end() && at->name == name ? &*at : nullptr;
  }
};

std::string read_index(int file, std::string_view path, std::uint64_t bytes, std::vector<ContainerEntry>& entries,
                       std::uint64_t& end) {
  if (!is_unfinished(path)) return read_directory(file, bytes, entries, end);
  entries = walk(file, bytes, end);
  return {};
}

std::shared_ptr<const Index> index_of(const std::string& path, int file, const struct stat& now) {
  static RecentFiles<Index> recent;
  return recent.of(path, now, [&](Index& index) {
    std::uint64_t end = 0;
    index.fault = read_index(file, path, static_cast<std::uint64_t>(now.st_size), index.entries, end);
    std::ranges::sort(index.entries, {}, &ContainerEntry::name);
    const auto twice = std::ranges::adjacent_find(index.entries, {}, &ContainerEntry::name);
    if (twice != index.entries.end() && index.fault.empty()) index.fault = twice->name + " occurs twice";
    return index.fault != kUnreadable;
  });
}

/// A container that is open, and the rest of a path that leads through it; without an index if it leads through none.
struct Through {
  Descriptor file{-1};
  std::shared_ptr<const Index> index;
  std::string inside;
};

/// The part of a path that is a regular file, and what follows it; both empty without one.
std::pair<std::string, std::string> split(const std::string& path) {
  for (std::size_t at = path.rfind('/'); at != std::string::npos && at > 0; at = path.rfind('/', at - 1)) {
    struct stat status {};
    std::string outer = path.substr(0, at);
    if (::stat(outer.c_str(), &status) != 0) {
      if (errno == ENOTDIR) continue;
      break;
    }
    if (!S_ISREG(status.st_mode)) break;
    return {std::move(outer), fs::path(path.substr(at + 1)).lexically_normal().generic_string()};
  }
  return {};
}

Through open_container(const std::string& outer, std::string inside) {
  Descriptor file(outer.empty() ? -1 : ::open(outer.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK));
  struct stat status {};
  if (file.get() < 0 || ::fstat(file.get(), &status) != 0 || !S_ISREG(status.st_mode)) return {};
  if (!begins_like_container(file.get(), static_cast<std::uint64_t>(status.st_size))) return {};
  std::shared_ptr<const Index> index = index_of(outer, file.get(), status);
  return {std::move(file), std::move(index), std::move(inside)};
}

/// Whether an entry is a file of a job, so that other commands read no parts out of any ZIP file.
bool is_of_job(std::string_view inside) {
  return inside.starts_with("layers/") || inside.starts_with("program/") || inside == "inspection.json" ||
         (inside.starts_with("manifest") && inside.ends_with(".json"));
}

Through open_through(const std::string& path) {
  auto [outer, inside] = split(path);
  return is_of_job(inside) ? open_container(outer, std::move(inside)) : Through();
}

}  // namespace

Result<std::vector<ContainerEntry>> read_entries(const std::string& path, std::uint64_t* end) {
  const auto wrong = [&](std::string_view what) { return Error{Fault::kVerification, fmt::format("{}: {}", path, what)}; };
  const Descriptor file(::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK));
  struct stat status {};
  if (file.get() < 0 || ::fstat(file.get(), &status) != 0) return wrong(std::strerror(errno));
  if (!S_ISREG(status.st_mode)) return wrong("is no file");
  std::vector<ContainerEntry> entries;
  std::uint64_t last = 0;
  const std::string fault = read_index(file.get(), path, static_cast<std::uint64_t>(status.st_size), entries, last);
  if (!fault.empty()) return wrong(fault);
  if (const std::string& name = index_of(path, file.get(), status)->fault; !name.empty()) return wrong(name);
  if (end != nullptr) *end = last;
  return entries;
}

bool is_container(const std::string& path) {
  struct stat status {};
  if (::stat(path.c_str(), &status) != 0 || !S_ISREG(status.st_mode)) return false;
  const Through through = open_container(path, {});
  if (!through.index || !through.index->fault.empty()) return false;
  return is_unfinished(path) || through.index->has_manifest();
}

bool begins_like_job(const std::string& path) {
  const Descriptor file(::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK));
  std::array<char, kEntryHead + 8> head{};
  if (file.get() < 0 || !read_at(file.get(), 0, head)) return false;
  const std::string_view text(head.data(), head.size()), name = text.substr(kEntryHead);
  return text.starts_with(kEntry) && (name.starts_with("layers/") || name.starts_with("program/"));
}

bool is_job_folder(const std::string& path) {
  std::error_code ignored;
  return fs::is_directory(path, ignored) || is_container(path);
}

std::vector<std::string> misplaced_entries(const std::string& container) {
  std::vector<std::string> names;
  const auto entries = read_entries(container);
  if (!entries) return names;
  for (const ContainerEntry& entry : *entries) {
    const std::string_view name = entry.name;
    const std::size_t slash = name.find('/');
    const bool of_job = name.starts_with("layers/") || name.starts_with("program/");
    const bool outside =
        name.starts_with('/') || name.find("..") != std::string_view::npos || name.find('\\') != std::string_view::npos;
    if (outside || (of_job && name.find('/', slash + 1) != std::string_view::npos)) names.push_back(entry.name);
  }
  return names;
}

OpenedEntry open_entry(const std::string& path) {
  if (auto paged = open_in_pages(path)) return std::move(*paged);
  Through through = open_through(path);
  if (through.index && !through.index->fault.empty()) return {-1, 0, 0, through.index->fault};
  const ContainerEntry* entry = through.index ? through.index->find(through.inside) : nullptr;
  if (entry == nullptr) {
    errno = ENOENT;
    return {};
  }
  const auto head = read_head(through.file.get(), entry->header, static_cast<std::uint64_t>(through.index->stamp.st_size));
  if (!head || !head->stored || head->entry.name != entry->name || head->entry.bytes != entry->bytes ||
      head->entry.crc != entry->crc)
    return {-1, 0, 0, "is damaged in its container"};
  return {through.file.release(), head->data, entry->bytes, {}};
}

int copy_range(int file, std::uint64_t offset, std::uint64_t bytes) {
  if (bytes > kMaxCopied) {
    errno = EFBIG;
    return -1;
  }
  Descriptor copy(::memfd_create("entry", MFD_CLOEXEC));
  auto from = static_cast<off_t>(offset);
  for (std::uint64_t left = bytes; copy.get() >= 0 && left > 0;) {
    const ssize_t sent = ::sendfile(copy.get(), file, &from, static_cast<std::size_t>(left));
    if (sent < 0 && errno == EINTR) continue;
    if (sent == 0) errno = EIO;  // the container was cut
    if (sent <= 0) return -1;
    left -= static_cast<std::uint64_t>(sent);
  }
  if (copy.get() >= 0) ::lseek(copy.get(), 0, SEEK_SET);
  return copy.release();
}

bool has_its_sum(const std::string& container, const ContainerEntry& entry) {
  const Descriptor file(::open(container.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK));
  struct stat status {};
  if (file.get() < 0 || ::fstat(file.get(), &status) != 0) return false;
  const auto head = read_head(file.get(), entry.header, static_cast<std::uint64_t>(status.st_size));
  if (!head || !head->stored || head->entry.name != entry.name || head->entry.bytes != entry.bytes) return false;
  std::vector<char> piece(static_cast<std::size_t>(std::min<std::uint64_t>(entry.bytes, 256 << 10)));
  uLong sum = 0;
  for (std::uint64_t at = 0; at < entry.bytes; at += piece.size()) {
    const auto part = std::span(piece).first(static_cast<std::size_t>(std::min<std::uint64_t>(piece.size(), entry.bytes - at)));
    if (!read_at(file.get(), head->data + at, part)) return false;
    sum = crc32_z(sum, reinterpret_cast<const Bytef*>(part.data()), part.size());
  }
  return sum == entry.crc && head->entry.crc == entry.crc;
}

std::optional<std::uint64_t> entry_bytes(const std::string& path) {
  if (const auto paged = bytes_in_pages(path)) return paged;
  const Through through = open_through(path);
  const ContainerEntry* entry = through.index ? through.index->find(through.inside) : nullptr;
  return entry != nullptr ? std::optional(entry->bytes) : std::nullopt;
}

std::vector<std::string> names_in_folder(const std::string& folder) {
  std::vector<std::string> names;
  std::error_code error;
  if (fs::is_directory(folder, error)) {
    for (fs::directory_iterator at(folder, error), end; !error && at != end; at.increment(error))
      names.push_back(at->path().filename().string());
    return names;
  }
  auto [outer, inside] = fs::is_regular_file(folder, error) ? std::pair(folder, std::string()) : split(folder);
  const Through through = open_container(outer, std::move(inside));
  if (!through.index) return names_in_pages(folder);
  const std::string below = through.inside.empty() ? std::string() : through.inside + "/";
  for (const ContainerEntry& entry : through.index->entries) {
    if (!entry.name.starts_with(below)) continue;
    const std::string_view name = std::string_view(entry.name).substr(below.size());
    if (name.find('/') == std::string_view::npos) names.emplace_back(name);
  }
  return names;
}

}  // namespace lamina
