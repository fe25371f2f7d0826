#include <fmt/format.h>
#include <unistd.h>

#include <cstring>

#include "stages/formats/images/stack_info.h"
#include "stages/support/io/file_reader.h"
#include "stages/support/late/tiff.h"

namespace lamina::read {
namespace {

std::string tiff_coding(std::uint16_t compression) {
  switch (compression) {
    case COMPRESSION_NONE: return "none";
    case COMPRESSION_CCITTRLE: return "CCITT RLE";
    case COMPRESSION_CCITTFAX3: return "Group 3";
    case COMPRESSION_CCITTFAX4: return "Group 4";
    case COMPRESSION_LZW: return "LZW";
    case COMPRESSION_PACKBITS: return "PackBits";
    case COMPRESSION_ADOBE_DEFLATE:
    case COMPRESSION_DEFLATE: return "deflate";
    default: return fmt::format("compression {}", compression);
  }
}

Result<ImageKind> tiff_kind(int file, const std::string& path, std::uint64_t page) {
  std::string message;
  const auto options = strict_tiff_options(message);
  const int own_file = ::dup(file);
  const TiffHandle handle(options != nullptr && own_file >= 0 ? TIFFFdOpenExt(own_file, path.c_str(), "rCm", options.get())
                                                              : nullptr);
  if (handle == nullptr && own_file >= 0) ::close(own_file);
  if (handle == nullptr || (page != 0 && TIFFSetSubDirectory(handle.get(), page) == 0))
    return Error{Fault::kInput, fmt::format("{}: not a whole TIFF: {}", path, message)};
  std::uint16_t bits = 1, photometric = PHOTOMETRIC_MINISWHITE, compression = COMPRESSION_NONE;
  TIFFGetFieldDefaulted(handle.get(), TIFFTAG_BITSPERSAMPLE, &bits);
  TIFFGetFieldDefaulted(handle.get(), TIFFTAG_COMPRESSION, &compression);
  TIFFGetField(handle.get(), TIFFTAG_PHOTOMETRIC, &photometric);
  const bool white = photometric == PHOTOMETRIC_MINISWHITE, black = photometric == PHOTOMETRIC_MINISBLACK;
  return ImageKind{"TIFF", bits,
                   white   ? "0 is white"
                   : black ? "0 is black"
                           : fmt::format("photometric {}", photometric),
                   tiff_coding(compression)};
}

}  // namespace

Result<ImageKind> kind_of(const std::string& path, std::uint64_t page) {
  const auto file = FileReader::open(path, {.fault = Fault::kInput});
  if (!file) return file.error();
  unsigned char head[34] = {};
  if (!file->read_at(0, std::span(reinterpret_cast<char*>(head), std::min<std::uint64_t>(sizeof head, file->size()))))
    return Error{Fault::kInput, path + ": cannot be read; take a whole image"};
  const auto begins = [&](const char* text, std::size_t length) { return std::memcmp(head, text, length) == 0; };
  if (begins("II", 2) || begins("MM", 2)) return tiff_kind(file->descriptor(), path, page);
  if (begins("\x89PNG", 4)) return ImageKind{"PNG", head[24], head[25] == 3 ? "by its palette" : "0 is black", "deflate"};
  if (begins("BM", 2)) return ImageKind{"BMP", head[28], "by its palette", "none"};
  if (begins("P4", 2)) return ImageKind{"PBM", 1, "0 is white", "none"};
  if (begins("P5", 2)) return ImageKind{"PGM", 8, "0 is black", "none"};
  return Error{Fault::kInput, path + ": neither TIFF nor PNG nor BMP nor PBM nor PGM"};
}

}  // namespace lamina::read
