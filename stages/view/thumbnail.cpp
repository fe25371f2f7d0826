#include "stages/view/thumbnail.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace lamina::view {
namespace {

using Vector = std::array<double, 3>;

constexpr std::uint32_t kSamples = 2;  // a pixel, along each side
constexpr int kGround = 255, kBrightest = 200, kDarkest = 40;
constexpr double kMargin = 0.04;  // of the picture, at each side

double dot(const Vector& a, const Vector& b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }
Vector cross(const Vector& a, const Vector& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}
Vector unit(const Vector& a) {
  const double length = std::sqrt(dot(a, a));
  return length > 0 ? Vector{a[0] / length, a[1] / length, a[2] / length} : a;
}

/// Right, up and towards the viewer, who is in front of the bed, to the right and above.
struct Camera {
  Vector towards = unit({0.6, -1, 0.75}), right = unit({1, 0.6, 0}), up = cross(towards, right);
  Vector light = unit({0.1, -0.7, 1});
  Vector operator()(const Point3& p, const Point3& by) const {
    const Vector at{static_cast<double>(p.x) + by.x, static_cast<double>(p.y) + by.y, static_cast<double>(p.z) + by.z};
    return {dot(at, right), dot(at, up), dot(at, towards)};
  }
};

/// The nearest facet of each sample.
class DepthBuffer {
 public:
  DepthBuffer(std::uint32_t width, std::uint32_t height)
      : width_(width), height_(height), depth_(std::size_t{width} * height, -HUGE_VALF), shade_(depth_.size(), kGround) {}

  /// Corners in samples: x to the right, y down, and nearness.
  void draw(const std::array<Vector, 3>& corner, std::uint8_t shade) {
    const auto [a, b, c] = corner;
    const double area = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
    if (area == 0) return;
    const auto limits = [](double p, double q, double r, std::uint32_t end) {
      const double low = std::min({p, q, r}), high = std::max({p, q, r});
      return std::array{static_cast<int>(std::max(0.0, std::ceil(low - 0.5))),
                        static_cast<int>(std::min(end - 1.0, std::floor(high - 0.5)))};
    };
    const auto [x0, x1] = limits(a[0], b[0], c[0], width_);
    const auto [y0, y1] = limits(a[1], b[1], c[1], height_);
    for (int y = y0; y <= y1; ++y) {
      for (int x = x0; x <= x1; ++x) {
        const double px = x + 0.5, py = y + 0.5;
        const double of_b = ((px - a[0]) * (c[1] - a[1]) - (py - a[1]) * (c[0] - a[0])) / area;
        const double of_c = ((b[0] - a[0]) * (py - a[1]) - (b[1] - a[1]) * (px - a[0])) / area;
        if (of_b < 0 || of_c < 0 || of_b + of_c > 1) continue;
        const auto near = static_cast<float>(a[2] + of_b * (b[2] - a[2]) + of_c * (c[2] - a[2]));
        const std::size_t at = static_cast<std::size_t>(y) * width_ + static_cast<std::size_t>(x);
        if (near <= depth_[at]) continue;
        depth_[at] = near;
        shade_[at] = shade;
      }
    }
  }

  /// The mean of the samples of a pixel.
  std::uint8_t pixel(std::uint32_t x, std::uint32_t y) const {
    std::uint32_t sum = 0;
    for (std::uint32_t j = 0; j < kSamples; ++j) {
      for (std::uint32_t i = 0; i < kSamples; ++i) {
        sum += shade_[std::size_t{y * kSamples + j} * width_ + x * kSamples + i];
      }
    }
    return static_cast<std::uint8_t>(sum / (kSamples * kSamples));
  }

 private:
  std::uint32_t width_, height_;
  std::vector<float> depth_;
  std::vector<std::uint8_t> shade_;
};

/// Calls visit(corners, normal) for each facet in the camera's frame.
template <class Visit>
void for_each_facet(std::span<const Mesh> meshes, std::span<const Instance> instances, const Camera& camera,
                    const Visit& visit) {
  for (const Instance& instance : instances) {
    for (const Triangle& t : meshes[instance.mesh].triangles) {
      const auto edge = [](const Point3& from, const Point3& to) {
        return Vector{static_cast<double>(to.x) - from.x, static_cast<double>(to.y) - from.y,
                      static_cast<double>(to.z) - from.z};
      };
      visit(std::array{camera(t.a, instance.offset), camera(t.b, instance.offset), camera(t.c, instance.offset)},
            unit(cross(edge(t.a, t.b), edge(t.a, t.c))));
    }
  }
}

}  // namespace

std::vector<std::string> thumbnail_colours() {
  constexpr int kFirst[] = {70, 30, 0}, kPart[] = {255, 165, 75}, kLast[] = {245, 245, 245};
  std::vector<std::string> colours;
  for (int i = 0; i <= kGround; ++i) {
    std::string colour;
    for (int channel = 0; channel < 3; ++channel) {
      const int value = i <= kBrightest
                            ? kFirst[channel] + (kPart[channel] - kFirst[channel]) * i / kBrightest
                            : kPart[channel] + (kLast[channel] - kPart[channel]) * (i - kBrightest) / (kGround - kBrightest);
      colour += fmt::format("{:02x}", value);
    }
    colours.push_back(colour);
  }
  return colours;
}

Thumbnail draw_thumbnail(std::span<const Mesh> meshes, std::span<const Instance> instances, std::uint32_t width,
                         std::uint32_t height) {
  const Camera camera;
  double low[2] = {HUGE_VAL, HUGE_VAL}, high[2] = {-HUGE_VAL, -HUGE_VAL};
  for_each_facet(meshes, instances, camera, [&](const std::array<Vector, 3>& corner, const Vector&) {
    for (const Vector& at : corner) {
      for (std::size_t i = 0; i < 2; ++i) low[i] = std::min(low[i], at[i]), high[i] = std::max(high[i], at[i]);
    }
  });
  Thumbnail picture{width, height, std::vector<std::uint8_t>(std::size_t{width} * height, kGround)};
  if (low[0] > high[0]) return picture;
  DepthBuffer buffer(width * kSamples, height * kSamples);
  const double columns = width * kSamples, rows = height * kSamples;
  const double scale =
      (1 - 2 * kMargin) * std::min(columns / std::max(1.0, high[0] - low[0]), rows / std::max(1.0, high[1] - low[1]));
  const double left = (columns - (low[0] + high[0]) * scale) / 2, top = (rows + (low[1] + high[1]) * scale) / 2;
  for_each_facet(meshes, instances, camera, [&](std::array<Vector, 3> corner, const Vector& normal) {
    if (dot(normal, camera.towards) <= 0) return;
    for (Vector& at : corner) at = {left + at[0] * scale, top - at[1] * scale, at[2] * 1e-6};
    const double light = 0.35 * dot(normal, camera.towards) + 0.65 * std::max(0.0, dot(normal, camera.light));
    buffer.draw(corner, static_cast<std::uint8_t>(std::clamp<int>(static_cast<int>(kDarkest + (kBrightest - kDarkest) * light),
                                                                  kDarkest, kBrightest)));
  });
  for (std::uint32_t y = 0; y < height; ++y) {
    for (std::uint32_t x = 0; x < width; ++x) picture.pixels[std::size_t{y} * width + x] = buffer.pixel(x, y);
  }
  return picture;
}

}  // namespace lamina::view
