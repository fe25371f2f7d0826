#include "stages/dose/shares.h"

#include <algorithm>
#include <array>

namespace lamina::dose {
namespace {

/// Pixels from one on, in one row of an image whose pixels are all unset beyond it.
struct AlikePixels {
  bool alike;         // it and both next to it have the value
  std::int64_t stop;  // the first pixel that is not so, or that may be so
};

/// A row of changes that is read from left to right.
struct RowReader {
  std::span<const std::uint32_t> row;
  std::size_t next = 0;  // the first change behind the column at work

  AlikePixels alike_pixels(std::int64_t column, bool value) {
    constexpr std::int64_t kNone = INT64_MAX;
    while (next < row.size() && row[next] <= column) ++next;
    const std::int64_t end = next == row.size() ? kNone : std::int64_t{row[next]};
    if ((next & 1) != (value ? 1 : 0)) return {false, end == kNone ? kNone : end + 1};
    if ((next > 0 && row[next - 1] == column) || end == column + 1) return {false, column + 1};
    return {true, end == kNone ? kNone : end - 1};
  }
};

/// A row of an image and those around it; rows outside are empty.
std::array<RowReader, 3> rows_around(const RunsView& image, std::uint32_t row) {
  std::array<RowReader, 3> rows;
  for (std::uint32_t i = 0; i < 3; ++i) {
    if (row + i > 0 && row + i <= image.rows()) rows[i].row = image.row(row + i - 1);
  }
  return rows;
}

/// Pixels of [begin, end) whose eight neighbours have their value, which is one for all of them.
std::uint64_t pixels_away_from_edges(std::array<RowReader, 3>& rows, std::int64_t begin, std::int64_t end, bool value) {
  std::uint64_t found = 0;
  for (std::int64_t at = begin; at < end;) {
    std::int64_t stop = end, candidate = at;
    for (RowReader& row : rows) {
      const AlikePixels near = row.alike_pixels(at, value);
      if (near.alike) {
        stop = std::min(stop, near.stop);
      } else {
        candidate = std::max(candidate, near.stop);
      }
    }
    if (candidate == at) found += static_cast<std::uint64_t>(stop - at);
    at = candidate == at ? stop : candidate;
  }
  return found;
}

/// The runs with what `level_in` gives for each inside of the mask, and `level_out` outside.
template <class In, class Out>
void apply_mask(const LevelsView& image, const RunsView& masks, In level_in, Out level_out, Levels& result) {
  result.start(image.columns);
  for (std::uint32_t row = 0; row < image.rows(); ++row) {
    const auto mask = masks.row(row);
    std::size_t k = 0;
    for (std::uint32_t i = image.row_offset[row]; i < image.row_offset[row + 1]; ++i) {
      const std::uint32_t end = image.change[2 * i + 1];
      std::uint32_t at = image.change[2 * i];
      while (k + 1 < mask.size() && mask[k + 1] <= at) k += 2;
      for (std::size_t m = k; m + 1 < mask.size() && mask[m] < end; m += 2) {
        const std::uint32_t begin = std::max(at, mask[m]), stop = std::min(end, mask[m + 1]);
        result.append(at, begin, level_out(image.level[i]));
        result.append(begin, stop, level_in(image.level[i]));
        at = stop;
      }
      result.append(at, end, level_out(image.level[i]));
    }
    result.end_row();
  }
}

constexpr auto kKept = [](std::uint8_t level) { return level; };
constexpr auto kLeftOut = [](std::uint8_t) { return std::uint8_t{0}; };

/// How many changes two rows have in common at their beginning; eight are compared at once.
std::size_t same_changes(std::span<const std::uint32_t> a, std::span<const std::uint32_t> b) {
  const std::size_t maximum = std::min(a.size(), b.size());
  std::size_t same = 0;
  for (; same + 8 <= maximum; same += 8) {
    std::uint32_t differs = 0;
    for (std::size_t i = same; i < same + 8; ++i) differs |= a[i] ^ b[i];
    if (differs != 0) break;
  }
  while (same < maximum && a[same] == b[same]) ++same;
  return same;
}

/// Appends [begin, end) to the row that is being made.
void append_run(std::uint32_t row_begin, std::uint32_t begin, std::uint32_t end, Runs& image) {
  if (image.change.size() > row_begin && image.change.back() == begin) {
    image.change.back() = end;
  } else {
    image.change.push_back(begin);
    image.change.push_back(end);
  }
}

/// Goes through a row of several parts from column to column at which any of them changes.
class RowOfParts {
 public:
  explicit RowOfParts(std::span<const Levels* const> parts) : parts_(parts), at_(parts.size()) {}

