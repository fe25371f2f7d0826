// Layer images: TIFF, PNG, BMP, PBM, PGM, of 1 bit and grey, and Group 4 alone.
#include "stages/formats/images/image.h"

#include <unistd.h>
#include <zlib.h>

#include <algorithm>
#include <cstdio>
#include <cstring>

#include "stages/formats/g4/decode.h"
#include "stages/formats/image_format.h"
#include "stages/formats/images/stack_info.h"
#include "stages/geometry/bits.h"
#include "stages/support/late/tiff.h"
#include "tests/fuzz/laws.h"
#include "tests/program/machines.h"

namespace lamina::fuzz {
namespace {

std::string encoded(std::string_view format, const RunsView& runs, double dpi_x, double dpi_y) {
  formats::Bytes bytes;
  const auto encoder = formats::find_image_format(format)->make_encoder();
  const Status done = encoder->encode(runs, dpi_x, dpi_y, bytes);
  law(done.ok(), done.ok() ? "" : done.error().message.c_str());
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

bool same(const RunsView& a, const RunsView& b) {
  return a.columns == b.columns && std::ranges::equal(a.row_offset, b.row_offset) && std::ranges::equal(a.change, b.change);
}

bool read_image(std::string_view bytes) {
  static MemoryFile file("000000.tif");
  const auto image = formats::image(file.hold(bytes));
  if (!image) return check_error(image.error()), false;
  check_runs(image->runs);
  // Any image that was read is written and read as the same image, unless it is so large that this takes long.
  const std::uint64_t pixels = std::uint64_t{image->runs.columns} * image->runs.view().rows();
  if (pixels > 1 << 16) return true;
  constexpr std::string_view kFormats[] = {"tiff-g4", "tiff-packbits", "png", "pbm", "bmp"};
  Dice dice(bytes);
  const auto again = formats::image(file.hold(encoded(kFormats[dice.below(5)], image->runs, 600, 300)));
  law(again.ok(), again.ok() ? "" : again.error().message.c_str());
  law(same(again->runs, image->runs), "an image that was written reads back as another one");
  return true;
}

bool same(const LevelsView& a, const LevelsView& b) {
  return a.columns == b.columns && std::ranges::equal(a.row_offset, b.row_offset) && std::ranges::equal(a.change, b.change) &&
         std::ranges::equal(a.level, b.level);
}

void check_levels(const LevelsView& levels, std::uint8_t full) {
  law(!levels.row_offset.empty() && levels.row_offset.front() == 0 && levels.row_offset.back() == levels.level.size() &&
          levels.change.size() == 2 * levels.level.size(),
      "offsets of levels");
  for (std::uint32_t r = 0; r < levels.rows(); ++r) {
    law(levels.row_offset[r] <= levels.row_offset[r + 1], "offsets of levels fall");
    for (std::uint32_t i = levels.row_offset[r]; i < levels.row_offset[r + 1]; ++i) {
      const std::uint32_t begin = levels.change[2 * i], end = levels.change[2 * i + 1];
      law(begin < end && end <= levels.columns, "a run of levels is empty or leaves the image");
      law(levels.level[i] > 0 && levels.level[i] <= full, "a level is 0 or more than full");
      if (i == levels.row_offset[r]) continue;
      law(levels.change[2 * i - 1] < begin || (levels.change[2 * i - 1] == begin && levels.level[i - 1] != levels.level[i]),
          "runs of levels overlap, or touch and are of one level");
    }
  }
}

/// As layer images of others: each page dark or not, and in levels.
bool read_grey(std::string_view bytes) {
  static MemoryFile file("000000.tif");
  const std::string& path = file.hold(bytes);
  Dice dice(bytes);
  const auto pages = formats::pages_of(path);
  if (!pages) return check_error(pages.error()), false;
  law(!pages->empty(), "a file without pages");
  const std::uint64_t page = (*pages)[dice.below(static_cast<std::uint32_t>(pages->size()))];
  constexpr std::uint8_t kFull[] = {1, 3, 15, 255};
  const std::uint8_t full = kFull[dice.below(4)];
  const auto dark = formats::dark_pixels(path, 128, page);
  Levels half, levels, exact;
  const auto of_half = formats::nearest_levels(path, {1, false, page}, half);
  const auto of_levels = formats::nearest_levels(path, {full, dice.below(2) == 0, page}, levels);
  law(dark.ok() == of_half.ok() && dark.ok() == of_levels.ok(),
      "read in levels, and not as dark pixels, or the other way round");
  if (!dark) return check_error(dark.error()), false;
  check_runs(dark->runs);
  check_levels(half, 1);
  check_levels(levels, full);
  Runs set;
  threshold_levels(half, 1, set);
  law(same(set, dark->runs), "half and more is not what is below 128");
  const auto kind = formats::kind_of(path, page);
  law(kind.ok() && kind->bits >= 1 && kind->bits <= 16, "an image that is read is of no kind");
  if (formats::levels(path, full, exact)) {
    check_levels(exact, full);
    Levels nearest;
    law(formats::nearest_levels(path, {full}, nearest).ok() && same(exact, nearest), "exact levels are not the nearest ones");
  }
  if (std::uint64_t{levels.columns} * levels.view().rows() > 1 << 16) return true;
  formats::Bytes out;
  const Status done =
      formats::find_level_format(dice.below(2) == 0 ? "tiff-8" : "png-8")->make_encoder()->encode(levels, full, 600, 300, out);
  law(done.ok(), done.ok() ? "" : done.error().message.c_str());
  const auto again = formats::levels(file.hold({reinterpret_cast<const char*>(out.data()), out.size()}), full, exact);
  law(again.ok() && same(exact, levels), "levels that were written read back as others");
  return true;
}

void put(std::string& out, std::uint32_t value, int bytes) {
  for (int i = 0; i < bytes; ++i) out += static_cast<char>(value >> (8 * i));
}

/// One strip of Group 4 as a TIFF.
std::string tiff_of(std::string_view coded, const formats::G4Strip& strip) {
  const std::uint32_t tags[][2] = {{256, strip.columns},
                                   {257, strip.rows},
                                   {258, 1},
                                   {259, 4},
                                   {262, 0},
                                   {266, strip.low_bit_first ? 2u : 1u},
                                   {273, 8 + 2 + 10 * 12 + 4},
                                   {277, 1},
                                   {278, strip.rows},
                                   {279, static_cast<std::uint32_t>(coded.size())}};
  std::string out = "II*";
  put(out, 0, 1), put(out, 8, 4), put(out, 10, 2);
  for (const auto& [tag, value] : tags)
    put(out, tag, 2), put(out, tag < 258 || tag == 273 || tag > 277 ? 4 : 3, 2), put(out, 1, 4), put(out, value, 4);
  put(out, 0, 4);
  return out + std::string(coded);
}

/// What our decoder takes, libtiff decodes to the same.
bool read_g4(std::string_view bytes) {
  if (bytes.size() < 5) return false;
  const auto byte = [&](std::size_t i) { return static_cast<std::uint8_t>(bytes[i]); };
  const formats::G4Strip strip{1u + (byte(0) | (byte(1) & 15u) << 8), 1u + byte(2) % 64u, (byte(3) & 1) != 0, false};
  const std::string_view coded = bytes.substr(4);
  Buffer<std::byte> buffer(coded.size());
  std::memcpy(buffer.data(), coded.data(), coded.size());
  static formats::G4Decoder decoder;
  Runs runs;
  runs.columns = strip.columns;
  runs.row_offset.assign(1, 0);
  if (!decoder.append(buffer, strip, runs)) return false;
  check_runs(runs);
  law(runs.view().rows() == strip.rows, "a strip of other rows");
  static MemoryFile file("000000.tif");
  const std::string& path = file.hold(tiff_of(coded, strip));
  std::string message;
  const auto options = strict_tiff_options(message);
  FILE* stream = std::fopen(path.c_str(), "rb");
  law(stream != nullptr && options != nullptr, "no libtiff");
  const TiffHandle tiff(TIFFFdOpenExt(::dup(::fileno(stream)), path.c_str(), "rCm", options.get()));
  std::fclose(stream);
  law(tiff != nullptr, message.c_str());
  RunsBuilder builder(strip.columns);
  Buffer<std::byte> row(row_bytes(strip.columns));
  for (std::uint32_t r = 0; r < strip.rows; ++r) {
    law(TIFFReadScanline(tiff.get(), row.data(), r, 0) == 1 && message.empty(), "libtiff refuses what is taken");
    builder.add_row(row, false);
  }
  law(same(builder.finish(), runs), "libtiff decodes something else");
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
std::vector<std::string> tiff_seeds() { return seeds_of({"tiff-g4", "tiff-deflate", "tiff-packbits", "tiff-none"}); }
std::vector<std::string> png_seeds() { return seeds_of({"png"}); }
std::vector<std::string> pbm_seeds() { return seeds_of({"pbm"}); }
std::vector<std::string> bmp_seeds() { return seeds_of({"bmp"}); }

std::vector<std::string> g4_seeds() {
  std::vector<std::string> seeds;
  program::testing::Random random(6);
  for (const auto& [columns, rows] : {std::pair{17u, 5u}, {300u, 40u}, {1u, 1u}}) {
    const std::string file =
        encoded("tiff-g4", program::testing::runs_of(program::testing::random_image(random, columns, rows)), 600, 300);
    std::string seed;
    put(seed, columns - 1, 2), put(seed, rows - 1, 1), put(seed, 0, 1);
    // The strip lies where its tag (273) says.
    const auto number = [&](std::size_t at, int size) {
      std::uint32_t value = 0;
      for (int i = 0; i < size; ++i) value |= std::uint32_t{static_cast<std::uint8_t>(file[at + i])} << (8 * i);
      return value;
    };
    std::uint32_t offset = 0, length = 0;
    const std::size_t directory = number(4, 4);
    for (std::uint32_t i = 0; i < number(directory, 2); ++i) {
      const std::size_t entry = directory + 2 + 12 * std::size_t{i};
      if (number(entry, 2) == 273) offset = number(entry + 8, 4);
      if (number(entry, 2) == 279) length = number(entry + 8, 4);
    }
    seeds.push_back(seed + file.substr(offset, length));
  }
  return seeds;
}

/// Levels in every format that has them, and the other ones of grey by hand.
std::vector<std::string> grey_seeds() {
  std::vector<std::string> seeds = seeds_of({"tiff-g4", "png", "bmp", "pbm"});
  program::testing::Random random(7);
  Levels levels;
  levels.start(9);
  for (int r = 0; r < 4; ++r) {
    for (std::uint32_t c = 0; c < 9; ++c) levels.append(c, c + 1, static_cast<std::uint8_t>(random() % 4));
    levels.end_row();
  }
  for (const auto& format : formats::level_formats()) {
    formats::Bytes bytes;
    law(format.make_encoder()->encode(levels, 3, 600, 300, bytes).ok(), "a seed is not written");
    seeds.emplace_back(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  }
  seeds.emplace_back("P5\n# grey\n3 2 255\n\x00\x40\x7f\x80\xc0\xff", 24);
  seeds.emplace_back("P2\n3 2 300\n0 40 # grey\n150 151 200 300\n");
  seeds.emplace_back("P1\n3 2\n011 1 0 0\n");
  std::string bmp = "BM";
  for (const std::uint32_t value : {54u + 4 * 4 + 2 * 4, 0u, 54u + 4 * 4, 40u, 3u, 2u}) put(bmp, value, 4);
  put(bmp, 1, 2), put(bmp, 8, 2);
  for (const std::uint32_t value : {0u, 8u, 11811u, 11811u, 4u, 0u}) put(bmp, value, 4);
  for (const std::uint32_t value : {0u, 0x404040u, 0x80ff80u, 0xffffffu}) put(bmp, value, 4);
  seeds.push_back(bmp + std::string("\0\1\2\0\3\2\1\0", 8));
  return seeds;
}

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
    "stages/formats/images/image stages/formats/tiff stages/formats/g4/decode stages/formats/png/png_format stages/formats/pbm stages/formats/bmp stages/geometry/bits";
constexpr std::string_view kGreySources =
    "stages/formats/images/image stages/formats/tiff stages/formats/png/png_format stages/formats/pbm stages/formats/bmp stages/geometry/bits";
const Registered kTiff({"image_tiff", read_image, tiff_seeds, kImageSources, ".tif", "tiff.dict", 1024});
const Registered kPng({"image_png", read_image, png_seeds, kImageSources, ".png", "png.dict", 1024, mutate_png});
const Registered kGrey({"image_grey", read_grey, grey_seeds, kGreySources, ".tif .png .bmp .pgm", "tiff.dict", 1024});
const Registered kG4({"image_g4", read_g4, g4_seeds, "stages/formats/g4/decode stages/geometry/t6", {}, {}, 512});
const Registered kBmp({"image_bmp", read_image, bmp_seeds, kImageSources, ".bmp", {}, 512});
const Registered kPbm({"image_pbm", read_image, pbm_seeds, kImageSources, ".pbm", {}, 512});

}  // namespace
}  // namespace lamina::fuzz
