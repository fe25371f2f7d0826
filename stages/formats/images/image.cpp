#include "stages/formats/images/image.h"

#include <fmt/format.h>

#include <unistd.h>
#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstdio>
#include <cstring>

#include "stages/data/bit_image.h"
#include "stages/data/shortage.h"
#include "stages/data/units.h"
#include "stages/formats/images/image_formats.h"
#include "stages/support/io/file_reader.h"
#include "stages/support/text/number_text.h"

namespace lamina::formats {
namespace {

/// By the first bytes, regardless of the file name.
Result<Image> read_by_magic(const FileReader& file, int threshold, std::uint64_t page, LevelSink* sink, Keep keep) {
  const std::string& path = file.path();
  unsigned char magic[8] = {};
  if (::pread(file.descriptor(), magic, sizeof magic, 0) < 0) {
    return Error{Fault::kVerification, fmt::format("{}: cannot read: {}", path, std::strerror(errno))};
  }
  const auto begins = [&](const char* text, std::size_t length) { return std::memcmp(magic, text, length) == 0; };
  if (begins("II", 2) || begins("MM", 2)) return read_tiff(file.descriptor(), file.size(), path, threshold, page, sink, keep);
  if (begins("\x89PNG\r\n\x1a\n", 8)) return read_png(file.descriptor(), file.size(), path, threshold, sink, keep);
  if (sink != nullptr && !sink->nearest)
    return Error{Fault::kVerification, path + ": neither TIFF nor PNG; plan the layer again"};
  const bool portable = magic[0] == 'P' && (magic[1] == '1' || magic[1] == '2' || magic[1] == '5');
  if (begins("P4", 2) || (threshold > 0 && portable)) return read_pbm(file, threshold, sink, keep);
  if (begins("BM", 2)) return read_bmp(file, threshold, sink, keep);
  return Error{Fault::kVerification, fmt::format("{}: neither TIFF nor PNG nor PBM (P4) nor BMP; plan the layer again", path)};
}

Result<Image> read_image(const std::string& path, int threshold, std::uint64_t page = 0, LevelSink* sink = nullptr,
                         Keep keep = Keep::kRuns) {
  const auto file = FileReader::open(path, {});
  if (!file) return file.error();
  return report_shortages(path, [&] { return read_by_magic(*file, threshold, page, sink, keep); });
}

}  // namespace

std::uint64_t Image::set() const { return bits ? bits->set_pixels() : counts.set + set_pixels(runs); }

double requested_dpi(double dpi) {
  constexpr double kMetresAnInch = 0.0254, kSlack = 1e-4;
  const double whole = std::round(dpi), per_metre = dpi / kMetresAnInch;
  const bool metric = std::abs(per_metre - std::round(per_metre)) < kSlack;
  return std::abs(dpi - whole) < (metric ? 0.02 : kSlack / 2) ? whole : dpi;
}

Result<Image> image(const std::string& path, std::uint8_t full, Keep keep) {
  if (full == 0) return read_image(path, 0, 0, nullptr, keep);
  Levels unused;
  return levels(path, full, unused);
}

Result<Image> levels(const std::string& path, std::uint8_t full, Levels& levels) {
  LevelSink sink{full, levels};
  auto image = read_image(path, 0, 0, &sink);
  if (!image) return image;
  threshold_levels(levels, 1, image->runs);
  image->rows = levels.view().rows();
  return image;
}

Result<Levels> image_levels(const std::string& path, std::uint8_t full) {
  Levels found;
  const auto image = full == 0 ? read_image(path, 0) : levels(path, full, found);
  if (!image) return image.error();
  if (full == 0) levels_of(image->runs, 1, found);
  return found;
}

namespace {

/// Of images of others: what is wrong is with the input.
Error of_others(Error error) {
  if (error.fault == Fault::kMemory) return error;
  constexpr std::string_view kAgain = "; plan the layer again";
  std::string& message = error.message;
  if (message.ends_with(kAgain)) message.resize(message.size() - kAgain.size());
  return Error{Fault::kInput, message + "; take grey or 1-bit PNG, TIFF, BMP or PBM"};
}

}  // namespace

Result<Image> nearest_levels(const std::string& path, const LevelsRequest& request, Levels& levels, Keep keep) {
  LevelSink sink{request.full, levels, true, request.invert};
  levels.row_offset.clear();
  auto image = read_image(path, 128, request.page, &sink, keep);
  if (!image) return of_others(image.error());
  if (image->bits) {
    if (request.invert) invert(*image->bits);
    return image;
  }
  if (levels.row_offset.empty()) {  // of 1 bit
    levels_of(request.invert ? inverse(image->runs) : std::move(image->runs), request.full, levels);
  }
  image->runs = {};
  image->rows = levels.view().rows();
  return image;
}

Result<GreyCounts> grey_counts(const std::string& path, std::uint64_t page) {
  GreyCounts counts;
  Levels unused;
  LevelSink sink{255, unused, true, false, &counts};
  const auto image = read_image(path, 128, page, &sink, Keep::kCounts);
  if (!image) return of_others(image.error());
  if (unused.row_offset.empty()) counts.darkness = 255 * image->counts.set;  // of 1 bit
  return counts;
}

Result<Image> dark_pixels(const std::string& path, int threshold, std::uint64_t page, Keep keep) {
  auto image = read_image(path, threshold, page, nullptr, keep);
  return image ? std::move(image) : of_others(image.error());
}

Result<std::vector<std::uint64_t>> pages_of(const std::string& path) {
  const auto file = FileReader::open(path, {.fault = Fault::kInput});
  if (!file) return file.error();
  char magic[2] = {};
  if (!file->read_at(0, magic)) return Error{Fault::kInput, path + ": is empty; use a complete image"};
  const bool is_tiff = (magic[0] == 'I' || magic[0] == 'M') && magic[1] == magic[0];
  if (!is_tiff) return std::vector<std::uint64_t>{0};
  return report_shortages(path, [&] { return tiff_pages(file->descriptor(), path); });
}

namespace {

/// "layer 3 of 6, z 0.1 to 0.15 mm", behind a title and before what else there is: "" if the description does not say so, or
/// says this layer.
std::string other_layer(const std::string& description, const Layer& layer) {
  const std::size_t begin = description.rfind("layer ");
  unsigned number = 0, of = 0;
  double bottom = 0, top = 0;
  int end = 0;
  if (begin == std::string::npos) return {};
  const std::string text = description.substr(begin);
  if (std::sscanf(text.c_str(), "layer %u of %u, z %lf to %lf mm%n", &number, &of, &bottom, &top, &end) != 4 || end == 0)
    return {};
  const std::int64_t lies = layer.bottom, ends = lies + layer.thickness;
  if (number == std::uint64_t{layer.index} + 1 && nm_of(bottom) == lies && nm_of(top) == ends) return {};
  return fmt::format("describes {}, the manifest says layer {} from {} to {} mm", text.substr(0, static_cast<std::size_t>(end)),
                     std::uint64_t{layer.index} + 1, number_text(mm(lies)), number_text(mm(ends)));
}

}  // namespace

std::string difference(const Image& image, const PixelGrid& grid, std::uint64_t set, const Layer& layer) {
  const std::uint32_t columns = image.columns, rows = image.rows;
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
  const std::uint64_t is_set = image.set();
  return is_set == set ? other_layer(image.description, layer)
                       : fmt::format("{} set pixels, the manifest says {}", is_set, set);
}

Runs inverse(const Runs& image) {
  Runs out;
  out.columns = image.columns;
  out.row_offset.assign(1, 0);
  for (std::uint32_t r = 0; r < image.view().rows(); ++r) {
    const auto row = image.view().row(r);
    const bool from_first = row.empty() || row.front() > 0, to_last = row.empty() || row.back() < image.columns;
    if (from_first) out.change.push_back(0);
    for (const std::uint32_t c : row)
      if (c > 0 && c < image.columns) out.change.push_back(c);
    if (to_last) out.change.push_back(image.columns);
    out.row_offset.push_back(static_cast<std::uint32_t>(out.change.size()));
  }
  return out;
}

void invert(BitImage& image) {
  const std::uint32_t last = image.columns() % 64;
  for (std::uint32_t r = 0; r < image.rows(); ++r) {
    const std::span<std::uint64_t> row = image.row(r);
    for (std::uint64_t& word : row) word = ~word;
    if (last != 0) row.back() &= (std::uint64_t{1} << last) - 1;
  }
}

// Rows of grey values become bits or levels.

namespace {

/// Bits before all values that are still to be read.
template <class ValueAt>
void put_bits(std::span<std::byte> row, std::uint32_t columns, int threshold, const ValueAt& value_at) {
  for (std::uint32_t first = 0; first < columns; first += 8) {
    unsigned bits = 0;
    for (std::uint32_t i = 0; i < 8 && first + i < columns; ++i) {
      bits |= static_cast<unsigned>(value_at(first + i) < threshold) << (7 - i);
    }
    row[first / 8] = static_cast<std::byte>(bits);
  }
}

}  // namespace

void bits_of_grey(std::span<std::byte> row, std::uint32_t columns, std::size_t step, bool second, int threshold) {
  const std::size_t offset = second ? 1 : 0;
  put_bits(row, columns, threshold, [&](std::size_t i) { return std::to_integer<int>(row[i * step + offset]); });
}

void bits_of_nibbles(std::span<std::byte> row, std::uint32_t columns, int threshold) {
  put_bits(row, columns, threshold, [&](std::size_t i) {
    const auto pair = std::to_integer<int>(row[i / 2]);
    return 17 * (i % 2 == 0 ? pair >> 4 : pair & 15);
  });
}

namespace {

/// The first byte of [from, to) that is another one; `to` if none is.
std::size_t first_other(std::span<const std::byte> row, std::size_t from, std::size_t to, std::byte byte) {
  std::uint64_t pattern = 0, word = 0;
  std::memset(&pattern, std::to_integer<int>(byte), sizeof pattern);
  for (; from + sizeof word <= to; from += sizeof word) {
    std::memcpy(&word, row.data() + from, sizeof word);
    if (word != pattern) break;
  }
  while (from < to && row[from] == byte) ++from;
  return from;
}

}  // namespace

Colours Colours::of_grey(unsigned maximum) {
  Colours colours;
  for (; colours.count <= maximum; ++colours.count)
    colours.grey[colours.count] = static_cast<std::uint8_t>(255 * colours.count / maximum);
  return colours;
}

void Colours::add(unsigned red, unsigned green, unsigned blue, unsigned opaque) {
  const unsigned light = (299 * red + 587 * green + 114 * blue + 500) / 1000;
  if (count < grey.size()) grey[count++] = static_cast<std::uint8_t>((light * opaque + 255 * (255 - opaque) + 127) / 255);
}

bool Colours::are_black_and_white() const {
  return count > 0 && std::all_of(grey.begin(), grey.begin() + std::min(count, 2u),
                                  [](std::uint8_t light) { return light == 0 || light == 255; });
}

bool widen_row(std::span<std::byte> row, std::uint32_t columns, unsigned bits, const Colours& colours) {
  unsigned highest = 0;
  if (bits == 8) {
    for (std::byte& value : row.first(columns)) {
      highest = std::max(highest, std::to_integer<unsigned>(value));
      value = std::byte{colours.grey[std::to_integer<unsigned>(value)]};
    }
    return highest < colours.count;
  }
  for (std::size_t column = columns; column-- > 0;) {  // from the end, so that no value is overwritten before it is read
    const std::size_t at = column * bits;
    const unsigned value = std::to_integer<unsigned>(row[at / 8]) >> (8 - bits - at % 8) & ((1u << bits) - 1);
    highest = std::max(highest, value);
    row[column] = std::byte{colours.grey[value]};
  }
  return highest < colours.count;
}

bool add_bits(std::span<std::byte> row, std::uint32_t columns, const Colours& colours, int threshold, RunsBuilder& builder) {
  const int below = threshold > 0 ? threshold : 128;
  const bool first = colours.grey[0] < below, second = colours.grey[1] < below;
  const std::span<std::byte> bits = row.first(row_bytes(columns));
  if (colours.count < 2) {
    const auto after_last = static_cast<unsigned>(8 * bits.size() - columns);
    bits.back() = bits.back() >> after_last << after_last;
    if (std::ranges::any_of(bits, [](std::byte byte) { return byte != std::byte{}; })) return false;
  } else if (first == second) {
    std::ranges::fill(bits, std::byte{});
  }
  return builder.add_row(bits, first);
}

bool LevelSink::add_row(std::span<const std::byte> row, std::uint32_t columns, unsigned bits, bool bright_is_low,
                        unsigned maximum) {
  const unsigned darkest = maximum > 0 ? maximum : (1u << bits) - 1;
  const auto value_at = [&](std::uint32_t column) -> unsigned {
    if (bits == 16) {
      return std::to_integer<unsigned>(row[2 * std::size_t{column}]) |
             std::to_integer<unsigned>(row[2 * std::size_t{column} + 1]) << 8;
    }
    const auto byte = std::to_integer<unsigned>(row[bits == 8 ? column : column / 2]);
    return bits == 8 ? byte : column % 2 == 0 ? byte >> 4 : byte & 15u;
  };
  for (std::uint32_t begin = 0; begin < columns;) {
    const unsigned value = value_at(begin), dark = bright_is_low != invert ? value : darkest - value;
    std::uint32_t end = begin + 1;
    if (bits == 8) end = static_cast<std::uint32_t>(first_other(row, end, columns, row[begin]));
    if (bits == 4)  // whole bytes of it from the next one on
      end =
          std::max(end, static_cast<std::uint32_t>(2 * first_other(row, (begin + 1) / 2, columns / 2, std::byte(17 * value))));
    while (end < columns && value_at(end) == value) ++end;
    if ((!nearest && dark * full % darkest != 0) || levels.level.size() >= UINT32_MAX / 2) return false;
    const auto level = static_cast<std::uint8_t>((2 * dark * full + darkest) / (2 * darkest));
    if (counts != nullptr) {
      counts->darkness += std::uint64_t{level} * (end - begin);
      counts->between += level > 0 && level < full ? end - begin : 0;
    } else {
      levels.append(begin, end, level);
    }
    begin = end;
  }
  if (counts != nullptr) return true;
  levels.end_row();
  return true;
}

}  // namespace lamina::formats
