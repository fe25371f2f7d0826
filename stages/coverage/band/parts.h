// stages/coverage/band/parts.h: eight lanes in parts of kPartBytes, which compilers turn into what the target has. Included
// once for each of those instruction sets, in its namespace, behind Part, an array of doubles, and its min_of(), max_of()
// and signs_of(); LAMINA_LANES has the target.

constexpr int kWidth = sizeof(Part) / sizeof(double), kParts = 8 / kWidth;
using Whole = std::int64_t __attribute__((vector_size(sizeof(Part))));

struct Eight {
  Part part[kParts];
};
struct Mask {
  Whole part[kParts];
};

/// A part at any address. Not a type with the attribute aligned(8): clang 14 may copy such a part by an aligned load.
struct __attribute__((packed, may_alias)) LoosePart {
  Part value;
};
struct __attribute__((packed, may_alias)) LooseWhole {
  Whole value;
};

LAMINA_LANES Eight load(const double* at) {
  Eight a;
  for (int i = 0; i < kParts; ++i) a.part[i] = reinterpret_cast<const LoosePart*>(at + i * kWidth)->value;
  return a;
}
LAMINA_LANES void store(double* at, const Eight& a) {
  for (int i = 0; i < kParts; ++i) reinterpret_cast<LoosePart*>(at + i * kWidth)->value = a.part[i];
}

#define LAMINA_EACH(expression)                                 \
  Eight result;                                                 \
  for (int i = 0; i < kParts; ++i) result.part[i] = expression; \
  return result

LAMINA_LANES Eight all(double value) { LAMINA_EACH(Part{} + value); }
LAMINA_LANES Eight plus(const Eight& a, const Eight& b) { LAMINA_EACH(a.part[i] + b.part[i]); }
LAMINA_LANES Eight less(const Eight& a, const Eight& b) { LAMINA_EACH(a.part[i] - b.part[i]); }
LAMINA_LANES Eight times(const Eight& a, const Eight& b) { LAMINA_EACH(a.part[i] * b.part[i]); }
LAMINA_LANES Eight over(const Eight& a, const Eight& b) { LAMINA_EACH(a.part[i] / b.part[i]); }
LAMINA_LANES Eight minimum(const Eight& a, const Eight& b) { LAMINA_EACH(min_of(a.part[i], b.part[i])); }
LAMINA_LANES Eight maximum(const Eight& a, const Eight& b) { LAMINA_EACH(max_of(a.part[i], b.part[i])); }
/// Of less than 2^51, as the next.
LAMINA_LANES Eight nearest(const Eight& a) { LAMINA_EACH((a.part[i] + 0x1.8p52) - 0x1.8p52); }
LAMINA_LANES Eight whole_below(const Eight& a) {
  const Eight near = nearest(a);
  LAMINA_EACH(near.part[i] > a.part[i] ? near.part[i] - 1 : near.part[i]);
}
LAMINA_LANES Eight magnitude(const Eight& a) { LAMINA_EACH(max_of(a.part[i], -a.part[i])); }
LAMINA_LANES double lowest_of(const Eight& a) {
  double lowest = a.part[0][0];
  for (int i = 1; i < 8; ++i) lowest = std::min(lowest, a.part[i / kWidth][i % kWidth]);
  return lowest;
}
LAMINA_LANES double highest_of(const Eight& a) {
  double highest = a.part[0][0];
  for (int i = 1; i < 8; ++i) highest = std::max(highest, a.part[i / kWidth][i % kWidth]);
  return highest;
}
LAMINA_LANES Mask below(const Eight& a, const Eight& b) {
  Mask mask;
  for (int i = 0; i < kParts; ++i) mask.part[i] = a.part[i] < b.part[i];
  return mask;
}
LAMINA_LANES std::uint32_t bits(const Mask& mask) {
  std::uint32_t found = 0;
  for (int i = 0; i < kParts; ++i) found |= signs_of((Part)mask.part[i]) << i * kWidth;
  return found;
}
LAMINA_LANES Eight pick(const Mask& mask, const Eight& a, const Eight& b) { LAMINA_EACH(mask.part[i] ? a.part[i] : b.part[i]); }
LAMINA_LANES Eight keep(const Mask& mask, const Eight& a) { LAMINA_EACH(mask.part[i] ? a.part[i] : Part{}); }
LAMINA_LANES Eight drop(const Mask& mask, const Eight& a) { LAMINA_EACH(mask.part[i] ? Part{} : a.part[i]); }
LAMINA_LANES Mask first_lanes(std::uint32_t count) {
  static constexpr std::int64_t kOnes[16] = {-1, -1, -1, -1, -1, -1, -1, -1};
  Mask mask;
  for (int i = 0; i < kParts; ++i) mask.part[i] = reinterpret_cast<const LooseWhole*>(kOnes + 8 - count + i * kWidth)->value;
  return mask;
}
LAMINA_LANES void store_whole(std::uint32_t* at, const Eight& a) {
  for (int i = 0; i < 8; ++i) at[i] = static_cast<std::uint32_t>(static_cast<std::int32_t>(a.part[i / kWidth][i % kWidth]));
}

/// Of whole numbers below 256: sums of less than 2^32 are exact.
LAMINA_LANES std::uint64_t bytes_of(const Eight& a) {
  double weighted[8];
  const double weight[8] = {1, 0x1p8, 0x1p16, 0x1p24, 1, 0x1p8, 0x1p16, 0x1p24};
  store(weighted, times(a, load(weight)));
  const auto four = [&](int i) LAMINA_TARGET {
    return static_cast<std::int64_t>((weighted[i] + weighted[i + 1]) + (weighted[i + 2] + weighted[i + 3]));
  };
  return static_cast<std::uint64_t>(four(0)) | static_cast<std::uint64_t>(four(4)) << 32;
}
LAMINA_LANES void note_changes(std::uint64_t levels, std::uint32_t columns, std::uint32_t first, std::uint32_t& level,
                               Changes& changes) {
  std::uint64_t changed = levels ^ (levels << 8 | level);
  if (columns < 8) changed &= (std::uint64_t{1} << 8 * columns) - 1;
  while (changed != 0) {
    const auto lane = static_cast<std::uint32_t>(std::countr_zero(changed)) / 8;
    level = levels >> 8 * lane & 255;
    changes.column[changes.count] = first + lane;
    changes.level[changes.count++] = static_cast<std::uint8_t>(level);
    changed &= ~(std::uint64_t{255} << 8 * lane);
  }
}

#undef LAMINA_EACH
