#include <nlohmann/json.hpp>

#include "stages/formats/plot/plot.h"
#include "stages/support/text/text_shape.h"

namespace lamina {

NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(Plot::Box, left, top, width, height, colour)
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(Plot::Image, left, top, columns, colours, pixels)
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(Plot::Line, points, colour)
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(Plot::Dot, x, y, radius, colour)
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(Plot::Text, x, baseline, size, anchor, colour, line)
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(Plot, width, height, boxes, images, lines, dots, texts)

}  // namespace lamina

namespace lamina::write {

std::string plot_json(const Plot& plot) {
  return nlohmann::json(plot).dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
}

Result<Plot> read_plot(std::string_view json) {
  if (!json_nests_within(json)) return Error{Fault::kUsage, "is no plot: it nests too deep"};
  try {
    return nlohmann::json::parse(json).get<Plot>();
  } catch (const nlohmann::json::exception& error) {
    return Error{Fault::kUsage, std::string("is no plot: ") + error.what()};
  }
}

}  // namespace lamina::write
