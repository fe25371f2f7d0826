#include "pipeline/output/print_program.h"

#include <fmt/format.h>

#include <algorithm>

#include "stages/program/binary_program.h"

namespace lamina::pipeline {

std::string program_extension(const program::Dialect& dialect, bool compress) {
  return fmt::format("{}{}", dialect.extension, compress && dialect.compressed() ? kCompressedEnd : "");
}

std::string program_file_name(std::uint32_t index, std::string_view extension) {
  return extension.empty() ? std::string() : fmt::format("program/{:06}{}", index, extension);
}

ProgramFrame program_frame(const ResolvedMachine& resolved, std::uint32_t layers) {
  ProgramFrame frame;
  const auto writer = program::find_dialect(resolved.machine.dialect)->make_writer(resolved.machine, resolved.grid);
  writer->start(layers, frame.start);
  writer->end(frame.end);
  return frame;
}

PrintProgram::PrintProgram(const ResolvedMachine& resolved, std::string directory, std::uint32_t layers,
                           const FileOptions& files, bool compress)
    : resolved_(resolved),
      dialect_(*program::find_dialect(resolved.machine.dialect)),
      directory_(std::move(directory)),
      extension_(program_extension(dialect_, compress)),
      layers_(layers),
      files_(files),
      machine_(replay::VirtualMachine::build(resolved.machine, resolved.grid.image.columns(), resolved.grid.image.rows())) {}

Status PrintProgram::give_content(const std::string& stem, const program::ProgramBytes& content, const TakeFile& take) const {
  ContentWriter writer;
  Status status = writer.open_in_memory(is_compressed(extension_));
  if (status) status = writer.append(content);
  if (!status) return status;
  const auto digest = writer.finish();
  return digest ? take("program/" + stem + extension_, writer.stored()) : Status(digest.error());
}

Status PrintProgram::give_start(const TakeFile& take) const {
  const std::string profile = pipeline::kept_machine_text(resolved_.machine);
  const Status status = take("program/machine.toml", std::as_bytes(std::span(profile)));
  return status ? give_content("start", program_frame(resolved_, layers_).start, take) : status;
}

Status PrintProgram::give_end(const TakeFile& take) const {
  return give_content("end", program_frame(resolved_, layers_).end, take);
}

Status PrintProgram::begin() const {
  const TakeFile write = [&](const std::string& name, std::span<const std::byte> bytes) {
    return write_file(directory_ + "/" + name, bytes, files_);
  };
  const Status status = give_start(write);
  return status ? give_end(write) : status;
}

Status PrintProgram::write_layer(const Layer& layer, const RunsView& image, const std::vector<std::uint32_t>& feeds,
                                 ProgramWork& work, ProgramRecord& record, bool measures) const {
  return write(layer, feeds, work, record, measures, [&](const program::EmitSweep& emit) {
    return program::compile(resolved_.grid, image, work.compile, emit, layer.index);
  });
}

Status PrintProgram::write_layer(const Layer& layer, const Drops& drops, const std::vector<std::uint32_t>& feeds,
                                 ProgramWork& work, ProgramRecord& record, bool measures) const {
  return write(layer, feeds, work, record, measures, [&](const program::EmitSweep& emit) {
    return program::compile(resolved_.grid, drops.image, drops.maximum, work.compile, emit, layer.index);
  });
}

template <class Compile>
Status PrintProgram::write(const Layer& layer, const std::vector<std::uint32_t>& feeds, ProgramWork& work,
                           ProgramRecord& record, bool measures, const Compile& compile) const {
  if (!machine_) return machine_.error();
  if (!work.writer) work.writer = dialect_.make_writer(resolved_.machine, resolved_.grid);
  if (!work.timer) work.timer.emplace(*machine_);
  const bool writes = measures || !directory_.empty();  // else the layer is only timed
  if (measures || (writes && in_memory)) {
    const bool compressed = is_compressed(extension_);
    if (Status status = measures ? work.file.open_nowhere(compressed) : work.file.open_in_memory(compressed); !status)
      return status;
  } else if (writes) {
    const std::string name = directory_ + "/" + program_file_name(layer.index, extension_);
    if (Status status = work.file.open(name, files_); !status) return status;
  }
  const LayerCycle cycle{layer.index,     layers_, layer.bottom,
                         layer.thickness, feeds,   std::ranges::binary_search(refills, layer.index)};
  const auto flush = [&]() -> Status {
    if (dialect_.has_motion) work.timer->read(work.text);
    Status status = writes ? work.file.append(work.text) : Status();
    work.text.clear();
    return status;
  };
  const auto append = [&](std::span<const std::byte> bytes) {
    const Status status = flush();
    return status ? work.file.append(bytes) : status;
  };
  work.text.clear();
  work.timer->begin(layer);
  work.writer->begin_layer(cycle, work.text);
  const auto maintenance = [&](const auto& write) {  // of the head alone
    const std::size_t from = work.text.size();
    write();
    if (!dialect_.has_motion) work.timer->maintenance(std::span(work.text).subspan(from));
  };
  maintenance([&] { work.writer->maintenance_of_layer(cycle, work.text); });
  constexpr std::size_t kPiece = 256 << 10;
  const auto count = compile([&](const Sweep& sweep, const SweepVectors& vectors) -> Status {
    maintenance([&] { work.writer->maintenance_before(sweep, vectors, work.text); });
    if (!dialect_.has_motion) {
      const std::int64_t low = vectors.first_step, high = low + vectors.steps - 1;
      work.timer->sweep(static_cast<double>(program::across_nm(resolved_.machine, resolved_.grid, sweep.first_line)) / 1e6,
                        sweep.backward, sweep.backward ? high : low, sweep.backward ? low : high, sweep.added, sweep.drops);
    }
    if (dialect_.has_motion) {
      work.writer->sweep(sweep, vectors, work.text);
    } else if (writes) {
      if (Status status = work.writer->stream_sweep(sweep, vectors, work.text, append); !status) return status;
    }
    return work.text.size() < kPiece ? Status() : flush();
  });
  if (!count) return count.error();
  maintenance([&] { work.writer->maintenance_after(work.text); });
  work.writer->end_layer(cycle, work.text);
  if (Status status = flush(); !status) return status;
  const auto taken = work.timer->end();
  if (!taken) return taken.error();
  record = {0,          {}, 0, count->sweeps - count->skipped, count->drops, count->moved, count->lost, taken->microseconds,
            taken->spat};
  record.added_sweeps = count->added;
  record.added_microseconds = work.timer->added_microseconds();
  if (!writes) return {};
  const auto digest = work.file.finish();
  if (!digest) return digest.error();
  record.bytes = digest->bytes;
  record.hash = digest->hash;
  record.stored = work.file.stored_bytes();
  return {};
}

std::uint64_t PrintProgram::max_sweeps(std::uint32_t drops) const {
  const HeadGrid& grid = resolved_.grid;
  const std::uint64_t further = grid.blocked_rule == BlockedRule::kSecondPass ? grid.blocked.size() : 0;
  return std::uint64_t{grid.max_swaths()} * grid.passes * (1 + further) * grid.sweeps_for(drops);
}

std::uint64_t PrintProgram::file_bound(std::uint32_t drops) const {
  const HeadGrid& grid = resolved_.grid;
  const std::uint64_t vectors = grid.steps() * grid.words() * grid.drop_bits * 8;
  const std::uint64_t of_sweep = dialect_.has_motion ? 4 * vectors + 32 * grid.steps() : vectors + vectors / 4;
  return max_sweeps(drops) * (of_sweep + 4096) + (64 << 10);
}

std::uint64_t PrintProgram::bytes_bound(std::uint64_t changes, std::uint32_t drops) const {
  const HeadGrid& grid = resolved_.grid;
  // A sweep's vectors with their text of at most three times the size, lines, sorted changes and their steps.
  const std::uint64_t vectors = grid.steps() * grid.words() * grid.drop_bits * 8;
  const std::uint64_t turned = grid.scan_axis == ScanAxis::kX ? 9 * changes : 27 * changes;
  // The timer keeps a layer's text, but for vectors of nuferbj, hp45 and oasis: at most 32 bytes a step (m578), twice while the
  // text grows.
  constexpr std::uint64_t kStepText = 32, kSweepText = 256;
  const std::uint64_t sweeps = max_sweeps(drops);
  const bool keeps = dialect_.has_motion && !replay::Timer::keeps_no_vectors(dialect_.id);
  const std::uint64_t kept = keeps ? 2 * sweeps * (kStepText * grid.steps() + kSweepText) : 0;
  // Lines of the base, and of shots off the bed: of one nozzle after the other (m578), of a dot a drop (brundlefab).
  const Machine& machine = resolved_.machine;
  const std::uint64_t shots = machine.maintenance.spits() ? 1 + (machine.maintenance.spit_seconds > 0 ? sweeps : 0) : 0;
  const std::uint64_t maintenance =
      512 * machine.powder.base_layers + shots * (256 + 16 * std::uint64_t{machine.maintenance.spit_drops});
  // Lines of drops as bits, and what is under the nozzles; a line that blocked nozzles leave to others has a run a position.
  const std::uint64_t rows =
      (std::uint64_t{256} << 10) + std::uint64_t{64 * 8 * 4} * grid.words() * grid.drop_bits + 80 * grid.nozzles;
  const std::uint64_t moved = grid.blocked_rule == BlockedRule::kNeighbour ? 2 * std::uint64_t{grid.max_swaths()} : 0;
  const std::uint64_t own = 18 * moved * grid.passes * grid.blocked.size() * grid.positions;
  return rows + own + 4 * maintenance + 4 * vectors + 4 * grid.steps() + 16 * grid.lines + 4 * changes + turned + kept +
         (is_compressed(extension_) && !directory_.empty() ? ContentWriter::kMaxBytes : 0) +
         (in_memory ? file_bound(drops) : 0) + (512 << 10);
}

}  // namespace lamina::pipeline
