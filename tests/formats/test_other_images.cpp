// Images of other programs in every depth, palette, transparency, byte order and order of names, against values that are
// calculated here.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <png.h>

#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <functional>
#include <memory>
#include <numeric>
#include <optional>
#include <random>
#include <string>
#include <vector>

#include "stages/formats/image_format.h"
#include "stages/formats/images/image.h"
#include "stages/formats/images/layer_images.h"
#include "stages/formats/images/stack_info.h"
#include "tests/commands/program.h"

namespace lamina::formats::other_images {
namespace {

namespace fs = std::filesystem;

using Pixels = std::vector<std::vector<unsigned>>;

Pixels pixels_of(const LevelsView& image) {
  Pixels pixels(image.rows(), std::vector<unsigned>(image.columns));
  for (std::uint32_t r = 0; r < image.rows(); ++r)
    for (std::uint32_t i = image.row_offset[r]; i < image.row_offset[r + 1]; ++i)
      for (std::uint32_t c = image.change[2 * i]; c < image.change[2 * i + 1]; ++c) pixels[r][c] = image.level[i];
  return pixels;
}

/// Values, and what each of them means: light of `white`.
struct Picture {
  Pixels values;
  std::vector<unsigned> light;
  unsigned white = 255;

  std::size_t columns() const { return values.front().size(); }
  unsigned light_of(unsigned value) const { return light.empty() ? value : light[value]; }
};

Picture random_picture(std::mt19937& random, unsigned used) {
  Picture picture;
  const std::size_t columns = 1 + random() % 40, rows = 1 + random() % 4;
  picture.values.assign(rows, std::vector<unsigned>(columns));
  for (auto& row : picture.values)
    for (std::size_t c = 0; c < columns; ++c)
      row[c] = c > 0 && random() % 2 == 0 ? row[c - 1] : static_cast<unsigned>(random() % used);
  return picture;
}

Pixels mapped(const Pixels& values, const std::function<unsigned(unsigned)>& of) {
  Pixels out = values;
  for (auto& row : out)
    for (unsigned& value : row) value = of(value);
  return out;
}

/// The file as dark pixels by every threshold and as levels of every number.
void expect_read(const std::string& path, const Picture& picture, const std::string& what) {
  for (const unsigned threshold : {1u, 100u, 128u, 129u, 255u}) {
    const auto dark = dark_pixels(path, static_cast<int>(threshold));
    ASSERT_TRUE(dark.ok()) << what << ": " << dark.error().message;
    Levels levels;
    levels_of(dark->runs, 1, levels);
    const auto is_dark = [&](unsigned value) -> unsigned {  // of 255, or of more the upper 256 steps
      const std::uint64_t light = picture.light_of(value), white = picture.white;
      return white > 255 ? light * 256 / (white + 1) < threshold : light * 255 < threshold * white;
    };
    EXPECT_EQ(pixels_of(levels.view()), mapped(picture.values, is_dark)) << what << " below " << threshold;
  }
  for (const unsigned full : {1u, 3u, 15u, 255u}) {
    Levels levels;
    const auto image = nearest_levels(path, {static_cast<std::uint8_t>(full)}, levels);
    ASSERT_TRUE(image.ok()) << what << ": " << image.error().message;
    const auto nearest = [&](unsigned value) {
      const std::uint64_t white = picture.white, dark = white - picture.light_of(value);
      unsigned level = 0;  // the highest whose lower half step is not above it
      while (level < full && dark * full * 2 >= (2 * level + 1) * white) ++level;
      return level;
    };
    EXPECT_EQ(pixels_of(levels.view()), mapped(picture.values, nearest)) << what << " of " << full;
  }
  EXPECT_TRUE(kind_of(path, 0).ok()) << what;
}

void expect_refused(const std::string& path, const std::string& words) {
  const auto image = dark_pixels(path, 128);
  ASSERT_FALSE(image.ok()) << path << " " << words;
  EXPECT_NE(image.error().message.find(words), std::string::npos) << image.error().message;
}

std::string packed(const std::vector<unsigned>& row, unsigned bits, bool low_first = false) {
  std::string bytes((row.size() * bits + 7) / 8, '\0');
  for (std::size_t c = 0; c < row.size(); ++c)
    for (unsigned b = 0; b < bits; ++b) {
      const std::size_t at = c * bits + b;
      if (row[c] >> (bits - 1 - b) & 1) bytes[at / 8] = static_cast<char>(bytes[at / 8] | 0x80 >> at % 8);
    }
  if (bits == 16 && low_first)
    for (std::size_t i = 0; i < bytes.size(); i += 2) std::swap(bytes[i], bytes[i + 1]);
  return bytes;
}

struct Colour {
  unsigned red, green, blue, opaque;
};

/// One of some shades, dark and light ones more often.
Colour random_colour(std::mt19937& random, bool transparent) {
  const auto part = [&] { return random() % 3 == 0 ? 0u : random() % 2 == 0 ? 255u : static_cast<unsigned>(random() % 256); };
  Colour colour{part(), part(), part(), transparent ? part() : 255};
  if (random() % 2 == 0) colour.green = colour.blue = colour.red;
  return colour;
}

unsigned light_of(const Colour& colour) {
  const unsigned light = (299 * colour.red + 587 * colour.green + 114 * colour.blue + 500) / 1000;
  return (light * colour.opaque + 255 * (255 - colour.opaque) + 127) / 255;  // over white paper
}

struct PngParts {
  unsigned bits = 8;
  std::vector<Colour> palette;
  std::optional<unsigned> transparent;
  bool opacities = false;
};

void write_png(const std::string& path, const Pixels& values, const PngParts& parts) {
  FILE* file = std::fopen(path.c_str(), "wb");
  png_structp png = png_create_write_struct(PNG_LIBPNG_VER_STRING, nullptr, nullptr, nullptr);
  png_infop info = png_create_info_struct(png);
  png_init_io(png, file);
  png_set_check_for_invalid_index(png, -1);
  png_set_IHDR(png, info, static_cast<png_uint_32>(values.front().size()), static_cast<png_uint_32>(values.size()),
               static_cast<int>(parts.bits), parts.palette.empty() ? PNG_COLOR_TYPE_GRAY : PNG_COLOR_TYPE_PALETTE,
               PNG_INTERLACE_NONE, PNG_COMPRESSION_TYPE_DEFAULT, PNG_FILTER_TYPE_DEFAULT);
  std::vector<png_color> colours;
  std::vector<png_byte> opaque;
  for (const Colour& c : parts.palette) {
    colours.push_back({static_cast<png_byte>(c.red), static_cast<png_byte>(c.green), static_cast<png_byte>(c.blue)});
    opaque.push_back(static_cast<png_byte>(c.opaque));
  }
  if (!colours.empty()) png_set_PLTE(png, info, colours.data(), static_cast<int>(colours.size()));
  png_color_16 grey{};
  grey.gray = static_cast<png_uint_16>(parts.transparent.value_or(0));
  if (parts.opacities) png_set_tRNS(png, info, opaque.data(), static_cast<int>(opaque.size()), nullptr);
  if (parts.transparent) png_set_tRNS(png, info, nullptr, 0, &grey);
  png_write_info(png, info);
  for (const auto& row : values) {
    std::string bytes = packed(row, parts.bits);
    png_write_row(png, reinterpret_cast<png_bytep>(bytes.data()));
  }
  png_write_end(png, nullptr);
  png_destroy_write_struct(&png, &info);
  std::fclose(file);
}

TEST(OtherImages, PngsOfGreyWithATransparentValue) {
  test::Directory folder;
  std::mt19937 random(21);
  const std::string path = folder / "a.png";
  for (int trial = 0; trial < 60; ++trial) {
    PngParts parts{1u << random() % 5, {}, {}, false};
    const unsigned white = (1u << parts.bits) - 1;
    Picture picture = random_picture(random, white + 1);
    if (random() % 3 == 0) picture.values = mapped(picture.values, [&](unsigned v) { return v % 2 == 0 ? 0 : white; });
    if (random() % 4 != 0) parts.transparent = picture.values.back()[random() % picture.columns()];
    picture.white = white;
    picture.light.resize(white + 1);
    std::iota(picture.light.begin(), picture.light.end(), 0u);
    if (parts.transparent) picture.light[*parts.transparent] = white;
    write_png(path, picture.values, parts);
    expect_read(path, picture, "grey of " + std::to_string(parts.bits));
  }
}

TEST(OtherImages, PngsAndBmpsOfPalettes) {
  test::Directory folder;
  std::mt19937 random(22);
  for (int trial = 0; trial < 80; ++trial) {
    const bool png = trial % 2 == 0;
    const unsigned bits = png ? 1u << random() % 4 : std::vector<unsigned>{1, 4, 8}[random() % 3];
    const unsigned count = 1 + static_cast<unsigned>(random() % (1u << bits));
    PngParts parts{bits, {}, {}, png && random() % 2 == 0};
    Picture picture = random_picture(random, count);
    for (unsigned c = 0; c < count; ++c) {
      parts.palette.push_back(random_colour(random, parts.opacities));
      picture.light.push_back(light_of(parts.palette.back()));
    }
    const std::string path = folder / (png ? "a.png" : "a.bmp");
    const bool from_top = random() % 2 == 0;
    const auto write = [&] {
      if (png) return write_png(path, picture.values, parts);
      std::string out = "BM";
      const auto put = [&](unsigned value, int bytes) {
        for (int i = 0; i < bytes; ++i) out += static_cast<char>(value >> (8 * i));
      };
      const unsigned rows = static_cast<unsigned>(picture.values.size()), begin = 54 + 4 * count;
      put(0, 4), put(0, 4), put(begin, 4), put(40, 4), put(static_cast<unsigned>(picture.columns()), 4);
      put(from_top ? 0 - rows : rows, 4), put(1, 2), put(bits, 2);
      for (int i = 0; i < 4; ++i) put(0, 4);
      put(count, 4), put(0, 4);
      for (const Colour& c : parts.palette) put(c.blue | c.green << 8 | c.red << 16, 4);
      for (unsigned r = 0; r < rows; ++r) {
        std::string row = packed(picture.values[from_top ? r : rows - 1 - r], bits);
        row.resize((row.size() + 3) / 4 * 4);
        out += row;
      }
      std::ofstream(path, std::ios::binary) << out;
    };
    write();
    expect_read(path, picture, fs::path(path).extension().string() + " of " + std::to_string(bits));
    if (count == 1u << bits) continue;
    picture.values.back().back() = count;
    write();
    expect_refused(path, "a pixel's colour is not in its palette");
  }
}

// optipng, pngquant and pngcrush: palettes of one colour, grey of fewer bits, palettes instead of grey.
TEST(OtherImages, LayersOfAJobInFewerBits) {
  test::Directory folder;
  const std::string path = folder / "000000.png";
  const Colour white{255, 255, 255, 255}, black{0, 0, 0, 255};
  const Pixels first(3, std::vector<unsigned>(17, 0));
  for (const bool full : {false, true}) {
    write_png(path, first, {1, {full ? black : white}, {}, false});
    const auto bits = image(path), levels = image(path, 3);
    ASSERT_TRUE(bits.ok() && levels.ok());
    EXPECT_EQ(set_pixels(bits->runs), full ? 51u : 0u);
    EXPECT_EQ(set_pixels(levels->runs), full ? 51u : 0u);
  }
  std::mt19937 random(23);
  for (const unsigned bits : {1u, 2u, 4u}) {  // of as many levels
    const unsigned brightest = (1u << bits) - 1;
    const Picture picture = random_picture(random, brightest + 1);
    PngParts palette{bits, {}, {}, false};
    for (unsigned v = 0; v <= brightest; ++v)
      palette.palette.push_back(Colour{v * 255 / brightest, v * 255 / brightest, v * 255 / brightest, 255});
    for (const PngParts& parts : {PngParts{bits, {}, {}, false}, palette}) {
      write_png(path, picture.values, parts);
      Levels levels;
      ASSERT_TRUE(formats::levels(path, static_cast<std::uint8_t>(brightest), levels).ok()) << bits;
      EXPECT_EQ(pixels_of(levels.view()), mapped(picture.values, [&](unsigned v) { return brightest - v; }));
    }
    if (bits == 1) continue;
    Levels levels;  // more than the levels of the job
    write_png(path, {{0, 1}}, {bits, {}, {}, false});
    EXPECT_FALSE(formats::levels(path, 1, levels).ok());
  }
}

TEST(OtherImages, PortableMapsOfAnyMaximum) {
  test::Directory folder;
  std::mt19937 random(24);
  const std::string path = folder / "a.pgm";
  for (int trial = 0; trial < 60; ++trial) {
    const bool bits = trial % 4 == 0, plain = random() % 2 == 0;
    const unsigned maximum = bits ? 1 : 1 + static_cast<unsigned>(random() % (random() % 2 == 0 ? 400 : 65'535));
    Picture picture = random_picture(random, maximum + 1);
    if (trial % 8 == 1) picture.values.front().front() = maximum / 2;
    picture.white = maximum;
    if (bits) picture.light = {1, 0};
    std::string head = std::string("P") +
                       (bits    ? plain ? "1" : "4"
                        : plain ? "2"
                                : "5") +
                       "\n# other\n" + std::to_string(picture.columns()) + "\t" + std::to_string(picture.values.size()) + "\n";
    if (!bits) head += std::to_string(maximum) + "\n";
    std::string text = head;
    for (const auto& row : picture.values) {
      if (!plain) text += packed(row, bits ? 1 : maximum > 255 ? 16 : 8);
      for (std::size_t c = 0; plain && c < row.size(); ++c)
        text += std::to_string(row[c]) + (bits && c % 7 != 0 ? "" : c % 5 == 0 ? "\n# remark\n" : "  ");
    }
    const std::string what = head.substr(0, 2) + " to " + std::to_string(maximum);
    for (const char* end : {"", "\n", "\r\n"}) {
      test::write_text(path, text + end);
      expect_read(path, picture, what);
    }
    test::write_text(path, text + (plain ? " 7" : "xx\n"));
    expect_refused(path, plain ? "more than its pixels" : "bytes where");
    if (plain) {
      test::write_text(path, head + "\n 1 x" + text.substr(head.size()));
      expect_refused(path, "");
    } else if (!bits && maximum != 255 && maximum != 65'535) {
      text.back() = '\xff';
      if (maximum > 255) text[text.size() - 2] = '\xff';
      test::write_text(path, text);
      expect_refused(path, "is above its maximum of " + std::to_string(maximum));
    }
  }
  test::write_text(path, "P5 2 1 0\n\1\1");
  expect_refused(path, "its grey ends at 0, not between 1 and 65535");
  test::write_text(path, "P2 2147484 2147484 9\n1 1 1 1\n");
  expect_refused(path, "or more");
}

/// Directories of one strip each, uncompressed.
struct TiffPage {
  unsigned bits = 8, kind = 0;
  std::optional<unsigned> orientation;
  bool byte_counts = true, white_is_0 = false;
  Pixels values;
};

std::string tiff_of(const std::vector<TiffPage>& pages, bool low_first) {
  std::string out = low_first ? "II" : "MM";
  const auto text_of = [&](unsigned value, int bytes) {
    std::string text;
    for (int i = 0; i < bytes; ++i) text += static_cast<char>(value >> (8 * (low_first ? i : bytes - 1 - i)));
    return text;
  };
  out += text_of(42, 2) + text_of(8, 4);
  for (std::size_t p = 0; p < pages.size(); ++p) {
    const TiffPage& page = pages[p];
    std::string strip, entries;
    for (const auto& row : page.values) strip += packed(row, page.bits, low_first);
    unsigned count = 0;
    const std::size_t all = 9u + page.orientation.has_value() + page.byte_counts, data = out.size() + 2 + 12 * all + 4;
    const auto entry = [&](unsigned tag, bool is_long, unsigned value) {
      entries += text_of(tag, 2) + text_of(is_long ? 4 : 3, 2) + text_of(1, 4) + text_of(value, is_long ? 4 : 2);
      if (!is_long) entries += std::string(2, '\0');
      ++count;
    };
    entry(254, true, page.kind);
    entry(256, false, static_cast<unsigned>(page.values.front().size()));
    entry(257, false, static_cast<unsigned>(page.values.size()));
    entry(258, false, page.bits);
    entry(259, false, 1);
    entry(262, false, page.white_is_0 ? 0 : 1);
    entry(273, true, static_cast<unsigned>(data));
    if (page.orientation) entry(274, false, *page.orientation);
    entry(277, false, 1);
    entry(278, false, static_cast<unsigned>(page.values.size()));
    if (page.byte_counts) entry(279, true, static_cast<unsigned>(strip.size()));
    if (strip.size() % 2 != 0) strip += '\0';
    const auto next = p + 1 < pages.size() ? static_cast<unsigned>(data + strip.size()) : 0;
    out += text_of(count, 2) + entries + text_of(next, 4) + strip;
  }
  return out;
}

TEST(OtherImages, TiffsWithThumbnailsAndWithoutTags) {
  test::Directory folder;
  std::mt19937 random(25);
  const std::string path = folder / "a1.tif";
  for (int trial = 0; trial < 80; ++trial) {
    TiffPage page;
    page.bits = 1u << random() % 5;
    page.white_is_0 = random() % 2 == 0;
    page.byte_counts = random() % 2 == 0;
    if (random() % 3 != 0) page.orientation = static_cast<unsigned>(random() % 2);
    Picture picture = random_picture(random, 1u << page.bits);
    picture.white = (1u << page.bits) - 1;
    page.values = picture.values;
    if (page.white_is_0) page.values = mapped(page.values, [&](unsigned v) { return picture.white - v; });
    TiffPage thumbnail = page;
    thumbnail.kind = random() % 2 == 0 ? 1 : 4;
    thumbnail.values.assign(2, std::vector<unsigned>(3, 1));
    std::vector<TiffPage> pages{page};
    if (random() % 2 == 0) pages.push_back(thumbnail);
    if (random() % 3 == 0) pages.insert(pages.begin(), thumbnail);
    const bool low_first = random() % 2 == 0;
    test::write_text(path, tiff_of(pages, low_first));
    const std::string what = std::to_string(page.bits) + " bits, " + std::to_string(pages.size()) +
                             " directories, Orientation " + std::to_string(page.orientation.value_or(99)) +
                             (page.byte_counts ? "" : ", no StripByteCounts");
    expect_read(path, picture, what);
    const auto found = pages_of(path);
    ASSERT_TRUE(found.ok() && found->size() == 1) << what;
    const auto stack = LayerImages::open(folder.path().string(), {});
    ASSERT_TRUE(stack.ok()) << stack.error().message;
    EXPECT_EQ(stack->columns(), picture.columns()) << what;
    pages.push_back(page);
    test::write_text(path, tiff_of(pages, low_first));
    expect_refused(path, "several images in one file");
    page.orientation = 2 + static_cast<unsigned>(random() % 8);
    test::write_text(path, tiff_of({page}, low_first));
    expect_refused(path, "Orientation");
    thumbnail.orientation = {};
    test::write_text(path, tiff_of({thumbnail}, low_first));  // nothing else: it is the image
    EXPECT_EQ(pages_of(path)->size(), 1u);
    EXPECT_TRUE(dark_pixels(path, 128).ok());
  }
}

/// The names in the order of a stack, or the message.
std::string order_of(std::vector<std::string> names, bool gaps = false) {
  test::Directory folder;
  std::mt19937 random(static_cast<std::uint32_t>(names.size()));
  std::ranges::shuffle(names, random);
  for (const std::string& name : names) test::write_text(folder / name, "P1 1 1 0");
  const auto found = numbered_images(folder.path().string(), gaps);
  if (!found) return found.error().message;
  std::string text;
  for (const Numbered& image : *found) text += fs::path(image.path).stem().string() + " ";
  return text;
}

TEST(ImageOrder, OfHeightsIsFromTheBottomUp) {
  std::mt19937 random(26);
  for (int trial = 0; trial < 60; ++trial) {
    const int digits = 1 + static_cast<int>(random() % 3), scale = digits == 1 ? 10 : digits == 2 ? 100 : 1000;
    const int step = 1 + static_cast<int>(random() % 30), first = static_cast<int>(random() % 300);
    const bool cut = step % scale != 0 && random() % 2 == 0;  // 0.5, 1, 1.5
    const std::string before = std::vector<std::string>{"", "z", "part_7_z", "slice-"}[random() % 4];
    std::vector<std::string> names;
    std::string expected;
    for (int i = 0; i < 25; ++i) {
      const int height = first + i * step;
      std::string fraction = std::to_string(scale + height % scale).substr(1);
      while (cut && !fraction.empty() && fraction.back() == '0') fraction.pop_back();
      names.push_back(before + std::to_string(height / scale) + (fraction.empty() ? "" : "." + fraction) + ".pbm");
      expected += names.back().substr(0, names.back().size() - 4) + " ";
    }
    EXPECT_EQ(order_of(names), expected) << step << "/" << scale;
  }
}

TEST(ImageOrder, OfOtherNumbersIsRefusedWhereThereAreTwo) {
  EXPECT_EQ(order_of({"a8.pbm", "a9.pbm", "a10.pbm"}), "a8 a9 a10 ");
  EXPECT_EQ(order_of({"v1.8.pbm", "v1.9.pbm"}), "v1.8 v1.9 ");
  EXPECT_EQ(order_of({"2026-11-27_1.pbm", "2026-11-28_2.pbm"}), "2026-11-27_1 2026-11-28_2 ");
  EXPECT_EQ(order_of({"a.1.2.001.pbm", "a.1.2.002.pbm"}), "a.1.2.001 a.1.2.002 ");
  EXPECT_EQ(order_of({"f9a_1.pbm", "f3c_2.pbm", "f7_3.pbm"}), "f9a_1 f3c_2 f7_3 ");  // a hash counts in no steps
  std::vector<std::string> counted;
  for (int i = 1; i <= 12; ++i) counted.push_back("1." + std::to_string(i) + ".pbm");  // 1.1 and 1.10 are one height
  EXPECT_EQ(order_of(counted), "1.1 1.2 1.3 1.4 1.5 1.6 1.7 1.8 1.9 1.10 1.11 1.12 ");
  const auto refused = [](const std::vector<std::string>& names, const std::string& words, bool gaps = false) {
    const std::string message = order_of(names, gaps);
    EXPECT_NE(message.find(words), std::string::npos) << message;
    EXPECT_EQ(std::ranges::count(message, '\n'), 0);
  };
  refused({"v2.9.pbm", "v2.10.pbm"}, "two orders");  // two names show no steps
  refused({"a000_b7.pbm", "a001_b8.pbm", "a002_b9.pbm", "a003_b0.pbm", "a004_b1.pbm"},
          "the names allow two orders: by number 1 of each a000_b7.pbm, a001_b8.pbm, a002_b9.pbm, ...; by the last number "
          "a003_b0.pbm, a004_b1.pbm, a000_b7.pbm, ...",
          true);
  refused({"1_z0.3.pbm", "2_z0.2.pbm", "3_z0.1.pbm"}, "by number 1 of each 1_z0.3.pbm");
  refused({"0001_a7.pbm", "0002_a3.pbm", "0003_a9.pbm"}, "allow two orders", true);
  refused({"1.8.pbm", "1.9.pbm", "1.10.pbm", "1.11.pbm"}, "by height 1.10.pbm, 1.11.pbm, 1.8.pbm");
  refused({"z0.3.pbm", "z1.1.pbm", "z1.2.pbm"}, "by height z0.3.pbm");
  refused({"z0.1.pbm", "z0.2.pbm", "z0.4.pbm"}, "z0.4.pbm: height 0.3 is missing before it");
  refused({"a01.pbm", "a02.pbm", "a04.pbm"}, "a04.pbm: number 3 is missing before it");
}

// Steps of 1/30 mm, and others that no decimals state.
TEST(ImageOrder, HeightsMayBeRounded) {
  EXPECT_EQ(order_of({"z0.033.pbm", "z0.067.pbm", "z0.100.pbm"}), "z0.033 z0.067 z0.100 ");
  EXPECT_EQ(order_of({"z0.967.pbm", "z1.000.pbm", "z1.033.pbm"}), "z0.967 z1.000 z1.033 ");
  for (const double step : {1 / 30.0, 0.0333, 0.0127, 0.0762, 0.125}) {
    for (const int digits : {3, 4}) {
      std::vector<std::string> names;
      std::string expected;
      for (int i = 1; i <= 300; ++i) {
        names.push_back(fmt::format("z{:.{}f}.pbm", i * step, digits));
        expected += names.back().substr(0, names.back().size() - 4) + " ";
      }
      EXPECT_EQ(order_of(names), expected) << step;
      names.resize(7);
      names.erase(names.begin() + 3);
      EXPECT_NE(order_of(names).find(fmt::format("height {:.{}f} is missing before it", 4 * step, digits)), std::string::npos)
          << step << ": " << order_of(names);
    }
  }
  // Thicknesses that differ by more than rounding are no steps.
  EXPECT_NE(order_of({"z0.030.pbm", "z0.065.pbm", "z0.100.pbm", "z0.131.pbm"}).find("is missing"), std::string::npos);
  EXPECT_NE(order_of({"z0.3.pbm", "z0.5.pbm", "z0.8.pbm"}).find("height 0.4 is missing"), std::string::npos);
}

TEST(ImageOrder, AMinusIsASignWhereOtherHeightsHaveNone) {
  EXPECT_EQ(order_of({"z-0.2.pbm", "z0.0.pbm", "z0.2.pbm"}), "z-0.2 z0.0 z0.2 ");
  EXPECT_EQ(order_of({"z-0.2.pbm", "z-0.1.pbm", "z0.0.pbm", "z0.1.pbm"}), "z-0.2 z-0.1 z0.0 z0.1 ");
  EXPECT_EQ(order_of({"z-0.1.pbm", "z-0.2.pbm", "z-0.3.pbm"}), "z-0.1 z-0.2 z-0.3 ");  // as in layer-0.1
  EXPECT_NE(order_of({"z-0.2.pbm", "z0.0.pbm", "z0.4.pbm"}).find("height 0.2 is missing before it"), std::string::npos);
}

TEST(ImageFormats, UnknownOnesNameTheNearest) {
  for (const char* id : {"tif", "TIFF", "tiff-g3"})
    EXPECT_EQ(unknown_format(id),
              "unknown value '" + std::string(id) +
                  "'; use one of tiff-g4, tiff-deflate, tiff-packbits, tiff-none, tiff-4, tiff-8; did you mean 'tiff-g4'?");
  EXPECT_NE(unknown_format("jpeg").find("tiff-g4, tiff-deflate, tiff-packbits, tiff-none, png, pbm, bmp"), std::string::npos);
}

// Files that lamina read wrongly or refused: tests/corpus/images3.
TEST(OtherImages, FilesOfPublicReports) {
  const auto set_of = [](const std::string& name) {
    const auto stack = LayerImages::open(test::corpus_file("images3/" + name), {});
    if (!stack) return stack.error().message;
    std::string text;
    for (std::uint32_t l = 0; l < stack->layers(); ++l) text += std::to_string(set_pixels(*stack->read(l))) + " ";
    return text;
  };
  for (const char* name : {"I02_gray8_trns_bg", "J03_gray2_trns", "J03_gray16_trns", "I12_thumb_second", "I22b_orient_0",
                           "I10c_no_bytecounts", "I25b_pbm_trailing"})
    EXPECT_EQ(set_of(name), "192 ") << name;
  for (const char* name : {"J01_pal_white_white", "J01c_pal_white_light", "J02_bmp_white_white"})
    EXPECT_EQ(set_of(name), "0 ") << name;
  EXPECT_EQ(set_of("J01b_pal_black_black"), "851 ");
  EXPECT_EQ(set_of("I01_blank_one_colour_white"), "192 0 192 ");
  EXPECT_EQ(set_of("J04c_z_from_1.5"), "5 10 15 20 25 30 35 40 45 50 ");
  EXPECT_NE(set_of("J04f_wrap_hash").find("two orders"), std::string::npos);
}

}  // namespace
}  // namespace lamina::formats::other_images
