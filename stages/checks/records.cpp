#include "stages/checks/records.h"

#include <fmt/format.h>

#include <algorithm>

#include "stages/checks/solid_checks.h"
#include "stages/support/text/readable.h"

namespace lamina::checks {

void LayerRecords::add(const Layer& layer, std::uint64_t set_pixels, std::uint64_t lost_pixels, std::uint32_t capped_rows) {
  layers_.push_back(layer);
  filled_.push_back(set_pixels > 0 ? 1 : 0);
  lost_ += lost_pixels;
  if (capped_rows > 0 && capped_layers_++ == 0) first_capped_ = layer;
  capped_ += capped_rows;
}

Status LayerRecords::check(std::span<const PartSummary> parts, bool thins, bool allow_empty,
                           std::vector<Warning>& warnings) const {
  const bool nothing = std::ranges::find(filled_, 1) == filled_.end();
  constexpr std::string_view kHint = "look at `lamina info` of the parts, and at the summary of a shard";
  if (nothing && !allow_empty) {
    return Error{Fault::kInput, fmt::format("not one pixel in {} layer{}, so nothing is joined: {}; --allow-empty joins it "
                                            "nevertheless",
                                            layers_.size(), layers_.size() == 1 ? "" : "s", kHint)};
  }
  if (nothing) warnings.push_back({"empty", fmt::format("the whole job is empty: {}", kHint)});
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
  if (capped_ == 0) return;
  const double z = mm(first_capped_.plane());
  const std::string part = parts.size() == 1 ? one_line(parts.front().path) : std::string();
  warnings.push_back({"rows-capped",
                      fmt::format("{}{} rows in {} layers are closed only by the caps put over openings, first in layer {} "
                                  "at z {:.3f} mm; look at `lamina info`",
                                  part.empty() ? "" : part + ": ", capped_, capped_layers_, first_capped_.index, z),
                      part, first_capped_.index, z});
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
  if (end < height || last.highest_plane() >= height) {
    warnings.push_back(
        {"cover-top", fmt::format("--cover-top: the layer that covers the top is empty with --containment inside, the "
                                  "topmost {:.3f} mm are not built; leave out one of the two",
                                  mm(height - (end < height ? end : last.bottom)))});
  }
}

void warn_of_unfed(const UnfedPowder& powder, std::vector<Warning>& warnings) {
  if (powder.pixels == 0) return;
  const double z = mm(powder.first.plane());
  warnings.push_back(
      {"mixed-powders",
       fmt::format("{} pixels of {} in {} layers lie in another powder, whose vat feeds those layers, first in layer {} at z "
                   "{:.3f} mm; --vat-rule says which vat feeds, refuse ends such a job",
                   readable_count(powder.pixels), one_line(powder.name), powder.layers, powder.first.index, z),
       "", powder.first.index, z});
}

Status refuse_warnings(std::span<const Warning> warnings) {
  if (warnings.empty()) return {};
  std::string text = fmt::format("--strict: {} warning{}", warnings.size(), warnings.size() == 1 ? "" : "s");
  for (const Warning& warning : warnings) text += fmt::format("; [{}] {}", warning.code, one_line(warning.text));
  return Error{Fault::kVerification, text};
}

}  // namespace lamina::checks
