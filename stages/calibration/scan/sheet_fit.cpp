#include "stages/calibration/scan/sheet_fit.h"

#include <algorithm>
#include <span>

#include "stages/calibration/robust.h"
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

namespace {

constexpr std::size_t kViewUnknowns = 9;
constexpr double kSmall = 1e-6;     // step of slopes
constexpr double kKeptSmall = 1;    // pixels^2 / mm^2: an offset of 50 um weighs as much as a twentieth of a pixel of one dash
constexpr double kMinScale = 0.02;  // pixels

double& unknown(View& view, std::size_t i) { return i < 8 ? view.h[i] : view.lens; }

/// Pixels a mm of x and of y.
struct Slopes {
  Spot x, y;
};

Slopes slopes_at(const View& view, const Spot& at, const Spot& detected) {
  const Spot x = view.at(at.x + kSmall, at.y), y = view.at(at.x, at.y + kSmall);
  return {{(x.x - detected.x) / kSmall, (x.y - detected.y) / kSmall},
          {(y.x - detected.x) / kSmall, (y.y - detected.y) / kSmall}};
}

class Fitter {
 public:
  Fitter(const std::vector<Sighting>& sightings, std::uint32_t first, bool lens, SheetFit& fit)
      : sightings_(sightings), first_(first), lens_(lens), fit_(fit), nozzles_(fit.offset.size()) {
    unknowns_ = kViewUnknowns + 2 * (fit.shift.size() - 1);
  }

  void run() {
    for (int step = 0; step < 12; ++step) {
      locate_swaths();
      locate_nozzles();
      if (take_step() < 1e-9) break;
    }
    fit_.scatter_pixels = scatter();
  }

 private:
  Spot position_of(const Sighting& one) const {
    const Spot shift = fit_.shift[one.swath], offset = fit_.offset[one.nozzle];
    return {one.position.x + shift.x + offset.x, one.position.y + shift.y + offset.y};
  }

  double scatter() const {
    std::vector<double> distances;
    distances.reserve(sightings_.size());
    for (const Sighting& one : sightings_) {
      const Spot at = position_of(one), p = fit_.view.at(at.x, at.y);
      distances.push_back(std::hypot(p.x - one.detected.x, p.y - one.detected.y));
    }
    return upper_median_of(distances);
  }

  /// How far a dash lies from where it should, in mm of the sheet.
  Spot off_by(const Sighting& one) const {
    const Spot at = position_of(one), p = fit_.view.at(at.x, at.y), off{one.detected.x - p.x, one.detected.y - p.y};
    const auto [x, y] = slopes_at(fit_.view, at, p);
    const double area = x.x * y.y - y.x * x.y;
    return {(y.y * off.x - y.x * off.y) / area, (x.x * off.y - x.y * off.x) / area};
  }

  /// Shifts as the medians of their dashes have them, so that a swath that lies far from the others is no outlier.
  void locate_swaths() {
    std::vector<std::vector<double>> x(fit_.shift.size()), y(fit_.shift.size());
    for (const Sighting& one : sightings_) {
      const Spot off = off_by(one);
      x[one.swath].push_back(off.x);
      y[one.swath].push_back(off.y);
    }
    const Spot first{upper_median_of(x[first_]), upper_median_of(y[first_])};
    for (std::size_t s = 0; s < fit_.shift.size(); ++s) {
      if (s != first_ && !x[s].empty())
        fit_.shift[s] = {fit_.shift[s].x + upper_median_of(x[s]) - first.x, fit_.shift[s].y + upper_median_of(y[s]) - first.y};
    }
  }

  /// Offsets as the medians of their dashes have them, so that a stray nozzle is no outlier.
  void locate_nozzles() {
    std::vector<std::vector<double>> x(nozzles_), y(nozzles_);
    for (const Sighting& one : sightings_) {
      const Spot off = off_by(one);
      x[one.nozzle].push_back(fit_.offset[one.nozzle].x + off.x);
      y[one.nozzle].push_back(fit_.offset[one.nozzle].y + off.y);
    }
    for (std::size_t n = 0; n < nozzles_; ++n) {
      if (!x[n].empty()) fit_.offset[n] = {upper_median_of(x[n]), upper_median_of(y[n])};
    }
  }

  /// Where the unknowns of a swath's shift begin; not of the first one.
  std::size_t shift_at(std::uint32_t swath) const {
    return kViewUnknowns + 2 * std::size_t{swath < first_ ? swath : swath - 1};
  }

