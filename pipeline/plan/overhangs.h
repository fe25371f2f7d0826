// pipeline/plan/overhangs.h: what hangs over air in the layers of a job, and in the layers of a table.
#pragma once

#include <cstdint>
#include <span>

#include "pipeline/plan/sections.h"
#include "stages/checks/overhang_tally.h"
#include "stages/data/mesh.h"
#include "stages/data/overhang.h"

namespace lamina::pipeline {

/// The overhangs of any layer of a job. Usable from any thread.
class Overhangs {
 public:
  /// sections  must outlive this object; keeps the contours of `neighbours` layers at a time. angle_deg  0 to 89
  Overhangs(Sections& sections, double angle_deg, std::uint32_t neighbours);

  /// Of a layer against the one below of the same part. The first layer on the bed has none; one above the bed hangs as a
  /// whole. Contours are compared with all their points, and copies of a body that are alike once. errors  of Slicer::layer and
  /// clipping.h
  Result<LayerOverhang> at(std::uint32_t index) const;
  /// The region of it, clean contours but that they may touch. errors  as at()
  Result<Contours> region(std::uint32_t index) const;

 private:
  const Sections& sections_;
  double angle_deg_;
};

/// The overhangs of a table's layers. planes  nm, of the layers, strictly increasing
/// errors  of Slicer::build and Slicer::layer
/// cost    slices every plane, in parallel
Result<checks::OverhangTally> tally_overhangs(std::span<const Mesh> meshes, std::span<const Instance> instances,
                                              FillRule fill_rule, std::span<const Layer> layers, std::span<const Nm> planes,
                                              double angle_deg);

}  // namespace lamina::pipeline
