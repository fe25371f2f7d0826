// stages/coverage/band/body.h: the kernels of kernels.h, on the lanes of an instruction set. Included once for each, in its
// namespace, behind Eight, Mask and what is done with them; LAMINA_LANES has the target.

/// A triangle that what lies behind it sees along x (slab_facet.h), in each of eight rows; x from the facet's lowest corner.
struct Tent {
  Eight x0, x1, x2, area, mean, rise, fall;
};

/// nm of x that change no volume: area x this is far below roundings.
constexpr double kThinnest = 0x1p-64;

/// Corners in any order.
LAMINA_LANES Tent tent_of(Eight a, Eight b, Eight c, Eight area) {
  const Eight low = minimum(a, b), high = maximum(a, b), inner = minimum(high, c);
  Tent t;
  t.x0 = minimum(low, c);
  t.x2 = maximum(high, c);
  t.x1 = maximum(low, inner);
  t.area = area;
  t.mean = times(plus(plus(t.x0, t.x1), t.x2), all(1.0 / 3));
  // One division for both: area / 3 (x1 - x0) (x2 - x0) and area / 3 (x2 - x1) (x2 - x0).
  const Eight rise = less(t.x1, t.x0), fall = less(t.x2, t.x1), one = all(1);
  const Mask rises = below(all(kThinnest), rise), falls = below(all(kThinnest), fall);
  const Eight of_rise = pick(rises, rise, one), of_fall = pick(falls, fall, one);
  const Eight per_both = over(times(area, all(1.0 / 3)), times(times(of_rise, of_fall), less(t.x2, t.x0)));
  t.rise = keep(rises, times(per_both, of_fall));
  t.fall = keep(falls, times(per_both, of_rise));
  return t;
}

/// Volume between a tent and x, behind it.
LAMINA_LANES Eight behind(const Tent& t, Eight x) {
  const Mask rises = below(x, t.x1);
  const Eight from = maximum(pick(rises, less(x, t.x0), less(t.x2, x)), all(0));
  const Eight part = times(times(pick(rises, t.rise, t.fall), from), times(from, from));
  return plus(drop(rises, times(t.area, less(x, t.mean))), part);
}
LAMINA_LANES Eight along(double at, double per_y, Eight from) { return plus(all(at), times(from, all(per_y))); }

/// The value in lanes [begin, end), another one in the others.
LAMINA_LANES Eight in_lanes(std::uint32_t begin, std::uint32_t end, Eight value, Eight other) {
  return pick(first_lanes(end), pick(first_lanes(begin), other, value), other);
}
LAMINA_LANES void add_to(double* to, Eight value) { store(to, plus(load(to), value)); }

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
  const auto first = static_cast<std::uint32_t>(lowest_of(in_lanes(begin, end, first_column, last_column)));
  const auto last = static_cast<std::uint32_t>(highest_of(in_lanes(begin, end, end_column, all(0))));
  cells.held().mark(first, last);
  if (!piece.edgewise) cells.summed().mark(first, last);
  if (piece.suspect) cells.suspect().mark(first, last);
  const Eight one = in_lanes(begin, end, all(1), all(0));
  add_to(sums.size.data(), times(one, all(piece.size)));
  add_to(sums.columns.data(), times(one, all(last - first + 2)));
  add_to(sums.count.data(), one);
  if (piece.edgewise || bits(has_height) == 0) return;
  const Eight half = keep(has_height, times(less(high, low), all(0.5)));
  const auto height = [&](Eight on, Eight back) LAMINA_TARGET {
    return less(along(piece.back.z, piece.back.dz, back), along(piece.on.z, piece.on.dz, on));
  };
  const Eight upper = times(height(on_high, back_high), half), lower = times(height(on_low, back_low), half);
  const Tent a = tent_of(x_back_high, x_on_high, x_back_low, upper), b = tent_of(x_back_low, x_on_low, x_on_high, lower);
  double* cell = cells.column(first);
  const double *edges = columns.data() + first, *per_width = columns.per_width() + first;
  // Nothing is behind the first edge, and both tents are before the last one.
  Eight before = all(0), mean = all(0);
  for (std::uint32_t column = first; column < last; ++column, cell += kLanes) {
    const Eight x = all(*++edges - piece.from_x), now = plus(behind(a, x), behind(b, x));
    const Eight area = times(less(now, before), all(*per_width++));
    add_to(cell, less(area, mean));
    before = now, mean = area;
  }
  const Eight x = all(*++edges - piece.from_x), now = plus(times(upper, less(x, a.mean)), times(lower, less(x, b.mean)));
  const Eight area = times(less(now, before), all(*per_width));
  add_to(cell, less(area, mean));
  add_to(cell + kLanes, less(plus(upper, lower), area));
}

