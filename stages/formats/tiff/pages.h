// stages/formats/tiff/pages.h: writes the TIFF files of images as the pages of one file, each as it is (layout: paged.h).
//
// The directory of a page repeats that of the file in it, with offsets into the whole file, and has the private tags. It is
// before the file: the position of the next one follows from the sizes, so that a job only appends, until its end.
#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <string>

#include "stages/data/status.h"
#include "stages/support/io/file.h"
#include "stages/support/io/paged.h"

namespace lamina::formats::tiff {

/// Reads bytes of an image's file; false if it has none there.
using ReadBytes = std::function<bool(std::uint64_t offset, std::span<char> to)>;

/// What is before the file in a page at `offset`: directory, values, bytes up to a multiple of 8.
/// file    of the image, a little-endian classic TIFF with one directory and strips
/// errors  kVerification: it is none; kOutput: the page would end beyond 4 GiB of a classic TIFF
/// source  TIFF 6.0 (Adobe 1992), section 2; BigTIFF, entries of 20 bytes whose values of up to 8 are in them
Result<std::string> page_head(const PageContent& content, std::uint64_t offset, bool big, const ReadBytes& file);

class PageWriter {
 public:
  /// file  has to outlive the writer; empty, or with the pages that are kept. big  BigTIFF, with offsets of 64 bits
  PageWriter(File& file, bool big) : file_(file), big_(big) {}

  /// content.bytes is that of `image`. errors  of page_head; kOutput
  Status add(const PageContent& content, std::span<const std::byte> image);
  /// The file ends with this page. Before the first other one. errors  kOutput
  Status keep(const JobPage& page);
  /// Ends the chain of pages. errors  kOutput
  Status finish();

 private:
  Status put_next(std::uint64_t offset);
  File& file_;
  bool big_;
  std::uint64_t last_directory_ = 0, last_entries_ = 0;
};

/// "", or how a page differs from what PageWriter makes of the file in it, as in "layers/000042.tif: ...". The file itself is
/// compared with a manifest by others.
/// pages  the file of all pages, for which `next` is right
std::string fault_of_page(const FileReader& pages, const JobPage& page, bool big);

/// "", or what is wrong with a finished file of pages, or with the unfinished NAME.part. cost  some reads a page
std::string fault_of_pages(const std::string& path);

}  // namespace lamina::formats::tiff
