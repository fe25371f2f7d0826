#include "stages/support/hash/hash.h"

#include <fmt/format.h>
#include <xxhash.h>

#include <unistd.h>
#include <algorithm>
#include <cerrno>
#include <charconv>
#include <cstring>
#include <filesystem>
#include <memory>
#include <vector>

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

Result<FileDigest> digest_file(const std::string& path, std::optional<std::uint64_t> expected) {
  auto file = FileReader::open(path, {.missing = std::strerror(ENOENT)});
  if (!file) return file.error();
  if (expected && file->size() != *expected) return FileDigest{file->size(), {}};
  const std::unique_ptr<XXH3_state_t, XXH_errorcode (*)(XXH3_state_t*)> state(XXH3_createState(), XXH3_freeState);
  XXH3_128bits_reset(state.get());
  std::vector<char> piece(256 << 10);
  FileDigest digest;
  while (true) {
    const ssize_t got = ::read(file->descriptor(), piece.data(), piece.size());
    if (got < 0 && errno == EINTR) continue;
    if (got < 0) return Error{Fault::kVerification, fmt::format("{}: {}", path, std::strerror(errno))};
    if (got == 0) break;
    digest.bytes += static_cast<std::uint64_t>(got);
    XXH3_128bits_update(state.get(), piece.data(), static_cast<std::size_t>(got));
  }
  const XXH128_hash_t hash = XXH3_128bits_digest(state.get());
  digest.hash = {hash.high64, hash.low64};
  return digest;
}

Result<TreeDigest> digest_tree(const std::string& path) {
  namespace fs = std::filesystem;
  TreeDigest digest;
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
  std::ranges::sort(files);
  std::string text;
  for (const fs::path& file : files) {
    const Result<FileDigest> one = digest_file(file.string());
    if (!one) return one.error();
    text += fmt::format("{} {} {}\n", file.lexically_relative(path).string(), one->bytes, hex(one->hash));
    digest.bytes += one->bytes;
  }
  digest.files = files.size();
  digest.hash = hash_text(text);
  return digest;
}

std::optional<Hash128> digest_range(const FileReader& file, std::uint64_t offset, std::uint64_t bytes) {
  const std::unique_ptr<XXH3_state_t, XXH_errorcode (*)(XXH3_state_t*)> state(XXH3_createState(), XXH3_freeState);
  XXH3_128bits_reset(state.get());
  std::vector<char> piece(static_cast<std::size_t>(std::min<std::uint64_t>(bytes, 256 << 10)));
  while (bytes > 0) {
    const std::span<char> part = std::span(piece).first(static_cast<std::size_t>(std::min<std::uint64_t>(bytes, piece.size())));
    if (!file.read_at(offset, part)) return std::nullopt;
    XXH3_128bits_update(state.get(), part.data(), part.size());
    offset += part.size();
    bytes -= part.size();
  }
  const XXH128_hash_t hash = XXH3_128bits_digest(state.get());
  return Hash128{hash.high64, hash.low64};
}

}  // namespace lamina
