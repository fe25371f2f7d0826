#include "stages/formats/images/stack_info.h"

#include <fmt/format.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <filesystem>

#include "stages/data/shortage.h"
#include "stages/formats/images/image.h"
#include "stages/formats/images/image_formats.h"
#include "stages/formats/images/layer_images.h"
#include "stages/formats/tiff/input.h"
#include "stages/support/io/file_reader.h"
#include "stages/support/memory_gate.h"
#include "stages/support/text/json_value.h"
#include "stages/support/text/number_text.h"
#include "stages/support/text/readable.h"

namespace lamina::formats {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kMaxWrong = 20;  // lines
/// Memory of an image that is read for its counts: of some rows, and of a strip as coded.
constexpr std::uint64_t kRowsBytes = 4 << 20, kMaxStripBytes = 64 << 20;

struct ImageFile {
  const std::string* path;
  std::uint64_t page;
  std::string name() const { return page == 0 ? one_line(*path) : fmt::format("{}: page at byte {}", one_line(*path), page); }
};

/// One image.
struct ImageInspection {
  std::string wrong;  // why it cannot be read
  Fault fault = Fault::kInput;
  ImageKind kind;
  std::uint32_t columns = 0, rows = 0;
  double dpi_x = 0, dpi_y = 0;
  std::uint64_t set = 0, grey = 0, light = 0;  // light: sum of darkness, of 255
};

ImageInspection inspect_image(const ImageFile& position, int threshold) {
  ImageInspection inspection;
  const auto refuse = [&](const Error& error) {
    inspection.wrong = one_line(error.message);
    inspection.fault = error.fault;
    return inspection;
  };
  auto kind = kind_of(*position.path, position.page);
  if (!kind) return refuse(kind.error());
  const auto image = dark_pixels(*position.path, threshold, position.page, Keep::kCounts);
  if (!image) return refuse(image.error());
  inspection.kind = std::move(*kind);
  inspection.columns = image->columns;
  inspection.rows = image->rows;
  inspection.dpi_x = image->dpi_x;
  inspection.dpi_y = image->dpi_y;
  inspection.set = image->counts.set;
  inspection.light = 255 * inspection.set;
  if (inspection.kind.bits == 1) return inspection;
  const auto grey = grey_counts(*position.path, position.page);
  if (!grey) return refuse(grey.error());
  inspection.light = grey->darkness;
  inspection.grey = grey->between;
  return inspection;
}

/// Why an image cannot be a layer of the same stack as the first one.
std::string differs(const ImageInspection& inspection, const StackInfo& first) {
  if (inspection.columns != first.columns || inspection.rows != first.rows)
    return fmt::format("{} x {} pixels, the first image has {} x {}", inspection.columns, inspection.rows, first.columns,
                       first.rows);
  if (std::abs(inspection.dpi_x - first.dpi_x) > 0.05 || std::abs(inspection.dpi_y - first.dpi_y) > 0.05)
    return fmt::format("{:g} x {:g} dpi, the first image has {:g} x {:g}", inspection.dpi_x, inspection.dpi_y, first.dpi_x,
                       first.dpi_y);
  return {};
}

void add_image(const ImageFile& position, const ImageInspection& inspection, StackInfo& info) {
  std::string wrong = inspection.wrong;
  if (!wrong.empty()) {
    ++info.unreadable;
  } else if (wrong = differs(inspection, info); !wrong.empty()) {
    ++info.differing;
    wrong = fmt::format("{}: {}", position.name(), wrong);
  }
  if (!wrong.empty() && info.wrong.size() < kMaxWrong) info.wrong.push_back(std::move(wrong));
  if (!inspection.wrong.empty()) return;
  info.set += inspection.set;
  info.grey += inspection.grey;
  info.filled += static_cast<double>(inspection.light) / 255;
  info.empty += inspection.set == 0;
  info.min_set = std::min(info.min_set, inspection.set);
  info.max_set = std::max(info.max_set, inspection.set);
  // The kind is reported as long as all are of one kind.
  if (inspection.kind.format != info.kind.format) info.kind.format = "several formats";
  if (inspection.kind.light != info.kind.light) info.kind.light = "0 is white in some";
  if (inspection.kind.coding != info.kind.coding) info.kind.coding = "several codings";
  info.kind.bits = std::max(info.kind.bits, inspection.kind.bits);
}

std::string ranges_text(const StackInfo& info) {
  std::string text;
  for (std::size_t i = 0; i < std::min(info.missing.size(), kMaxWrong); ++i) {
    const auto [from, to] = info.missing[i];
    text += fmt::format("{}{}", i == 0 ? "" : ", ", from == to ? fmt::format("{}", from) : fmt::format("{} to {}", from, to));
  }
  return text + (info.missing.size() > kMaxWrong ? ", ..." : "");
}

}  // namespace

