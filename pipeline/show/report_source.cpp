#include "pipeline/show/report_source.h"
#include "pipeline/job/file.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <memory>
#include <set>
#include <span>

#include "pipeline/check/job_files.h"
#include "pipeline/plan/plan.h"
#include "pipeline/plan/sections.h"
#include "stages/formats/gcode/read_gcode.h"
#include "stages/geometry/run_rows.h"
#include "stages/raster/beads.h"
#include "stages/slice/deep.h"
#include "stages/support/hash/hash.h"
#include "stages/support/io/container.h"
#include "stages/support/io/file.h"
#include "stages/support/io/temporary.h"

namespace lamina::pipeline {
namespace {

namespace fs = std::filesystem;

Error wrong(const std::string& path, std::string_view what) {
  return {Fault::kVerification, fmt::format("{}: {}", path, what)};
}

Result<Manifest> finished_manifest(const std::string& position, const std::string& path) {
  if (!is_file(path)) {
    if (is_file(path + ".part") || is_file(part_of(position))) {
      return wrong(position, "the job is not finished; complete it with --resume first");
    }
    return wrong(position,
                 fmt::format("no {}; name a finished directory of lamina jet (shards: run lamina merge first) or a G-code "
                             "file of lamina extrude",
                             fs::path(path).filename().string()));
  }
  Result<Manifest> manifest = read_manifest(path);
  if (!manifest) return manifest;
  if (manifest->layers.empty()) return wrong(position, "the job has no layers");
  return manifest;
}

/// Reads a layer's files into runs if they match the manifest.
Result<LayerPicture> read_layer(const std::string& directory, const ManifestHead& head, const LayerRecord& record,
                                const ExpectedDrops& expected) {
  if (Status status = check_images(directory, head, record); !status) return status.error();
  return picture_of_layer(directory, head, record, expected);
}

/// The same of a layer of one image of 1 bit, as runs or bits.
Result<ReportLayer> read_bits(const std::string& directory, const ManifestHead& head, const LayerRecord& record) {
  if (Status status = check_images(directory, head, record); !status) return status.error();
  const std::string name = layer_images(head, record).front().name;
  auto image = formats::image(directory + "/" + name, 0, Keep::kSmaller);
  if (!image) return image.error();
  if (image->columns != head.grid.columns() || image->rows != head.grid.rows())
    return wrong(directory + "/" + name, "is not of the manifest's size; run lamina verify for details");
  return ReportLayer{std::move(image->runs), 0, std::move(image->bits)};
}

/// Machine time of a layer, from replaying its program as lamina verify does.
Result<double> seconds_of_layer(const std::string& directory, const ManifestHead& head, const replay::VirtualMachine& machine,
                                const LayerRecord& record, std::span<const BitRows* const> planes) {
  const auto program = program_of_layer(directory, head, record);
  if (!program) return program.error();
  const auto replay = machine.replay(*program, record.layer, planes, record.program.moved, record.program.lost);
  if (replay) return replay->seconds();
  return wrong(directory + "/" + program_file_name(record.layer.index, head.program_extension),
               replay.error().message + "; run lamina verify for details");
}

Result<double> seconds_of_layer(const std::string& directory, const ManifestHead& head, const replay::VirtualMachine& machine,
                                const LayerRecord& record, const LayerPicture& picture) {
  const std::vector<RunRows> rows(picture.begin(), picture.end());
  std::vector<const BitRows*> planes;
  for (const RunRows& one : rows) planes.push_back(&one);
  return seconds_of_layer(directory, head, machine, record, planes);
}

/// A layer whose image is the geometry: its drops are made row by row, and only the pixels with any are kept, as bits.
/// machine  null: without the time
Result<ReportLayer> read_dosed(const std::string& directory, const ManifestHead& head, const LayerRecord& record,
                               const ExpectedDrops& expected, const replay::VirtualMachine* machine) {
  const auto geometry = read_layer(directory, head, record, ExpectedDrops());
  if (!geometry) return geometry.error();
  LayerDrops drops;
  if (Status status = expected.make(record.layer, *geometry, drops); !status)
    return wrong(directory, status.error().message + "; run lamina verify for details");
  ReportLayer layer;
  if (machine != nullptr) {
    const auto seconds = seconds_of_layer(directory, head, *machine, record, drops.planes());
    if (!seconds) return seconds.error();
    layer.seconds = *seconds;
  }
  const BitRows& any = *drops.planes().front();
  const auto bits = std::make_shared<BitImage>(any.columns(), any.rows());
  for (std::uint32_t r = 0; r < any.rows(); ++r) any.row(r, bits->row(r));
  layer.bits = bits;
  return layer;
}

Result<ReportSource> source_of_images(const std::string& directory, ReportSource source) {
  const ManifestHead& head = source.manifest.head;
  if (head.extension.empty()) {
    return wrong(directory,
                 fmt::format("the job wrote no images (format {}); plan it with another format, as tiff-g4", head.format));
  }
  source.grid = head.grid;
  std::optional<replay::VirtualMachine> machine;
  if (!head.machine.empty()) {
    auto built = machine_of_job(directory, head);
    if (!built)
      return Error{built.error().fault, fmt::format("{}/{}; run lamina verify for details", directory, built.error().message)};
    machine.emplace(std::move(*built));
    source.machine = machine->profile();
    if (Status status = check_frame(directory, head); !status) return status.error();
  }
  auto drops = machine ? ExpectedDrops::of(head, machine->profile()) : ExpectedDrops();
  if (!drops) return Error{drops.error().fault, fmt::format("{}/{}", directory, drops.error().message)};
  const auto expected = std::make_shared<const ExpectedDrops>(std::move(*drops));
  const auto manifest = std::make_shared<const Manifest>(source.manifest);
  source.layer = [directory, manifest, machine, expected](std::uint32_t position, bool timed) -> Result<ReportLayer> {
    const LayerRecord& record = manifest->layers[position];
    if (expected->remakes()) return read_dosed(directory, manifest->head, record, *expected, timed ? &*machine : nullptr);
    if (is_one_bit(manifest->head) && (!machine || !timed)) return read_bits(directory, manifest->head, record);
    auto runs = read_layer(directory, manifest->head, record, *expected);
    if (!runs) return runs.error();
    if (!machine || !timed) return ReportLayer{std::move(runs->front())};
    const auto seconds = seconds_of_layer(directory, manifest->head, *machine, record, *runs);
    if (!seconds) return seconds.error();
    return ReportLayer{std::move(runs->front()), *seconds};
  };
  const std::uint32_t planes = std::max(1u, head.max_drops);
  source.bytes = [manifest, expected, replay = machine ? machine->bytes_of_replay(planes) : 0](std::uint32_t position,
                                                                                               bool timed) {
    const ManifestHead& of = manifest->head;
    const LayerRecord& record = manifest->layers[position];
    const std::uint64_t more = replay > 0 && timed ? replay + 2 * record.program.bytes : 0;
    if (expected->remakes()) return bytes_to_make(of, record) + bytes_of_bits(of.grid.columns(), of.grid.rows()) + more;
    return bytes_to_read(of, record, is_one_bit(of) && more == 0 ? Keep::kSmaller : Keep::kRuns) + more;
  };
  return source;
}

Result<ReportSource> source_of_toolpaths(const std::string& path, ReportSource source) {
  const Result<FileDigest> digest = digest_file(path);
  if (!digest) return digest.error();
  const Manifest& manifest = source.manifest;
  if (digest->bytes != manifest.file.bytes || digest->hash != manifest.file.hash) {
    return wrong(path, "is not the file of its manifest; run lamina verify for details");
  }
  auto opened = formats::GcodeFile::open(path);
  if (!opened) return opened.error();
  Job job;
  if (Status status = read_job_text(manifest.head.job_toml, "manifest.json", job); !status) return status.error();
  const std::uint32_t raft = job.extrude.raft_layers;  // below the layers of the manifest
  if (opened->count() != raft + manifest.layers.size()) {
    return wrong(path, fmt::format("has {} layers, its manifest {}", opened->count(), raft + manifest.layers.size()));
  }
  const auto file = std::make_shared<const formats::GcodeFile>(std::move(*opened));
  source.box = file->box();
  source.grid = raster::bead_grid(source.box);
  std::vector<double> seconds;
  for (const LayerRecord& record : manifest.layers) seconds.push_back(record.paths ? record.paths->totals.seconds : 0);
  source.layer = [file, raft, grid = source.grid, seconds](std::uint32_t position, bool) -> Result<ReportLayer> {
    const auto layer = file->layer(raft + position);
    if (!layer) return layer.error();
    raster::BeadRaster beads(grid);
    beads.add(layer->beads, {file->box().lo.x, file->box().lo.y});
    ReportLayer detected{{}, seconds[position]};
    beads.runs(detected.runs);
    return detected;
  };
  return source;
}

}  // namespace

Result<ReportSource> report_source(const std::string& path) {
  const bool toolpaths = is_file(path) && !is_container(path);
  ReportSource source;
  source.manifest_path = toolpaths ? path + ".json" : path + "/manifest.json";
  auto manifest = finished_manifest(path, source.manifest_path);
  if (!manifest) return manifest.error();
  source.manifest = std::move(*manifest);
  switch (source.manifest.head.product) {
    case Product::kMoves:
      if (toolpaths) return source_of_toolpaths(path, std::move(source));
      break;
    case Product::kImages: return source_of_images(path, std::move(source));
    case Product::kContours: break;
  }
  return wrong(path, "is a job of lamina slice, and reports are of images and toolpaths; lamina preview draws its layers");
}

Result<Scene> find_parts(const ManifestHead& head, const Job& recorded, const Machine* machine,
                         const std::vector<std::string>& folders) {
  Job job = recorded;
  for (const PartSummary& part : head.parts) {
    if (part.triangles == 0)
      return Error{Fault::kInput, fmt::format("{}: consists of images, which have no side view", part.path)};
  }
  for (PartRequest& part : job.parts) {
    const std::string name = fs::path(part.path).filename().string();
    part.path = find_part(name, folders);
    if (part.path.empty()) return Error{Fault::kInput, fmt::format("{}: not found; name its folder with --parts", name)};
  }
  // The manifest decides the bed of images, because the machine's profile may have changed.
  const double margin_mm = machine != nullptr ? machine->bed.margin_mm : job.margin_mm.value_or(0);
  Bed bed{{mm(head.grid.x.length), mm(head.grid.y.length)}, false, margin_mm};
  if (head.product != Product::kImages) {
    const auto resolved = resolve(job, head.product);
    if (!resolved) return resolved.error();
    bed = resolved->bed;
  }
  Result<Scene> scene = load_scene(job, bed);
  if (!scene) return scene;
  for (std::size_t i = 0; i < scene->parts.size(); ++i) {
    if (i < head.parts.size() && scene->parts[i].fingerprint == head.parts[i].fingerprint) continue;
    return Error{Fault::kInput,
                 fmt::format("{}: is not the part that was planned, its triangles are others", job.parts[i].path)};
  }
  return scene;
}

namespace {

/// Where instances overlap deeply, every ray would meet all of them: of those close together, one is shown.
std::vector<Instance> shown_instances(const Scene& scene, std::uint32_t maximum) {
  constexpr std::size_t kShown = 256;
  std::vector<Box> boxes;
  Box all;
  for (const Instance& instance : scene.instances) all.add(boxes.emplace_back(box_of(scene, instance)));
  std::vector<Instance> shown = scene.instances;
  if (!slice::overlaps_deeply(boxes)) return shown;
  std::int64_t step = std::max({all.width(), all.depth(), all.height()}) / (4 * maximum) + 1;
  for (; shown.size() > kShown && step < 2 * kNmReach; step *= 2) {
    std::set<std::array<std::int64_t, 4>> positions;
    std::erase_if(shown, [&](const Instance& instance) {
      const Point3& at = instance.offset;
      return !positions.insert({instance.mesh, at.x / step, at.y / step, at.z / step}).second;
    });
  }
  return shown;
}

}  // namespace

Result<std::array<view::Picture, 3>> cast_parts(const Scene& scene, std::uint32_t maximum) {
  const Result<view::Caster> caster = view::Caster::build(scene.meshes, shown_instances(scene, maximum));
  if (!caster) return caster.error();
  return std::array{caster->render(view::ViewSide::kTop, maximum), caster->render(view::ViewSide::kFront, maximum),
                    caster->render(view::ViewSide::kRight, maximum)};
}

}  // namespace lamina::pipeline
