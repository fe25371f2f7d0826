#include "stages/calibration/scan/dashes.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <random>

#include "stages/calibration/robust.h"
#include "stages/calibration/scan/marks.h"
#include "stages/geometry/least_squares.h"

namespace lamina::calibration {

Shape::Shape(double reach, double step)
    : step_(step), sum_(static_cast<std::size_t>(std::ceil(reach / step)) + 2, 0), weight_(sum_.size(), 0) {}

void Shape::add(const Profile& profile, double middle, double ground) {
  for (std::size_t i = 0; i < profile.value.size(); ++i) {
    const double at = std::abs(profile.position(i) - middle) / step_;
    const auto cell = static_cast<std::size_t>(at);
    if (cell + 1 >= sum_.size()) continue;
    const double share = at - static_cast<double>(cell), value = profile.value[i] - ground;
    sum_[cell] += (1 - share) * value;
    weight_[cell] += 1 - share;
    sum_[cell + 1] += share * value;
    weight_[cell + 1] += share;
  }
}

void Shape::settle() {
  for (std::size_t i = 0; i < sum_.size(); ++i) sum_[i] = weight_[i] > 0 ? sum_[i] / weight_[i] : i > 0 ? sum_[i - 1] : 0;
  const double highest = *std::ranges::max_element(sum_);
  if (highest > 0) {
    for (double& value : sum_) value /= highest;
  }
}

double Shape::at(double x) const {
  const double at = std::abs(x) / step_;
  const auto cell = static_cast<std::size_t>(at);
  if (cell + 1 >= sum_.size()) return sum_.back();
  return sum_[cell] + (at - static_cast<double>(cell)) * (sum_[cell + 1] - sum_[cell]);
}

double Shape::slope_at(double x) const { return (at(x + step_) - at(x - step_)) / (2 * step_); }

ShapeFit fit_shape(const Profile& profile, const Shape& shape, double middle, double reach, double maximum) {
  ShapeFit fit{.middle = middle};
  for (int step = 0; step < 5; ++step) {
    // First ground and height, then the middle too.
    LeastSquares linear(3);
    double squares = 0, count = 0;
    for (std::size_t i = 0; i < profile.value.size(); ++i) {
      const double at = profile.position(i) - fit.middle;
      if (std::abs(at) > reach) continue;
      const std::array<double, 3> slope{1, shape.at(at), step == 0 ? 0 : -fit.height * shape.slope_at(at)};
      const double left = profile.value[i] - fit.ground - fit.height * slope[1];
      linear.add(slope, left);
      squares += left * left;
      ++count;
    }
    if (count < 5) return fit;
    fit.misfit = std::sqrt(squares / count);
    linear.damp(1e-9, 1e-18);
    std::array<double, 3> change{};
    if (!linear.solve(change)) return fit;
    fit.ground += change[0];
    fit.height += change[1];
    if (step > 0) fit.middle = std::clamp(fit.middle + change[2], middle - maximum, middle + maximum);
  }
  return fit;
}

namespace {

constexpr double kSamplesAPixel = 2;

/// Samples of a dash's surroundings in its own frame: rows across, columns along.
struct DashWindow {
  int across = 0, along = 0;               // samples each
  double step_across = 0, step_along = 0;  // mm
  std::vector<double> dark;
  double at(int v, int u) const { return dark[static_cast<std::size_t>(v * along + u)]; }
  double v_of(int v) const { return (v - 0.5 * (across - 1)) * step_across; }
  double u_of(int u) const { return (u - 0.5 * (along - 1)) * step_along; }
};

/// Local, linear: a window is a millimetre wide.
bool inspection(const Photo& photo, const View& view, const Spot& middle, bool along_x, double half_along, double half_across,
                DashWindow& w) {
  const double e = 0.05;
  const Spot c = view.at(middle.x, middle.y), x = view.at(middle.x + e, middle.y), y = view.at(middle.x, middle.y + e);
  const Spot dx{(x.x - c.x) / e, (x.y - c.y) / e}, dy{(y.x - c.x) / e, (y.y - c.y) / e};
  const Spot du = along_x ? dx : dy, dv = along_x ? dy : dx;
  const auto samples = [](double half, const Spot& d) {
    return std::clamp(2 * static_cast<int>(std::ceil(half * std::hypot(d.x, d.y) * kSamplesAPixel)) + 1, 9, 401);
  };
  w.along = samples(half_along, du);
  w.across = samples(half_across, dv);
  w.step_along = 2 * half_along / (w.along - 1);
  w.step_across = 2 * half_across / (w.across - 1);
  for (const double sv : {-half_across, half_across}) {
    for (const double su : {-half_along, half_along}) {
      const double px = c.x + su * du.x + sv * dv.x, py = c.y + su * du.y + sv * dv.y;
      if (!(px >= 0 && py >= 0 && px < photo.darkness.cols - 1 && py < photo.darkness.rows - 1)) return false;
    }
  }
  w.dark.resize(static_cast<std::size_t>(w.across * w.along));
  for (int v = 0; v < w.across; ++v) {
    for (int u = 0; u < w.along; ++u) {
      const double a = w.u_of(u), b = w.v_of(v);
      w.dark[static_cast<std::size_t>(v * w.along + u)] =
          darkness_at(photo.darkness, c.x + a * du.x + b * dv.x, c.y + a * du.y + b * dv.y);
    }
  }
  return true;
}

/// The centre of what is above the ground within `reach` of `about`.
double centre(const std::vector<double>& profile, double step, double ground, double about, double reach) {
  double sum = 0, moment = 0;
  for (std::size_t i = 0; i < profile.size(); ++i) {
    const double at = (static_cast<double>(i) - 0.5 * static_cast<double>(profile.size() - 1)) * step;
    // The window's ends count by the share of a step that lies within.
    const double share = std::clamp((reach - std::abs(at - about)) / step + 0.5, 0.0, 1.0);
    sum += share * (profile[i] - ground);
    moment += share * (profile[i] - ground) * at;
  }
  return sum > 1e-9 ? std::clamp(moment / sum, about - reach, about + reach) : about;
}

/// The middle between two ends, each where what is above the ground within `reach` of the end adds up to half of it: less noise
/// than a centre of all has, and no level to be chosen.
double middle_of_ends(const std::vector<double>& profile, double step, double ground, double half, double reach) {
  double middle = 0;
  for (int round = 0; round < 3; ++round) {
    double left = 0, right = 0, top = 0, count = 0;
    for (std::size_t i = 0; i < profile.size(); ++i) {
      const double at = (static_cast<double>(i) - 0.5 * static_cast<double>(profile.size() - 1)) * step - middle;
      const double value = profile[i] - ground;
      const auto within = [&](double end) { return std::clamp((reach - std::abs(at - end)) / step + 0.5, 0.0, 1.0); };
      left += within(-half) * value * step;
      right += within(half) * value * step;
      if (std::abs(at) < half - reach) top += value, ++count;
    }
    if (count == 0 || top / count < 1e-4) return middle;
    middle += std::clamp((right - left) / (2 * top / count), -reach, reach);
  }
  return middle;
}

/// Inspects one dash after the other.
class Inspect {
 public:
  Inspect(const Photo& photo, const Chart& chart, const View& view, const std::optional<DashShapes>& shapes)
      : photo_(photo), chart_(chart), view_(view), shapes_(shapes) {
    for (const ChartDash& dash : chart.dashes) longest_ = std::max(longest_, length_of(dash));
    gathered_.emplace(DashShapes{Shape(chart.between_mm, 0.01), Shape(longest_, 0.01)});
  }

