// stages/formats/image_format.h: the per-layer image formats, and how a layer's runs become a file's bytes.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "stages/data/bit_rows.h"
#include "stages/data/buffer.h"
#include "stages/data/choices.h"
#include "stages/data/grid.h"
#include "stages/data/levels.h"
#include "stages/data/runs.h"
#include "stages/data/status.h"

namespace lamina {
class BitRows;
}

namespace lamina::formats {

using Bytes = Buffer<std::byte>;

/// What a file may state of its layer in addition to the pixels. No name of a file, so that equal layers are equal files.
struct LayerTags {
  std::string title;         // of the job, if its owner gave it one
  std::string material;      // empty if the job has one
  std::string_view mirror;   // axes, "x", "y" or "xy"; empty if the image is not mirrored
  std::uint32_t layer = 0;   // from 0
  std::uint32_t layers = 0;  // of the whole job; 0: nothing is to be said
  Nm bottom = 0, top = 0;    // nm above the bed
};

/// Encodes layers one after another and keeps its scratch memory between them. One encoder per thread at a time.
class ImageEncoder {
 public:
  virtual ~ImageEncoder() = default;

  /// The whole file of one layer, into `file` (its capacity is reused).
  /// dpi_x, dpi_y  written into the file's resolution tags
  /// errors        kOutput if the format cannot hold the image (its limits are named in the message)
  /// Set pixels are printed as 1 = jet: min-is-white in TIFF, black in PBM, 1 in PNG's palette (see the format's README).
  virtual Status encode(const RunsView& runs, double dpi_x, double dpi_y, Bytes& file) = 0;
  /// The same of rows that are read one by one: no whole image of runs is made.
  virtual Status encode(const BitRows& rows, double dpi_x, double dpi_y, Bytes& file) = 0;

  /// The widest instructions to use, if the processor has them; the bytes are the same with any. Else it chooses itself.
  virtual void use(Isa) {}

  /// What the next files say of their layer; nothing until it is called. Formats without a place for it ignore it.
  virtual void tag(const LayerTags&) {}
};

/// For encoders. errors  kOutput, "PNG cannot hold a layer of 3 x 0 pixels: it has no pixels"
Error cannot_hold(std::string_view format, std::uint32_t columns, std::uint32_t rows, std::string_view why);
Status check_size(std::string_view format, std::uint32_t columns, std::uint32_t rows);

/// One row of the registry.
struct ImageFormat {
  std::string_view id;           // as on the command line: tiff-g4, tiff-packbits, tiff-none, png, pbm, null
  std::string_view extension;    // with the dot; empty for null
  std::string_view description;  // for --help
  std::unique_ptr<ImageEncoder> (*make_encoder)();
  /// Bytes that the file of a layer may have at most, and so what an encoder may hold for it.
  std::uint64_t (*max_bytes)(std::uint64_t columns, std::uint64_t rows, std::uint64_t changes);
};

/// All formats, the default first.
std::span<const ImageFormat> image_formats();

/// The format with this id, or nullptr.
const ImageFormat* find_image_format(std::string_view id);

// --- formats whose pixels carry the levels of voxels, and how a layer's levels become a file's
// bytes.
//
// Grey in which more binder is darker, as 1 is jet in the formats of one bit: level l of n is l / n of the way from white to
// black, in whole steps for 1, 3 and 15, and for 255 of 8 bits.

/// Encodes layers one after another and keeps its scratch memory between them. One encoder per thread at a time.
class LevelEncoder {
 public:
  virtual ~LevelEncoder() = default;

  /// The whole file of one layer, into `file` (its capacity is reused).
  /// full    level of a full voxel: it divides the darkest value of the format
  /// errors  kOutput if the format cannot hold the image (its limits are named in the message)
  /// memory  a strip or a row of bytes, never the whole image
  virtual Status encode(const LevelsView& image, std::uint8_t full, double dpi_x, double dpi_y, Bytes& file) = 0;
  /// The same of an image whose voxels are full or empty, read row by row.
  virtual Status encode(const BitRows& image, double dpi_x, double dpi_y, Bytes& file) = 0;

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
  std::uint64_t (*max_bytes)(std::uint64_t columns, std::uint64_t rows, std::uint64_t changes);
};

std::span<const LevelFormat> level_formats();

/// The format with this id, or nullptr.
const LevelFormat* find_level_format(std::string_view id);

/// Of a format of one bit or of levels; nothing if there is none with this id.
std::optional<std::string_view> extension_of(std::string_view id);

/// "unknown value 'tif'; use one of tiff-g4, ...": the formats that begin with the same three letters, else all.
std::string unknown_format(std::string_view id);

}  // namespace lamina::formats
