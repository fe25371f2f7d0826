#include "stages/support/hash/hash.h"

#include <fmt/format.h>
#include <xxhash.h>

#include <unistd.h>
#include <algorithm>
#include <cerrno>
#include <charconv>
#include <cstring>
#include <filesystem>
#include <new>
#include <utility>
#include <vector>

#include "stages/support/hash/tree.h"
#include "stages/support/io/file_reader.h"

namespace lamina {

Hash128 hash_bytes(std::span<const std::byte> bytes) {
  const XXH128_hash_t hash = XXH3_128bits(bytes.data(), bytes.size());
  return {hash.high64, hash.low64};
}

Hash128 hash_text(std::string_view text) { return hash_bytes(std::as_bytes(std::span(text))); }

std::string hex(const Hash128& hash) { return fmt::format("{:016x}{:016x}", hash.high, hash.low); }

bool read_hex(std::string_view text, Hash128& hash) {
  if (text.size() != 32) return false;
  const auto half = [&](std::size_t from, std::uint64_t& value) {
    const char* end = text.data() + from + 16;
    const auto [stop, error] = std::from_chars(text.data() + from, end, value, 16);
    return error == std::errc() && stop == end;
  };
  return half(0, hash.high) && half(16, hash.low);
}

Hasher::Hasher() : state_(XXH3_createState()) {
  if (state_ == nullptr) throw std::bad_alloc();
  XXH3_128bits_reset(static_cast<XXH3_state_t*>(state_));
}

Hasher::~Hasher() { XXH3_freeState(static_cast<XXH3_state_t*>(state_)); }

void Hasher::add(std::span<const std::byte> bytes) {
  XXH3_128bits_update(static_cast<XXH3_state_t*>(state_), bytes.data(), bytes.size());
}

Hash128 Hasher::take() {
  const XXH128_hash_t hash = XXH3_128bits_digest(static_cast<const XXH3_state_t*>(state_));
  XXH3_128bits_reset(static_cast<XXH3_state_t*>(state_));
  return {hash.high64, hash.low64};
}

Result<FileDigest> digest_file(const std::string& path, std::optional<std::uint64_t> expected) {
  auto file = FileReader::open(path, {.missing = std::strerror(ENOENT)});
  if (!file) return file.error();
  if (expected && file->size() != *expected) return FileDigest{file->size(), {}};
  Hasher hasher;
  // As small as the file: a batch has many small ones.
  std::vector<char> piece(static_cast<std::size_t>(std::min<std::uint64_t>(file->size() + 1, 256 << 10)));
  FileDigest digest;
  while (true) {
    const auto got = file->read(piece);
    if (!got) return got.error();
    digest.bytes += *got;
    hasher.add(std::as_bytes(std::span(piece).first(*got)));
    if (*got < piece.size()) break;  // of a regular file: its end
  }
  digest.hash = hasher.take();
  return digest;
}

Result<TreeDigest> digest_tree(const std::string& path) {
  namespace fs = std::filesystem;
  std::vector<fs::path> files;
  std::error_code error;
  if (fs::is_regular_file(path, error)) files.emplace_back(path);
  if (fs::is_directory(path, error)) {
    for (fs::recursive_directory_iterator at(path, error), end; !error && at != end; at.increment(error)) {
      std::error_code ignored;
      if (at->is_regular_file(ignored)) files.push_back(at->path());
    }
    if (error) return Error{Fault::kVerification, fmt::format("{}: {}", path, error.message())};
  }
  std::vector<std::pair<std::string, FileDigest>> digests;
  for (const fs::path& file : files) {
    const Result<FileDigest> one = digest_file(file.string());
    if (!one) return one.error();
    digests.emplace_back(file.lexically_relative(path).string(), *one);
  }
  return digest_of(std::move(digests));
}

std::optional<Hash128> digest_range(const FileReader& file, std::uint64_t offset, std::uint64_t bytes) {
  Hasher hasher;
  std::vector<char> piece(static_cast<std::size_t>(std::min<std::uint64_t>(bytes, 256 << 10)));
  while (bytes > 0) {
    const std::span<char> part = std::span(piece).first(static_cast<std::size_t>(std::min<std::uint64_t>(bytes, piece.size())));
    if (!file.read_at(offset, part)) return std::nullopt;
    hasher.add(std::as_bytes(part));
    offset += part.size();
    bytes -= part.size();
  }
  return hasher.take();
}

}  // namespace lamina
