#include "stages/checks/paths.h"

#include <fmt/format.h>

#include <utility>

namespace lamina::checks {

void ReportedLayers::add(const Layer& layer) {
  if (++count > 1) return;
  index = layer.index;
  z_mm = mm(layer.plane());
  first = fmt::format("layer {} at z {:.3f} mm", index, z_mm);
}

void ReportedLayers::warn(std::string_view code, std::string text, std::vector<Warning>& warnings) const {
  if (count > 0) warnings.push_back({std::string(code), std::move(text), "", index, z_mm});
}

void PathWarnings::add(const Layer& layer, std::uint64_t open_chains, std::uint64_t lines, std::uint64_t thin) {
  if (open_chains > 0) open.add(layer);
  if (lines > 0 && thin == 0) undivided.add(layer);
}

void PathWarnings::report(bool fills, std::uint64_t moves, std::uint32_t layers, std::vector<Warning>& warnings) const {
  open.warn("chains-open",
            fmt::format("chains of cuts stay open in {} layers, first in {}: they bound nothing and are left out; leave "
                        "out --no-repair to close the parts",
                        open.count, open.first),
            warnings);
  undivided.warn("undivided",
                 fmt::format("segment.thin_mm: longer than every segmented line less its ends in {} of {} layers, first "
                             "in {}: no pores there",
                             undivided.count, layers, undivided.first),
                 warnings);
  if (fills && moves == 0) {
    warnings.push_back({"no-bead", "no bead fits into the parts: they are narrower than the walls and the filling ask for"});
  }
}

}  // namespace lamina::checks
