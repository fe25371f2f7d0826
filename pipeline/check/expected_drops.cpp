#include "pipeline/check/expected_drops.h"

#include <fmt/format.h>

#include <algorithm>
#include <vector>

#include "pipeline/check/job_files.h"
#include "pipeline/job/file.h"
#include "pipeline/plan/dose.h"

namespace lamina::pipeline {

ExpectedDrops::ExpectedDrops() = default;
ExpectedDrops::ExpectedDrops(ExpectedDrops&&) noexcept = default;
ExpectedDrops& ExpectedDrops::operator=(ExpectedDrops&&) noexcept = default;
ExpectedDrops::~ExpectedDrops() = default;

Result<ExpectedDrops> ExpectedDrops::of(const ManifestHead& head, const Machine& machine) {
  ExpectedDrops expected;
  if (!head.geometry) return expected;
  Job job;
  if (Status status = read_job_text(head.job_toml, "manifest.json", job); !status)
    return Error{Fault::kVerification, status.error().message};
  auto dose = std::make_unique<DosePlan>(job, head.grid);
  dose->restore(machine, head.sweep_drops, head.max_drops);
  if (!drops_follow_image(job))
    return Error{Fault::kVerification, "manifest.json: the drops of its job do not follow from images of the geometry"};
  expected.dose_ = std::move(dose);
  expected.max_drops_ = std::max(1u, head.max_drops);
  return expected;
}

Result<ExpectedDrops> ExpectedDrops::of(const std::string& directory, const ManifestHead& head) {
  if (!head.geometry) return ExpectedDrops();
  const auto machine = machine_of_job(directory, head);
  return machine ? of(head, machine->profile()) : machine.error();
}

Status ExpectedDrops::make(const Layer& layer, std::span<const Runs> images, LayerDrops& drops) const {
  drops.planes_.clear();
  drops.made_.clear();
  drops.runs_.clear();
  drops.pixels = drops.drops = drops.requested = drops.maximum = 0;
  if (!dose_) {
    drops.runs_.reserve(images.size());
    for (const Runs& image : images) {
      const std::uint64_t set = set_pixels(image);
      if (drops.planes_.empty()) drops.pixels = set;
      drops.drops += set;
      drops.maximum += set > 0 ? 1 : 0;
      drops.planes_.push_back(&drops.runs_.emplace_back(image));
    }
    return {};
  }
  dose::DropWork& work = drops.work_;
  work.drops.clear();
  if (dose_->thins()) dose_->thin(layer.index, images.front(), drops.second_, work);
  if (dose_->saturates()) {
    const auto sums = dose_->saturate(layer, false, 1, images.front(), {}, drops.second_, work);
    if (!sums) {
      return Error{Fault::kVerification, fmt::format("layer {}: the drops of its image cannot be made again: {}", layer.index,
                                                     sums.error().message)};
    }
    drops.requested = sums->requested_drops;
  }
  const DropTotals totals(work.drops.front(), work.counter);
  drops.pixels = totals.pixels();
  drops.drops = totals.drops();
  drops.maximum = totals.maximum();
  for (std::uint32_t drop = 0; drop < max_drops_; ++drop) drops.made_.emplace_back(work.drops.front(), drop);
  for (const DropPlane& plane : drops.made_) drops.planes_.push_back(&plane);
  return {};
}

Status ExpectedDrops::apply(const Layer& layer, std::vector<Runs>& images) const {
  if (!dose_) return {};
  LayerDrops drops;
  if (Status status = make(layer, images, drops); !status) return status;
  std::vector<Runs> planes(drops.planes().size());
  for (std::uint32_t i = 0; i < planes.size(); ++i) runs_of(drops.work_.drops.front(), i, planes[i]);
  images = std::move(planes);
  return {};
}

std::string ExpectedDrops::fault(const ManifestHead& head, const LayerRecord& record, const LayerDrops& drops) {
  if (!head.geometry) return {};
  if (head.max_drops > 0 && record.dosed_pixels != record.geometry_pixels) {
    return fmt::format("layer {}: its image sets {} pixels, the manifest says dosed_pixels {}", record.layer.index,
                       record.geometry_pixels, record.dosed_pixels);
  }
  if (head.max_drops > 0 && record.requested_drops != drops.requested) {
    return fmt::format("layer {}: its pixels need {} drops by the job, the manifest says requested_drops {}", record.layer.index,
                       drops.requested, record.requested_drops);
  }
  if (drops.pixels == record.set_pixels) return {};
  return fmt::format("layer {}: {} pixels of its image get drops by the job, the manifest says set_pixels {}",
                     record.layer.index, drops.pixels, record.set_pixels);
}

}  // namespace lamina::pipeline
