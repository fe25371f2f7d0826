// pipeline/plan/sections.h: the contours of a job's layers, and what fills them.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "pipeline/job/job.h"
#include "pipeline/plan/fill.h"
#include "pipeline/plan/layers.h"
#include "pipeline/plan/scene.h"
#include "stages/data/layer.h"
#include "stages/data/status.h"
#include "stages/data/toolpaths.h"
#include "stages/slice/slice.h"

namespace lamina::pipeline {

/// The contours of any layer of a scene, and what fills them. Immutable; any thread may ask.
class Sections {
 public:
  /// scene     has to outlive it: the slicer refers to its meshes
  /// fillings  one for each part of the job
  /// errors    of Slicer::build; kUsage: parts with layers of their own that touch
  static Result<Sections> make(const Job& job, const Scene& scene, LayerSchedule schedule, std::vector<FillPlan> fillings);

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

 private:
  Sections() = default;
  const Scene* scene_ = nullptr;
  LayerSchedule schedule_;
  Containment containment_ = Containment::kAcross;
  std::optional<slice::Slicer> slicer_;
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

}  // namespace lamina::pipeline
