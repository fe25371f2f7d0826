#include "pipeline/output/job_container.h"

#include <fmt/format.h>

#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <filesystem>

#include "pipeline/job/errors.h"
#include "pipeline/manifest/compare.h"
#include "pipeline/manifest/inspection_file.h"
#include "pipeline/output/directory.h"
#include "pipeline/output/print_program.h"
#include "stages/support/io/file_reader.h"

namespace lamina::pipeline {
namespace {

namespace fs = std::filesystem;

/// The names of the entries up to and with those of these layers, in their order.
std::vector<std::string> names_up_to(const ManifestHead& head, std::span<const LayerRecord> layers,
                                     std::vector<std::size_t>& ends) {
  std::vector<std::string> names;
  if (!head.machine.empty()) names = {"program/machine.toml", "program/start" + head.program_extension};
  for (const LayerRecord& record : layers) {
    for (LayerImageFile& image : layer_images(head, record)) {
      if (!image.name.empty()) names.push_back(std::move(image.name));
    }
    if (!head.machine.empty()) names.push_back(program_file_name(record.layer.index, head.program_extension));
    ends.push_back(names.size());
  }
  return names;
}

/// How many entries, from the first on, have the CRC that unpackers check.
std::size_t count_with_sums(const std::string& container, std::span<const ContainerEntry> entries) {
  std::vector<char> holds(entries.size());
  tbb::parallel_for(std::size_t{0}, entries.size(),
                    [&](std::size_t i) { holds[i] = has_its_sum(container, entries[i]) ? 1 : 0; });
  return static_cast<std::size_t>(std::ranges::find(holds, 0) - holds.begin());
}

/// What of the begun container is kept: layers without a gap from the first on, whose entries come in the order of the job.
Result<KeptContainer> kept_of_begun(const std::string& part, const ManifestHead& head, std::vector<LayerRecord> layers) {
  KeptContainer kept;
  if (layers.empty() || !has_program_frame(part, head, false)) return kept;
  std::size_t count = 0;
  while (count < layers.size() && layers[count].layer.index == head.first_layer + count) ++count;
  layers.resize(count);
  std::uint64_t end = 0;
  auto entries = read_entries(part, &end);
  if (!entries) return entries.error();
  std::vector<std::size_t> ends;
  const std::vector<std::string> names = names_up_to(head, layers, ends);
  std::size_t same = 0;
  while (same < names.size() && same < entries->size() && (*entries)[same].name == names[same]) ++same;
  const std::size_t whole = count_with_sums(part, std::span(*entries).first(same));
  while (!ends.empty() && ends.back() > whole) ends.pop_back();
  if (ends.empty()) return kept;
  layers.resize(ends.size());
  kept.layers = std::move(layers);
  kept.end = ends.back() < entries->size() ? (*entries)[ends.back()].header : end;
  entries->resize(ends.back());
  kept.entries = std::move(*entries);
  return kept;
}

Status check_not_begun(const Job& job) {
  if (job.resume || job.overwrite || !has_manifest_head(part_of(container_manifest(job)))) return {};
  return usage("{}: an interrupted job; continue with --resume, or start over with --overwrite", part_of(job.output));
}

/// Other programs use names in .part too.
Status check_part_is_ours(const Job& job) {
  const std::string part = part_of(job.output);
  if (is_replaceable(part, {}) || begins_like_job(part) || has_manifest_head(part_of(container_manifest(job)))) return {};
  return usage("{}: is no unfinished container of lamina; remove it, or name another file with -o", part);
}

/// A file that is not continued: damaged, or of another kind.
Error no_container(const std::string& path) {
  const auto entries = begins_like_job(path) ? read_entries(path) : Result<std::vector<ContainerEntry>>(Error{});
  if (!entries && !entries.error().message.empty())
    return failure(Fault::kVerification, "{}; make it again with --overwrite, or name another file", entries.error().message);
  return usage("{}: is no container of a job, which --resume continues; name another file with -o", path);
}

}  // namespace

std::string container_manifest(const Job& job) { return job.output + ".json"; }

bool has_program_frame(const std::string& output, const ManifestHead& head, bool end) {
  if (head.machine.empty()) return true;
  const std::string& extension = head.program_extension;
  return fault_of_file(output, "program/machine.toml", head.machine_profile).empty() &&
         fault_of_file(output, "program/start" + extension, head.program_start).empty() &&
         (!end || fault_of_file(output, "program/end" + extension, head.program_end).empty());
}

Status check_container(const Job& job) {
  std::error_code error;
  const fs::file_status status = fs::status(job.output, error);
  if (fs::is_directory(status))
    return Error{Fault::kOutput,
                 fmt::format("{}: is a directory, and --container zip writes one file; name another one with -o", job.output)};
  if (is_stream(job.output))
    return Error{Fault::kOutput, fmt::format("{}: is no file; a container cannot be written to it", job.output)};
  if (const Status made = job.dry_run ? Status() : check_can_write(job.output, true); !made) return made;
  if (Status busy = check_not_being_written(container_manifest(job)); !busy) return busy;
  if (fs::exists(status) && job.resume && !is_container(job.output)) return no_container(job.output);
  if (Status ours = check_part_is_ours(job); !ours) return ours;
  if (job.resume || job.overwrite) return {};
  if (fs::exists(status) && is_container(job.output))
    return usage("{}: a finished job; replace it with --overwrite, check and keep it with --resume, or name another file",
                 job.output);
  if (fs::exists(status)) return usage("{}: is there already; replace it with --overwrite, or name another file", job.output);
  return check_not_begun(job);
}

bool has_whole_entries(const std::string& container) {
  const auto entries = read_entries(container);
  return entries && count_with_sums(container, *entries) == entries->size();
}

Result<Claim> claim_container(const Job& job, MadeFolders& made) {
  const std::string folder = fs::path(job.output).parent_path().string();
  if (!folder.empty()) {
    if (const std::error_code error = made.make(folder)) return write_failure(folder, error.value());
  }
  auto claim = Claim::take(container_manifest(job), job.output);
  if (!claim) return claim.error();
  if (Status status = check_begun_manifest(part_of(container_manifest(job))); !status) return status.error();
  if (Status status = check_not_begun(job); !status) return status.error();
  return claim;
}

Result<KeptContainer> find_kept_container(const Job& job, const ManifestHead& head) {
  const std::string part = part_of(job.output);
  if (is_file(part) && has_manifest_head(part_of(container_manifest(job)))) {
    auto layers = layers_that_hold(part, container_manifest(job), head);
    if (!layers) return layers.error();
    auto kept = kept_of_begun(part, head, std::move(*layers));
    if (kept) kept->replaces = is_container(job.output);
    return kept;
  }
  KeptContainer kept;
  if (!is_file(job.output)) return kept;
  if (!is_file(job.output + "/" + manifest_name(job)))
    return usage("{}: contains no {} of this job; name another file with -o, or replace it with --overwrite", job.output,
                 manifest_name(job));
  kept.replaces = true;
  auto layers = layers_that_hold(job.output, job.output + "/" + manifest_name(job), head);
  if (!layers) return layers.error();
  const auto entries = read_entries(job.output);
  if (!entries) return entries.error();
  kept.finished = layers->size() == head.last_layer - head.first_layer && has_program_frame(job.output, head, true) &&
                  count_with_sums(job.output, *entries) == entries->size() &&
                  (!job.inspect || read_inspection(job.output, head));
  if (kept.finished) kept.layers = std::move(*layers);
  return kept;
}

Result<JobContainer> JobContainer::open(const Job& job, const KeptContainer& kept) {
  FileOptions how{.keep_part = true, .replace = kept.replaces || job.overwrite};
  if (job.sync == Sync::kOff) how.durable = Durable::kNo;
  auto file = kept.entries.empty() ? File::open(job.output, how) : File::reopen(job.output, kept.end, how);
  if (!file) return file.error();
  JobContainer container(std::move(*file));
  for (std::size_t i = 0; i < kept.entries.size(); ++i)
    container.zip_.keep(kept.entries[i], i + 1 < kept.entries.size() ? kept.entries[i + 1].header : kept.end);
  return container;
}

Status JobContainer::add(std::string_view name, std::span<const std::byte> bytes, std::uint32_t crc) {
  return zip_.store(name, bytes, crc);
}

Status JobContainer::flush(bool synced) { return synced ? file_->sync() : file_->flush(); }

Status JobContainer::finish(std::string_view inspection, std::string_view manifest, const std::string& manifest_path) {
  const auto add_text = [&](std::string_view name, std::string_view text) { return add(name, std::as_bytes(std::span(text))); };
  const auto text = read_file(manifest_path, {});
  if (!text) return text.error();
  Status status = inspection.empty() ? Status() : add_text("inspection.json", inspection);
  if (status) status = add_text(manifest, *text);
  if (status) status = zip_.finish();
  if (!status) return status;
  const auto written = file_->finish();
  return written ? Status() : Status(written.error());
}

void JobContainer::discard() { file_->discard(); }

}  // namespace lamina::pipeline
