// Everything of the manifest but reading: its text, and the file that grows while a job runs.
#include "pipeline/output/manifest.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <cstring>
#include <filesystem>
#include <iterator>

#include "pipeline/job/file.h"
#include "pipeline/job/keys.h"
#include "pipeline/machine/printer_profile.h"
#include "pipeline/output/manifest_text.h"
#include "pipeline/output/print_program.h"
#include "pipeline/plan/porous_plan.h"
#include "pipeline/text/json_text.h"
#include "pipeline/text/number_text.h"
#include "stages/write/file.h"
#include "stages/write/image_format.h"
#include "stages/write/program/dialect.h"

namespace lamina::pipeline {
namespace {

// Whole nanometres as mm with all their digits, so that reading them back loses nothing.
std::string exact_mm(std::int64_t nm) {
  const std::int64_t size = nm < 0 ? -nm : nm;
  return fmt::format("{}{}.{:06}", nm < 0 ? "-" : "", size / kNmPerMm, size % kNmPerMm);
}

std::string point_text(const Point3& p) { return fmt::format("[{}, {}, {}]", exact_mm(p.x), exact_mm(p.y), exact_mm(p.z)); }

std::string part_text(const PartSummary& part) {
  std::string notes;
  for (const Note& note : part.notes) {
    notes += fmt::format("{}{{\"repair\": {}, \"text\": {}}}", notes.empty() ? "" : ", ", note.repair, json_string(note.text));
  }
  return fmt::format(
      "{{\"path\": {}, \"copies\": {}, \"triangles\": {}, \"fingerprint\": \"{:016x}\", \"bounds_mm\": [{}, {}], "
      "\"notes\": [{}]}}",
      json_string(std::filesystem::path(part.path).filename().string()), part.copies, part.triangles, part.fingerprint,
      point_text(part.bounds.lo), point_text(part.bounds.hi), notes);
}

// The machine's line, if there is one.
std::string machine_line(const ManifestHead& head) {
  if (head.machine.empty()) return {};
  return fmt::format(
      "\"machine\": {{\"name\": {}, \"dialect\": {}, \"extension\": {}, \"profile_xxh3_128\": \"{}\", "
      "\"start_xxh3_128\": \"{}\", \"end_xxh3_128\": \"{}\"}},\n",
      json_string(head.machine), json_string(head.dialect), json_string(head.program_extension), hex(head.machine_profile),
      hex(head.program_start), hex(head.program_end));
}

// The line of a job with several materials.
std::string materials_line(const ManifestHead& head) {
  if (head.materials.empty()) return {};
  std::string text;
  for (const JobMaterial& material : head.materials) {
    text += fmt::format("{}{{\"name\": {}, \"vat\": {}}}", text.empty() ? "" : ", ", json_string(material.name), material.vat);
  }
  return fmt::format("\"materials\": [{}],\n", text);
}

// Whole dpi as a number; another grid as the dots that a span of nm holds.
std::string axis_text(const PixelAxis& axis) {
  if (axis.span == kNmPerInch) return fmt::format("{}", axis.dots);
  return fmt::format("\"{} in {} nm\"", axis.dots, axis.span);
}

// The head without what differs between shards of one job.
std::string lasting_text(const ManifestHead& head) {
  std::string parts;
  for (const PartSummary& part : head.parts) parts += (parts.empty() ? "" : ",\n") + part_text(part);
  return fmt::format(
      "\"lamina\": {},\n\"job\": {},\n\"bed_mm\": [{}, {}],\n\"dpi\": [{}, {}],\n\"columns\": {},\n\"rows\": {},\n"
      "\"format\": {},\n\"extension\": {},\n\"fill_rule\": {},\n\"mirror\": {},\n\"layer_count\": {},\n\"parts\": [\n{}\n],\n{}{}",
      json_string(head.version), json_string(head.job_toml), exact_mm(head.grid.x.length), exact_mm(head.grid.y.length),
      axis_text(head.grid.x), axis_text(head.grid.y), head.grid.columns(), head.grid.rows(), json_string(head.format),
      json_string(head.extension), json_string(head.fill_rule), json_string(head.mirror), head.layer_count, parts,
      materials_line(head), machine_line(head));
}

// A writer holds its lock as long as it lives; the lock of a killed run is gone with it.
bool locked_by_another(int file) { return ::flock(file, LOCK_EX | LOCK_NB) != 0 && errno == EWOULDBLOCK; }

Error busy(const std::string& partial) {
  return {Fault::kOutput,
          fmt::format("{}: another run is writing here right now; wait for it or name another directory", partial)};
}

std::string key_text(std::string_view section, std::string_view name, const Job& job) {
  for (const JobKey& key : job_keys()) {
    if (key.section == section && key.name == name) return key.write(job);
  }
  return {};
}

}  // namespace

bool read_reason(std::string_view name, LayerReason& reason) {
  for (const LayerReason one :
       {LayerReason::kUniform, LayerReason::kSlope, LayerReason::kPeak, LayerReason::kCusp, LayerReason::kFlat}) {
    if (reason_name(one) != name) continue;
    reason = one;
    return true;
  }
  return false;
}

std::string head_text(const ManifestHead& head) {
  return fmt::format("{{\n\"id\": \"{}\",\n{}\"range\": [{}, {}],\n\"layers\": [", hex(head.id()), lasting_text(head),
                     head.first_layer, head.last_layer);
}

void add_program_text(const ProgramRecord& record, std::string& text) {
  text += fmt::format(
      ", \"program\": {{\"bytes\": {}, \"sweeps\": {}, \"drops\": {}, \"moved\": {}, \"lost\": {}, "
      "\"xxh3_128\": \"{}\"}}}}",
      record.bytes, record.sweeps, record.drops, record.moved, record.lost, hex(record.hash));
}

void add_record_text(const LayerRecord& record, const ManifestHead& head, std::string& text) {
  if (!head.materials.empty()) {
    text += fmt::format(
        "{{\"index\": {}, \"bottom_nm\": {}, \"thickness_nm\": {}, \"reason\": \"{}\", \"capped_rows\": {}, "
        "\"images\": [",
        record.layer.index, record.layer.bottom, record.layer.thickness, reason_name(record.layer.reason), record.capped_rows);
    bool first = true;
    for (const LayerImageFile& image : layer_images(head, record)) {
      text += fmt::format("{}{{\"file\": {}, \"bytes\": {}, \"set_pixels\": {}, \"xxh3_128\": \"{}\"}}", first ? "" : ", ",
                          json_string(image.name), image.record.bytes, image.record.set_pixels, hex(image.record.hash));
      first = false;
    }
    text += "]}";
    return;
  }
  text += fmt::format(
      "{{\"index\": {}, \"file\": {}, \"bottom_nm\": {}, \"thickness_nm\": {}, \"reason\": \"{}\", "
      "\"bytes\": {}, \"set_pixels\": {}, \"capped_rows\": {}, \"xxh3_128\": \"{:016x}{:016x}\"}}",
      record.layer.index, json_string(layer_file_name(record.layer.index, head.extension)), record.layer.bottom,
      record.layer.thickness, reason_name(record.layer.reason), record.bytes, record.set_pixels, record.capped_rows,
      record.hash.high, record.hash.low);
}

Hash128 ManifestHead::id() const {
  const std::string text = lasting_text(*this);
  return hash_bytes(std::as_bytes(std::span(text)));
}

ManifestHead make_head(const Job& job, const std::vector<PartSummary>& parts, std::uint32_t layer_count,
                       std::array<std::uint32_t, 2> layers, const Materials& materials) {
  ManifestHead head;
  head.version = LAMINA_VERSION;
  head.job_toml = canonical_job_text(job);
  if (const auto filled = PorousPlan::asked(job); filled && *filled) head.job_toml += filling_text(job);
  head.format = job.format;
  if (const auto* format = write::find_image_format(job.format)) head.extension = format->extension;
  head.fill_rule = key_text("image", "fill", job);
  head.mirror = key_text("image", "mirror", job);
  head.grid = grid_of(job);
  head.layer_count = layer_count;
  head.first_layer = layers[0];
  head.last_layer = layers[1];
  head.parts = parts;
  for (PartSummary& part : head.parts) part.path = std::filesystem::path(part.path).filename().string();
  if (materials.several()) head.materials = materials.used;
  if (job.machine.resolved) {
    const Machine& machine = job.machine.resolved->machine;
    head.machine = machine.name;
    head.dialect = machine.dialect;
    if (const auto* dialect = write::find_dialect(machine.dialect)) head.program_extension = dialect->extension;
    const std::string profile = machine_text(machine);
    head.machine_profile = hash_bytes(std::as_bytes(std::span(profile)));
    const ProgramFrame frame = program_frame(*job.machine.resolved, layer_count);
    head.program_start = hash_bytes(frame.start);
    head.program_end = hash_bytes(frame.end);
  }
  return head;
}

std::string difference(const ManifestHead& now, const ManifestHead& earlier) {
  if (now.id() == earlier.id()) return {};
  if (now.version != earlier.version) return fmt::format("lamina is {}, was {}", now.version, earlier.version);
  const auto lines = split(now.job_toml, "\n"), lines_before = split(earlier.job_toml, "\n");
  std::string_view section;
  for (std::size_t i = 0; i < std::max(lines.size(), lines_before.size()); ++i) {
    const std::string_view line = i < lines.size() ? lines[i] : "";
    const std::string_view before = i < lines_before.size() ? lines_before[i] : "";
    if (line == before) {
      if (line.starts_with('[')) section = line;
      continue;
    }
    const std::size_t name_end = line.find(" = "), name_end_before = before.find(" = ");
    if (name_end == std::string_view::npos || line.substr(0, name_end) != before.substr(0, name_end_before)) {
      return "the parts, or which of their keys are set, are others";
    }
    section = section.substr(section.find_first_not_of('['));
    return fmt::format("{}.{}, was {}", section.substr(0, section.find(']')), line, before.substr(name_end_before + 3));
  }
  for (std::size_t i = 0; i < std::min(now.parts.size(), earlier.parts.size()); ++i) {
    if (now.parts[i].fingerprint != earlier.parts[i].fingerprint) {
      return fmt::format("the geometry of {} has changed", now.parts[i].path);
    }
  }
  if (now.machine_profile != earlier.machine_profile) return "the machine, or its profile, has changed";
  return "the parts have changed";
}

std::string manifest_name(const Job& job) {
  if (!job.shard) return "manifest.json";
  return fmt::format("manifest-{}-of-{}.json", (*job.shard)[0] + 1, (*job.shard)[1]);
}

std::string layer_file_name(std::uint32_t index, std::string_view extension, std::string_view material) {
  if (extension.empty()) return {};
  return fmt::format("layers/{:06}{}{}{}", index, material.empty() ? "" : "-", material, extension);
}

std::vector<LayerImageFile> layer_images(const ManifestHead& head, const LayerRecord& record) {
  std::vector<LayerImageFile> files;
  if (head.materials.empty()) {
    files.push_back({layer_file_name(record.layer.index, head.extension), {record.bytes, record.set_pixels, record.hash}});
  }
  for (std::size_t m = 0; m < head.materials.size(); ++m) {
    files.push_back({layer_file_name(record.layer.index, head.extension, head.materials[m].name),
                     m < record.images.size() ? record.images[m] : ImageRecord()});
  }
  return files;
}

Status check_not_being_written(const std::string& path) {
  const std::string partial = path + ".part";
  const int file = ::open(partial.c_str(), O_RDWR | O_CLOEXEC);
  if (file < 0) return {};
  const bool taken = locked_by_another(file);
  ::close(file);
  return taken ? Status(busy(partial)) : Status();
}

struct ManifestWriter::State {
  static constexpr std::uint32_t kLines = 64;
  static constexpr std::chrono::seconds kPatience{1};