  void start(std::uint32_t row) {
    row_ = row;
    for (std::size_t i = 0; i < parts_.size(); ++i) at_[i] = parts_[i]->row_offset[row];
  }
  /// The first column at or behind `from` where a part has a level; UINT32_MAX: none has.
  std::uint32_t next(std::uint32_t from) {
    std::uint32_t first = UINT32_MAX;
    for (std::size_t i = 0; i < parts_.size(); ++i) {
      const Levels& part = *parts_[i];
      while (at_[i] < part.row_offset[row_ + 1] && part.change[2 * at_[i] + 1] <= from) ++at_[i];
      if (at_[i] < part.row_offset[row_ + 1]) first = std::min(first, std::max(from, part.change[2 * at_[i]]));
    }
    return first;
  }
  std::uint8_t level(std::size_t i, std::uint32_t column) const { return holds(i, column) ? parts_[i]->level[at_[i]] : 0; }
  /// Where the levels from `column` on, as next() gave it, end.
  std::uint32_t end(std::uint32_t column) const {
    std::uint32_t stop = UINT32_MAX;
    for (std::size_t i = 0; i < parts_.size(); ++i) {
      if (at_[i] == parts_[i]->row_offset[row_ + 1]) continue;
      stop = std::min(stop, parts_[i]->change[2 * at_[i] + (holds(i, column) ? 1 : 0)]);
    }
    return stop;
  }

