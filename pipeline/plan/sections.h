// pipeline/plan/sections.h: the contours and fillings of a job's layers.
#pragma once

#include <cstdint>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "pipeline/job/job.h"
#include "pipeline/plan/layer_cache.h"
#include "pipeline/plan/layers.h"
#include "pipeline/plan/scene.h"
#include "stages/data/layer.h"
#include "stages/data/lost_features.h"
#include "stages/data/status.h"
#include "stages/data/toolpaths.h"
#include "stages/infill/fill.h"
#include "stages/infill/parameters.h"
#include "stages/slice/slice.h"

namespace lamina::pipeline {

/// The filling of a part at each height.
struct FillPlan {
  struct FillInterval {
    std::int64_t from, to;  // nm above the part's bottom: layers whose middle is in [from, to)
    infill::FillParameters parameters;
  };
  infill::FillParameters base;
  std::vector<FillInterval> ranges;  // in order, disjoint

  const infill::FillParameters& at(std::int64_t height) const;
  /// For fillings by density: the cross-section of beads, the thickness in which sparse lines have their width, and whether the
  /// printer makes beads of other widths.
  void set_beads(BeadShape shape, Nm nominal_thickness, bool varies_width);
  /// All beads get a width.
  void set_width(Nm width);
  /// Whether any layer has walls or a filling.
  bool fills() const;
};

/// The plan of a part, from the job's section and the part's changes.
/// errors  kUsage, one line that begins with the key
Result<FillPlan> plan_filling(const FillRequest& request, const FillChanges& part_changes);

/// The box of an instance on the bed; empty if its mesh is.
Box box_of(const Scene& scene, const Instance& instance);

/// The contours and fillings of any layer of a scene. Immutable; usable from any thread.
class Sections {
 public:
  /// scene     must outlive this object: the slicer refers to its meshes
  /// fillings  one for each part of the job
  /// errors    of Slicer::build; kUsage: touching parts with separate layers
  static Result<Sections> make(const Job& job, const Scene& scene, LayerSchedule schedule, std::vector<FillPlan> fillings);

  /// Scratch of a layer in flight.
  struct Work {
    std::uint64_t lent = 0;  // bytes of the scratch that its contours were made with, until they are filled
    slice::LayerContours contours;
    slice::LayerContours highest;            // section at the layer's top, if steps must stay on one side
    slice::LayerContours parts;              // of areas in bodies with several parts, merged part by part
    std::vector<Contours> surface;           // of these areas: the region without earlier parts
    std::vector<infill::Outlines> outlines;  // of each area: where the centres of beads lie; none of copies of another
    LostFeatures lost;
    Buffer<std::uint32_t> original;  // of each area: the first one with the same contours, moved
    Toolpaths paths;
    Buffer<std::uint32_t> path_body;  // the paths of body b are [path_body[b], path_body[b + 1])
    Buffer<std::uint32_t> path_area;  // the same of areas
    Buffer<std::uint32_t> rebased, rebased_highest;
    slice::SectionReport report;
    Buffer<char> text;

    std::uint64_t bytes() const;  // capacity of its buffers
  };
  /// Contours, and the filling if the job has one. Pure: independent of thread and order. Patterns are anchored to the parts:
  /// what copies at one height have alike is filled once, and moved.
  Status layer(std::uint32_t index, Work& work) const;
  /// The contours of a layer without a filling, shared with the layers that need them because they are next to it. Pure; those
  /// of the last layers are kept, as many as keep_neighbours() was called with. errors  of Slicer::layer
  struct SharedContours {
    slice::LayerContours contours;
    slice::SectionReport report;
    std::uint64_t bytes() const { return bytes_held(contours.contours.point) + bytes_held(contours.contours.offset); }
  };
  Result<std::shared_ptr<const SharedContours>> shared_contours(std::uint32_t index) const;
  /// Keeps the neighbours of so many layers at a time for skins; 0 to begin with. Before the first layer.
  void keep_neighbours(std::uint32_t layers);
  /// The same with all points, regardless of the tolerance; keep_exact_neighbours() sets how many are kept.
  Result<std::shared_ptr<const SharedContours>> exact_contours(std::uint32_t index) const;
  void keep_exact_neighbours(std::uint32_t layers);
  /// Bytes of both that are kept.
  std::uint64_t shared_bytes() const;
  /// nm: the plane of a layer, or the middle of both.
  double sampled_at(std::uint32_t index) const;
  /// The layer that is printed on layer `index` of the same part, and the one that it is printed on; none at the ends.
  std::optional<std::uint32_t> above(std::uint32_t index) const;
  std::optional<std::uint32_t> below(std::uint32_t index) const;
  /// The two halves of layer(): contours and regions, then their filling. The bound of the filling's memory needs the first.
  Status contours(std::uint32_t index, Work& work) const;
  Status fill(std::uint32_t index, Work& work) const;

