// stages/formats/slice_format.h: what writers of vector slices are given, and how they are called.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "stages/data/buffer.h"
#include "stages/data/contours.h"
#include "stages/data/layer.h"
#include "stages/data/mesh.h"  // Box
#include "stages/data/status.h"
#include "stages/data/toolpaths.h"

namespace lamina::formats {

/// The whole file, known before the first layer.
struct SliceHead {
  std::vector<std::string> parts;  // names, one for each body
  Box bounds;                      // nm on the bed, around all that is sliced
  std::uint32_t layers = 0;
  Nm first_bottom = 0;   // nm, bottom of the first layer that is written
  std::int64_t top = 0;  // nm, of the last layer of the whole file; 0: that of the box
  std::string program;   // "lamina 0.1.0"
};

/// One layer. The contours of body b are [body[b], body[b + 1]).
struct SliceLayer {
  Layer layer;
  ContoursView contours;
  std::span<const std::uint32_t> body;
  ToolpathsView paths;                       // filling; none if it was not requested
  std::span<const std::uint32_t> path_body;  // the paths of body b are [path_body[b], path_body[b + 1]); empty if none
};

struct SliceFormatOptions {
  bool empty_first_layer = false;  // CLI: an empty layer below the first, from which readers infer its thickness
};

/// Writes the text or bytes of a file piece by piece. head, layer and tail are pure: layers can be encoded by many
/// threads at once, and head + layers in order + tail is the file.
class SliceEncoder {
 public:
  virtual ~SliceEncoder() = default;
  /// Whether the format can hold a layer; call it before layer(). errors  kUsage
  virtual Status check(const SliceHead&, const SliceLayer&) const { return {}; }
  virtual void head(const SliceHead& head, Buffer<char>& out) const = 0;
  virtual void layer(const SliceHead& head, const SliceLayer& layer, Buffer<char>& out) const = 0;
  virtual void tail(const SliceHead& head, Buffer<char>& out) const = 0;
};

/// One row of the registry.
struct SliceFormat {
  std::string_view id, extension;
  bool layer_files;                                                  // may have one for each layer
  bool paths;                                                        // refuses no filling
  std::unique_ptr<SliceEncoder> (*make)(const SliceFormatOptions&);  // null: none, or a package
  std::uint32_t point_bytes, interval_bytes;  // of its text, at most: per point, and per element of a path
};
std::span<const SliceFormat> slice_formats();
/// The format with this id, or nullptr.
const SliceFormat* find_slice_format(std::string_view id);

/// A file of one layer on its own.
void encode_alone(const SliceEncoder& encoder, const SliceHead& head, const SliceLayer& layer, Buffer<char>& out);

}  // namespace lamina::formats
