// stages/formats/zip/zip.h: a ZIP archive of deflated or stored entries, written from front to back.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "stages/data/buffer.h"
#include "stages/data/status.h"
#include "stages/support/io/container.h"
#include "stages/support/io/file.h"

namespace lamina::formats {

/// Raw deflate data (RFC 1951) that end on a byte, without a last block: pieces one behind the other are one stream.
struct Deflated {
  Buffer<std::byte> bytes;
  std::uint32_t crc = 0;   // CRC-32 of what is deflated
  std::uint64_t size = 0;  // bytes of what is deflated
};

/// Deflates a piece and appends it. The bytes depend on the text, the cuts between pieces and the release of zlib alone.
/// errors  kOutput: memory ran out
/// cost    15 ns a byte; 270 kB while it runs
Status deflate_onto(Deflated& out, std::string_view text);

/// The date and time that all entries of an archive have, as a ZIP file holds them: the date in the upper half.
using ZipDate = std::uint32_t;
inline constexpr ZipDate kFirstZipDate = (1u << 5 | 1u) << 16;  // 1 January 1980, 0:00

/// The date in UTC of `seconds` after 1970, a whole number; that which is nearest of those that a ZIP file can hold.
/// text    that of SOURCE_DATE_EPOCH; nullptr or "" for the first day, so that the same entries give the same bytes
/// errors  kUsage: no number
/// source  https://reproducible-builds.org/specs/source-date-epoch/
Result<ZipDate> zip_date(const char* text);

/// The CRC-32 of an entry. cost  1 ns a byte
std::uint32_t crc_of(std::span<const std::byte> bytes);

/// Sizes and sums are before the data of an entry, so that readers need not search for its end.
///
/// source  PKWARE, APPNOTE.TXT 6.3.10, sections 4.3 and 4.5.3
class ZipWriter {
 public:
  /// file        has to outlive the writer; neither finished nor closed by it
  /// zip64_from  sizes and places from here on are written as Zip64; for tests
  explicit ZipWriter(File& file, ZipDate date = kFirstZipDate, std::uint64_t zip64_from = UINT32_MAX)
      : file_(file), date_(date), zip64_from_(zip64_from) {}

  /// Writes an entry of pieces that follow each other. errors  kOutput
  Status add(std::string_view name, std::span<const Deflated> pieces);
  /// Writes an entry as it is, without compression. crc  as of crc_of(). errors  kOutput
  Status store(std::string_view name, std::span<const std::byte> bytes, std::uint32_t crc);
  /// Adds an entry that the file already has, stored at that place. Before the first other one, in the order of the file.
  /// end  the offset behind it
  void keep(const ContainerEntry& entry, std::uint64_t end);
  /// Writes the directory of entries. errors  kOutput
  Status finish();

 private:
  struct Entry {
    std::string name;
    std::uint32_t crc;
    std::uint64_t packed, size, position;
    bool stored = false;
  };
  bool large(std::uint64_t number) const { return number >= zip64_from_; }
  std::string record(const Entry& entry, bool in_directory) const;

  File& file_;
  ZipDate date_;
  std::uint64_t zip64_from_;
  std::uint64_t written_ = 0;
  std::vector<Entry> entries_;
};

}  // namespace lamina::formats
