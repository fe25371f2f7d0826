#include "stages/read/image.h"

#include <fmt/format.h>
#include <unistd.h>

#include <cerrno>
#include <cmath>
#include <cstring>
#include <new>

#include "stages/data/input/file_reader.h"
#include "stages/read/image_formats.h"

namespace lamina::read {
namespace {

/// By the first bytes, whatever the name says.
Result<Image> read_by_magic(int file, std::uint64_t bytes, const std::string& path) {
  unsigned char magic[8] = {};
  if (::pread(file, magic, sizeof magic, 0) < 0) {
    return Error{Fault::kVerification, fmt::format("{}: cannot read: {}", path, std::strerror(errno))};
  }
  const auto begins = [&](const char* text, std::size_t length) { return std::memcmp(magic, text, length) == 0; };
  if (begins("II", 2) || begins("MM", 2)) return tiff(file, bytes, path);
  if (begins("\x89PNG\r\n\x1a\n", 8)) return png(file, bytes, path);
  if (begins("P4", 2)) return pbm(file, bytes, path);
  return Error{Fault::kVerification, fmt::format("{}: neither TIFF nor PNG nor PBM (P4); plan the layer again", path)};
}

}  // namespace

Result<Image> image(const std::string& path) {
  const auto file = FileReader::open(path, {});
  if (!file) return file.error();
  try {
    return read_by_magic(file->descriptor(), file->size(), path);
  } catch (const std::bad_alloc&) {
    return Error{Fault::kVerification, fmt::format("{}: too many runs for the memory", path)};
  }
}

std::string difference(const Image& image, const PixelGrid& grid, std::uint64_t set) {
  const std::uint32_t columns = image.runs.columns, rows = image.runs.view().rows();
  if (columns != grid.columns() || rows != grid.rows()) {
    return fmt::format("{} x {} pixels, the manifest says {} x {}", columns, rows, grid.columns(), grid.rows());
  }
  const auto dpi_differs = [](double dpi, double recorded) {
    // PNG stores whole pixels a metre, so that 600 dpi reads as 599.999.
    return dpi != 0 && std::abs(dpi - recorded) > 0.02;
  };
  if (dpi_differs(image.dpi_x, grid.x.dpi()) || dpi_differs(image.dpi_y, grid.y.dpi())) {
    return fmt::format("{} x {} dpi, the manifest says {} x {}", image.dpi_x, image.dpi_y, grid.x.dpi(), grid.y.dpi());
  }
  const std::uint64_t is_set = set_pixels(image.runs);
  return is_set == set ? "" : fmt::format("{} set pixels, the manifest says {}", is_set, set);
}

}  // namespace lamina::read
