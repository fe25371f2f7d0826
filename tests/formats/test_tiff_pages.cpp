// TIFF of many pages: each is read without those before it.
#include <gtest/gtest.h>
#include <tiffio.h>

#include <fstream>
#include <string>
#include <vector>

#include "stages/formats/images/image.h"
#include "stages/formats/images/stack_info.h"
#include "stages/support/io/file.h"
#include "stages/support/io/file_reader.h"
#include "tests/commands/program.h"

namespace lamina::formats {
namespace {

constexpr int kSide = 16;

/// Pages of page % 16 + 1 dark rows. mode  of TIFFOpen: "w", "wb" (big-endian), "w8" (BigTIFF)
void write_pages(const std::string& path, int count, const char* mode = "w") {
  TIFF* tiff = TIFFOpen(path.c_str(), mode);
  ASSERT_NE(tiff, nullptr);
  for (int page = 0; page < count; ++page) {
    for (const auto& [tag, value] : {std::pair{TIFFTAG_IMAGEWIDTH, kSide},
                                     {TIFFTAG_IMAGELENGTH, kSide},
                                     {TIFFTAG_BITSPERSAMPLE, 1},
                                     {TIFFTAG_SAMPLESPERPIXEL, 1},
                                     {TIFFTAG_ROWSPERSTRIP, kSide},
                                     {TIFFTAG_PHOTOMETRIC, PHOTOMETRIC_MINISWHITE}})
      TIFFSetField(tiff, tag, value);
    for (int row = 0; row < kSide; ++row) {
      unsigned char bits[2] = {};
      if (row <= page % kSide) bits[0] = bits[1] = 0xff;
      TIFFWriteScanline(tiff, bits, static_cast<std::uint32_t>(row), 0);
    }
    TIFFWriteDirectory(tiff);
  }
  TIFFClose(tiff);
}

/// System calls that read, of this process so far.
std::uint64_t reads() {
  std::ifstream file("/proc/self/io");
  for (std::string name; file >> name;)
    if (name == "syscr:") {
      std::uint64_t count = 0;
      file >> count;
      return count;
    }
  return 0;
}

template <class Work>
std::uint64_t reads_of(const Work& work) {
  const std::uint64_t before = reads();
  work();
  return reads() - before;
}

TEST(TiffPages, OfAnyOrderOfBytesAndSizeOfOffsets) {
  test::Directory folder;
  const std::string path = folder / "pages.tif";
  for (const char* mode : {"w", "wb", "wl", "w8", "wb8"}) {
    write_pages(path, 40, mode);
    const auto pages = pages_of(path);
    ASSERT_TRUE(pages.ok()) << mode << pages.error().message;
    ASSERT_EQ(pages->size(), 40u) << mode;
    for (const std::size_t page : {39u, 0u, 17u}) {
      const auto image = dark_pixels(path, 128, (*pages)[page]);
      ASSERT_TRUE(image.ok()) << mode << image.error().message;
      EXPECT_EQ(image->set(), kSide * (page % kSide + 1)) << mode << page;
    }
  }
}

TEST(TiffPages, ReadsOfAPageDoNotDependOnTheirNumber) {
  test::Directory folder;
  const std::string path = folder / "pages.tif";
  if (reads() == 0) GTEST_SKIP() << "no /proc/self/io";
  std::vector<std::uint64_t> a_page, all;
  for (const int count : {100, 400}) {
    write_pages(path, count);
    const auto pages = pages_of(path);
    ASSERT_TRUE(pages.ok());
    a_page.push_back(reads_of([&] { EXPECT_TRUE(dark_pixels(path, 128, pages->back()).ok()); }));
    all.push_back(reads_of([&] { EXPECT_EQ(inspect_stack(path, 128)->images, static_cast<std::uint64_t>(count)); }));
  }
  EXPECT_EQ(a_page[0], a_page[1]);
  EXPECT_LE(all[1], 4 * all[0]);
}

TEST(TiffPages, ChainsThatLoopOrEndEarlyAreRefused) {
  test::Directory folder;
  const std::string path = folder / "pages.tif";
  for (const char* mode : {"w", "w8"}) {
    write_pages(path, 5, mode);
    const auto pages = pages_of(path);
    ASSERT_TRUE(pages.ok());
    const std::string whole = *read_file(path, {});
    const std::size_t bytes = mode[1] == '8' ? 8 : 4;
    const auto number = [&](std::uint64_t value) { return std::string(reinterpret_cast<const char*>(&value), bytes); };
    const std::size_t link = whole.find(number((*pages)[4]), (*pages)[3]);  // behind the directory of the fourth page
    ASSERT_NE(link, std::string::npos);
    for (const std::uint64_t next : {(*pages)[0], (*pages)[2], (*pages)[3], std::uint64_t{3}, std::uint64_t{whole.size()}}) {
      std::string broken = whole;
      broken.replace(link, bytes, number(next));
      ASSERT_TRUE(write_file(path, broken));
      const auto found = pages_of(path);
      ASSERT_FALSE(found.ok()) << mode << next;
      EXPECT_EQ(found.error().fault, Fault::kInput);
      EXPECT_EQ(found.error().message.find('\n'), std::string::npos);
    }
    ASSERT_TRUE(write_file(path, whole.substr(0, (*pages)[4] + 20)));
    EXPECT_FALSE(pages_of(path).ok()) << mode;
  }
}

}  // namespace
}  // namespace lamina::formats