  /// The region of one [[part]] in a body: touching instances of the part. Areas are ordered by body, then by part; the
  /// first part owns a shared region.
  struct Area {
    std::uint32_t body, part;
    Box box;                            // of its instances, before any offset
    std::uint32_t shared = UINT32_MAX;  // number among the areas of bodies with several parts
    std::uint32_t alike = 0;            // the first area of such a part: itself, or one that it may be a moved copy of
  };
  const std::vector<Area>& areas() const { return areas_; }
  /// Within the contours of an area, mm2. work  of contours()
  double area_mm2(const Area& area, const Work& work) const;
  /// The height above its bottom that ranges see of an area in a layer: the middle of what the layer holds of it, nm.
  static std::int64_t height_in(const Area& area, const Layer& layer) {
    return std::int64_t{layer.plane_below(area.box.hi.z)} - area.box.lo.z;
  }
  /// The filling of an area in a layer.
  const infill::FillParameters& filling(const Area& area, const Layer& layer) const;

  const std::vector<ScheduledLayer>& layers() const { return schedule_.layers; }
  const slice::Slicer& slicer() const { return *slicer_; }
  const std::vector<FillPlan>& fillings() const { return plans_; }  // by part of the job
  const std::vector<std::string>& names() const { return names_; }  // of bodies
  const std::vector<std::uint32_t>& body_of_instance() const { return body_; }
  const Box& bounds() const { return bounds_; }  // around all, as sliced
  bool fills() const { return fills_; }
  /// Upper bound of the bytes for contours() and their text.
  std::uint64_t bytes_bound(std::uint32_t index) const;
  /// Upper bounds of the text, in bytes: per point, and in addition per stretch of one kind and per path.
  struct TextBytes {
    std::uint64_t point = 0, interval = 0, path = 0;
  };
  /// Upper bound of the additional bytes for fill() and its text. errors  of infill::bound_fill
  Result<std::uint64_t> fill_bytes_bound(std::uint32_t index, Work& work, TextBytes text) const;

 private:
  /// Scratch of slicing, lent to a layer while it is sliced: no more of it than layers that are sliced at once.
  struct Scratches {
    std::mutex mutex;
    std::vector<std::unique_ptr<slice::SectionScratch>> idle;
    std::unique_ptr<slice::SectionScratch> take();
    void give_back(std::unique_ptr<slice::SectionScratch> scratch);
  };

  /// Contours of the last layers, of any thread.
  struct NearbyLayers {
    bool used = false;
    LayerCache<SharedContours> contours;
  };

  Sections()
      : scratches_(std::make_unique<Scratches>()),
        neighbours_(std::make_unique<NearbyLayers>()),
        exact_neighbours_(std::make_unique<NearbyLayers>()) {}
  std::unique_ptr<Scratches> scratches_;
  std::unique_ptr<NearbyLayers> neighbours_, exact_neighbours_;
  const Scene* scene_ = nullptr;
  LayerSchedule schedule_;
  Containment containment_ = Containment::kAcross;
  std::optional<slice::Slicer> slicer_;
  std::vector<slice::Slicer> own_slicers_;    // by part, if each has its own layers
  std::vector<slice::Slicer> exact_slicers_;  // the same or one, without a tolerance; none if there is none anyway
  std::vector<std::string> names_;
  std::vector<std::uint32_t> body_;    // by instance
  std::vector<FillPlan> plans_;        // by [[part]]
  std::vector<FillPlan> first_plans_;  // of first layers on the bed; empty: as the others
  Nm elephant_foot_ = 0;
  std::vector<Area> areas_;
  std::vector<std::uint32_t> body_area_;      // bodies + 1, into areas_
  std::optional<slice::Slicer> part_slicer_;  // of the shared areas, if any has a filling
  Status slice_layer(std::uint32_t index, slice::SectionScratch& scratch, Work& work) const;
  Result<std::shared_ptr<const SharedContours>> share(std::uint32_t index, slice::SectionScratch& scratch,
                                                      bool exact = false) const;
  std::uint32_t skin_reach() const;
  void find_lost(Work& work) const;
  Status keep_covered(std::uint32_t index, const Area& area, Contours& region) const;
  Status divide_skins(std::uint32_t index, const Area& area, infill::Outlines& outlines) const;
  Status make_own_slicers(const Job& job, const std::vector<std::uint32_t>& body);
  std::vector<std::uint32_t> make_areas(const Job& job, const std::vector<Box>& boxes, const std::vector<std::uint32_t>& body);
  Result<slice::SectionReport> section(const slice::Slicer& slicer, const ScheduledLayer& scheduled, Nm tolerance,
                                       slice::SectionScratch& scratch, Work& work, slice::LayerContours& out) const;
  void find_copies(const std::vector<std::uint32_t>& body);
  bool is_moved(const Area& copy, const Area& original, const Work& work) const;
  ContoursView contours_of(const Area& area, Work& work) const;
  Result<infill::Outlines> outlines_of(const Area& area, const Layer& layer, Work& work) const;
  Error failed(const Area& area, const Error& error) const;
  Box bounds_;
  Nm grow_ = 0;              // of an offset outwards
  Nm tolerance_ = 0;         // of layers made of two planes
  Nm of_walls_ = 0;          // of what is made of filled contours
  std::uint32_t reach_ = 0;  // layers in the thickest skin
  bool fills_ = false;
};

}  // namespace lamina::pipeline
