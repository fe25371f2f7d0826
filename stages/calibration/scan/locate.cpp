#include "stages/calibration/scan/locate.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <opencv2/imgproc.hpp>

#include "stages/calibration/robust.h"
#include "stages/calibration/scan/photo.h"
#include "stages/geometry/least_squares.h"

namespace lamina::calibration {
namespace {

constexpr double kCoarseSide = 110, kFineSide = 220;  // pixels of small copies
constexpr double kCoarseStep = 2, kApartDeg = 8;      // of rotations that are tried, and that count as different ones
constexpr std::size_t kMaxCoarse = 6, kMaxFine = 4;   // rotations
constexpr double kWorse = 0.85;                       // of the best likeness: candidates below are dropped
constexpr double kAsWell = 0.02, kTie = 0.01;         // differences of likeness

/// What is left without slow changes of the light. wide  of them, pixels
cv::Mat without_shade(const cv::Mat& image, double wide) {
  cv::Mat slow;
  cv::GaussianBlur(image, slow, {}, wide, wide, cv::BORDER_REPLICATE);
  return image - slow;
}

/// Small copies of a photograph and of a layer, and the waves of the first: the layer is searched in it.
class SmallCopies {
 public:
  SmallCopies(const cv::Mat& photo, const cv::Mat& cells, double side) {
    constexpr double kMinCells = 64, kMaxPhoto = 500;  // a small layer in a large photograph keeps its shape
    const double all = std::max(photo.cols, photo.rows), own = std::max(cells.cols, cells.rows);
    scale_ = std::min({1.0, std::max(side / std::max(all, own), kMinCells / own), kMaxPhoto / std::max(all, own)});
    cv::Mat few;
    cv::resize(photo, few, {}, scale_, scale_, cv::INTER_AREA);
    cv::resize(cells, cells_, {}, scale_, scale_, cv::INTER_AREA);
    const double reach = std::hypot(cells_.cols, cells_.rows);
    side_ =
        cv::getOptimalDFTSize(static_cast<int>(std::max<double>(std::max(few.cols, few.rows) + 0.5 * reach, 1.1 * reach)) + 1);
    cv::Mat padded = cv::Mat::zeros(side_, side_, CV_32F);
    few.copyTo(padded(cv::Rect(0, 0, few.cols, few.rows)));
    cv::dft(padded, waves_);
    energy_ = cv::norm(few);
  }

  /// The best position of the layer in the photograph at a rotation and a scale.
  struct LayerMatch {
    double likeness = -1, rotation_deg = 0, scale = 1;
    Spot at;  // of the middle of the layer, pixels of the photograph
  };
  LayerMatch match(double rotation_deg, double scale) const {
    cv::Mat to = cv::getRotationMatrix2D(
        {0.5f * static_cast<float>(cells_.cols - 1), 0.5f * static_cast<float>(cells_.rows - 1)}, -rotation_deg, scale);
    to.at<double>(0, 2) += 0.5 * (side_ - cells_.cols);
    to.at<double>(1, 2) += 0.5 * (side_ - cells_.rows);
    cv::Mat rotated, waves, product;
    cv::warpAffine(cells_, rotated, to, {side_, side_}, cv::INTER_LINEAR, cv::BORDER_CONSTANT, 0);
    const double energy = cv::norm(rotated);
    cv::dft(rotated, waves);
    cv::mulSpectrums(waves_, waves, product, 0, true);
    cv::idft(product, product, cv::DFT_SCALE | cv::DFT_REAL_OUTPUT);
    double maximum = 0;
    cv::Point at;
    cv::minMaxLoc(product, nullptr, &maximum, nullptr, &at);
    const auto middle = [&](int shift) {  // pixel centres of small copies: (i + 0.5) * scale - 0.5
      return ((shift > side_ / 2 ? shift - side_ : shift) + 0.5 * side_) / scale_ - 0.5;
    };
    return {maximum / std::max(energy_ * energy, 1e-9), rotation_deg, scale, {middle(at.x), middle(at.y)}};
  }

  LayerMatch best(const std::vector<double>& rotations, const std::vector<double>& scales) const {
    LayerMatch best;
    for (const double rotation : rotations) {
      for (const double scale : scales) {
        if (const LayerMatch one = match(rotation, scale); one.likeness > best.likeness) best = one;
      }
    }
    return best;
  }

