#include "stages/checks/thin.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <tuple>

#include "stages/geometry/combine.h"

namespace lamina::checks {

// A stencil grows by a column where its width in nm passes a whole number of them, and so by a row. Where it does both, two of
// three times or so it grows along a diagonal: a regular octagon has 2 - sqrt(2) of its width there, about 41 of 70.
Stencils::Stencils(const PixelGrid& grid, std::int64_t min_nm) {
  const auto ends = [](std::uint32_t pixels, const PixelAxis& one, const PixelAxis& other) {
    return static_cast<__int128>(pixels) * one.span * other.dots;
  };
  // Less one: so many whole pixels in nm, rounded, are no pixel more.
  const __int128 minimum = static_cast<__int128>(min_nm - 1) * grid.x.dots * grid.y.dots;
  StencilSteps sum;
  sums_.push_back(sum);
  for (std::uint32_t both = 0;;) {
    const __int128 column = ends(sum.columns(), grid.x, grid.y), row = ends(sum.rows(), grid.y, grid.x);
    const __int128 next = std::min(column, row);
    if (next >= minimum || sum.columns() > grid.columns() || sum.rows() > grid.rows()) return;
    if (column != row) {
      ++(column < row ? sum.right : sum.down);
    } else if (const std::uint32_t diagonal = (41 * both++ + 17) / 70; diagonal == sum.falling + sum.rising) {
      ++sum.right;
      ++sum.down;
    } else {
      ++(diagonal % 2 == 1 ? sum.falling : sum.rising);
    }
    sums_.push_back(sum);
  }
}

std::uint64_t Stencils::two_squares(std::uint32_t number) const {
  return std::uint64_t{2} * sums_[number].columns() * sums_[number].rows();
}

Stencil Stencils::at(std::uint32_t number) const {
  const StencilSteps& sum = sums_[number];
  // The point of a row that is farthest to the left lies on a diagonal step for each row beyond those that go straight down.
  const auto first = [&](std::uint32_t row) {
    if (row < sum.rising) return sum.rising - row;
    return row > sum.rising + sum.down ? row - sum.rising - sum.down : 0;
  };
  Stencil stencil;
  stencil.steps = sum;
  stencil.columns = sum.columns();
  for (std::uint32_t row = 0; row < sum.rows(); ++row) {
    stencil.rows.push_back({first(row), stencil.columns - 1 - first(sum.rows() - 1 - row)});
  }
  return stencil;
}

namespace {

/// Runs are added row by row: begin_rows() first, end_row() after each row.
void begin_rows(std::uint32_t columns, Runs& result) {
  result.columns = columns;
  result.row_offset.assign(1, 0);
  result.change.clear();
}
void end_row(Runs& result) { result.row_offset.push_back(static_cast<std::uint32_t>(result.change.size())); }
void clear_rows(std::uint32_t columns, std::uint32_t rows, Runs& result) {
  begin_rows(columns, result);
  result.row_offset.assign(std::size_t{rows} + 1, 0);
}
void add_run(std::uint32_t begin, std::uint32_t end, Runs& result) {
  result.change.push_back(begin);
  result.change.push_back(end);
}

/// Where the image has rows and columns that are set.
PixelBox box_of(const RunsView& image) {
  PixelBox box;
  for (std::uint32_t r = 0; r < image.rows(); ++r) {
    const auto row = image.row(r);
    if (!row.empty()) box.add({row.front(), row.back(), r, r + 1});
  }
  return box;
}

/// Where the top left corner of a stencil may lie within a box; empty if it does not fit.
PixelBox corners_in(const PixelBox& box, const Stencil& stencil) {
  const auto rows = static_cast<std::uint32_t>(stencil.rows.size());
  if (box.right - box.left < stencil.columns || box.bottom - box.top < rows) return {0, 0, 0, 0};
  return {box.left, box.right - stencil.columns + 1, box.top, box.bottom - rows + 1};
}

enum class To { kPixels, kCorners };

/// Of corners, all pixels of their stencils; of pixels, the corners of all stencils that hold one. Within the window. Row by
/// row: for images of short chains. cost  O(rows of the stencil x runs)
void spread_rows(const RunsView& image, const Stencil& stencil, To to, const PixelBox& window, Buffer<std::uint64_t>& spans,
                 Runs& result) {
  begin_rows(image.columns, result);
  const std::int64_t left = window.left, right = window.right;
  for (std::uint32_t r = 0; r < image.rows(); ++r) {
    const std::size_t row_begin = result.change.size();
    const std::size_t rows = r >= window.top && r < window.bottom ? stencil.rows.size() : 0;
    spans.clear();
    for (std::size_t j = 0; j < rows; ++j) {
      const std::int64_t from =
          to == To::kPixels ? std::int64_t{r} - static_cast<std::int64_t>(j) : static_cast<std::int64_t>(r + j);
      if (from < 0 || from >= image.rows()) continue;
      const std::int64_t first = stencil.rows[j].first, last = stencil.rows[j].last;
      const auto row = image.row(static_cast<std::uint32_t>(from));
      for (std::size_t i = 0; i + 1 < row.size(); i += 2) {
        const std::int64_t begin = std::max(left, row[i] + (to == To::kPixels ? first : -last));
        const std::int64_t end = std::min(right, row[i + 1] + (to == To::kPixels ? last : -first));
        if (begin < end) spans.push_back(static_cast<std::uint64_t>(begin) << 32 | static_cast<std::uint64_t>(end));
      }
    }
    std::sort(spans.begin(), spans.end());
    for (const std::uint64_t span : spans) {
      const auto begin = static_cast<std::uint32_t>(span >> 32), end = static_cast<std::uint32_t>(span);
      if (result.change.size() > row_begin && begin <= result.change.back()) {
        result.change.back() = std::max(result.change.back(), end);
      } else {
        add_run(begin, end, result);
      }
    }
    end_row(result);
  }
}

/// The same; gaps  the pixels of the window that are in none instead.
void spread(const RunsView& image, const Stencil& stencil, To to, const PixelBox& window, bool gaps, ThinScratch& scratch,
            Runs& result) {
  if (scratch.chains.find(image, stencil.steps.rows()))
    return scratch.chains.spread(stencil.steps, to == To::kCorners, window, gaps, result);
  spread_rows(image, stencil, to, window, scratch.spans, gaps ? scratch.between : result);
  if (gaps) complement(scratch.between, window, result);
}

/// Pixels of `of`, all of which are set in the image, that the stencil covers nowhere.
void uncovered(const RunsView& image, const PixelBox& box, const RunsView& of, const Stencil& stencil, ThinScratch& scratch) {
  const PixelBox corners = corners_in(box, stencil);
  const auto corners_of = [&](const RunsView& pixels, bool gaps, Runs& result) {
    spread(pixels, stencil, To::kCorners, corners, gaps, scratch, result);
  };
  const auto cover = [&](const RunsView& positions) {
    spread(positions, stencil, To::kPixels, box, false, scratch, scratch.grown);
  };
  if (&of == &image) {
    complement(image, box, scratch.outside);
    corners_of(scratch.outside, true, scratch.fits);
  } else {
    corners_of(of, false, scratch.anchors);
    cover(scratch.anchors);
    combine(scratch.grown, image, SetOperation::kDifference, scratch.outside);
    corners_of(scratch.outside, false, scratch.grown);
    combine(scratch.anchors, scratch.grown, SetOperation::kDifference, scratch.fits);
  }
  cover(scratch.fits);
  combine(of, scratch.grown, SetOperation::kDifference, scratch.left);
}

/// Whether neighbouring rows of a stencil of several rows share columns.
bool shares_columns(const Stencil& stencil) {
  for (std::size_t j = 0; j + 1 < stencil.rows.size(); ++j) {
    const auto &a = stencil.rows[j], &b = stencil.rows[j + 1];
    if (std::max(a.first, b.first) > std::min(a.last, b.last)) return false;
  }
  return stencil.rows.size() > 1;
}

/// Pixels of an image that the stencil covers nowhere, in scratch.left.
void uncovered(const RunsView& image, const PixelBox& box, const Stencil& stencil, ThinScratch& scratch) {
  SimpleChains& simple = scratch.simple;
  simple.find(image);
  if (!shares_columns(stencil) || !simple.open(stencil.steps)) return uncovered(image, box, image, stencil, scratch);
  simple.context(image, scratch.context);
  if (scratch.context.change.empty()) {
    copy_runs(scratch.context, scratch.left);
  } else {
    const PixelBox all{box.left, box.right, 0, scratch.context.view().rows()};
    uncovered(scratch.context, all, scratch.context, stencil, scratch);
  }
  simple.finish(image, scratch.context, scratch.left, 0, scratch.near);
  std::swap(scratch.near, scratch.left);
}

/// Of an image, in rows next to those of `near`, what is not in a part of it.
void others_near(const RunsView& image, const RunsView& part, const RunsView& near, Runs& result) {
  begin_rows(image.columns, result);
  for (std::uint32_t r = 0; r < image.rows(); ++r) {
    const std::uint32_t first = r == 0 ? 0 : r - 1, last = std::min(image.rows(), r + 2);
    if (near.row_offset[first] == near.row_offset[last]) {
      end_row(result);
      continue;
    }
    const auto row = [&](const RunsView& of) { return RunsView{of.columns, of.row_offset.subspan(r, 2), of.change}; };
    append_combined(row(image), row(part), SetOperation::kDifference, result);
  }
}

/// Rows within `reach` of one that has pixels, and an empty one (UINT32_MAX) between such that are apart.
void rows_near(const RunsView& image, std::uint32_t reach, Buffer<std::uint32_t>& rows) {
  rows.clear();
  std::uint32_t next = 0;
  for (std::uint32_t r = 0; r < image.rows(); ++r) {
    if (image.row_offset[r] == image.row_offset[r + 1]) continue;
    const std::uint32_t first = r < reach ? 0 : r - reach, last = std::min(image.rows(), r + reach + 1);
    if (first > next) rows.push_back(UINT32_MAX);
    for (next = std::max(next, first); next < last; ++next) rows.push_back(next);
  }
}

void take_rows(const RunsView& image, std::span<const std::uint32_t> rows, Runs& result) {
  begin_rows(image.columns, result);
  for (const std::uint32_t row : rows) {
    if (row != UINT32_MAX) {
      const auto runs = image.row(row);
      result.change.insert(result.change.end(), runs.begin(), runs.end());
    }
    end_row(result);
  }
}

/// Puts them back where they were taken from.
void return_rows(const RunsView& image, std::span<const std::uint32_t> rows, std::uint32_t count, Runs& result) {
  begin_rows(image.columns, result);
  std::size_t from = 0;
  for (std::uint32_t r = 0; r < count; ++r) {
    while (from < rows.size() && rows[from] == UINT32_MAX) ++from;
    if (from < rows.size() && rows[from] == r) {
      const auto runs = image.row(static_cast<std::uint32_t>(from++));
      result.change.insert(result.change.end(), runs.begin(), runs.end());
    }
    end_row(result);
  }
}

/// The pieces of an image, of more than `least` pixels and at most `most`. returns  the pixels of the largest
std::uint64_t pick(const RunsView& image, const Pieces& pieces, std::uint64_t minimum, std::uint64_t maximum, Runs& result) {
  std::uint64_t largest = 0;
  begin_rows(image.columns, result);
  for (std::uint32_t r = 0; r < image.rows(); ++r) {
    for (std::uint32_t i = image.row_offset[r] / 2; i < image.row_offset[r + 1] / 2; ++i) {
      const std::uint64_t pixels = pieces.pixels[pieces.of_run[i]];
      if (pixels <= minimum || pixels > maximum) continue;
      largest = std::max(largest, pixels);
      add_run(image.change[2 * i], image.change[2 * i + 1], result);
    }
    end_row(result);
  }
  return largest;
}

/// Calls visit(run of a, run of b) for runs of two images that touch at sides or corners.
template <class Visit>
void for_neighbours(const RunsView& a, const RunsView& b, const Visit& visit) {
  for (std::uint32_t r = 0; r < a.rows(); ++r) {
    if (a.row_offset[r] == a.row_offset[r + 1]) continue;
    for (std::uint32_t next = r == 0 ? 0 : r - 1; next < std::min(r + 2, a.rows()); ++next) {
      for_touching(a, r, b, next, true, visit);
    }
  }
}

/// The columns that are set in both neighbours of a row, but not in the row.
void bridge_columns(std::span<const std::uint32_t> above, std::span<const std::uint32_t> row,
                    std::span<const std::uint32_t> below, Buffer<std::uint64_t>& spans) {
  std::size_t k = 0;
  for (std::size_t i = 0, j = 0; i < above.size() && j < below.size();) {
    const std::uint32_t begin = std::max(above[i], below[j]), end = std::min(above[i + 1], below[j + 1]);
    if (begin < end) {
      while (k < row.size() && row[k + 1] <= begin) k += 2;
      const bool within = k < row.size() && row[k] <= begin && end <= row[k + 1];
      if (!within) spans.push_back(std::uint64_t{begin} << 32 | end);
    }
    (above[i + 1] < below[j + 1] ? i : j) += 2;
  }
}

/// Of the pieces of scratch.left, in scratch.pieces, those of more pixels than `minimum`, and those that touch nothing wide.
void pick_narrow(const RunsView& wide, std::uint64_t minimum, ThinScratch& scratch, Runs& result) {
  const RunsView left = scratch.left;
  const Pieces& pieces = scratch.pieces;
  scratch.marks.assign(pieces.count(), 0);
  for_neighbours(left, wide, [&](std::uint32_t run, std::uint32_t) { scratch.marks[pieces.of_run[run]] = 1; });
  begin_rows(left.columns, result);
  for (std::uint32_t r = 0; r < left.rows(); ++r) {
    for (std::uint32_t i = left.row_offset[r] / 2; i < left.row_offset[r + 1] / 2; ++i) {
      const std::uint32_t piece = pieces.of_run[i];
      if (scratch.marks[piece] == 0 || pieces.pixels[piece] > minimum)
        add_run(left.change[2 * i], left.change[2 * i + 1], result);
    }
    end_row(result);
  }
}

/// Puts the largest in front, and no more than so many.
void keep_largest(std::vector<ThinRegion>& locations, std::size_t maximum) {
  const auto order = [](const ThinRegion& position) {
    return std::tuple(~position.pixels, position.box.top, position.box.left);
  };
  std::ranges::stable_sort(locations, {}, order);
  locations.resize(std::min(locations.size(), maximum));
}

/// Takes pieces of more pixels than `least` into the places. rows  of the image, by those of the pieces; empty: the same
void take(const Pieces& pieces, std::uint64_t minimum, std::span<const std::uint32_t> rows, ThinRegions& locations) {
  for (std::size_t p = 0; p < pieces.count(); ++p) {
    const std::uint64_t pixels = pieces.pixels[p];
    if (pixels <= minimum) continue;
    ++locations.count;
    locations.pixels += pixels;
    locations.largest.push_back({pixels, pieces.box[p]});
    PixelBox& box = locations.largest.back().box;
    if (!rows.empty()) box.top = rows[box.top], box.bottom = rows[box.bottom - 1] + 1;
    if (locations.largest.size() >= 4 * ThinRegions::kMax) keep_largest(locations.largest, ThinRegions::kMax);
  }
}

}  // namespace

void complement(const RunsView& image, const PixelBox& window, Runs& result) {
  begin_rows(image.columns, result);
  result.change.reserve(image.change.size() + 2 * (window.bottom - window.top));
  for (std::uint32_t r = 0; r < image.rows(); ++r) {
    if (r >= window.top && r < window.bottom) {
      std::uint32_t at = window.left;
      const auto row = image.row(r);
      for (std::size_t i = 0; i + 1 < row.size() && at < window.right; i += 2) {
        if (at < row[i]) add_run(at, std::min(row[i], window.right), result);
        at = std::max(at, row[i + 1]);
      }
      if (at < window.right) add_run(at, window.right, result);
    }
    end_row(result);
  }
}

std::uint64_t ThinScratch::bytes() const {
  std::uint64_t total =
      bytes_held(spans) + bytes_held(marks) + bytes_held(rows) + pieces.bytes() + chains.bytes() + simple.bytes();
  for (const Runs* image :
       {&outside, &anchors, &grown, &fits, &left, &chosen, &waiting, &pending, &between, &near, &context, &few, &more})
    total += bytes_of(*image);
  return total;
}

namespace {

/// From wide to narrow. What a stencil covers is thin for no narrower one, so that each inspects what those before it left, and
/// of that the pieces that are large enough for it: few corners are. Of the image only rows near them count.
/// maximum  pixels of the largest of the pieces that are left, which are scratch.chosen
void thin_for_narrower(const RunsView& whole, const Stencils& stencils, std::uint64_t maximum, ThinScratch& scratch,
                       Widths* widths, ThinRegions& locations) {
  Runs &left = scratch.left, &chosen = scratch.chosen, &waiting = scratch.waiting, &pending = scratch.pending;
  Runs &image = scratch.few, &narrow = scratch.more;
  Pieces& pieces = scratch.pieces;
  std::uint32_t number = stencils.count() - 1;
  const std::uint64_t corner = stencils.two_squares(1);
  rows_near(chosen, static_cast<std::uint32_t>(stencils.at(number).rows.size()), scratch.rows);
  take_rows(whole, scratch.rows, image);
  take_rows(chosen, scratch.rows, pending);
  clear_rows(whole.columns, static_cast<std::uint32_t>(scratch.rows.size()), narrow);
  const PixelBox box = box_of(image);
  while (--number > 0) {
    const std::uint64_t minimum = stencils.two_squares(number);
    if (maximum <= minimum) continue;
    pieces.find(pending, true);
    pick(pending, pieces, minimum, UINT64_MAX, chosen);
    maximum = pick(pending, pieces, corner, minimum, waiting);
    uncovered(image, box, chosen, stencils.at(number), scratch);
    pieces.find(left, true);
    take(pieces, minimum, scratch.rows, locations);
    if (widths != nullptr && pick(left, pieces, minimum, UINT64_MAX, chosen) > 0) {
      combine(narrow, chosen, SetOperation::kUnion, scratch.grown);
      std::swap(narrow, scratch.grown);
    }
    maximum = std::max(maximum, pick(left, pieces, corner, minimum, chosen));
    combine(waiting, chosen, SetOperation::kUnion, pending);
  }
  if (narrow.change.empty()) return;
  return_rows(narrow, scratch.rows, whole.rows(), chosen);
  combine(widths->narrow, chosen, SetOperation::kUnion, scratch.grown);
  std::swap(widths->narrow, scratch.grown);
}

}  // namespace

ThinRegions thin_regions(const RunsView& image, const Stencils& stencils, ThinScratch& scratch, Widths* widths) {
  ThinRegions locations;
  if (stencils.count() < 2 || image.change.empty()) {
    if (widths == nullptr) return locations;
    widths->narrow.columns = image.columns;
    widths->narrow.row_offset.assign(image.row_offset.size(), 0);
    widths->narrow.change.clear();
    copy_runs(widths->narrow, widths->rest);
    return locations;
  }
  const PixelBox box = box_of(image);
  const std::uint32_t number = stencils.count() - 1;
  uncovered(image, box, stencils.at(number), scratch);
  Runs& left = scratch.left;
  scratch.pieces.find(left, true);
  locations.bytes = image.change.size_bytes() + 5 * image.row_offset.size_bytes() + scratch.pieces.count() * sizeof(ThinRegion);
  for (const Runs* held : {&scratch.outside, &scratch.grown, &scratch.grown, &scratch.fits, &left})
    locations.bytes += held->view().change.size_bytes();
  take(scratch.pieces, stencils.two_squares(number), {}, locations);
  if (widths != nullptr) {
    others_near(image, left, left, scratch.near);
    pick_narrow(scratch.near, stencils.two_squares(number), scratch, widths->narrow);
    copy_runs(left, widths->rest);
  }
  const std::uint64_t maximum =
      pick(left, scratch.pieces, stencils.two_squares(1), stencils.two_squares(number), scratch.chosen);
  if (maximum > 0) thin_for_narrower(image, stencils, maximum, scratch, widths, locations);
  keep_largest(locations.largest, ThinRegions::kMax);
  return locations;
}

void drop_at_edge(const PixelBox& window, ThinScratch& scratch, Runs& image) {
  if (image.change.empty()) return;
  Pieces& pieces = scratch.pieces;
  pieces.find(image, true);
  for (std::size_t p = 0; p < pieces.count(); ++p) {
    const PixelBox& box = pieces.box[p];
    const bool at_edge =
        box.left == window.left || box.right == window.right || box.top == window.top || box.bottom == window.bottom;
    if (at_edge) pieces.pixels[p] = 0;
  }
  pick(image, pieces, 0, UINT64_MAX, scratch.chosen);
  std::swap(image, scratch.chosen);
}

void erode(const RunsView& image, const PixelBox& window, const Stencil& stencil, ThinScratch& scratch, Runs& corners) {
  complement(image, window, scratch.outside);
  spread(scratch.outside, stencil, To::kCorners, corners_in(window, stencil), true, scratch, corners);
}

void erode_found(const RunsView& image, const PixelBox& window, const Stencil& stencil, ThinScratch& scratch, Runs& corners) {
  SimpleChains& simple = scratch.simple;
  if (!shares_columns(stencil) || !simple.erode(stencil.steps)) return erode(image, window, stencil, scratch, corners);
  simple.context(image, scratch.context);
  erode(scratch.context, {window.left, window.right, 0, scratch.context.view().rows()}, stencil, scratch, scratch.fits);
  simple.finish(image, scratch.context, scratch.fits, stencil.rows.front().first, corners);
}

void open(const RunsView& image, const Stencil& stencil, ThinScratch& scratch, Runs& result) {
  const PixelBox box = image.change.empty() ? PixelBox{0, 0, 0, 0} : box_of(image);
  erode(image, box, stencil, scratch, scratch.fits);
  spread(scratch.fits, stencil, To::kPixels, box, false, scratch, result);
}

void inner_pixels(const RunsView& image, Runs& result) {
  begin_rows(image.columns, result);
  Buffer<std::uint32_t> both;
  // Of runs that are a pixel shorter at both ends.
  const auto intersect = [](std::span<const std::uint32_t> a, std::uint32_t less_a, std::span<const std::uint32_t> b,
                            std::uint32_t less_b, Buffer<std::uint32_t>& out) {
    for (std::size_t i = 0, j = 0; i < a.size() && j < b.size();) {
      const std::uint32_t begin = std::max(a[i] + less_a, b[j] + less_b), end = std::min(a[i + 1] - less_a, b[j + 1] - less_b);
      if (begin < end) {
        out.push_back(begin);
        out.push_back(end);
      }
      (a[i + 1] - less_a < b[j + 1] - less_b ? i : j) += 2;
    }
  };
  for (std::uint32_t r = 0; r < image.rows(); ++r) {
    both.clear();
    if (r > 0 && r + 1 < image.rows() && !image.row(r).empty()) {
      const auto above = image.row(r - 1), here = image.row(r), below = image.row(r + 1);
      if (rows_aligned(above, here) && rows_aligned(here, below)) {
        const std::size_t size = result.change.size();
        result.change.resize(size + here.size());
        std::uint32_t* to = result.change.data() + size;
        for (std::size_t i = 0; i < here.size(); i += 2) {
          const std::uint32_t begin = std::max({above[i], here[i], below[i]}) + 1,
                              end = std::min({above[i + 1], here[i + 1], below[i + 1]}) - 1;
          to[0] = begin;
          to[1] = end;
          to += static_cast<std::int32_t>(begin) < static_cast<std::int32_t>(end) ? 2 : 0;
        }
        result.change.resize(static_cast<std::size_t>(to - result.change.data()));
        end_row(result);
        continue;
      }
      intersect(image.row(r - 1), 1, image.row(r), 1, both);
      intersect(both, 0, image.row(r + 1), 1, result.change);
    }
    end_row(result);
  }
}

void Necks::mark(const RunsView& wide, const RunsView& rest, std::uint64_t minimum) {
  neighbour_.assign(pieces_.count(), UINT32_MAX);
  joins_.assign(pieces_.count(), 0);
  const auto note = [&](std::uint32_t run, std::uint32_t of_wide) {
    const std::uint32_t part = wide_.of_run[of_wide];
    if (wide_.pixels[part] < minimum) return;
    std::uint32_t& neighbour = neighbour_[pieces_.of_run[run]];
    if (neighbour != UINT32_MAX && neighbour != part) joins_[pieces_.of_run[run]] = 1;
    neighbour = part;
  };
  for_neighbours(rest, wide, note);
}

/// The pixels that are not set between two that are, in rows and columns; in rows also those next to one that is in a column.
/// returns  whether there are any
bool Necks::bridge(const RunsView& image) {
  begin_rows(image.columns, bridged_);
  for (std::uint32_t r = 0; r < image.rows(); ++r) {
    const auto row = image.row(r);
    spans_.clear();
    if (r > 0 && r + 1 < image.rows()) bridge_columns(image.row(r - 1), row, image.row(r + 1), spans_);
    bool adds = !spans_.empty();
    for (std::size_t i = 1; i + 1 < row.size(); i += 2) adds = adds || row[i + 1] == row[i] + 1;
    if (adds) {
      // Spans of the row and of its columns, with the gaps of one pixel between them, less the row.
      for (std::size_t i = 0; i + 1 < row.size(); i += 2) spans_.push_back(std::uint64_t{row[i]} << 32 | row[i + 1]);
      std::ranges::sort(spans_);
      joined_.clear();
      for (const std::uint64_t span : spans_) {
        const auto begin = static_cast<std::uint32_t>(span >> 32), end = static_cast<std::uint32_t>(span);
        if (!joined_.empty() && begin <= joined_.back() + 1) {
          joined_.back() = std::max(joined_.back(), end);
        } else {
          joined_.push_back(begin);
          joined_.push_back(end);
        }
      }
      const std::array<std::uint32_t, 2> both{0, static_cast<std::uint32_t>(joined_.size())},
          own{0, static_cast<std::uint32_t>(row.size())};
      append_combined({image.columns, both, joined_}, {image.columns, own, row}, SetOperation::kDifference, bridged_);
    } else {
      end_row(bridged_);
    }
  }
  return !bridged_.change.empty();
}

/// Whether a piece of the rest touches wide runs of two pieces, of any size.
bool Necks::touches_two(const RunsView& wide, const RunsView& rest) {
  neighbour_.assign(pieces_.count(), UINT32_MAX);
  bool two = false;
  const auto note = [&](std::uint32_t run, std::uint32_t of_wide) {
    const std::uint32_t part = wide_.number_of(of_wide);
    std::uint32_t& neighbour = neighbour_[pieces_.of_run[run]];
    two = two || (neighbour != UINT32_MAX && neighbour != part);
    neighbour = part;
  };
  for_neighbours(rest, wide, note);
  return two;
}

void Necks::find(const RunsView& image, const Widths& widths, std::uint64_t minimum, Runs& result) {
  const Runs* rest = &widths.rest;
  if (!widths.narrow.change.empty()) {
    combine(widths.rest, widths.narrow, SetOperation::kDifference, rest_);
    rest = &rest_;
  }
  if (bridge(image)) {
    combine(*rest, bridged_, SetOperation::kUnion, added_);
    rest = &added_;
  }
  pieces_.find(*rest, true);
  joins_.assign(pieces_.count(), 0);
  // What is connected near the rest is connected.
  others_near(image, widths.rest, *rest, near_);
  wide_.label(near_, false);
  if (touches_two(near_, *rest)) {
    combine(image, widths.rest, SetOperation::kDifference, all_wide_);
    wide_.find(all_wide_, false);
    mark(all_wide_, *rest, minimum);
  }
  for (std::size_t p = 0; p < pieces_.count(); ++p) {
    if (joins_[p] == 0) pieces_.pixels[p] = 0;
  }
  pick(*rest, pieces_, 0, UINT64_MAX, result);
}

std::uint64_t Necks::bytes() const {
  return bytes_of(rest_) + bytes_of(near_) + bytes_of(all_wide_) + bytes_of(added_) + bytes_of(bridged_) + wide_.bytes() +
         pieces_.bytes() + bytes_held(neighbour_) + bytes_held(joins_) + bytes_held(spans_) + bytes_held(joined_);
}

VanishedPieces vanished_pieces(const RunsView& before, const RunsView& after, std::uint64_t minimum, VanishScratch& scratch) {
  VanishedPieces found;
  if (before.change.empty()) return found;
  scratch.pieces.find(before, true);
  scratch.stays.assign(scratch.pieces.count(), 0);
  for (std::uint32_t r = 0; r < before.rows(); ++r) {
    for_touching(before, r, after, r, false,
                 [&](std::uint32_t run, std::uint32_t) { scratch.stays[scratch.pieces.of_run[run]] = 1; });
  }
  for (std::size_t p = 0; p < scratch.pieces.count(); ++p) {
    const std::uint64_t pixels = scratch.pieces.pixels[p];
    if (scratch.stays[p] != 0 || pixels <= minimum) continue;
    ++found.count;
    if (pixels <= found.largest) continue;
    found.largest = pixels;
    found.box = scratch.pieces.box[p];
  }
  return found;
}

void VanishCount::add(const Layer& layer, const VanishedPieces& found) {
  if (found.count == 0 || layer.index != next_) now_ = {};
  next_ = layer.index + 1;
  if (found.count == 0) return;
  ++now_.layers;
  if (now_.layers == kLayers) layers_ += kLayers;
  if (now_.layers > kLayers) ++layers_;
  if (found.largest > now_.largest) {
    now_.largest = found.largest;
    now_.box = found.box;
    now_.layer = layer;
  }
  if (now_.layers >= kLayers && now_.largest > worst_.largest) worst_ = now_;
}

void VanishCount::report(const PixelGrid& grid, bool mirrored_x, bool mirrored_y, std::vector<Warning>& warnings) const {
  if (layers_ == 0) return;
  std::int64_t column = (std::int64_t{worst_.box.left} + worst_.box.right - 1) / 2;
  std::int64_t row = (std::int64_t{worst_.box.top} + worst_.box.bottom - 1) / 2;
  if (mirrored_x) column = grid.columns() - 1 - column;
  if (mirrored_y) row = grid.rows() - 1 - row;
  const double mm2 = static_cast<double>(worst_.largest) / (grid.x.pixels_per_nm() * grid.y.pixels_per_nm() * 1e12);
  const double x = mm(grid.x.centre(column)), y = mm(grid.y.centre(std::int64_t{grid.rows()} - 1 - row)),
               z = mm(worst_.layer.bottom);
  warnings.push_back(
      {"vanished",
       fmt::format("the bleed leaves nothing of whole pieces of {} layers, the largest of {:.3g} mm2 at x {:.2f}, "
                   "y {:.2f}, z {:.2f} mm (layer {}): walls narrower than twice the bleed; make them thicker, or "
                   "give a smaller --bleed",
                   layers_, mm2, x, y, z, worst_.layer.index),
       {},
       worst_.layer.index,
       z});
}

}  // namespace lamina::checks
