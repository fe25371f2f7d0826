// stages/support/hash/hash.h: XXH3-128, the fingerprint of every file that a job leaves.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "stages/data/status.h"
#include "stages/support/io/file_reader.h"

namespace lamina {

/// XXH3-128 of some bytes.
struct Hash128 {
  std::uint64_t high = 0, low = 0;
  friend bool operator==(const Hash128&, const Hash128&) = default;
};

Hash128 hash_bytes(std::span<const std::byte> bytes);
Hash128 hash_text(std::string_view text);

/// 32 lower-case hexadecimal digits, high half first: what `xxhsum -H2` prints.
std::string hex(const Hash128& hash);
/// errors  false if the text is not 32 hexadecimal digits
bool read_hex(std::string_view text, Hash128& hash);

/// XXH3-128 of bytes that come in pieces.
class Hasher {
 public:
  Hasher();
  ~Hasher();
  Hasher(const Hasher&) = delete;
  Hasher& operator=(const Hasher&) = delete;
  void add(std::span<const std::byte> bytes);
  void add(std::string_view text) { add(std::as_bytes(std::span(text))); }
  /// Of all bytes since the last call.
  Hash128 take();

 private:
  void* state_;
};

struct FileDigest {
  std::uint64_t bytes = 0;
  Hash128 hash;
};

/// Size and hash of a file, read in pieces of 256 KiB. A file of another size than `expected` is not read: its hash is zero.
/// errors  kVerification with the file's name and the system's reason
Result<FileDigest> digest_file(const std::string& path, std::optional<std::uint64_t> expected = {});

struct TreeDigest {
  std::uint64_t files = 0, bytes = 0;
  Hash128 hash;  // of names, sizes and contents
};

/// The regular files at or below `path`, in the order of their names; no file if there is none.
/// errors  kVerification if one cannot be read
Result<TreeDigest> digest_tree(const std::string& path);

// --- the fingerprint of a stretch of a file.

/// XXH3-128 of `bytes` bytes from `offset` on, read in pieces of 256 KiB; nothing if the file is shorter.
std::optional<Hash128> digest_range(const FileReader& file, std::uint64_t offset, std::uint64_t bytes);

}  // namespace lamina
