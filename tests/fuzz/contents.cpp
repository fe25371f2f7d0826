// Files of one Zstandard frame, as print programs are stored, and the sections that an inspection keeps in one.
#include <zstd.h>

#include "pipeline/manifest/kept_sections.h"
#include "stages/formats/zip/zip.h"
#include "stages/support/io/compressed.h"
#include "stages/support/io/container.h"
#include "stages/support/io/file_reader.h"
#include "tests/fuzz/laws.h"

namespace lamina::fuzz {
namespace {

constexpr std::uint64_t kMaxContent = 1 << 20;

bool read_content_of(std::string_view bytes) {
  static MemoryFile file("000042.planes.zst");
  const std::string& path = file.hold(bytes);
  std::uint64_t passed = 0;
  const Status status = expand_file(path, kMaxContent, [&](std::span<const std::byte> piece) {
    law(piece.size() <= 256 << 10, "a piece is longer than promised");
    passed += piece.size();
    law(passed <= kMaxContent, "more than the limit is passed on");
    return Status();
  });
  if (!status) return check_error(status.error()), false;
  const auto content = read_content(path, kMaxContent);
  law(content.ok() && content->size() == passed, "a frame expands to another size");
  const auto digest = digest_content(path, passed);
  law(digest.ok() && digest->bytes == passed && digest->hash == hash_text(*content), "its hash is that of another content");
  law(fault_of_stored(path, passed).empty(), "a whole frame is not whole");
  return true;
}

std::vector<std::string> content_seeds() {
  std::vector<std::string> seeds;
  for (const std::size_t size : {0u, 10u, 3000u}) {
    const std::string content(size, 'x');
    std::string frame(ZSTD_compressBound(size), '\0');
    frame.resize(ZSTD_compress(frame.data(), frame.size(), content.data(), size, 1));
    seeds.push_back(frame);
  }
  return seeds;
}

/// Finished, and as an unfinished one.
bool read_container(std::string_view bytes) {
  static MemoryFile finished("job.zip"), begun("job.zip.part");
  bool accepted = false;
  for (MemoryFile* file : {&finished, &begun}) {
    const std::string& path = file->hold(bytes);
    std::uint64_t end = 0, last = 0;
    const auto entries = read_entries(path, &end);
    if (!entries) {
      check_error(entries.error());
      continue;
    }
    law(end <= bytes.size(), "entries end behind the file");
    for (const ContainerEntry& entry : *entries) {
      law(entry.header >= last && entry.bytes <= end && entry.header <= end - entry.bytes, "an entry is not within the file");
      law(entry.name.empty() || !entry.name.ends_with('/'), "a folder is an entry");
      last = entry.header + entry.bytes;
      accepted |= has_its_sum(path, entry);
    }
  }
  return accepted;
}

std::vector<std::string> container_seeds() {
  std::vector<std::string> seeds;
  for (const std::uint64_t zip64_from : {std::uint64_t{UINT32_MAX}, std::uint64_t{0}}) {
    static MemoryFile made("made.zip");
    const std::string path = made.hold("");
    auto file = File::open(path);
    if (!file) continue;
    formats::ZipWriter writer(*file, formats::kFirstZipDate, zip64_from);
    for (const std::string_view name : {"layers/000000.tif", "manifest.json"}) {
      const auto content = std::as_bytes(std::span(name));
      static_cast<void>(writer.store(name, content, formats::crc_of(content)));
    }
    if (!writer.finish() || !file->finish()) continue;
    if (const auto text = read_file(path, {})) seeds.push_back(*text);
  }
  return seeds;
}

const Registered kContainer({"container", read_container, container_seeds, "stages/support/io/container", ".zip"});

const Registered kContents({"contents", read_content_of, content_seeds, "stages/support/io/compressed", ""});

bool equal(const Runs& one, const Runs& other) {
  return one.columns == other.columns && one.row_offset == other.row_offset && one.change == other.change;
}

bool read_section(std::string_view bytes) {
  const PixelGrid grid{PixelAxis(254, kNmPerMm), PixelAxis(254, 2 * kNmPerMm)};
  const auto section = section_of(std::as_bytes(std::span(bytes)), grid);
  if (!section) return false;
  Buffer<std::byte> block;
  for (const Runs* image : {&section->image, &section->sampled}) {
    if (image == &section->sampled && !section->has_samples) continue;
    const RunsView runs = *image;
    law(runs.columns == grid.columns() && runs.rows() == grid.rows(), "an image of another size");
    law(runs.row_offset.back() == runs.change.size(), "changes beyond the last row");
    for (std::uint32_t r = 0; r < runs.rows(); ++r) {
      const auto row = runs.row(r);
      law(row.size() % 2 == 0 && (row.empty() || row.back() <= runs.columns), "a run beyond the image");
      for (std::size_t i = 1; i < row.size(); ++i) law(row[i - 1] < row[i], "runs out of order");
    }
    add_image(runs, block);
  }
  const auto again = section_of(block, grid);
  law(again && again->has_samples == section->has_samples, "what was written is not read");
  law(equal(again->image, section->image) && equal(again->sampled, section->sampled), "it comes back as another section");
  return true;
}

std::vector<std::string> section_seeds() {
  // No pixels; rows 2 and 20 with runs of 2 to 5, 7 to 10, and of all columns; the same as image and samples.
  const std::string image("\x02\x02\x02\x03\x02\x03\x12\x01\x00\x0a\x00", 11);
  return {std::string(1, '\0'), image, image + image};
}

const Registered kSections({"sections", read_section, section_seeds, "pipeline/manifest/kept_sections", ""});

}  // namespace
}  // namespace lamina::fuzz
