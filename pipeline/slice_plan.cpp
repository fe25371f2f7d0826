#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <numeric>

#include "pipeline/heights_plan.h"
#include "pipeline/slice.h"
#include "stages/infill/fill.h"

namespace lamina::pipeline {
namespace {

using Clock = std::chrono::steady_clock;
double seconds_since(Clock::time_point start) { return std::chrono::duration<double>(Clock::now() - start).count(); }

Box box_of(const Scene& scene, const Instance& instance) {
  const Box& own = scene.meshes[instance.mesh].bounds;
  Box box;
  if (own.empty()) return box;
  const Point3& by = instance.offset;
  box.add(Point3{own.lo.x + by.x, own.lo.y + by.y, own.lo.z + by.z});
  box.add(Point3{own.hi.x + by.x, own.hi.y + by.y, own.hi.z + by.z});
  return box;
}

bool touch(const Box& a, const Box& b) {
  return !a.empty() && !b.empty() && a.lo.x <= b.hi.x && b.lo.x <= a.hi.x && a.lo.y <= b.hi.y && b.lo.y <= a.hi.y &&
         a.lo.z <= b.hi.z && b.lo.z <= a.hi.z;
}

/// Instances whose boxes touch, directly or through others, are one body: only there can solids overlap. Bodies are
/// numbered by their first instance.
std::vector<std::uint32_t> group_bodies(const std::vector<Box>& boxes) {
  const auto count = static_cast<std::uint32_t>(boxes.size());
  std::vector<std::uint32_t> root(count), order(count);
  std::iota(root.begin(), root.end(), 0u);
  std::iota(order.begin(), order.end(), 0u);
  const auto find = [&](std::uint32_t i) {
    while (root[i] != i) i = root[i] = root[root[i]];
    return i;
  };
  std::ranges::sort(order, {}, [&](std::uint32_t i) { return std::pair(boxes[i].lo.x, i); });
  std::vector<std::uint32_t> open;
  for (const std::uint32_t i : order) {
    std::erase_if(open, [&](std::uint32_t other) { return boxes[other].hi.x < boxes[i].lo.x; });
    for (const std::uint32_t other : open) {
      if (!touch(boxes[i], boxes[other])) continue;
      const std::uint32_t a = find(i), b = find(other);
      root[std::max(a, b)] = std::min(a, b);
    }
    open.push_back(i);
  }
  std::vector<std::uint32_t> body(count), number(count, UINT32_MAX);
  std::uint32_t bodies = 0;
  for (std::uint32_t i = 0; i < count; ++i) {
    std::uint32_t& own = number[find(i)];
    if (own == UINT32_MAX) own = bodies++;
    body[i] = own;
  }
  return body;
}

}  // namespace

Result<SlicePlan> SlicePlan::make(const Job& job, const ProgressCallback& progress) {
  SlicePlan plan;
  for (const PartRequest& part : job.parts) {
    auto filling = plan_filling(job.fill, part.fill);
    if (!filling) return filling.error();
    plan.fills_ = plan.fills_ || filling->fills();
    plan.plans_.push_back(std::move(*filling));
  }
  auto start = Clock::now();
  progress({ProgressEvent::Stage::kLoading});
  auto scene = load_scene(job);
  if (!scene) return scene.error();
  plan.scene_ = std::make_unique<Scene>(std::move(*scene));
  plan.load_seconds = seconds_since(start);

  start = Clock::now();
  progress({ProgressEvent::Stage::kIndexing});
  if (job.heights.containment != Containment::kAcross) {
    return Error{Fault::kUsage, "--containment: contours are cut in the middle of layers; use it with lamina jet"};
  }
  if (job.heights.per_part) {
    return Error{Fault::kUsage, "--per-part: a file of slices has one table of layers for all parts; leave it out"};
  }
  const Result<heights::LayerTable> table = layer_table(job, *plan.scene_);
  if (!table) return table.error();
  const std::uint32_t total = table->size();
  std::vector<Nm> planes(total);
  plan.layers_.reserve(total);
  for (std::uint32_t i = 0; i < total; ++i) {
    plan.layers_.push_back((*table)[i]);
    planes[i] = plan.layers_[i].plane();
  }
  std::vector<Box> boxes;
  for (const Instance& instance : plan.scene_->instances) {
    boxes.push_back(box_of(*plan.scene_, instance));
    plan.bounds_.add(boxes.back());
  }
  const std::vector<std::uint32_t> body = group_bodies(boxes);
  for (std::size_t i = 0; i < body.size(); ++i) {
    if (body[i] == plan.box_of_body_.size()) {
      const std::uint32_t part = plan.scene_->part_of_instance[i];
      plan.part_of_body_.push_back(part);
      plan.names_.push_back(std::filesystem::path(job.parts[part].path).filename().string());
      plan.box_of_body_.emplace_back();
    }
    plan.box_of_body_[body[i]].add(boxes[i]);
  }
  slice::SliceOptions options;
  options.fill_rule = job.fill_rule;
  options.tolerance = static_cast<Nm>(nm_of(job.slice.tolerance_um / 1000));
  options.gap = static_cast<Nm>(nm_of(job.slice.bridge_mm));
  options.offset = nm_of(job.slice.offset_mm);
  if (options.offset > 0) {
    const auto grow = static_cast<Nm>(options.offset);
    plan.bounds_.lo.x -= grow, plan.bounds_.lo.y -= grow, plan.bounds_.hi.x += grow, plan.bounds_.hi.y += grow;
  }
  auto slicer = slice::Slicer::build(plan.scene_->meshes, plan.scene_->instances, body, planes, options);
  if (!slicer) return slicer.error();
  plan.slicer_ = std::make_unique<slice::Slicer>(std::move(*slicer));
  plan.index_seconds = seconds_since(start);
  return plan;
}

const infill::FillParameters& SlicePlan::filling(std::uint32_t body, const Layer& layer) const {
  return plans_[part_of_body_[body]].at(std::int64_t{layer.plane()} - box_of_body_[body].lo.z);
}

Status SlicePlan::layer(std::uint32_t index, Work& work) const {
  auto report = slicer_->layer(index, work.scratch, work.contours);
  if (!report) return report.error();
  work.report = *report;
  work.paths.clear();
  work.path_body.clear();
  if (!fills_) return {};
  work.path_body.push_back(0);
  const Layer& layer = layers_[index];
  for (std::uint32_t b = 0; b < slicer_->bodies(); ++b) {
    const Box& box = box_of_body_[b];
    const infill::FillParameters& parameters = filling(b, layer);
    const ContoursView contours = work.contours.of(b, work.rebased);
    if (Status status = infill::append_fill(contours, {layer, box}, parameters, work.paths); !status) {
      return Error{status.error().fault, fmt::format("{}: fill: {}", names_[b], status.error().message)};
    }
    work.path_body.push_back(work.paths.size());
  }
  return {};
}

std::uint64_t SlicePlan::bytes_bound(std::uint32_t index) const {
  // Text of a contour's point is at most 50 bytes, and it is kept beside the contours. A filling's size depends on its
  // lines: it is estimated by the box and the bead.
  const std::uint64_t contours = slicer_->layer_bytes_bound(index);
  std::uint64_t filling = 0;
  if (fills_) {
    for (const Box& box : box_of_body_) {
      filling += static_cast<std::uint64_t>((box.width() + box.depth()) / 100'000 + 1) * 64;
    }
  }
  return 3 * contours + 4 * filling + (1 << 14);
}

}  // namespace lamina::pipeline
