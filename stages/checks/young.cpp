#include "stages/checks/young.h"

#include <algorithm>
#include <utility>

#include "stages/geometry/combine.h"

namespace lamina::checks {

/// Puts a part of a column into the next layer.
void YoungColumns::keep(const ColumnSpan& span, std::uint32_t begin, std::uint32_t end, std::int64_t from) {
  if (begin >= end) return;
  if (span.bottom <= from) {
    Buffer<std::uint32_t>& change = next_tall_.change;
    if (change.size() > next_tall_.row_offset.back() && change.back() == begin) {
      change.back() = end;
    } else {
      change.push_back(begin);
      change.push_back(end);
    }
    return;
  }
  if (next_.size() > next_row_.back()) {
    ColumnSpan& last = next_.back();
    if (last.end == begin && last.first_layer == span.first_layer && last.bottom == span.bottom) {
      last.end = end;
      return;
    }
  }
  next_.push_back(span);
  next_.back().begin = begin;
  next_.back().end = end;
}

/// Of a row whose columns are all tall.
void YoungColumns::add_tall_row(std::span<const std::uint32_t> image, std::span<const std::uint32_t> old,
                                const ColumnSpan& kind) {
  Buffer<std::uint32_t>& change = next_tall_.change;
  const auto begin_columns = [&](std::uint32_t begin, std::uint32_t end) {
    next_.push_back(kind);
    next_.back().begin = begin;
    next_.back().end = end;
  };
  for (std::size_t run = 0, i = 0; run < image.size(); run += 2) {
    std::uint32_t done = image[run];
    const std::uint32_t end = image[run + 1];
    while (i < old.size() && old[i + 1] <= done) i += 2;
    for (; i < old.size() && old[i] < end; i += 2) {
      if (done < old[i]) begin_columns(done, old[i]);
      change.push_back(std::max(done, old[i]));
      change.push_back(done = std::min(end, old[i + 1]));
      if (old[i + 1] > end) break;
    }
    if (done < end) begin_columns(done, end);
  }
}

void YoungColumns::add_row(std::uint32_t row, std::span<const std::uint32_t> image, std::int64_t from, const ColumnSpan& kind) {
  ColumnSpan tall;
  tall.bottom = ColumnSpan::kEndless;
  const auto old = tall_.view().row(row);
  std::size_t i = 0, at = row_[row];
  const std::size_t last = row_[row + 1];
  // Spans of both kinds from the left, the parts of the image between them, and their parts outside of it.
  std::size_t run = 0;
  std::uint32_t done = image.empty() ? UINT32_MAX : image[0];  // the image is done with up to here
  while (i < old.size() || at < last) {
    const bool is_tall = at == last || (i < old.size() && old[i] < span_[at].begin);
    const ColumnSpan& span = is_tall ? tall : span_[at];
    std::uint32_t begin = is_tall ? old[i] : span.begin;
    const std::uint32_t end = is_tall ? old[i + 1] : span.end;
    const auto end_column = [&](std::uint32_t to) {
      if (is_tall || begin >= to) return;
      ended_.push_back(span);
      ended_.back().begin = begin;
      ended_.back().end = to;
      ended_.back().row = row;
    };
    for (; run < image.size() && image[run] < end; run += 2) {
      const std::uint32_t image_end = image[run + 1];
      // Up to the span, the image begins columns.
      if (done < begin) keep(kind, done, std::min(begin, image_end), from);
      if (image_end > begin) {
        const std::uint32_t first = std::max(begin, image[run]);
        end_column(first);
        keep(span, first, std::min(end, image_end), from);
        begin = done = std::min(end, image_end);
      }
      if (image_end > end) break;
      done = run + 2 < image.size() ? image[run + 2] : UINT32_MAX;
    }
    end_column(end);
    (is_tall ? i : at) += is_tall ? 2 : 1;
  }
  for (; run < image.size(); run += 2) {
    keep(kind, std::max(done, image[run]), image[run + 1], from);
  }
}

void YoungColumns::add(const Layer& layer, const RunsView& image, std::int64_t from, bool all_tall) {
  const std::uint32_t rows = image.rows();
  ended_.clear();
  if (row_.empty()) {
    row_.assign(std::size_t{rows} + 1, 0);
    tall_.columns = image.columns;
    tall_.row_offset.assign(std::size_t{rows} + 1, 0);
    tall_.change.clear();
    if (all_tall) return copy_runs(image, tall_);
  }
  if (layer.bottom <= from) {
    // Columns are tall at once, and so are those that are left.
    span_.clear();
    row_.assign(std::size_t{rows} + 1, 0);
    return copy_runs(image, tall_);
  }
  next_.clear();
  next_row_.assign(1, 0);
  next_row_.reserve(std::size_t{rows} + 1);
  next_tall_.columns = image.columns;
  next_tall_.row_offset.reserve(std::size_t{rows} + 1);
  next_tall_.row_offset.assign(1, 0);
  next_tall_.change.clear();
  ColumnSpan kind;
  kind.bottom = layer.bottom;
  kind.first_layer = layer.index;
  for (std::uint32_t r = 0; r < rows; ++r) {
    const auto runs = image.row(r), old = tall_.view().row(r);
    if (row_[r] == row_[r + 1] && std::ranges::equal(runs, old)) {
      next_tall_.change.insert(next_tall_.change.end(), runs.begin(), runs.end());
    } else if (row_[r] == row_[r + 1]) {
      add_tall_row(runs, old, kind);
    } else {
      add_row(r, runs, from, kind);
    }
    next_row_.push_back(static_cast<std::uint32_t>(next_.size()));
    next_tall_.row_offset.push_back(static_cast<std::uint32_t>(next_tall_.change.size()));
  }
  std::swap(span_, next_);
  std::swap(row_, next_row_);
  std::swap(tall_, next_tall_);
}

void YoungColumns::finish() {
  ended_.clear();
  for (std::uint32_t r = 0; r + 1 < row_.size(); ++r) {
    for (std::uint32_t i = row_[r]; i < row_[r + 1]; ++i) {
      ended_.push_back(span_[i]);
      ended_.back().row = r;
    }
  }
  row_.clear();
  span_.clear();
}

/// Adds an element whose buffers were in use before, if there is one.
void TallColumns::push(std::vector<LayerImage>& stack) {
  if (unused_.empty()) unused_.emplace_back();
  stack.push_back(std::move(unused_.back()));
  unused_.pop_back();
}

/// The bottom of the second lowest layer of the window.
std::int64_t TallColumns::second_bottom() const {
  if (lower_.size() > 1) return lower_[lower_.size() - 2].bottom;
  return lower_.empty() ? upper_[1].bottom : upper_[0].bottom;
}

void TallColumns::add(const Layer& layer, const RunsView& image, std::int64_t from) {
  push(upper_);
  upper_.back().bottom = layer.bottom;
  copy_runs(image, upper_.back().image);
  if (upper_.size() == 1) {
    copy_runs(image, upper_all_);
  } else {
    combine(upper_all_, image, SetOperation::kIntersection, spare_);
    std::swap(upper_all_, spare_);
  }
  while (lower_.size() + upper_.size() > 1 && second_bottom() <= from) {
    if (lower_.empty()) {
      for (; !upper_.empty(); upper_.pop_back()) {
        lower_.push_back(std::move(upper_.back()));
        if (lower_.size() == 1) continue;
        combine(lower_.back().image, lower_[lower_.size() - 2].image, SetOperation::kIntersection, spare_);
        std::swap(lower_.back().image, spare_);
      }
    }
    unused_.push_back(std::move(lower_.back()));
    lower_.pop_back();
  }
  if (lower_.empty() || upper_.empty()) return copy_runs(lower_.empty() ? upper_all_ : lower_.back().image, tall_);
  combine(lower_.back().image, upper_all_, SetOperation::kIntersection, tall_);
}

std::uint64_t TallColumns::need(const RunsView& image) const {
  const auto size = [](const RunsView& runs) { return runs.change.size_bytes() + runs.row_offset.size_bytes(); };
  std::uint64_t total = 5 * size(image);
  for (const std::vector<LayerImage>* stack : {&lower_, &upper_}) {
    for (const LayerImage& one : *stack) total += size(one.image);
  }
  return total;
}

std::uint64_t TallColumns::bytes() const {
  std::uint64_t total = bytes_of(upper_all_) + bytes_of(spare_) + bytes_of(tall_);
  for (const std::vector<LayerImage>* stack : {&lower_, &upper_, &unused_}) {
    total += stack->capacity() * sizeof(LayerImage);
    for (const LayerImage& one : *stack) total += bytes_of(one.image);
  }
  return total;
}

}  // namespace lamina::checks
