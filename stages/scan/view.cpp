#include "stages/scan/view.h"

#include <Eigen/Dense>
#include <algorithm>

namespace lamina::scan {
namespace {

constexpr Eigen::Index kViewUnknowns = 9;

double& unknown(View& view, Eigen::Index i) { return i < 8 ? view.h[static_cast<std::size_t>(i)] : view.lens; }

Spot seen_at(const View& view, const std::vector<Spot>& shifts, const Sighting& one) {
  const Spot shift = shifts[one.group];
  return view.at(one.place.x + shift.x, one.place.y + shift.y);
}

double median_of(std::vector<double>& values) {
  if (values.empty()) return 0;
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

double median_distance(const std::vector<Sighting>& sightings, const View& view, const std::vector<Spot>& shifts) {
  std::vector<double> distances;
  distances.reserve(sightings.size());
  for (const Sighting& one : sightings) {
    const Spot p = seen_at(view, shifts, one);
    distances.push_back(std::hypot(p.x - one.seen.x, p.y - one.seen.y));
  }
  return median_of(distances);
}

}  // namespace

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

double fit_view(const std::vector<Sighting>& sightings, View& view, std::vector<Spot>& shifts, bool lens) {
  const Eigen::Index unknowns = kViewUnknowns + 2 * (static_cast<Eigen::Index>(shifts.size()) - 1);
  for (int step = 0; step < 12; ++step) {
    const double reach = 4.7 * std::max(1.4826 * median_distance(sightings, view, shifts), 0.02);
    Eigen::MatrixXd normal = Eigen::MatrixXd::Zero(unknowns, unknowns);
    Eigen::VectorXd right = Eigen::VectorXd::Zero(unknowns);
    std::array<View, kViewUnknowns> moved;
    constexpr double kStep = 1e-6;
    for (Eigen::Index i = 0; i < kViewUnknowns; ++i) {
      moved[static_cast<std::size_t>(i)] = view;
      unknown(moved[static_cast<std::size_t>(i)], i) += kStep;
    }
    for (const Sighting& one : sightings) {
      const Spot p = seen_at(view, shifts, one);
      const double ex = one.seen.x - p.x, ey = one.seen.y - p.y, share = std::hypot(ex, ey) / reach;
      if (share >= 1) continue;
      const double weight = (1 - share * share) * (1 - share * share);
      std::array<Eigen::Index, kViewUnknowns + 2> at{};
      Eigen::Matrix<double, 2, kViewUnknowns + 2> slope = Eigen::Matrix<double, 2, kViewUnknowns + 2>::Zero();
      for (Eigen::Index i = 0; i < kViewUnknowns; ++i) {
        const Spot q = seen_at(moved[static_cast<std::size_t>(i)], shifts, one);
        at[static_cast<std::size_t>(i)] = i;
        slope.col(i) << (q.x - p.x) / kStep, (q.y - p.y) / kStep;
      }
      Eigen::Index used = kViewUnknowns;
      if (one.group > 0) {
        Sighting right_of = one, below = one;
        right_of.place.x += kStep;
        below.place.y += kStep;
        const Spot q = seen_at(view, shifts, right_of), r = seen_at(view, shifts, below);
        slope.col(kViewUnknowns) << (q.x - p.x) / kStep, (q.y - p.y) / kStep;
        slope.col(kViewUnknowns + 1) << (r.x - p.x) / kStep, (r.y - p.y) / kStep;
        at[kViewUnknowns] = kViewUnknowns + 2 * (static_cast<Eigen::Index>(one.group) - 1);
        at[kViewUnknowns + 1] = at[kViewUnknowns] + 1;
        used += 2;
      }
      for (Eigen::Index i = 0; i < used; ++i) {
        const Eigen::Index row = at[static_cast<std::size_t>(i)];
        right(row) += weight * (slope(0, i) * ex + slope(1, i) * ey);
        for (Eigen::Index j = 0; j < used; ++j)
          normal(row, at[static_cast<std::size_t>(j)]) += weight * slope.col(i).dot(slope.col(j));
      }
    }
    if (!lens) {
      normal.row(kViewUnknowns - 1).setZero();
      normal.col(kViewUnknowns - 1).setZero();
      right(kViewUnknowns - 1) = 0;
    }
    const Eigen::VectorXd scale = (normal.diagonal().array() > 0).select(normal.diagonal().array().rsqrt(), 1).matrix();
    Eigen::MatrixXd scaled = scale.asDiagonal() * normal * scale.asDiagonal();
    scaled.diagonal().array() += 1e-12;
    const Eigen::VectorXd change = scale.cwiseProduct(scaled.ldlt().solve(scale.cwiseProduct(right)));
    if (!change.allFinite()) break;
    for (Eigen::Index i = 0; i < kViewUnknowns; ++i) unknown(view, i) += change(i);
    for (std::size_t g = 1; g < shifts.size(); ++g) {
      const Eigen::Index i = kViewUnknowns + 2 * (static_cast<Eigen::Index>(g) - 1);
      shifts[g] = {shifts[g].x + change(i), shifts[g].y + change(i + 1)};
    }
    if (change.cwiseAbs().maxCoeff() < 1e-9) break;
  }
  return median_distance(sightings, view, shifts);
}

}  // namespace lamina::scan
