#include "pipeline/check/model_layers.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <optional>
#include <utility>
#include <vector>

#include "pipeline/job/job.h"
#include "pipeline/machine/profiles.h"
#include "pipeline/plan/scene.h"
#include "pipeline/plan/sections.h"
#include "stages/formats/gcode/read_gcode.h"
#include "stages/formats/gcode/replay/layer_track.h"

namespace lamina::pipeline {
namespace {

using formats::GcodeFile;
using formats::gcode::BeadRole;

/// Layers of a file that have beads of parts: one for each height.
struct PrintedLayer {
  std::uint32_t first = 0, last = 0;  // [first, last) of the file
  std::int64_t bottom = 0, top = 0;   // nm
};

/// The surroundings of outer walls, as cells of a layer.
class WallCells {
 public:
  static constexpr double kCellMm = 0.25, kStepMm = 0.2;

  explicit WallCells(const Box& box)
      : low_{mm(box.lo.x) - 2, mm(box.lo.y) - 2},
        columns_(static_cast<std::size_t>(mm(box.width()) / kCellMm + 4 / kCellMm) + 1),
        rows_(static_cast<std::size_t>(mm(box.depth()) / kCellMm + 4 / kCellMm) + 1) {}
  void clear() { set_.assign(columns_ * rows_, false); }
  void wall(Point2 from, Point2 to) {
    each_step(from, to, [&](double x, double y) { mark(x, y); });
  }
  /// The length of a contour, and how much of it is near walls; mm.
  std::pair<double, double> near(std::span<const Point2> contour, const std::array<double, 2>& moved) const {
    double all = 0, found = 0;
    for (std::size_t i = 0; i < contour.size(); ++i) {
      each_step(contour[i], contour[i + 1 < contour.size() ? i + 1 : 0], [&](double x, double y) {
        all += 1;
        const std::optional<std::size_t> cell = cell_of(x + moved[0], y + moved[1]);
        found += cell && set_[*cell] ? 1 : 0;
      });
    }
    return {all * kStepMm, found * kStepMm};
  }

 private:
  template <class Visit>
  static void each_step(Point2 from, Point2 to, Visit visit) {
    const double dx = mm(std::int64_t{to.x} - from.x), dy = mm(std::int64_t{to.y} - from.y), length = std::hypot(dx, dy);
    const auto steps = static_cast<std::uint32_t>(length / kStepMm) + 1;
    for (std::uint32_t i = 0; i < steps; ++i) visit(mm(from.x) + dx * i / steps, mm(from.y) + dy * i / steps);
  }
  std::optional<std::size_t> cell_of(double x, double y) const {
    const double column = (x - low_[0]) / kCellMm, row = (y - low_[1]) / kCellMm;
    if (!(column >= 0 && row >= 0 && column < static_cast<double>(columns_) && row < static_cast<double>(rows_)))
      return std::nullopt;
    return static_cast<std::size_t>(row) * columns_ + static_cast<std::size_t>(column);
  }
  void mark(double x, double y) {
    constexpr int kReach = static_cast<int>(kNearMm / kCellMm);
    for (int r = -kReach; r <= kReach; ++r) {
      for (int c = -kReach; c <= kReach; ++c) {
        if (const auto cell = cell_of(x + c * kCellMm, y + r * kCellMm)) set_[*cell] = true;
      }
    }
  }

  std::array<double, 2> low_;
  std::size_t columns_, rows_;
  std::vector<bool> set_;
};

class LayerComparison {
 public:
  LayerComparison(const GcodeFile& file, ModelComparison& result, Faults& faults)
      : file_(file), result_(result), faults_(faults) {
    for (const std::string& type : file.types()) roles_.push_back(formats::gcode::role_of(type));
    states_walls_ = std::ranges::find(roles_, BeadRole::kOuter) != roles_.end();
  }
  /// Finds the layers and the box of the walls. errors  of GcodeFile::layer
  Status survey();
  /// errors  of the slicer
  Status compare(const Scene& scene, const Job& job);

