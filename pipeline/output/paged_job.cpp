#include "pipeline/output/paged_job.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <utility>

#include "pipeline/job/errors.h"
#include "pipeline/manifest/layer_files.h"
#include "pipeline/output/directory.h"
#include "pipeline/output/job_container.h"
#include "stages/support/io/file_reader.h"

namespace lamina::pipeline {
namespace {

namespace fs = std::filesystem;

std::string pages_file(const Job& job) { return fmt::format("{}/{}", job.output, kPagesFile); }
std::string program_file(const Job& job, const ManifestHead& head) {
  return fmt::format("{}/program{}", job.output, head.program_extension);
}

/// Keeps the first layers whose pages are those that the job writes, in their order.
void keep_pages(const ManifestHead& head, const PageList& found, const FileReader& file, const std::vector<LayerRecord>& layers,
                KeptPages& kept) {
  std::size_t next = 0;
  for (const LayerRecord& record : layers) {
    if (record.layer.index != head.first_layer + kept.layers.size()) return;
    std::string program = program_file_name(record.layer.index, head.program_extension);
    std::uint64_t program_end = kept.program_end;
    for (const LayerImageFile& image : layer_images(head, record)) {
      if (next == found.pages.size()) return;
      const JobPage& page = found.pages[next++];
      const PageContent& content = page.content;
      if (content.name != image.name || content.program != program) return;
      if (!formats::tiff::fault_of_page(file, page, found.big).empty()) return;
      if (!program.empty() && kept.last && content.program_offset != program_end) return;
      if (!program.empty()) program_end = content.program_offset + content.program_bytes;
      program.clear();  // the first image names it
    }
    if (next == 0) return;  // a layer without images
    kept.program_end = program_end;
    kept.last = found.pages[next - 1];
    kept.layers.push_back(record);
  }
}

/// Gives a finished file, which is the one that was checked, the name of an unfinished one, also if that is there.
/// errors  kOutput
Status reopen_name(const std::string& file) {
  if (!is_file(file)) return {};
  return std::rename(file.c_str(), part_of(file).c_str()) == 0 ? Status() : Status(write_failure(file, errno));
}

/// A run leaves one of both names, and the other one is not of the job. errors  kUsage
Status check_one_name(const std::string& directory) {
  for (const std::string& name : names_in_folder(directory)) {
    if (name != kPagesFile && !name.starts_with("program.")) continue;
    const std::string file = fmt::format("{}/{}", directory, name);
    std::error_code error;
    if (fs::exists(fs::symlink_status(part_of(file), error)))
      return usage("{} and {} are both there; remove the one that is not of this job", file, part_of(file));
  }
  return {};
}

/// Before anything changes. errors  kOutput
Status check_no_links(const std::string& file) {
  for (const std::string& name : {file, part_of(file)}) {
    std::error_code error;
    if (fs::is_symlink(fs::symlink_status(name, error)))
      return failure(Fault::kOutput, "{}: is a link, and its file would be changed; put the file in its place", name);
  }
  return {};
}

}  // namespace

Status check_kind_of_output(const Job& job) {
  if (const std::string machine = job.output + "/machine.toml";
      job.container == Container::kTiff && same_file(job.machine.profile, machine))
    return usage("{}: is read by this call as the machine profile, and would be replaced; name another directory", machine);
  if (job.overwrite) return {};
  constexpr std::string_view kAdvice = "replace it with --overwrite, or name another directory";
  const std::string pages = pages_path(job.output);
  if (job.container != Container::kTiff) {
    if (pages.empty()) return {};
    return usage("{}: is of a job with --container tiff; continue it with that option, {}", pages, kAdvice);
  }
  for (const char* folder : {"layers", "program"}) {
    std::error_code error;
    if (fs::exists(fs::symlink_status(fmt::format("{}/{}", job.output, folder), error)))
      return usage("{}/{}: is there already, which --container tiff does not write; {}", job.output, folder, kAdvice);
  }
  if (job.resume && !pages.empty()) return check_one_name(job.output);
  for (const std::string& name : names_in_folder(job.output)) {
    const bool of_program = !job.machine.profile.empty() && (name == "machine.toml" || name.starts_with("program."));
    if (name == kPagesFile || of_program) return usage("{}/{}: is there already; {}", job.output, name, kAdvice);
  }
  return {};
}

Result<Claim> claim_paged_output(const Job& job, MadeFolders& made) {
  auto claim = claim_output(job, made);
  if (!claim) return claim.error();
  remove_leftovers(job.output, [](std::string_view name) { return name.starts_with("inspection"); });
  if (!job.overwrite) {
    const Status status = check_kind_of_output(job);
    return status ? std::move(claim) : status.error();
  }
  if (Status status = remove_manifests(job); !status) return status.error();
  if (Status status = check_stays_inside(job.output); !status) return status.error();
  if (Status status = remove_layers(job.output); !status) return status.error();
  for (const char* folder : {"layers", "program"}) {
    const fs::path path = fs::path(job.output) / folder;
    std::error_code error;
    fs::remove(path, error);  // fails if other files remain
    if (fs::exists(fs::symlink_status(path, error)))
      return usage("{}: has files of no job, and would hide the pages of this one; remove it, or name another directory",
                   path.string());
  }
  return claim;
}

Result<KeptPages> find_kept_pages(const Job& job, const ManifestHead& head, bool big) {
  KeptPages kept;
  const std::string manifest = job.output + "/" + manifest_name(job);
  auto layers = layers_that_hold(job.output, manifest, head);
  if (!layers) return layers.error();
  const std::string path = pages_path(job.output);
  if (layers->empty() || path.empty() || !has_program_frame(job.output, head, false)) return kept;
  const auto pages = read_pages(path);
  const auto file = FileReader::open(path, {});
  if (!pages || !file || pages->big != big) return kept;
  keep_pages(head, *pages, *file, *layers, kept);
  kept.finished = kept.layers.size() == head.last_layer - head.first_layer && is_file(manifest) && path == pages_file(job) &&
                  has_program_frame(job.output, head, true) && formats::tiff::fault_of_pages(path).empty();
  for (const std::string& name : {pages_file(job), program_file(job, head)}) {
    if (Status status = kept.last && !kept.finished ? check_no_links(name) : Status(); !status) return status.error();
  }
  return kept;
}

Result<PagedJob> PagedJob::open(const Job& job, const ManifestHead& head, bool big, const KeptPages& kept,
                                const PrintProgram* program) {
  FileOptions how{.keep_part = true, .follow = false, .replace = job.resume || job.overwrite};
  if (job.sync == Sync::kOff) how.durable = Durable::kNo;
  // The record of an earlier run, which the begun one replaces, goes before its files do.
  std::error_code error;
  fs::remove(job.output + "/" + manifest_name(job), error);
  Status status = error ? Status(write_failure(job.output, error.value())) : Status();
  if (status && !kept.last) status = remove_layers(job.output);
  if (status && kept.last) status = reopen_name(pages_file(job));
  if (status && kept.last && program != nullptr) status = reopen_name(program_file(job, head));
  if (!status) return status.error();
  auto pages = kept.last ? File::reopen(pages_file(job), kept.last->end(), how) : File::open(pages_file(job), how);
  if (!pages) return pages.error();
  PagedJob paged(job.output, std::move(*pages), big);
  if (kept.last) status = paged.writer_.keep(*kept.last);
  if (!status || program == nullptr) return status ? Result<PagedJob>(std::move(paged)) : status.error();
  auto file =
      kept.last ? File::reopen(program_file(job, head), kept.program_end, how) : File::open(program_file(job, head), how);
  if (!file) return file.error();
  paged.program_.emplace(std::move(*file));
  if (kept.last) return paged;
  status = program->give_start([&](const std::string& name, std::span<const std::byte> bytes) {
    return name == "program/machine.toml"
               ? write_file(job.output + "/machine.toml", bytes, {.follow = false, .durable = how.durable})
               : paged.program_->append(bytes);
  });
  return status ? Result<PagedJob>(std::move(paged)) : status.error();
}

Status PagedJob::add(std::span<const StoredFile> files, bool synced) {
  const StoredFile* program = program_ ? &files.back() : nullptr;
  for (const StoredFile& file : files) {
    if (&file == program) break;
    PageContent content{file.name, {}, file.bytes.size()};
    if (program != nullptr && &file == &files.front()) {
      content.program = program->name;
      content.program_offset = program_->size();
      content.program_bytes = program->bytes.size();
    }
    if (Status status = writer_.add(content, file.bytes); !status) return status;
  }
  Status status = pages_->flush();
  if (status && synced) status = pages_->sync();
  if (!status || program == nullptr) return status;
  status = program_->append(program->bytes);
  if (status) status = program_->flush();
  return status && synced ? program_->sync() : status;
}

Status PagedJob::finish(const PrintProgram* program) {
  Status status = writer_.finish();
  if (status && program != nullptr)
    status = program->give_end([&](const std::string&, std::span<const std::byte> bytes) { return program_->append(bytes); });
  if (!status) return status;
  if (program_) {
    const auto written = program_->finish();
    if (!written) return written.error();
  }
  const auto written = pages_->finish();
  return written ? Status() : Status(written.error());
}

void PagedJob::discard() {
  pages_->discard();
  if (!program_) return;
  program_->discard();
  remove_or_note(directory_ + "/machine.toml");
}

}  // namespace lamina::pipeline
