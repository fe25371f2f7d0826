// stages/data/layer.h: one layer of the job, the plane that stands for it, and the binder and powder in it.
#pragma once

#include <algorithm>
#include <cstdint>
#include <string>
#include <string_view>
#include <utility>

#include "stages/data/units.h"

namespace lamina {

/// Why a layer has its thickness.
enum class LayerReason : std::uint8_t {
  kUniform,  // the thickest that there is, or the only one
  kSlope,    // a facet is at least as flat as the angle that requests thinner layers
  kPeak,     // a horizontal face lies in or on top of the thicker layer
  kCusp,     // a thicker layer would leave too high a step on a slope
  kFlat      // so that a layer ends on a horizontal face, or at the top or bottom of a part
};

constexpr std::string_view reason_name(LayerReason reason) {
  switch (reason) {
    case LayerReason::kSlope: return "slope";
    case LayerReason::kPeak: return "peak";
    case LayerReason::kCusp: return "cusp";
    case LayerReason::kFlat: return "flat";
    case LayerReason::kUniform: break;
  }
  return "uniform";
}

/// Where the steps of the layers lie. A plane in the middle puts them across the true surface; two planes, at the
/// bottom and at the top of the layer, give what lies inside (both) or outside (either).
enum class Containment : std::uint8_t { kAcross, kInside, kOutside };

struct Layer {
  std::uint32_t index;  // from 0 at the bottom
  Nm bottom;            // nm above the bed
  Nm thickness;         // nm, > 0
  LayerReason reason = LayerReason::kUniform;

  /// Height at which the part is sampled: the middle of the layer, rounded down.
  Nm plane() const { return bottom + thickness / 2; }
  /// The same of a layer that covers a part of which it holds only what lies below `top`: where the layer's middle lies above
  /// the part, the middle of that.
  Nm plane_below(std::int64_t top) const {
    return plane() < top || top <= bottom ? plane() : static_cast<Nm>(bottom + (top - bottom) / 2);
  }
  /// The planes that see the section at the layer's very bottom and at its very top. Vertices up to kPlaneReach above a plane count
  /// as below it, so the upper one lies 1 nm more under the top: a face that ends the layer is still cut.
  Nm lowest_plane() const { return bottom; }
  Nm highest_plane() const { return std::max(bottom, bottom + thickness - 1 - kPlaneReach); }
};

/// Per cent of the powder's voids: a number, or a formula of the position (stages/dose/field.h).
struct Saturation {
  double percent = 0;
  std::string formula;  // of x, y and z in mm; empty: the number

  Saturation() = default;
  Saturation(double of_voids) : percent(of_voids) {}
  static Saturation of(std::string text) {
    Saturation saturation;
    saturation.formula = std::move(text);
    return saturation;
  }
  bool operator==(const Saturation&) const = default;
};

/// Pixels of a powder in layers that the vat of another one feeds: its binder falls into that other powder.
struct UnfedPowder {
  std::string name;
  std::uint64_t pixels = 0;
  std::uint32_t layers = 0;
  Layer first{};

  /// In layer order.
  void add(const Layer& layer, std::uint64_t of_layer) {
    if (of_layer == 0) return;
    if (layers++ == 0) first = layer;
    pixels += of_layer;
  }
};

}  // namespace lamina
