// stages/coverage/band/body.h: the kernels of kernels.h, on the lanes of an instruction set. Included once for each, in its
// namespace, behind Eight, Mask and what is done with them; LAMINA_LANES has the target.

/// A triangle that what lies behind it sees along x (slab_facet.h), in each of eight rows; x from the facet's lowest corner.
struct Tent {
  Eight x0, x1, x2, area, mean, rise, fall;
};

/// Corners in any order.
LAMINA_LANES Tent tent_of(Eight a, Eight b, Eight c, Eight area) {
  const Eight low = minimum(a, b), high = maximum(a, b), inner = minimum(high, c);
  Tent t;
  t.x0 = minimum(low, c);
  t.x2 = maximum(high, c);
  t.x1 = maximum(low, inner);
  t.area = area;
  t.mean = times(plus(plus(t.x0, t.x1), t.x2), all(1.0 / 3));
  const Eight span = less(t.x2, t.x0), third = times(area, all(1.0 / 3));
  const Eight of_rise = times(less(t.x1, t.x0), span), of_fall = times(less(t.x2, t.x1), span);
  t.rise = keep(below(all(0), of_rise), over(third, of_rise));
  t.fall = keep(below(all(0), of_fall), over(third, of_fall));
  return t;
}

/// Two tents of each row, number by number.
struct alignas(64) TentRows {
  double of[14][kLanes];

  LAMINA_LANES void put(std::uint32_t first, const Tent& t) {
    store(of[first], t.x0), store(of[first + 1], t.x1), store(of[first + 2], t.x2), store(of[first + 3], t.area);
    store(of[first + 4], t.mean), store(of[first + 5], t.rise), store(of[first + 6], t.fall);
  }
};

/// The same numbers of one row, in all lanes.
struct TentPair {
  Tent a, b;
};
LAMINA_LANES TentPair pair_of(const TentRows& rows, std::uint32_t lane) {
  const auto at = [&](std::uint32_t i) LAMINA_TARGET { return all(rows.of[i][lane]); };
  return {{at(0), at(1), at(2), at(3), at(4), at(5), at(6)}, {at(7), at(8), at(9), at(10), at(11), at(12), at(13)}};
}

/// Volume between a tent and x, behind it.
LAMINA_LANES Eight behind(const Tent& t, Eight x) {
  const Mask rises = below(x, t.x1);
  const Eight from = maximum(pick(rises, less(x, t.x0), less(t.x2, x)), all(0));
  const Eight part = times(times(pick(rises, t.rise, t.fall), from), times(from, from));
  return plus(drop(rises, times(t.area, less(x, t.mean))), part);
}
LAMINA_LANES Eight behind(const TentPair& t, Eight x) { return plus(behind(t.a, x), behind(t.b, x)); }

LAMINA_LANES void add_columns(const TentPair& tents, double from_x, const double* edges, double* partial,
                              std::uint32_t columns) {
  const Eight from = all(from_x);
  Eight now = behind(tents, less(load(edges), from));
  for (;;) {
    if (columns < kLanes) {
      store_first(partial, columns, plus(load(partial), less(shifted(now, now), now)));
      return;
    }
    edges += kLanes;
    const Eight next = behind(tents, less(load(edges), from));
    store(partial, plus(load(partial), less(shifted(now, next), now)));
    columns -= kLanes;
    if (columns == 0) return;
    partial += kLanes;
    now = next;
  }
}

LAMINA_LANES void add_lanes(double* to, std::uint32_t begin, std::uint32_t end, Eight value) {
  store(to, plus(load(to), less(keep_first(end, value), keep_first(begin, value))));
}

LAMINA_LANES Eight along(double at, double per_y, Eight from) { return plus(all(at), times(from, all(per_y))); }

