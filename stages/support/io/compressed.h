// stages/support/io/compressed.h: files of one Zstandard frame (RFC 8878), written and read in pieces.
//
// A file whose name ends in .zst has the frame, with the size of its content; every other file has the content.
// Sizes and hashes are those of the content, because the bytes of a frame depend on the version of libzstd. A frame has no
// checksum of its own: readers compare the content's hash.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "stages/data/status.h"
#include "stages/support/hash/hash.h"
#include "stages/support/io/file.h"

namespace lamina {

inline constexpr std::string_view kCompressedEnd = ".zst";

/// Whether a file of this name has a frame.
inline bool is_compressed(std::string_view name) { return name.ends_with(kCompressedEnd); }

/// Writes the content of a file, compressed if its name says so; reused by later files.
class ContentWriter {
 public:
  ContentWriter();
  ContentWriter(ContentWriter&&) noexcept;
  ContentWriter& operator=(ContentWriter&&) noexcept;
  ~ContentWriter();

  /// Begins a file; one that was not finished is removed. errors  of File::open
  Status open(const std::string& path, const FileOptions& options);
  /// Begins a content that is only measured.
  Status open_nowhere(bool compressed);
  /// Begins a content that is kept in memory, for stored().
  Status open_in_memory(bool compressed);
  /// errors  of File::append; kMemory
  Status append(std::span<const std::byte> bytes);
  /// Gives the file its name. returns  the size and the hash of the content
  Result<FileDigest> finish();
  /// Of the last finished file.
  std::uint64_t stored_bytes() const;
  /// Its bytes, if it is in memory; valid until the next one begins.
  std::span<const std::byte> stored() const;

  /// Of its buffers, now and at most.
  std::uint64_t bytes() const;
  static constexpr std::uint64_t kMaxBytes = 4 << 20;

 private:
  struct State;
  Status begin(const std::string& path, const FileOptions& options, bool compressed);
  std::unique_ptr<State> state_;
};

/// Writes a whole file. errors  of ContentWriter
Status write_content(const std::string& path, std::span<const std::byte> content, const FileOptions& options);

/// Passes the content of a file on, in pieces of at most 256 KiB. Windows above 8 MiB are refused, so that memory is bounded.
/// max_bytes  of the content
/// errors     kVerification with the file's name: missing; no frame, damaged, cut off, more than one frame, more content than
///            its head states or than max_bytes; of `take`
Status expand_file(const std::string& path, std::uint64_t max_bytes,
                   const std::function<Status(std::span<const std::byte>)>& take);

/// The content of a file. errors  of expand_file
Result<std::string> read_content(const std::string& path, std::uint64_t max_bytes);
/// The same into memory that is used again.
Status read_content(const std::string& path, std::uint64_t max_bytes, std::string& content);

/// As digest_file(), of the content. A file whose frame states another size than `expected` is not expanded; without one at
/// most 16 MiB are.
/// errors  of expand_file
Result<FileDigest> digest_content(const std::string& path, std::optional<std::uint64_t> expected);

/// "", or how a file cannot have a content of that size, by its frame's head and length alone; the content is not expanded.
std::string fault_of_stored(const std::string& path, std::uint64_t content_bytes);

}  // namespace lamina
