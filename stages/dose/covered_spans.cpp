#include "stages/dose/covered_spans.h"

#include <algorithm>
#include <numeric>

namespace lamina::dose {
namespace {

/// How wide all is that a box is part of, along an axis, where boxes closer than `gap` are one.
std::vector<std::int64_t> widths(std::span<const ZoneBox> boxes, std::size_t axis, std::int64_t gap) {
  std::vector<std::uint32_t> order(boxes.size());
  std::iota(order.begin(), order.end(), 0u);
  std::ranges::sort(order, {}, [&](std::uint32_t i) { return boxes[i].low[axis]; });
  std::vector<std::int64_t> width(boxes.size());
  for (std::size_t begin = 0, end = 0; begin < order.size(); begin = end) {
    const std::int64_t low = boxes[order[begin]].low[axis];
    std::int64_t high = boxes[order[begin]].high[axis];
    for (; end < order.size() && boxes[order[end]].low[axis] <= high + gap; ++end)
      high = std::max(high, boxes[order[end]].high[axis]);
    for (std::size_t i = begin; i < end; ++i) width[order[i]] = high - low;
  }
  return width;
}

}  // namespace

CoveredSpans::CoveredSpans(std::span<const ZoneBox> boxes, std::uint32_t zones, std::int64_t shell_nm, std::int64_t pixel_nm)
    : everywhere_(false), all_(zones), core_(zones) {
  // A pixel more at either end of a box, and a reach that is rounded down to pixels.
  const std::int64_t margin = 4 * pixel_nm;
  const std::vector<std::int64_t> along_x = widths(boxes, 0, margin), along_y = widths(boxes, 1, margin);
  for (std::size_t i = 0; i < boxes.size(); ++i) {
    const ZoneBox& box = boxes[i];
    all_[box.zone].push_back({box.low[2], box.high[2]});
    if (std::min(along_x[i], along_y[i]) + margin > 2 * shell_nm) core_[box.zone].push_back({box.low[2], box.high[2]});
  }
  std::ranges::for_each(all_, merge);
  std::ranges::for_each(core_, merge);
}

void CoveredSpans::merge(Spans& spans) {
  std::ranges::sort(spans, {}, &Span::from);
  std::size_t kept = 0;
  for (std::size_t i = 1; i < spans.size(); ++i) {
    if (spans[i].from <= spans[kept].to) {
      spans[kept].to = std::max(spans[kept].to, spans[i].to);
    } else {
      spans[++kept] = spans[i];
    }
  }
  if (!spans.empty()) spans.resize(kept + 1);
}

bool CoveredSpans::meets(const Spans& spans, const Layer& layer) {
  const auto above =
      std::ranges::upper_bound(spans, std::int64_t{layer.bottom}, {}, &Span::to);  // ends above the layer's bottom
  return above != spans.end() && above->from < std::int64_t{layer.bottom} + layer.thickness;
}

}  // namespace lamina::dose