/// Levels of one column in each row; what is not decided is noted.
struct SweepState {
  Eight cover, area, per_area, off, top;
  std::uint32_t rows;  // a bit each
};

/// A level is decided where its position is further than the bound of errors from a whole number.
LAMINA_LANES std::uint64_t levels_at(const SweepState& state, Eight share, std::uint32_t& undecided, std::uint32_t& outside) {
  const Eight position = plus(times(share, state.top), all(0.5)), near = nearest(position);
  undecided = ~bits(below(state.off, magnitude(less(position, near)))) & state.rows;
  outside = bits(below(all(0.75), magnitude(less(share, all(0.5))))) & state.rows;
  return bytes_of(maximum(minimum(pick(below(position, near), less(near, all(1)), near), state.top), all(0)));
}

/// Puts levels of rows whose share can only be of one level of the horizontal facets. rows  a bit each; returns  those decided
LAMINA_LANES std::uint32_t put_faces(const BandTask& band, Eight share, std::uint32_t rows, std::uint64_t& levels) {
  Eight lowest = all(255), highest = all(-1);
  for (std::size_t i = 0; i < band.faces.share.size(); ++i) {
    const Mask misses = below(load(band.face_off.data()), magnitude(less(all(band.faces.share[i]), share)));
    const Eight level = all(band.faces.level[i]);
    lowest = pick(misses, lowest, minimum(lowest, level));
    highest = pick(misses, highest, maximum(highest, level));
  }
  rows &= ~(bits(below(lowest, highest)) | bits(below(highest, lowest)));
  constexpr std::uint64_t kOnes = 0x0101010101010101;
  const std::uint64_t bytes = (((rows * kOnes & 0x8040201008040201) + 0x7f * kOnes) >> 7 & kOnes) * 255;
  levels = (levels & ~bytes) | (bytes_of(lowest) & bytes);
  return rows;
}

/// Columns of one share, with numbers if they are a single one.
LAMINA_LANES void sweep_columns(const BandTask& band, SweepState& state, const LevelSegment& columns, bool suspect,
                                SweptBand& swept) {
  double* cell = band.cells->column(columns.first);
  state.cover = plus(state.cover, load(cell));
  const Eight share = times(state.cover, state.per_area);
  store(cell, all(0));
  std::uint32_t undecided = 0, outside = 0;
  swept.level[columns.first] = levels_at(state, share, undecided, outside);
  if ((undecided | outside) == 0 && !suspect) [[likely]]
    return;
  if (band.has_ties && outside == 0 && !suspect) {
    const std::uint32_t rows = undecided & ~band.cells->sloped_rows(columns.first);
    const std::uint32_t decided = put_faces(band, share, rows, swept.level[columns.first]);
    swept.face_voxels += static_cast<std::uint32_t>(std::popcount(decided));
    undecided &= ~decided;
    if (undecided == 0) return;
  }
  OpenColumns open{columns.first,
                   columns.end,
                   static_cast<std::uint32_t>(swept.span.size() - 1),
                   static_cast<std::uint8_t>(undecided),
                   static_cast<std::uint8_t>(outside),
                   suspect,
                   {}};
  store(open.share.data(), share);
  swept.open.push_back(open);
}

LAMINA_LANES void add_segment(std::uint32_t first, std::uint32_t end, SweptBand& swept) {
  if (!swept.segment.empty() && swept.segment.back().end == first) {
    swept.segment.back().end = end;
  } else {
    swept.segment.push_back({first, end});
  }
}

