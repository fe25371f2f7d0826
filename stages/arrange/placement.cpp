#include "stages/arrange/placement.h"

#include <fmt/format.h>

#include <algorithm>

#include "stages/data/units.h"

namespace lamina::arrange {
namespace {

// A box that is wider or deeper than the bed cannot stand anywhere.
std::optional<Error> too_large(const BoxRequest& box, std::int64_t bed_width, std::int64_t bed_depth, bool bed_of_machine) {
  if (box.width <= bed_width && box.depth <= bed_depth) return std::nullopt;
  const bool turned = box.depth <= bed_width && box.width <= bed_depth;
  return Error{Fault::kUsage,
               fmt::format("{}: {} x {} mm is larger than the bed of {} x {} mm; {} {} or a smaller --scale", box.name,
                           mm(box.width), mm(box.depth), mm(bed_width), mm(bed_depth), turned ? "try --rotate 0,0,90," : "use",
                           bed_of_machine ? "another machine" : "a larger --bed")};
}

}  // namespace

Result<std::vector<BoxPosition>> arrange_boxes(std::span<const BoxRequest> requests, std::int64_t bed_width,
                                               std::int64_t bed_depth, std::int64_t gap, bool bed_of_machine) {
  std::vector<BoxPosition> positions;
  std::int64_t x = 0, y = 0, row_depth = 0, block_width = 0;
  bool begun = false;
  for (std::uint32_t r = 0; r < requests.size(); ++r) {
    const BoxRequest& box = requests[r];
    if (const auto error = too_large(box, bed_width, bed_depth, bed_of_machine)) return *error;
    for (std::uint32_t copy = 0; copy < box.copies; ++copy) {
      if (box.at_x) {
        const std::int64_t from = *box.at_x + copy * (box.width + gap);
        const std::int64_t over_x = from + box.width - bed_width, over_y = *box.at_y + box.depth - bed_depth;
        if (from < 0 || *box.at_y < 0 || over_x > 0 || over_y > 0) {
          return Error{Fault::kUsage,
                       fmt::format("{}: copy {} at {},{} mm reaches {} mm beyond the bed of {} x {} mm; move it with "
                                   "--at, or leave --at out to have it centred",
                                   box.name, copy + 1, mm(from), mm(*box.at_y),
                                   mm(std::max({over_x, over_y, -from, -*box.at_y})), mm(bed_width), mm(bed_depth))};
        }
        positions.push_back({r, from, *box.at_y});
        continue;
      }
      if (begun && x + gap + box.width > bed_width) {
        y += row_depth + gap;
        x = row_depth = 0;
        begun = false;
      } else if (begun) {
        x += gap;
      }
      if (y + box.depth > bed_depth) {
        return Error{Fault::kUsage,
                     fmt::format("{}: copy {} of {} finds no room on the bed of {} x {} mm, {} mm of depth are missing; "
                                 "use fewer --copies, a smaller --gap or {}",
                                 box.name, copy + 1, box.copies, mm(bed_width), mm(bed_depth), mm(y + box.depth - bed_depth),
                                 bed_of_machine ? "another machine" : "a larger --bed")};
      }
      positions.push_back({r, x, y});
      begun = true;
      x += box.width;
      row_depth = std::max(row_depth, box.depth);
      block_width = std::max(block_width, x);
    }
  }
  const std::int64_t right = (bed_width - block_width) / 2, back = (bed_depth - (y + row_depth)) / 2;
  for (BoxPosition& position : positions) {
    if (requests[position.request].at_x) continue;
    position.x += right;
    position.y += back;
  }
  return positions;
}

}  // namespace lamina::arrange
