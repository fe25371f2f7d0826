#include "pipeline/check/expected_drops.h"

#include <fmt/format.h>

#include <algorithm>
#include <vector>

#include "pipeline/check/job_files.h"
#include "pipeline/job/file.h"
#include "pipeline/plan/dose.h"
#include "stages/data/runs.h"

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
  return expected;
}

Result<ExpectedDrops> ExpectedDrops::of(const std::string& directory, const ManifestHead& head) {
  if (!head.geometry) return ExpectedDrops();
  const auto machine = machine_of_job(directory, head);
  return machine ? of(head, machine->profile()) : machine.error();
}

void ExpectedDrops::apply(const Layer& layer, std::vector<Runs>& planes) const {
  if (!dose_) return;
  Runs image = std::move(planes.front()), second, third;
  dose_->thin(layer.index, image, second, third);
  dose::DropWork work;
  if (dose_->saturates()) {
    const auto sums = dose_->saturate(layer, false, 1, image, {}, second, work);
    if (!sums) return;  // only formulas fail
  }
  planes.clear();
  if (dose_->max_drops() > 1) {
    planes.assign(std::make_move_iterator(work.planes.begin()), std::make_move_iterator(work.planes.end()));
  } else {
    planes.push_back(std::move(image));
  }
}

std::string ExpectedDrops::fault(const ManifestHead& head, const LayerRecord& record, const std::vector<Runs>& planes) {
  if (!head.geometry) return {};
  if (head.max_drops > 0 && record.dosed_pixels != record.geometry_pixels) {
    return fmt::format("layer {}: its image sets {} pixels, the manifest says dosed_pixels {}", record.layer.index,
                       record.geometry_pixels, record.dosed_pixels);
  }
  const std::uint64_t set = set_pixels(planes.front());
  if (set == record.set_pixels) return {};
  return fmt::format("layer {}: {} pixels of its image get drops by the job, the manifest says set_pixels {}",
                     record.layer.index, set, record.set_pixels);
}

}  // namespace lamina::pipeline