 private:
  cv::Mat cells_, waves_;
  double scale_ = 1, energy_ = 0;
  int side_ = 0;
};
using LayerMatch = SmallCopies::LayerMatch;

double angle_between(double a_deg, double b_deg) { return std::abs(std::remainder(a_deg - b_deg, 360)); }

/// The best, at most `maximum`, each at another rotation.
std::vector<LayerMatch> different(std::vector<LayerMatch> matches, std::size_t maximum) {
  std::ranges::stable_sort(matches, std::greater<>(), &LayerMatch::likeness);
  std::vector<LayerMatch> kept;
  for (const LayerMatch& one : matches) {
    const bool known = std::ranges::any_of(
        kept, [&](const LayerMatch& other) { return angle_between(one.rotation_deg, other.rotation_deg) < kApartDeg; });
    if (!known && kept.size() < maximum && one.likeness >= kWorse * matches[0].likeness) kept.push_back(one);
  }
  return kept;
}

/// All rotations on small copies, then the best of them on larger ones.
std::vector<LayerMatch> candidates(const cv::Mat& photo, const cv::Mat& cells) {
  const SmallCopies coarse(photo, cells, kCoarseSide), fine(photo, cells, kFineSide);
  std::vector<LayerMatch> matches;
  for (double rotation = -180; rotation < 180; rotation += kCoarseStep)
    matches.push_back(coarse.best({rotation}, {0.97, 1.0, 1.03}));
  matches = different(std::move(matches), kMaxCoarse);
  for (LayerMatch& one : matches) {
    std::vector<double> rotations;
    for (double turn = -1.5; turn <= 1.5; turn += 0.5) rotations.push_back(one.rotation_deg + turn);
    one = fine.best(rotations, {one.scale - 0.015, one.scale, one.scale + 0.015});
  }
  return different(std::move(matches), kMaxFine);
}

View view_of_match(const cv::Mat& photo, const LayerCells& layer, const LayerMatch& match) {
  const double c = std::cos(match.rotation_deg * std::numbers::pi / 180) * match.scale / layer.side,
               s = std::sin(match.rotation_deg * std::numbers::pi / 180) * match.scale / layer.side;
  const cv::Mat& cells = layer.share;
  View view;
  view.middle = {layer.left + 0.5 * cells.cols * layer.side, layer.top + 0.5 * cells.rows * layer.side};
  view.unit = 0.5 * std::max(cells.cols, cells.rows) * layer.side;
  view.photo_middle = {0.5 * (photo.cols - 1), 0.5 * (photo.rows - 1)};
  view.radius = std::hypot(photo.cols, photo.rows) / 2;
  view.h = {c * view.unit, -s * view.unit, match.at.x, s * view.unit, c * view.unit, match.at.y, 0, 0};
  return view;
}

/// Moves the view until edges are on edges: photo(view(position)) - gain * layer(position), by Gauss and Newton, with Cauchy's
/// weights, so that a missing stripe does not bend the view.
void refine(const cv::Mat& photo, const cv::Mat& cells, const LayerCells& layer, View& view) {
  struct Sample {
    Spot position;
    double value;
  };
  cv::Mat dx, dy, slope_x, slope_y;
  cv::Sobel(cells, dx, CV_32F, 1, 0);
  cv::Sobel(cells, dy, CV_32F, 0, 1);
  cv::Sobel(photo, slope_x, CV_32F, 1, 0, 3, 1.0 / 8);
  cv::Sobel(photo, slope_y, CV_32F, 0, 1, 3, 1.0 / 8);
  std::vector<Sample> samples;
  double steepest = 0;
  cv::Mat steep;
  cv::magnitude(dx, dy, steep);
  cv::minMaxLoc(steep, nullptr, &steepest);
  for (int y = 0; y < cells.rows; ++y) {
    for (int x = 0; x < cells.cols; ++x) {
      if (static_cast<double>(steep.at<float>(y, x)) > 0.15 * steepest)
        samples.push_back({layer.middle(x, y), static_cast<double>(cells.at<float>(y, x))});
    }
  }
  const std::size_t step = samples.size() / 20'000 + 1;
  for (int round = 0; round < 15; ++round) {
    LeastSquares linear(9);
    double vv = 1e-9, pv = 0;
    for (std::size_t i = 0; i < samples.size(); i += step) {
      const Spot p = view.at(samples[i].position.x, samples[i].position.y);
      pv += darkness_at(photo, p.x, p.y) * samples[i].value;
      vv += samples[i].value * samples[i].value;
    }
    const double gain = pv / vv;
    std::vector<double> left;
    for (std::size_t i = 0; i < samples.size(); i += step) {
      const Spot p = view.at(samples[i].position.x, samples[i].position.y);
      left.push_back(std::abs(gain * samples[i].value - darkness_at(photo, p.x, p.y)));
    }
    const double usual = std::max(2 * upper_median_of(left), 1e-6);
    for (std::size_t i = 0; i < samples.size(); i += step) {
      const Spot& m = samples[i].position;
      const Spot p = view.at(m.x, m.y);
      if (!(p.x >= 1 && p.y >= 1 && p.x <= photo.cols - 2 && p.y <= photo.rows - 2)) continue;
      const double gx = darkness_at(slope_x, p.x, p.y), gy = darkness_at(slope_y, p.x, p.y);
      const double u = (m.x - view.middle.x) / view.unit, v = (m.y - view.middle.y) / view.unit,
                   w = 1 + view.h[6] * u + view.h[7] * v;
      const double g = -(gx * p.x + gy * p.y);
      const std::array<double, 9> slope{gx * u / w, gx * v / w, gx / w,    gy * u / w,       gy * v / w,
                                        gy / w,     g * u / w,  g * v / w, -samples[i].value};
      const double error = gain * samples[i].value - darkness_at(photo, p.x, p.y), share = error / usual;
      linear.add(slope, error, 1 / (1 + share * share));
    }
    linear.damp(1e-9, 0);
    std::array<double, 9> change{};
    if (!linear.solve(change)) return;
    for (std::size_t i = 0; i < 8; ++i) view.h[i] += change[i];
    if (std::ranges::all_of(change.begin(), change.begin() + 6, [](double one) { return std::abs(one) < 1e-4; })) return;
  }
}

/// Correlation of the photograph with the layer, cell by cell.
double likeness_in(const cv::Mat& photo, const cv::Mat& cells, const LayerCells& layer, const View& view) {
  const cv::Mat detected = in_cells(photo, layer, view, 0);
  return detected.dot(cells) / std::max(cv::norm(detected) * cv::norm(cells), 1e-9);
}

/// Of the direction of x in the middle of the layer.
double rotation_of(const View& view) {
  return std::atan2(view.h[3] - view.h[5] * view.h[6], view.h[0] - view.h[2] * view.h[6]) * 180 / std::numbers::pi;
}

/// A photograph and a layer at several degrees of blur, each of them free of shade.
struct Blurred {
  cv::Mat photo, cells;
};

/// The views of all candidates with their likeness, best first.
std::vector<LayerPosition> positions_of(const std::vector<Blurred>& blurred, const cv::Mat& photo, const cv::Mat& cells,
                                        const LayerCells& layer) {
  std::vector<LayerPosition> positions;
  for (const LayerMatch& match : candidates(photo, cells)) {
    LayerPosition position{.view = view_of_match(photo, layer, match), .also_deg = {}};
    for (const Blurred& one : blurred) refine(one.photo, one.cells, layer, position.view);
    position.likeness = likeness_in(blurred.back().photo, blurred.back().cells, layer, position.view);
    position.rotation_deg = rotation_of(position.view);
    positions.push_back(std::move(position));
  }
  std::ranges::stable_sort(positions, std::greater<>(), &LayerPosition::likeness);
  return positions;
}

std::vector<Blurred> blurred_of(const cv::Mat& photo, const cv::Mat& cells) {
  std::vector<Blurred> blurred;
  for (const double sigma : {8.0, 4.0, 2.0, 1.0}) {
    Blurred& one = blurred.emplace_back();
    cv::GaussianBlur(photo, one.photo, {}, sigma);
    cv::GaussianBlur(cells, one.cells, {}, sigma);
  }
  return blurred;
}

}  // namespace

cv::Mat in_cells(const cv::Mat& image, const LayerCells& layer, const View& view, double outside) {
  cv::Mat detected(layer.share.size(), CV_32F);
  for (int y = 0; y < detected.rows; ++y) {
    for (int x = 0; x < detected.cols; ++x) {
      const Spot m = layer.middle(x, y), p = view.at(m.x, m.y);
      const bool inside = p.x >= 0 && p.y >= 0 && p.x < image.cols - 1 && p.y < image.rows - 1;
      detected.at<float>(y, x) = inside ? static_cast<float>(darkness_at(image, p.x, p.y)) : static_cast<float>(outside);
    }
  }
  return detected;
}

LayerPosition locate_layer(const cv::Mat& light, const LayerCells& layer) {
  const double wide = std::max(8.0, 0.08 * std::max(layer.share.cols, layer.share.rows));
  const cv::Mat photo = without_shade(-light, wide), cells = without_shade(layer.share, wide);
  cv::Mat mirrored;
  cv::flip(cells, mirrored, 1);
  const std::vector<LayerPosition> positions = positions_of(blurred_of(photo, cells), photo, cells, layer);
  const std::vector<LayerPosition> flipped = positions_of(blurred_of(photo, mirrored), photo, mirrored, layer);
  if (positions.empty() || flipped.empty()) return {};  // one grey all over: like nothing
  LayerPosition best = positions.front();
  for (const LayerPosition& one : positions) {
    const bool as_good = one.likeness > positions.front().likeness - kTie;
    if (as_good && std::abs(one.rotation_deg) < std::abs(best.rotation_deg)) best = one;
  }
  for (const LayerPosition& one : positions) {
    const bool other = angle_between(one.rotation_deg, best.rotation_deg) > kApartDeg;
    if (other && one.likeness > positions.front().likeness - kAsWell) best.also_deg.push_back(one.rotation_deg);
  }
  best.mirrored_likeness = flipped.front().likeness;
  return best;
}

}  // namespace lamina::calibration
