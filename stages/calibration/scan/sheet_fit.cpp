#include "stages/calibration/scan/sheet_fit.h"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

namespace lamina::scan {
namespace {

constexpr Eigen::Index kViewUnknowns = 9;
constexpr double kSmall = 1e-6;   // step of slopes
constexpr double kKeptSmall = 1;  // pixels^2 / mm^2: an offset of 50 um weighs as much as a twentieth of a pixel of one dash
constexpr double kLeastScale = 0.02;  // pixels

using Both = Eigen::Matrix2d;
using Pair = Eigen::Vector2d;

double& unknown(View& view, Eigen::Index i) { return i < 8 ? view.h[static_cast<std::size_t>(i)] : view.lens; }

double median_of(std::vector<double>& values) {
  if (values.empty()) return 0;
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

/// Pixels a mm of x and of y there, as columns.
Both slopes_at(const View& view, const Spot& at, const Spot& seen) {
  const Spot x = view.at(at.x + kSmall, at.y), y = view.at(at.x, at.y + kSmall);
  Both slopes;
  slopes << (x.x - seen.x) / kSmall, (y.x - seen.x) / kSmall, (x.y - seen.y) / kSmall, (y.y - seen.y) / kSmall;
  return slopes;
}

class Fitter {
 public:
  Fitter(const std::vector<Sighting>& sightings, std::uint32_t first, bool lens, SheetFit& fit)
      : sightings_(sightings), first_(first), lens_(lens), fit_(fit), nozzles_(fit.offset.size()) {
    unknowns_ = kViewUnknowns + 2 * (static_cast<Eigen::Index>(fit.shift.size()) - 1);
  }

  void run() {
    for (int step = 0; step < 12; ++step) {
      place_swaths();
      place_nozzles();
      if (take_step() < 1e-9) break;
    }
    fit_.scatter_pixels = scatter();
  }

 private:
  struct Nozzle {
    Both square = kKeptSmall * Both::Identity();
    Pair right = Pair::Zero();
    Eigen::MatrixXd mixed;  // unknowns x 2
  };

  Spot place_of(const Sighting& one) const {
    const Spot shift = fit_.shift[one.swath], offset = fit_.offset[one.nozzle];
    return {one.place.x + shift.x + offset.x, one.place.y + shift.y + offset.y};
  }

  double scatter() const {
    std::vector<double> distances;
    distances.reserve(sightings_.size());
    for (const Sighting& one : sightings_) {
      const Spot at = place_of(one), p = fit_.view.at(at.x, at.y);
      distances.push_back(std::hypot(p.x - one.seen.x, p.y - one.seen.y));
    }
    return median_of(distances);
  }

  /// How far a dash lies from where it should, in mm of the sheet.
  Pair off_by(const Sighting& one) const {
    const Spot at = place_of(one), p = fit_.view.at(at.x, at.y);
    return slopes_at(fit_.view, at, p).inverse() * Pair(one.seen.x - p.x, one.seen.y - p.y);
  }

  /// Shifts as the medians of their dashes have them, so that a swath that lies far from the others is no outlier.
  void place_swaths() {
    std::vector<std::vector<double>> x(fit_.shift.size()), y(fit_.shift.size());
    for (const Sighting& one : sightings_) {
      const Pair off = off_by(one);
      x[one.swath].push_back(off.x());
      y[one.swath].push_back(off.y());
    }
    const Spot first{median_of(x[first_]), median_of(y[first_])};
    for (std::size_t s = 0; s < fit_.shift.size(); ++s) {
      if (s != first_ && !x[s].empty())
        fit_.shift[s] = {fit_.shift[s].x + median_of(x[s]) - first.x, fit_.shift[s].y + median_of(y[s]) - first.y};
    }
  }

  /// Offsets as the medians of their dashes have them, so that a stray nozzle is no outlier.
  void place_nozzles() {
    std::vector<std::vector<double>> x(nozzles_), y(nozzles_);
    for (const Sighting& one : sightings_) {
      const Pair off = off_by(one);
      x[one.nozzle].push_back(fit_.offset[one.nozzle].x + off.x());
      y[one.nozzle].push_back(fit_.offset[one.nozzle].y + off.y());
    }
    for (std::size_t n = 0; n < nozzles_; ++n) {
      if (!x[n].empty()) fit_.offset[n] = {median_of(x[n]), median_of(y[n])};
    }
  }

  /// Where the unknowns of a swath's shift begin; -1 of the first one.
  Eigen::Index shift_at(std::uint32_t swath) const {
    if (swath == first_) return -1;
    return kViewUnknowns + 2 * static_cast<Eigen::Index>(swath < first_ ? swath : swath - 1);
  }

  void add(const Sighting& one, const std::array<View, kViewUnknowns>& moved, double reach) {
    const Spot at = place_of(one), p = fit_.view.at(at.x, at.y);
    const Pair error(one.seen.x - p.x, one.seen.y - p.y);
    const double share = error.norm() / reach;
    if (share >= 1) return;
    const double weight = (1 - share * share) * (1 - share * share);
    Eigen::Matrix<double, 2, kViewUnknowns> slope;
    for (Eigen::Index i = 0; i < kViewUnknowns; ++i) {
      const Spot q = moved[static_cast<std::size_t>(i)].at(at.x, at.y);
      slope.col(i) << (q.x - p.x) / kSmall, (q.y - p.y) / kSmall;
    }
    if (!lens_) slope.col(kViewUnknowns - 1).setZero();
    const Both place = slopes_at(fit_.view, at, p);
    Nozzle& nozzle = by_nozzle_[one.nozzle];
    normal_.topLeftCorner<kViewUnknowns, kViewUnknowns>() += weight * slope.transpose() * slope;
    right_.head<kViewUnknowns>() += weight * slope.transpose() * error;
    nozzle.mixed.topRows<kViewUnknowns>() += weight * slope.transpose() * place;
    nozzle.square += weight * place.transpose() * place;
    nozzle.right += weight * place.transpose() * error;
    const Eigen::Index s = shift_at(one.swath);
    if (s < 0) return;
    normal_.block<2, 2>(s, s) += weight * place.transpose() * place;
    normal_.block<kViewUnknowns, 2>(0, s) += weight * slope.transpose() * place;
    normal_.block<2, kViewUnknowns>(s, 0) += weight * place.transpose() * slope;
    right_.segment<2>(s) += weight * place.transpose() * error;
    nozzle.mixed.middleRows<2>(s) += weight * place.transpose() * place;
  }

  /// returns the largest change of view and shifts
  double take_step() {
    const double reach = 4.7 * std::max(1.4826 * scatter(), kLeastScale);
    normal_ = Eigen::MatrixXd::Zero(unknowns_, unknowns_);
    right_ = Eigen::VectorXd::Zero(unknowns_);
    by_nozzle_.assign(nozzles_, {});
    for (std::size_t n = 0; n < nozzles_; ++n) {
      by_nozzle_[n].mixed = Eigen::MatrixXd::Zero(unknowns_, 2);
      by_nozzle_[n].right = -kKeptSmall * Pair(fit_.offset[n].x, fit_.offset[n].y);
    }
    std::array<View, kViewUnknowns> moved;
    for (Eigen::Index i = 0; i < kViewUnknowns; ++i) {
      moved[static_cast<std::size_t>(i)] = fit_.view;
      unknown(moved[static_cast<std::size_t>(i)], i) += kSmall;
    }
    for (const Sighting& one : sightings_) add(one, moved, reach);
    // Nozzles are eliminated one by one: each has two unknowns of its own.
    for (const Nozzle& nozzle : by_nozzle_) {
      const Eigen::MatrixXd share = nozzle.mixed * nozzle.square.inverse();
      normal_ -= share * nozzle.mixed.transpose();
      right_ -= share * nozzle.right;
    }
    const Eigen::VectorXd scale = (normal_.diagonal().array() > 0).select(normal_.diagonal().array().rsqrt(), 1).matrix();
    Eigen::MatrixXd scaled = scale.asDiagonal() * normal_ * scale.asDiagonal();
    scaled.diagonal().array() += 1e-12;
    const Eigen::VectorXd change = scale.cwiseProduct(scaled.ldlt().solve(scale.cwiseProduct(right_)));
    if (!change.allFinite()) return 0;
    for (Eigen::Index i = 0; i < kViewUnknowns; ++i) unknown(fit_.view, i) += change(i);
    for (std::uint32_t s = 0; s < fit_.shift.size(); ++s) {
      if (const Eigen::Index at = shift_at(s); at >= 0)
        fit_.shift[s] = {fit_.shift[s].x + change(at), fit_.shift[s].y + change(at + 1)};
    }
    for (std::size_t n = 0; n < nozzles_; ++n) {
      const Nozzle& nozzle = by_nozzle_[n];
      const Pair moved_by = nozzle.square.inverse() * (nozzle.right - nozzle.mixed.transpose() * change);
      fit_.offset[n] = {fit_.offset[n].x + moved_by.x(), fit_.offset[n].y + moved_by.y()};
    }
    return change.cwiseAbs().maxCoeff();
  }

  const std::vector<Sighting>& sightings_;
  std::uint32_t first_;
  bool lens_;
  SheetFit& fit_;
  std::size_t nozzles_;
  Eigen::Index unknowns_ = 0;
  Eigen::MatrixXd normal_;
  Eigen::VectorXd right_;
  std::vector<Nozzle> by_nozzle_;
};

}  // namespace

void fit_sheet(const std::vector<Sighting>& sightings, std::uint32_t first, bool lens, SheetFit& fit) {
  Fitter(sightings, first, lens, fit).run();
}

HeadLine line_of(const std::vector<std::pair<double, double>>& values) {
  constexpr std::size_t kMost = 500;
  const std::size_t step = values.size() / kMost + 1;
  std::vector<double> slopes, rest;
  for (std::size_t i = 0; i < values.size(); i += step) {
    for (std::size_t j = i + step; j < values.size(); j += step)
      slopes.push_back((values[j].second - values[i].second) / (values[j].first - values[i].first));
  }
  HeadLine line;
  line.slope = median_of(slopes);
  for (const auto& [index, value] : values) rest.push_back(value - line.slope * index);
  line.middle = median_of(rest);
  return line;
}

}  // namespace lamina::scan
