#include "stages/checks/layer_warnings.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "stages/checks/solid_checks.h"
#include "stages/support/text/readable.h"

namespace lamina::checks {

void ReportedLayers::add(const Layer& layer) {
  if (++count > 1) return;
  index = layer.index;
  z_mm = mm(layer.plane());
  first = fmt::format("layer {} at z {:.3f} mm", index, z_mm);
}

void ReportedLayers::warn(std::string code, std::string text, std::vector<Warning>& warnings, std::string part) const {
  if (count > 0) warnings.push_back({std::move(code), std::move(text), std::move(part), index, z_mm});
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
    warnings.push_back({"no-bead", "no bead fits into the parts: they are narrower than the walls and the infill require"});
  }
}

bool RowWarnings::note(Rows& reported, const Layer& layer, std::uint32_t rows, std::uint32_t first, const PixelGrid& grid) {
  if (rows == 0) return false;
  reported.rows += rows;
  reported.layers.add(layer);
  if (reported.layers.count > 1) return false;
  reported.position = fmt::format("in layer {} at y {:.3f} mm, z {:.3f} mm (image row {})", layer.index,
                                  mm(grid.y.centre(first)), mm(layer.plane()), grid.rows() - 1 - first);
  return true;
}

void RowWarnings::report(const std::string& part, std::vector<Warning>& warnings) const {
  capped_.layers.warn(
      "rows-capped",
      fmt::format("{}: {} rows in {} layers are closed only by the caps over its openings, first {}; see `lamina info`", part,
                  capped_.rows, capped_.layers.count, capped_.position),
      warnings, part);
  open_.layers.warn("rows-open",
                    fmt::format("{} rows in {} layers stay open, first {}; each is drawn up to its last crossing; leave out "
                                "--no-repair to close the parts",
                                open_.rows, open_.layers.count, open_.position),
                    warnings);
}

void LevelWarnings::add(const Layer& layer, const LevelFace& face) {
  constexpr std::uint64_t kReported = 1'000'000;  // um2: less is a rounded top or a small facet, and shows in few pixels
  if (face.area_um2 < kReported) return;
  layers_.add(layer);
  if (face.area_um2 <= largest_.area_um2) return;
  largest_ = face;
  position_ = fmt::format("layer {} is sampled, z {:.4f} mm", layer.index, mm(face.plane));
}

void LevelWarnings::report(const std::string& part, std::vector<Warning>& warnings) const {
  // Then all corners count as above the plane, or none does.
  constexpr double kAwayMm = (kLevelReach + 2 * kPlaneReach) * 1e-6;
  layers_.warn("horizontal-face",
               fmt::format("{}: {:.2f} mm2 of a horizontal face lie within 0.001 mm of where {}, and may be printed in part{}; move "
                           "the face up or down by {:.4f} mm, or choose another layer thickness",
                           part, static_cast<double>(largest_.area_um2) / 1e6, position_,
                           layers_.count > 1 ? fmt::format(" ({} such layers)", layers_.count) : "", kAwayMm),
               warnings, part);
}

namespace {

/// The layers whose planes lie in a stretch, [first, last).
LayerRange layers_in(const PowderInterval& span, std::span<const Nm> planes) {
  const auto below = [&](std::int64_t z) {
    return static_cast<std::uint32_t>(std::ranges::lower_bound(planes, z) - planes.begin());
  };
  return {below(span.from), below(span.to)};
}

}  // namespace

std::vector<LayerRange> mixed_layers(std::vector<PowderInterval> intervals, std::uint32_t materials,
                                     std::span<const Nm> planes) {
  std::ranges::sort(intervals, {}, &PowderInterval::from);
  std::vector<std::uint32_t> done(materials, 0);         // layers below are counted for the material
  std::vector<std::uint32_t> powders(planes.size(), 0);  // of each layer
  for (const PowderInterval& span : intervals) {
    const auto [first, last] = layers_in(span, planes);
    std::uint32_t& from = done[span.material];
    for (from = std::max(from, first); from < last; ++from) ++powders[from];
  }
  std::vector<LayerRange> ranges;
  for (std::uint32_t layer = 0; layer < powders.size(); ++layer) {
    if (powders[layer] < 2) continue;
    if (ranges.empty() || ranges.back()[1] + 1 != layer) ranges.push_back({layer, layer});
    ranges.back()[1] = layer;
  }
  return ranges;
}

