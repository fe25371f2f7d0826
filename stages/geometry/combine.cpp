#include "stages/geometry/combine.h"

#include <algorithm>
#include <utility>

namespace lamina {

void combine(const RunsView& a, const RunsView& b, SetOperation operation, Runs& out) {
  out.columns = a.columns;
  out.row_offset.assign(1, 0);
  out.change.clear();
  append_combined(a, b, operation, out);
}

namespace {

using Row = std::span<const std::uint32_t>;

inline std::uint32_t* put(std::uint32_t begin, std::uint32_t end, std::uint32_t* to) {
  to[0] = begin;
  to[1] = end;
  return to + 2;
}

std::uint32_t* merge(Row a, Row b, std::uint32_t* to) {
  const std::uint32_t* const first = to;
  for (std::size_t i = 0, j = 0; i < a.size() || j < b.size();) {
    const bool from_a = j == b.size() || (i < a.size() && a[i] < b[j]);
    const std::uint32_t begin = from_a ? a[i] : b[j], end = from_a ? a[i + 1] : b[j + 1];
    (from_a ? i : j) += 2;
    if (to != first && begin <= to[-1]) {
      to[-1] = std::max(to[-1], end);
    } else {
      to = put(begin, end, to);
    }
  }
  return to;
}

std::uint32_t* intersect(Row a, Row b, std::uint32_t* to) {
  if (rows_aligned(a, b)) {
    for (std::size_t i = 0; i + 1 < a.size(); i += 2) to = put(std::max(a[i], b[i]), std::min(a[i + 1], b[i + 1]), to);
    return to;
  }
  for (std::size_t i = 0, j = 0; i < a.size() && j < b.size();) {
    const std::uint32_t begin = std::max(a[i], b[j]), end_a = a[i + 1], end_b = b[j + 1], end = std::min(end_a, end_b);
    put(begin, end, to);  // no branch depends on how runs lie: what is empty is overwritten
    to += begin < end ? 2 : 0;
    i += end_a < end_b ? 2 : 0;
    j += end_a < end_b ? 0 : 2;
  }
  return to;
}

std::uint32_t* subtract(Row a, Row b, std::uint32_t* to) {
  for (std::size_t i = 0, j = 0; i < a.size(); i += 2) {
    std::uint32_t at = a[i];
    const std::uint32_t end = a[i + 1];
    while (j < b.size() && b[j + 1] <= at) j += 2;
    for (; j < b.size() && b[j] < end; j += 2) {
      if (at < b[j]) to = put(at, b[j], to);
      at = b[j + 1];
      if (at >= end) break;
    }
    if (at < end) to = put(at, end, to);
  }
  return to;
}

}  // namespace

void append_combined(const RunsView& a, const RunsView& b, SetOperation operation, Runs& out) {
  const std::size_t row = out.row_offset.size(), there = out.change.size();
  const auto changes = [](const RunsView& image) { return image.row_offset.back() - image.row_offset.front(); };
  out.row_offset.resize(row + a.rows());
  out.change.resize(there + changes(a) + changes(b));
  std::uint32_t* next = out.change.data() + there;
  const auto each_row = [&](const auto& combine_row) {
    for (std::uint32_t r = 0; r < a.rows(); ++r) {
      const bool empty_a = a.row_offset[r] == a.row_offset[r + 1], empty_b = b.row_offset[r] == b.row_offset[r + 1];
      if (!empty_a && !empty_b) {
        next = combine_row(a.row(r), b.row(r), next);
      } else if ((!empty_a && operation != SetOperation::kIntersection) || (!empty_b && operation == SetOperation::kUnion)) {
        next = std::ranges::copy(empty_a ? b.row(r) : a.row(r), next).out;
      }
      out.row_offset[row + r] = static_cast<std::uint32_t>(next - out.change.data());
    }
  };
  switch (operation) {
    case SetOperation::kUnion: each_row(merge); break;
    case SetOperation::kIntersection: each_row(intersect); break;
    case SetOperation::kDifference: each_row(subtract); break;
  }
  out.change.resize(static_cast<std::size_t>(next - out.change.data()));
}

std::array<std::uint32_t, 2> first_difference(const RunsView& a, const RunsView& b) {
  std::uint32_t r = 0;
  while (r + 1 < a.rows() && std::ranges::equal(a.row(r), b.row(r))) ++r;
  const auto first = a.row(r), second = b.row(r);
  const auto position = static_cast<std::size_t>(std::ranges::mismatch(first, second).in1 - first.begin());
  return {
      std::min(position < first.size() ? first[position] : a.columns, position < second.size() ? second[position] : a.columns),
      r};
}

namespace {

/// The runs of a row that are not yet behind.
struct Ahead {
  const LevelsView& image;
  std::uint32_t i, end;

  Ahead(const LevelsView& of, std::uint32_t row) : image(of), i(of.row_offset[row]), end(of.row_offset[row + 1]) {}
  bool any() const { return i < end; }
  std::uint8_t level_at(std::uint32_t column) const {
    return any() && image.change[2 * std::size_t{i}] <= column ? image.level[i] : std::uint8_t{0};
  }
  /// Where its level changes next.
  std::uint32_t next(std::uint32_t column) const {
    if (!any()) return UINT32_MAX;
    const std::uint32_t begin = image.change[2 * std::size_t{i}];
    return begin > column ? begin : image.change[2 * std::size_t{i} + 1];
  }
  void leave(std::uint32_t column) {
    if (any() && image.change[2 * std::size_t{i} + 1] <= column) ++i;
  }
};

/// level  of a pixel, by its level in a and in b
template <class Level>
void join(const LevelsView& a, const LevelsView& b, Levels& out, Level level) {
  out.start(a.columns);
  for (std::uint32_t r = 0; r < a.rows(); ++r) {
    Ahead first(a, r), second(b, r);
    for (std::uint32_t column = 0; first.any() || second.any();) {
      const std::uint32_t next = std::min(first.next(column), second.next(column));
      out.append(column, next, level(first.level_at(column), second.level_at(column)));
      first.leave(next);
      second.leave(next);
      column = next;
    }
    out.end_row();
  }
}

}  // namespace

void larger(const LevelsView& a, const LevelsView& b, Levels& out) {
  join(a, b, out, [](std::uint8_t one, std::uint8_t other) { return std::max(one, other); });
}

void add_levels(const LevelsView& a, const LevelsView& b, Levels& out) {
  join(a, b, out, [](int one, int other) { return static_cast<std::uint8_t>(std::min(one + other, 255)); });
}

Levels times_set(std::span<const Runs> images) {
  Levels sum, one, both;
  levels_of(images.front(), 1, sum);
  for (const Runs& image : images.subspan(1)) {
    levels_of(image, 1, one);
    add_levels(sum, one, both);
    std::swap(sum, both);
  }
  return sum;
}

}  // namespace lamina
