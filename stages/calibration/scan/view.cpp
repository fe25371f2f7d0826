#include "stages/calibration/scan/view.h"

#include <Eigen/Dense>

namespace lamina::scan {
bool view_of(const std::array<Spot, 4>& places, const std::array<Spot, 4>& pixels, double width, double height, View& view) {
  view = View();
  for (const Spot& place : places) view.middle = {view.middle.x + place.x / 4, view.middle.y + place.y / 4};
  view.unit = 0;
  for (const Spot& place : places) view.unit += std::hypot(place.x - view.middle.x, place.y - view.middle.y) / 4;
  view.photo_middle = {(width - 1) / 2, (height - 1) / 2};
  view.radius = std::hypot(width, height) / 2;
  if (!(view.unit > 0)) return false;
  Eigen::Matrix<double, 8, 8> a = Eigen::Matrix<double, 8, 8>::Zero();
  Eigen::Matrix<double, 8, 1> b;
  for (std::size_t i = 0; i < 4; ++i) {
    const double u = (places[i].x - view.middle.x) / view.unit, v = (places[i].y - view.middle.y) / view.unit;
    const Eigen::Index r = 2 * static_cast<Eigen::Index>(i);
    a.row(r) << u, v, 1, 0, 0, 0, -u * pixels[i].x, -v * pixels[i].x;
    a.row(r + 1) << 0, 0, 0, u, v, 1, -u * pixels[i].y, -v * pixels[i].y;
    b(r) = pixels[i].x;
    b(r + 1) = pixels[i].y;
  }
  const Eigen::FullPivLU<Eigen::Matrix<double, 8, 8>> lu(a);
  if (!lu.isInvertible()) return false;
  const Eigen::Matrix<double, 8, 1> h = lu.solve(b);
  for (std::size_t i = 0; i < 8; ++i) view.h[i] = h(static_cast<Eigen::Index>(i));
  return h.allFinite();
}

}  // namespace lamina::scan
