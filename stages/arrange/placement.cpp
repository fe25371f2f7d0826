#include "stages/arrange/placement.h"

#include <fmt/format.h>

#include <algorithm>

#include "stages/data/units.h"

namespace lamina::arrange {
namespace {

std::string size_text(std::int64_t width, std::int64_t depth) { return fmt::format("{} x {} mm", mm(width), mm(depth)); }

/// What else to change, behind "use".
std::string remedy(const BedSpace& bed) {
  return fmt::format("{}{}", bed.margin > 0 ? "a smaller --margin, " : "",
                     bed.of_machine ? "another machine" : "a larger --bed");
}

// A box that is wider or deeper than the bed cannot stand anywhere.
std::optional<Error> too_large(const BoxRequest& box, const BedSpace& bed) {
  const std::int64_t margin = box.at_x ? 0 : bed.margin, width = bed.width - 2 * margin, depth = bed.depth - 2 * margin;
  if (box.width <= width && box.depth <= depth) return std::nullopt;
  const bool turned = box.depth <= width && box.width <= depth;
  const bool fits = box.width <= bed.width && box.depth <= bed.depth;
  const std::string beyond = margin == 0 ? fmt::format("is larger than the bed of {}", size_text(bed.width, bed.depth))
                                         : fmt::format("is larger than the bed of {} without its margin of {} mm",
                                                       size_text(bed.width, bed.depth), mm(margin));
  return Error{Fault::kUsage,
               fmt::format("{}: {} {}; {} {}{} or a smaller --scale", box.name, size_text(box.width, box.depth), beyond,
                           turned ? "try --rotate 0,0,90," : "use", remedy(bed), margin > 0 && fits ? ", --at" : "")};
}

Error no_space(const BoxRequest& box, std::uint32_t copy, std::int64_t missing, const BedSpace& bed) {
  const bool margin = bed.margin > 0;
  return {Fault::kUsage,
          fmt::format("{}: copy {} of {} finds no room on the bed of {}{}, {} mm of depth are missing; use "
                      "fewer --copies, {}a smaller --gap or {}",
                      box.name, copy + 1, box.copies, size_text(bed.width, bed.depth),
                      margin ? fmt::format(" with a margin of {} mm", mm(bed.margin)) : "", mm(missing),
                      margin ? "a smaller --margin, " : "", bed.of_machine ? "another machine" : "a larger --bed")};
}

}  // namespace

Result<std::vector<BoxPosition>> arrange_boxes(std::span<const BoxRequest> requests, const BedSpace& bed, std::int64_t gap) {
  const std::int64_t inner_width = bed.width - 2 * bed.margin, inner_depth = bed.depth - 2 * bed.margin;
  std::vector<BoxPosition> positions;
  std::int64_t x = 0, y = 0, row_depth = 0, block_width = 0;
  bool begun = false;
  for (std::uint32_t r = 0; r < requests.size(); ++r) {
    const BoxRequest& box = requests[r];
    if (const auto error = too_large(box, bed)) return *error;
    for (std::uint32_t copy = 0; copy < box.copies; ++copy) {
      if (box.at_x) {
        const std::int64_t from = *box.at_x + copy * (box.width + gap);
        const std::int64_t over_x = from + box.width - bed.width, over_y = *box.at_y + box.depth - bed.depth;
        if (from < 0 || *box.at_y < 0 || over_x > 0 || over_y > 0) {
          return Error{Fault::kUsage,
                       fmt::format("{}: copy {} at {},{} mm reaches {} mm beyond the bed of {}; move it with "
                                   "--at, or leave --at out to have it centred",
                                   box.name, copy + 1, mm(from), mm(*box.at_y),
                                   mm(std::max({over_x, over_y, -from, -*box.at_y})), size_text(bed.width, bed.depth))};
        }
        positions.push_back({r, from, *box.at_y});
        continue;
      }
      if (begun && x + gap + box.width > inner_width) {
        y += row_depth + gap;
        x = row_depth = 0;
        begun = false;
      } else if (begun) {
        x += gap;
      }
      if (y + box.depth > inner_depth) return no_space(box, copy, y + box.depth - inner_depth, bed);
      positions.push_back({r, x, y});
      begun = true;
      x += box.width;
      row_depth = std::max(row_depth, box.depth);
      block_width = std::max(block_width, x);
    }
  }
  const std::int64_t right = (bed.width - block_width) / 2, back = (bed.depth - (y + row_depth)) / 2;
  for (BoxPosition& position : positions) {
    if (requests[position.request].at_x) continue;
    position.x += right;
    position.y += back;
  }
  return positions;
}

}  // namespace lamina::arrange