  int file = -1;
  std::string path, buffer;
  ManifestHead head;
  bool programs = false;  // lines speak of print programs
  std::uint32_t next_layer = 0, last_layer = 0, lines_buffered = 0;
  bool first_line = true;
  std::chrono::steady_clock::time_point written = std::chrono::steady_clock::now();

  ~State() {
    if (file >= 0) ::close(file);
  }

  Error failed(int reason) const { return write::write_failure(path + ".part", reason); }

  void add(const LayerRecord& record) {
    buffer += first_line ? "\n" : ",\n";
    first_line = false;
    add_record_text(record, head, buffer);
    if (programs) {
      buffer.pop_back();
      add_program_text(record.program, buffer);
    }
    ++next_layer;
    ++lines_buffered;
  }

  Status flush() {
    std::string_view rest = buffer;
    while (!rest.empty()) {
      const ssize_t wrote = ::write(file, rest.data(), rest.size());
      if (wrote < 0 && errno == EINTR) continue;
      if (wrote < 0) return failed(errno);
      rest.remove_prefix(static_cast<std::size_t>(wrote));
    }
    buffer.clear();
    lines_buffered = 0;
    written = std::chrono::steady_clock::now();
    return {};
  }
};

ManifestWriter::ManifestWriter() : state_(std::make_unique<State>()) {}
ManifestWriter::ManifestWriter(ManifestWriter&&) noexcept = default;
ManifestWriter& ManifestWriter::operator=(ManifestWriter&&) noexcept = default;
ManifestWriter::~ManifestWriter() = default;

Result<ManifestWriter> ManifestWriter::open(const std::string& path, const ManifestHead& head,
                                            std::vector<LayerRecord> kept_prefix) {
  ManifestWriter writer;
  State& state = *writer.state_;
  state.path = path;
  state.head = head;
  state.programs = !head.machine.empty();
  state.next_layer = head.first_layer;
  state.last_layer = head.last_layer;
  const std::string partial = path + ".part", fresh = partial + ".new";

  if (Status status = check_not_being_written(path); !status) return status.error();
  state.file = ::open(fresh.c_str(), O_WRONLY | O_CREAT | O_CLOEXEC, 0666);
  if (state.file < 0) return state.failed(errno);
  if (locked_by_another(state.file)) return busy(partial);
  const auto give_up = [&](Error error) {
    ::unlink(fresh.c_str());
    return error;
  };
  if (::ftruncate(state.file, 0) != 0) return give_up(state.failed(errno));
  state.buffer = head_text(head);
  for (const LayerRecord& record : kept_prefix) {
    if (record.layer.index != state.next_layer) {
      return give_up(
          {Fault::kInternal, fmt::format("manifest: layer {} kept where {} is next", record.layer.index, state.next_layer)});
    }
    state.add(record);
    if (state.lines_buffered == State::kLines) {
      if (Status status = state.flush(); !status) return give_up(status.error());
    }
  }
  if (Status status = state.flush(); !status) return give_up(status.error());
  if (std::rename(fresh.c_str(), partial.c_str()) != 0) return give_up(state.failed(errno));
  return writer;
}

Status ManifestWriter::append(const LayerRecord& record) {
  State& state = *state_;
  if (record.layer.index != state.next_layer || record.layer.index >= state.last_layer) {
    return Error{Fault::kInternal, fmt::format("manifest: layer {} appended where {} of {} is next", record.layer.index,
                                               state.next_layer, state.last_layer)};
  }
  state.add(record);
  const bool due =
      state.lines_buffered >= State::kLines || std::chrono::steady_clock::now() - state.written >= State::kPatience;
  return due ? state.flush() : Status();
}

Status ManifestWriter::flush() { return state_->flush(); }

Status ManifestWriter::finish() {
  State& state = *state_;
  if (state.next_layer != state.last_layer) {
    return Error{Fault::kInternal, fmt::format("manifest: closed at layer {} of {}", state.next_layer, state.last_layer)};
  }
  state.buffer += "\n]\n}\n";
  if (Status status = state.flush(); !status) return status;
  const std::string partial = state.path + ".part";
  if (std::rename(partial.c_str(), state.path.c_str()) != 0) return state.failed(errno);
  const int file = std::exchange(state.file, -1);
  if (::close(file) != 0) return write::write_failure(state.path, errno);
  return {};
}

}  // namespace lamina::pipeline
