// Layer images: TIFF, PNG, PBM.
#include "stages/read/image.h"

#include <zlib.h>

#include <cstring>

#include "stages/write/image_format.h"
#include "tests/fuzz/laws.h"
#include "tests/program/machines.h"

namespace lamina::fuzz {
namespace {

std::string encoded(std::string_view format, const RunsView& runs, double dpi_x, double dpi_y) {
  write::Bytes bytes;
  const auto encoder = write::find_image_format(format)->make_encoder();
  const Status done = encoder->encode(runs, dpi_x, dpi_y, bytes);
  law(done.ok(), done.ok() ? "" : done.error().message.c_str());
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

bool same(const RunsView& a, const RunsView& b) {
  return a.columns == b.columns && std::ranges::equal(a.row_offset, b.row_offset) && std::ranges::equal(a.change, b.change);
}

bool read_image(std::string_view bytes) {
  static MemoryFile file("000000.tif");
  const auto image = read::image(file.hold(bytes));
  if (!image) return check_error(image.error()), false;
  check_runs(image->runs);
  // Whatever was read is written and read as the same image, unless it is so large that this takes long.
  const std::uint64_t pixels = std::uint64_t{image->runs.columns} * image->runs.view().rows();
  if (pixels > 1 << 16) return true;
  constexpr std::string_view kFormats[] = {"tiff-g4", "tiff-packbits", "png", "pbm"};
  Dice dice(bytes);
  const auto again = read::image(file.hold(encoded(kFormats[dice.below(4)], image->runs, 600, 300)));
  law(again.ok(), again.ok() ? "" : again.error().message.c_str());
  law(same(again->runs, image->runs), "an image that was written reads back as another one");
  return true;
}

std::vector<std::string> seeds_of(std::initializer_list<std::string_view> formats) {
  program::testing::Random random(5);
  std::vector<std::string> seeds;
  for (const std::string_view format : formats) {
    for (const auto& [columns, rows] : {std::pair{17u, 5u}, {64u, 40u}, {1u, 1u}}) {
      seeds.push_back(
          encoded(format, program::testing::runs_of(program::testing::random_image(random, columns, rows)), 600, 300));
    }
  }
  return seeds;
}
std::vector<std::string> tiff_seeds() { return seeds_of({"tiff-g4", "tiff-packbits", "tiff-none"}); }
std::vector<std::string> png_seeds() { return seeds_of({"png"}); }
std::vector<std::string> pbm_seeds() { return seeds_of({"pbm"}); }

/// Sets the checksums of all chunks right.
std::size_t mutate_png(std::uint8_t* bytes, std::size_t size, std::size_t, std::uint32_t) {
  for (std::size_t at = 8; at + 12 <= size;) {
    const std::size_t length = std::size_t{bytes[at]} << 24 | bytes[at + 1] << 16 | bytes[at + 2] << 8 | bytes[at + 3];
    if (length > size - at - 12) break;
    const uLong sum = ::crc32(0, bytes + at + 4, static_cast<uInt>(length + 4));
    for (int i = 0; i < 4; ++i) bytes[at + 8 + length + i] = static_cast<std::uint8_t>(sum >> (24 - 8 * i));
    at += 12 + length;
  }
  return size;
}

constexpr std::string_view kImageSources =
    "stages/read/image stages/read/tiff stages/read/g4 stages/read/png stages/read/pbm stages/geometry/bits";
const Registered kTiff({"image_tiff", read_image, tiff_seeds, kImageSources, ".tif", "tiff.dict", 1024});
const Registered kPng({"image_png", read_image, png_seeds, kImageSources, ".png", "png.dict", 1024, mutate_png});
const Registered kPbm({"image_pbm", read_image, pbm_seeds, kImageSources, ".pbm", {}, 512});

}  // namespace
}  // namespace lamina::fuzz
