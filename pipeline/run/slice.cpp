#include "pipeline/run/slice.h"
#include "pipeline/flow/progress.h"
#include "pipeline/text/version.h"

#include <fmt/format.h>
#include <tbb/global_control.h>

#include <chrono>
#include <cmath>
#include <filesystem>
#include <optional>

#include "pipeline/flow/layer_flow.h"
#include "pipeline/job/file.h"
#include "pipeline/job/keys.h"
#include "pipeline/output/manifest.h"
#include "pipeline/output/slice_directory.h"
#include "pipeline/text/json_text.h"
#include "pipeline/text/number_text.h"
#include "stages/data/hash.h"
#include "stages/write/file.h"
#include "stages/write/slice3mf/slice3mf.h"
#include "stages/write/slice_format.h"

namespace lamina::pipeline {
namespace {

namespace fs = std::filesystem;
using Clock = std::chrono::steady_clock;
double seconds_since(Clock::time_point start) { return std::chrono::duration<double>(Clock::now() - start).count(); }

double length_mm(const ToolpathsView& paths) {
  double sum = 0;
  for (std::uint32_t p = 0; p < paths.size(); ++p) {
    for (std::uint32_t i = paths.offset[p]; i + 1 < paths.offset[p + 1]; ++i) {
      const Point2 a = paths.point[i], b = paths.point[i + 1];
      sum += std::hypot(static_cast<double>(b.x) - a.x, static_cast<double>(b.y) - a.y);
    }
  }
  return sum * 1e-6;
}

/// The job, with the sections that contours depend on.
std::string job_of_manifest(const Job& job) {
  std::string text = canonical_job_text(job);
  for (const auto& [section, keys] : {std::pair{"slice", slice_keys()}, {"fill", fill_keys()}}) {
    text += fmt::format("\n[{}]\n", section);
    for (const JobKey& key : keys) {
      const std::string value = key.write(job);
      if (!value.empty()) text += fmt::format("{} = {}\n", key.name, json_string(value));
    }
  }
  return text;
}

/// manifest.json of a sliced job: one line a layer; where its bytes are, and their hash.
class SliceManifest {
 public:
  static Result<SliceManifest> open(const std::string& path, const std::string& head) {
    auto file = write::File::open(path);
    if (!file) return file.error();
    if (auto status = file->append(head); !status) return status.error();
    return SliceManifest(std::move(*file));
  }
  Status append(const std::string& line) {
    const std::string text = fmt::format("{}\n    {}", first_ ? "" : ",", line);
    first_ = false;
    return file_.append(text);
  }
  /// rest  keys after the layers: ",\n  \"key\": value"
  Status finish(const std::string& rest) {
    if (auto status = file_.append("\n  ]" + rest + "\n}\n"); !status) return status;
    const auto done = file_.finish();
    return done ? Status() : Status(done.error());
  }

