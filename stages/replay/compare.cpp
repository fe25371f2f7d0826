// What a layer printed against its image: Printing::compare.
#include <fmt/format.h>

#include <algorithm>
#include <bit>

#include "stages/replay/printing.h"

namespace lamina::replay {

std::int64_t Printing::line_of(std::uint32_t column, std::uint32_t row) const {
  const auto& mount = profile().mounting;
  const auto has = [&](Side side) { return mount.scan_from == side || mount.nozzle_0 == side; };
  if (mount.scan_axis == ScanAxis::kX) return has(Side::kFront) ? machine_.rows_ - 1 - row : row;
  return has(Side::kRight) ? machine_.columns_ - 1 - column : column;
}

// Where the nozzle is that has to see to a pixel.
void Printing::note_place(std::uint32_t column, std::uint32_t row, std::string& text) const {
  const auto& mount = profile().mounting;
  const auto has = [&](Side side) { return mount.scan_from == side || mount.nozzle_0 == side; };
  const std::int64_t from_left = has(Side::kRight) ? machine_.columns_ - 1 - column : column;
  const std::int64_t from_back = has(Side::kFront) ? machine_.rows_ - 1 - row : row;
  const bool x = mount.scan_axis == ScanAxis::kX;
  const std::int64_t line = x ? from_back : from_left, place = x ? from_left : from_back;
  for (const Sweep& sweep : sweeps_) {
    for (const VirtualMachine::Nozzle& nozzle : machine_.nozzle_) {
      if (nozzle.blocked || sweep.first_line + nozzle.line != line) continue;
      text =
          fmt::format("layer {}, swath {}, step {}", layer_.index, sweep.number, place * machine_.ticks_ + nozzle.step_offset);
      return;
    }
  }
  text = fmt::format("layer {}, line {} across, place {} along, which no swath comes over", layer_.index, line, place);
}

// Lines that a nozzle which works comes over, and those of blocked ones: only these may lose pixels. A sweep in which
// nobody fires is not known; what no sweep comes over may be one.
void Printing::coverage(std::vector<bool>& worked, std::vector<bool>& blocked) const {
  for (const Sweep& sweep : sweeps_) {
    for (const VirtualMachine::Nozzle& nozzle : machine_.nozzle_) {
      const std::int64_t over = sweep.first_line + nozzle.line;
      if (over >= 0 && over < machine_.lines_) (nozzle.blocked ? blocked : worked)[std::size_t(over)] = true;
    }
  }
}

void Printing::compare_plane(const RunsView& image, std::uint32_t plane, std::uint64_t moved, std::uint64_t lost,
                             Differences& differ) const {
  const bool x = profile().mounting.scan_axis == ScanAxis::kX;
  const std::int64_t next = profile().mounting.passes;
  const auto may_be_lost = [&](std::int64_t column, std::int64_t row) {
    const auto over = std::size_t(line_of(static_cast<std::uint32_t>(column), static_cast<std::uint32_t>(row)));
    return differ.blocked[over] || !differ.worked[over];
  };
  const auto set_and_unfired = [&](std::int64_t column, std::int64_t row) {
    if (column < 0 || row < 0 || column >= machine_.columns_ || row >= machine_.rows_ || !may_be_lost(column, row))
      return false;
    const auto line = image.row(static_cast<std::uint32_t>(row));
    const auto after = std::upper_bound(line.begin(), line.end(), static_cast<std::uint32_t>(column)) - line.begin();
    const std::uint64_t fired = fired_more(plane, std::size_t(row) * row_words_ + std::size_t(column) / 64);
    return after % 2 == 1 && (fired >> (column % 64) & 1) == 0;
  };
  std::vector<std::uint64_t>& wanted = differ.wanted;
  for (std::uint32_t row = 0; row < image.rows(); ++row) {
    const auto line = image.row(row);
    if (line.empty() && fires_row_[row] == 0) continue;
    std::fill(wanted.begin(), wanted.end(), 0);
    for (std::size_t i = 0; i + 1 < line.size(); i += 2) {
      for (std::uint32_t c = line[i]; c < line[i + 1];) {
        const std::uint32_t to = std::min((c / 64 + 1) * 64, line[i + 1]);
        const std::uint64_t ones = to - c == 64 ? ~std::uint64_t{0} : (std::uint64_t{1} << (to - c)) - 1;
        wanted[c / 64] |= ones << (c % 64);
        c = to;
      }
    }
    for (std::uint32_t w = 0; w < row_words_; ++w) {
      const std::uint64_t got = fired_more(plane, std::size_t{row} * row_words_ + w);
      for (std::uint64_t different = got ^ wanted[w]; different != 0; different &= different - 1) {
        const auto bit = static_cast<std::uint32_t>(std::countr_zero(different));
        const std::uint32_t column = w * 64 + bit;
        const bool extra = (got >> bit & 1) != 0;
        (extra ? differ.added : differ.missing) += 1;
        const bool explained =
            !extra ? moved + lost > 0 && may_be_lost(column, row)
                   : moved > 0 && (x ? set_and_unfired(column, row - next) || set_and_unfired(column, row + next)
                                     : set_and_unfired(column - next, row) || set_and_unfired(column + next, row));
        if (differ.first_of_all.empty()) note_place(column, row, differ.first_of_all);
        if (differ.first.empty() && !explained) {
          note_place(column, row, differ.first);
          differ.first += fmt::format(": column {}, row {} is {}{}", column, row,
                                      extra ? "fired and not set in the image" : "set in the image and not fired",
                                      planes_ == 1 ? "" : fmt::format(", drop {}", plane + 1));
        }
      }
    }
  }
}

void Printing::compare(std::span<const RunsView> planes, std::uint64_t moved, std::uint64_t lost) {
  Differences differ;
  differ.wanted.resize(row_words_);
  differ.worked.resize(machine_.lines_);
  differ.blocked.resize(machine_.lines_);
  coverage(differ.worked, differ.blocked);
  for (std::uint32_t plane = 0; plane < planes.size(); ++plane) {
    const RunsView& image = planes[plane];
    if (image.columns != machine_.columns_ || image.rows() != machine_.rows_) return fault("the image is of another size");
    compare_plane(image, plane, moved, lost, differ);
  }
  const auto& [missing, added, first, first_of_all, worked, blocked, wanted] = differ;
  if (first.empty()) check_numbers(planes);
  if (!first.empty()) {
    return fail(fmt::format("{}; in all {} pixels are not fired and {} fired too many", first, missing, added));
  }
  if (added != moved || missing != moved + lost) {
    // The manifest alone may speak of such pixels.
    const std::string place = first_of_all.empty() ? fmt::format("layer {}", layer_.index) : first_of_all;
    fail(fmt::format("{}: {} pixels are not fired and {} fired instead; the manifest says {} and {}", place, missing, added,
                     moved + lost, moved));
  }
}

}  // namespace lamina::replay
