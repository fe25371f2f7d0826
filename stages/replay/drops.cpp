// Drops of nozzles on pixels: Printing::fire.
#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cmath>

#include "stages/replay/printing.h"

namespace lamina::replay {

void Printing::fire(std::uint32_t number, std::uint32_t drops) {
  if (purpose_ == Purpose::kTime) return;
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
  if (drops > profile().head.most_drops) {
    return fault(
        fmt::format("nozzle {} fires {} drops at a place, the head has at most {}", number, drops, profile().head.most_drops));
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
  fires_row_[row] = 1;
  count.drops += drops;
  sweep_most_ = std::max(sweep_most_, drops);
  count.most_at_place = std::max(count.most_at_place, drops);
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

std::uint32_t Printing::sweeps_a_place() const {
  const auto& head = profile().head;
  const double hertz = profile().motion.scan_speed_mm_s * 1000 / machine_.place_um_;
  const double fits = std::clamp(std::floor(head.highest_frequency_hz / hertz + 1e-9), 1.0, double(head.most_drops));
  return static_cast<std::uint32_t>(std::ceil(planes_ / fits));
}

void Printing::leave_sweep() {
  if (sweep_most_ == 0 || profile().head.most_drops < 2) return;
  const std::uint32_t number = sweep_ / sweeps_a_place();
  if (number != place_.number) place_ = {};
  place_.number = number;
  const std::uint32_t most = profile().head.most_drops;
  const auto needed = [&] { return (place_.drops + most - 1) / most; };  // sweeps, for the drops so far
  const std::uint32_t before = needed();
  place_.drops += sweep_most_;
  if (needed() == before) added_.insert(sweep_);
  count.added = static_cast<std::uint32_t>(added_.size());
  sweep_most_ = 0;
}

std::uint32_t Printing::drop_bits() const { return replay::drop_bits(profile().head.most_drops); }

void Printing::fire_words(std::span<const std::uint64_t> words) {
  if (purpose_ == Purpose::kTime) return;
  for (std::size_t w = 0; w < words.size(); ++w) {
    for (std::uint64_t left = words[w]; left != 0 && ok();) {
      const int bit = std::countl_zero(left);
      left &= ~(std::uint64_t{1} << (63 - bit));
      fire(static_cast<std::uint32_t>(w * 64) + static_cast<std::uint32_t>(bit));
    }
  }
}

}  // namespace lamina::replay
