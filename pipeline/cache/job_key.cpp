#include "pipeline/cache/job_key.h"

#include <fmt/format.h>
#include <link.h>

#include <cstddef>
#include <cstring>
#include <filesystem>
#include <span>

#include "pipeline/job/file.h"
#include "pipeline/job/profiles/extruder.h"
#include "pipeline/job/profiles/printer.h"
#include "stages/load/load.h"
#include "stages/support/io/file.h"
#include "stages/support/text/version.h"

namespace lamina::pipeline {
namespace {

/// The identifier that the linker gave this program, in hexadecimal digits; empty without one. cost  no system call
std::string build_id() {
  std::string id;
  const auto take = [](dl_phdr_info* object, std::size_t, void* to) {
    for (std::size_t i = 0; i < object->dlpi_phnum; ++i) {
      const auto& segment = object->dlpi_phdr[i];
      if (segment.p_type != PT_NOTE) continue;
      const char* note = reinterpret_cast<const char*>(object->dlpi_addr + segment.p_vaddr);
      const char* const end = note + segment.p_memsz;
      const auto padded = [](std::size_t bytes) { return (bytes + 3) / 4 * 4; };
      while (end - note >= static_cast<std::ptrdiff_t>(sizeof(ElfW(Nhdr)))) {
        ElfW(Nhdr) head;
        std::memcpy(&head, note, sizeof head);
        const char* const name = note + sizeof head;
        const char* const text = name + padded(head.n_namesz);
        if (head.n_type == NT_GNU_BUILD_ID && head.n_namesz == 4 && std::memcmp(name, "GNU", 4) == 0) {
          for (std::size_t b = 0; b < head.n_descsz; ++b) {
            *static_cast<std::string*>(to) += fmt::format("{:02x}", static_cast<unsigned char>(text[b]));
          }
          return 1;
        }
        note = text + padded(head.n_descsz);
      }
    }
    return 1;  // the first object is the program
  };
  ::dl_iterate_phdr(take, &id);
  return id;
}

/// Why a job is not cached; empty if it is.
std::string why_not(const Resolved& resolved) {
  const Job& job = resolved.job;
  if (job.dry_run) return "a dry run has no files";
  if (job.timing) return "--timing measures a run";
  if (job.engine == Engine::kBoth) return "the engines are compared";
  if (job.shard) return "it is a shard";
  if (job.inspect) return "--inspect adds a file";
  if (job.quote) return "--quote adds a table";
  if (resolved.product == Product::kContours) return "contours are not cached";
  if (resolved.product == Product::kMoves && resolved.extruder->machine.format == "sml") return "SML has a second file";
  if (resolved.product == Product::kMoves && is_stream(job.output)) return "the output is a stream";
  if (job.container != Container::kNone) return "its files are in a container";
  for (const PartRequest& part : job.parts) {
    if (!load::is_part_name(part.path)) return part.path + " is not an STL, OBJ or 3MF file";
  }
  return {};
}

/// The extension that decides how a part is read.
std::string ending_of(const std::filesystem::path& path) {
  const std::string last = path.extension().string();
  return path.stem().extension().string() + last;
}

/// Names in the files of a product.
std::string names_in_files(const Resolved& resolved) {
  std::string text;
  if (resolved.product == Product::kImages) return text;
  for (const PartRequest& part : resolved.job.parts) {
    const std::string& name = part.path;
    text += fmt::format("{}:{}\n", name.size(), name);
  }
  return text;
}

/// The job without what decides neither its files nor its summary. Profiles go: their texts are in the key.
Job lasting_job(const Resolved& resolved) {
  const Job plain;
  Job job = resolved.job;
  for (std::size_t i = 0; i < job.parts.size(); ++i) job.parts[i].path = fmt::format("{}{}", i, ending_of(job.parts[i].path));
  job.machine.profile.clear();
  job.machine.presets.clear();
  job.extrude.material.clear();
  job.output.clear();
  job.engine = plain.engine;
  job.isa = plain.isa;
  job.threads = plain.threads;
  job.memory_bytes = plain.memory_bytes;
  job.sync = plain.sync;
  job.strict = false;  // a job with warnings takes nothing from the cache then
  return job;
}

std::string machine_text(const Resolved& resolved) {
  if (resolved.extruder) return extruder_text(*resolved.extruder);
  if (!resolved.printer || !resolved.printer->machine) return {};
  return kept_machine_text(resolved.printer->machine->machine);
}

}  // namespace

JobKey128 job_key(const Resolved& resolved, InputDigests& inputs) {
  if (std::string reason = why_not(resolved); !reason.empty()) return {{}, std::move(reason)};
  static const std::string program = fmt::format("lamina {} {}", version(), build_id());
  const std::string machine = machine_text(resolved);
  std::string text =
      fmt::format("{}\n{} {}\n{}{}:{}", program, static_cast<int>(resolved.product),
                  static_cast<int>(resolved.job.image_content), names_in_files(resolved), machine.size(), machine);
  for (const PartRequest& part : resolved.job.parts) {
    const Result<FileDigest> digest = inputs.of(part.path);
    if (!digest) return {{}, digest.error().message};
    text += fmt::format("{} {}\n", digest->bytes, hex(digest->hash));
  }
  for (const std::string& name : resolved.job.named) {
    if (!name.starts_with("run.")) text += name + "\n";
  }
  text += job_text(lasting_job(resolved), "");
  return {hash_text(text), {}};
}

}  // namespace lamina::pipeline
