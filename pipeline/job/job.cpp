#include "pipeline/job/job.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>

#include "pipeline/job/errors.h"
#include "pipeline/job/keys.h"
#include "stages/formats/image_format.h"
#include "stages/geometry/isa.h"
#include "stages/heights/heights.h"
#include "stages/support/io/file.h"
#include "stages/support/text/readable.h"

namespace lamina::pipeline {

namespace {

/// errors  kUsage: a bleed that shrinks along one axis and grows along the other; a part's dose without the job's
Status check_dose(const Job& job) {
  const DoseRequest& dose = job.dose;
  const auto check_signs = [](std::string_view key, const std::optional<std::array<double, 2>>& um) -> Status {
    if (!um || (*um)[0] * (*um)[1] >= 0) return {};
    return usage("{}: an edge moves inwards along both axes, or outwards (negative) along both; give two numbers of one sign",
                 key);
  };
  for (const auto& [key, um] : {std::pair{"dose.bleed_um", std::optional(dose.bleed_um)},
                                {"dose.hole_bleed_um", dose.hole_bleed_um},
                                {"dose.first_bleed_um", dose.first_bleed_um}}) {
    if (Status status = check_signs(key, um); !status) return status;
  }
  for (const PartRequest& part : job.parts) {
    if (Status status = check_signs("part.bleed_um", part.bleed_um); !status) return status;
    if (Status status = check_signs("part.hole_bleed_um", part.hole_bleed_um); !status) return status;
    if (part.core_saturation_percent && !part.saturation_percent)
      return usage("part.core_saturation_percent: changes a part.saturation_percent that is missing; add it");
    if (part.core_saturation_percent && dose.shell_mm == 0)
      return usage("part.core_saturation_percent: is of what lies inside of a shell; add --shell");
    if (part.saturation_percent && !dose.saturation_percent)
      return usage("part.saturation_percent: there is no saturation to change; add --saturation");
  }
  return {};
}

}  // namespace

std::vector<std::array<double, 2>> bleeds_of(const Job& job) {
  std::vector<std::array<double, 2>> all{job.dose.bleed_um};
  const auto add = [&](const std::optional<std::array<double, 2>>& um) {
    if (um) all.push_back(*um);
  };
  add(job.dose.hole_bleed_um);
  add(job.dose.first_bleed_um);
  for (const PartRequest& part : job.parts) add(part.bleed_um), add(part.hole_bleed_um);
  return all;
}

Status check_job(const Job& job) {
  if (job.parts.empty()) return usage("no part to plan; name one or more STL, OBJ or 3MF files");
  for (const JobKey& key : job_keys()) {
    if (const std::string wrong = key.check(job); !wrong.empty()) return usage("{}.{}: {}", key.section, key.name, wrong);
  }
  for (const PartRequest& part : job.parts) {
    for (const PartKey& key : part_keys()) {
      if (const std::string wrong = key.check(part); !wrong.empty())
        return usage("{}: {}.{}: {}", part.path, key.section, key.name, wrong);
    }
  }
  if (const auto options = heights_options(job); !options) return options.error();
  if (const auto isa = usable_isa(job.isa); !isa) return isa.error();
  const DoseRequest& dose = job.dose;
  if (!dose.saturation_percent && (dose.core_saturation_percent || !dose.saturation_ranges.empty())) {
    return usage("dose.{}: there is no saturation to change; add --saturation",
                 dose.core_saturation_percent ? "core_saturation_percent" : "saturation_range");
  }
  if (dose.core_saturation_percent && dose.shell_mm == 0)
    return usage("dose.core_saturation_percent: is of what lies inside of a shell; add --shell");
  if (Status status = check_dose(job); !status) return status;
  if (dose.saturation_percent && dose.core < 1)
    return usage("dose.core: a share of the pixels and --saturation exclude each other; use --core-saturation");
  if (job.layers && job.shard) return usage("--layers and --shard exclude each other; a shard is a share of all layers");
  if (job.resume && job.overwrite)
    return usage("--resume and --overwrite exclude each other; --resume keeps what --overwrite replaces");
  if (job.container != Container::kNone) {
    if ((job.layers || job.shard) && job.inspect)
      return usage(
          "--container: sections that --inspect keeps of some layers need a directory; inspect all layers, or remove it");
    if (job.container == Container::kTiff && job.shard)
      return usage("--shard: shards of one directory exclude --container tiff; name layers by --layers, or use zip");
    if (const auto extension = formats::extension_of(job.format);
        job.container == Container::kTiff && extension && *extension != ".tif")
      return usage("--format {}: --container tiff needs images in TIFF files; use tiff-g4, or --container zip", job.format);
    if (job.container == Container::kZip && !job.output.empty() && !names_container(job.output))
      return usage("-o {}: a container is a ZIP file; end its name with .zip", job.output);
  }
  if (job.output.empty() && !job.dry_run)
    return usage("-o DIR is missing; name the directory for the layers, or use --dry-run");
  return {};
}

bool names_container(std::string_view path) {
  constexpr std::size_t kBytes = 4;
  return path.size() >= kBytes && lower_case(std::string(path.substr(path.size() - kBytes))) == ".zip";
}

std::string output_of(std::string output, Container container) {
  if (container != Container::kZip || is_stream(output)) return output;
  while (output.size() > 1 && output.ends_with('/')) output.pop_back();
  const std::string name = std::filesystem::path(output).filename().string();
  if (name.empty() || name == "." || name == ".." || names_container(output)) return output;
  return output += ".zip";
}

Result<heights::Options> heights_options(const Job& job) { return heights::options_of(job.heights, job.layer_mm); }

double tolerance_um_of(const Job& job, Product product) {
  return job.slice.tolerance_um.value_or(product == Product::kMoves ? 10 : 0);
}

bool fills(const Job& job) {
  if (job.segment.any()) return true;
  return std::ranges::any_of(job.parts, [&](const PartRequest& part) {
    FillSettings own = job.fill.all;
    apply(part.fill, own);
    return fills(own) || std::ranges::any_of(job.fill.ranges, [&](const FillRange& range) {
             FillSettings there = own;
             apply(range.changes, there);
             return fills(there);
           });
  });
}

bool drops_follow_image(const Job& job) {
  const auto is_formula = [](const std::optional<Saturation>& target) { return target && !target->formula.empty(); };
  const DoseRequest& dose = job.dose;
  if (job.levels > 0 || is_formula(dose.saturation_percent) || is_formula(dose.core_saturation_percent)) return false;
  const bool plain = std::ranges::none_of(dose.saturation_ranges, [&](const SaturationRange& range) {
    return is_formula(range.percent) || is_formula(range.core_percent);
  });
  return plain && std::ranges::all_of(job.parts, [&](const PartRequest& part) {
           return part.material == job.parts.front().material && part.material_ranges.empty() && !part.bleed_um &&
                  !part.hole_bleed_um && !part.saturation_percent;
         });
}

bool thins(const Job& job) { return fills(job) || job.dose.core < 1 || job.dose.saturation_percent || job.levels > 0; }

Result<std::array<std::uint32_t, 2>> layer_range(const Job& job, std::uint32_t layer_count) {
  if (job.shard) {
    const auto [index, of] = *job.shard;
    const auto share = [&, shards = of](std::uint64_t i) { return static_cast<std::uint32_t>(layer_count * i / shards); };
    return std::array<std::uint32_t, 2>{share(index), share(std::uint64_t{index} + 1)};
  }
  if (!job.layers) return std::array<std::uint32_t, 2>{0, layer_count};
  if ((*job.layers)[0] >= layer_count) {
    return usage("--layers {}:: the job has {} layers, 0 to {}; begin below that", (*job.layers)[0], layer_count,
                 layer_count - 1);
  }
  return std::array<std::uint32_t, 2>{(*job.layers)[0], std::min((*job.layers)[1], layer_count)};
}

}  // namespace lamina::pipeline
