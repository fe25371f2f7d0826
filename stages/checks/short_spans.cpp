#include "stages/checks/short_spans.h"

#include <algorithm>
#include <utility>

namespace lamina::checks {
namespace {

/// Calls visit(begin, end) for what is set in one row but not in the other.
template <class Visit>
void for_difference(std::span<const std::uint32_t> set, std::span<const std::uint32_t> unset, const Visit& visit) {
  std::size_t j = 0;
  for (std::size_t i = 0; i < set.size(); i += 2) {
    std::uint32_t begin = set[i];
    const std::uint32_t end = set[i + 1];
    while (j < unset.size() && unset[j + 1] <= begin) j += 2;
    for (std::size_t k = j; begin < end; k += 2) {
      if (k >= unset.size() || unset[k] >= end) {
        visit(begin, end);
        break;
      }
      if (unset[k] > begin) visit(begin, unset[k]);
      begin = std::max(begin, unset[k + 1]);
    }
  }
}

bool equal(const RunsView& a, const RunsView& b) {
  return std::ranges::equal(a.row_offset, b.row_offset) && std::ranges::equal(a.change, b.change);
}

}  // namespace

/// Whether no short column ends in a row: all layers have as many runs there, and none moves out and back. Where it does not
/// know, it says no. tall  whether columns that begin in the lowest layer are not short
bool ShortSpans::steady(std::uint32_t row, std::span<const std::uint32_t> image, bool tall) const {
  const std::size_t size = image.size(), layers = below_.size() - 1;
  const auto last = below_.back().image.view().row(row);
  if (last.size() != size) return false;
  const std::uint32_t* old[kMaxLayers];
  for (std::size_t j = 0; j < layers; ++j) {
    const auto one = below_[j].image.view().row(row);
    if (one.size() != size) return false;
    old[j] = one.data();
  }
  const std::uint32_t ends = tall ? 0 : 1;
  std::uint32_t bad = 0, right_before = 0, grown_before = 0, moved_before = 0;
  for (std::size_t i = 0; i < size; i += 2) {
    const std::uint32_t left = image[i], right = image[i + 1], last_left = last[i], last_right = last[i + 1];
    std::uint32_t min_left = UINT32_MAX, max_left = 0, min_right = UINT32_MAX, max_right = 0;
    for (std::size_t j = 0; j < layers; ++j) {
      min_left = std::min(min_left, old[j][i]);
      max_left = std::max(max_left, old[j][i]);
      min_right = std::min(min_right, old[j][i + 1]);
      max_right = std::max(max_right, old[j][i + 1]);
    }
    // What material leaves was set in all layers.
    bad |= static_cast<std::uint32_t>(last_left < left) &
           (ends | static_cast<std::uint32_t>(max_left > last_left) | static_cast<std::uint32_t>(min_right < left));
    bad |= static_cast<std::uint32_t>(right < last_right) &
           (ends | static_cast<std::uint32_t>(min_right < last_right) | static_cast<std::uint32_t>(max_left > right));
    // Where it grows was powder in all layers, up to the runs next to it.
    bad |= static_cast<std::uint32_t>(left < last_left) &
           (static_cast<std::uint32_t>(min_left < last_left) | static_cast<std::uint32_t>(right_before > left));
    bad |= grown_before & static_cast<std::uint32_t>(min_left < moved_before);
    grown_before = right > last_right ? 1 : 0;
    moved_before = right;
    bad |= grown_before & static_cast<std::uint32_t>(max_right > last_right);
    right_before = max_right;
  }
  return bad == 0;
}

/// Appends the columns of what ends in a row. set  whether they are of set pixels; endless  the columns of the lowest layer
/// are not short
void ShortSpans::cut(std::uint32_t row, bool set, bool endless, Buffer<ColumnSpan>& result) {
  const std::size_t first = result.size();
  const auto begin_columns = [&](std::uint32_t begin, std::uint32_t end, const Layer& layer) {
    ColumnSpan span;
    span.begin = begin;
    span.end = end;
    span.bottom = layer.bottom;
    span.first_layer = layer.index;
    span.row = row;
    result.push_back(span);
  };
  for (std::size_t j = below_.size() - 1; j-- > 0 && !ending_.empty();) {
    const auto old = below_[j].image.view().row(row);
    rest_.clear();
    for (const Range& range : ending_) {
      std::uint32_t begin = range.begin;
      auto at = static_cast<std::size_t>(std::ranges::upper_bound(old, begin) - old.begin());
      for (; begin < range.end; ++at) {
        const std::uint32_t end = at < old.size() ? std::min(range.end, old[at]) : range.end;
        if ((at % 2 == 1) == set) {
          rest_.push_back({begin, end});
        } else {
          begin_columns(begin, end, below_[j + 1].layer);
        }
        begin = end;
      }
    }
    std::swap(ending_, rest_);
  }
  if (!endless) {
    for (const Range& range : ending_) begin_columns(range.begin, range.end, below_[0].layer);
  }
  std::sort(result.begin() + static_cast<std::ptrdiff_t>(first), result.end(),
            [](const ColumnSpan& a, const ColumnSpan& b) { return a.begin < b.begin; });
}

/// The parts of what ends that are within a row of an image.
void ShortSpans::keep_within(std::span<const std::uint32_t> image) {
  rest_.clear();
  std::size_t i = 0;
  for (const Range& range : ending_) {
    while (i < image.size() && image[i + 1] <= range.begin) i += 2;
    for (std::size_t k = i; k < image.size() && image[k] < range.end; k += 2)
      rest_.push_back({std::max(range.begin, image[k]), std::min(range.end, image[k + 1])});
  }
  std::swap(ending_, rest_);
}

/// The parts of what ends that are outside of it.
void ShortSpans::keep_outside(std::span<const std::uint32_t> image) {
  rest_.clear();
  std::size_t i = 0;
  for (const Range& range : ending_) {
    std::uint32_t begin = range.begin;
    while (i < image.size() && image[i + 1] <= begin) i += 2;
    for (std::size_t k = i; k < image.size() && image[k] < range.end; k += 2) {
      if (begin < image[k]) rest_.push_back({begin, image[k]});
      begin = std::max(begin, image[k + 1]);
    }
    if (begin < range.end) rest_.push_back({begin, range.end});
  }
  std::swap(ending_, rest_);
}

/// Cuts what ends in a row. tall  columns that begin in the lowest layer are not short
void ShortSpans::end_row(std::uint32_t row, std::span<const std::uint32_t> image, bool tall, const PixelBox& window) {
  const auto before = below_.back().image.view().row(row);
  const bool many = !recent_.empty();
  ending_.clear();
  for_difference(before, image, [&](std::uint32_t begin, std::uint32_t end) { ending_.push_back({begin, end}); });
  if (many && tall && !ending_.empty()) keep_outside(recent_.all().row(row));
  cut(row, true, tall, solid_);
  ending_.clear();
  if (row < window.top || row >= window.bottom) return;
  for_difference(image, before, [&](std::uint32_t begin, std::uint32_t end) {
    begin = std::max(begin, window.left);
    end = std::min(end, window.right);
    if (begin < end) ending_.push_back({begin, end});
  });
  if (many && !ending_.empty()) keep_within(recent_.any().row(row));
  cut(row, false, true, powder_);
}

void ShortSpans::end_rows(const Layer& layer, const RunsView& image, const PixelBox& window) {
  solid_.clear();
  powder_.clear();
  if (below_.empty()) return;
  const bool tall = std::int64_t{layer.bottom} - below_[0].layer.bottom >= height_nm_;
  if (below_.size() == 1 && tall) return;
  const RunsView last = below_.back().image;
  for (std::uint32_t r = 0; r < last.rows(); ++r) {
    const auto now = r < image.rows() ? image.row(r) : std::span<const std::uint32_t>(), before = last.row(r);
    if (std::ranges::equal(now, before)) continue;
    if (recent_.empty() && below_.size() > 1 && steady(r, now, tall)) continue;
    end_row(r, now, tall, window);
  }
}

/// The lowest layer becomes the last one of which columns are tall.
void ShortSpans::forget(const Layer& layer) {
  while (below_.size() > 1 && std::int64_t{layer.bottom} - below_[1].layer.bottom >= height_nm_) {
    unused_.push_back(std::move(below_.front()));
    below_.pop_front();
  }
  if (!recent_.empty()) {
    recent_.forget(std::int64_t{layer.bottom} - height_nm_, below_.size());
  } else if (below_.size() > kMaxLayers) {
    for (const Below& one : below_) recent_.add(one.layer, one.image);
  }
}

void ShortSpans::add(const Layer& layer, const RunsView& image, const PixelBox& window) {
  forget(layer);
  end_rows(layer, image, window);
  if (!below_.empty() && equal(below_.back().image, image)) return;
  if (!recent_.empty()) recent_.add(layer, image);
  if (unused_.empty()) unused_.emplace_back();
  below_.push_back(std::move(unused_.back()));
  unused_.pop_back();
  below_.back().layer = layer;
  copy_runs(image, below_.back().image);
}

void ShortSpans::finish(const Layer& above) {
  forget(above);
  end_rows(above, {}, {0, 0, 0, 0});
}

std::uint64_t ShortSpans::need(const RunsView& image, std::uint64_t of_ended) const {
  // Of noise a span ends for each run of the last two layers, in a buffer that doubles.
  const std::uint64_t runs = image.change.size() / 2 + (below_.empty() ? 0 : below_.back().image.change.size() / 2);
  std::uint64_t total = image.change.size_bytes() + image.row_offset.size_bytes() + 2 * runs * sizeof(ColumnSpan) +
                        (solid_.size() + powder_.size()) * of_ended + (recent_.empty() ? 0 : recent_.need(image));
  for (const Below& one : below_) total += 4 * (one.image.change.size() + one.image.row_offset.size());
  return total;
}

std::uint64_t ShortSpans::bytes() const {
  std::uint64_t total = bytes_held(solid_) + bytes_held(powder_) + bytes_held(ending_) + bytes_held(rest_) + recent_.bytes() +
                        below_.size() * sizeof(Below) + unused_.capacity() * sizeof(Below);
  for (const Below& one : below_) total += bytes_of(one.image);
  for (const Below& one : unused_) total += bytes_of(one.image);
  return total;
}

}  // namespace lamina::checks
