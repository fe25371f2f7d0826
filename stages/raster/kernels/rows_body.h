// stages/raster/kernels/rows_body.h: sorting of rows on the registers of an instruction set. Included once for each, in its
// namespace, behind kLanes, Register and what is done with them; LAMINA_TARGET is the target, LAMINA_INLINE has it.

/// Sorts up to 4 * kLanes crossings, more than two, and writes the row if it is its own changes; else puts it back, sorted.
LAMINA_INLINE bool sort_short(std::uint32_t* row, std::uint32_t count, bool positive, std::uint32_t* change);

/// Two sorted registers: the lesser half into a, the greater into b, both sorted.
LAMINA_INLINE void merge_two(Register& a, Register& b) {
  const Register other = reversed(b);
  b = merge_bitonic(greater_of(a, other));
  a = merge_bitonic(lesser_of(a, other));
}

/// Two sorted lists of two registers each, merged.
LAMINA_INLINE void merge_four(Register (&v)[4]) {
  const Register third = reversed(v[3]), fourth = reversed(v[2]);
  const Register low = lesser_of(v[0], third), low_2 = lesser_of(v[1], fourth);
  const Register high = greater_of(v[0], third), high_2 = greater_of(v[1], fourth);
  v[0] = merge_bitonic(lesser_of(low, low_2));
  v[1] = merge_bitonic(greater_of(low, low_2));
  v[2] = merge_bitonic(lesser_of(high, high_2));
  v[3] = merge_bitonic(greater_of(high, high_2));
}

/// Sorts four registers as one list. Fours are sorted across registers first, where no lane has to move, and turned from
/// columns into rows: half the work of sorting them within each.
LAMINA_INLINE void sort_four_registers(Register (&v)[4]) {
  const auto in_order = [](Register& a, Register& b) LAMINA_TARGET {
    const Register low = lesser_of(a, b);
    b = greater_of(a, b);
    a = low;
  };
  in_order(v[0], v[1]), in_order(v[2], v[3]), in_order(v[0], v[2]), in_order(v[1], v[3]), in_order(v[1], v[2]);
  turn_fours(v);
  for (Register& one : v) one = merge_rising_fours(one);
  merge_two(v[0], v[1]);
  merge_two(v[2], v[3]);
  merge_four(v);
}

/// Merges two sorted lists of whole registers: the lesser half of two registers is next, whatever comes.
LAMINA_TARGET void merge_registers(const std::uint32_t* a, const std::uint32_t* a_end, const std::uint32_t* b,
                                   const std::uint32_t* b_end, std::uint32_t* out) {
  Register low = load_row(a), high = load_row(b);
  a += kLanes, b += kLanes;
  while (true) {
    merge_two(low, high);
    store_row(out, low);
    out += kLanes;
    if (a == a_end && b == b_end) break;
    const bool from_a = b == b_end || (a != a_end && *a < *b);
    low = load_row(from_a ? a : b);
    (from_a ? a : b) += kLanes;
  }
  store_row(out, high);
}

/// Sorts more than four registers of crossings. returns  where they are then: in the row or in `other`
LAMINA_TARGET std::uint32_t* sort_many(std::uint32_t* row, std::uint32_t count, std::uint32_t* other) {
  constexpr std::uint32_t kBlock = 4 * kLanes;
  const std::uint32_t padded = (count + kBlock - 1) / kBlock * kBlock;
  std::fill(row + count, row + padded, UINT32_MAX);
  for (std::uint32_t i = 0; i < padded; i += kBlock) {
    Register v[4];
    for (std::uint32_t k = 0; k < 4; ++k) v[k] = load_row(row + i + k * kLanes);
    sort_four_registers(v);
    for (std::uint32_t k = 0; k < 4; ++k) store_row(row + i + k * kLanes, v[k]);
  }
  for (std::uint32_t length = kBlock; length < padded; length *= 2) {
    for (std::uint32_t i = 0; i < padded; i += 2 * length) {
      const std::uint32_t middle = std::min(i + length, padded), end = std::min(i + 2 * length, padded);
      if (middle == end) {
        std::copy(row + i, row + end, other + i);
      } else {
        merge_registers(row + i, row + middle, row + middle, row + end, other + i);
      }
    }
    std::swap(row, other);
  }
  return row;
}

/// Writes a sorted row that is its own changes; false if it is not.
LAMINA_TARGET bool write_alternating(const std::uint32_t* row, std::uint32_t count, bool positive, std::uint32_t* change) {
  std::uint32_t bad = (count & 1) | (positive ? ~*row & 1 : 0);
  for (std::uint32_t i = 0; i + 1 < count; i += kLanes) {
    bad |= _bzhi_u32(bad_pairs(load_row(row + i), load_row(row + i + 1)), std::min(count - 1 - i, kLanes));
  }
  if (bad != 0) return false;
  for (std::uint32_t i = 0; i < count; i += kLanes) store_row(change + i, halved(load_row(row + i)));
  return true;
}

LAMINA_TARGET std::uint32_t* rows_body(const RowsTask& task) {
  std::uint32_t* change = task.change;
  std::uint32_t* row_end = task.row_end;
  const bool positive = task.rule == FillRule::kPositive;
  for (std::uint32_t row = task.rows; row-- > 0;) {
    const std::uint32_t first = row == 0 ? 0 : task.end[row - 1], count = task.end[row] - first;
    if (count != 0) {
      std::uint32_t* sorted = task.crossing + first;
      bool done;
      if (count == 2) {
        done = put_pair(sorted, positive, change);
        if (!done && sorted[1] < sorted[0]) std::swap(sorted[0], sorted[1]);
      } else if (count <= 4 * kLanes) {
        done = sort_short(sorted, count, positive, change);
      } else {
        sorted = sort_many(sorted, count, change);
        done = write_alternating(sorted, count, positive, change);
      }
      change = done ? change + count : write_changes(task.rule, sorted, sorted + count, change);
    }
    *row_end++ = static_cast<std::uint32_t>(change - task.changes);
  }
  return change;
}
