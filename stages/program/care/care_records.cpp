#include "stages/program/care/care_records.h"

#include <cmath>

namespace lamina::write {
namespace {

/// nm as i32, in which check_care holds places.
std::uint32_t nm_field(double mm) { return static_cast<std::uint32_t>(static_cast<std::int32_t>(std::llround(mm * kNmPerMm))); }
std::uint32_t thousandths(double value) { return static_cast<std::uint32_t>(std::llround(value * 1000)); }

}  // namespace

void CareRecords::go(CareClock::Place to, ProgramBytes& out) const {
  put(CareRecord::kGo, {nm_field(to[0]), nm_field(to[1])}, out);
}

void CareRecords::begin_layer(const LayerCycle& cycle, ProgramBytes& out) {
  const auto& powder = machine_.powder;
  const auto& cap = machine_.care.cap_mm;
  if (cycle.refill) {
    if (cap) go(*cap, out);
    put(CareRecord::kFill, {}, out);
    if (cap) go(machine_.motion.safe_mm, out);
  }
  if (cycle.layer == 0 && powder.base_layers > 0) {
    put(CareRecord::kBase, {powder.base_layers, nm_field(powder.base_layer_mm)}, out);
  }
  if (powder.roller_rpm > 0) put(CareRecord::kRoller, {thousandths(powder.roller_rpm)}, out);
  serve(clock_.begin_layer(cycle.layer, machine_.motion.safe_mm), out);
}

void CareRecords::before_sweep(const Sweep& sweep, const SweepVectors& vectors, ProgramBytes& out) {
  serve(clock_.before_sweep(carriage_.place(carriage_.begin(sweep, vectors), sweep.first_line),
                            carriage_.place(carriage_.end(sweep, vectors), sweep.first_line)),
        out);
}

void CareRecords::serve(CareClock::Due due, ProgramBytes& out) const {
  const auto& care = machine_.care;
  if (due.wipe) {
    const auto& [x, y, to_x, to_y] = *care.wipe_mm;
    go({x, y}, out);
    put(CareRecord::kWipe, {nm_field(to_x), nm_field(to_y), thousandths(care.wipe_speed_mm_s)}, out);
    put_own(care.wipe_lines, out);
  }
  if (due.shot) {
    go(*care.spit_mm, out);
    put(CareRecord::kShot, {care.spit_drops}, out);
  }
}

void CareRecords::dry(ProgramBytes& out) const {
  if (machine_.powder.dry_s == 0) return;
  go(machine_.care.cap_mm.value_or(machine_.motion.safe_mm), out);
  put_own(machine_.powder.dry_on_lines, out);
  put(CareRecord::kDry, {thousandths(machine_.powder.dry_s)}, out);
  put_own(machine_.powder.dry_off_lines, out);
}

// Text in words of four bytes, the first one lowest, the last padded with zeros.
void CareRecords::put_own(const std::vector<std::string>& lines, ProgramBytes& out) const {
  for (const std::string& line : lines) {
    std::vector<std::uint32_t> words((line.size() + 3) / 4, 0);
    for (std::size_t i = 0; i < line.size(); ++i) {
      words[i / 4] |= std::uint32_t{static_cast<unsigned char>(line[i])} << (i % 4 * 8);
    }
    put_(CareRecord::kOwn, words, out);
  }
}

}  // namespace lamina::write
