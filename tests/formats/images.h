// tests/formats/images.h: images and files for the tests of the writers.
#pragma once

#include <cstdint>
#include <filesystem>
#include <fstream>
#include <random>
#include <string>
#include <vector>

#include "stages/data/runs.h"
#include "stages/formats/image_format.h"

namespace lamina::formats::testing {

using Row = std::vector<std::uint32_t>;  // changes, as in data/runs.h

inline Runs image_of(std::uint32_t columns, const std::vector<Row>& rows) {
  Runs runs;
  runs.columns = columns;
  runs.row_offset.push_back(0);
  for (const Row& row : rows) {
    runs.change.insert(runs.change.end(), row.begin(), row.end());
    runs.row_offset.push_back(static_cast<std::uint32_t>(runs.change.size()));
  }
  return runs;
}

inline std::uint32_t below(std::mt19937& random, std::uint32_t limit) { return static_cast<std::uint32_t>(random() % limit); }

/// Every column is a change with probability 1 / spacing.
inline Row random_row(std::mt19937& random, std::uint32_t columns, std::uint32_t spacing) {
  Row row;
  for (std::uint32_t column = below(random, spacing); column <= columns; column += 1 + below(random, 2 * spacing)) {
    row.push_back(column);
  }
  if (row.size() % 2 != 0) row.pop_back();
  return row;
}

/// The row with some changes moved a little, some runs gone and some new: what neighbouring rows of a part look like.
inline Row neighbour(std::mt19937& random, std::uint32_t columns, const Row& row) {
  std::vector<bool> set(columns, false);
  for (std::size_t i = 0; i + 1 < row.size(); i += 2) {
    if (below(random, 12) == 0) continue;
    const std::int64_t begin = std::int64_t{row[i]} + below(random, 9) - 4,
                       end = std::int64_t{row[i + 1]} + below(random, 9) - 4;
    for (std::int64_t column = std::max<std::int64_t>(begin, 0); column < std::min<std::int64_t>(end, columns); ++column) {
      set[static_cast<std::size_t>(column)] = true;
    }
  }
  if (below(random, 6) == 0) set[below(random, columns)] = true;
  Row changes;
  bool before = false;
  for (std::uint32_t column = 0; column < columns; ++column) {
    if (set[column] != before) changes.push_back(column);
    before = set[column];
  }
  if (before) changes.push_back(columns);
  return changes;
}

/// Rows of all kinds after each other: random, like the one above, the same as it, empty, full.
inline Runs random_image(std::uint32_t seed, std::uint32_t columns, std::uint32_t rows) {
  std::mt19937 random(seed);
  std::vector<Row> image;
  const std::uint32_t spacing = 1 + below(random, columns < 8 ? columns : columns / 4);
  while (image.size() < rows) {
    const Row above = image.empty() ? Row{} : image.back();
    switch (below(random, 10)) {
      case 0: image.push_back(random_row(random, columns, spacing)); break;
      case 1: image.push_back({}); break;
      case 2: image.push_back({0, columns}); break;
      case 3: image.push_back(above); break;
      case 4: image.push_back(random_row(random, columns, 1 + below(random, 4))); break;
      default: image.push_back(neighbour(random, columns, above)); break;
    }
  }
  return image_of(columns, image);
}

/// A folder of its own for each test, gone at the end.
class Folder {
 public:
  Folder() {
    std::string name = (std::filesystem::temp_directory_path() / "lamina-write-XXXXXX").string();
    if (::mkdtemp(name.data()) == nullptr) std::abort();
    path_ = name;
  }
  ~Folder() { std::filesystem::remove_all(path_); }
  Folder(const Folder&) = delete;
  Folder& operator=(const Folder&) = delete;
  std::string operator/(const std::string& name) const { return (path_ / name).string(); }
  std::size_t files() const { return static_cast<std::size_t>(std::distance(std::filesystem::directory_iterator(path_), {})); }

 private:
  std::filesystem::path path_;
};

/// A new file: ext4 writes one that is emptied and filled again to the disk at once, thousands of times in these tests.
inline void save(const std::string& path, std::span<const std::byte> bytes) {
  std::filesystem::remove(path);
  std::ofstream(path, std::ios::binary)
      .write(reinterpret_cast<const char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
}

inline std::string load(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

/// The file of an image, or no bytes if the encoder refuses.
inline Bytes encoded(const ImageFormat& format, const RunsView& runs, double dpi_x = 1200, double dpi_y = 600) {
  Bytes file;
  if (!format.make_encoder()->encode(runs, dpi_x, dpi_y, file)) file.clear();
  return file;
}

/// Formats that write files.
inline std::vector<const ImageFormat*> file_formats() {
  std::vector<const ImageFormat*> formats;
  for (const ImageFormat& format : image_formats()) {
    if (!format.extension.empty()) formats.push_back(&format);
  }
  return formats;
}

}  // namespace lamina::formats::testing
