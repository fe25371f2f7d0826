// pipeline/plan/jet_plan.h: a binder-jet job with its parts loaded, ready to give any of its layers, without any file.
//
// What programs that embed lamina use where run_jet() would write a directory. The images are those of its files.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "pipeline/job/job.h"
#include "pipeline/plan/scene.h"
#include "stages/data/grid.h"
#include "stages/data/runs.h"
#include "stages/data/status.h"
#include "stages/heights/table.h"

namespace lamina::pipeline {

/// A layer's image, and what of it is of each material.
struct PlannedImages {
  Runs whole;
  std::vector<Runs> material;  // in the order of materials(), no pixel set in two; empty where the whole is of one
};

/// Immutable; layers may be asked for in any order and from any number of threads.
class JetPlan {
 public:
  /// Loads and places the parts, decides the layers and builds the index. job.output is not looked at.
  /// errors  of check_job, resolve_machine, load_scene and layer_table
  static Result<JetPlan> make(const Job& job);
  JetPlan(JetPlan&&) noexcept;
  JetPlan& operator=(JetPlan&&) noexcept;
  ~JetPlan();

  const Job& job() const;  // with its machine resolved
  const PixelGrid& grid() const;
  const heights::LayerTable& layers() const;
  const std::vector<PartSummary>& parts() const;

  /// Names of the powders, as file names have them; empty if no part names one.
  std::vector<std::string> materials() const;

  /// The image of layers()[index], of all materials together. errors  kVerification: engine is kBoth and they differ
  /// memory  the runs; scratch is kept for the next layer, one set for each layer that is made at the same time
  Result<Runs> layer(std::uint32_t index) const;
  /// The same with those of the materials.
  Result<PlannedImages> images(std::uint32_t index) const;

 private:
  JetPlan();
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace lamina::pipeline