 private:
  bool holds(std::size_t i, std::uint32_t column) const {
    return at_[i] < parts_[i]->row_offset[row_ + 1] && parts_[i]->change[2 * at_[i]] <= column;
  }
  std::span<const Levels* const> parts_;
  std::vector<std::uint32_t> at_;  // run of each part
  std::uint32_t row_ = 0;
};

}  // namespace

std::uint64_t ShareOut::bytes() const {
  std::uint64_t total = 0;
  for (const Levels& levels : part) total += levels.bytes();
  for (const Runs& runs : owner) total += bytes_held(runs.row_offset) + bytes_held(runs.change);
  return total;
}

void share_out(std::span<Levels* const> parts, std::uint8_t full, ShareOut& out, Levels& total) {
  const std::uint32_t columns = parts.front()->columns, rows = parts.front()->view().rows();
  out.part.resize(parts.size());
  out.owner.resize(parts.size());
  for (Levels& part : out.part) part.start(columns);
  for (Runs& image : out.owner) image.columns = columns, image.row_offset.assign(1, 0), image.change.clear();
  total.start(columns);
  RowOfParts row(parts);
  for (std::uint32_t r = 0; r < rows; ++r) {
    row.start(r);
    for (std::uint32_t at = row.next(0); at != UINT32_MAX; at = row.next(at)) {
      const std::uint32_t stop = row.end(at);
      std::uint8_t used = 0, maximum = 0;
      std::size_t owner = 0;
      for (std::size_t i = parts.size(); i-- > 0;) {
        const std::uint8_t level = std::min<std::uint8_t>(row.level(i, at), static_cast<std::uint8_t>(full - used));
        out.part[i].append(at, stop, level);
        used = static_cast<std::uint8_t>(used + level);
        if (level > maximum) maximum = level, owner = i;
      }
      total.append(at, stop, used);
      if (used >= half_of(full)) append_run(out.owner[owner].row_offset.back(), at, stop, out.owner[owner]);
      at = stop;
    }
    for (Levels& part : out.part) part.end_row();
    for (Runs& image : out.owner) image.row_offset.push_back(static_cast<std::uint32_t>(image.change.size()));
    total.end_row();
  }
  for (std::size_t i = 0; i < parts.size(); ++i) std::swap(*parts[i], out.part[i]);
}

void surplus(const Levels& all, const Levels& some, Levels& result) {
  result.start(all.columns);
  const std::array<const Levels*, 2> both{&all, &some};
  RowOfParts row(both);
  for (std::uint32_t r = 0; r < all.view().rows(); ++r) {
    row.start(r);
    for (std::uint32_t at = row.next(0), stop = 0; at != UINT32_MAX; at = row.next(stop)) {
      stop = row.end(at);
      result.append(at, stop, static_cast<std::uint8_t>(row.level(0, at) - row.level(1, at)));
    }
    result.end_row();
  }
}

void mirror(const LevelsView& image, bool x, bool y, Levels& result) {
  result.start(image.columns);
  const std::uint32_t rows = image.rows();
  for (std::uint32_t r = 0; r < rows; ++r) {
    const std::uint32_t from = y ? rows - 1 - r : r;
    const std::uint32_t begin = image.row_offset[from], end = image.row_offset[from + 1];
    for (std::uint32_t k = begin; k < end; ++k) {
      const std::uint32_t i = x ? begin + (end - 1 - k) : k;
      const std::uint32_t left = image.change[2 * i], right = image.change[2 * i + 1];
      result.append(x ? image.columns - right : left, x ? image.columns - left : right, image.level[i]);
    }
    result.end_row();
  }
}

void without(const LevelsView& image, const RunsView& mask, Levels& result) {
  apply_mask(image, mask, kLeftOut, kKept, result);
}

void within(const LevelsView& image, const RunsView& mask, Levels& result) { apply_mask(image, mask, kKept, kLeftOut, result); }

void mark_core(const LevelsView& image, const RunsView& core, std::uint8_t full, Levels& result) {
  const auto more = [full](std::uint8_t level) { return static_cast<std::uint8_t>(level + full); };
  apply_mask(image, core, more, kKept, result);
}

void drops_of_zones(const LayerDose& dose, std::uint8_t full, bool dithered, std::span<Drops24> drops) {
  drops[0] = 0;
  for (std::uint32_t level = 1; level <= full; ++level) {
    drops[level] = dose.shell * level / full;
    drops[full + level] = dose.core * level / full;
  }
  if (!dithered) std::ranges::transform(drops, drops.begin(), rounded);
}

ZoneSums sums_of(const LevelsView& zones, std::uint8_t full, const LayerDose& dose) {
  std::uint64_t shell = 0, core = 0;
  for (std::size_t i = 0; i < zones.level.size(); ++i) {
    const std::uint64_t pixels = zones.change[2 * i + 1] - zones.change[2 * i], level = zones.level[i];
    (level <= full ? shell : core) += pixels * (level <= full ? level : level - full);
  }
  using Product = unsigned __int128;
  const Product requested = Product{dose.requested_shell} * shell + Product{dose.requested_inside} * core;
  const Product one = Product{kOneDrop} * full;
  return {(2 * (shell + core) + full) / (2 * full), static_cast<std::uint64_t>((2 * requested + one) / (2 * one))};
}

Difference difference(const RunsView& a, const RunsView& b) {
  Difference found;
  for (std::uint32_t r = 0; r < a.rows(); ++r) {
    const auto one = a.row(r), other = b.row(r);
    std::array<RowReader, 3> around = rows_around(a, r);
    // Where the changes of both are merged, pixels differ from every odd one to the next.
    std::size_t i = same_changes(one, other), k = i;
    bool differs = false;
    std::uint32_t from = 0;
    while (i < one.size() || k < other.size()) {
      const bool first = k == other.size() || (i < one.size() && one[i] <= other[k]);
      const std::size_t changes_before = i;
      const std::uint32_t at = first ? one[i++] : other[k++];
      if (differs && from < at) {
        found.pixels += at - from;
        found.far += pixels_away_from_edges(around, from, at, (changes_before & 1) != 0);
      }
      differs = !differs;
      from = at;
    }
  }
  return found;
}

}  // namespace lamina::dose
