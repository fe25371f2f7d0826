#include "pipeline/output/thumbnail_text.h"

#include <fmt/format.h>

#include "stages/formats/png/png_format.h"
#include "stages/support/text/escape.h"
#include "stages/view/thumbnail.h"

namespace lamina::pipeline {

std::string thumbnail_text(const Scene& scene, std::uint32_t width, std::uint32_t height) {
  constexpr std::size_t kRow = 78;
  const view::Thumbnail picture = view::draw_thumbnail(scene.meshes, scene.instances, width, height);
  const std::string letters = base64(formats::png::coloured(width, view::thumbnail_colours(), picture.pixels));
  std::string text = fmt::format(";\n; thumbnail begin {}x{} {}\n", width, height, letters.size());
  for (std::size_t at = 0; at < letters.size(); at += kRow) text += "; " + letters.substr(at, kRow) + "\n";
  return text + "; thumbnail end\n;\n";
}

}  // namespace lamina::pipeline