std::uint64_t StackInfo::missing_numbers() const {
  std::uint64_t sum = 0;
  for (const auto& [from, to] : missing) sum += to - from + 1;
  return sum;
}

Result<StackInfo> inspect_stack(const std::string& path, int threshold, std::uint64_t memory) {
  StackInfo info;
  info.path = path;
  std::error_code ignored;
  info.folder = fs::is_directory(path, ignored);
  std::vector<Numbered> files{{0, path}};
  if (info.folder) {
    auto found = numbered_images(path, true);
    if (!found) return found.error();
    files = std::move(*found);
    info.first_number = files.front().number;
    info.last_number = files.back().number;
    for (std::size_t i = 1; i < files.size(); ++i) {
      if (files[i].number != files[i - 1].number + 1) info.missing.push_back({files[i - 1].number + 1, files[i].number - 1});
    }
  }
  info.files = files.size();
  std::vector<ImageFile> positions;
  for (const Numbered& file : files) {
    const auto pages = pages_of(file.path);
    if (!pages && (info.files == 1 || pages.error().fault == Fault::kMemory)) return pages.error();
    if (!pages) {
      positions.push_back({&file.path, 0});  // says what is wrong when it is read
      continue;
    }
    for (const std::uint64_t page : *pages) positions.push_back({&file.path, page});
    if (info.folder && pages->size() > 1)
      info.wrong.push_back(fmt::format("{}: contains {} images; give the file itself, or write one image per file",
                                       one_line(file.path), pages->size()));
  }
  info.images = positions.size();
  std::vector<ImageInspection> inspections(positions.size());
  MemoryGate gate(memory);
  tbb::parallel_for(std::size_t{0}, positions.size(), [&](std::size_t i) {
    std::error_code unknown;
    const std::uintmax_t bytes = fs::file_size(*positions[i].path, unknown);
    const auto pass = gate.enter(kRowsBytes + (unknown ? 0 : std::min<std::uint64_t>(bytes, kMaxStripBytes)));
    inspections[i] = inspect_image(positions[i], threshold);
  });
  const auto stopped = std::ranges::find(inspections, Fault::kMemory, &ImageInspection::fault);
  if (stopped != inspections.end()) return Error{Fault::kMemory, stopped->wrong};
  const auto first =
      std::ranges::find_if(inspections, [](const ImageInspection& inspection) { return inspection.wrong.empty(); });
  if (first == inspections.end()) return Error{Fault::kInput, inspections.front().wrong};
  info.kind = first->kind;
  info.columns = first->columns;
  info.rows = first->rows;
  info.dpi_x = first->dpi_x;
  info.dpi_y = first->dpi_y;
  info.min_set = UINT64_MAX;
  for (std::size_t i = 0; i < inspections.size(); ++i) add_image(positions[i], inspections[i], info);
  return info;
}