  DashReading see(const ChartDash& dash, const Spot& position) {
    const double length = length_of(dash), half_across = chart_.between_mm / 2, half_along = (length + chart_.gap_mm) / 2;
    DashReading detected{.position = position};
    if (!inspection(photo_, view_, position, chart_.scan_along_x, half_along, half_across, w_)) {
      detected.hidden = true;
      return detected;
    }
    sum_across(length, half_across, detected);
    const double v = positions_across(half_across, detected);
    sum_along(half_across, v);
    const double u = position_along(length, half_along, detected);
    detected.position = chart_.scan_along_x ? Spot{position.x + u, position.y + v} : Spot{position.x + v, position.y + u};
    gathered_->across.add(across_, v, detected.ground);
    gathered_->along.add(along_, u, detected.ground);
    return detected;
  }

  /// The common shapes of all detected dashes.
  std::optional<DashShapes> shapes() {
    gathered_->across.settle();
    gathered_->along.settle();
    return std::move(gathered_);
  }

 private:
  double length_of(const ChartDash& dash) const { return along_of(chart_, size_of(dash.box, chart_)); }

  void sum_across(double length, double half_across, DashReading& detected) {
    across_.value.assign(static_cast<std::size_t>(w_.across), 0);
    across_.step = w_.step_across;
    edge_.clear();
    for (int v = 0; v < w_.across; ++v) {
      double sum = 0;
      int count = 0;
      for (int u = 0; u < w_.along; ++u) {
        if (std::abs(w_.u_of(u)) > 0.42 * length) continue;
        sum += w_.at(v, u);
        ++count;
        if (std::abs(w_.v_of(v)) > 0.8 * half_across) edge_.push_back(w_.at(v, u));
      }
      across_.value[static_cast<std::size_t>(v)] = sum / std::max(count, 1);
    }
    detected.ground = upper_median_of(edge_);
    for (int v = 0; v < w_.across; ++v) {
      if (std::abs(w_.v_of(v)) <= 0.7 * half_across)
        detected.mass += (across_.value[static_cast<std::size_t>(v)] - detected.ground) * w_.step_across;
    }
  }

