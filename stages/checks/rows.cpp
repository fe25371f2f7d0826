#include "stages/checks/rows.h"

#include <fmt/format.h>

namespace lamina::checks {

bool RowWarnings::note(Rows& reported, const Layer& layer, std::uint32_t rows, std::uint32_t first, const PixelGrid& grid) {
  if (rows == 0) return false;
  const bool is_first = reported.rows == 0;
  if (is_first) {
    reported.position = fmt::format("in layer {} at y {:.3f} mm, z {:.3f} mm (image row {})", layer.index,
                                    mm(grid.y.centre(first)), mm(layer.plane()), grid.rows() - 1 - first);
    reported.layer = layer.index;
    reported.z_mm = mm(layer.plane());
  }
  reported.rows += rows;
  ++reported.layers;
  return is_first;
}

void RowWarnings::report(const std::string& part, std::vector<Warning>& warnings) const {
  if (capped_.rows > 0) {
    warnings.push_back(
        {"rows-capped",
         fmt::format(
             "{}: {} rows in {} layers are closed only by the caps put over its openings, first {}; look at `lamina info`",
             part, capped_.rows, capped_.layers, capped_.position),
         part, capped_.layer, capped_.z_mm});
  }
  if (open_.rows > 0) {
    warnings.push_back(
        {"rows-open",
         fmt::format("{} rows in {} layers stay open, first {}; each is drawn up to its last crossing; leave out "
                     "--no-repair to close the parts",
                     open_.rows, open_.layers, open_.position),
         "", open_.layer, open_.z_mm});
  }
}

}  // namespace lamina::checks