void LayerRecords::add(const Layer& layer, std::uint64_t set_pixels, std::uint64_t lost_pixels, std::uint32_t capped_rows) {
  layers_.push_back(layer);
  filled_.push_back(set_pixels > 0 ? 1 : 0);
  lost_ += lost_pixels;
  if (capped_rows > 0) capped_layers_.add(layer);
  capped_ += capped_rows;
}

Status LayerRecords::check(std::span<const PartSummary> parts, bool thins, bool allow_empty,
                           std::vector<Warning>& warnings) const {
  const bool nothing = std::ranges::find(filled_, 1) == filled_.end();
  constexpr std::string_view kHint = "see `lamina info` of the parts, and the summary of a shard";
  if (nothing && !allow_empty) {
    return Error{Fault::kInput,
                 fmt::format("not one pixel in {} layer{}, so nothing is merged: {}; --allow-empty merges anyway",
                             layers_.size(), layers_.size() == 1 ? "" : "s", kHint)};
  }
  if (nothing) warnings.push_back({"empty", fmt::format("the job is empty: {}", kHint)});
  report(parts, warnings);
  if (thins) return {};
  std::vector<Solid> solids(parts.size());
  for (std::size_t i = 0; i < parts.size(); ++i) solids[i].box = parts[i].bounds;
  check_layers(
      solids, filled_, [&](std::uint32_t i) { return layers_[i]; }, warnings);
  return {};
}

void LayerRecords::report(std::span<const PartSummary> parts, std::vector<Warning>& warnings) const {
  warn_of_lost_pixels(lost_, warnings);
  const std::string part = parts.size() == 1 ? one_line(parts.front().path) : std::string();
  capped_layers_.warn(
      "rows-capped",
      fmt::format("{}{} rows in {} layers are closed only by the caps over openings, first in {}; see `lamina info`",
                  part.empty() ? "" : part + ": ", capped_, capped_layers_.count, capped_layers_.first),
      warnings, part);
}

void warn_of_lost_pixels(std::uint64_t pixels, std::vector<Warning>& warnings) {
  if (pixels == 0) return;
  warnings.push_back(
      {"lost-pixels",
       fmt::format("{} pixels of blocked nozzles are not fired at all; head.blocked_rule = \"second-pass\" fires them",
                   readable_count(pixels))});
}

void warn_of_open_top(const Layer& last, std::int64_t height, std::vector<Warning>& warnings) {
  const std::int64_t end = std::int64_t{last.bottom} + last.thickness;
  if (end < height || last.highest_plane() + kPlaneReach >= height) {
    warnings.push_back(
        {"cover-top", fmt::format("--cover-top: the layer that covers the top is empty with --containment inside, the "
                                  "topmost {:.3f} mm are not built; leave out one of the two",
                                  mm(height - (end < height ? end : last.bottom)))});
  }
}

void warn_of_unfed(const UnfedPowder& powder, std::vector<Warning>& warnings) {
  if (powder.pixels == 0) return;
  ReportedLayers first;
  first.add(powder.first);
  first.warn("mixed-powders",
             fmt::format("{} pixels of {} in {} layers are in another powder, whose vat feeds those layers, first in {}; "
                         "--vat-rule sets which vat feeds, refuse ends such a job",
                         readable_count(powder.pixels), one_line(powder.name), powder.layers, first.first),
             warnings);
}

Status refuse_warnings(std::span<const Warning> warnings) {
  if (warnings.empty()) return {};
  std::string text = fmt::format("--strict: {} warning{}", warnings.size(), warnings.size() == 1 ? "" : "s");
  for (const Warning& warning : warnings) text += fmt::format("; [{}] {}", warning.code, one_line(warning.text));
  return Error{Fault::kVerification, text};
}

}  // namespace lamina::checks