std::string as_text(const StackInfo& info) {
  std::string text = one_line(info.path) + "\n";
  const auto line = [&](std::string_view name, const std::string& what) { text += fmt::format("  {:<12}{}\n", name, what); };
  const std::string in = !info.folder && info.images > 1 ? " on pages of one file" : "";
  line("images", fmt::format("{} {}{}: {} bit{}, {}, coded {}", info.images, info.kind.format, in, info.kind.bits,
                             info.kind.bits > 1 ? "s" : "", info.kind.light, info.kind.coding));
  if (info.folder) {
    line("numbers",
         fmt::format("{} to {}{}", info.first_number, info.last_number,
                     info.missing.empty() ? "" : fmt::format("; {} missing: {}", info.missing_numbers(), ranges_text(info))));
  }
  const bool reported = info.dpi_x > 0 && info.dpi_y > 0;
  line("size", fmt::format("{} x {} pixels{}", info.columns, info.rows,
                           reported ? fmt::format(" of {:.6g} x {:.6g} dpi: {:.3f} x {:.3f} mm", info.dpi_x, info.dpi_y,
                                                  info.columns * 25.4 / info.dpi_x, info.rows * 25.4 / info.dpi_y)
                                    : "; the files state no resolution"));
  line("set", fmt::format("{} pixels, {} to {} an image{}", readable_count(info.set), readable_count(info.min_set),
                          readable_count(info.max_set), info.empty > 0 ? fmt::format("; {} of them empty", info.empty) : ""));
  if (info.kind.bits > 1)
    line("grey", fmt::format("{} pixels between white and black; all come to {} full ones", readable_count(info.grey),
                             readable_count(static_cast<std::uint64_t>(std::llround(info.filled)))));
  for (const std::string& wrong : info.wrong) line("wrong", wrong);
  if (const std::uint64_t more = info.unreadable + info.differing; more > info.wrong.size())
    line("wrong", fmt::format("{} images in all", more));
  return text;
}

Json as_json(const StackInfo& info) {
  Json json = {{"path", info.path},
               {"kind", "images"},
               {"files", info.files},
               {"images", info.images},
               {"format", info.kind.format},
               {"bits", info.kind.bits},
               {"photometric", info.kind.light},
               {"compression", info.kind.coding},
               {"columns", info.columns},
               {"rows", info.rows},
               {"dpi", nullptr},
               {"set_pixels", info.set},
               {"min_set_pixels", info.min_set},
               {"max_set_pixels", info.max_set},
               {"empty_images", info.empty},
               {"grey_pixels", info.grey},
               {"filled_pixels", info.filled},
               {"unreadable_images", info.unreadable},
               {"differing_images", info.differing},
               {"wrong", info.wrong}};
  if (info.dpi_x > 0 && info.dpi_y > 0) json["dpi"] = {info.dpi_x, info.dpi_y};
  if (info.folder) json["numbers"] = {{"first", info.first_number}, {"last", info.last_number}, {"missing", info.missing}};
  return json;
}

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
  const tiff::Input input(file, path, page);
  TIFF* const handle = input.handle();
  if (handle == nullptr) return Error{Fault::kInput, fmt::format("{}: not a complete TIFF: {}", path, input.message)};
  std::uint16_t bits = 1, photometric = PHOTOMETRIC_MINISWHITE, compression = COMPRESSION_NONE;
  TIFFGetFieldDefaulted(handle, TIFFTAG_BITSPERSAMPLE, &bits);
  TIFFGetFieldDefaulted(handle, TIFFTAG_COMPRESSION, &compression);
  TIFFGetField(handle, TIFFTAG_PHOTOMETRIC, &photometric);
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
    return Error{Fault::kInput, path + ": cannot be read; use a complete image"};
  const auto begins = [&](const char* text, std::size_t length) { return std::memcmp(head, text, length) == 0; };
  if (begins("II", 2) || begins("MM", 2))
    return report_shortages(path, [&] { return tiff_kind(file->descriptor(), path, page); });
  if (begins("\x89PNG", 4)) return ImageKind{"PNG", head[24], head[25] == 3 ? "by its palette" : "0 is black", "deflate"};
  if (begins("BM", 2)) return ImageKind{"BMP", head[28], "by its palette", "none"};
  if (begins("P4", 2)) return ImageKind{"PBM", 1, "0 is white", "none"};
  if (begins("P1", 2)) return ImageKind{"PBM", 1, "0 is white", "ASCII"};
  if (begins("P5", 2)) return ImageKind{"PGM", pgm_bits(*file), "0 is black", "none"};
  if (begins("P2", 2)) return ImageKind{"PGM", pgm_bits(*file), "0 is black", "ASCII"};
  return Error{Fault::kInput, path + ": neither TIFF nor PNG nor BMP nor PBM nor PGM"};
}

}  // namespace lamina::formats
