#include "pipeline/plan/part_images.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>

#include "pipeline/manifest/manifest.h"
#include "stages/support/text/number_text.h"
#include "stages/support/text/readable.h"

namespace lamina::pipeline {
namespace {

namespace fs = std::filesystem;

constexpr std::uint32_t kSampledImages = 5;  // into a stack, for how crowded its images are

Error usage(std::string what) { return {Fault::kUsage, std::move(what)}; }

/// An output never replaces an input.
Status check_apart(const Job& job, const std::string& path) {
  std::error_code ignored;
  if (job.output.empty()) return {};
  const fs::path in = fs::weakly_canonical(path, ignored), out = fs::weakly_canonical(job.output, ignored);
  const bool inside = std::ranges::mismatch(out, in).in1 == out.end();
  if (!inside) return {};
  return usage(fmt::format("{}: lies in the directory that is written; name another one with -o", one_line(path)));
}

/// Dots an inch of the images by key or tags. errors  kInput, kUsage
Result<std::array<std::int64_t, 2>> dots_of(const PartRequest& part, const formats::LayerImages& images,
                                            const PixelGrid& grid) {
  std::array<double, 2> dpi{images.dpi_x(), images.dpi_y()};
  if (part.images.dpi) dpi = {static_cast<double>((*part.images.dpi)[0]), static_cast<double>((*part.images.dpi)[1])};
  if (!(dpi[0] > 0) || !(dpi[1] > 0))
    return Error{Fault::kInput, fmt::format("{}: its files tell no resolution; give it as part.dpi", one_line(part.path))};
  std::array<std::int64_t, 2> dots{};
  const std::array axes{&grid.x, &grid.y};
  for (std::size_t a = 0; a < 2; ++a) {
    if (std::abs(dpi[a] - axes[a]->dpi()) <= 0.02) {
      dots[a] = axes[a]->dots;
    } else if (!part.images.resample) {
      return usage(fmt::format("{}: {:g} x {:g} dpi, the job has {:g} x {:g}; give the same --dpi, or part.resample = true",
                               one_line(part.path), dpi[0], dpi[1], grid.x.dpi(), grid.y.dpi()));
    } else if (axes[a]->span != kNmPerInch || dpi[a] < 1 || dpi[a] > 25'400) {
      return usage(
          fmt::format("{}: {:g} dpi cannot be resampled to the job's {:g} x {:g}, which are not whole; plan the images at "
                      "the machine's",
                      one_line(part.path), dpi[a], grid.x.dpi(), grid.y.dpi()));
    } else {
      dots[a] = std::llround(dpi[a]);
    }
  }
  return dots;
}

Status check_no_transform(const PartRequest& part) {
  const PartRequest plain;
  if (part.scale == plain.scale && part.rotate_deg == plain.rotate_deg && part.shrink == plain.shrink &&
      part.unit == plain.unit)
    return {};
  return usage(fmt::format("{}: images are neither scaled nor turned; leave out scale, rotate_deg, shrink and unit",
                           one_line(part.path)));
}

/// nm that pixels of the image take on the bed. As many as a bed of this length has are as long as the bed.
std::int64_t length_of(std::uint32_t pixels, std::int64_t dots, const PixelAxis& axis) {
  const std::int64_t nm = pixels * axis.span / dots;
  return pixels == ceil_div(axis.length * dots, axis.span) ? std::min(nm, axis.length) : nm;
}

}  // namespace

Result<OpenImages> open_images(const Job& job, const PartRequest& part, const PixelGrid* grid) {
  if (grid == nullptr)
    return usage(fmt::format("{}: is layer images; lamina jet and lamina convert take them", one_line(part.path)));
  if (Status status = check_no_transform(part); !status) return status.error();
  if (Status status = check_apart(job, part.path); !status) return status.error();
  const auto reported = images_on_record(part.path);
  if (!reported) return reported.error();
  if (job.levels > 0 && part.images.threshold != PartImages().threshold)
    return usage(
        fmt::format("{}: part.threshold is of images of 1 bit, and --levels takes grey as shares of voxels; leave out "
                    "one of them",
                    one_line(part.path)));
  auto images = formats::LayerImages::open(
      reported->path, {static_cast<int>(part.images.threshold), part.images.invert, part.images.missing_empty, kSampledImages});
  if (!images) return images.error();
  OpenImages open;
  const auto dots = dots_of(part, *images, *grid);
  if (!dots) return dots.error();
  open.dots = *dots;
  open.bottom = part.bottom_mm ? static_cast<Nm>(nm_of(*part.bottom_mm)) : reported->bottom;
  open.thickness = reported->thickness;
  const bool layer_named = std::ranges::find(job.named, "layers.thickness_mm") != job.named.end();
  if (part.images.layer_mm) {
    open.thickness = static_cast<Nm>(nm_of(*part.images.layer_mm));
  } else if (open.thickness == 0 && layer_named) {
    open.thickness = static_cast<Nm>(nm_of(job.layer_mm));
  }
  if (open.thickness <= 0)
    return usage(fmt::format("{}: no manifest of lamina tells how thick its layers are; give --layer, or part.layer_mm",
                             one_line(part.path)));
  if (open.bottom + std::int64_t{open.thickness} * images->layers() > kNmReach)
    return usage(fmt::format("{}: {} layers of {} mm reach beyond {} mm; give thinner ones", one_line(part.path),
                             images->layers(), mm(open.thickness), mm(kNmReach)));
  open.width = length_of(images->columns(), open.dots[0], grid->x);
  open.depth = length_of(images->rows(), open.dots[1], grid->y);
  open.notes.push_back(
      {false, fmt::format("images: {} layers of {} mm, {} x {} pixels{}", images->layers(), number_text(mm(open.thickness)),
                          images->columns(), images->rows(),
                          images->missing() > 0 ? fmt::format(", {} of them missing and empty", images->missing()) : "")});
  if (!reported->mirror.empty() && reported->mirror != "none")
    open.notes.push_back(
        {false, fmt::format("its manifest says that the images are mirrored; --mirror {} turns them back", reported->mirror)});
  if (reported->levels > 0 && reported->levels != job.levels)
    open.notes.push_back(
        {false, fmt::format("its manifest says that the images are shares of voxels in {} levels, which --levels {} keeps; {}",
                            reported->levels, reported->levels,
                            job.levels > 0 ? "here they are rounded" : "here half full and more is set")});
  open.images = std::make_shared<const formats::LayerImages>(std::move(*images));
  return open;
}

PlacedImages placed_images(const OpenImages& open, const PartRequest& part, const PixelGrid& grid, std::int64_t x_nm,
                           std::int64_t y_nm, std::vector<Note>& notes) {
  const auto snapped = [](std::int64_t nm, std::int64_t length, const PixelAxis& axis) {
    const std::int64_t pixels = ceil_div(length * axis.dots, axis.span);
    const auto nearest = static_cast<std::int64_t>(std::llround(static_cast<double>(nm) * axis.pixels_per_nm()));
    return std::clamp<std::int64_t>(nearest, 0, std::max<std::int64_t>(0, axis.count - pixels));
  };
  PlacedImages placed;
  placed.images = open.images;
  placed.bottom = open.bottom;
  placed.thickness = open.thickness;
  // What is cropped stays where it is; else a pixel more or less of rounding must not cut anything off.
  const bool cut_x = part.images.crop && x_nm + open.width > grid.x.length;
  const bool cut_y = part.images.crop && y_nm + open.depth > grid.y.length;
  const std::int64_t column = snapped(x_nm, cut_x ? 0 : open.width, grid.x),
                     row = snapped(y_nm, cut_y ? 0 : open.depth, grid.y);
  placed.position =
      formats::placement_of(open.images->columns(), open.images->rows(), open.dots[0], open.dots[1], grid, column, row);
  const auto at_nm = [](std::int64_t pixel, const PixelAxis& axis) { return pixel * axis.span / axis.dots; };
  if (part.at_mm && (std::abs(at_nm(column, grid.x) - x_nm) > 1 || std::abs(at_nm(row, grid.y) - y_nm) > 1))
    notes.push_back(
        {false, fmt::format("placed at whole pixels: {:.4f}, {:.4f} mm", mm(at_nm(column, grid.x)), mm(at_nm(row, grid.y)))});
  if (cut_x || cut_y)
    notes.push_back({false, fmt::format("cropped: {:.3f} x {:.3f} mm of the images stick out of the bed",
                                        mm(cut_x ? x_nm + open.width - grid.x.length : 0),
                                        mm(cut_y ? y_nm + open.depth - grid.y.length : 0))});
  return placed;
}

Status fit_layers(const Scene& scene, bool beads, Job& job) {
  if (scene.images.empty()) return {};
  const std::string first = one_line(scene.parts[scene.images.front().part].path);
  if (beads) return usage(first + ": is images; walls, fillings and segments are of meshes, leave them out");
  if (job.heights.mode != heights::Mode::kUniform || job.heights.per_part || !job.heights.thickness_mm.empty())
    return usage(first + ": images have layers of one thickness; leave out --heights and --thickness");
  if (!scene.instances.empty()) return {};
  const Nm thickness = scene.images.front().thickness;
  for (const PlacedImages& images : scene.images) {
    const std::string& path = scene.parts[images.part].path;
    if (images.thickness != thickness)
      return usage(fmt::format("{}: layers of {} mm, those of {} are {} mm; images share one thickness", one_line(path),
                               mm(images.thickness), first, mm(thickness)));
    if (images.bottom % thickness != 0)
      return usage(fmt::format("{}: begins {} mm above the bed, which are no whole layers of {} mm; give another --bottom",
                               one_line(path), mm(images.bottom), mm(thickness)));
  }
  const bool named = std::ranges::find(job.named, "layers.thickness_mm") != job.named.end();
  if (named && nm_of(job.layer_mm) != thickness)
    return usage(fmt::format("{}: layers of {} mm, the job asks for {} mm; leave out --layer", first, mm(thickness),
                             number_text(job.layer_mm)));
  job.layer_mm = mm(thickness);
  return {};
}

}  // namespace lamina::pipeline
