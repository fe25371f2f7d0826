#include "pipeline/run/layer_workshop.h"

#include <fmt/core.h>

#include <algorithm>
#include <chrono>

#include "stages/data/hash.h"
#include "stages/raster/combine.h"
#include "stages/raster/mirror.h"
#include "stages/write/file.h"

namespace lamina::pipeline {
namespace {

using Clock = std::chrono::steady_clock;

/// Adds the life of an object to a sum that many threads share.
class StageTimer {
 public:
  explicit StageTimer(std::atomic<std::int64_t>& sum) : sum_(sum) {}
  ~StageTimer() { sum_ += std::chrono::duration_cast<std::chrono::nanoseconds>(Clock::now() - start_).count(); }

 private:
  std::atomic<std::int64_t>& sum_;
  Clock::time_point start_ = Clock::now();
};

/// Where two engines disagree first.
Error disagreement(const Layer& layer, const PixelGrid& grid, const RunsView& rays, const RunsView& contours) {
  std::uint32_t row = 0;
  while (row + 1 < rays.rows() && std::ranges::equal(rays.row(row), contours.row(row))) ++row;
  const auto a = rays.row(row), b = contours.row(row);
  const auto place = static_cast<std::size_t>(std::ranges::mismatch(a, b).in1 - a.begin());
  const std::uint32_t column = std::min(place < a.size() ? a[place] : rays.columns, place < b.size() ? b[place] : rays.columns);
  return {Fault::kVerification,
          fmt::format("layer {}: engines disagree first in image row {}, column {} (x {:.4f} mm, y {:.4f} mm, z {:.4f} "
                      "mm); this is a fault of lamina, please report it with the part",
                      layer.index, row, column, mm(grid.x.centre(column)), mm(grid.y.centre(grid.rows() - 1 - row)),
                      mm(layer.plane()))};
}

/// Sums of a layer's solids; the places are those of the first that has any.
void add(const raster::LayerReport& solid, raster::LayerReport& all) {
  if (all.capped_rows == 0) {
    all.first_capped_row = solid.first_capped_row;
    all.first_capped_instance = solid.first_capped_instance;
  }
  if (all.open_rows == 0) all.first_open_row = solid.first_open_row;
  all.capped_rows += solid.capped_rows;
  all.open_rows += solid.open_rows;
}

}  // namespace

LayerWorkshop::LayerWorkshop(const Job& job, const Solids& solids, const Materials& materials, const ManifestHead& head,
                             const write::ImageFormat& format, const PrintProgram* program, const PorousPlan* porous,
                             std::uint64_t covered_pixels)
    : job_(job),
      solids_(solids),
      materials_(materials),
      head_(head),
      format_(format),
      program_(program),
      porous_(porous),
      dose_(job, head.grid),
      covered_pixels_(covered_pixels) {}

Status LayerWorkshop::raster(LayerWork& work, LayerOutcome& outcome) {
  const StageTimer timer(sums.raster);
  const Layer& layer = outcome.record.layer;
  const bool several = materials_.several();
  if (several) {
    work.materials.start(materials_.used.size(), head_.grid.columns(), head_.grid.rows());
    work.runs.columns = head_.grid.columns();
    work.runs.row_offset.assign(std::size_t{head_.grid.rows()} + 1, 0);
    work.runs.change.clear();
  }
  for (const Solid& solid : solids_.all()) {
    Runs& image = several ? work.section : work.runs;
    if (Status status = section_of(solid, work, image, outcome); !status) return status;
    if (several) work.materials.lay(solid.material.at(layer.plane()), image, work.runs);
  }
  if (porous_ != nullptr) {
    outcome.solid_pixels = set_pixels(work.runs);
    if (Status status = porous_->apply(layer, work.runs, work.second, work.porous); !status) return status;
    outcome.bead_pixels = set_pixels(work.runs);
  }
  if (job_.mirror != Mirror::kNone) {
    mirror(work.runs, work.second);
    for (Runs& image : work.materials.image) mirror(image, work.second);
  }
  if (dose_.any()) dose_.apply(layer.index, work.runs, work.second, work.third);
  if (several && (porous_ != nullptr || dose_.any())) work.materials.keep(work.runs);
  outcome.record.set_pixels = set_pixels(work.runs);
  for (const Runs& image : work.materials.image) outcome.record.images.push_back({0, set_pixels(image), {}});
  return {};
}

/// The section of one solid; what was noticed goes to the outcome.
Status LayerWorkshop::section_of(const Solid& solid, LayerWork& work, Runs& image, LayerOutcome& outcome) {
  const Layer& layer = outcome.record.layer;
  const bool rays = job_.engine != Engine::kContours;
  raster::LayerReport report = section(solid, rays ? raster::Engine::kRays : raster::Engine::kContours, layer, work, image);
  if (job_.engine == Engine::kBoth) {
    section(solid, raster::Engine::kContours, layer, work, work.second);
    if (image.row_offset != work.second.row_offset || image.change != work.second.change) {
      return disagreement(layer, head_.grid, image, work.second);
    }
  }
  if (!solid.instance.empty() && report.capped_rows > 0) {
    report.first_capped_instance = solid.instance[report.first_capped_instance];
  }
  outcome.record.capped_rows += report.capped_rows;
  add(report, outcome.report);
  return {};
}

void LayerWorkshop::mirror(Runs& image, Runs& scratch) const {
  raster::mirror(image, job_.mirror != Mirror::kY, job_.mirror != Mirror::kX, scratch);
  std::swap(image, scratch);
}

/// The image of a layer: its middle plane, or what its lowest and highest sections have in common or together.
raster::LayerReport LayerWorkshop::section(const Solid& solid, raster::Engine engine, const Layer& layer, LayerWork& work,
                                           Runs& image) {
  const raster::Rasterizer& rasterizer = solid.rasterizer;
  if (job_.heights.containment == Containment::kAcross) {
    return rasterizer.layer(engine, layer.plane(), work.scratch, image);
  }
  const raster::LayerReport low = rasterizer.layer(engine, layer.lowest_plane(), work.scratch, work.lowest);
  const raster::LayerReport high = rasterizer.layer(engine, layer.highest_plane(), work.scratch, work.highest);
  raster::combine(
      work.lowest, work.highest,
      job_.heights.containment == Containment::kInside ? raster::SetOperation::kIntersection : raster::SetOperation::kUnion,
      image);
  return low.open_rows + low.capped_rows >= high.open_rows + high.capped_rows ? low : high;
}

Status LayerWorkshop::encode(LayerWork& work, LayerOutcome& outcome) {
  const StageTimer timer(sums.encode);
  if (!work.encoder) work.encoder = format_.make_encoder();
  LayerRecord& record = outcome.record;
  if (!materials_.several()) {
    if (auto status = encode_image(work, record, work.runs, work.file); !status) return status;
    record.bytes = work.file.size();
    record.hash = hash_bytes(work.file);
    return {};
  }
  work.files.resize(record.images.size());
  for (std::size_t m = 0; m < work.files.size(); ++m) {
    if (auto status = encode_image(work, record, work.materials.image[m], work.files[m]); !status) return status;
    record.images[m].bytes = work.files[m].size();
    record.images[m].hash = hash_bytes(work.files[m]);
    record.bytes += work.files[m].size();
  }
  return {};
}

Status LayerWorkshop::encode_image(LayerWork& work, const LayerRecord& record, const RunsView& image,
                                   write::Bytes& file) const {
  file.clear();
  const Status status = work.encoder->encode(image, head_.grid.x.dpi(), head_.grid.y.dpi(), file);
  if (status) return {};
  return Error{status.error().fault, fmt::format("layer {}: {}", record.layer.index, status.error().message)};
}

Status LayerWorkshop::store(LayerWork& work, LayerOutcome& outcome) {
  const StageTimer timer(sums.write);
  const LayerRecord& record = outcome.record;
  const auto images = layer_images(head_, record);
  for (std::size_t m = 0; m < images.size() && !images[m].name.empty(); ++m) {
    const write::Bytes& file = materials_.several() ? work.files[m] : work.file;
    if (auto status = write::write_file(job_.output + "/" + images[m].name, file, {.lock = false}); !status) return status;
  }
  if (program_ == nullptr) return {};
  std::vector<std::uint64_t> pixels;
  for (const LayerImageFile& image : images) pixels.push_back(image.record.set_pixels);
  const auto feeds = vats_of_layer(job_.machine.resolved->machine, materials_, pixels);
  if (!feeds) {
    return Error{feeds.error().fault, fmt::format("layer {} (z {:.3f} mm): {}", record.layer.index, mm(record.layer.plane()),
                                                  feeds.error().message)};
  }
  return program_->write_layer(record.layer, work.runs, *feeds, work.program, outcome.record.program);
}

std::uint64_t LayerWorkshop::bytes_of_layer(const Layer& layer) const {
  if (job_.heights.containment != Containment::kAcross) {
    // Both sections, and an image that may have the crossings of both; twice with another engine or a mirror.
    return 2 * (bytes_of_section(layer.lowest_plane(), 0) + bytes_of_section(layer.highest_plane(), 0));
  }
  if (porous_ == nullptr) return bytes_of_section(layer.plane(), 0);
  return bytes_of_section(layer.plane(), 2 * porous_->spans_expected(layer.index)) + porous_->bytes_expected(layer.index);
}

std::uint64_t LayerWorkshop::bytes_of_section(Nm plane, std::uint64_t bead_changes) const {
  const std::uint64_t rows = head_.grid.rows();
  const std::uint64_t crossings = dose_.changes_bound(solids_.crossings_bound(plane), covered_pixels_) + bead_changes;
  const bool second = porous_ != nullptr || job_.engine == Engine::kBoth || job_.mirror != Mirror::kNone || dose_.any();
  const std::uint64_t second_image = (second ? 8 * crossings + 4 * rows : 0) * (dose_.any() ? 3 : 1);
  // The image of each material, of all, of one solid, and another one in the making.
  const std::uint64_t materials = materials_.several() ? materials_.used.size() : 0;
  const std::uint64_t material_images = materials == 0 ? 0 : (materials + 3) * 2 * (4 * crossings + 4 * rows);
  const std::uint64_t file = std::max<std::uint64_t>(1, materials) * format_.most_bytes(head_.grid.columns(), rows, crossings);
  const std::uint64_t program = program_ == nullptr ? 0 : program_->bytes_bound(crossings);
  return solids_.layer_bytes_bound(plane) + second_image + material_images + file + program;
}

}  // namespace lamina::pipeline