LAMINA_LANES void add_body(const Trapezoid& piece, const BandRows& rows, const Edges& columns, BandCells& cells,
                           ColumnReach& reach, BandSums& sums) {
  const Eight low = maximum(less(load(rows.y.data()), all(piece.from_y)), all(piece.low));
  const Eight high = minimum(less(load(rows.y.data() + 1), all(piece.from_y)), all(piece.high));
  const Mask has_height = below(low, high);
  const Eight on_low = less(low, all(piece.on.y)), on_high = less(high, all(piece.on.y));
  const Eight back_low = less(low, all(piece.back.y)), back_high = less(high, all(piece.back.y));
  const Eight x_on_low = along(piece.on.x, piece.on.dx, on_low), x_on_high = along(piece.on.x, piece.on.dx, on_high);
  const Eight x_back_low = along(piece.back.x, piece.back.dx, back_low);
  const Eight x_back_high = along(piece.back.x, piece.back.dx, back_high);

  const Eight slack = all(piece.slope_margin), left_end = all(piece.left), right_end = all(piece.right);
  const Eight leftmost = less(minimum(minimum(x_on_low, x_on_high), minimum(x_back_low, x_back_high)), slack);
  const Eight rightmost = plus(maximum(maximum(x_on_low, x_on_high), maximum(x_back_low, x_back_high)), slack);
  const Eight left = pick(has_height, maximum(leftmost, left_end), left_end);
  const Eight right = pick(has_height, minimum(rightmost, right_end), right_end);
  const Eight per_nm = all(columns.per_nm()), last_column = all(static_cast<double>(columns.count() - 1));
  const auto bounded = [&](Eight x, double by) LAMINA_TARGET {
    return minimum(maximum(times(plus(x, all(piece.from_x + by)), per_nm), all(0)), last_column);
  };
  const Eight first_column = bounded(left, -kSlack), end_column = bounded(right, kSlack + Edges::kBehind);
  store_whole(reach.first.data(), first_column);
  store_whole(reach.last.data(), end_column);

  const std::uint32_t begin = piece.first_row > rows.first ? piece.first_row - rows.first : 0;
  const std::uint32_t end = std::min(piece.last_row - rows.first + 1, rows.count);
  add_lanes(sums.size.data(), begin, end, all(piece.size));
  add_lanes(sums.columns.data(), begin, end, plus(less(end_column, first_column), all(2)));
  add_lanes(sums.count.data(), begin, end, all(1));
  TentRows tents;
  alignas(64) double area[kLanes];
  std::uint32_t with_area = 0;
  if (!piece.edgewise) {
    with_area = bits(has_height);
    const Eight half = times(less(high, low), all(0.5));
    const auto height = [&](Eight on, Eight back) LAMINA_TARGET {
      return less(along(piece.back.z, piece.back.dz, back), along(piece.on.z, piece.on.dz, on));
    };
    const Eight upper = times(height(on_high, back_high), half), lower = times(height(on_low, back_low), half);
    tents.put(0, tent_of(x_back_high, x_on_high, x_back_low, upper));
    tents.put(7, tent_of(x_back_low, x_on_low, x_on_high, lower));
    store(area, plus(upper, lower));
  }
  for (std::uint32_t lane = begin; lane < end; ++lane) {
    const std::uint32_t first = reach.first[lane], last = reach.last[lane];
    cells.held(lane).mark(first, last);
    if (piece.suspect) cells.suspect(lane).mark(first, last);
    if ((with_area >> lane & 1) == 0) continue;
    add_columns(pair_of(tents, lane), piece.from_x, columns.data() + first, cells.partial(lane) + first, last - first + 1);
    cells.passed(lane)[last + 1] += area[lane];
  }
}

/// Whether no trapezoid with area along x begins or ends in 64 columns.
LAMINA_LANES bool is_even(const double* partial, const double* passed) {
  for (std::uint32_t k = 0; k < 64; k += kLanes) {
    if (!is_zero(load(partial + k), load(passed + k))) return false;
  }
  return true;
}