  double positions_across(double half_across, DashReading& detected) const {
    double v = 0;
    for (const double reach : {0.8, 0.55, 0.45, 0.45, 0.45})
      v = centre(across_.value, w_.step_across, detected.ground, v, reach * half_across);
    if (!shapes_) return v;
    const ShapeFit fit = fit_shape(across_, shapes_->across, v, 0.75 * half_across, 0.25 * half_across);
    detected.misfit = std::max(detected.misfit, fit.misfit / std::max(fit.height, 1e-3));
    return fit.middle;
  }

  /// The profile along the scan, of what lies about the dash's middle line.
  void sum_along(double half_across, double middle) {
    weights_.assign(static_cast<std::size_t>(w_.across), 0);
    double all = 0;
    for (int r = 0; r < w_.across; ++r) {
      const double off = w_.v_of(r) - middle;
      const double weight = shapes_ ? (std::abs(off) < 0.6 * half_across ? std::max(shapes_->across.at(off), 0.0) : 0)
                                    : (std::abs(off) > 0.28 * half_across ? 0 : 1);
      all += weights_[static_cast<std::size_t>(r)] = weight;
    }
    along_.value.assign(static_cast<std::size_t>(w_.along), 0);
    along_.step = w_.step_along;
    for (int r = 0; r < w_.across && all > 0; ++r) {
      const double weight = weights_[static_cast<std::size_t>(r)] / all;
      if (weight <= 0) continue;
      for (int u = 0; u < w_.along; ++u) along_.value[static_cast<std::size_t>(u)] += weight * w_.at(r, u);
    }
  }

  double position_along(double length, double half_along, DashReading& detected) const {
    const double u = middle_of_ends(along_.value, w_.step_along, detected.ground, length / 2, 0.4 * chart_.gap_mm);
    if (!shapes_) return u;
    const ShapeFit fit = fit_shape(along_, shapes_->along, u, half_along - 0.1 * chart_.gap_mm, 0.25 * chart_.gap_mm);
    detected.misfit = std::max(detected.misfit, fit.misfit / std::max(fit.height, 1e-3));
    return fit.middle;
  }

