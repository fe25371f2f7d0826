#include "stages/replay/printing.h"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <tuple>
#include <utility>

namespace lamina::replay {

Printing::Printing(const VirtualMachine& machine, const Layer& layer, Purpose purpose, const VirtualMachine::Watch* watch,
                   std::uint32_t planes)
    : machine_(machine),
      watch_(watch),
      layer_(layer),
      purpose_(purpose),
      row_words_((machine.columns_ + 63) / 64),
      roller_mm_(machine.machine_.powder.roller_mm[0]),
      planes_(planes),
      times_bits_(static_cast<std::uint32_t>(std::bit_width(planes))),
      fired_(purpose == Purpose::kPrint ? std::size_t{row_words_} * machine.rows_ * times_bits_ : 0, 0) {}

Printing::Printing(const VirtualMachine& machine, const Layer& layer, std::span<const BitRows* const> planes)
    : Printing(machine, layer, Purpose::kCompare, nullptr, static_cast<std::uint32_t>(planes.size())) {
  words_.emplace(machine, planes);
}

AxisPositions Printing::axis_positions() const {
  const auto& motion = profile().motion;
  return {motion.safe_mm[0], motion.safe_mm[1], profile().powder.build_sign * (mm(layer_.bottom) - base_mm()),
          profile().powder.roller_mm[0]};
}

void Printing::fault(std::string_view what) {
  if (!ok()) return;
  const bool ahead = reading_sweep_ != INT64_MIN;  // its words are read, and it has not begun
  std::string position = fmt::format("layer {}", layer_.index);
  if (ahead || sweeping_) {
    position += fmt::format(", swath {}", ahead ? reading_sweep_ : std::int64_t{sweep_});
    if (reading_ != INT64_MIN) {
      position += fmt::format(", step {}", reading_);
    } else {
      position += stepped_ && !ahead ? fmt::format(", step {}", step_) : ", before its first step";
    }
  } else {
    position += ", before its first swath";
  }
  fail(fmt::format("{}: {}", position, what));
}

void Printing::begin_sweep(std::uint32_t number, bool backward, std::optional<std::uint32_t> of) {
  leave_sweep();
  // Further sweeps for blocked nozzles have higher numbers than the regular ones that follow them.
  if (sweeping_ && number <= sweep_ && std::ranges::find(sweeps_, number, &Sweep::number) != sweeps_.end())
    return fault(fmt::format("swath {} begins a second time", number));
  sweep_ = number;
  reading_sweep_ = INT64_MIN;
  backward_ = backward;
  sweeping_ = true;
  stepped_ = false;
  fired_here_ = false;
  ++count.sweeps;
  host_spread_ = true;
  if (of) state_sweep(*of);
  check_spread();
}

// From the side of nozzle 0: back and right are the far ends.
double Printing::across_um(double carriage_mm) const {
  const auto& mount = profile().mounting;
  const double um = (carriage_mm - mount.offset_mm[mount.scan_axis == ScanAxis::kX ? 1 : 0]) * 1000;
  const bool far = mount.nozzle_0 == Side::kBack || mount.nozzle_0 == Side::kRight;
  return far ? machine_.lines_ * machine_.line_um_ - um : um;
}

void Printing::go_across(double carriage_mm) {
  const double line = across_um(carriage_mm) / machine_.line_um_ - 0.5;
  first_line_ = std::llround(line);
  if (std::abs(line - static_cast<double>(first_line_)) > 0.02) {
    fault(fmt::format("the head is {:.2f} lines off line {}", line - static_cast<double>(first_line_), first_line_));
  }
}

double Printing::position_of(double step) const {
  const auto& mount = profile().mounting;
  double um = 0.5 * machine_.position_um_ + step * machine_.step_um_;
  if (mount.scan_from == Side::kRight || mount.scan_from == Side::kBack) um = machine_.positions_ * machine_.position_um_ - um;
  return um / 1000 + mount.offset_mm[mount.scan_axis == ScanAxis::kX ? 0 : 1];
}

std::int64_t Printing::step_at(double carriage_mm) {
  const double one = position_of(1) - position_of(0), step = (carriage_mm - position_of(0)) / one;
  if (std::abs(step - std::round(step)) > 0.05) {
    fault(fmt::format("{:.4f} mm is {:.2f} steps off a step", carriage_mm, step - std::round(step)));
    return 0;
  }
  return std::llround(step);
}

void Printing::at_step(std::int64_t step) {
  reading_ = INT64_MIN;
  if (!sweeping_) return fault("vectors before a swath");
  previous_step_ = step_;
  const bool moved = stepped_;
  step_ = step;
  stepped_ = true;
  if (moved && (backward_ ? step >= previous_step_ : step <= previous_step_)) {
    return fault(fmt::format("the head would have to go back from step {}", previous_step_));
  }
  ++count.vectors;
}

bool Printing::pixel(std::int64_t line, std::int64_t position, std::uint32_t& column, std::uint32_t& row) const {
  if (line < 0 || position < 0 || line >= machine_.lines_ || position >= machine_.positions_) return false;
  const bool x = profile().mounting.scan_axis == ScanAxis::kX;
  const auto from_left = x ? position : line, from_back = x ? line : position;
  column = static_cast<std::uint32_t>(machine_.begins_at(Side::kRight) ? machine_.columns_ - 1 - from_left : from_left);
  row = static_cast<std::uint32_t>(machine_.begins_at(Side::kFront) ? machine_.rows_ - 1 - from_back : from_back);
  return true;
}

void Printing::head_moves(double mm, double mm_s, bool scanning, std::uint32_t drops) {
  const double hertz = drops * mm_s * 1000 / machine_.position_um_;
  const double rounded = drops * kHalfMmPerMinute * 1000 / machine_.position_um_;  // speeds are written so
  if (scanning && hertz > profile().head.highest_frequency_hz * (1 + 1e-4) + rounded) {
    return fault(fmt::format("scans at {:g} mm/s, where nozzles fire {:.0f} times a second; they can {:.0f}", mm_s, hertz,
                             profile().head.highest_frequency_hz));
  }
  check_speed(mm_s, scanning);
  (scanning ? count.scan_mm : count.travel_mm) += std::abs(mm);
  const double way = std::abs(mm), a = profile().motion.acceleration_mm_s2;
  takes(a == 0 ? way / mm_s : way < mm_s * mm_s / a ? 2 * std::sqrt(way / a) : way / mm_s + mm_s / a);
  if (!scanning) return;
  const auto& maintenance = profile().maintenance;
  if (maintenance.spits()) check_maintenance("fired off the bed", maintenance.spit_layers, maintenance.spit_seconds, spat_s_);
  if (maintenance.wipes()) check_maintenance("wiped", maintenance.wipe_layers, maintenance.wipe_seconds, wiped_s_);
  if (maintenance.spits() && wiped_s_ > spat_s_) fault("scans after the wiper before the head is fired off the bed");
  if (dwelt_s_ + lamp_blocks_ > 0) fault("scans after the pause in which the layer dries");
}

// Sweeps of the BrundleFab's bar are as fast as its sprays let them, which its reader holds.
void Printing::check_speed(double mm_s, bool scanning) {
  if (purpose_ == Purpose::kTime || profile().dialect == "brundlefab") return;
  const auto& motion = profile().motion;
  if (scanning) {
    if (std::abs(mm_s - motion.scan_speed_mm_s) < 1.01 * kHalfMmPerMinute) return;
    return fault(fmt::format("scans at {:g} mm/s where {:g} have to be", mm_s, motion.scan_speed_mm_s));
  }
  const double wipe = profile().maintenance.wipes() ? profile().maintenance.wipe_speed_mm_s : 0;
  const double roller = roller_on_gantry() ? profile().powder.roller_speed_mm_s : 0;
  const double maximum = std::max({motion.travel_speed_mm_s, motion.scan_speed_mm_s, wipe, roller});
  if (mm_s > maximum + 1.01 * kHalfMmPerMinute)
    fault(fmt::format("the head travels at {:g} mm/s, the profile's fastest is {:g}", mm_s, maximum));
}

bool Printing::has_ramps(double before_mm, double behind_mm, double adjacent_mm) {
  const double ramp = profile().motion.ramp_mm;
  if (std::min(before_mm, behind_mm) > ramp - adjacent_mm) return true;
  fault(fmt::format("{:g} mm before the first drops and {:g} after the last are left, where ramps of {:g} have to be",
                    before_mm, behind_mm, ramp));
  return false;
}

const Count& Printing::finish() {
  leave_sweep();
  const auto& powder = profile().powder;
  takes(powder.pause_s);
  const auto spread = [&](double height_mm) {
    const double by_moves = (1 + powder.dose) * height_mm / powder.vat_speed_mm_s +
                            2 * std::abs(powder.roller_mm[1] - powder.roller_mm[0]) / powder.roller_speed_mm_s;
    takes(powder.spread_s > 0 ? powder.spread_s : by_moves);
  };
  if (!moves_powder_) {
    for (std::uint32_t below = 0; below < base_layers(); ++below) spread(powder.base_layer_mm);
    spread(mm(layer_.thickness));
  }
  count.microseconds = std::llround((seconds_ < kMaxSeconds ? seconds_ : kMaxSeconds) * 1e6);
  return count;
}

// Drops of nozzles on pixels: Printing::fire.

void Printing::fire(std::uint32_t number, std::uint32_t drops) {
  if (number >= machine_.nozzle_.size()) return fault(fmt::format("nozzle {} does not exist", number));
  const VirtualMachine::Nozzle& nozzle = machine_.nozzle_[number];
  if (nozzle.blocked) return fault(fmt::format("nozzle {} fires, which is blocked", number));
  if (!fired_here_) sweeps_.push_back({sweep_, first_line_});
  fired_here_ = true;
  const std::int64_t late = step_ - nozzle.step_offset;
  std::uint32_t column = 0, row = 0;
  if (late < 0 || late % machine_.ticks_ != 0 || !pixel(first_line_ + nozzle.line, late / machine_.ticks_, column, row)) {
    return fault(fmt::format("nozzle {} fires where there is no pixel", number));
  }
  if (drops > profile().head.max_drops) {
    return fault(fmt::format("nozzle {} fires {} drops at one position, the head has at most {}", number, drops,
                             profile().head.max_drops));
  }
  std::uint64_t* const fired = &fired_[(std::size_t{row} * row_words_ + column / 64) * times_bits_];
  const unsigned bit = column % 64;
  std::uint32_t times = drops;
  for (std::uint32_t b = 0; b < times_bits_; ++b) times += static_cast<std::uint32_t>(fired[b] >> bit & 1) << b;
  if (times > planes_) {
    return fault(fmt::format("nozzle {} fires on column {}, row {} {}", number, column, row,
                             planes_ == 1 ? "a second time" : fmt::format("more than {} times", planes_)));
  }
  for (std::uint32_t b = 0; b < times_bits_; ++b) {
    fired[b] = (fired[b] & ~(std::uint64_t{1} << bit)) | std::uint64_t{times >> b & 1} << bit;
  }
  count.drops += drops;
  sweep_max_ = std::max(sweep_max_, drops);
  count.max_per_position = std::max(count.max_per_position, drops);
  count.farthest_along_um = std::max(count.farthest_along_um, std::abs(nozzle.along_um));
  count.farthest_across_um = std::max(count.farthest_across_um, std::abs(nozzle.across_um));
  for (std::uint32_t k = 0; watch_ != nullptr && k < drops; ++k) {
    (*watch_)({column, row, sweep_, static_cast<std::uint32_t>(step_), number, first_line_});
  }
}

std::uint64_t Printing::fired_more(std::uint32_t times, std::size_t word) const {
  std::uint64_t more = 0, same = ~std::uint64_t{0};
  for (std::uint32_t b = times_bits_; b-- > 0;) {
    const std::uint64_t fired = fired_[word * times_bits_ + b];
    if ((times >> b & 1) == 0) more |= same & fired;
    same &= (times >> b & 1) != 0 ? fired : ~fired;
  }
  return more;
}

std::uint32_t Printing::sweeps_per_position() const {
  const auto& head = profile().head;
  const double hertz = profile().motion.scan_speed_mm_s * 1000 / machine_.position_um_;
  const double fits = std::clamp(std::floor(head.highest_frequency_hz / hertz + 1e-9), 1.0, double(head.max_drops));
  return static_cast<std::uint32_t>(std::ceil(planes_ / fits));
}

void Printing::leave_sweep() {
  if (sweep_max_ == 0 || profile().head.max_drops < 2) return;
  const std::uint32_t number = sweep_ / sweeps_per_position();
  if (number != position_.number) position_ = {};
  position_.number = number;
  const std::uint32_t maximum = profile().head.max_drops;
  const auto needed = [&] { return (position_.drops + maximum - 1) / maximum; };  // sweeps, for the drops so far
  const std::uint32_t before = needed();
  position_.drops += sweep_max_;
  if (needed() == before) added_.insert(sweep_);
  count.added = static_cast<std::uint32_t>(added_.size());
  sweep_max_ = 0;
}

std::uint32_t Printing::fire_words(std::span<const std::uint64_t> words, std::uint32_t bits) {
  const std::uint32_t maximum = max_drops(words, bits);
  if (maximum == 0 || purpose_ == Purpose::kTime) return maximum;
  if (!words_) {
    fire_singly(words, bits);
    return maximum;
  }
  if (!fired_here_) sweeps_.push_back({sweep_, first_line_});
  fired_here_ = true;
  sweep_max_ = std::max(sweep_max_, maximum);
  count.max_per_position = std::max(count.max_per_position, maximum);
  words_->fire(first_line_, step_, words, bits, flip_);
  return maximum;
}

std::uint32_t Printing::max_drops(std::span<const std::uint64_t> words, std::uint32_t bits) const {
  const std::size_t size = words.size() / bits;
  std::uint32_t maximum = 0;
  if (bits == 1) return std::ranges::any_of(words, [](std::uint64_t word) { return word != 0; }) ? 1 : 0;
  for (std::size_t w = 0; w < size; ++w) {
    std::uint64_t among = ~std::uint64_t{0};  // nozzles with as many as any of the word, in the bits so far
    std::uint32_t drops = 0;
    for (std::uint32_t b = bits; b-- > 0;) {
      const std::uint64_t more = among & words[b * size + w];
      if (more == 0) continue;
      among = more;
      drops |= 1u << b;
    }
    maximum = std::max(maximum, drops);
  }
  return maximum;
}

void Printing::fire_singly(std::span<const std::uint64_t> words, std::uint32_t bits) {
  const std::size_t size = words.size() / bits;
  for (std::size_t w = 0; w < size; ++w) {
    std::uint64_t left = 0;
    for (std::uint32_t b = 0; b < bits; ++b) left |= words[b * size + w];
    while (left != 0 && ok()) {
      const auto bit = static_cast<std::uint32_t>(flip_ == 0 ? std::countr_zero(left) : 63 - std::countl_zero(left));
      left &= ~(std::uint64_t{1} << bit);
      std::uint32_t drops = 0;
      for (std::uint32_t b = 0; b < bits; ++b) drops |= static_cast<std::uint32_t>(words[b * size + w] >> bit & 1) << b;
      fire(static_cast<std::uint32_t>(w * 64) + (bit ^ flip_), drops);
    }
  }
}

// What a program says of its layer and of its sweeps, against the layer and where the sweeps are.

void Printing::state_layers(std::uint32_t layers) {
  if (machine_.layers_ == 0 || layers == machine_.layers_) return;
  fault(fmt::format("the program is of {} layers, the job has {}", layers, machine_.layers_));
}

void Printing::state_heights(std::optional<double> bottom_mm, double thickness_mm) {
  const double bottom = mm(layer_.bottom), thickness = mm(layer_.thickness);
  if (std::abs(thickness_mm - thickness) > 1e-4) {
    wrong_powder(fmt::format("its stated thickness is {:g} mm where {:g} have to be", thickness_mm, thickness));
  } else if (bottom_mm && std::abs(*bottom_mm - bottom) > 1e-4) {
    wrong_powder(fmt::format("its stated bottom is at {:g} mm where {:g} have to be", *bottom_mm, bottom));
  }
}

void Printing::state_sweep(std::uint32_t of) {
  if (backward_ && !profile().motion.both_directions) fault("runs back, and the profile's head fires only in forward sweeps");
  if (swaths_stated_ && *swaths_stated_ != of)
    fault(fmt::format("is one of {} swaths, the preceding ones of {}", of, *swaths_stated_));
  swaths_stated_ = of;
}

// The first line of the layer that has something; the last one if none has.
std::int64_t Printing::first_of_layer(const BitRows& image) const {
  std::int64_t first = machine_.lines_ - 1;
  std::vector<std::uint64_t> words(image.words());
  for (std::uint32_t row = 0; row < image.rows(); ++row) {
    image.row(row, words);
    const auto is_set = [](std::uint64_t word) { return word != 0; };
    const auto begin = std::ranges::find_if(words, is_set);
    if (begin == words.end()) continue;
    const auto end = std::find_if(words.rbegin(), words.rend(), is_set);
    const auto left = static_cast<std::uint32_t>((begin - words.begin()) * 64 + std::countr_zero(*begin));
    const auto right = static_cast<std::uint32_t>((words.rend() - end) * 64 - 1 - std::countl_zero(*end));
    first = std::min({first, line_of(left, row), line_of(right, row)});
  }
  return first;
}

// Numbers follow from where sweeps begin: a swath after the other, of each its passes, of each the sweeps for its drops.
void Printing::check_numbers(std::int64_t first_of_layer) {
  if (!swaths_stated_) return;
  const auto& mount = profile().mounting;
  const std::int64_t lines = std::int64_t{nozzles()} * mount.passes, stride = lines - mount.overlap_lines;
  std::int64_t first = mount.first_swath == FirstSwath::kLayer ? first_of_layer : 0;
  first -= static_cast<std::int64_t>(layer_.index) * mount.joint_shift_lines % stride;
  const std::int64_t left = machine_.lines_ - first;
  const std::int64_t swaths = left <= lines ? 1 : 1 + (left - lines + stride - 1) / stride;
  const std::int64_t per_position = sweeps_per_position(), of = swaths * mount.passes * per_position;
  if (*swaths_stated_ != of)
    return fail(
        fmt::format("layer {}, before its first swath: states {} swaths, and has {}", layer_.index, *swaths_stated_, of));
  const bool further = profile().head.blocked_rule == BlockedRule::kSecondPass && !profile().head.blocked.empty();
  for (const Sweep& sweep : sweeps_) {
    if (sweep.number >= of) {
      if (further) continue;
      return fail(fmt::format("layer {}, swath {}, before its first step: is beyond the {} that the layer has", layer_.index,
                              sweep.number, of));
    }
    const std::int64_t position = sweep.number / per_position,
                       at = first + position / mount.passes * stride + position % mount.passes;
    if (sweep.first_line == at) continue;
    return fail(
        fmt::format("layer {}, swath {}, before its first step: begins at line {}, and the swath of that number at line {}",
                    layer_.index, sweep.number, sweep.first_line, at));
  }
}

// What a layer printed against its image: Printing::compare.

std::array<std::int64_t, 2> Printing::line_and_position(std::uint32_t column, std::uint32_t row) const {
  const std::int64_t from_left = machine_.begins_at(Side::kRight) ? machine_.columns_ - 1 - column : column;
  const std::int64_t from_back = machine_.begins_at(Side::kFront) ? machine_.rows_ - 1 - row : row;
  if (profile().mounting.scan_axis == ScanAxis::kX) return {from_back, from_left};
  return {from_left, from_back};
}

// Where the nozzle is that has to see to a pixel.
std::string Printing::describe_position(std::uint32_t column, std::uint32_t row) const {
  const auto [line, position] = line_and_position(column, row);
  for (const Sweep& sweep : sweeps_) {
    for (const VirtualMachine::Nozzle& nozzle : machine_.nozzle_) {
      if (nozzle.blocked || sweep.first_line + nozzle.line != line) continue;
      return fmt::format("layer {}, swath {}, step {}", layer_.index, sweep.number,
                         position * machine_.ticks_ + nozzle.step_offset);
    }
  }
  return fmt::format("layer {}, line {} across, position {} along, which no swath covers", layer_.index, line, position);
}

// Lines of blocked nozzles, and those that no nozzle which works comes over: only these may lose pixels. A sweep in which
// no nozzle fires is not known; lines that no sweep comes over may be one.
std::vector<bool> Printing::lines_that_may_be_lost() const {
  std::vector<bool> worked(machine_.lines_), blocked(machine_.lines_);
  for (const Sweep& sweep : sweeps_) {
    for (const VirtualMachine::Nozzle& nozzle : machine_.nozzle_) {
      const std::int64_t over = sweep.first_line + nozzle.line;
      if (over >= 0 && over < machine_.lines_) (nozzle.blocked ? blocked : worked)[std::size_t(over)] = true;
    }
  }
  for (std::size_t line = 0; line < blocked.size(); ++line) blocked[line] = blocked[line] || !worked[line];
  return blocked;
}

void Printing::compare_plane(const BitRows& image, std::uint32_t plane, std::uint64_t moved, std::uint64_t lost,
                             Differences& differ) const {
  const bool x = profile().mounting.scan_axis == ScanAxis::kX;
  const std::int64_t next = profile().mounting.passes;
  const auto may_be_lost = [&](std::int64_t column, std::int64_t row) {
    return differ.may_be_lost[std::size_t(line_of(static_cast<std::uint32_t>(column), static_cast<std::uint32_t>(row)))];
  };
  const auto set_and_unfired = [&](std::int64_t column, std::int64_t row) {
    if (column < 0 || row < 0 || column >= machine_.columns_ || row >= machine_.rows_ || !may_be_lost(column, row))
      return false;
    if (differ.neighbour_row != row) image.row(static_cast<std::uint32_t>(row), differ.neighbour);
    differ.neighbour_row = row;
    const std::uint64_t fired = fired_more(plane, std::size_t(row) * row_words_ + std::size_t(column) / 64);
    return ((differ.neighbour[std::size_t(column) / 64] & ~fired) >> (column % 64) & 1) != 0;
  };
  differ.neighbour_row = -1;
  for (std::uint32_t row = 0; row < image.rows(); ++row) {
    image.row(row, differ.wanted);
    for (std::uint32_t w = 0; w < row_words_; ++w) {
      const std::uint64_t got = fired_more(plane, std::size_t{row} * row_words_ + w);
      for (std::uint64_t different = got ^ differ.wanted[w]; different != 0; different &= different - 1) {
        const auto bit = static_cast<std::uint32_t>(std::countr_zero(different));
        const std::uint32_t column = w * 64 + bit;
        const bool extra = (got >> bit & 1) != 0;
        (extra ? differ.added : differ.missing) += 1;
        const bool explained =
            !extra ? moved + lost > 0 && may_be_lost(column, row)
                   : moved > 0 && (x ? set_and_unfired(column, row - next) || set_and_unfired(column, row + next)
                                     : set_and_unfired(column - next, row) || set_and_unfired(column + next, row));
        if (differ.first_of_all.empty()) differ.first_of_all = describe_position(column, row);
        if (differ.first.empty() && !explained) {
          differ.first = fmt::format("{}: column {}, row {} is {}{}", describe_position(column, row), column, row,
                                     extra ? "fired and not set in the image" : "set in the image and not fired",
                                     planes_ == 1 ? "" : fmt::format(", drop {}", plane + 1));
        }
      }
    }
  }
}

void Printing::compare(std::span<const BitRows* const> planes, std::uint64_t moved, std::uint64_t lost) {
  if (words_) return compare_words(moved, lost);
  Differences differ;
  differ.wanted.resize(row_words_);
  differ.neighbour.resize(row_words_);
  differ.may_be_lost = lines_that_may_be_lost();
  for (std::uint32_t plane = 0; plane < planes.size(); ++plane) {
    const BitRows& image = *planes[plane];
    if (image.columns() != machine_.columns_ || image.rows() != machine_.rows_) return fault("the image is of another size");
    compare_plane(image, plane, moved, lost, differ);
  }
  if (differ.first.empty()) check_numbers(first_of_layer(*planes[0]));
  const std::uint64_t missing = differ.missing, added = differ.added;
  if (!differ.first.empty()) {
    return fail(fmt::format("{}; in all {} pixels are not fired and {} fired too many", differ.first, missing, added));
  }
  if (added != moved || missing != moved + lost) {
    // The manifest alone may speak of such pixels.
    const std::string position = differ.first_of_all.empty() ? fmt::format("layer {}", layer_.index) : differ.first_of_all;
    fail(fmt::format("{}: {} pixels are not fired and {} fired instead; the manifest says {} and {}", position, missing, added,
                     moved + lost, moved));
  }
}

void Printing::compare_words(std::uint64_t moved, std::uint64_t lost) {
  if (!words_->agrees(lines_that_may_be_lost(), moved, lost)) return fault("drops differ from the image");
  check_numbers(words_->first_line());
  count.drops = words_->drops();
  count.farthest_along_um = std::max(count.farthest_along_um, words_->along_um());
  count.farthest_across_um = std::max(count.farthest_across_um, words_->across_um());
}

// Maintenance of head and powder on the virtual machine, in any dialect: stages/replay/printing.h.

void Printing::leaves_wiper(std::string_view what) {
  if (own_ > 0) fault(fmt::format("{} before all of the machine's own lines", what));
  own_ = 0;
  at_wiper_ = false;
}

// A wipe is a G1 as fast as the profile has it: travels may have the same ends.
void Printing::head_is_at(double x_mm, double y_mm, double works_mm_s) {
  const auto& maintenance = profile().maintenance;
  leaves_wiper("the head moves on");
  leaves_position();
  if (lamp_on_) {
    fault(fmt::format("the head moves before '{}', which ends the pause to dry", profile().powder.dry_off_lines.front()));
  }
  if (filled_ && std::hypot(x_mm - profile().motion.safe_mm[0], y_mm - profile().motion.safe_mm[1]) > 1e-3) {
    fault(fmt::format("the head goes to {:g}, {:g} mm after the pause to fill vats, not to its safe position", x_mm, y_mm));
  }
  filled_ = false;
  const bool slow = std::abs(works_mm_s - maintenance.wipe_speed_mm_s) < 1.01 * kHalfMmPerMinute;
  if (const auto& wiper = maintenance.wipe_mm; wiper && slow) {
    const auto [x, y] = head_mm_.value_or(profile().motion.safe_mm);
    if (std::hypot(x - (*wiper)[0], y - (*wiper)[1]) + std::hypot(x_mm - (*wiper)[2], y_mm - (*wiper)[3]) < 1e-3) {
      at_wiper_ = true;
      wiped_s_ = seconds_;
      ++count.wipes;
    }
  }
  head_mm_ = {x_mm, y_mm};
}

void Printing::leaves_position() {
  const std::uint32_t drops = profile().maintenance.spit_drops;
  if (spat_here_ % std::max(1u, drops) != 0) {
    fault(fmt::format("nozzles fire {} drops off the bed, where {} are a shot", spat_here_, drops));
  }
  spat_here_ = 0;
}

void Printing::check_maintenance(std::string_view what, std::uint32_t every, double limit_s, double done_s) {
  const bool due = limit_s > 0 || (every > 0 && layer_.index % every == 0);
  if (done_s < 0 && due) return fault(fmt::format("scans before the head is {}, as it has to be in this layer", what));
  if (limit_s == 0 || seconds_ - done_s <= limit_s) return;
  fault(fmt::format("a sweep ends {:.2f} s after the head was {} where {:g} may pass", seconds_ - done_s, what, limit_s));
}

void Printing::outside_bed(double x_mm, double y_mm) {
  const bool x = profile().mounting.scan_axis == ScanAxis::kX;
  const auto line = static_cast<std::int64_t>(std::floor(across_um(x ? y_mm : x_mm) / machine_.line_um_));
  const double step = ((x ? x_mm : y_mm) - position_of(0)) / (position_of(1) - position_of(0));
  for (std::uint32_t nozzle = 0; nozzle < nozzles(); ++nozzle) {
    const auto [column, row] = machine_.nozzle_at(line, step, nozzle);
    if (machine_.nozzle_[nozzle].blocked || column < -0.5 || row < -0.5 || column > machine_.columns_ - 0.5 ||
        row > machine_.rows_ - 0.5) {
      continue;
    }
    return fault(fmt::format("nozzle {} fires off the bed where column {:.0f}, row {:.0f} of it is", nozzle, column, row));
  }
}

void Printing::spits(double x_mm, double y_mm, std::uint64_t drops, double seconds) {
  const auto& maintenance = profile().maintenance;
  if (!maintenance.spits() || !maintenance.spit_mm) return fault("fires off the bed, and the profile has no position for it");
  if (std::hypot(x_mm - (*maintenance.spit_mm)[0], y_mm - (*maintenance.spit_mm)[1]) > 1e-3) {
    return fault(fmt::format("fires off the bed at {:g}, {:g} mm, not at {:g}, {:g}", x_mm, y_mm, (*maintenance.spit_mm)[0],
                             (*maintenance.spit_mm)[1]));
  }
  outside_bed(x_mm, y_mm);
  for (const VirtualMachine::Nozzle& nozzle : machine_.nozzle_) count.spat += nozzle.blocked ? 0 : drops;
  leaves_wiper("nozzles fire off the bed");
  takes(seconds);
  spat_here_ += drops;
  if (spat_here_ > maintenance.spit_drops) {
    return fault(fmt::format("nozzles fire {} drops off the bed, where {} are a shot", spat_here_, maintenance.spit_drops));
  }
  if (spat_here_ < maintenance.spit_drops) return;
  spat_s_ = seconds_;
  ++count.spits;
}

void Printing::waits_capped(std::string_view what) {
  const auto& cap = profile().maintenance.cap_mm;
  const auto at = cap.value_or(profile().motion.safe_mm);
  if (head_at(at)) return;
  fault(fmt::format("{} while the head is not at its {}, {:g}, {:g} mm", what, cap ? "cap" : "safe position", at[0], at[1]));
}

void Printing::refills() {
  if (count.fed_mm[0] + count.fed_mm[1] > 0) return fault("waits for the vats to be filled after the layer's powder");
  waits_capped("the vats are filled");
  filled_ = profile().maintenance.cap_mm.has_value();
  if (++count.refills > 1) fault("waits for the vats to be filled a second time");
}

void Printing::dwells(double seconds) {
  waits_capped("the layer dries");
  leaves_wiper("the layer dries");
  dwelt_s_ += seconds;
  takes(seconds);
}

bool Printing::takes_own(std::string_view line) {
  const auto& powder = profile().powder;
  // The block that may come now.
  const auto& lines = at_wiper_ ? profile().maintenance.wipe_lines : dwelt_s_ > 0 ? powder.dry_off_lines : powder.dry_on_lines;
  if (own_ < lines.size() && lines[own_] == line) {
    if (under_way_) fault(fmt::format("'{}' comes while the head may still move; G4 P0 waits for it", line));
    if (!at_wiper_) waits_capped(fmt::format("'{}' of the pause to dry comes", line));
    if (++own_ < lines.size()) return true;
    own_ = 0;
    ++(at_wiper_ ? wiper_blocks_ : lamp_blocks_);
    lamp_on_ = !at_wiper_ && dwelt_s_ == 0 && !profile().powder.dry_off_lines.empty();
    at_wiper_ = false;
    return true;
  }
  if (own_ > 0) fault(fmt::format("'{}' is where the machine's own '{}' has to be", line, lines[own_]));
  return false;
}

void Printing::state_host(std::string_view record, bool of_powder) {
  if (of_powder && host_spread_) return fault(fmt::format("{} comes after the layer's powder", record));
  if (of_powder && record != "FILL" && !head_at_safe()) {
    return fault(fmt::format("{} comes while the head is not at its safe position, and the powder is spread", record));
  }
  host_spread_ = host_spread_ || !of_powder;
}

void Printing::state_base(std::uint32_t layers, double layer_mm) {
  if (based_) return fault("states a base of powder a second time");
  based_ = true;
  if (layers == base_layers() && std::abs(layer_mm - profile().powder.base_layer_mm) < 1e-6) return;
  fault(fmt::format("states a base of {} layers of {:g} mm, where {} of {:g} have to be", layers, layer_mm, base_layers(),
                    profile().powder.base_layer_mm));
}

void Printing::check_pauses() {
  const auto& powder = profile().powder;
  if (std::abs(dwelt_s_ - powder.dry_s) > 1e-3) {
    wrong_cycle(fmt::format("the layer dries for {:g} s where {:g} have to be", dwelt_s_, powder.dry_s));
  }
  const std::uint32_t lamps = (powder.dry_on_lines.empty() ? 0 : 1) + (powder.dry_off_lines.empty() ? 0 : 1);
  const std::uint32_t wipers = profile().maintenance.wipe_lines.empty() ? 0 : count.wipes;
  if (lamp_blocks_ == lamps && wiper_blocks_ == wipers) return;
  wrong_cycle(
      fmt::format("the machine's own lines come {} times where {} are expected", lamp_blocks_ + wiper_blocks_, lamps + wipers));
}

// Of a program that moves no powder.
void Printing::check_stated() {
  check_pauses();
  if (base_layers() > 0 && !based_) wrong_cycle(fmt::format("its base of {} layers is not stated", base_layers()));
  if (const double rpm = profile().powder.roller_rpm; std::abs(rpm_ - rpm) > 1e-3) {
    wrong_cycle(fmt::format("the stated roller speed is {:g} turns a minute where {:g} have to be", rpm_, rpm));
  }
}

// The powder of a layer: the order and the positions of roller, vats and head. Errors are reported by check_cycle alone, which
// knows the layer's true heights.

void Printing::wrong_cycle(std::string_view what) { fail(fmt::format("layer {}, powder cycle: {}", layer_.index, what)); }

bool Printing::roller_on_gantry() const {
  const auto& [powder, motion] = std::tie(profile().powder, profile().motion);
  return powder.roller_axis == motion.x_axis || powder.roller_axis == motion.y_axis;
}

bool Printing::head_at(const std::array<double, 2>& at) const {
  const auto [x, y] = head_mm_.value_or(profile().motion.safe_mm);
  return std::hypot(x - at[0], y - at[1]) < 1e-3;
}

void Printing::check_way(MovingPart part, double mm_s) {
  const auto& powder = profile().powder;
  const bool gantry = roller_on_gantry();
  const auto at_roller = [&] {
    return fmt::format("while the roller is at {:g} mm, not at {:g}", roller_mm_, powder.roller_mm[0]);
  };
  if (part == MovingPart::kHead) {
    if (!gantry && !roller_at_home()) wrong_powder(fmt::format("the head moves {}", at_roller()));
    return;
  }
  const bool roller = part == MovingPart::kRoller;
  if (roller && !head_at_safe()) {
    wrong_powder(fmt::format("the roller moves while the head is at {:g}, {:g} mm, not at its safe position", (*head_mm_)[0],
                             (*head_mm_)[1]));
  }
  // Oasis lowers its pistons before the spreader goes back.
  if (!roller && profile().dialect != "oasis" && !roller_at_home() && !(gantry && head_at_safe())) {
    wrong_powder(fmt::format("a vat moves {}", at_roller()));
  }
  const double speed = roller ? powder.roller_speed_mm_s : powder.vat_speed_mm_s;
  if (std::abs(mm_s - speed) < 1.01 * kHalfMmPerMinute) return;
  wrong_powder(fmt::format("{} moves at {:g} mm/s where {:g} have to be", roller ? "the roller" : "a vat", mm_s, speed));
}

void Printing::check_spread() {
  const std::string& dialect = profile().dialect;
  if (dialect == "raw" || dialect == "planes") return;
  if (!rolled_) return wrong_powder("the first sweep begins before powder is spread");
  const double top = mm(std::int64_t{layer_.bottom} + layer_.thickness);
  if (dialect == "brundlefab" || std::abs(count.build_mm - top) < 1e-3) return;  // its bins give way to the carriage
  wrong_powder(fmt::format("a sweep begins with the build vat at {:g} mm where {:g} have to be", count.build_mm, top));
}

void Printing::feeds(std::uint32_t vat, double mm, double mm_s) {
  count.fed_mm[vat] += mm;
  if (mm > 0) count.vats |= 1u << vat;
  moves_powder_ = true;
  takes(std::abs(mm) / mm_s);
}

void Printing::build_vat_is_at(double mm) {
  count.moves = moves_powder_ = true;
  count.build_mm = mm * profile().powder.build_sign;
}

void Printing::roller_is_at(double mm, bool may_spread) {
  moves_powder_ = true;
  const double far = profile().powder.roller_mm[1];
  const bool comes = std::abs(roller_mm_ - far) >= 1e-3 || std::abs(profile().powder.roller_mm[0] - far) < 1e-3;
  if (may_spread && std::abs(mm - far) < 1e-3 && comes)
    strokes(count.moves ? count.build_mm : lamina::mm(layer_.bottom) - base_mm(), count.fed_mm[0] + count.fed_mm[1]);
  rolled_ = rolled_ || strokes_ > base_layers();
  const double home = profile().powder.roller_mm[0];
  if (rpm_ != 0 && std::abs(mm - home) < 1e-3 && std::abs(roller_mm_ - home) >= 1e-3) {
    wrong_powder(fmt::format("the roller returns with {:g} turns a minute, and must not turn", rpm_));
  }
  roller_mm_ = mm;
}

void Printing::strokes(double build_mm, double fed_mm) {
  const auto& powder = profile().powder;
  ++strokes_;
  if (powder.roller_rpm > 0 && std::abs(rpm_ - powder.roller_rpm) > 1e-3) {
    wrong_powder(fmt::format("the roller spreads with {:g} turns a minute where {:g} have to be", rpm_, powder.roller_rpm));
  }
  if (profile().dialect == "oasis") return;  // whose reader sees where it turns
  if (strokes_ > base_layers() + 1) {
    if (!roller_on_gantry()) wrong_powder("the roller spreads once more than the layer needs");
    return;
  }
  const bool base = strokes_ <= base_layers();
  const double above = base ? base_mm() - strokes_ * powder.base_layer_mm : -mm(layer_.thickness);  // still to be spread
  const double build = mm(layer_.bottom) - above, fed = powder.dose * (base_mm() - above);
  if (std::abs(build_mm - build) > 1e-3 || std::abs(fed_mm - fed) > 1e-3 * strokes_) {
    wrong_powder(fmt::format("{} is spread with the build vat at {:g} mm and {:g} mm fed, not {:g} and {:g}",
                             base ? fmt::format("layer {} of the base", strokes_) : "powder", build_mm, fed_mm, build, fed));
  }
}

void Printing::spreads(double build_mm, double fed_mm, double clearance_mm) {
  const auto& powder = profile().powder;
  const bool base = strokes_ < base_layers();
  const double height = base ? (strokes_ + 1) * powder.base_layer_mm : base_mm() + mm(layer_.thickness);
  const double build = build_mm * powder.build_sign, top = mm(layer_.bottom) - base_mm() + height - clearance_mm;
  const double fed = powder.dose * height + clearance_mm;
  if (std::abs(build - top) > 1e-3) {
    wrong_powder(fmt::format("powder is spread with the build vat at {:g} mm where {:g} have to be", build, top));
  } else if (std::abs(fed_mm - fed) > 1e-3) {
    wrong_powder(fmt::format("powder is spread with {:g} mm fed where {:g} have to be", fed_mm, fed));
  }
}

// SerialGRBL.py, NewLayer, takes it 1 mm down before a layer, which a thicker one's place lies below.
void Printing::pistons_came(double build_mm, double feed_mm) {
  constexpr double kThickMm = 1.25;
  const auto& powder = profile().powder;
  const double height = strokes_ < base_layers() ? powder.base_layer_mm : mm(layer_.thickness);
  const bool build = build_mm * powder.build_sign < 0 || height >= kThickMm;
  if (build && feed_mm * powder.feed_sign > 0) return;
  wrong_powder(fmt::format("the {} piston comes to its position from above, and has play", build ? "feed" : "build"));
}

void Printing::check_cycle() {
  const auto& powder = profile().powder;
  if (const AxisPositions next = axis_positions();
      head_mm_ && std::hypot((*head_mm_)[0] - next.x_mm, (*head_mm_)[1] - next.y_mm) > 1e-3) {
    wrong_cycle(fmt::format("the head stays at {:g}, {:g} mm, and the next layer finds it at {:g}, {:g}", (*head_mm_)[0],
                            (*head_mm_)[1], next.x_mm, next.y_mm));
  }
  if (lowered_mm_) count.build_mm = mm(layer_.bottom) + *lowered_mm_;
  if (profile().dialect == "raw" || profile().dialect == "planes") {  // the head alone
    if (!spread_wrong_.empty()) wrong_cycle(spread_wrong_);
    return check_stated();
  }
  if (!count.moves) return wrong_cycle("the build vat does not move");
  if (!rolled_) wrong_cycle(fmt::format("the roller does not reach its far end at {:g} mm", powder.roller_mm[1]));
  if (!spread_wrong_.empty()) return wrong_cycle(spread_wrong_);
  // Numbers are written to a tenth of a micrometre.
  if (const double top = mm(std::int64_t{layer_.bottom} + layer_.thickness); std::abs(count.build_mm - top) > 1e-3) {
    wrong_cycle(fmt::format("the build vat is at {:g} mm where {:g} have to be", count.build_mm, top));
  }
  const double fed = count.fed_mm[0] + count.fed_mm[1], dose = powder.dose * (mm(layer_.thickness) + base_mm());
  if (std::abs(fed - dose) > 1e-3 * (1 + base_layers()))
    wrong_cycle(fmt::format("{:g} mm are fed where {:g} have to be", fed, dose));
  check_pauses();
  if (rpm_ != 0) wrong_cycle(fmt::format("the roller still makes {:g} turns a minute when the layer ends", rpm_));
  if (std::abs(roller_mm_ - powder.roller_mm[0]) > 1e-3) {
    wrong_cycle(fmt::format("the roller stays at {:g} mm, not at {:g}", roller_mm_, powder.roller_mm[0]));
  }
}

}  // namespace lamina::replay
