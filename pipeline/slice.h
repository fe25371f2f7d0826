// pipeline/slice.h: a job from its parts to a file of contours and filling.
#pragma once

#include <atomic>
#include <cstdint>
#include <string>
#include <vector>

#include "pipeline/job.h"
#include "pipeline/jet.h"  // ProgressCallback
#include "pipeline/scene.h"
#include "stages/data/layer.h"
#include "stages/data/status.h"
#include "stages/data/toolpaths.h"
#include "stages/slice/slice.h"

namespace lamina::pipeline {

/// A job with its parts loaded, ready to give any of its layers: what `lamina slice` and pictures of it share.
class SlicePlan {
 public:
  /// errors  of load_scene, Slicer::build and plan_filling
  static Result<SlicePlan> make(const Job& job, const ProgressCallback& progress);

  /// What a layer in flight occupies.
  struct Work {
    slice::LayerScratch scratch;
    slice::LayerContours contours;
    Toolpaths paths;
    Buffer<std::uint32_t> path_body;
    Buffer<std::uint32_t> rebased;
    slice::LayerReport report;
    Buffer<char> text;
  };
  /// Contours, and filling if the job asks for one. Pure: the same for any thread and order.
  Status layer(std::uint32_t index, Work& work) const;

  const std::vector<Layer>& layers() const { return layers_; }
  const Scene& scene() const { return *scene_; }
  const slice::Slicer& slicer() const { return *slicer_; }
  const std::vector<std::string>& names() const { return names_; }  // of bodies
  const Box& bounds() const { return bounds_; }                      // around all, as sliced
  bool fills() const { return fills_; }
  const Box& box_of_body(std::uint32_t body) const { return box_of_body_[body]; }
  /// What fills a body in a layer.
  const infill::FillParameters& filling(std::uint32_t body, const Layer& layer) const;
  std::uint64_t bytes_bound(std::uint32_t index) const;

  double load_seconds = 0, index_seconds = 0;

 private:
  SlicePlan() = default;
  std::unique_ptr<Scene> scene_;  // stays where it is: the slicer points into it
  std::vector<Layer> layers_;
  std::unique_ptr<slice::Slicer> slicer_;
  std::vector<std::string> names_;
  std::vector<FillPlan> plans_;              // by [[part]]
  std::vector<std::uint32_t> part_of_body_;
  std::vector<Box> box_of_body_;
  Box bounds_;
  bool fills_ = false;
};

struct SliceSummary {
  std::string output;  // the file, or the directory of one file a layer
  std::uint32_t layers_total = 0, layers = 0;
  std::uint64_t triangles = 0, cuts = 0, contours = 0, points = 0, paths = 0, bytes_written = 0;
  std::uint64_t united_layers = 0, gaps_closed = 0, open_chains = 0;
  double volume_mm3 = 0;       // area x thickness
  double bead_mm = 0;          // length of all beads
  double load_seconds = 0, index_seconds = 0, layer_seconds = 0, slice_seconds = 0, encode_seconds = 0;
  std::uint64_t index_bytes = 0, peak_layer_bytes = 0, peak_resident_bytes = 0;
  std::uint32_t most_in_flight = 0;
  std::vector<PartSummary> parts;
  std::vector<std::string> warnings;
};

/// Writes DIR/NAME.svg, .cli or .3mf, or DIR/layers/000000.svg and up, and DIR/manifest.json.
/// errors  of SlicePlan::make; kOutput; kInterrupted: nothing is left behind
Result<SliceSummary> run_slice(const Job& job, const ProgressCallback& progress, const std::atomic<bool>& cancel);

/// Refuses a directory that holds another job, unless job.overwrite. errors  kUsage, kOutput
Status check_slice_output(const Job& job);

std::string slice_summary_text(const Job& job, const SliceSummary& summary);
std::string slice_summary_json(const Job& job, const SliceSummary& summary);

}  // namespace lamina::pipeline