/// Levels of a span, from `winding` before it; returns that behind it.
LAMINA_LANES std::int64_t sweep_span(const RowTask& row, const ColumnSpan& span, std::uint32_t& level, Changes& changes) {
  const Eight top = all(row.top), spoilt = all(row.spoilt * row.top), rounding = all(0x1p-49);
  double cover = static_cast<double>(span.winding) * row.area;
  for (std::uint32_t c = span.first; c < span.end; c += kLanes) {
    const std::uint32_t columns = std::min(span.end - c, kLanes), ends = std::min(columns + 1, kLanes);
    const Eight width = less(load(row.edges + c + 1), load(row.edges + c));
    const Eight old_partial = load(row.partial + c), old_passed = load(row.passed + c);
    const Eight partial = keep_first(columns, old_partial), passed = keep_first(ends, old_passed);
    store_first(row.partial + c, columns, all(0));
    store_first(row.passed + c, ends, all(0));
    const Eight behind = plus(sums_of(passed), all(cover));
    cover = last_of(behind);
    const Eight volume = plus(times(behind, width), partial);
    const Eight per_voxel = pick(below(width, all(row.widest)), all(row.per_narrowest), all(row.per_widest));
    const Eight position = plus(times(volume, per_voxel), all(0.5));
    const Eight off = plus(spoilt, times(rounding, plus(absolute(position), top)));
    const Eight lowest = maximum(minimum(whole_below(less(position, off)), top), all(0));
    const Eight highest = maximum(minimum(whole_below(plus(position, off)), top), all(0));
    const std::uint32_t valid = (1u << columns) - 1;
    std::uint64_t levels = bytes_of(lowest);
    const std::uint32_t undecided = bits(below(lowest, highest)) & valid;
    const std::uint32_t suspects = row.has_suspects ? row.suspect.eight(c) & valid : 0;
    if ((undecided | suspects) != 0) [[unlikely]] {
      OpenLanes open_lanes{span, c, undecided, suspects, {}};
      store(open_lanes.volume.data(), volume);
      levels = row.resolver->decide(open_lanes, levels);
    }
    note_changes(levels, columns, c, level, changes);
    // A flat top, or a floor, within the layer.
    if (span.end - c >= 128 && !row.has_suspects && is_zero(old_partial, old_passed)) [[unlikely]] {
      const std::uint32_t until = undecided != 0 ? row.resolver->even_until() : span.end;
      while (c + kLanes + 64 < until && is_even(row.partial + c + kLanes, row.passed + c + kLanes)) c += 64;
    }
  }
  if ((span.end - span.first) % kLanes == 0) {
    cover += row.passed[span.end];
    row.passed[span.end] = 0;
  }
  return static_cast<std::int64_t>(std::floor(cover / row.area + 0.5));
}

LAMINA_LANES void sweep_body(const RowTask& row_of, Changes& result) {
  const RowTask row = row_of;  // a copy: no member is read again after a write
  Changes changes = result;
  ColumnSpan span;
  std::uint32_t level = 0, at = 0;
  const auto pass_free = [&](std::uint32_t end) LAMINA_TARGET {
    const std::uint32_t free =
        is_solid(row.fill, static_cast<std::int32_t>(span.winding)) ? static_cast<std::uint32_t>(row.top) : 0;
    if (at < end && free != level) {
      changes.column[changes.count] = at;
      changes.level[changes.count++] = static_cast<std::uint8_t>(free);
      level = free;
    }
    if (at < end && (span.winding < 0 || span.winding > 1)) row.resolver->free(span.winding, at, end);
  };
  for (std::uint32_t c = row.held.next(0); c != ColumnMarks::kNone; c = row.held.next(at)) {
    pass_free(c);
    span.first = c;
    span.end = row.held.end_of(c);
    changes.held += span.end - span.first;
    span.winding = sweep_span(row, span, level, changes);
    at = span.end;
  }
  pass_free(row.columns);
  result = changes;
}