 private:
  explicit SliceManifest(write::File file) : file_(std::move(file)) {}
  write::File file_;
  bool first_ = true;
};

}  // namespace

Result<SliceSummary> run_slice(const Job& job, const ProgressCallback& progress, const std::atomic<bool>& cancel) {
  std::optional<tbb::global_control> threads;
  if (job.threads > 0) threads.emplace(tbb::global_control::max_allowed_parallelism, job.threads);
  if (job.slice.format == "3mf" && job.slice.file_a_layer) {
    return Error{Fault::kUsage, "--file-a-layer: a 3MF package holds all slices; choose svg or cli, or leave it out"};
  }
  if (job.heights.per_part) {
    return Error{Fault::kUsage, "--per-part: a file of slices has one table of layers for all parts; leave it out"};
  }
  if (job.shard) return Error{Fault::kUsage, fmt::format("run.shard: {}", kNoShards)};
  const auto plan = SlicePlan::make(job, progress);
  if (!plan) return plan.error();
  if (cancel) return Error{Fault::kInterrupted, "interrupted before the first layer; nothing was written"};
  const auto range = layer_range(job, static_cast<std::uint32_t>(plan->layers().size()));
  if (!range) return range.error();
  const auto [first, last] = *range;

  SliceSummary summary;
  summary.layers_total = static_cast<std::uint32_t>(plan->layers().size());
  summary.parts = plan->scene().parts;
  summary.load_seconds = plan->load_seconds;
  summary.index_seconds = plan->index_seconds;
  summary.index_bytes = plan->slicer().index_bytes();
  for (const Instance& instance : plan->scene().instances) {
    summary.triangles += plan->scene().meshes[instance.mesh].triangles.size();
  }
  summary.output = job.slice.format == "null" ? job.output
                   : job.slice.file_a_layer   ? job.output + "/layers"
                                              : job.output + "/" + slice_file_name(job);
  if (job.dry_run) {
    for (std::uint32_t i = first; i < last; ++i) {
      summary.peak_layer_bytes = std::max(summary.peak_layer_bytes, plan->bytes_bound(i));
    }
    summary.peak_resident_bytes = peak_resident_bytes();
    return summary;
  }
  if (Status status = prepare_slice_directory(job); !status) return status.error();
  const WaitingLayers waiting(job);

  // --- what is written
  write::SliceHead head;
  head.parts = plan->names();
  head.bounds = plan->bounds();
  head.layers = last - first;
  head.first_bottom = first < last ? plan->layers()[first].layer.bottom : 0;
  head.program = fmt::format("lamina {}", version());
  write::SliceFormatOptions format_options;
  format_options.empty_first_layer = job.slice.empty_first_layer;
  std::unique_ptr<write::SliceEncoder> encoder;
  std::optional<write::Slice3mfWriter> package;
  if (job.slice.format == "3mf") {
    auto made = write::Slice3mfWriter::make(head);
    if (!made) return made.error();
    package.emplace(std::move(*made));
  } else if (job.slice.format != "null") {
    encoder = job.slice.format == "svg" ? write::make_svg_encoder()
                                        : write::make_cli_encoder(job.slice.format == "cli-binary", format_options);
  }
  std::optional<write::File> file;
  Buffer<char> ends;  // what stands before the first layer and behind the last
  if (encoder && !job.slice.file_a_layer) {
    auto opened = write::File::open(summary.output);
    if (!opened) return opened.error();
    file.emplace(std::move(*opened));
    encoder->head(head, ends);
    if (Status status = file->append(ends); !status) return status.error();
  }
  auto manifest = SliceManifest::open(
      job.output + "/manifest.json",
      fmt::format("{{\n  \"lamina\": {},\n  \"kind\": \"slice\",\n  \"job\": {},\n  \"format\": {},\n  \"file\": {},\n"
                  "  \"layer_count\": {},\n  \"first_layer\": {},\n  \"last_layer\": {},\n  \"layers\": [",
                  json_string(version()), json_string(job_of_manifest(job)), json_string(job.slice.format),
                  job.slice.file_a_layer || job.slice.format == "null" ? "null" : json_string(slice_file_name(job)),
                  summary.layers_total, first, last));
  if (!manifest) return manifest.error();

  // --- layers
  std::atomic<std::int64_t> slice_ns{0}, encode_ns{0};
  const auto timed = [](std::atomic<std::int64_t>& sum, Clock::time_point from) {
    sum += std::chrono::duration_cast<std::chrono::nanoseconds>(Clock::now() - from).count();
  };
  const auto view_of = [&](std::uint32_t index, const SlicePlan::Work& work) {
    return write::SliceLayer{plan->layers()[index].layer, work.contours.contours, work.contours.body, work.paths,
                             work.path_body};
  };
  const auto prepare = [&](std::uint32_t i, SlicePlan::Work& work) -> Result<std::uint64_t> {
    // Two numbers of some 11 characters and what divides them. An element of SVG names kind, colour and width, one of CLI
    // its part and count; both repeat the point that they share with the element before.
    const SlicePlan::TextBytes text = !encoder                           ? SlicePlan::TextBytes{}
                                      : job.slice.format == "svg"        ? SlicePlan::TextBytes{26, 200, 0}
                                      : job.slice.format == "cli-binary" ? SlicePlan::TextBytes{16, 24, 0}
                                                                         : SlicePlan::TextBytes{48, 64, 0};
    const auto from = Clock::now();
    if (Status status = plan->contours(first + i, work); !status) return status.error();
    auto more = plan->fill_bytes_bound(first + i, work, text);
    timed(slice_ns, from);
    return more;
  };
  const auto expand = [&](std::uint32_t i, SlicePlan::Work& work) -> Result<std::uint64_t> {
    auto from = Clock::now();
    if (Status status = plan->fill(first + i, work); !status) return status.error();
    timed(slice_ns, from);
    work.text.clear();
    if (!encoder) return work.bytes();
    from = Clock::now();
    const write::SliceLayer layer = view_of(first + i, work);
    if (job.slice.file_a_layer) {
      write::encode_alone(*encoder, head, layer, work.text);
    } else {
      encoder->layer(head, layer, work.text);
    }
    timed(encode_ns, from);
    if (job.slice.file_a_layer) {
      const std::string name = waiting_layers(job) / fmt::format("{:06}{}", first + i, slice_extension(job));
      if (Status status = write::write_file(name, std::as_bytes(std::span(work.text)), {.lock = false}); !status)
        return status.error();
    }
    return work.bytes();
  };
  std::string first_open, first_emptied;
  std::uint32_t done = 0;
  const auto record = [&](std::uint32_t i, SlicePlan::Work& work) -> Status {
    const Layer& layer = plan->layers()[first + i].layer;
    const double area = square_mm(doubled_area(work.contours.contours));
    std::string where;
    if (package) {
      if (Status status = package->add(view_of(first + i, work)); !status) return status;
    } else if (encoder) {
      where = fmt::format(",\"offset\":{},\"bytes\":{},\"xxh3_128\":\"{}\"", file ? file->size() : 0, work.text.size(),
                          hex(hash_bytes(std::as_bytes(std::span(work.text)))));
      summary.bytes_written += work.text.size();
      if (file) {
        if (Status status = file->append(work.text); !status) return status;
      }
    }
    summary.cuts += work.report.cuts;
    summary.contours += work.contours.contours.size();
    summary.points += work.contours.contours.point.size();
    summary.paths += work.paths.size();
    summary.united_layers += work.report.united > 0 ? 1 : 0;
    summary.gaps_closed += work.report.gaps.closed;
    summary.largest_gap_mm = std::max(summary.largest_gap_mm, mm(work.report.gaps.largest_closed));
    if (job.slice.offset_mm < 0 && work.report.cuts > 0 && work.contours.contours.size() == 0 && work.report.gaps.open == 0) {
      if (++summary.emptied_layers == 1) first_emptied = fmt::format("layer {} at z {:.3f} mm", layer.index, mm(layer.plane()));
    }
    if (work.report.gaps.open > 0 && summary.open_chains == 0) {
      first_open = fmt::format("in layer {} at z {:.3f} mm", layer.index, mm(layer.plane()));
    }
    summary.open_chains += work.report.gaps.open;
    summary.volume_mm3 += area * mm(layer.thickness);
    summary.bead_mm += length_mm(work.paths);
    progress({ProgressEvent::Stage::kLayers, ++done, last - first});
    return manifest->append(fmt::format(
        "{{\"layer\":{},\"bottom_nm\":{},\"thickness_nm\":{},\"contours\":{},\"points\":{},\"area_mm2\":{:.9f},"
        "\"paths\":{},\"united\":{},\"open\":{}{}}}",
        layer.index, layer.bottom, layer.thickness, work.contours.contours.size(), work.contours.contours.point.size(), area,
        work.paths.size(), work.report.united, work.report.gaps.open, where));
  };
  FlowLimits limits;
  limits.budget_bytes = job.memory_bytes;
  limits.most_in_flight =
      4 * static_cast<std::uint32_t>(tbb::global_control::active_value(tbb::global_control::max_allowed_parallelism));
  FlowReport flow;
  const auto start = Clock::now();
  const auto bytes_of = [&](std::uint32_t i) { return plan->bytes_bound(first + i); };
  const LayerSteps<SlicePlan::Work> steps{bytes_of, prepare, expand, record};
  if (Status status = flow_layers(last - first, steps, limits, cancel, flow); !status) return status.error();
  std::string rest;
  if (file) {
    Buffer<char> text;
    encoder->tail(head, text);
    if (Status status = file->append(text); !status) return status.error();
    summary.bytes_written = file->size();
    ends.insert(ends.end(), text.begin(), text.end());
    rest = fmt::format(",\n  \"file_bytes\": {},\n  \"ends_xxh3_128\": \"{}\"", file->size(),
                       hex(hash_bytes(std::as_bytes(std::span(ends)))));
  }
  if (package) {
    if (Status status = package->finish(summary.output); !status) return status.error();
    std::error_code ignored;
    summary.bytes_written = fs::file_size(summary.output, ignored);
    const auto digest = digest_file(summary.output);
    if (!digest) return Error{Fault::kOutput, digest.error().message};
    rest = fmt::format(",\n  \"file_bytes\": {},\n  \"file_xxh3_128\": \"{}\"", digest->bytes, hex(digest->hash));
  }
  if (Status status = replace_earlier_slices(job); !status) return status.error();
  if (file) {
    if (const auto written = file->finish(); !written) return written.error();
  }
  // For lamina preview, which plans a layer again: the job without what leaves the bytes alone. Parts whose names a job
  // file cannot hold are sliced all the same.
  Job kept = job;
  kept.threads = 0;
  kept.memory_bytes = Job().memory_bytes;
  kept.output.clear();
  if (Status status = save_job(job.output + "/job.toml", kept); !status && status.error().fault == Fault::kOutput) {
    return status.error();
  }
  if (Status status = manifest->finish(rest); !status) return status.error();
  summary.layers = last - first;
  summary.layer_seconds = seconds_since(start);
  summary.slice_seconds = static_cast<double>(slice_ns) * 1e-9;
  summary.encode_seconds = static_cast<double>(encode_ns) * 1e-9;
  summary.most_in_flight = flow.most_in_flight;
  summary.peak_layer_bytes = flow.most_bytes;
  summary.peak_resident_bytes = peak_resident_bytes();
  if (summary.open_chains > 0) {
    summary.warnings.push_back(fmt::format(
        "{} chains of cuts stay open, first {}: they bound nothing and are left out; leave out --no-repair to close the "
        "parts, or give a longer --bridge",
        summary.open_chains, first_open));
  }
  if (summary.emptied_layers > 0) {
    summary.warnings.push_back(fmt::format(
        "--offset {} leaves nothing of {} of {} layers, first {}: they are thinner than twice that; give a smaller offset",
        number_text(job.slice.offset_mm), summary.emptied_layers, summary.layers, first_emptied));
  }
  return summary;
}

}  // namespace lamina::pipeline
