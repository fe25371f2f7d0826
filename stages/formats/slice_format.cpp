#include "stages/formats/slice_format.h"

#include <algorithm>

#include "stages/formats/cli/cli.h"
#include "stages/formats/svg/svg.h"

namespace lamina::formats {
namespace {

using Options = SliceFormatOptions;

// Two numbers of about 11 characters and separators. An SVG element has kind, colour and width, a CLI element part and count;
// both repeat the last point of the element before.
constexpr SliceFormat kSliceFormats[] = {
    {"svg", ".svg", true, true, [](const Options&) { return make_svg_encoder(); }, 26, 200},
    {"svg-polygon", ".svg", true, false, [](const Options&) { return make_svg_polygon_encoder(); }, 26, 0},
    {"cli", ".cli", true, true, [](const Options& options) { return make_cli_encoder(false, options); }, 48, 64},
    {"cli-binary", ".cli", true, true, [](const Options& options) { return make_cli_encoder(true, options); }, 16, 24},
    {"cli-16", ".cli", true, true, make_cli_16_encoder, 8, 16},
    {"3mf", ".3mf", false, true, nullptr, 0, 0},
    {"null", "", false, true, nullptr, 0, 0},
};

}  // namespace

std::span<const SliceFormat> slice_formats() { return kSliceFormats; }

const SliceFormat* find_slice_format(std::string_view id) {
  const auto* found = std::ranges::find(kSliceFormats, id, &SliceFormat::id);
  return found == std::end(kSliceFormats) ? nullptr : found;
}

void encode_alone(const SliceEncoder& encoder, const SliceHead& head, const SliceLayer& layer, Buffer<char>& out) {
  SliceHead own = head;
  own.layers = 1;
  own.first_bottom = layer.layer.bottom;
  encoder.head(own, out);
  encoder.layer(own, layer, out);
  encoder.tail(own, out);
}

}  // namespace lamina::formats
