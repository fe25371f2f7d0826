// pipeline/output/print_program.h: the print program of a job, one file per layer next to its image.
//
// out/program/machine.toml   the profile with the job's changes
//             start.<ext>    text before the first layer
//             end.<ext>      text after the last layer
//             000000.<ext>   a layer, independent of all others, so that jobs can be resumed, sharded and merged
// The whole program is the concatenation: start, layers in order, end. Of dialects of lamina's own each file is compressed, and
// <ext> ends in .zst, unless the job turns it off.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "pipeline/job/job.h"
#include "pipeline/machine/profiles.h"
#include "pipeline/manifest/manifest.h"
#include "stages/data/layer.h"
#include "stages/data/runs.h"
#include "stages/data/status.h"
#include "stages/program/compile.h"
#include "stages/program/dialect.h"
#include "stages/replay/time/timer.h"
#include "stages/support/io/compressed.h"
#include "stages/support/io/file.h"

namespace lamina::pipeline {

/// Scratch for a layer's program; reused by later layers.
struct ProgramWork {
  program::CompileScratch compile;
  std::unique_ptr<program::ProgramWriter> writer;
  program::ProgramBytes text;
  ContentWriter file;
  std::optional<replay::Timer> timer;

  std::uint64_t bytes() const { return compile.bytes() + bytes_held(text) + file.bytes() + (timer ? timer->bytes() : 0); }
};

/// The end of the names of a dialect's files.
std::string program_extension(const program::Dialect& dialect, bool compress);
/// The file of a layer's program in a job's directory, program/000042.gcode; "" without a machine.
std::string program_file_name(std::uint32_t index, std::string_view extension);

/// The commands before the first layer and after the last one.
struct ProgramFrame {
  program::ProgramBytes start, end;
};
ProgramFrame program_frame(const ResolvedMachine& resolved, std::uint32_t layers);

class PrintProgram {
 public:
  /// directory  of the job, empty to time layers without writing them; the machine must outlive this object
  /// compress   files of dialects that are compressed
  PrintProgram(const ResolvedMachine& resolved, std::string directory, std::uint32_t layers, const FileOptions& files,
               bool compress = false);

  using TakeFile = std::function<Status(const std::string& name, std::span<const std::byte> bytes)>;
  /// Gives away machine.toml and start, or end, as they are stored, with their folder. errors  of `take`; kMemory
  Status give_start(const TakeFile& take) const;
  Status give_end(const TakeFile& take) const;
  /// Writes them into the directory. errors  kOutput
  Status begin() const;

  /// Compiles a layer, times it and writes its file, sweep by sweep. errors  kOutput
  /// feeds   the vats that feed the layer
  /// measures  without a directory: the file is made and dropped
  Status write_layer(const Layer& layer, const RunsView& image, const std::vector<std::uint32_t>& feeds, ProgramWork& work,
                     ProgramRecord& record, bool measures = false) const;

  /// The same of pixels that get the drops of an image. maximum  of any pixel of the job
  struct Drops {
    DropImageView image;
    std::uint32_t maximum = 1;
  };
  Status write_layer(const Layer& layer, const Drops& drops, const std::vector<std::uint32_t>& feeds, ProgramWork& work,
                     ProgramRecord& record, bool measures = false) const;

  bool in_memory = false;              // the files of layers stay in their work, instead of the directory; set first
  std::vector<std::uint32_t> refills;  // layers before which the program pauses for vats to be filled, in order; set first

  /// Upper bound of write_layer's memory, in bytes, for an image with so many changes, or two for each run of a zone.
  std::uint64_t bytes_bound(std::uint64_t changes, std::uint32_t drops = 1) const;
  /// Bytes that the file of a layer hardly exceeds: all sweeps over the whole bed, before it is compressed.
  std::uint64_t file_bound(std::uint32_t drops) const;

 private:
  /// compile(emit)  makes the sweeps
  template <class Compile>
  Status write(const Layer& layer, const std::vector<std::uint32_t>& feeds, ProgramWork& work, ProgramRecord& record,
               bool measures, const Compile& compile) const;
  Status give_content(const std::string& stem, const program::ProgramBytes& content, const TakeFile& take) const;
  /// Of a layer.
  std::uint64_t max_sweeps(std::uint32_t drops) const;
  const ResolvedMachine& resolved_;
  const program::Dialect& dialect_;
  std::string directory_, extension_;
  std::uint32_t layers_;
  FileOptions files_;
  Result<replay::VirtualMachine> machine_;  // computes the time
};

}  // namespace lamina::pipeline
