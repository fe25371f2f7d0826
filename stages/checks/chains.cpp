#include "stages/checks/chains.h"

#include <algorithm>
#include <utility>

#include "stages/geometry/combine.h"

namespace lamina::checks {
namespace {

constexpr std::int32_t kFar = 1 << 30;

}  // namespace

bool Chains::find(const RunsView& image, std::uint32_t stencil_rows) {
  columns_ = image.columns;
  rows_ = image.rows();
  const std::size_t runs = image.change.size() / 2, more = stencil_rows - 1;
  of_run_.resize(runs);
  chain_.clear();
  const std::uint32_t* const change = image.change.data();
  std::uint32_t above = 0, run = 0;
  for (std::uint32_t r = 0; r < rows_; ++r) {
    const std::uint32_t above_end = run, end = image.row_offset[r + 1] / 2;
    if (r > 0 && run < end && rows_aligned(image.row(r - 1), image.row(r))) {
      for (; run < end; ++run) ++chain_[of_run_[run] = of_run_[above++]].length;
      continue;
    }
    for (; run < end; ++run) {
      const std::uint32_t left = change[2 * run], right = change[2 * run + 1];
      while (above < above_end && change[2 * above + 1] <= left) ++above;
      if (above < above_end && change[2 * above] < right) {
        const std::uint32_t chain = of_run_[run] = of_run_[above++];
        ++chain_[chain].length;
      } else {
        of_run_[run] = static_cast<std::uint32_t>(chain_.size());
        chain_.push_back({r, 1, 0, 0});
        if (chain_.size() * (more + 4) > 4 * runs + 4096) return false;
      }
    }
    above = above_end;
  }
  std::size_t at = 0;
  for (Chain& chain : chain_) {
    chain.at = chain.spread = at;
    at += chain.length;
  }
  end_left_.resize(at);
  end_right_.resize(at);
  for (run = 0; run < runs; ++run) {
    const std::size_t to = chain_[of_run_[run]].spread++;
    end_left_[to] = static_cast<std::int32_t>(change[2 * run]);
    end_right_[to] = -static_cast<std::int32_t>(change[2 * run + 1]);
  }
  return true;
}

/// Takes the chains that begin up to an output row, and drops those that ended.
void Chains::enter(std::int64_t row, std::int64_t shift, std::size_t& next) {
  const std::int64_t more = stencil_.rows() - 1;
  std::erase_if(active_, [&](const Active& one) { return one.end <= row; });
  begin_.clear();
  for (; next < chain_.size() && chain_[next].row + shift <= row; ++next) {
    const Chain& chain = chain_[next];
    const std::int64_t first = chain.row + shift, end = first + chain.length + more;
    if (end <= row) continue;
    begin_.push_back({static_cast<std::ptrdiff_t>(chain.spread) - first, end});
  }
  if (begin_.empty()) return;
  const auto left_at = [&](const Active& one) { return left_[static_cast<std::size_t>(one.at + row)]; };
  const auto by_left = [&](const Active& a, const Active& b) { return left_at(a) < left_at(b); };
  std::sort(begin_.begin(), begin_.end(), by_left);
  const auto middle = static_cast<std::ptrdiff_t>(active_.size());
  active_.insert(active_.end(), begin_.begin(), begin_.end());
  std::inplace_merge(active_.begin(), active_.begin() + middle, active_.end(), by_left);
}

/// Writes a row of the output. returns  behind it; null: the chains are not in the order of their left ends
std::uint32_t* Chains::fill_row(std::uint32_t row, const RowEdges& edges, bool gaps, std::uint32_t* to) const {
  std::int32_t before = INT32_MIN, begin = edges.left, end = edges.left;
  const auto put = [&](std::int32_t first, std::int32_t last) {
    to[0] = static_cast<std::uint32_t>(first);
    to[1] = static_cast<std::uint32_t>(last);
    to += 2;
  };
  for (const Active& one : active_) {
    const auto at = static_cast<std::size_t>(one.at + row);
    const std::int32_t from = left_[at], until = std::min(edges.right, edges.to_right - less_right_[at]);
    if (from < before) return nullptr;
    before = from;
    const std::int32_t first = std::max(edges.left, from + edges.to_left);
    if (first >= until) continue;
    if (first > end) {
      if (gaps) put(end, first);
      if (!gaps && end > begin) put(begin, end);
      begin = first;
      end = until;
    } else {
      end = std::max(end, until);
    }
  }
  if (gaps && end < edges.right) put(end, edges.right);
  if (!gaps && begin < end) put(begin, end);
  return to;
}

void Chains::spread(const StencilSteps& stencil, bool corners, const PixelBox& window, bool gaps, Runs& result) {
  stencil_ = stencil;
  std::size_t all = 0;
  for (Chain& chain : chain_) {
    chain.spread = all;
    all += chain.length + stencil.rows() - 1;
  }
  left_.resize(all);
  less_right_.resize(all);
  // Between the ends of chains so many rows as a stencil has more than one are beyond all columns.
  const std::size_t more = stencil.rows() - 1;
  one_.resize(all + more);
  for (const auto& [ends, covered] : {std::pair(&end_left_, &left_), std::pair(&end_right_, &less_right_)}) {
    std::int32_t* to = one_.data();
    for (const Chain& chain : chain_) {
      to = std::fill_n(to, more, kFar);
      to = std::copy_n(ends->data() + chain.at, chain.length, to);
    }
    std::fill_n(to, more, kFar);
    slide_minima(one_.data(), all, 1, profile(stencil, covered == &less_right_), other_, covered->data());
  }
  const auto wide = static_cast<std::int32_t>(stencil.columns() - 1);
  const std::int64_t shift = corners ? 1 - static_cast<std::int64_t>(stencil.rows()) : 0;
  const RowEdges edges{static_cast<std::int32_t>(window.left), static_cast<std::int32_t>(window.right), corners ? -wide : 0,
                       corners ? 0 : wide};
  const std::uint32_t bottom = edges.left < edges.right ? std::min(rows_, window.bottom) : 0,
                      top = std::min(window.top, bottom);
  result.columns = columns_;
  result.row_offset.assign(std::size_t{rows_} + 1, 0);
  result.change.resize(result.change.capacity());
  active_.clear();
  std::size_t next_chain = 0, size = 0;
  std::int64_t ends = INT64_MAX;  // the first row that no longer meets one of the active chains
  const auto begins = [&] { return next_chain < chain_.size() ? chain_[next_chain].row + shift : INT64_MAX; };
  for (std::uint32_t r = top; r < bottom; ++r) {
    if (r >= ends || begins() <= r) {
      enter(r, shift, next_chain);
      ends = INT64_MAX;
      for (const Active& one : active_) ends = std::min(ends, one.end);
    }
    if (active_.empty() && !gaps) {
      const auto next = static_cast<std::uint32_t>(std::min<std::int64_t>(bottom, std::max<std::int64_t>(r + 1, begins())));
      std::fill(result.row_offset.begin() + r + 1, result.row_offset.begin() + next + 1, static_cast<std::uint32_t>(size));
      r = next - 1;
      continue;
    }
    const std::size_t enough = size + 2 * active_.size() + 2;
    if (result.change.size() < enough) result.change.resize(std::max(enough, size + size / 2));
    std::uint32_t* const row = result.change.data() + size;
    std::uint32_t* end = fill_row(r, edges, gaps, row);
    if (end == nullptr) {
      std::ranges::sort(active_, {}, [&](const Active& one) { return left_[static_cast<std::size_t>(one.at + r)]; });
      end = fill_row(r, edges, gaps, row);
    }
    size += static_cast<std::size_t>(end - row);
    result.row_offset[r + 1] = static_cast<std::uint32_t>(size);
  }
  std::fill(result.row_offset.begin() + bottom, result.row_offset.end(), static_cast<std::uint32_t>(size));
  result.change.resize(size);
}

std::uint64_t Chains::bytes() const {
  return bytes_held(of_run_) + bytes_held(chain_) + bytes_held(end_left_) + bytes_held(end_right_) + bytes_held(left_) +
         bytes_held(less_right_) + bytes_held(one_) + bytes_held(other_) + bytes_held(active_) + bytes_held(begin_);
}

}  // namespace lamina::checks
