#include "stages/checks/simple_chains.h"

#include <algorithm>
#include <cstring>
#include <span>

#include "stages/checks/windows.h"
#include "stages/geometry/combine.h"

namespace lamina::checks {
namespace {

using Row = std::span<const std::uint32_t>;

}  // namespace

/// Runs of a row that share columns with one run above, which shares them with no other, get its chain; others begin one.
void SimpleChains::link(const RunsView& image, std::uint32_t row) {
  const Row above = row > 0 ? image.row(row - 1) : Row(), here = image.row(row);
  touched_.assign(above.size() / 2, 0);
  next_.assign(here.size() / 2, UINT32_MAX);
  for (std::size_t i = 0, j = 0; j < here.size(); j += 2) {
    while (i < above.size() && above[i + 1] <= here[j]) i += 2;
    std::size_t count = 0;
    for (std::size_t k = i; k < above.size() && above[k] < here[j + 1]; k += 2, ++count) ++touched_[k / 2];
    if (count == 1) next_[j / 2] = static_cast<std::uint32_t>(i / 2);
  }
  const std::uint32_t first = image.row_offset[row] / 2, before = row > 0 ? image.row_offset[row - 1] / 2 : 0;
  for (std::uint32_t j = 0; j < next_.size(); ++j) {
    if (next_[j] != UINT32_MAX && touched_[next_[j]] == 1) {
      const std::uint32_t chain = of_run_[first + j] = of_run_[before + next_[j]];
      ++chain_[chain].length;
    } else {
      of_run_[first + j] = static_cast<std::uint32_t>(chain_.size());
      chain_.push_back({row, 1, 0});
    }
  }
}

void SimpleChains::find(const RunsView& image) {
  const std::size_t runs = image.change.size() / 2;
  ensure_capacity(of_run_, runs);
  of_run_.resize(runs);
  chain_.clear();
  for (std::uint32_t r = 0; r < image.rows(); ++r) {
    const Row here = image.row(r);
    if (here.empty()) continue;
    if (r == 0 || !rows_aligned(image.row(r - 1), here)) {
      link(image, r);
      continue;
    }
    const std::uint32_t before = image.row_offset[r - 1] / 2, first = image.row_offset[r] / 2,
                        end = image.row_offset[r + 1] / 2;
    for (std::uint32_t i = first; i < end; ++i) {
      const std::uint32_t chain = of_run_[i] = of_run_[before + (i - first)];
      ++chain_[chain].length;
    }
  }
  next_.resize(chain_.size());
  std::size_t at = 0;
  for (std::size_t c = 0; c < chain_.size(); ++c) {
    chain_[c].at = at;
    next_[c] = static_cast<std::uint32_t>(at);
    at += chain_[c].length;
  }
  for (Buffer<std::int32_t>* values : {&left_, &right_, &first_, &last_, &begin_, &end_}) ensure_capacity(*values, at + 256);
  left_.resize(at);
  right_.resize(at);
  for (std::size_t run = 0; run < runs; ++run) {
    const std::uint32_t to = next_[of_run_[run]]++;
    left_[to] = -static_cast<std::int32_t>(image.change[2 * run]);
    right_[to] = static_cast<std::int32_t>(image.change[2 * run + 1]);
  }
}

/// Corners of stencils, of all chains at once: where the window reaches into the next chain the result has no meaning.
void SimpleChains::slide(const StencilSteps& stencil) {
  const std::size_t runs = of_run_.size(), reach = stencil.rows() - 1;
  for (Buffer<std::int32_t>* values : {&left_, &right_}) {
    values->resize(runs);
    values->resize(runs + reach, 0);
    std::fill(values->begin() + static_cast<std::ptrdiff_t>(runs), values->end(), 0);
  }
  first_.resize(runs + reach);
  last_.resize(runs + reach);
  slide_minima(left_.data(), runs, 1, profile(stencil, true), held_, first_.data());
  Windows right = profile(stencil, false);
  right.added -= static_cast<std::int32_t>(stencil.columns());
  slide_minima(right_.data(), runs, 1, right, held_, last_.data());
  open_.assign(runs, 0);
  found_.clear();
  rows_of_stencil_ = stencil.rows();
}

/// Leaves rows [first, last) of a chain open; `reach` more on both sides are their context.
void SimpleChains::leave(const Chain& chain, std::int64_t first, std::int64_t last, std::int64_t reach) {
  const std::int64_t length = chain.length, begin = std::max<std::int64_t>(0, first - reach),
                     end = std::min(length, last + reach);
  for (std::int64_t r = begin; r < end; ++r) open_[chain.at + static_cast<std::size_t>(r)] |= r >= first && r < last ? 3 : 2;
}

bool SimpleChains::open(const StencilSteps& stencil) {
  slide(stencil);
  erodes_ = false;
  const std::size_t runs = of_run_.size(), rows = stencil.rows(), reach = rows - 1;
  std::fill(first_.begin() + static_cast<std::ptrdiff_t>(runs), first_.end(), 0);
  std::fill(last_.begin() + static_cast<std::ptrdiff_t>(runs), last_.end(), 0);
  begin_.resize(runs);
  end_.resize(runs);
  slide_minima(first_.data(), runs, -1, profile(stencil, false), held_, begin_.data());
  slide_minima(last_.data(), runs, -1, profile(stencil, true), held_, end_.data());
  const auto columns = static_cast<std::int32_t>(stencil.columns());
  std::size_t left_open = 0;
  for (const Chain& chain : chain_) {
    const auto length = static_cast<std::int64_t>(chain.length), ends = static_cast<std::int64_t>(reach);
    if (length < 2 * ends + 1) {
      leave(chain, 0, length, 0);
      left_open += chain.length;
      continue;
    }
    leave(chain, 0, ends, ends);
    leave(chain, length - ends, length, ends);
    left_open += 4 * reach;
    // Stencils at neighbouring rows that share no column: what they cover need not be one run.
    const std::int32_t *first = first_.data() + chain.at, *last = last_.data() + chain.at;
    for (std::size_t t = 0; t + rows < chain.length; t += 64) {
      const std::size_t until = std::min<std::size_t>(t + 64, chain.length - rows);
      std::int32_t negative = 0;
      for (std::size_t i = t; i < until; ++i) negative |= std::min(first[i], first[i + 1]) + std::min(last[i], last[i + 1]);
      for (std::size_t i = t; negative < 0 && i < until; ++i) {
        if (std::min(first[i], first[i + 1]) + std::min(last[i], last[i + 1]) >= 0) continue;
        leave(chain, static_cast<std::int64_t>(i), static_cast<std::int64_t>(i + rows + 1), ends);
        left_open += 3;
      }
    }
    const std::size_t simple = chain.length - 2 * reach;
    const std::int32_t *begin = begin_.data() + chain.at, *end = end_.data() + chain.at;
    const std::int32_t *left = left_.data() + chain.at + reach, *right = right_.data() + chain.at + reach;
    for (std::size_t t = 0; t < simple; t += 64) {
      const std::size_t until = std::min(t + 64, simple);
      std::int32_t differs = 0;
      for (std::size_t i = t; i < until; ++i) differs |= (begin[i] + left[i]) | (columns - end[i] - right[i]);
      for (std::size_t i = t; differs != 0 && i < until; ++i) {
        if ((open_[chain.at + reach + i] & 1) != 0) continue;
        const auto row = static_cast<std::uint32_t>(chain.row + reach + i);
        const std::int32_t covered = columns - end[i];
        if (begin[i] > -left[i])
          found_.push_back({row, static_cast<std::uint32_t>(-left[i]), static_cast<std::uint32_t>(begin[i]), 0});
        if (covered < right[i])
          found_.push_back({row, static_cast<std::uint32_t>(covered), static_cast<std::uint32_t>(right[i]), 0});
      }
    }
  }
  return 2 * left_open < runs;
}

bool SimpleChains::erode(const StencilSteps& stencil) {
  slide(stencil);
  erodes_ = true;
  const auto ends = static_cast<std::int64_t>(stencil.rows() - 1);
  std::size_t left_open = 0;
  for (const Chain& chain : chain_) {
    const std::int64_t length = chain.length;
    leave(chain, std::max<std::int64_t>(0, length - ends), length, 0);
    for (std::int64_t r = 0; r < std::min(ends, length); ++r) open_[chain.at + static_cast<std::size_t>(r)] |= 2;
    left_open += static_cast<std::size_t>(std::min(2 * ends, length));
  }
  return 2 * left_open < of_run_.size();
}

/// By row, then from the left.
void SimpleChains::sort_found(std::uint32_t rows) {
  next_.assign(std::size_t{rows} + 1, 0);
  for (const ChainPart& one : found_) ++next_[one.row + 1];
  for (std::uint32_t r = 0; r < rows; ++r) next_[r + 1] += next_[r];
  sorted_.resize(found_.size());
  for (const ChainPart& one : found_) sorted_[next_[one.row]++] = one;
  // Now next_[r] is where row r ends.
  for (std::uint32_t r = 0; r < rows; ++r) {
    const auto first = sorted_.begin() + (r == 0 ? 0 : next_[r - 1]), last = sorted_.begin() + next_[r];
    if (last - first > 1) std::sort(first, last, [](const ChainPart& a, const ChainPart& b) { return a.begin < b.begin; });
  }
}

void SimpleChains::context(const RunsView& image, Runs& result) {
  std::swap(found_, kept_);
  found_.clear();
  for (const Chain& chain : chain_) {
    for (std::uint32_t r = 0; r < chain.length; ++r) {
      const std::size_t at = chain.at + r;
      std::uint64_t eight = 1;
      if (r + 8 <= chain.length) std::memcpy(&eight, open_.data() + at, 8);
      if (eight == 0) {
        r += 7;
      } else if (open_[at] != 0) {
        found_.push_back(
            {chain.row + r, static_cast<std::uint32_t>(-left_[at]), static_cast<std::uint32_t>(right_[at]), open_[at]});
      }
    }
  }
  sort_found(image.rows());
  result.columns = image.columns;
  result.row_offset.assign(1, 0);
  rows_.clear();
  for (std::uint32_t r = 0, before = 0; r < image.rows(); before = next_[r++]) {
    if (next_[r] == before) continue;
    if (!rows_.empty() && rows_.back() + 1 != r) {
      rows_.push_back(r - 1);
      result.row_offset.push_back(2 * before);
    }
    rows_.push_back(r);
    result.row_offset.push_back(2 * next_[r]);
  }
  result.change.resize(2 * sorted_.size());
  of_context_.resize(sorted_.size());
  for (std::size_t i = 0; i < sorted_.size(); ++i) {
    result.change[2 * i] = sorted_[i].begin;
    result.change[2 * i + 1] = sorted_[i].end;
    of_context_[i] = static_cast<std::uint8_t>(sorted_[i].open);
  }
  std::swap(found_, kept_);
}

void SimpleChains::finish(const RunsView& image, const RunsView& context, const RunsView& of_context, std::uint32_t shift,
                          Runs& result) {
  for (std::uint32_t r = 0; r < of_context.rows(); ++r) {
    const Row found = of_context.row(r), within = context.row(r);
    for (std::size_t i = 0, j = 0; i < found.size(); i += 2) {
      while (within[j + 1] <= found[i] + shift) j += 2;
      if ((of_context_[(context.row_offset[r] + j) / 2] & 1) != 0) found_.push_back({rows_[r], found[i], found[i + 1], 0});
    }
  }
  sort_found(image.rows());
  result.columns = image.columns;
  result.row_offset.assign(1, 0);
  result.change.clear();
  if (!erodes_) {
    for (std::uint32_t r = 0; r < image.rows(); ++r) result.row_offset.push_back(2 * next_[r]);
    result.change.reserve(2 * sorted_.size());
    for (const ChainPart& one : sorted_) {
      result.change.push_back(one.begin);
      result.change.push_back(one.end);
    }
    return;
  }
  result.change.resize(image.change.size() + 2 * sorted_.size());
  std::uint32_t* to = result.change.data();
  std::size_t next = 0;
  for (std::uint32_t r = 0; r < image.rows(); ++r) {
    const auto put_open = [&](std::uint32_t until) {
      for (; next < next_[r] && sorted_[next].begin < until; ++next) {
        *to++ = sorted_[next].begin;
        *to++ = sorted_[next].end;
      }
    };
    for (std::uint32_t run = image.row_offset[r] / 2; run < image.row_offset[r + 1] / 2; ++run) {
      const Chain& chain = chain_[of_run_[run]];
      const std::size_t row = r - chain.row, at = chain.at + row;
      if (row + rows_of_stencil_ > chain.length || first_[at] + last_[at] < 0) continue;
      const auto begin = static_cast<std::uint32_t>(-first_[at]);
      put_open(begin);
      *to++ = begin;
      *to++ = static_cast<std::uint32_t>(last_[at] + 1);
    }
    put_open(UINT32_MAX);
    result.row_offset.push_back(static_cast<std::uint32_t>(to - result.change.data()));
  }
  result.change.resize(static_cast<std::size_t>(to - result.change.data()));
}

std::uint64_t SimpleChains::bytes() const {
  std::uint64_t total = bytes_held(of_run_) + bytes_held(chain_) + bytes_held(open_) + bytes_held(of_context_) +
                        bytes_held(rows_) + bytes_held(touched_) + bytes_held(next_) + bytes_held(found_) + bytes_held(kept_) +
                        bytes_held(sorted_);
  for (const Buffer<std::int32_t>* values : {&left_, &right_, &first_, &last_, &begin_, &end_, &held_})
    total += bytes_held(*values);
  return total;
}

}  // namespace lamina::checks
