// pipeline/run/slice.h: a job from its parts to a file of contours and filling.
#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "pipeline/flow/progress.h"
#include "pipeline/job/job.h"
#include "pipeline/plan/fill.h"
#include "pipeline/plan/layers.h"
#include "pipeline/plan/scene.h"
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
    slice::LayerContours highest;   // where steps have to stay on one side: the section at the top of the layer
    slice::LayerContours parts;     // of areas of bodies that several parts share, united part by part
    std::vector<Contours> surface;  // of these areas: what no earlier part takes
    std::vector<Contours> region;   // of each area: where centres of filling beads may lie
    Toolpaths paths;
    Buffer<std::uint32_t> path_body;  // the paths of body b are [path_body[b], path_body[b + 1])
    Buffer<std::uint32_t> path_area;  // the same of areas
    Buffer<std::uint32_t> rebased, rebased_highest;
    slice::LayerReport report;
    Buffer<char> text;

    std::uint64_t bytes() const;  // that its buffers hold on to
  };
  /// Contours, and filling if the job asks for one. Pure: the same for any thread and order.
  Status layer(std::uint32_t index, Work& work) const;
  /// Its two halves: contours and regions, then what fills these. In between it is known what the filling may need.
  Status contours(std::uint32_t index, Work& work) const;
  Status fill(std::uint32_t index, Work& work) const;

  /// What one [[part]] fills of a body, on its own: instances of the part that touch. Areas are in the order of bodies,
  /// then of parts in the job; where parts share room it belongs to the first one.
  struct Area {
    std::uint32_t body, part;
    Box box;                            // of its instances, before any offset
    std::uint32_t shared = UINT32_MAX;  // number among the areas of bodies with several parts
  };
  const std::vector<Area>& areas() const { return areas_; }
  /// What fills an area in a layer.
  const infill::FillParameters& filling(const Area& area, const Layer& layer) const;

  const std::vector<ScheduledLayer>& layers() const { return schedule_.layers; }
  const Scene& scene() const { return *scene_; }
  const slice::Slicer& slicer() const { return *slicer_; }
  const std::vector<std::string>& names() const { return names_; }  // of bodies
  const Box& bounds() const { return bounds_; }                     // around all, as sliced
  bool fills() const { return fills_; }
  /// Bytes that contours() may need at most, and text of them.
  std::uint64_t bytes_bound(std::uint32_t index) const;
  /// Bytes of text that a point of a path takes at most, and beside its points a stretch of one kind and a path.
  struct TextBytes {
    std::uint64_t point = 0, stretch = 0, path = 0;
  };
  /// Bytes that fill() and its text may need beside those. errors  of infill::bound_fill
  Result<std::uint64_t> fill_bytes_bound(std::uint32_t index, Work& work, TextBytes text) const;

  double load_seconds = 0, index_seconds = 0;

 private:
  SlicePlan() = default;
  std::unique_ptr<Scene> scene_;  // stays where it is: the slicer points into it
  LayerSchedule schedule_;
  Containment containment_ = Containment::kAcross;
  std::unique_ptr<slice::Slicer> slicer_;
  std::vector<slice::Slicer> own_slicers_;  // by part, where each has layers of its own
  std::vector<std::string> names_;
  std::vector<FillPlan> plans_;  // by [[part]]
  std::vector<Area> areas_;
  std::vector<std::uint32_t> body_area_;      // bodies + 1, into areas_
  std::optional<slice::Slicer> part_slicer_;  // of the shared areas, if there are any to be filled
  Status make_own_slicers(const Job& job, const std::vector<std::uint32_t>& body);
  std::vector<std::uint32_t> make_areas(const Job& job, const std::vector<Box>& boxes, const std::vector<std::uint32_t>& body);
  Result<slice::LayerReport> section(const slice::Slicer& slicer, const ScheduledLayer& scheduled, Work& work,
                                     slice::LayerContours& out) const;
  ContoursView contours_of(const Area& area, Work& work) const;
  Error failed(const Area& area, const Error& error) const;
  Box bounds_;
  Nm grow_ = 0;  // of an offset outwards
  bool fills_ = false;
};

struct SliceSummary {
  std::string output;  // the file, or the directory of one file a layer
  std::uint32_t layers_total = 0, layers = 0;
  std::uint64_t triangles = 0, cuts = 0, contours = 0, points = 0, paths = 0, bytes_written = 0;
  std::uint64_t united_layers = 0, gaps_closed = 0, open_chains = 0;
  double largest_gap_mm = 0;         // of those closed
  std::uint64_t emptied_layers = 0;  // that were solid before the offset
  double volume_mm3 = 0;             // area x thickness
  double bead_mm = 0;                // length of all beads
  double load_seconds = 0, index_seconds = 0, layer_seconds = 0, slice_seconds = 0, encode_seconds = 0;
  std::uint64_t index_bytes = 0, peak_layer_bytes = 0, peak_resident_bytes = 0;
  std::uint32_t most_in_flight = 0;
  std::vector<PartSummary> parts;
  std::vector<std::string> warnings;
};

/// Writes DIR/NAME.svg, .cli or .3mf, or DIR/layers/000000.svg and up, and DIR/manifest.json. All of it appears when the
/// last layer is done: a job that fails leaves what was there before.
/// errors  of SlicePlan::make; kOutput; kInterrupted: nothing is left behind
Result<SliceSummary> run_slice(const Job& job, const ProgressCallback& progress, const std::atomic<bool>& cancel);

std::string slice_summary_text(const Job& job, const SliceSummary& summary);
std::string slice_summary_json(const Job& job, const SliceSummary& summary);

}  // namespace lamina::pipeline
