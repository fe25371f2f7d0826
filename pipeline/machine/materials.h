// pipeline/machine/materials.h: the powders of a job: which part is of which, in which vat it is, and which vat feeds a layer.
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

/// What a part is of, at each height.
struct PartMaterial {
  struct Range {
    std::int64_t from, to;  // nm above the bed, [from, to)
    std::uint32_t material;
    bool operator==(const Range&) const = default;
  };
  std::uint32_t elsewhere = 0;  // number of a material
  std::vector<Range> ranges;
  std::uint32_t at(Nm plane) const;
  bool operator==(const PartMaterial&) const = default;
};

struct Materials {
  std::vector<JobMaterial> used{{}};  // at least one; by vat, or without a machine in the order of the parts
  std::vector<PartMaterial> part;     // one for each part of the job
  bool several() const { return used.size() > 1; }
};

/// The materials of a job. machine  null: it has none. No part, or every part names its own. They have to be
/// those of the vats (powder.materials); vats without names take them in the order in which parts name them.
/// errors  kUsage: a part without a material among others, a name that no vat has, more materials than vats
Result<Materials> materials_of(const Job& job, const Machine* machine);

/// The vats that feed a layer with so many pixels of each material: that of its only material; for a layer of several by
/// the machine's rule, the first one on a tie; for an empty layer that of the job's first material.
/// errors  kUsage by the rule `refuse`; what follows "layer 12"
Result<std::vector<std::uint32_t>> vats_of_layer(const Machine& machine, const Materials& materials,
                                                 std::span<const std::uint64_t> pixels);

}  // namespace lamina::pipeline
