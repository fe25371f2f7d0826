#include "pipeline/run/space.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>

#include "pipeline/manifest/layer_files.h"
#include "pipeline/output/image_files.h"
#include "pipeline/run/layer_imager.h"
#include "stages/support/io/paged.h"
#include "stages/support/text/readable.h"

namespace lamina::pipeline {
namespace {

namespace fs = std::filesystem;

/// Bytes of a line of the manifest, and of a file's last block, about.
constexpr std::uint64_t kBytesOfLayer = 1024;

/// Of one image per drop or material.
std::uint64_t bits_of_images(const ManifestHead& head) {
  const std::uint64_t images = std::max<std::size_t>(1, head.named_images()), bits = head.full_level() > 0 ? 8 : 1;
  return images * ((head.grid.columns() * bits + 7) / 8) * head.grid.rows();
}

/// Of the files of earlier layers, which the job keeps or replaces.
std::uint64_t bytes_there(const Job& job) {
  if ((!job.resume && !job.overwrite) || job.shard) return 0;
  std::uint64_t bytes = 0;
  const std::vector<std::string> paged = paged_job_files(job.output);
  for (const std::string& file : paged) {
    std::error_code error;
    const std::uintmax_t size = fs::file_size(file, error);
    bytes += error ? 0 : size;
  }
  if (!paged.empty()) return bytes;
  if (job.container == Container::kZip) {  // a finished one is replaced at the end
    std::error_code error;
    const std::uintmax_t size = fs::file_size(job.output + ".part", error);
    return error ? 0 : size;
  }
  for (const fs::path& file : layer_files(job.output)) {
    std::error_code error;
    const std::uintmax_t size = fs::file_size(file, error);
    bytes += error ? 0 : size;
  }
  return bytes;
}

}  // namespace

SpaceNeed estimate_space(const Plan& plan) {
  const std::uint32_t layers = plan.range[1] - plan.range[0];
  if (layers == 0) return {};
  SpaceNeed need;
  need.sampled = std::min(layers, plan.job.dry_run ? 3 : std::clamp(layers / 64, 1u, 3u));
  const LayerImager imager(plan);
  const ImageFiles files(plan);
  ImageWork work;
  ImageFiles::FileWork file_work;
  std::uint64_t bytes = 0;
  for (std::uint32_t i = 0; i < need.sampled; ++i) {
    const Layer layer = plan.layer(plan.range[0] + (2 * i + 1) * layers / (2 * need.sampled));
    LayerRecord record;
    record.layer = layer;
    ImageNotes notes;
    if (!imager.make(layer, work, record, notes)) continue;
    if (!files.measure({work.runs, work.materials.image, work.drops.drops, work.drops.shares}, file_work, record)) continue;
    bytes += record.bytes + record.program.stored;
  }
  need.bytes = bytes / need.sampled * layers + layers * kBytesOfLayer;
  return need;
}

std::uint64_t space_bound(const Plan& plan) {
  const ManifestHead head = image_head(plan);
  std::uint64_t of_layer = bits_of_images(head) + kBytesOfLayer;
  if (plan.images->machine) {
    const PrintProgram program(*plan.images->machine, "", plan.layer_count, {});
    of_layer += program.file_bound(std::max(1u, head.max_drops));
  }
  return of_layer * (plan.range[1] - plan.range[0]);
}

std::optional<FreeSpace> free_space(const std::string& output) {
  std::error_code error;
  fs::path folder = fs::absolute(output.empty() ? "." : output, error).lexically_normal();
  while (!fs::exists(folder, error) && folder.has_relative_path()) folder = folder.parent_path();
  const fs::space_info space = fs::space(folder, error);
  if (error || space.capacity == 0) return std::nullopt;  // as of /proc
  return FreeSpace{folder.string(), space.available};
}

Status check_space(const SpaceNeed& need, const FreeSpace& space, std::uint64_t freed, bool only_warn,
                   std::vector<Warning>& warnings) {
  if (space.bytes + freed >= need.bytes) return {};
  const std::string text = fmt::format(
      "{}: the job needs about {}, by {} of its layers, and {} are free; free some space, or name another folder "
      "with -o",
      one_line(space.folder), readable_bytes(need.bytes), need.sampled, readable_bytes(space.bytes + freed));
  if (!only_warn && space.bytes + freed < need.bytes / 2) return Error{Fault::kOutput, text};
  warnings.push_back({"low-space", text});
  return {};
}

Status check_space(const Plan& plan, Summary& summary) {
  const Job& job = plan.job;
  if (!plan.images || plan.undecided) return {};
  const auto space = free_space(job.output);
  const std::uint64_t freed = bytes_there(job);
  if (!job.dry_run && (!space || space->bytes + freed >= space_bound(plan))) return {};
  const SpaceNeed need = estimate_space(plan);
  Json estimate{{"bytes", need.bytes}, {"layers_sampled", need.sampled}};
  std::string text = fmt::format("about {}, by {} of {} layers", readable_bytes(need.bytes), need.sampled,
                                 readable_count(plan.range[1] - plan.range[0]));
  if (space) {
    estimate["free_bytes"] = space->bytes;
    text += fmt::format("; {} free in {}", readable_bytes(space->bytes), one_line(space->folder));
  }
  if (job.dry_run) {
    summary.facts["files_estimate"] = estimate;
    summary.estimate_text = text;
  }
  return space ? check_space(need, *space, freed, job.dry_run, summary.warnings) : Status();
}

}  // namespace lamina::pipeline
