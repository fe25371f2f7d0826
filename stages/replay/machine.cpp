#include "stages/replay/machine.h"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <iterator>

#include "stages/data/bit_image.h"
#include "stages/geometry/run_rows.h"
#include "stages/replay/printing.h"

namespace lamina::replay {
namespace {

constexpr double kPi = 3.14159265358979323846;

struct DialectReader {
  std::string_view id;
  void (*read)(std::string_view, Printing&);
};
constexpr DialectReader kReaders[] = {{"nuferbj", read_nuferbj}, {"raw", read_raw},     {"planes", read_planes},
                                      {"hp45", read_hp45},       {"oasis", read_oasis}, {"brundlefab", read_brundlefab},
                                      {"m578", read_m578}};

/// Reads a program with the reader of its dialect. errors  kVerification
Status read(std::string_view dialect, std::string_view program, Printing& printing) {
  const auto reader = std::ranges::find(kReaders, dialect, &DialectReader::id);
  if (reader == std::end(kReaders)) {
    return Error{Fault::kVerification, fmt::format("no virtual machine reads the dialect '{}'", dialect)};
  }
  reader->read(program, printing);
  return printing.status();
}

}  // namespace

std::uint32_t drop_bits(std::uint32_t max_drops) { return max_drops < 2 ? 1 : max_drops < 4 ? 2 : 4; }

Result<VirtualMachine> VirtualMachine::build(const Machine& machine, std::uint32_t columns, std::uint32_t rows,
                                             std::uint32_t layers) {
  const auto wrong = [](const std::string& what) { return Error{Fault::kVerification, "program/machine.toml: " + what}; };
  VirtualMachine made;
  made.machine_ = machine;
  made.columns_ = columns;
  made.rows_ = rows;
  made.layers_ = layers;
  const bool x = machine.mounting.scan_axis == ScanAxis::kX;
  const double pitch = machine.head.pitch_um;
  const double passes = machine.mounting.passes;
  double angle = (x ? machine.mounting.tilt_deg : 90 - machine.mounting.tilt_deg) * kPi / 180;
  if (machine.mounting.dpi > 0) angle = std::asin(std::min(1.0, 25'400 * passes / machine.mounting.dpi / pitch));
  angle = std::abs(angle);
  made.line_um_ = machine.mounting.dpi > 0 ? 25'400 / machine.mounting.dpi : pitch * std::sin(angle) / passes;
  made.position_um_ = made.line_um_;
  if (machine.motion.ticks_per_pixel > 0) {
    made.position_um_ = 25'400 / machine.motion.encoder_dpi * machine.motion.ticks_per_pixel;
  } else if (machine.mounting.along_dpi > 0) {
    made.position_um_ = 25'400 / machine.mounting.along_dpi;
  }
  if (!(made.line_um_ > 0.5 && made.position_um_ > 0.5)) return wrong("its pixels have no size");
  made.ticks_ = machine.motion.lag_unit == LagUnit::kTick ? std::max(1u, machine.motion.ticks_per_pixel) : 1;
  made.step_um_ = made.position_um_ / static_cast<double>(made.ticks_);
  made.lines_ = x ? rows : columns;
  made.positions_ = x ? columns : rows;
  const auto expected = [](double bed_mm, double pixel_um) { return bed_mm * 1000 / pixel_um; };
  const double want_lines = expected(machine.bed.size_mm[x ? 1 : 0], made.line_um_);
  const double want_positions = expected(machine.bed.size_mm[x ? 0 : 1], made.position_um_);
  if (made.lines_ + 0.01 < want_lines || made.lines_ > want_lines + 1.01 || made.positions_ + 0.01 < want_positions ||
      made.positions_ > want_positions + 1.01) {
    return wrong(fmt::format("its bed has {:.1f} x {:.1f} pixels along and across the scan, the images {} x {}", want_positions,
                             want_lines, made.positions_, made.lines_));
  }
  // Where the nozzles are: across from nozzle 0, and behind the foremost one.
  const auto& offsets = machine.head.row_offset_um;
  std::vector<double> across, behind;
  for (std::uint32_t i = 0; i < machine.head.nozzles; ++i) {
    const double along_row = (machine.mounting.first_leads ? i : machine.head.nozzles - 1.0 - i) * pitch;
    const double offset = offsets[i % offsets.size()];
    across.push_back(i * pitch * std::sin(angle) - offset * std::cos(angle));
    behind.push_back(along_row * std::cos(angle) + offset * std::sin(angle));
  }
  const double foremost = *std::min_element(behind.begin(), behind.end());
  for (std::uint32_t i = 0; i < machine.head.nozzles; ++i) {
    const double late = (behind[i] - foremost) / made.step_um_;
    Nozzle nozzle{};
    nozzle.line = std::llround(across[i] / made.line_um_);
    // A drop half a step from two places is that of the one behind.
    nozzle.step_offset = -static_cast<std::int64_t>(std::floor(-late + 0.5 + 1e-6));
    nozzle.along_um = (static_cast<double>(nozzle.step_offset) - late) * made.step_um_;
    nozzle.across_um = across[i] - static_cast<double>(nozzle.line) * made.line_um_;
    nozzle.blocked = std::ranges::find(machine.head.blocked, i) != machine.head.blocked.end();
    made.nozzle_.push_back(nozzle);
  }
  return made;
}

VirtualMachine::Counts VirtualMachine::counts() const {
  return {machine_.head.nozzles,
          positions_,
          lines_,
          static_cast<std::uint32_t>(ticks_),
          drop_bits(machine_.head.max_drops),
          step_um_};
}

std::array<double, 2> VirtualMachine::nozzle_at(std::int64_t first_line, double step, std::uint32_t number) const {
  const Nozzle& nozzle = nozzle_[number];
  const double line = static_cast<double>(first_line + nozzle.line) + nozzle.across_um / line_um_;
  const double position =
      (step - static_cast<double>(nozzle.step_offset)) / static_cast<double>(ticks_) + nozzle.along_um / position_um_;
  const bool x = machine_.mounting.scan_axis == ScanAxis::kX;
  double column = x ? position : line, row = x ? line : position;
  if (begins_at(Side::kRight)) column = columns_ - 1 - column;
  if (begins_at(Side::kFront)) row = rows_ - 1 - row;
  return {column, row};
}

Result<Count> VirtualMachine::replay(std::string_view program, const Layer& layer, const RunsView& image, std::uint64_t moved,
                                     std::uint64_t lost) const {
  return replay(program, layer, {&image, 1}, moved, lost);
}

Result<Count> VirtualMachine::replay(std::string_view program, const Layer& layer, std::span<const RunsView> planes,
                                     std::uint64_t moved, std::uint64_t lost) const {
  std::vector<RunRows> rows(planes.begin(), planes.end());
  std::vector<const BitRows*> views;
  for (const RunRows& one : rows) views.push_back(&one);
  return replay(program, layer, views, moved, lost);
}

Result<Count> VirtualMachine::replay(std::string_view program, const Layer& layer, std::span<const BitRows* const> planes,
                                     std::uint64_t moved, std::uint64_t lost) const {
  auto count = replay_words(program, layer, planes, moved, lost);
  return count ? std::move(count) : replay_drops(program, layer, planes, moved, lost);
}

Result<Count> VirtualMachine::replay_words(std::string_view program, const Layer& layer, std::span<const BitRows* const> planes,
                                           std::uint64_t moved, std::uint64_t lost) const {
  const auto fits = [&](const BitRows* plane) { return plane->columns() == columns_ && plane->rows() == rows_; };
  if (!std::ranges::all_of(planes, fits)) return Error{Fault::kVerification, "the image is of another size"};
  Printing printing(*this, layer, planes);
  return replay(program, printing, planes, moved, lost);
}

Result<Count> VirtualMachine::replay_drops(std::string_view program, const Layer& layer, std::span<const BitRows* const> planes,
                                           std::uint64_t moved, std::uint64_t lost) const {
  Printing printing(*this, layer, Purpose::kPrint, nullptr, static_cast<std::uint32_t>(planes.size()));
  return replay(program, printing, planes, moved, lost);
}

Result<Count> VirtualMachine::replay(std::string_view program, Printing& printing, std::span<const BitRows* const> planes,
                                     std::uint64_t moved, std::uint64_t lost) const {
  if (Status status = read(machine_.dialect, program, printing); !status) return status.error();
  printing.check_cycle();
  if (printing.ok()) printing.compare(planes, moved, lost);
  if (!printing.ok()) return printing.status().error();
  Count count = printing.finish();
  if (printing.added_sweeps().empty()) return count;
  Printing without(*this, printing.of_layer(), Purpose::kTime);
  without.leave_out(printing.added_sweeps());
  if (Status status = read(machine_.dialect, program, without); !status) return status.error();
  count.added_microseconds = count.microseconds - without.finish().microseconds;
  return count;
}

std::uint32_t VirtualMachine::max_open_lines() const {
  const auto [low, high] = std::ranges::minmax(nozzle_, {}, &Nozzle::line);
  const auto blocked = static_cast<std::uint64_t>(std::ranges::count_if(nozzle_, &Nozzle::blocked));
  const auto span = static_cast<std::uint64_t>(high.line - low.line) + 1;
  const std::uint64_t swaths = lines_ / std::max<std::uint64_t>(1, nozzle_.size()) + 2;
  return static_cast<std::uint32_t>(std::min<std::uint64_t>(lines_, 2 * span + 3 * blocked * swaths));
}

std::uint64_t VirtualMachine::bytes_of_replay(std::uint32_t planes) const { return FiredWords::bytes(*this, planes); }

std::uint64_t VirtualMachine::bytes_of_drops(std::uint32_t planes) const {
  return std::bit_width(planes) * bytes_of_bits(columns_, rows_);
}

Result<Count> VirtualMachine::timed(std::string_view program, const Layer& layer) const {
  Printing printing(*this, layer, Purpose::kTime);
  if (Status status = read(machine_.dialect, program, printing); !status) return status.error();
  return printing.finish();
}

Result<Count> VirtualMachine::run(std::string_view program, std::uint32_t layer, const Watch& watch,
                                  std::uint32_t planes) const {
  Printing printing(*this, {layer, 0, 1}, Purpose::kPrint, &watch, planes);
  if (Status status = read(machine_.dialect, program, printing); !status) return status.error();
  return printing.count;
}

}  // namespace lamina::replay