  const Photo& photo_;
  const Chart& chart_;
  const View& view_;
  const std::optional<DashShapes>& shapes_;
  std::optional<DashShapes> gathered_;
  double longest_ = 0;
  DashWindow w_;
  Profile across_, along_;
  std::vector<double> edge_, weights_;
};

/// Decides which dashes are there, by comparison with usual dashes.
void check_dashes(const Photo& photo, const Chart& chart, std::vector<DashReading>& detected) {
  constexpr double kThere = 0.5, kMax = 2.5, kMarred = 3;  // shares of a usual dash
  // A usual dash: three quarters of all have less. Where most are missing, half of what full ink of its width has.
  std::vector<double> masses, misfits;
  for (const DashReading& one : detected) {
    if (!one.hidden) masses.push_back(one.mass);
  }
  if (masses.empty()) return;
  const auto rank = masses.begin() + static_cast<std::ptrdiff_t>(masses.size() * 3 / 4);
  std::nth_element(masses.begin(), rank, masses.end());
  const double pitch = 1e-6 * across_of(chart, {chart.pixel_x_nm, chart.pixel_y_nm});
  const double usual = std::max(*rank, 0.5 * photo.ink * pitch);
  for (DashReading& one : detected) {
    one.there = !one.hidden && one.mass > kThere * usual;
    one.hidden = one.hidden || one.mass > kMax * usual || one.ground > 0.35 * photo.ink;
    if (one.there && !one.hidden) misfits.push_back(one.misfit);
  }
  if (misfits.empty()) return;
  const double maximum = kMarred * upper_median_of(misfits);
  for (DashReading& one : detected) one.marred = one.misfit > maximum;
}

}  // namespace

std::vector<DashReading> see_dashes(const Photo& photo, const Chart& chart, const SheetFit& fit,
                                    std::optional<DashShapes>& shapes) {
  constexpr double kStray = 0.2;  // of the way to the next dash: how far a nozzle's own offset is followed
  std::vector<DashReading> detected;
  detected.reserve(chart.dashes.size());
  Inspect inspection(photo, chart, fit.view, shapes);
  const double maximum = kStray * chart.between_mm;
  const Spot sheet = middle_of({0, 0, chart.columns, chart.rows}, chart);
  const double sample = 1 / (kSamplesAPixel * fit.view.pixels_a_mm(sheet.x, sheet.y));
  std::minstd_rand random;
  const auto strewn = [&] {
    return sample * (static_cast<double>(random()) / static_cast<double>(std::minstd_rand::max()) - 0.5);
  };
  for (const ChartDash& dash : chart.dashes) {
    const Spot m = middle_of(dash.box, chart), shift = fit.shift[dash.swath], offset = fit.offset[dash.nozzle];
    // Distributed over a sample: if all windows are near where their dashes were detected before, the common shape is known at
    // few positions only, and keeps each dash there. This happens by chance, as a nozzle's dashes have even distances.
    const double dx = strewn(), dy = strewn();
    detected.push_back(inspection.see(dash, {m.x + shift.x + std::clamp(offset.x, -maximum, maximum) + dx,
                                             m.y + shift.y + std::clamp(offset.y, -maximum, maximum) + dy}));
  }
  check_dashes(photo, chart, detected);
  shapes = inspection.shapes();
  return detected;
}

std::vector<double> stripe(const Photo& photo, const View& view, const Spot& middle, bool along_x, double reach, double half) {
  DashWindow w;
  std::vector<double> line;
  if (!inspection(photo, view, middle, along_x, reach, half, w)) return line;
  for (int u = 0; u < w.along; ++u) {
    double sum = 0;
    for (int v = 0; v < w.across; ++v) sum += w.at(v, u);
    line.push_back(sum / w.across);
  }
  return line;
}

}  // namespace lamina::calibration
