#include "pipeline/plan/reach.h"

#include <fmt/format.h>

#include "stages/program/reach.h"

namespace lamina::pipeline {

Status check_reach(const Machine& machine, const Scene& scene) {
  for (std::size_t i = 0; i < scene.instances.size(); ++i) {
    const Instance& instance = scene.instances[i];
    const Mesh& mesh = scene.meshes[instance.mesh];
    const auto outside = program::first_outside(machine, mesh, instance.offset);
    if (!outside) continue;
    const std::string& part = scene.parts[scene.part_of_instance[i]].path;
    if (outside->above) {
      return Error{Fault::kUsage, fmt::format("{}: reaches z {:.3f} mm at x {:.3f}, y {:.3f}, above the build height of {}, "
                                              "{:g} mm; turn or scale the part",
                                              part, mm(outside->place.z), mm(outside->place.x), mm(outside->place.y),
                                              machine.name, machine.bed.build_height_mm)};
    }
    return Error{
        Fault::kUsage,
        fmt::format("{}: reaches x {:.3f}, y {:.3f} mm at z {:.3f}, {:.3f} mm outside of the bed of {}; "
                    "move, turn or scale the part",
                    part, mm(outside->place.x), mm(outside->place.y), mm(outside->place.z), outside->beyond_mm, machine.name)};
  }
  for (const PlacedImages& images : scene.images) {
    const double top = mm(images.bottom + std::int64_t{images.thickness} * images.images->layers());
    if (top <= machine.bed.build_height_mm) continue;
    return Error{Fault::kUsage,
                 fmt::format("{}: its images reach z {:.3f} mm, above the build height of {}, {:g} mm; leave some out",
                             scene.parts[images.part].path, top, machine.name, machine.bed.build_height_mm)};
  }
  return {};
}

}  // namespace lamina::pipeline
