// stages/dose/covered_spans.h: the heights at which something of each dose can lie, and those at which a core can.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "stages/data/grid.h"
#include "stages/data/layer.h"

namespace lamina::dose {

/// A part, at most: everything of it lies within the box. nm along x, y and z; grown by its bleed.
struct ZoneBox {
  std::uint32_t zone = 0;
  std::array<std::int64_t, 3> low{}, high{};
  std::array<std::int64_t, 3> origin{};  // corner of the part, from which a formula of its own counts
};

/// A bound by boxes: zones reported as absent are absent; zones reported as present may be absent.
class CoveredSpans {
 public:
  /// Every zone at all heights, with a core.
  CoveredSpans() = default;
  /// shell_nm  a core lies deeper than that; parts that may touch have one together. pixel_nm  the larger pitch
  /// cost      O(boxes log boxes)
  CoveredSpans(std::span<const ZoneBox> boxes, std::uint32_t zones, std::int64_t shell_nm, std::int64_t pixel_nm);

  bool any(std::uint32_t zone, const Layer& layer) const { return everywhere_ || meets(all_[zone], layer); }
  bool core(std::uint32_t zone, const Layer& layer) const { return everywhere_ || meets(core_[zone], layer); }

 private:
  struct Span {
    std::int64_t from = 0, to = 0;
  };
  using Spans = std::vector<Span>;  // in order, apart
  static void merge(Spans& spans);
  static bool meets(const Spans& spans, const Layer& layer);

  bool everywhere_ = true;
  std::vector<Spans> all_, core_;  // by zone
};

}  // namespace lamina::dose
