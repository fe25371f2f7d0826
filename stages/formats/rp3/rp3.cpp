#include "stages/formats/rp3/rp3.h"

#include <fmt/format.h>

#include <cmath>

namespace lamina::formats::rp3 {

std::string text_of(std::span<const LayerSetting> layers, const Settings& settings) {
  const auto filling_angle = [&](std::size_t layer) {
    return std::fmod(settings.first_angle_deg + settings.angle_step_deg * static_cast<double>(layer), 360);
  };
  std::string text = "Português\n----- Arquivo RP3 : -----\nprocesso:\ntipo\tFDM\ncoeficiente de contração:\n";
  const auto triple = [&](const std::array<double, 3>& values) {
    for (std::size_t i = 0; i < 3; ++i) text += fmt::format("{}\t{}\n", "xyz"[i], values[i]);
  };
  triple(settings.shrink);
  text += "rotação atual:\n";
  triple(settings.rotation_deg);
  text +=
      "parâmetros do sólido:\n"
      "camada\toffset\traster\tlayer\tang_stl\tângulo\ta_base\ta_incr\tzigzag\tvolta\tvel_var\tvel_pos\tt_p\n-----\n";
  const auto row = [&](std::size_t number, const LayerSetting& layer, double filling) {
    text += fmt::format("{}\t{:.3f}\t{:.3f}\t{:.3f}\t{:.2f}\t{:.2f}\t{:.2f}\t{:.2f}\t0\t0\t0\t0\t0\n", number,
                        settings.contour_offset_mm, settings.raster_width_mm, layer.thickness_mm, layer.angle_deg, filling,
                        settings.first_angle_deg, settings.angle_step_deg);
  };
  // The summary: the number of layers, the first one's thickness, the last one's filling angle.
  if (!layers.empty()) row(layers.size(), {layers.front().thickness_mm, 0}, filling_angle(layers.size() - 1));
  text += "-----\n";
  for (std::size_t i = 0; i < layers.size(); ++i) row(i + 1, layers[i], filling_angle(i));
  text += "----- fim do arquivo -----\n";
  return text;
}

}  // namespace lamina::formats::rp3
