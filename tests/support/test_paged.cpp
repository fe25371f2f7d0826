// tests/support/test_paged.cpp: TIFF files as pages of one file: libtiff reads the images, paths lead to the files, and a
// damaged or lying file gives an error.
#include <gtest/gtest.h>
#include <tiffio.h>

#include <algorithm>
#include <filesystem>
#include <random>

#include "stages/formats/image_format.h"
#include "stages/formats/tiff/pages.h"
#include "stages/geometry/bits.h"
#include "stages/support/io/container.h"
#include "stages/support/io/file_reader.h"
#include "tests/commands/program.h"

namespace lamina {
namespace {

using test::Directory;

/// The file of an image of that many columns whose first rows are dark.
std::string image_file(std::string_view format, std::uint32_t columns, std::uint32_t dark) {
  RunsBuilder builder(columns);
  const std::uint32_t row[] = {0, columns / 2 + 1};
  for (std::uint32_t r = 0; r < 40; ++r) builder.add_changes(r < dark ? std::span(row) : std::span<const std::uint32_t>());
  const Runs runs = builder.finish();
  formats::Bytes file;
  const auto encoder = formats::find_image_format(format)->make_encoder();
  EXPECT_TRUE(encoder->encode(runs.view(), 600, 600, file).ok());
  return {reinterpret_cast<const char*>(file.data()), file.size()};
}

/// A job of images and a program of parts of 3 bytes. returns  the files of the images
std::vector<std::string> write_paged_job(const Directory& folder, bool big, std::string_view format,
                                         std::uint32_t columns = 100) {
  std::vector<std::string> images;
  auto file = File::open(folder / "layers.tif");
  EXPECT_TRUE(file.ok());
  formats::tiff::PageWriter writer(*file, big);
  for (std::uint32_t i = 0; i < 5; ++i) {
    images.push_back(image_file(format, columns, 7 * i));
    const std::string name = "00000" + std::to_string(i);
    EXPECT_TRUE(writer
                    .add({"layers/" + name + ".tif", "program/" + name + ".x", images.back().size(), 2 + 3 * i, 3},
                         std::as_bytes(std::span(images.back())))
                    .ok());
  }
  EXPECT_TRUE(writer.finish().ok());
  EXPECT_TRUE(file->finish().ok());
  test::write_text(folder / "program.x", "gol00l11l22l33l44end");
  test::write_text(folder / "machine.toml", "name");
  return images;
}

/// All rows of the pages of a file, and the sizes of their strips.
std::vector<std::string> pages_by_libtiff(const std::string& path) {
  std::vector<std::string> pages;
  TIFF* tiff = TIFFOpen(path.c_str(), "r");
  EXPECT_NE(tiff, nullptr);
  if (tiff == nullptr) return pages;
  do {
    std::uint32_t rows = 0;
    TIFFGetField(tiff, TIFFTAG_IMAGELENGTH, &rows);
    std::string bits(static_cast<std::size_t>(TIFFScanlineSize(tiff)), '\0'), page;
    for (std::uint32_t r = 0; r < rows; ++r) {
      EXPECT_EQ(TIFFReadScanline(tiff, bits.data(), r), 1);
      page += bits;
    }
    for (std::uint32_t s = 0; s < TIFFNumberOfStrips(tiff); ++s) page += std::to_string(TIFFRawStripSize64(tiff, s)) + " ";
    pages.push_back(std::move(page));
  } while (TIFFReadDirectory(tiff) != 0);
  TIFFClose(tiff);
  return pages;
}

TEST(PagesOfAJob, AreReadByLibtiffLikeTheFilesInThem) {
  TIFFSetWarningHandler(
      [](const char*, const char* text, va_list) { EXPECT_NE(std::string(text).find("nknown"), std::string::npos) << text; });
  for (const std::string_view format : {"tiff-g4", "tiff-deflate", "tiff-packbits", "tiff-none"}) {
    for (const bool big : {false, true}) {
      // Of the wide images a row is a strip of its own.
      for (const std::uint32_t columns : {100u, 2'100'000u}) {
        const Directory folder;
        const auto images = write_paged_job(folder, big, format, columns);
        const auto pages = pages_by_libtiff(folder / "layers.tif");
        ASSERT_EQ(pages.size(), images.size()) << format << big;
        for (std::size_t i = 0; i < pages.size(); ++i) {
          test::write_text(folder / "one.tif", images[i]);
          EXPECT_TRUE(pages_by_libtiff(folder / "one.tif") == std::vector{pages[i]}) << format << ", page " << i;
        }
        EXPECT_EQ(formats::tiff::fault_of_pages(folder / "layers.tif"), "");
        EXPECT_EQ(test::read_text(folder / "layers.tif")[2], big ? '\x2b' : '\x2a');
      }
    }
  }
  TIFFSetWarningHandler(nullptr);
}

TEST(PagesOfAJob, HavePathsToTheirFiles) {
  const Directory folder;
  const auto images = write_paged_job(folder, true, "tiff-g4");
  const auto content = [&](const std::string& name) {
    const auto read = read_file(folder / name, {});
    EXPECT_EQ(entry_bytes(folder / name), read ? std::optional(read->size()) : std::nullopt) << name;
    EXPECT_EQ(is_file(folder / name), read.ok()) << name;
    return read ? *read : read.error().message.substr(read.error().message.rfind(':'));
  };
  for (std::size_t i = 0; i < images.size(); ++i) {
    EXPECT_TRUE(content("layers/00000" + std::to_string(i) + ".tif") == images[i]);
    EXPECT_EQ(content("program/00000" + std::to_string(i) + ".x"), "l" + std::string(2, static_cast<char>('0' + i)));
  }
  EXPECT_EQ(content("program/start.x"), "go");
  EXPECT_EQ(content("program/end.x"), "end");
  EXPECT_EQ(content("program/machine.toml"), "name");
  EXPECT_EQ(content("layers/000005.tif"), ": no such file");
  EXPECT_EQ(content("other/000000.tif"), ": no such file");
  EXPECT_EQ(names_in_folder(folder / "layers").size(), 5U);
  EXPECT_EQ(names_in_folder(folder / "program").size(), 8U);
  std::filesystem::create_directory(folder / "layers");
  EXPECT_EQ(content("layers/000000.tif"), ": no such file") << "a folder comes first";
}

TEST(UnfinishedPages, AreThoseBeforeTheEnd) {
  for (const bool big : {false, true}) {
    const Directory folder;
    write_paged_job(folder, big, "tiff-g4");
    const std::string whole = test::read_text(folder / "layers.tif");
    const auto all = read_pages(folder / "layers.tif");
    ASSERT_TRUE(all.ok());
    for (std::size_t bytes = 0; bytes <= whole.size(); ++bytes) {
      test::write_text(folder / "layers.tif.part", std::string_view(whole).substr(0, bytes));
      const auto pages = read_pages(folder / "layers.tif.part");
      ASSERT_TRUE(pages.ok() && pages->fault.empty());
      const auto expected = std::ranges::count_if(all->pages, [&](const JobPage& page) { return page.end() <= bytes; });
      ASSERT_EQ(std::ssize(pages->pages), expected) << bytes;
    }
  }
}

// Every changed byte is found: of an image or a program by its bytes, elsewhere by the page.
TEST(DamagedPages, AreFoundWithoutACrash) {
  for (const bool big : {false, true}) {
    const Directory folder;
    const auto images = write_paged_job(folder, big, "tiff-g4");
    const std::string path = folder / "layers.tif", whole = test::read_text(path);
    const auto pages = read_pages(path);
    ASSERT_TRUE(pages.ok());
    std::mt19937 draw(5);
    for (int trial = 0; trial < 1500; ++trial) {
      std::string damaged = whole;
      const int changes = 1 + trial % 3;
      for (int i = 0; i < changes; ++i)
        damaged[draw() % damaged.size()] = static_cast<char>(draw() % 3 == 0 ? 0xff : draw() % 3 == 0 ? 0 : draw());
      if (trial % 7 == 0) damaged.resize(draw() % damaged.size());
      if (damaged == whole) continue;
      test::write_text(path, damaged);
      bool same_files = true;
      for (std::size_t i = 0; i < images.size(); ++i) {
        const auto image = read_file(folder / ("layers/00000" + std::to_string(i) + ".tif"), {});
        const auto part = read_file(folder / ("program/00000" + std::to_string(i) + ".x"), {});
        same_files =
            same_files && image && *image == images[i] && part && *part == "l" + std::string(2, static_cast<char>('0' + i));
        EXPECT_LE(image ? image->size() : 0, damaged.size());
      }
      EXPECT_TRUE(!same_files || !formats::tiff::fault_of_pages(path).empty()) << "trial " << trial;
    }
  }
}

TEST(LyingPages, EndTheChain) {
  const Directory folder;
  write_paged_job(folder, false, "tiff-g4");
  const std::string path = folder / "layers.tif", whole = test::read_text(path);
  const auto pages = read_pages(path);
  ASSERT_TRUE(pages.ok());
  const auto fault_with = [&](std::size_t at, std::uint32_t number) {
    std::string lying = whole;
    std::ranges::copy(std::string(reinterpret_cast<const char*>(&number), 4), lying.begin() + static_cast<std::ptrdiff_t>(at));
    test::write_text(path, lying);
    return formats::tiff::fault_of_pages(path);
  };
  const JobPage& page = pages->pages[2];
  const std::size_t next = page.directory + 2 + page.entries * 12;
  for (const std::uint64_t offset :
       {page.directory, pages->pages[0].directory, pages->pages[4].directory, std::uint64_t{0xfffffff8}})
    EXPECT_EQ(fault_with(next, static_cast<std::uint32_t>(offset)), "layers.tif: page 2: its directory is damaged") << offset;
  EXPECT_NE(fault_with(next, 0), "") << "pages follow the last one";
  EXPECT_NE(fault_with(next + 4, 0xfffffff0), "") << "the offset of the file in the page";
  EXPECT_NE(fault_with(next + 8, 0xfffffff0), "") << "the size of the file in the page";
}

}  // namespace
}  // namespace lamina
