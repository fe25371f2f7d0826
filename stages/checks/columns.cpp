#include "stages/checks/columns.h"

#include <algorithm>

#include "stages/checks/thin.h"

namespace lamina::checks {

void Columns::push(ColumnSpan span) {
  if (span.begin >= span.end) return;
  if (next_.size() > next_row_.back()) {
    ColumnSpan& last = next_.back();
    if (last.end == span.begin && last.first_layer == span.first_layer && last.bottom == span.bottom &&
        last.attached == span.attached) {
      last.end = span.end;
      return;
    }
  }
  next_.push_back(span);
}

void Columns::begin_columns(std::uint32_t begin, std::uint32_t end, std::span<const std::uint32_t> base,
                            const ColumnSpan& kind) {
  ColumnSpan span = kind;
  auto at = static_cast<std::size_t>(std::ranges::upper_bound(base, begin) - base.begin());
  for (; begin < end; ++at) {
    span.begin = begin;
    span.end = begin = at < base.size() ? std::min(end, base[at]) : end;
    span.attached = at % 2 == 1 ? 1 : 0;
    push(span);
  }
}

void Columns::end_columns(std::uint32_t row, std::size_t& at, std::size_t last, std::uint32_t from, std::uint32_t to) {
  for (; at < last && span_[at].begin < to; ++at) {
    ColumnSpan span = span_[at];
    span.begin = std::max(span.begin, from);
    span.end = std::min(span.end, to);
    span.row = row;
    if (span.begin < span.end) ended_.push_back(span);
    if (span_[at].end > to) return;
  }
}

void Columns::add(const Layer& layer, const RunsView& image, const RunsView& base) {
  const std::uint32_t rows = image.rows();
  if (row_.empty()) row_.assign(std::size_t{rows} + 1, 0);
  ended_.clear();
  if (image.change.empty() && span_.empty()) return;
  next_.clear();
  next_row_.assign(1, 0);
  ColumnSpan kind;
  kind.bottom = layer.bottom;
  kind.first_layer = layer.index;
  for (std::uint32_t r = 0; r < rows; ++r) {
    const auto runs = image.row(r);
    const auto below = r < base.rows() ? base.row(r) : std::span<const std::uint32_t>();
    std::size_t at = row_[r];
    const std::size_t last = row_[r + 1];
    std::uint32_t done = 0;
    for (std::size_t i = 0; i + 1 < runs.size(); i += 2) {
      const std::uint32_t begin = runs[i], end = runs[i + 1];
      end_columns(r, at, last, done, begin);
      std::uint32_t from = begin;
      for (; at < last && span_[at].begin < end; ++at) {
        ColumnSpan span = span_[at];
        span.begin = std::max(span.begin, begin);
        span.end = std::min(span.end, end);
        if (span.begin < span.end) {
          begin_columns(from, span.begin, below, kind);
          push(span);
          from = span.end;
        }
        if (span_[at].end > end) break;
      }
      begin_columns(from, end, below, kind);
      done = end;
    }
    end_columns(r, at, last, done, UINT32_MAX);
    next_row_.push_back(static_cast<std::uint32_t>(next_.size()));
  }
  std::swap(span_, next_);
  std::swap(row_, next_row_);
}

void Columns::finish() {
  ended_.clear();
  for (std::uint32_t r = 0; r + 1 < row_.size(); ++r) {
    std::size_t at = row_[r];
    end_columns(r, at, row_[r + 1], 0, UINT32_MAX);
  }
  row_.clear();
  span_.clear();
}

namespace {

/// Calls visit(part of a span, whether it is within the image).
template <class Visit>
void split(std::span<const ColumnSpan> spans, const RunsView& image, const Visit& visit) {
  for (const ColumnSpan& whole : spans) {
    const auto row = whole.row < image.rows() ? image.row(whole.row) : std::span<const std::uint32_t>();
    auto at = static_cast<std::size_t>(std::ranges::upper_bound(row, whole.begin) - row.begin());
    ColumnSpan span = whole;
    for (; span.begin < whole.end; ++at, span.begin = span.end) {
      span.end = at < row.size() ? std::min(whole.end, row[at]) : whole.end;
      visit(span, at % 2 == 1);
    }
  }
}

}  // namespace

void attach(std::span<const ColumnSpan> spans, const RunsView& image, Buffer<ColumnSpan>& result) {
  result.clear();
  split(spans, image, [&](ColumnSpan span, bool within) {
    if (within) span.attached = 1;
    result.push_back(span);
  });
}

void clip(std::span<const ColumnSpan> spans, const RunsView& image, Buffer<ColumnSpan>& result) {
  result.clear();
  split(spans, image, [&](const ColumnSpan& span, bool within) {
    if (within) result.push_back(span);
  });
}

void footprint(std::span<const ColumnSpan> spans, std::uint32_t columns, std::uint32_t rows, Runs& result) {
  result.columns = columns;
  result.row_offset.assign(1, 0);
  result.change.clear();
  std::size_t at = 0;
  for (std::uint32_t r = 0; r < rows; ++r) {
    const std::size_t row_begin = result.change.size();
    for (; at < spans.size() && spans[at].row == r; ++at) {
      if (result.change.size() > row_begin && result.change.back() == spans[at].begin) {
        result.change.back() = spans[at].end;
      } else {
        result.change.push_back(spans[at].begin);
        result.change.push_back(spans[at].end);
      }
    }
    result.row_offset.push_back(static_cast<std::uint32_t>(result.change.size()));
  }
}

void ColumnBodies::find(const Layer& layer, std::span<const ColumnSpan> ended, std::uint32_t columns, std::uint32_t rows,
                        std::int64_t tall_nm) {
  // Beyond the last column and row there is one more, so that what is wider remains in the image.
  footprint(ended, columns + 1, rows + 1, footprint_);
  grown_.columns = columns + 1;
  grown_.row_offset.assign(1, 0);
  grown_.change.clear();
  const RunsView flat = footprint_;
  for (std::uint32_t r = 0; r < rows + 1; ++r) {
    const std::size_t row_begin = grown_.change.size();
    const auto above = r > 0 ? flat.row(r - 1) : std::span<const std::uint32_t>(), here = flat.row(r);
    for (std::size_t i = 0, j = 0; i < above.size() || j < here.size();) {
      const bool first = j >= here.size() || (i < above.size() && above[i] < here[j]);
      const auto& from = first ? above : here;
      std::size_t& at = first ? i : j;
      const std::uint32_t begin = from[at], end = from[at + 1] + 1;
      at += 2;
      if (grown_.change.size() > row_begin && begin <= grown_.change.back()) {
        grown_.change.back() = std::max(grown_.change.back(), end);
      } else {
        grown_.change.push_back(begin);
        grown_.change.push_back(end);
      }
    }
    grown_.row_offset.push_back(static_cast<std::uint32_t>(grown_.change.size()));
  }
  follower_.find(grown_);
  sums_.assign(follower_.pieces().count(), PieceSum());
  const RunsView grown = grown_;
  for (const ColumnSpan& span : ended) {
    const auto row = grown.row(span.row);
    const auto run = static_cast<std::uint32_t>(std::ranges::upper_bound(row, span.begin) - row.begin() - 1) / 2;
    PieceSum& sum = sums_[follower_.pieces().of_run[grown.row_offset[span.row] / 2 + run]];
    const std::int64_t height = std::int64_t{layer.bottom} - span.bottom;
    const std::uint64_t pixels = span.end - span.begin;
    sum.area += pixels;
    if (height >= tall_nm) sum.tall += pixels;
    if (span.attached == 0) sum.detached += pixels;
    sum.pixel_nm += pixels * static_cast<std::uint64_t>(height);
    sum.bottom = std::min<std::int64_t>(sum.bottom, span.bottom);
    sum.first_layer = std::min(sum.first_layer, span.first_layer);
  }
}

}  // namespace lamina::checks
