// stages/write/package/zip.h: a ZIP archive of deflated entries, written from front to back.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "stages/data/status.h"
#include "stages/write/file.h"
#include "stages/write/package/deflate.h"

namespace lamina::write {

/// Sizes and sums stand before the data of an entry, so that readers need not look for its end. Every entry is of 1 January
/// 1980, the first day that a ZIP file knows: the same entries give the same bytes.
///
/// source  PKWARE, APPNOTE.TXT 6.3.10, sections 4.3 and 4.5.3
class ZipWriter {
 public:
  /// file        has to outlive the writer; neither finished nor closed by it
  /// zip64_from  sizes and places from here on are written as Zip64; for tests
  explicit ZipWriter(File& file, std::uint64_t zip64_from = UINT32_MAX) : file_(file), zip64_from_(zip64_from) {}

  /// Writes an entry of pieces that follow each other. errors  kOutput
  Status add(std::string_view name, std::span<const Deflated> pieces);
  /// Writes the directory of entries. errors  kOutput
  Status finish();

 private:
  struct Entry {
    std::string name;
    std::uint32_t crc;
    std::uint64_t packed, size, place;
  };
  bool large(std::uint64_t number) const { return number >= zip64_from_; }
  std::string record(const Entry& entry, bool in_directory) const;

  File& file_;
  std::uint64_t zip64_from_;
  std::uint64_t written_ = 0;
  std::vector<Entry> entries_;
};

}  // namespace lamina::write
