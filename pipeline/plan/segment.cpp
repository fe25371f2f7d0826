// pipeline/plan/segment.cpp: what a job says of segmented lines -> what is laid at each height.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "pipeline/job/job.h"
#include "pipeline/plan/segment.h"
#include "pipeline/text/key_text.h"

namespace lamina::pipeline {
namespace {

using Text = std::string_view;

std::string_view trimmed(Text text) {
  while (text.starts_with(' ')) text.remove_prefix(1);
  while (text.ends_with(' ')) text.remove_suffix(1);
  return text;
}

/// Sets keys from "thin_mm=2 on=false". returns "" or what is wrong
std::string read_changes(Text text, SegmentSettings& settings) {
  for (const Text change : split(trimmed(text), " ")) {
    if (change.empty()) continue;
    const std::size_t equals = change.find('=');
    if (equals == Text::npos) return fmt::format("'{}' is not key=value", change);
    std::vector<Text> names;
    const SegmentKey* found = nullptr;
    for (const SegmentKey& key : segment_settings_keys()) {
      names.push_back(key.name);
      if (key.name == change.substr(0, equals)) found = &key;
    }
    if (found == nullptr) {
      return fmt::format("'{}' is no key of a segmentation{}", change.substr(0, equals),
                         suggest(change.substr(0, equals), names));
    }
    if (const std::string wrong = found->read(change.substr(equals + 1), settings); !wrong.empty()) {
      return fmt::format("{}: {}", found->name, wrong);
    }
  }
  return {};
}

Result<SegmentRange> resolve(const SegmentSettings& settings, const segment::Calibration& calibration, double bead_mm) {
  SegmentRange range;
  range.settings = settings;
  segment::Segmentation& plan = range.plan;
  const segment::RepeatedReading widths = segment::repeated_at(calibration, settings.thick_extrusion);
  const double scale = bead_mm / calibration.width_mm;  // the tables are of one bead; others are taken in proportion
  plan.rule = settings.rule;
  plan.thick_mm = settings.thick_mm;
  plan.thin_mm = settings.thin_mm;
  plan.least_end_mm = settings.least_end_mm.value_or(settings.thick_mm / 2);
  plan.continuous = settings.continuous;
  plan.thick_extrusion = settings.thick_extrusion;
  plan.thin_extrusion = settings.thin_extrusion.value_or(settings.thick_extrusion);
  plan.thick_speed = settings.thick_speed.value_or(calibration.repeated.empty() ? 100 : widths.thick_speed_percent);
  plan.thin_speed = settings.thin_speed;
  const bool measured = !calibration.repeated.empty();
  plan.thick_width_mm = settings.thick_width_mm.value_or(measured ? widths.thick_mm * scale : bead_mm);
  plan.continuous_width_mm = settings.continuous_width_mm.value_or(measured ? widths.continuous_mm * scale : bead_mm);
  const auto thin_width = [&](double extrusion, double speed) {
    if (settings.thin_width_mm) return *settings.thin_width_mm;
    if (measured && extrusion == plan.thick_extrusion && std::abs(speed - 200) < 1) return widths.thin_mm * scale;
    if (speed > 100) return segment::thin_width_at_speed(calibration, speed).value * scale;
    return segment::thin_width_at_extrusion(calibration, extrusion).value * scale;
  };
  plan.thin_width_mm = thin_width(plan.thin_extrusion, plan.thin_speed);
  const std::size_t lines = std::max(settings.thin_speed_sweep.size(), settings.thin_extrusion_sweep.size());
  for (std::size_t i = 0; i < lines; ++i) {
    const auto of = [i](const std::vector<double>& list, double all) { return list.empty() ? all : list[i % list.size()]; };
    const double extrusion = of(settings.thin_extrusion_sweep, plan.thin_extrusion),
                 speed = of(settings.thin_speed_sweep, plan.thin_speed);
    plan.sweep.push_back({extrusion, speed, thin_width(extrusion, speed)});
  }
  segment::Spacing spacing = segment::spacing_for(plan.thick_width_mm, plan.continuous_width_mm, settings.gap_mm);
  const bool own_widths = settings.thick_width_mm || settings.continuous_width_mm;
  if (const auto settled = segment::settled_spacing(calibration, settings.thick_extrusion); settled && !own_widths) {
    spacing = {settled->segmented * scale + settings.gap_mm, settled->continuous * scale + settings.gap_mm};
  }
  plan.spacing_sc_mm = settings.spacing_sc_mm.value_or(spacing.segmented);
  plan.spacing_cc_mm = settings.spacing_cc_mm.value_or(spacing.continuous);
  if (const Status status = segment::check(plan, bead_mm); !status) return status.error();
  return range;
}

/// The distances between lines, in turn from a segmented one.
std::vector<double> distances_of(const segment::Segmentation& plan, std::int32_t first) {
  const auto period = static_cast<std::int64_t>(plan.continuous) + 1;
  std::vector<double> distances;
  for (std::int64_t line = 0; line < period; ++line) {
    const std::int64_t place = line - first - floor_div(line - first, period) * period;
    distances.push_back(place == 0 || place == period - 1 ? plan.spacing_sc_mm : plan.spacing_cc_mm);
  }
  return distances;
}

std::string list_text(const std::vector<double>& values) {
  std::vector<std::string> texts;
  for (const double value : values) texts.push_back(number_text(value));
  return fmt::format("{}", fmt::join(texts, ","));
}

/// Whether a filling leaves the distances between its lines to the segmentation.
bool leaves_distances(const FillSettings& fill) { return distance_keys(fill).empty() && fill.group == 1; }

/// Spacings of a segmentation beside distances that the filling gives itself.
Status check_spacings(const SegmentSettings& settings, const FillSettings& fill, const std::string& where) {
  if (!settings.on || leaves_distances(fill)) return {};
  const Text key = settings.spacing_sc_mm   ? "spacing_sc_mm"
                   : settings.spacing_cc_mm ? "spacing_cc_mm"
                   : settings.gap_mm != 0   ? "gap_mm"
                                            : "";
  if (key.empty()) return {};
  const auto keys = distance_keys(fill);
  return Error{Fault::kUsage, fmt::format("segment.{}: {}fill.{} says how far lines lie from each other; leave out one of them",
                                          key, where, keys.empty() ? Text("group") : keys.front())};
}

struct Entry {
  std::int64_t from, to;
  std::string heights, changes;
};

/// "0:2.7 thin_mm=2; 2.7:3 on=false" in pieces.
Result<std::vector<Entry>> read_entries(Text text, Text key) {
  std::vector<Entry> entries;
  for (Text piece : split(text, ";")) {
    piece = trimmed(piece);
    if (piece.empty()) continue;
    const std::size_t space = std::min(piece.find(' '), piece.size());
    const auto ends = split(piece.substr(0, space), ":");
    double from = 0, to = 0;
    const bool two = ends.size() == 2;
    if (!two || !read_number(ends[0], 0, kMostMm, " mm", from).empty() ||
        !read_number(ends[1], 0, kMostMm, " mm", to).empty() || nm_of(to) <= nm_of(from)) {
      return Error{Fault::kUsage, fmt::format("{}: '{}' is not from:to in mm, as in 2.7:3", key, piece.substr(0, space))};
    }
    entries.push_back({nm_of(from), nm_of(to), std::string(piece.substr(0, space)), std::string(trimmed(piece.substr(space)))});
  }
  std::ranges::sort(entries, {}, &Entry::from);
  for (std::size_t i = 1; i < entries.size(); ++i) {
    if (entries[i].from < entries[i - 1].to) {
      return Error{Fault::kUsage, fmt::format("{}: {} overlaps {}; end one where the other begins", key, entries[i].heights,
                                              entries[i - 1].heights)};
    }
  }
  return entries;
}

}  // namespace

const SegmentRange& SegmentPlan::at(std::int64_t height) const {
  for (const SegmentRange& range : ranges) {
    if (range.from <= height && height < range.to) return range;
  }
  return base;
}

bool SegmentPlan::any() const {
  return base.settings.on || std::ranges::any_of(ranges, [](const SegmentRange& range) { return range.settings.on; });
}

Result<SegmentPlan> plan_segments(const SegmentRequest& request, const segment::Calibration& calibration, FillRequest& fill) {
  SegmentPlan plan;
  auto base = resolve(request.all, calibration, fill.all.width_mm);
  if (!base && (request.all.on || !request.by_height.empty())) return base.error();
  if (base) plan.base = *base;
  auto entries = read_entries(request.by_height, "segment.by_height");
  if (!entries) return entries.error();
  const bool whole = request.all.on || !entries->empty();
  if (!whole) return plan;
  if (fill.all.pattern == infill::Pattern::kNone) fill.all.pattern = infill::Pattern::kRaster;
  const bool spaced = leaves_distances(fill.all);
  if (Status status = check_spacings(request.all, fill.all, ""); !status) return status.error();
  auto fillings = read_entries(fill.by_height, "fill.by_height");
  if (!fillings) return fillings.error();
  if (plan.base.settings.on && spaced) fill.all.distance_mm = distances_of(plan.base.plan, plan.base.settings.first);

  for (const Entry& entry : *entries) {
    SegmentSettings settings = request.all;
    if (const std::string what = read_changes(entry.changes, settings); !what.empty()) {
      return Error{Fault::kUsage, fmt::format("segment.by_height: {}: {}", entry.heights, what)};
    }
    if (Status status = spaced ? Status() : check_spacings(settings, fill.all, entry.heights + ": "); !status)
      return status.error();
    auto range = resolve(settings, calibration, fill.all.width_mm);
    if (!range) return Error{Fault::kUsage, fmt::format("segment.by_height: {}: {}", entry.heights, range.error().message)};
    range->from = entry.from;
    range->to = entry.to;
    // --- the filling of these heights gets the distances that go with them
    Entry* same = nullptr;
    for (Entry& filling : *fillings) {
      if (filling.from == entry.from && filling.to == entry.to) {
        same = &filling;
      } else if (filling.from < entry.to && entry.from < filling.to) {
        return Error{Fault::kUsage,
                     fmt::format("segment.by_height: {} overlaps {} of fill.by_height in part; give both the same ends",
                                 entry.heights, filling.heights)};
      }
    }
    if (spaced) {
      const bool own_gap = same != nullptr && (same->changes.find("gap") != std::string::npos ||
                                               same->changes.find("distance_mm") != std::string::npos);
      const std::vector<double> plain{fill.all.width_mm};
      const std::string distance = "distance_mm=" + list_text(settings.on ? distances_of(range->plan, settings.first) : plain);
      if (same == nullptr) {
        fillings->push_back({entry.from, entry.to, entry.heights, distance});
      } else if (!own_gap) {
        same->changes = distance + " " + same->changes;
      }
    }
    plan.ranges.push_back(std::move(*range));
  }
  fill.by_height.clear();
  for (const Entry& filling : *fillings) {
    fill.by_height += fmt::format("{}{} {}", fill.by_height.empty() ? "" : "; ", filling.heights, filling.changes);
  }
  return plan;
}

}  // namespace lamina::pipeline
