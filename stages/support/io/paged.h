// stages/support/io/paged.h: reads the files of a job whose layers are the pages of one TIFF file.
//
//   DIR/layers.tif    a page an image; each contains the file of the image as it is
//   DIR/program.EXT   the print program: start, layers, end
//   DIR/machine.toml
//
// DIR/layers/000042.tif is the file in a page and DIR/program/000042.EXT the part of the program that the page names, if there
// is no folder of that name. A job that runs has layers.tif.part and program.EXT.part, and the pages that are whole.
//
// A page is its directory, the values of that, and the file of the image; all three begin at multiples of 8 bytes. The header
// is followed by the first page, a page by the next one. Private tags of a directory:
//   65000  two LONG or LONG8: offset and size of the image's file        65001  ASCII: its name, layers/000042.tif
//   65002  two LONG or LONG8: offset and size of the layer's part of program.EXT; of the first image of a layer with a program
//   65003  ASCII: the name of that part, program/000042.EXT
// source  TIFF 6.0 (Adobe 1992), section 2; BigTIFF (https://libtiff.gitlab.io/libtiff/specification/bigtiff.html)
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "stages/data/status.h"
#include "stages/support/io/container.h"

namespace lamina {

inline constexpr std::string_view kPagesFile = "layers.tif";
inline constexpr std::uint16_t kFileRangeTag = 65000, kFileNameTag = 65001, kProgramRangeTag = 65002, kProgramNameTag = 65003;

/// The next multiple of 8.
constexpr std::uint64_t page_aligned(std::uint64_t offset) { return (offset + 7) & ~std::uint64_t{7}; }

/// Sizes of the parts of a classic TIFF or a BigTIFF, in bytes.
struct TiffSizes {
  std::size_t header, count, entry, offset;  // of the file, of the number of entries, of an entry, of an offset
};
constexpr TiffSizes tiff_sizes(bool big) { return big ? TiffSizes{16, 8, 20, 8} : TiffSizes{8, 2, 12, 4}; }

/// What the private tags of a page state.
struct PageContent {
  std::string name, program;  // program: "" without
  std::uint64_t bytes = 0, program_offset = 0, program_bytes = 0;
};

struct JobPage {
  PageContent content;
  std::uint64_t directory = 0, file = 0;  // offsets of the directory and of the image's file
  std::uint64_t entries = 0;              // of the directory
  std::uint64_t next = 0;                 // offset of the next directory; 0: this is the last page
  std::uint64_t end() const { return page_aligned(file + content.bytes); }
};

/// The pages of a file, in their order.
struct PageList {
  bool big = false;  // BigTIFF
  std::vector<JobPage> pages;
  std::string fault;  // "", or why there are no more pages, as in "page 3: its directory is damaged"
};

/// Of NAME.part the pages that are whole, without a fault.
/// errors  kVerification: cannot be read, no such file
/// cost    two reads a page
Result<PageList> read_pages(const std::string& path);

/// DIR/layers.tif, or that with .part; "" if a job's directory has neither. Of files that are not of lamina the first counts
/// as absent.
std::string pages_path(const std::string& directory);

/// Whether a path may be one of a file in a page: DIR/layers/NAME or DIR/program/NAME. cost  no system call
bool is_page_name(std::string_view path);

/// Opens a file in a page, or a part of a program; nothing if the path leads through no pages.
std::optional<OpenedEntry> open_in_pages(const std::string& path);
/// The size of such a file; nothing if there is none.
std::optional<std::uint64_t> bytes_in_pages(const std::string& path);
/// The names in DIR/layers or DIR/program, as of names_in_folder().
std::vector<std::string> names_in_pages(const std::string& folder);

/// The files of such a job in its directory: layers.tif, program.*, machine.toml, with .part or without; none if it is no
/// such job.
std::vector<std::string> paged_job_files(const std::string& directory);

}  // namespace lamina