LAMINA_LANES void sweep_body(const BandTask& band, SweptBand& swept) {
  const ColumnMarks held = band.cells->held(), summed = band.cells->summed(), suspect = band.cells->suspect();
  const bool has_suspects = suspect.next(0) != ColumnMarks::kNone;
  SweepState state{all(0),        load(band.area.data()), load(band.per_area.data()), load(band.off.data()),
                   all(band.top), (1u << band.rows) - 1};
  ColumnSpan span;
  for (std::uint32_t c = held.next(0); c != ColumnMarks::kNone; c = held.next(span.end)) {
    span.first = c;
    span.end = held.end_of(c);
    swept.span.push_back(span);
    std::uint32_t at = c;
    while (at < span.end) {
      const std::uint32_t next = has_suspects ? at : std::min(summed.next(at), span.end);
      if (next > at) sweep_columns(band, state, {at, next}, false, swept), add_segment(at, at + 1, swept);
      if (next >= span.end) break;
      at = has_suspects ? span.end : std::min(summed.end_of(next), span.end);
      for (std::uint32_t column = next; column < at; ++column)
        sweep_columns(band, state, {column, column + 1}, has_suspects && suspect.has(column), swept);
      add_segment(next, at, swept);
    }
    double* cell = band.cells->column(span.end);
    const Eight cover = plus(state.cover, load(cell));
    store(cell, all(0));
    const Eight winding = whole_below(plus(times(cover, state.per_area), all(0.5)));
    state.cover = times(winding, state.area);
    alignas(64) double whole[kLanes];
    store(whole, winding);
    std::uint64_t levels = 0;
    for (std::uint32_t lane = 0; lane < band.rows; ++lane) {
      span.winding[lane] = static_cast<std::int32_t>(whole[lane]);
      swept.winds |= span.winding[lane] < 0 || span.winding[lane] > 1;
      const bool solid = is_solid(band.fill, span.winding[lane]);
      levels |= (solid ? static_cast<std::uint64_t>(band.top) : 0) << 8 * lane;
    }
    swept.level[span.end] = levels;
    add_segment(span.end, span.end + 1, swept);
  }
  span.first = span.end = UINT32_MAX;
  swept.span.push_back(span);  // behind all
}

/// Columns become rows: byte i of word k is byte k of word i.
LAMINA_LANES void turn(const std::uint64_t* from, std::uint64_t* to) {
  using Bytes16 = std::uint8_t __attribute__((vector_size(16)));
  Bytes16 in[4], a[4], b[4];
  std::memcpy(in, from, 64);
  for (int i = 0; i < 4; ++i)
    a[i] = __builtin_shufflevector(in[i], in[i], 0, 8, 1, 9, 2, 10, 3, 11, 4, 12, 5, 13, 6, 14, 7, 15);
  for (int i = 0; i < 2; ++i) {
    const Bytes16 &x = a[2 * i], &y = a[2 * i + 1];
    b[2 * i] = __builtin_shufflevector(x, y, 0, 1, 16, 17, 2, 3, 18, 19, 4, 5, 20, 21, 6, 7, 22, 23);
    b[2 * i + 1] = __builtin_shufflevector(x, y, 8, 9, 24, 25, 10, 11, 26, 27, 12, 13, 28, 29, 14, 15, 30, 31);
  }
  for (int i = 0; i < 2; ++i) {
    const Bytes16 &x = b[i], &y = b[i + 2];
    a[2 * i] = __builtin_shufflevector(x, y, 0, 1, 2, 3, 16, 17, 18, 19, 4, 5, 6, 7, 20, 21, 22, 23);
    a[2 * i + 1] = __builtin_shufflevector(x, y, 8, 9, 10, 11, 24, 25, 26, 27, 12, 13, 14, 15, 28, 29, 30, 31);
  }
  std::memcpy(to, a, 64);
}

LAMINA_LANES void split_body(const SweptBand& swept, Changes* rows) {
  std::uint32_t level[kLanes] = {};
  std::uint64_t last = 0;  // levels of the column before
  for (const LevelSegment& segment : swept.segment) {
    for (std::uint32_t c = segment.first; c < segment.end; c += kLanes) {
      const std::uint32_t columns = std::min(segment.end - c, kLanes);
      const std::uint64_t* levels = swept.level.data() + c;
      std::uint64_t changed = 0;
      for (std::uint32_t i = 0; i < columns; ++i) changed |= levels[i] ^ last;
      if (changed == 0) continue;
      last = levels[columns - 1];
      std::uint64_t row[kLanes];
      turn(levels, row);
      for (std::uint32_t lane = 0; lane < kLanes; ++lane) {
        if ((changed >> 8 * lane & 255) != 0) note_changes(row[lane], columns, c, level[lane], rows[lane]);
      }
    }
  }
}
