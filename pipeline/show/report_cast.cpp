#include "pipeline/show/report_cast.h"

#include <fmt/format.h>

#include <filesystem>

#include "pipeline/plan/plan.h"

namespace lamina::pipeline {
namespace {

namespace fs = std::filesystem;

/// The file of that name in the first folder that contains it; empty if none does.
std::string find_part(const std::string& name, const std::vector<std::string>& folders) {
  std::error_code ignored;
  for (const fs::path folder : folders) {
    if (fs::is_regular_file(folder, ignored) && folder.filename() == name) return folder.string();
    if (fs::is_regular_file(folder / name, ignored)) return (folder / name).string();
  }
  return {};
}

}  // namespace

Result<Scene> find_parts(const ManifestHead& head, const Job& recorded, const std::vector<std::string>& folders) {
  Job job = recorded;
  for (const PartSummary& part : head.parts) {
    if (part.triangles == 0)
      return Error{Fault::kInput, fmt::format("{}: is images, which have no sides to look at", part.path)};
  }
  for (PartRequest& part : job.parts) {
    const std::string name = fs::path(part.path).filename().string();
    part.path = find_part(name, folders);
    if (part.path.empty()) return Error{Fault::kInput, fmt::format("{}: not found; name its folder with --parts", name)};
  }
  // The manifest decides the bed of images, because the machine's profile may have changed.
  Bed bed{{mm(head.grid.x.length), mm(head.grid.y.length)}};
  if (head.product != Product::kImages) {
    const auto resolved = resolve(job, head.product);
    if (!resolved) return resolved.error();
    bed = resolved->bed;
  }
  Result<Scene> scene = load_scene(job, bed);
  if (!scene) return scene;
  for (std::size_t i = 0; i < scene->parts.size(); ++i) {
    if (i < head.parts.size() && scene->parts[i].fingerprint == head.parts[i].fingerprint) continue;
    return Error{Fault::kInput,
                 fmt::format("{}: is not the part that was planned, its triangles are others", job.parts[i].path)};
  }
  return scene;
}

Result<std::array<view::Picture, 3>> cast_parts(const Scene& scene, std::uint32_t maximum) {
  const Result<view::Caster> caster = view::Caster::build(scene.meshes, scene.instances);
  if (!caster) return caster.error();
  return std::array{caster->render(view::ViewSide::kTop, maximum), caster->render(view::ViewSide::kFront, maximum),
                    caster->render(view::ViewSide::kRight, maximum)};
}

}  // namespace lamina::pipeline
