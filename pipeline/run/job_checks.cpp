#include "pipeline/run/job_checks.h"

#include <fmt/format.h>

#include <algorithm>

#include "pipeline/plan/layers.h"
#include "stages/load/planned.h"
#include "stages/slice/bodies.h"
#include "stages/slice/slice.h"
#include "stages/support/text/readable.h"

namespace lamina::pipeline {
namespace {

std::vector<checks::Solid> solids_of(const Scene& scene) {
  std::vector<checks::Solid> solids;
  for (std::size_t i = 0; i < scene.instances.size(); ++i) {
    const Mesh& mesh = scene.meshes[scene.instances[i].mesh];
    solids.push_back({box_of(scene, scene.instances[i]), scene.part_of_instance[i], 0, mesh.volume_mm3, mesh.closed});
  }
  return solids;
}

std::vector<checks::Solid> solids_of(const Plan& plan) {
  if (plan.images) return solids_from_above(*plan.scene);
  std::vector<checks::Solid> solids = solids_of(*plan.scene);
  for (std::size_t i = 0; i < solids.size(); ++i) solids[i].group = plan.sections->body_of_instance()[i];
  return solids;
}

}  // namespace

std::vector<checks::Solid> solids_from_above(const Scene& scene) {
  std::vector<checks::Solid> solids = solids_of(scene);
  std::vector<Box> boxes;
  for (const checks::Solid& solid : solids) boxes.push_back(solid.box);
  const std::vector<std::uint32_t> group = slice::group_from_above(std::move(boxes));
  for (std::size_t i = 0; i < solids.size(); ++i) solids[i].group = group[i];
  return solids;
}

checks::Sampling sampling_of(const Job& job, const PixelGrid* grid) {
  checks::Sampling sampling;
  sampling.one_sided = job.heights.containment != Containment::kAcross;
  if (grid != nullptr) {
    sampling.pixel_mm = {25.4 / grid->x.dpi(), 25.4 / grid->y.dpi()};
    const auto bleeds = bleeds_of(job);
    if (std::ranges::all_of(bleeds, [&](const auto& um) { return um == bleeds.front(); })) sampling.bleed_um = bleeds.front();
  } else {
    sampling.tolerance_um = job.slice.tolerance_um.value_or(0);
    sampling.offset_mm = job.slice.offset_mm;
  }
  return sampling;
}

std::function<Result<double>(std::uint32_t)> union_in(const Scene& scene, const checks::Tally& tally,
                                                      const std::atomic<bool>* cancel, checks::GroupUnion::Again again) {
  const auto volume = [cancel](std::span<const Mesh> meshes, std::span<const Instance> members) -> Result<double> {
    const Error interrupted{Fault::kInterrupted, "interrupted"};
    if (cancel != nullptr && *cancel) return interrupted;
    const double mm3 = load::union_mm3(meshes, members, slice::surplus_areas);
    return cancel != nullptr && *cancel ? Result<double>(interrupted) : mm3;
  };
  const auto merged =
      std::make_shared<checks::GroupUnion>(scene.meshes, scene.instances, tally.solids(), volume, std::move(again));
  return [merged](std::uint32_t group) { return merged->mm3(group); };
}

JobChecks::JobChecks(const Plan& plan, const std::atomic<bool>& cancel)
    : plan_(plan), tally_(std::make_unique<checks::Tally>(solids_of(plan))) {
  for (const PartSummary& part : plan.scene->parts) names_.push_back(one_line(part.path));
  if (plan.images) tally_->inspect_layers(plan.images->grid);
  sampling_ = sampling_of(plan.job, plan.images ? &plan.images->grid : nullptr);
  if (!plan.images) sampling_.tolerance_um = tolerance_um_of(plan.job, plan.product);
  sampling_.part = names_;
  // Where triangles are in clusters, parts are read again.
  const bool in_blocks = std::ranges::any_of(plan.scene->meshes, [](const Mesh& mesh) { return mesh.blocks != nullptr; });
  checks::GroupUnion::Again again = [this]() -> Result<std::vector<Mesh>> {
    const PixelGrid* const grid = plan_.images ? &plan_.images->grid : nullptr;
    Result<Scene> scene = load_scene(plan_.job, plan_.bed, MeshForm::kLists, grid);
    return scene ? Result<std::vector<Mesh>>(std::move(scene->meshes)) : scene.error();
  };
  sampling_.union_mm3 = union_in(*plan.scene, *tally_, &cancel, plan.images || in_blocks ? again : nullptr);
  count_layers();
}

void JobChecks::count_layers() {
  filled_.resize(plan_.layer_count);
  for (std::uint32_t i = 0; i < plan_.layer_count; ++i) {
    sampling_.thickest_mm = std::max(sampling_.thickest_mm, mm(plan_.layer(i).thickness));
  }
}

void JobChecks::add_left(const Layer& layer, const Runs& image) {
  tally_->add_left(layer, image, mirrors_x(plan_.job.mirror), mirrors_y(plan_.job.mirror));
}

double JobChecks::add_contours(const Layer& layer, const slice::LayerContours& contours) {
  __int128 all = 0;
  for (std::uint32_t b = 0; b + 1 < contours.body.size(); ++b) {
    __int128 doubled = 0;
    for (std::uint32_t c = contours.body[b]; c < contours.body[b + 1]; ++c) doubled += doubled_area(contours.contours[c]);
    if (doubled != 0) tally_->add_area(b, layer, square_mm(doubled));
    all += doubled;
  }
  return square_mm(all);
}

std::string JobChecks::why_nothing() const {
  const Job& job = plan_.job;
  if (plan_.product == Product::kMoves && !plan_.sections->fills()) {
    return "no walls and no filling are requested: give --walls, --fill or both";
  }
  if (kept_) return "check the parts with `lamina info`";
  if (plan_.scene->instances.empty()) return "no pixel of the images is dark enough: give part.threshold, or part.invert";
  if (const Status status = checks::check_anything(*tally_, sampling_); !status) return status.error().message;
  if (job.dose.saturation_percent) return "--saturation leaves no drop: give a higher one";
  if (job.dose.core < 1) return "--core leaves no drop: give a larger fraction, or --shell";
  return "no bead fits into the parts: they are narrower than walls and filling require";
}

/// Layers that something is in, or that may be empty: parts may have a gap in height, and beads and doses thin out what is.
std::vector<std::uint8_t> JobChecks::filled_or_rightly_empty() const {
  std::vector<std::uint8_t> filled = filled_;
  std::vector<Nm> planes;
  for (std::uint32_t i = 0; i < filled.size(); ++i) {
    if (filled[i] == 0) planes.push_back(plane_of(plan_.job, plan_.layer(i), plan_.scene->height));
  }
  if (planes.empty()) return filled;
  const bool thinned = plan_.images && thins(plan_.job);
  std::vector<std::uint8_t> crossed(planes.size(), 0);
  if (!thinned && plan_.images) {
    for (const Solid& solid : plan_.images->solids.all()) solid.rasterizer.mark_crossed(planes, crossed);
  } else if (!thinned) {
    crossed = checks::crossed_planes(plan_.scene->meshes, plan_.scene->instances, planes);
  }
  std::size_t next = 0;
  for (std::uint8_t& layer : filled) {
    if (layer == 0) layer = crossed[next++] == 0 ? 1 : 0;
  }
  return filled;
}

Status JobChecks::end(std::vector<Warning>& warnings) const {
  const Job& job = plan_.job;
  if (job.layers || job.shard) return {};
  const bool nothing = std::ranges::find(filled_, 1) == filled_.end();
  constexpr std::string_view kThings[] = {"pixel", "contour", "bead"};
  if (nothing && !job.allow_empty) {
    return Error{Fault::kInput,
                 fmt::format("not one {} in {} layer{}, so nothing is kept: {}; --allow-empty plans it nevertheless",
                             kThings[static_cast<std::size_t>(plan_.product)], plan_.layer_count,
                             plan_.layer_count == 1 ? "" : "s", why_nothing())};
  }
  if (nothing) warnings.push_back({"empty", "the whole job is empty: " + why_nothing()});
  if (!kept_ && !nothing) {
    if (Status status = checks::check_solids(*tally_, sampling_, warnings); !status) return status;
  }
  checks::check_layers(
      tally_->solids(), filled_or_rightly_empty(), [&](std::uint32_t i) { return plan_.layer(i); }, warnings);
  checks::check_tolerance(tally_->solids(), sampling_, warnings);
  if (plan_.product == Product::kMoves) checks::check_footing(tally_->solids(), sampling_, warnings);
  return {};
}

}  // namespace lamina::pipeline
