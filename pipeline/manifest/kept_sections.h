// pipeline/manifest/kept_sections.h: the sections of some layers of a job, kept by --inspect until lamina merge has all of
// them.
//
// An inspection follows bodies from layer to layer, and needs samples between pixels, which no image contains.
//   inspection-2-of-5.zst, next to manifest-2-of-5.json: blocks of an 8-byte length, the XXH3-128 of their bytes, and these.
//   The first block is JSON (SectionsHead), each other a layer: an image, and its samples, if there are any
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "stages/checks/solid_checks.h"
#include "stages/data/buffer.h"
#include "stages/data/grid.h"
#include "stages/data/runs.h"
#include "stages/data/status.h"
#include "stages/support/io/compressed.h"

namespace lamina {

/// Facts that decide an inspection in addition to the sections.
struct SectionsHead {
  std::string job;  // id of its manifest
  double min_mm = 0, drain_mm = 0;
  std::uint64_t max_bytes = 0;        // limit of memory
  std::vector<std::string> parts;     // names for warnings
  std::vector<checks::Solid> placed;  // boxes and parts alone
};

struct Section {
  Runs image, sampled;
  bool has_samples = false;
};

/// The file next to a finished manifest.
std::string sections_path(const std::string& manifest);
/// Starts a file with its head. errors  kUsage: a file of that name is not lamina's own; kOutput
Status open_sections(const std::string& path, const SectionsHead& head, const FileOptions& options, ContentWriter& file);
Status append_block(std::span<const std::byte> block, ContentWriter& file);
/// Appends an image to a block.
void add_image(const RunsView& image, Buffer<std::byte>& block);

/// The section of a block; none if it is not one of that grid.
std::optional<Section> section_of(std::span<const std::byte> block, const PixelGrid& grid);

/// Reads a file, layer by layer.
/// errors  kVerification with the file's name: missing or damaged; of take_head and take
Status read_sections(const std::string& path, const PixelGrid& grid, const std::function<Status(SectionsHead)>& take_head,
                     const std::function<Status(Section)>& take);

/// Removes the file, if there is one.
void remove_sections(const std::string& manifest);

}  // namespace lamina
