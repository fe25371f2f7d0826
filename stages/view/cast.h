// stages/view/cast.h: views of parts on the bed, with one Embree ray per sample.
//
// Pictures do not affect any output of a job, so coordinates are floats here. Rays are orthographic, four per pixel; the
// first facet on a ray is shaded by the angle of its normal.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "stages/data/mesh.h"
#include "stages/data/status.h"

namespace lamina::view {

/// From above with the front of the bed below; from the front; from the right with the front on the left.
enum class ViewSide : std::uint8_t { kTop, kFront, kRight };

struct Picture {
  std::uint32_t width = 0, height = 0;    // pixels
  double width_mm = 0, height_mm = 0;     // of all parts together
  std::vector<std::uint8_t> light_cover;  // per pixel, rows from the top: lightness (255 white), coverage by parts
};

class Caster {
 public:
  /// meshes, instances  on the bed, at least one facet; not needed afterwards
  /// errors  kInternal if Embree fails
  /// cost    O(T log T); 48 bytes a facet and Embree's tree. Copies share both
  static Result<Caster> build(std::span<const Mesh> meshes, std::span<const Instance> instances);
  Caster(Caster&&) noexcept;
  ~Caster();

  /// The view, with `most` pixels along the longest side of the box around all parts (the same scale for every view).
  /// cost  4 rays per pixel, on all processors
  Picture render(ViewSide side, std::uint32_t maximum) const;

 private:
  Caster();
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace lamina::view
