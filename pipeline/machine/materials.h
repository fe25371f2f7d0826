// pipeline/machine/materials.h: the powders of a job: their parts, their vats, and the vats that feed a layer.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "pipeline/job/job.h"
#include "stages/data/machine.h"
#include "stages/data/status.h"
#include "stages/data/units.h"

namespace lamina::pipeline {

/// The material of a part at each height.
struct PartMaterial {
  struct MaterialInterval {
    std::int64_t from, to;  // nm above the bed, [from, to)
    std::uint32_t material;
    bool operator==(const MaterialInterval&) const = default;
  };
  std::uint32_t elsewhere = 0;  // number of a material
  std::vector<MaterialInterval> ranges;
  std::uint32_t at(Nm plane) const;
  bool operator==(const PartMaterial&) const = default;
};

struct Materials {
  std::vector<JobMaterial> used{{}};  // at least one; in the order of vats, or of parts without a machine
  std::vector<PartMaterial> part;     // one for each part of the job
  bool several() const { return used.size() > 1; }
};

/// The materials of a job. machine  null without one. Either all parts or none have a material. Materials must match the
/// vats (powder.materials); unnamed vats receive them in the order of the parts.
/// errors  kUsage: only some parts have a material, a name without a vat, two that differ in case alone, more than vats
Result<Materials> materials_of(const Job& job, const Machine* machine);

/// The vats that feed a layer with the given pixels of each material: for one material its vat; for several the machine's
/// rule decides, the first vat on a tie; for an empty layer the vat of the job's first material.
/// errors  kUsage by the rule `refuse`; the text continues "layer 12: "
Result<std::vector<std::uint32_t>> vats_of_layer(const Machine& machine, const Materials& materials,
                                                 std::span<const std::uint64_t> pixels);

/// The pixels of a material that lie in another powder: all of them if its vat does not feed the layer, else 0.
std::uint64_t unfed_pixels(const JobMaterial& material, std::span<const std::uint32_t> feeds, std::uint64_t pixels);

}  // namespace lamina::pipeline
