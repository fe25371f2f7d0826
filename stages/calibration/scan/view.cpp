#include "stages/calibration/scan/view.h"

#include "stages/geometry/least_squares.h"

namespace lamina::calibration {
bool view_of(const std::array<Spot, 4>& positions, const std::array<Spot, 4>& pixels, double width, double height, View& view) {
  view = View();
  for (const Spot& position : positions) view.middle = {view.middle.x + position.x / 4, view.middle.y + position.y / 4};
  view.unit = 0;
  for (const Spot& position : positions) view.unit += std::hypot(position.x - view.middle.x, position.y - view.middle.y) / 4;
  view.photo_middle = {(width - 1) / 2, (height - 1) / 2};
  view.radius = std::hypot(width, height) / 2;
  if (!(view.unit > 0)) return false;
  LeastSquares equations(8);
  for (std::size_t i = 0; i < 4; ++i) {
    const double u = (positions[i].x - view.middle.x) / view.unit, v = (positions[i].y - view.middle.y) / view.unit;
    equations.add(std::array{u, v, 1.0, 0.0, 0.0, 0.0, -u * pixels[i].x, -v * pixels[i].x}, pixels[i].x);
    equations.add(std::array{0.0, 0.0, 0.0, u, v, 1.0, -u * pixels[i].y, -v * pixels[i].y}, pixels[i].y);
  }
  return equations.solve(view.h);
}

}  // namespace lamina::calibration
