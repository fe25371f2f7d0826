#include "stages/checks/vanished.h"

#include <fmt/format.h>

namespace lamina::checks {

VanishedPieces vanished_pieces(const RunsView& before, const RunsView& after, std::uint64_t minimum, VanishScratch& scratch) {
  VanishedPieces found;
  if (before.change.empty()) return found;
  scratch.pieces.find(before, true);
  scratch.stays.assign(scratch.pieces.count(), 0);
  for (std::uint32_t r = 0; r < before.rows(); ++r) {
    for_touching(before, r, after, r, false,
                 [&](std::uint32_t run, std::uint32_t) { scratch.stays[scratch.pieces.of_run[run]] = 1; });
  }
  for (std::size_t p = 0; p < scratch.pieces.count(); ++p) {
    const std::uint64_t pixels = scratch.pieces.pixels[p];
    if (scratch.stays[p] != 0 || pixels <= minimum) continue;
    ++found.count;
    if (pixels <= found.largest) continue;
    found.largest = pixels;
    found.box = scratch.pieces.box[p];
  }
  return found;
}

void VanishCount::add(const Layer& layer, const VanishedPieces& found) {
  if (found.count == 0 || layer.index != next_) end_span();
  next_ = layer.index + 1;
  if (found.count == 0) return;
  ++now_.layers;
  if (now_.layers == kLayers) layers_ += kLayers;
  if (now_.layers > kLayers) ++layers_;
  if (found.largest > now_.largest) {
    now_.largest = found.largest;
    now_.box = found.box;
    now_.layer = layer;
  }
  if (now_.layers >= kLayers && now_.largest > worst_.largest) worst_ = now_;
}

void VanishCount::end_span() { now_ = {}; }

void VanishCount::report(const PixelGrid& grid, bool mirrored_x, bool mirrored_y, std::vector<Warning>& warnings) const {
  if (layers_ == 0) return;
  std::int64_t column = (std::int64_t{worst_.box.left} + worst_.box.right - 1) / 2;
  std::int64_t row = (std::int64_t{worst_.box.top} + worst_.box.bottom - 1) / 2;
  if (mirrored_x) column = grid.columns() - 1 - column;
  if (mirrored_y) row = grid.rows() - 1 - row;
  const double mm2 = static_cast<double>(worst_.largest) / (grid.x.pixels_per_nm() * grid.y.pixels_per_nm() * 1e12);
  const double x = static_cast<double>(grid.x.centre(column)) / kNmPerMm,
               y = static_cast<double>(grid.y.centre(std::int64_t{grid.rows()} - 1 - row)) / kNmPerMm,
               z = mm(worst_.layer.bottom);
  warnings.push_back(
      {"vanished",
       fmt::format("the bleed leaves nothing of whole pieces of {} layers, the largest of {:.3g} mm2 at x {:.2f}, "
                   "y {:.2f}, z {:.2f} mm (layer {}): walls narrower than twice the bleed; make them thicker, or "
                   "give a smaller --bleed",
                   layers_, mm2, x, y, z, worst_.layer.index),
       {},
       worst_.layer.index,
       z});
}

}  // namespace lamina::checks
