#include "pipeline/plan/scene.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <map>
#include <numeric>
#include <set>
#include <tuple>
#include <utility>

#include "pipeline/job/errors.h"
#include "pipeline/job/keys.h"
#include "pipeline/manifest/manifest.h"
#include "stages/formats/images/image.h"
#include "stages/geometry/blocks/mesh_blocks.h"
#include "stages/load/load.h"
#include "stages/program/bed.h"
#include "stages/support/text/number_text.h"
#include "stages/support/text/readable.h"

namespace lamina::pipeline {
namespace {

double millimetres_of(const std::string& unit) {
  constexpr std::pair<std::string_view, double> kUnits[] = {{"mm", 1},     {"cm", 10},     {"m", 1000},
                                                            {"um", 0.001}, {"inch", 25.4}, {"foot", 304.8}};
  for (const auto& [name, size] : kUnits) {
    if (name == unit) return size;
  }
  return 1;
}

// A file, loaded once for all [[part]] entries with equal options.
struct Loaded {
  std::uint32_t first_mesh = 0;     // of its meshes in the scene
  std::vector<Instance> instances;  // mesh counts from first_mesh
  Box bounds;
  std::uint64_t triangles = 0, fingerprint = 0;
  std::vector<Note> notes;
  std::shared_ptr<const OpenImages> images = {};  // of a part that is no mesh
};

using LoadKey =
    std::tuple<std::string, std::string, std::array<double, 3>, std::array<double, 3>, std::array<double, 3>, std::string>;

// splitmix64's finisher: spreads neighbouring offsets over all bits.
std::uint64_t mix(std::uint64_t x) {
  x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9ull;
  x = (x ^ (x >> 27)) * 0x94d049bb133111ebull;
  return x ^ (x >> 31);
}

std::uint64_t fingerprint_of(const Instance& instance, const Mesh& mesh) {
  std::uint64_t hash = mix(mesh.fingerprint);
  for (const Nm part : {instance.offset.x, instance.offset.y, instance.offset.z}) {
    hash = mix(hash + 0x9e3779b97f4a7c15ull + static_cast<std::uint32_t>(part));
  }
  return hash;
}

// Brings a mesh's box to the origin, so that any offset on the bed fits 32 bits; returns where it was. shared  other jobs may
// use its blocks, which stay as they are
Point3 rebase(Mesh& mesh, bool shared) {
  const Point3 from = mesh.bounds.lo;
  if (mesh.blocks && shared) mesh.triangles = list_of(*std::exchange(mesh.blocks, {}));
  const auto shift = [&](Point3& p) { p = {p.x - from.x, p.y - from.y, p.z - from.z}; };
  if (mesh.blocks) mesh.blocks->shift({-from.x, -from.y, -from.z});
  for (Triangle& t : mesh.triangles) {
    shift(t.a);
    shift(t.b);
    shift(t.c);
  }
  const Point3 hi{static_cast<Nm>(mesh.bounds.width()), static_cast<Nm>(mesh.bounds.depth()),
                  static_cast<Nm>(mesh.bounds.height())};
  mesh.bounds = {{0, 0, 0}, hi};
  return from;
}

bool fits(std::int64_t nm) { return nm >= INT32_MIN && nm <= INT32_MAX; }

Result<Loaded> load_part(const Job& job, const PartRequest& request, MeshForm form,
                         const std::shared_ptr<load::Scratch>& scratch, Scene& scene) {
  load::LoadOptions options = load_options(job, request);
  options.blocks = form != MeshForm::kLists;
  options.order = form == MeshForm::kOrderedBlocks;
  options.isa = job.isa;
  options.scratch = scratch;
  Result<Part> part = load::load(request.path, options);
  if (!part) return part.error();
  if (part->bounds.empty() || part->instances.empty()) {
    return Error{Fault::kInput, fmt::format("{}: contains no triangles; nothing to plan", request.path)};
  }
  if (part->bounds.height() == 0) {
    return Error{Fault::kInput, fmt::format("{}: all of it is at z = {} mm, it has no height; nothing to plan", request.path,
                                            mm(part->bounds.lo.z))};
  }
  Loaded loaded;
  loaded.first_mesh = static_cast<std::uint32_t>(scene.meshes.size());
  loaded.bounds = part->bounds;
  loaded.instances = std::move(part->instances);
  loaded.notes = std::move(part->notes);
  for (const Instance& instance : loaded.instances) {
    const Mesh& mesh = part->meshes[instance.mesh];
    loaded.triangles += triangle_count(mesh);
    loaded.fingerprint += fingerprint_of(instance, mesh);
  }
  for (Mesh& mesh : part->meshes) scene.meshes.push_back(std::move(mesh));
  return loaded;
}

Result<Loaded> load_images(const Job& job, const PartRequest& request, const PixelGrid* grid) {
  auto open = open_images(job, request, grid);
  if (!open) return open.error();
  Loaded loaded;
  loaded.bounds.add(Point3{0, 0, 0});
  loaded.bounds.add(Point3{static_cast<Nm>(std::min(open->width, std::int64_t{INT32_MAX})),
                           static_cast<Nm>(std::min(open->depth, std::int64_t{INT32_MAX})),
                           static_cast<Nm>(open->images->layers() * std::int64_t{open->thickness})});
  loaded.fingerprint = open->images->fingerprint();
  loaded.notes = open->notes;
  loaded.images = std::make_shared<const OpenImages>(std::move(*open));
  return loaded;
}

/// Of a part, no more overlaps than this are listed.
constexpr std::size_t kOverlapsNoted = 3;

// Only parts with explicit positions can overlap: arranged boxes are disjoint.
void note_overlaps(const Job& job, Scene& scene, const std::vector<std::pair<std::uint32_t, Box>>& boxes) {
  const auto count = static_cast<std::uint32_t>(boxes.size());
  std::vector<std::uint32_t> order(count), found(count, 0), next(count + 1);
  for (std::uint32_t i = 0; i < count; ++i) order[i] = i;
  std::iota(next.begin(), next.end(), 0u);
  std::sort(order.begin(), order.end(), [&](std::uint32_t a, std::uint32_t b) {
    return std::tie(boxes[a].second.lo.x, a) < std::tie(boxes[b].second.lo.x, b);
  });
  // A box for which enough others are known is left out: boxes at one position are compared a few times each.
  const auto open_from = [&](std::uint32_t j) {
    while (next[j] != j) j = next[j] = next[next[j]];
    return j;
  };
  std::map<std::pair<std::uint32_t, std::uint32_t>, bool> noted;
  std::set<std::uint32_t> more;  // parts with overlaps that are not listed
  for (std::uint32_t i = 0; i < count; ++i) {
    const auto& [part, box] = boxes[order[i]];
    for (std::uint32_t j = open_from(i + 1); j < count; j = open_from(j + 1)) {
      const auto& [other_part, other] = boxes[order[j]];
      if (other.lo.x >= box.hi.x) break;
      const bool apart = other.lo.y >= box.hi.y || other.hi.y <= box.lo.y || other.lo.z >= box.hi.z || other.hi.z <= box.lo.z;
      const bool counts = part != other_part && (job.parts[part].at_mm || job.parts[other_part].at_mm) && !apart;
      if (counts && noted.try_emplace(std::minmax({part, other_part}), true).second) ++found[j];
      if (found[j] <= kOverlapsNoted) continue;
      more.insert(other_part);
      next[j] = j + 1;
    }
  }
  std::vector<std::size_t> listed(scene.parts.size(), 0);
  for (const auto& [pair, unused] : noted) {
    const auto& [first, second] = pair;
    if (listed[second]++ >= kOverlapsNoted) {
      more.insert(second);
      continue;
    }
    const auto is_images = [&](std::uint32_t part) { return std::ranges::count(scene.images, part, &PlacedImages::part) > 0; };
    scene.parts[second].notes.push_back(
        {false, fmt::format("its box overlaps that of part {} ({}); where solids overlap {}", first + 1,
                            std::filesystem::path(scene.parts[first].path).filename().string(),
                            job.parts[first].material == job.parts[second].material ? "their union is printed"
                            : is_images(first) && !is_images(second)                ? "that one's material counts"
                                                                                    : "this one's material counts")});
  }
  for (const std::uint32_t part : more) scene.parts[part].notes.push_back({false, "its box overlaps those of more parts"});
}

/// nm above the bed.
std::int64_t bottom_of(const PartRequest& part, const Loaded& loaded) {
  return loaded.images ? loaded.images->bottom : nm_of(part.bottom_mm.value_or(0));
}

/// The file of each [[part]]; equal files with equal transforms are loaded once. A map's values stay where they are.
/// errors  of load_part; kUsage: a part that reaches beyond what nm can say
Result<std::vector<const Loaded*>> load_parts(const Job& job, MeshForm form, const PixelGrid* grid,
                                              std::map<LoadKey, Loaded>& files, Scene& scene) {
  std::vector<const Loaded*> loaded;
  const auto scratch = load::make_scratch(job.isa);
  for (const PartRequest& part : job.parts) {
    std::error_code ignored;
    const std::filesystem::path file = std::filesystem::weakly_canonical(part.path, ignored);
    // Parts of different materials have separate meshes, because solids.h indexes them separately.
    const std::string solid =
        part.material_ranges.empty()
            ? part.material
            : fmt::format("{} {} {}", part.material, material_ranges_text(part.material_ranges), part.bottom_mm.value_or(0));
    const bool images = formats::names_images(part.path);
    const LoadKey key{images         ? fmt::format("images {}", loaded.size())
                      : file.empty() ? part.path
                                     : file.string(),
                      part.unit,
                      part.scale,
                      part.rotate_deg,
                      part.shrink,
                      solid};
    auto found = files.find(key);
    if (found == files.end()) {
      Result<Loaded> fresh = images ? load_images(job, part, grid) : load_part(job, part, form, scratch, scene);
      if (!fresh) return fresh.error();
      found = files.emplace(key, std::move(*fresh)).first;
    }
    loaded.push_back(&found->second);
    const std::int64_t top = bottom_of(part, found->second) + found->second.bounds.height();
    if (top > kNmReach) {
      return Error{Fault::kUsage,
                   fmt::format("{}: reaches {} mm above the bed, beyond {} mm; use a smaller --scale or --bottom", part.path,
                               mm(top), mm(kNmReach))};
    }
  }
  return loaded;
}

arrange::BedSpace space_of(const Bed& bed) {
  return {nm_of(bed.size_mm[0]), nm_of(bed.size_mm[1]), nm_of(bed.margin_mm), bed.of_machine};
}

/// Requested positions in the margin are kept.
void note_margin(const Bed& bed, const PartRequest& request, const Box& box, PartSummary& part) {
  const auto [width, depth, margin, unused] = space_of(bed);
  const bool inside = box.lo.x >= margin && box.lo.y >= margin && box.hi.x <= width - margin && box.hi.y <= depth - margin;
  if (inside || !request.at_mm) return;
  part.notes.push_back({false, fmt::format("its box lies in the margin of {:g} mm along the edges of the bed", bed.margin_mm)});
}

/// The space of a part.
arrange::BoxRequest box_request(const PartRequest& part, const Loaded& loaded, const Bed& bed) {
  arrange::BoxRequest request;
  request.width = loaded.bounds.width();
  request.depth = loaded.bounds.depth();
  request.copies = part.copies;
  request.name = part.path;
  if (part.at_mm) {
    request.at_x = nm_of((*part.at_mm)[0]);
    request.at_y = nm_of((*part.at_mm)[1]);
  }
  if (loaded.images && part.images.crop) {
    const std::int64_t free_x = nm_of(bed.size_mm[0]) - request.at_x.value_or(0);
    const std::int64_t free_y = nm_of(bed.size_mm[1]) - request.at_y.value_or(0);
    if (free_x > 0) request.width = std::min(request.width, free_x);
    if (free_y > 0) request.depth = std::min(request.depth, free_y);
  }
  // Images of a whole bed include its margin.
  const arrange::BedSpace space = space_of(bed);
  if (loaded.images && !part.at_mm && part.copies == 1 &&
      (request.width > space.width - 2 * space.margin || request.depth > space.depth - 2 * space.margin)) {
    request.at_x = std::max<std::int64_t>(0, space.width - request.width) / 2;
    request.at_y = std::max<std::int64_t>(0, space.depth - request.depth) / 2;
  }
  return request;
}

namespace fs = std::filesystem;

constexpr std::uint32_t kSampledImages = 5;  // into a stack, for how crowded its images are

/// An output never replaces an input.
Status check_apart(const Job& job, const std::string& path) {
  std::error_code ignored;
  if (job.output.empty()) return {};
  const fs::path in = fs::weakly_canonical(path, ignored), out = fs::weakly_canonical(job.output, ignored);
  const bool inside = std::ranges::mismatch(out, in).in1 == out.end();
  if (!inside) return {};
  return usage("{}: is in the output directory; name another one with -o", one_line(path));
}

/// The pixels of the images by key or tags. errors  kInput, kUsage
Result<std::array<DotPitch, 2>> pitch_of(const PartRequest& part, const formats::LayerImages& images, const PixelGrid& grid) {
  const std::array<double, 2> dpi =
      part.images.dpi.value_or(std::array{formats::requested_dpi(images.dpi_x()), formats::requested_dpi(images.dpi_y())});
  if (!(dpi[0] > 0) || !(dpi[1] > 0))
    return Error{Fault::kInput, fmt::format("{}: its files state no resolution; add part.dpi", one_line(part.path))};
  std::array<DotPitch, 2> pitch{};
  const std::array axes{&grid.x, &grid.y};
  for (std::size_t a = 0; a < 2; ++a) {
    const bool same = std::abs(dpi[a] - axes[a]->dpi()) <= 0.02;
    if (!same && !part.images.resample)
      return usage("{}: {:g} x {:g} dpi, the job has {:g} x {:g}; give the same --dpi, or part.resample = true",
                   one_line(part.path), dpi[0], dpi[1], grid.x.dpi(), grid.y.dpi());
    pitch[a] = same ? axes[a]->pitch() : pitch_of_dpi(dpi[a]);
  }
  return pitch;
}

Status check_no_transform(const PartRequest& part) {
  const PartRequest plain;
  if (part.scale == plain.scale && part.rotate_deg == plain.rotate_deg && part.shrink == plain.shrink &&
      part.unit == plain.unit)
    return {};
  return usage("{}: images are neither scaled nor turned; leave out scale, rotate_deg, shrink and unit", one_line(part.path));
}

/// nm that pixels of the image take on the bed. As many as a bed of this length has are as long as the bed.
std::int64_t length_of(std::uint32_t pixels, const DotPitch& pitch, const PixelAxis& axis) {
  const std::int64_t nm = pixels * pitch.span / pitch.dots;
  return pixels == ceil_div(axis.length * pitch.dots, pitch.span) ? std::min(nm, axis.length) : nm;
}

}  // namespace

load::LoadOptions load_options(const Job& job, const PartRequest& request) {
  load::LoadOptions options;
  options.transform = load::make_transform(request.scale, request.rotate_deg, request.shrink);
  options.unit_mm = millimetres_of(request.unit);
  options.drop_bad = job.drop_bad;
  options.repair = job.repair;
  options.turn_shells = job.fill_rule == FillRule::kNonzero;
  options.winding = job.winding;
  options.weld_nm = nm_of(job.weld_um / 1000);
  options.store = job.loaded;
  return options;
}

Result<Scene> load_scene(const Job& job, const Bed& bed, MeshForm form, const PixelGrid* grid) {
  Scene scene;
  std::map<LoadKey, Loaded> files;
  const auto parts = load_parts(job, form, grid, files, scene);
  if (!parts) return parts.error();
  const std::vector<const Loaded*>& loaded = *parts;
  std::vector<arrange::BoxRequest> requests;
  for (std::size_t p = 0; p < job.parts.size(); ++p) requests.push_back(box_request(job.parts[p], *loaded[p], bed));

  const Result<std::vector<arrange::BoxPosition>> positions =
      arrange::arrange_boxes(requests, space_of(bed), nm_of(job.gap_mm));
  if (!positions) return positions.error();

  for (std::size_t p = 0; p < job.parts.size(); ++p) {
    scene.parts.push_back(
        {job.parts[p].path, job.parts[p].copies, loaded[p]->triangles, loaded[p]->fingerprint, Box(), loaded[p]->notes});
  }
  // Meshes far from their file's origin, whose offset to the bed exceeds 32 bits of nanometres.
  std::map<std::uint32_t, Point3> rebased;
  std::vector<std::pair<std::uint32_t, Box>> boxes;
  bool positions_requested = false;
  for (const arrange::BoxPosition& position : *positions) {
    const Loaded& part = *loaded[position.request];
    const std::int64_t bottom = bottom_of(job.parts[position.request], part);
    if (part.images) {
      scene.images.push_back(placed_images(*part.images, job.parts[position.request], *grid, position.x, position.y,
                                           scene.parts[position.request].notes));
      scene.images.back().part = position.request;
    }
    positions_requested = positions_requested || job.parts[position.request].at_mm.has_value();
    for (const Instance& instance : part.instances) {
      const std::uint32_t mesh = part.first_mesh + instance.mesh;
      const auto way = [&](Nm own, std::int64_t target, Nm lo) { return std::int64_t{own} + target - lo; };
      std::int64_t x = way(instance.offset.x, position.x, part.bounds.lo.x);
      std::int64_t y = way(instance.offset.y, position.y, part.bounds.lo.y);
      std::int64_t z = way(instance.offset.z, bottom, part.bounds.lo.z);
      auto base = rebased.find(mesh);
      if (base == rebased.end() && !(fits(x) && fits(y) && fits(z))) {
        base = rebased.emplace(mesh, scene.meshes[mesh].bounds.lo).first;
        rebase(scene.meshes[mesh], job.loaded != nullptr);
        // Shifts earlier instances of the mesh as well.
        for (Instance& earlier : scene.instances) {
          if (earlier.mesh != mesh) continue;
          earlier.offset = {earlier.offset.x + base->second.x, earlier.offset.y + base->second.y,
                            earlier.offset.z + base->second.z};
        }
      }
      if (base != rebased.end()) {
        x += base->second.x;
        y += base->second.y;
        z += base->second.z;
      }
      scene.instances.push_back({mesh, {static_cast<Nm>(x), static_cast<Nm>(y), static_cast<Nm>(z)}});
      scene.part_of_instance.push_back(position.request);
    }
    const Box box{{static_cast<Nm>(position.x), static_cast<Nm>(position.y), static_cast<Nm>(bottom)},
                  {static_cast<Nm>(position.x + part.bounds.width()), static_cast<Nm>(position.y + part.bounds.depth()),
                   static_cast<Nm>(bottom + part.bounds.height())}};
    PartSummary& summary = scene.parts[position.request];
    if (summary.bounds.empty()) {
      summary.bounds = box;
      note_margin(bed, job.parts[position.request], box, summary);
    }
    scene.height = std::max<std::int64_t>(scene.height, box.hi.z);
    boxes.emplace_back(position.request, box);
  }
  if (positions_requested) note_overlaps(job, scene, boxes);
  return scene;
}

Status check_reach(const Machine& machine, const Scene& scene) {
  for (std::size_t i = 0; i < scene.instances.size(); ++i) {
    const Instance& instance = scene.instances[i];
    const Mesh& mesh = scene.meshes[instance.mesh];
    const auto outside = program::first_outside(machine, mesh, instance.offset);
    if (!outside) continue;
    const std::string& part = scene.parts[scene.part_of_instance[i]].path;
    if (outside->above) {
      return Error{Fault::kUsage, fmt::format("{}: reaches z {:.3f} mm at x {:.3f}, y {:.3f}, above the build height of {}, "
                                              "{:g} mm; turn or scale the part",
                                              part, mm(outside->position.z), mm(outside->position.x), mm(outside->position.y),
                                              machine.name, machine.bed.build_height_mm)};
    }
    return Error{Fault::kUsage,
                 fmt::format("{}: reaches x {:.3f}, y {:.3f} mm at z {:.3f}, {:.3f} mm outside of the bed of {}; "
                             "move, turn or scale the part",
                             part, mm(outside->position.x), mm(outside->position.y), mm(outside->position.z),
                             outside->beyond_mm, machine.name)};
  }
  for (const PlacedImages& images : scene.images) {
    const double top = mm(images.bottom + std::int64_t{images.thickness} * images.images->layers());
    if (top <= machine.bed.build_height_mm) continue;
    return Error{Fault::kUsage,
                 fmt::format("{}: its images reach z {:.3f} mm, above the build height of {}, {:g} mm; leave some out",
                             scene.parts[images.part].path, top, machine.name, machine.bed.build_height_mm)};
  }
  return {};
}

Result<OpenImages> open_images(const Job& job, const PartRequest& part, const PixelGrid* grid) {
  if (grid == nullptr) return usage("{}: is layer images; lamina jet and lamina convert take them", one_line(part.path));
  if (Status status = check_no_transform(part); !status) return status.error();
  if (Status status = check_apart(job, part.path); !status) return status.error();
  const auto reported = images_on_record(part.path);
  if (!reported) return reported.error();
  if (job.levels > 0 && part.images.threshold != PartImages().threshold)
    return usage(
        "{}: part.threshold applies to 1-bit images, but --levels reads grey as fill fractions of voxels; leave out "
        "one of them",
        one_line(part.path));
  auto images = formats::LayerImages::open(
      reported->path, {static_cast<int>(part.images.threshold), part.images.invert, part.images.missing_empty, kSampledImages});
  if (!images) return images.error();
  OpenImages open;
  const auto pitch = pitch_of(part, *images, *grid);
  if (!pitch) return pitch.error();
  open.pitch = *pitch;
  open.bottom = part.bottom_mm ? static_cast<Nm>(nm_of(*part.bottom_mm)) : reported->bottom;
  open.thickness = reported->thickness;
  const bool layer_named = std::ranges::find(job.named, "layers.thickness_mm") != job.named.end();
  if (part.images.layer_mm) {
    open.thickness = static_cast<Nm>(nm_of(*part.images.layer_mm));
  } else if (open.thickness == 0 && layer_named) {
    open.thickness = static_cast<Nm>(nm_of(job.layer_mm));
  }
  if (open.thickness <= 0)
    return usage("{}: no manifest of lamina states the layer thickness; add --layer or part.layer_mm", one_line(part.path));
  if (open.bottom + std::int64_t{open.thickness} * images->layers() > kNmReach)
    return usage("{}: {} layers of {} mm reach beyond {} mm; give thinner ones", one_line(part.path), images->layers(),
                 mm(open.thickness), mm(kNmReach));
  open.width = length_of(images->columns(), open.pitch[0], grid->x);
  open.depth = length_of(images->rows(), open.pitch[1], grid->y);
  open.notes.push_back(
      {false, fmt::format("images: {} layers of {} mm, {} x {} pixels{}", images->layers(), number_text(mm(open.thickness)),
                          images->columns(), images->rows(),
                          images->missing() > 0 ? fmt::format(", {} of them missing and empty", images->missing()) : "")});
  if (!reported->mirror.empty() && reported->mirror != "none")
    open.notes.push_back(
        {false, fmt::format("its manifest says that the images are mirrored; --mirror {} turns them back", reported->mirror)});
  if (reported->levels > 0 && reported->levels != job.levels)
    open.notes.push_back(
        {false,
         fmt::format("its manifest says that the images are fill fractions of voxels in {} levels, which --levels {} keeps; {}",
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
      formats::placement_of(open.images->columns(), open.images->rows(), open.pitch[0], open.pitch[1], grid, column, row);
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
  if (beads) return usage("{}: is images; walls, fillings and segments are of meshes, leave them out", first);
  if (job.heights.mode != heights::Mode::kUniform || job.heights.per_part || !job.heights.thickness_mm.empty())
    return usage("{}: images have layers of one thickness; leave out --heights and --thickness", first);
  if (!scene.instances.empty()) return {};
  const Nm thickness = scene.images.front().thickness;
  for (const PlacedImages& images : scene.images) {
    const std::string& path = scene.parts[images.part].path;
    if (images.thickness != thickness)
      return usage("{}: layers of {} mm, those of {} are {} mm; images share one thickness", one_line(path),
                   mm(images.thickness), first, mm(thickness));
    if (images.bottom % thickness != 0)
      return usage("{}: begins {} mm above the bed, which are no whole layers of {} mm; give another --bottom", one_line(path),
                   mm(images.bottom), mm(thickness));
  }
  const bool named = std::ranges::find(job.named, "layers.thickness_mm") != job.named.end();
  if (named && nm_of(job.layer_mm) != thickness)
    return usage("{}: layers of {} mm, the job requests {} mm; leave out --layer", first, mm(thickness),
                 number_text(job.layer_mm));
  job.layer_mm = mm(thickness);
  return {};
}

}  // namespace lamina::pipeline