  void add(const Sighting& one, const std::array<View, kViewUnknowns>& moved, double reach, GroupedLeastSquares& linear) const {
    const Spot at = position_of(one), p = fit_.view.at(at.x, at.y), error{one.detected.x - p.x, one.detected.y - p.y};
    const double share = std::hypot(error.x, error.y) / reach;
    if (share >= 1) return;
    const double weight = (1 - share * share) * (1 - share * share);
    std::array<GroupedLeastSquares::Term, kViewUnknowns + 2> x{}, y{};
    for (std::size_t i = 0; i < kViewUnknowns; ++i) {
      const Spot q = moved[i].at(at.x, at.y);
      const bool known = i == kViewUnknowns - 1 && !lens_;
      x[i] = {i, known ? 0 : (q.x - p.x) / kSmall};
      y[i] = {i, known ? 0 : (q.y - p.y) / kSmall};
    }
    const Slopes slopes = slopes_at(fit_.view, at, p);
    const std::array<double, 2> own_x{slopes.x.x, slopes.y.x}, own_y{slopes.x.y, slopes.y.y};
    const std::size_t terms = kViewUnknowns + (one.swath == first_ ? 0 : 2);
    for (std::size_t i = kViewUnknowns; i < terms; ++i) {
      const std::size_t axis = i - kViewUnknowns;
      x[i] = {shift_at(one.swath) + axis, own_x[axis]};
      y[i] = {shift_at(one.swath) + axis, own_y[axis]};
    }
    linear.add(std::span(x).first(terms), one.nozzle, own_x, error.x, weight);
    linear.add(std::span(y).first(terms), one.nozzle, own_y, error.y, weight);
  }

  /// returns the largest change of view and shifts
  double take_step() {
    const double reach = 4.7 * std::max(1.4826 * scatter(), kMinScale);
    GroupedLeastSquares linear(unknowns_, nozzles_, 2);
    for (std::size_t n = 0; n < nozzles_; ++n) {
      linear.add({}, n, std::array{1.0, 0.0}, -fit_.offset[n].x, kKeptSmall);
      linear.add({}, n, std::array{0.0, 1.0}, -fit_.offset[n].y, kKeptSmall);
    }
    std::array<View, kViewUnknowns> moved;
    for (std::size_t i = 0; i < kViewUnknowns; ++i) {
      moved[i] = fit_.view;
      unknown(moved[i], i) += kSmall;
    }
    for (const Sighting& one : sightings_) add(one, moved, reach, linear);
    std::vector<double> change(unknowns_), offset(2 * nozzles_);
    if (!linear.solve(1e-12, change, offset)) return 0;
    for (std::size_t i = 0; i < kViewUnknowns; ++i) unknown(fit_.view, i) += change[i];
    for (std::uint32_t s = 0; s < fit_.shift.size(); ++s) {
      if (s == first_) continue;
      const std::size_t at = shift_at(s);
      fit_.shift[s] = {fit_.shift[s].x + change[at], fit_.shift[s].y + change[at + 1]};
    }
    for (std::size_t n = 0; n < nozzles_; ++n)
      fit_.offset[n] = {fit_.offset[n].x + offset[2 * n], fit_.offset[n].y + offset[2 * n + 1]};
    double maximum = 0;
    for (const double one : change) maximum = std::max(maximum, std::abs(one));
    return maximum;
  }

  const std::vector<Sighting>& sightings_;
  std::uint32_t first_;
  bool lens_;
  SheetFit& fit_;
  std::size_t nozzles_;
  std::size_t unknowns_ = 0;
};

}  // namespace

void fit_sheet(const std::vector<Sighting>& sightings, std::uint32_t first, bool lens, SheetFit& fit) {
  Fitter(sightings, first, lens, fit).run();
}

HeadLine line_of(const std::vector<std::pair<double, double>>& values) {
  constexpr std::size_t kMax = 500;
  const std::size_t step = values.size() / kMax + 1;
  std::vector<double> slopes, rest;
  for (std::size_t i = 0; i < values.size(); i += step) {
    for (std::size_t j = i + step; j < values.size(); j += step)
      slopes.push_back((values[j].second - values[i].second) / (values[j].first - values[i].first));
  }
  HeadLine line;
  line.slope = upper_median_of(slopes);
  for (const auto& [index, value] : values) rest.push_back(value - line.slope * index);
  line.middle = upper_median_of(rest);
  return line;
}

}  // namespace lamina::calibration
