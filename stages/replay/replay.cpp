#include "stages/replay/replay.h"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cmath>

#include "stages/replay/replay_printing.h"

namespace lamina::pipeline {
namespace {

constexpr double kPi = 3.14159265358979323846;

struct DialectReader {
  std::string_view id;
  void (*read)(std::string_view, Printing&);
};
constexpr DialectReader kReaders[] = {{"nuferbj", replay_nuferbj},       {"raw", replay_raw},
                                      {"planes", replay_planes},         {"hp45", replay_hp45},
                                      {"brundlefab", replay_brundlefab}, {"m578", replay_m578}};

}  // namespace

void ReplayCount::add(const ReplayCount& other) {
  drops += other.drops;
  vectors += other.vectors;
  sweeps += other.sweeps;
  scan_mm += other.scan_mm;
  travel_mm += other.travel_mm;
  seconds += other.seconds;
  fed_mm[0] += other.fed_mm[0];
  fed_mm[1] += other.fed_mm[1];
  vats |= other.vats;
  moves |= other.moves;
  build_mm = std::max(build_mm, other.build_mm);
  farthest_along_um = std::max(farthest_along_um, other.farthest_along_um);
  farthest_across_um = std::max(farthest_across_um, other.farthest_across_um);
}

Result<VirtualMachine> VirtualMachine::build(const Machine& machine, std::uint32_t columns, std::uint32_t rows) {
  const auto wrong = [](const std::string& what) { return Error{Fault::kVerification, "program/machine.toml: " + what}; };
  VirtualMachine made;
  made.machine_ = machine;
  made.columns_ = columns;
  made.rows_ = rows;
  const bool x = machine.mounting.scan_axis == ScanAxis::kX;
  const double pitch = machine.head.pitch_um;
  const double passes = machine.mounting.passes;
  double angle = (x ? machine.mounting.tilt_deg : 90 - machine.mounting.tilt_deg) * kPi / 180;
  if (machine.mounting.dpi > 0) angle = std::asin(std::min(1.0, 25'400 * passes / machine.mounting.dpi / pitch));
  angle = std::abs(angle);
  made.line_um_ = machine.mounting.dpi > 0 ? 25'400 / machine.mounting.dpi : pitch * std::sin(angle) / passes;
  made.place_um_ = made.line_um_;
  if (machine.motion.ticks_per_pixel > 0) {
    made.place_um_ = 25'400 / machine.motion.encoder_dpi * machine.motion.ticks_per_pixel;
  } else if (machine.mounting.along_dpi > 0) {
    made.place_um_ = 25'400 / machine.mounting.along_dpi;
  }
  if (!(made.line_um_ > 0.5 && made.place_um_ > 0.5)) return wrong("its pixels have no size");
  made.ticks_ = machine.motion.lag_unit == LagUnit::kTick ? std::max(1u, machine.motion.ticks_per_pixel) : 1;
  made.step_um_ = made.place_um_ / static_cast<double>(made.ticks_);
  made.lines_ = x ? rows : columns;
  made.places_ = x ? columns : rows;
  const auto expected = [](double bed_mm, double pixel_um) { return bed_mm * 1000 / pixel_um; };
  const double want_lines = expected(machine.bed.size_mm[x ? 1 : 0], made.line_um_);
  const double want_places = expected(machine.bed.size_mm[x ? 0 : 1], made.place_um_);
  if (made.lines_ + 0.01 < want_lines || made.lines_ > want_lines + 1.01 || made.places_ + 0.01 < want_places ||
      made.places_ > want_places + 1.01) {
    return wrong(fmt::format("its bed has {:.1f} x {:.1f} pixels along and across the scan, the images {} x {}", want_places,
                             want_lines, made.places_, made.lines_));
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

std::array<double, 2> VirtualMachine::nozzle_at(std::int64_t first_line, double step, std::uint32_t number) const {
  const Nozzle& nozzle = nozzle_[number];
  const double line = static_cast<double>(first_line + nozzle.line) + nozzle.across_um / line_um_;
  const double place =
      (step - static_cast<double>(nozzle.step_offset)) / static_cast<double>(ticks_) + nozzle.along_um / place_um_;
  const bool x = machine_.mounting.scan_axis == ScanAxis::kX;
  double column = x ? place : line, row = x ? line : place;
  const auto has = [&](Side side) { return machine_.mounting.scan_from == side || machine_.mounting.nozzle_0 == side; };
  if (has(Side::kRight)) column = columns_ - 1 - column;
  if (has(Side::kFront)) row = rows_ - 1 - row;
  return {column, row};
}

// --- printing

Printing::Printing(const VirtualMachine& machine, std::uint32_t layer, const VirtualMachine::Watch* watch)
    : machine_(machine),
      watch_(watch),
      layer_(layer),
      row_words_((machine.columns_ + 63) / 64),
      fired_(std::size_t{row_words_} * machine.rows_, 0) {}

void Printing::fault(const std::string& what) const {
  const bool ahead = reading_sweep_ != INT64_MIN;  // its words are read, and it has not begun
  std::string place = fmt::format("layer {}", layer_);
  if (ahead || sweeping_) {
    place += fmt::format(", swath {}", ahead ? reading_sweep_ : std::int64_t{sweep_});
    if (reading_ != INT64_MIN) {
      place += fmt::format(", step {}", reading_);
    } else {
      place += stepped_ && !ahead ? fmt::format(", step {}", step_) : ", before its first step";
    }
  } else {
    place += ", before its first swath";
  }
  throw place + ": " + what;
}

void Printing::begin_sweep(std::uint32_t number, bool backward) {
  if (sweeping_ && number <= sweep_ && !(sweeps_.empty())) {
    // Further sweeps for blocked nozzles have higher numbers than the regular ones that follow them.
    for (const Sweep& sweep : sweeps_) {
      if (sweep.number == number) fault(fmt::format("swath {} begins a second time", number));
    }
  }
  sweep_ = number;
  reading_sweep_ = INT64_MIN;
  backward_ = backward;
  sweeping_ = true;
  stepped_ = false;
  fired_here_ = false;
  ++count.sweeps;
}

void Printing::go_across(double carriage_mm) {
  const auto& mount = profile().mounting;
  const bool x = mount.scan_axis == ScanAxis::kX;
  double um = (carriage_mm - mount.offset_mm[x ? 1 : 0]) * 1000;
  // From the side of nozzle 0: back and right are the far ends.
  const bool far = mount.nozzle_0 == Side::kBack || mount.nozzle_0 == Side::kRight;
  if (far) um = machine_.lines_ * machine_.line_um_ - um;
  const double line = um / machine_.line_um_ - 0.5;
  first_line_ = std::llround(line);
  if (std::abs(line - static_cast<double>(first_line_)) > 0.02) {
    fault(fmt::format("the head stands {:.2f} lines beside line {}", line - static_cast<double>(first_line_), first_line_));
  }
}

double Printing::position_of(double step) const {
  const auto& mount = profile().mounting;
  double um = 0.5 * machine_.place_um_ + step * machine_.step_um_;
  if (mount.scan_from == Side::kRight || mount.scan_from == Side::kBack) um = machine_.places_ * machine_.place_um_ - um;
  return um / 1000 + mount.offset_mm[mount.scan_axis == ScanAxis::kX ? 0 : 1];
}

std::int64_t Printing::step_at(double carriage_mm) const {
  const double one = position_of(1) - position_of(0), step = (carriage_mm - position_of(0)) / one;
  if (std::abs(step - std::round(step)) > 0.05) {
    fault(fmt::format("{:.4f} mm is {:.2f} steps beside a step", carriage_mm, step - std::round(step)));
  }
  return std::llround(step);
}

void Printing::at_step(std::int64_t step) {
  reading_ = INT64_MIN;
  if (!sweeping_) fault("vectors before a swath");
  previous_step_ = step_;
  const bool moved = stepped_;
  step_ = step;
  stepped_ = true;
  if (moved && (backward_ ? step >= previous_step_ : step <= previous_step_)) {
    fault(fmt::format("the head would have to go back from step {}", previous_step_));
  }
  ++count.vectors;
}

bool Printing::pixel(std::int64_t line, std::int64_t place, std::uint32_t& column, std::uint32_t& row) const {
  if (line < 0 || place < 0 || line >= machine_.lines_ || place >= machine_.places_) return false;
  const auto& mount = profile().mounting;
  const bool x = mount.scan_axis == ScanAxis::kX;
  const auto from_left = x ? place : line, from_back = x ? line : place;
  const auto has = [&](Side side) { return mount.scan_from == side || mount.nozzle_0 == side; };
  column = static_cast<std::uint32_t>(has(Side::kRight) ? machine_.columns_ - 1 - from_left : from_left);
  row = static_cast<std::uint32_t>(has(Side::kFront) ? machine_.rows_ - 1 - from_back : from_back);
  return true;
}

void Printing::fire(std::uint32_t number) {
  if (number >= machine_.nozzle_.size()) fault(fmt::format("nozzle {} does not exist", number));
  const VirtualMachine::Nozzle& nozzle = machine_.nozzle_[number];
  if (nozzle.blocked) fault(fmt::format("nozzle {} fires, which is blocked", number));
  if (!fired_here_) sweeps_.push_back({sweep_, first_line_});
  fired_here_ = true;
  const std::int64_t late = step_ - nozzle.step_offset;
  std::uint32_t column = 0, row = 0;
  if (late < 0 || late % machine_.ticks_ != 0 || !pixel(first_line_ + nozzle.line, late / machine_.ticks_, column, row)) {
    fault(fmt::format("nozzle {} fires where there is no pixel", number));
  }
  std::uint64_t& word = fired_[std::size_t{row} * row_words_ + column / 64];
  const std::uint64_t bit = std::uint64_t{1} << (column % 64);
  if ((word & bit) != 0) fault(fmt::format("nozzle {} fires on column {}, row {} a second time", number, column, row));
  word |= bit;
  ++count.drops;
  count.farthest_along_um = std::max(count.farthest_along_um, std::abs(nozzle.along_um));
  count.farthest_across_um = std::max(count.farthest_across_um, std::abs(nozzle.across_um));
  if (watch_ != nullptr) (*watch_)({column, row, sweep_, static_cast<std::uint32_t>(step_), number, first_line_});
}

void Printing::fire_words(const std::vector<std::uint64_t>& words) {
  for (std::size_t w = 0; w < words.size(); ++w) {
    for (std::uint64_t left = words[w]; left != 0;) {
      const int bit = std::countl_zero(left);
      left &= ~(std::uint64_t{1} << (63 - bit));
      fire(static_cast<std::uint32_t>(w * 64) + static_cast<std::uint32_t>(bit));
    }
  }
}

void Printing::head_moves(double mm, double mm_s, bool scanning) {
  const double hertz = mm_s * 1000 / machine_.place_um_;
  if (scanning && hertz > profile().head.highest_frequency_hz * (1 + 1e-4)) {  // speeds are written rounded
    fault(fmt::format("scans at {:g} mm/s, where nozzles fire {:.0f} times a second; they can {:.0f}", mm_s, hertz,
                      profile().head.highest_frequency_hz));
  }
  (scanning ? count.scan_mm : count.travel_mm) += std::abs(mm);
  count.seconds += std::abs(mm) / mm_s;
}

void Printing::feeds(std::uint32_t vat, double mm, double mm_s) {
  count.fed_mm[vat] += mm;
  if (mm > 0) count.vats |= 1u << vat;
  count.seconds += std::abs(mm) / mm_s;
}

void Printing::build_vat_stands_at(double mm) {
  count.moves = true;
  count.build_mm = mm * profile().powder.build_sign;
}

void Printing::roller_stands_at(double mm) {
  rolled_ = rolled_ || std::abs(mm - profile().powder.roller_mm[1]) < 1e-3;
  roller_mm_ = mm;
}

void Printing::check_cycle(const Layer& layer) const {
  if (!count.moves) return;
  const auto& powder = profile().powder;
  const auto wrong = [&](const std::string& what) { throw fmt::format("layer {}, powder cycle: {}", layer_, what); };
  // Numbers are written to a tenth of a micrometre.
  if (const double top = mm(std::int64_t{layer.bottom} + layer.thickness); std::abs(count.build_mm - top) > 1e-3) {
    wrong(fmt::format("the build vat stands at {:g} mm where {:g} have to", count.build_mm, top));
  }
  const double fed = count.fed_mm[0] + count.fed_mm[1], dose = powder.dose * mm(layer.thickness);
  if (std::abs(fed - dose) > 1e-3) wrong(fmt::format("{:g} mm are fed where {:g} have to", fed, dose));
  if (!rolled_) wrong(fmt::format("the roller does not reach its far end at {:g} mm", powder.roller_mm[1]));
  if (std::abs(roller_mm_ - powder.roller_mm[0]) > 1e-3) {
    wrong(fmt::format("the roller stays at {:g} mm, not at {:g}", roller_mm_, powder.roller_mm[0]));
  }
}

std::int64_t Printing::line_of(std::uint32_t column, std::uint32_t row) const {
  const auto& mount = profile().mounting;
  const auto has = [&](Side side) { return mount.scan_from == side || mount.nozzle_0 == side; };
  if (mount.scan_axis == ScanAxis::kX) return has(Side::kFront) ? machine_.rows_ - 1 - row : row;
  return has(Side::kRight) ? machine_.columns_ - 1 - column : column;
}

// Where the nozzle is that has to see to a pixel.
std::string Printing::place_of(std::uint32_t column, std::uint32_t row) const {
  const auto& mount = profile().mounting;
  const auto has = [&](Side side) { return mount.scan_from == side || mount.nozzle_0 == side; };
  const std::int64_t from_left = has(Side::kRight) ? machine_.columns_ - 1 - column : column;
  const std::int64_t from_back = has(Side::kFront) ? machine_.rows_ - 1 - row : row;
  const bool x = mount.scan_axis == ScanAxis::kX;
  const std::int64_t line = x ? from_back : from_left, place = x ? from_left : from_back;
  for (const Sweep& sweep : sweeps_) {
    for (const VirtualMachine::Nozzle& nozzle : machine_.nozzle_) {
      if (nozzle.blocked || sweep.first_line + nozzle.line != line) continue;
      return fmt::format("layer {}, swath {}, step {}", layer_, sweep.number, place * machine_.ticks_ + nozzle.step_offset);
    }
  }
  return fmt::format("layer {}, line {} across, place {} along, which no swath comes over", layer_, line, place);
}

void Printing::compare(const RunsView& image, std::uint64_t moved, std::uint64_t lost) {
  if (image.columns != machine_.columns_ || image.rows() != machine_.rows_) fault("the image is of another size");
  std::vector<std::uint64_t> wanted(row_words_);
  std::uint64_t missing = 0, added = 0;
  std::string first, first_of_all;  // that nothing explains; explained or not
  const bool x = profile().mounting.scan_axis == ScanAxis::kX;
  const std::int64_t next = profile().mounting.passes;
  // Lines that a nozzle which works comes over, and those of blocked ones: only these may lose pixels. A sweep in which
  // nobody fires is not known; what no sweep comes over may be one.
  std::vector<bool> worked(machine_.lines_), blocked(machine_.lines_);
  for (const Sweep& sweep : sweeps_) {
    for (const VirtualMachine::Nozzle& nozzle : machine_.nozzle_) {
      const std::int64_t over = sweep.first_line + nozzle.line;
      if (over >= 0 && over < machine_.lines_) (nozzle.blocked ? blocked : worked)[std::size_t(over)] = true;
    }
  }
  const auto may_be_lost = [&](std::int64_t column, std::int64_t row) {
    const auto over = std::size_t(line_of(static_cast<std::uint32_t>(column), static_cast<std::uint32_t>(row)));
    return blocked[over] || !worked[over];
  };
  const auto set_and_unfired = [&](std::int64_t column, std::int64_t row) {
    if (column < 0 || row < 0 || column >= machine_.columns_ || row >= machine_.rows_ || !may_be_lost(column, row))
      return false;
    const auto line = image.row(static_cast<std::uint32_t>(row));
    const auto after = std::upper_bound(line.begin(), line.end(), static_cast<std::uint32_t>(column)) - line.begin();
    return after % 2 == 1 && (fired_[std::size_t(row) * row_words_ + std::size_t(column) / 64] >> (column % 64) & 1) == 0;
  };
  for (std::uint32_t row = 0; row < image.rows(); ++row) {
    std::fill(wanted.begin(), wanted.end(), 0);
    const auto line = image.row(row);
    for (std::size_t i = 0; i + 1 < line.size(); i += 2) {
      for (std::uint32_t c = line[i]; c < line[i + 1];) {
        const std::uint32_t to = std::min((c / 64 + 1) * 64, line[i + 1]);
        const std::uint64_t ones = to - c == 64 ? ~std::uint64_t{0} : (std::uint64_t{1} << (to - c)) - 1;
        wanted[c / 64] |= ones << (c % 64);
        c = to;
      }
    }
    for (std::uint32_t w = 0; w < row_words_; ++w) {
      const std::uint64_t got = fired_[std::size_t{row} * row_words_ + w];
      for (std::uint64_t differ = got ^ wanted[w]; differ != 0; differ &= differ - 1) {
        const auto bit = static_cast<std::uint32_t>(std::countr_zero(differ));
        const std::uint32_t column = w * 64 + bit;
        const bool extra = (got >> bit & 1) != 0;
        (extra ? added : missing) += 1;
        const bool explained =
            !extra ? moved + lost > 0 && may_be_lost(column, row)
                   : moved > 0 && (x ? set_and_unfired(column, row - next) || set_and_unfired(column, row + next)
                                     : set_and_unfired(column - next, row) || set_and_unfired(column + next, row));
        if (first_of_all.empty()) first_of_all = place_of(column, row);
        if (first.empty() && !explained) {
          first = fmt::format("{}: column {}, row {} is {}", place_of(column, row), column, row,
                              extra ? "fired and not set in the image" : "set in the image and not fired");
        }
      }
    }
  }
  if (!first.empty()) throw first;
  if (added != moved || missing != moved + lost) {
    if (first_of_all.empty()) first_of_all = fmt::format("layer {}", layer_);  // the manifest alone speaks of such pixels
    throw fmt::format("{}: {} pixels are not fired and {} fired instead; the manifest says {} and {}", first_of_all, missing,
                      added, moved + lost, moved);
  }
}

Result<ReplayCount> VirtualMachine::replay(std::string_view program, const Layer& layer, const RunsView& image,
                                           std::uint64_t moved, std::uint64_t lost) const {
  Printing printing(*this, layer.index, nullptr);
  try {
    for (const DialectReader& reader : kReaders) {
      if (reader.id != machine_.dialect) continue;
      reader.read(program, printing);
      printing.check_cycle(layer);
      printing.compare(image, moved, lost);
      return printing.count;
    }
  } catch (const std::string& fault) {
    return Error{Fault::kVerification, fault};
  }
  return Error{Fault::kVerification, fmt::format("no virtual machine reads the dialect '{}'", machine_.dialect)};
}

Result<ReplayCount> VirtualMachine::run(std::string_view program, std::uint32_t layer, const Watch& watch) const {
  Printing printing(*this, layer, &watch);
  try {
    for (const DialectReader& reader : kReaders) {
      if (reader.id != machine_.dialect) continue;
      reader.read(program, printing);
      return printing.count;
    }
  } catch (const std::string& fault) {
    return Error{Fault::kVerification, fault};
  }
  return Error{Fault::kVerification, fmt::format("no virtual machine reads the dialect '{}'", machine_.dialect)};
}

}  // namespace lamina::pipeline
