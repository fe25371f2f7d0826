#include "pipeline/nest/plate.h"

#include <tbb/enumerable_thread_specific.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "pipeline/job/errors.h"
#include "pipeline/output/image_files.h"
#include "pipeline/plan/plan.h"
#include "pipeline/run/layer_imager.h"
#include "stages/support/text/readable.h"

namespace lamina::pipeline {
namespace {

constexpr std::uint32_t kSampledLayers = 64;

/// What the layers of a build take that one of them stands for.
struct SampledLayer {
  std::uint32_t begin = 0, end = 0;  // [begin, end)
  LayerRecord record;
};

/// The first layer, which is spread on the base, and the last one stand for themselves.
std::vector<SampledLayer> samples_of(std::uint32_t layers) {
  const std::uint32_t count = std::min(layers, kSampledLayers);
  std::vector<SampledLayer> samples(count);
  const auto begin_of = [&](std::uint32_t i) {
    if (layers <= kSampledLayers || i == 0) return i;
    if (i + 1 >= count) return layers - (count - i);
    return 1 + static_cast<std::uint32_t>(std::uint64_t{layers - 2} * (i - 1) / (count - 2));
  };
  for (std::uint32_t i = 0; i < count; ++i) {
    samples[i].begin = begin_of(i);
    samples[i].end = begin_of(i + 1);
  }
  return samples;
}

/// Makes a layer's images and times its program.
Status make_sample(const Plan& plan, const LayerImager& imager, const ImageFiles& files, SampledLayer& sample) {
  ImageWork work;
  ImageFiles::FileWork file;
  ImageNotes notes;
  sample.record.layer = plan.layer((sample.begin + sample.end) / 2);
  if (Status status = imager.make(sample.record.layer, work, sample.record, notes); !status) return status;
  const LayerImages images{work.runs, work.materials.image, work.drops.drops, work.drops.shares,
                           work.bits ? &*work.bits : nullptr};
  return files.program(images, file, sample.record);
}

/// What each copy has of a layer's pixels.
std::vector<std::uint64_t> shares_of(const NestPlan& plan, const NestBuild& build, const Layer& layer, std::uint64_t pixels) {
  const double middle = mm(std::int64_t{layer.bottom} + layer.thickness / 2);
  std::vector<std::uint64_t> areas;
  for (const NestedCopy& copy : build.copies) {
    const std::vector<double>& sections = plan.sections[copy.sections];
    const double at = middle / copy.height_mm * static_cast<double>(sections.size());
    const bool inside = at < static_cast<double>(sections.size());
    // Square micrometres.
    areas.push_back(inside ? static_cast<std::uint64_t>(std::llround(1e6 * sections[static_cast<std::size_t>(at)])) : 0);
  }
  const auto whole = cost::shares(static_cast<std::int64_t>(pixels), areas);
  return {whole.begin(), whole.end()};
}

}  // namespace

Job plate_of(const NestBuild& build, const std::vector<OrderRow>& rows, const Job& options) {
  Job job = options;
  job.parts.clear();
  job.output.clear();
  job.threads = 0;
  for (const NestedCopy& copy : build.copies) {
    PartRequest part = settings_of(rows[copy.row], options);
    part.path = rows[copy.row].path;
    part.copies = 1;
    part.at_mm = {copy.x_mm, copy.y_mm};
    const std::array<double, 3> rotation = rotation_of(rows[copy.row], copy.turn);
    for (std::size_t i = 0; i < 3; ++i) part.rotate_deg[i] += rotation[i];
    job.parts.push_back(std::move(part));
  }
  return job;
}

NestSpace nest_space(const Resolved& resolved) {
  NestSpace space;
  space.bed = {nm_of(resolved.bed.size_mm[0]), nm_of(resolved.bed.size_mm[1]), nm_of(resolved.bed.margin_mm), false};
  space.height = kNmReach;
  if (resolved.printer && resolved.printer->machine) {
    const Machine& machine = resolved.printer->machine->machine;
    space.machine = machine.name;
    space.bed.round = machine.bed.shape == BedShape::kRound;
    space.height = nm_of(machine.bed.build_height_mm);
  }
  if (resolved.extruder) {
    space.machine = resolved.extruder->machine.name;
    space.height = nm_of(resolved.extruder->machine.bed.build_height_mm);
  }
  space.gap = nm_of(resolved.job.gap_mm);
  for (const double quarter : {0, 90, 180, 270}) space.turns.push_back(std::llround(quarter * 1e6));
  return space;
}

Status nest_job(Product product, Job& job) {
  const auto resolved = resolve(job, product);
  if (!resolved) return resolved.error();
  std::vector<OrderRow> rows;
  for (std::uint32_t i = 0; i < job.parts.size(); ++i) {
    const PartRequest& part = job.parts[i];
    if (part.at_mm && part.copies > 1)
      return usage("--nest: part {} has a position for {} copies; give one copy a position", i + 1, part.copies);
    OrderRow& row = rows.emplace_back();
    row.path = part.path;
    row.copies = part.copies;
    row.fixed_mm = part.at_mm;
    row.request = i;
  }
  NestSpace space = nest_space(*resolved);
  const auto plan = nest_orders(rows, space, job);
  if (!plan) return plan.error();
  if (!plan->left_out.empty())
    return usage("--nest: {}: {}", one_line(rows[plan->left_out[0].row].path), plan->left_out[0].reason);
  if (plan->builds.size() > 1) {
    std::size_t parts = 0;
    for (const NestBuild& build : plan->builds) parts += build.copies.size();
    return usage("--nest: {} of {} parts fit the first of {} builds; make the builds with lamina nest",
                 plan->builds[0].copies.size(), parts, plan->builds.size());
  }
  job.parts = plate_of(plan->builds[0], rows, job).parts;
  return {};
}

Status quote_build(const Job& plate, Product product, const NestPlan& plan, NestBuild& build) {
  if (product != Product::kImages) return {};
  auto resolved = resolve(plate, product);
  if (!resolved) return resolved.error();
  if (!resolved->printer->machine) return {};
  resolved->job.dry_run = true;
  const auto made = make_plan(std::move(*resolved), [](const ProgressEvent&) {});
  if (!made) return made.error();
  const LayerImager imager(*made, true);
  const ImageFiles files(*made);
  std::vector<SampledLayer> samples = samples_of(made->layer_count);
  std::vector<Status> status(samples.size());
  tbb::parallel_for(std::size_t{0}, samples.size(),
                    [&](std::size_t i) { status[i] = make_sample(*made, imager, files, samples[i]); });
  for (const Status& each : status)
    if (!each) return each;

  const Machine& machine = made->images->machine->machine;
  cost::Tally tally(machine, made->images->grid, build.copies.size());
  tally.add_base();
  for (const SampledLayer& sample : samples) {
    const LayerRecord& record = sample.record;
    for (std::uint32_t i = sample.begin; i < sample.end; ++i) {
      const Layer layer = made->layer(i);
      tally.add(layer.thickness, record.program.microseconds, record.program.drops + record.program.spat,
                record.filled_pixels(), shares_of(plan, build, layer, record.filled_pixels()));
    }
  }
  build.use = BuildUse{made->layer_count, tally.quote(), machine.cost};
  return {};
}

Status quote_builds(Product product, const std::vector<OrderRow>& rows, const Job& options, const ProgressCallback& progress,
                    const std::atomic<bool>& cancel, NestPlan& plan) {
  const auto count = static_cast<std::uint32_t>(plan.builds.size());
  for (std::uint32_t b = 0; b < count; ++b) {
    progress({ProgressEvent::Stage::kBuilds, b, count});
    if (cancel) return Error{Fault::kInterrupted, "interrupted"};
    NestBuild& build = plan.builds[b];
    if (Status status = quote_build(plate_of(build, rows, options), product, plan, build); !status) return status;
  }
  return {};
}

}  // namespace lamina::pipeline
