// stages/formats/level_format.h: formats whose pixels carry the levels of voxels, and how a layer's levels become a file's
// bytes.
//
// Grey in which more binder is darker, as 1 is jet in the formats of one bit: level l of n is l / n of the way from white to
// black, in whole steps for 1, 3 and 15, and for 255 of 8 bits.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string_view>

#include "stages/data/levels.h"
#include "stages/data/status.h"
#include "stages/formats/image_format.h"

namespace lamina::write {

/// Encodes layers one after another and keeps its scratch memory between them. One encoder per thread at a time.
class LevelEncoder {
 public:
  virtual ~LevelEncoder() = default;

  /// The whole file of one layer, into `file` (its capacity is reused).
  /// full    level of a full voxel: it divides the darkest value of the format
  /// errors  kOutput if the format cannot hold the image (its limits are named in the message)
  /// memory  a strip or a row of bytes, never the whole image
  virtual Status encode(const LevelsView& image, std::uint8_t full, double dpi_x, double dpi_y, Bytes& file) = 0;

  /// What the next files say of their layer. Formats without a place for it ignore it.
  virtual void tag(const LayerTags&) {}
};

/// One row of the registry.
struct LevelFormat {
  std::string_view id;           // as on the command line: tiff-4, tiff-8, png-8
  std::string_view extension;    // with the dot
  std::string_view description;  // for --help
  std::unique_ptr<LevelEncoder> (*make_encoder)();
  /// Bytes that the file of a layer may have at most, and so what an encoder may hold for it. changes  two a run
  std::uint64_t (*most_bytes)(std::uint64_t columns, std::uint64_t rows, std::uint64_t changes);
};

std::span<const LevelFormat> level_formats();

/// The format with this id, or nullptr.
const LevelFormat* find_level_format(std::string_view id);

/// Of a format of one bit or of levels; nothing if there is none with this id.
std::optional<std::string_view> extension_of(std::string_view id);

}  // namespace lamina::write
