#include "pipeline/check/doses.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "pipeline/job/file.h"
#include "pipeline/job/job.h"
#include "stages/heights/heights.h"

namespace lamina::pipeline {
namespace {

// Drops a pixel are rounded to 2^-24.
constexpr double kOfDrops = 1e-12, kDropStep = 3e-8;
constexpr double kMaxDropsOfPixel = 64;

/// As shares and drops are taken.
double in_millionths(double value) { return static_cast<double>(std::llround(value * 1e6)) * 1e-6; }

}  // namespace

DoseCheck::DoseCheck(const ManifestHead& head, const Machine* machine) : head_(head), machine_(machine) {
  Job job;
  if (read_job_text(head.job_toml, "manifest.json", job)) job_ = std::move(job);
}

void DoseCheck::check_heights(const Manifest& manifest, Faults& faults) const {
  const auto options = job_ ? heights_options(*job_) : Error{};
  heights::OnRecord layers(options ? std::optional(*options) : std::nullopt);
  for (const LayerRecord& record : manifest.layers) {
    if (const Status status = layers.check(record.layer); !status) faults.add(status.error().message);
  }
}

std::optional<DoseCheck::RequestedRange> DoseCheck::requested_range(const Layer& layer) const {
  if (!job_) return std::nullopt;
  const DoseRequest& dose = job_->dose;
  if (!dose.saturation_percent) {
    // Levels that are not dithered are drops to a head that fires several; else a full pixel gets one.
    const bool drops = machine_ != nullptr && machine_->head.max_drops > 1 && head_.levels > 0 && !dose.dithered;
    const double full = drops ? head_.levels - 1 : 1;
    return RequestedRange{full, full};
  }
  if (machine_ == nullptr || machine_->head.drop_pl <= 0) return std::nullopt;
  const Nm plane = layer.plane();
  Saturation percent = *dose.saturation_percent;
  std::optional<Saturation> core = dose.core_saturation_percent;
  for (const SaturationRange& range : dose.saturation_ranges) {
    if (plane < nm_of(range.from_mm) || plane >= nm_of(range.to_mm)) continue;
    percent = range.percent;
    core = range.core_percent;
  }
  std::vector<Saturation> targets{percent, core.value_or(percent)};
  for (const PartRequest& part : job_->parts) {
    if (!part.saturation_percent && !part.core_saturation_percent) continue;
    const Saturation own = part.saturation_percent.value_or(percent);
    targets.insert(targets.end(), {own, part.core_saturation_percent.value_or(own), core.value_or(own)});
  }
  // What a formula requests depends on the positions of parts.
  if (std::ranges::any_of(targets, [](const Saturation& target) { return !target.formula.empty(); })) return std::nullopt;
  const auto& powder = machine_->powder;
  const double pixel_mm2 = 25.4 / head_.grid.x.dpi() * 25.4 / head_.grid.y.dpi();
  const double voids_pl = pixel_mm2 * mm(layer.thickness) * 1e6 * (1 - in_millionths(powder.packing));
  const double stays_pl = in_millionths(machine_->head.drop_pl) * (1 - in_millionths(powder.evaporates_percent / 100));
  const auto drops = [&](double target) { return in_millionths(target / 100) * voids_pl / stays_pl; };
  const auto [minimum, maximum] = std::ranges::minmax_element(targets, {}, &Saturation::percent);
  return RequestedRange{drops(minimum->percent), drops(maximum->percent)};
}

double DoseCheck::max_pixels(const Layer& layer) const {
  const double bed = static_cast<double>(head_.grid.columns()) * head_.grid.rows();
  double pixels = 0;
  const auto grows = [](const std::optional<std::array<double, 2>>& um) { return um && ((*um)[0] < 0 || (*um)[1] < 0); };
  if (!job_ || grows(job_->dose.bleed_um) || grows(job_->dose.hole_bleed_um) || grows(job_->dose.first_bleed_um)) return bed;
  for (const PartRequest& part : job_->parts) {
    if (grows(part.bleed_um) || grows(part.hole_bleed_um)) return bed;
  }
  for (const PartSummary& part : head_.parts) {
    const Box& box = part.bounds;
    if (box.lo.z >= layer.bottom + layer.thickness || box.hi.z <= layer.bottom) continue;
    pixels += part.copies * (static_cast<double>(box.width()) * head_.grid.x.pixels_per_nm() + 2) *
              (static_cast<double>(box.depth()) * head_.grid.y.pixels_per_nm() + 2);
  }
  return std::min(pixels, bed);
}

std::string DoseCheck::fault(const LayerRecord& record, std::uint64_t set, std::uint64_t levels) const {
  const auto said = [&](const std::string& what) { return fmt::format("layer {}: {}", record.layer.index, what); };
  if (record.half_far > record.half_differs) {
    return said(fmt::format("the manifest says {} of {} pixels whose voxels differ", record.half_far, record.half_differs));
  }
  if (const std::uint64_t full = head_.grey_drops() ? 0 : head_.full_level(); full > 0) {
    const std::uint64_t voxels = (2 * levels + full) / (2 * full);
    if (voxels == record.dosed_pixels) return {};
    return said(
        fmt::format("its levels come to {} full voxels, the manifest says dosed_pixels {}", voxels, record.dosed_pixels));
  }
  if (head_.max_drops == 0) return {};
  const std::string what = fault_of_dosed(record, set);
  if (!what.empty()) return said(what);
  const std::string requested = fault_of_target(record);
  return requested.empty() ? requested : said(requested);
}

std::string DoseCheck::fault_of_dosed(const LayerRecord& record, std::uint64_t set) const {
  const auto dosed = static_cast<double>(record.dosed_pixels);
  // A level is at least one of a full voxel's.
  const double full = std::max(1u, head_.levels > 0 ? head_.levels - 1 : 1), minimum = static_cast<double>(set) / full - 0.5;
  const auto target = requested_range(record.layer);
  if (head_.levels == 0 && target) {
    const double sweeps = machine_ != nullptr ? machine_->head.max_drop_sweeps : 0;
    const double limit = sweeps > 0 ? std::min(sweeps * head_.sweep_drops, kMaxDropsOfPixel) : kMaxDropsOfPixel;
    const double jetted = std::min(target->minimum, limit);
    if (jetted > (job_->dose.dithered ? 1 : 0.5) * (1 + kOfDrops) + kDropStep && record.dosed_pixels != set) {
      return fmt::format("each pixel gets a drop, and {} have one; the manifest says dosed_pixels {}", set,
                         record.dosed_pixels);
    }
  }
  const double maximum = max_pixels(record.layer);
  if (dosed >= minimum && dosed <= maximum + 0.5) return {};
  return fmt::format("the manifest says dosed_pixels {}, and {} is the {} that its {} can have", record.dosed_pixels,
                     dosed < minimum ? std::ceil(minimum) : std::floor(maximum), dosed < minimum ? "minimum" : "maximum",
                     dosed < minimum ? "images" : "parts");
}

std::string DoseCheck::fault_of_target(const LayerRecord& record) const {
  const auto target = requested_range(record.layer);
  if (!target) return {};
  const auto dosed = static_cast<double>(record.dosed_pixels), requested = static_cast<double>(record.requested_drops);
  // Both numbers are rounded, that of voxels too where they are shares.
  const double apart = head_.levels > 0 ? 0.5 : 0;
  const double minimum = std::max(0.0, dosed - apart) * std::max(0.0, target->minimum * (1 - kOfDrops) - kDropStep) - 0.5001;
  const double maximum = (dosed + apart) * (target->maximum * (1 + kOfDrops) + kDropStep) + 0.5001;
  if (requested >= minimum && requested <= maximum) return {};
  const std::string drops = target->minimum == target->maximum
                                ? fmt::format("{:.6g}", target->minimum)
                                : fmt::format("{:.6g} to {:.6g}", target->minimum, target->maximum);
  return fmt::format(
      "{} pixels with a target of {} drops each need {:.0f} to {:.0f} drops, the manifest says requested_drops {}",
      record.dosed_pixels, drops, std::ceil(std::max(0.0, minimum)), std::floor(maximum), record.requested_drops);
}

}  // namespace lamina::pipeline