 private:
  bool of_part(const formats::GcodeBead& bead) const { return roles_[bead.type] != BeadRole::kSupport; }
  bool of_wall(const formats::GcodeBead& bead) const {
    return states_walls_ ? roles_[bead.type] == BeadRole::kOuter : of_part(bead);
  }
  LayerSchedule schedule() const;
  struct SectionMeasure {
    double area_mm2 = 0, outline = -1;  // the share near walls; below 0: no contour
  };
  /// The volume of a layer's beads, mm3; its walls go to the cells. errors  of GcodeFile::layer
  Result<double> load_beads(const PrintedLayer& layer, WallCells& cells) const;
  SectionMeasure measure(const Contours& contours, const WallCells& cells) const;
  void add_layer(const PrintedLayer& layer, double volume, const SectionMeasure& middle, double outline);
  void report_outlines();

  const GcodeFile& file_;
  ModelComparison& result_;
  Faults& faults_;
  std::vector<BeadRole> roles_;
  bool states_walls_ = false;
  std::vector<PrintedLayer> layers_;
  std::int64_t lift_ = 0;         // nm: the model's bottom, on a raft
  std::vector<double> outlines_;  // shares, of layers_; below 0: no contour
  Box walls_;                     // of the outer edges of walls
};

Status LayerComparison::survey() {
  for (std::uint32_t i = 0; i < file_.count(); ++i) {
    const auto layer = file_.layer(i);
    if (!layer) return layer.error();
    bool part = false;
    for (const formats::GcodeBead& bead : layer->beads) {
      part = part || of_part(bead);
      if (!of_wall(bead)) continue;
      for (const Point2 end : {bead.from, bead.to}) {
        const Nm half = bead.width / 2, z = static_cast<Nm>(layer->z);
        walls_.add(Point3{end.x - half, end.y - half, z});
        walls_.add(Point3{end.x + half, end.y + half, z});
      }
    }
    if (!part) continue;
    if (!layers_.empty() && layer->z == layers_.back().top) {
      layers_.back().last = i + 1;
      continue;
    }
    const std::int64_t below = layers_.empty() ? 0 : layers_.back().top;
    if (layer->z < below) {
      result_.reason = fmt::format("layer {} is below the one before; parts one after another are not compared", i);
      return {};
    }
    layers_.push_back({i, i + 1, below, layer->z});
  }
  if (walls_.empty()) result_.reason = "no bead of a part";
  // Layers of supports alone are a raft; the gap above it is not stated.
  if (layers_.size() > 1 && layers_[0].first > 0) {
    layers_[0].bottom = 2 * layers_[0].top - layers_[1].top;
    lift_ = layers_[0].bottom;
  }
  return {};
}

/// Near the bottom, in the middle and near the top of each layer: at a horizontal face slicers differ by up to a layer.
LayerSchedule LayerComparison::schedule() const {
  LayerSchedule schedule;
  for (const PrintedLayer& printed : layers_) {
    for (const double share : {0.02, 0.5, 0.98}) {
      const auto height = share * static_cast<double>(printed.top - printed.bottom);
      const auto index = static_cast<std::uint32_t>(schedule.layers.size());
      const Layer layer{index, static_cast<Nm>(printed.bottom - lift_ + static_cast<std::int64_t>(height)), 1};
      schedule.layers.push_back({layer, kEveryPart, index, index, index});
      schedule.planes.push_back(layer.plane());
    }
  }
  return schedule;
}

Result<double> LayerComparison::load_beads(const PrintedLayer& layer, WallCells& cells) const {
  cells.clear();
  double volume = 0;
  for (std::uint32_t i = layer.first; i < layer.last; ++i) {
    const auto beads = file_.layer(i, true);
    if (!beads) return beads.error();
    for (std::size_t b = 0; b < beads->beads.size(); ++b) {
      const formats::GcodeBead& bead = beads->beads[b];
      if (of_part(bead)) volume += beads->feeds[b].volume_mm3;
      if (of_wall(bead)) cells.wall(bead.from, bead.to);
    }
  }
  return volume;
}

LayerComparison::SectionMeasure LayerComparison::measure(const Contours& contours, const WallCells& cells) const {
  SectionMeasure measure;
  double all = 0, found = 0;
  for (std::uint32_t c = 0; c < contours.size(); ++c) {
    measure.area_mm2 += static_cast<double>(doubled_area(contours[c])) / 2e12;
    const auto [length, near] = cells.near(contours[c], result_.moved_mm);
    all += length;
    found += near;
  }
  if (all > 0) measure.outline = found / all;
  return measure;
}

/// middle  the section in the middle; outline  the best one of all sections
void LayerComparison::add_layer(const PrintedLayer& layer, double volume, const SectionMeasure& middle, double outline) {
  outlines_.push_back(outline);
  const double solid = middle.area_mm2 * mm(layer.top - layer.bottom);
  if (!(solid > 0)) return;
  const double fill = volume / solid;
  const bool first = result_.layers++ == 0;
  if (first || fill < result_.min_fill.value) result_.min_fill = {fill, layer.first};
  if (first || fill > result_.max_fill.value) result_.max_fill = {fill, layer.first};
  if (first || outline < result_.min_outline.value) result_.min_outline = {outline, layer.first};
  result_.model_mm3 += solid;
  result_.bead_mm3 += volume;
}

/// A missing wall is a sudden loss; details thinner than a bead are missing in many layers.
void LayerComparison::report_outlines() {
  constexpr double kLoss = 0.85;    // of the share of both neighbours
  constexpr double kPrinted = 0.5;  // their share, at least
  for (std::size_t i = 1; i + 1 < outlines_.size(); ++i) {
    const double around = std::min(outlines_[i - 1], outlines_[i + 1]);
    if (outlines_[i] < 0 || around < kPrinted || outlines_[i] >= kLoss * around) continue;
    faults_.add(
        fmt::format("layer {}: {:.0f} % of the model's outline have an outer wall, {:.0f} % or more in the layers around it",
                    layers_[i].first, 100 * outlines_[i], 100 * around));
  }
}

Status LayerComparison::compare(const Scene& scene, const Job& job) {
  auto sections = Sections::make(job, scene, schedule(), std::vector<FillPlan>(job.parts.size()));
  if (!sections) return sections.error();
  const Box& model = sections->bounds();
  const double wide[] = {mm(walls_.width()) - mm(model.width()), mm(walls_.depth()) - mm(model.depth())};
  if (std::abs(wide[0]) > 0.5 + 0.02 * mm(model.width()) || std::abs(wide[1]) > 0.5 + 0.02 * mm(model.depth())) {
    result_.reason = fmt::format("the model is {:.2f} x {:.2f} mm large and the outer walls {:.2f} x {:.2f} mm",
                                 mm(model.width()), mm(model.depth()), mm(walls_.width()), mm(walls_.depth()));
    return {};
  }
  result_.moved_mm = {(mm(walls_.lo.x) + mm(walls_.hi.x) - mm(model.lo.x) - mm(model.hi.x)) / 2,
                      (mm(walls_.lo.y) + mm(walls_.hi.y) - mm(model.lo.y) - mm(model.hi.y)) / 2};
  WallCells cells(walls_);
  Sections::Work work;
  for (std::uint32_t i = 0; i < layers_.size(); ++i) {
    const auto volume = load_beads(layers_[i], cells);
    if (!volume) return volume.error();
    SectionMeasure middle;
    double outline = -1;
    for (std::uint32_t k = 0; k < 3; ++k) {
      if (Status status = sections->contours(3 * i + k, work); !status) return status;
      const SectionMeasure one = measure(work.contours.contours, cells);
      if (k == 1) middle = one;
      outline = std::max(outline, one.outline);
    }
    add_layer(layers_[i], *volume, middle, outline);
  }
  report_outlines();
  return {};
}

}  // namespace

Result<ModelComparison> compare_with_model(const std::string& path, const std::string& model, double filament_mm,
                                           Faults& faults) {
  ModelComparison result;
  formats::GcodeOptions options;
  options.filament_mm = filament_mm;
  const auto file = GcodeFile::open(path, options);
  if (!file) return file.error();
  Job job;
  job.parts = {{.path = model}};
  const auto scene = load_scene(job, kLargestBed);
  if (!scene) return scene.error();
  LayerComparison comparison(*file, result, faults);
  if (Status status = comparison.survey(); !status) return status.error();
  if (!result.reason.empty()) return result;
  if (Status status = comparison.compare(*scene, job); !status) return status.error();
  return result;
}

}  // namespace lamina::pipeline
