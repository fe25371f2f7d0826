// stages/load/stl_binary.cpp: binary STL, read in blocks and snapped straight into the mesh.
#include <fmt/core.h>
#include <sys/mman.h>
#include <tbb/blocked_range.h>
#include <tbb/enumerable_thread_specific.h>
#include <tbb/parallel_reduce.h>

#include <algorithm>
#include <atomic>
#include <cstring>

#include "stages/load/reader.h"

namespace lamina::load {
namespace {

constexpr std::uint64_t kHeader = 84, kFacet = 50;
constexpr std::size_t kBlock = 5120;  // facets, 250 KiB: a block and its triangles stay in a core's cache
constexpr std::size_t kStrip = 256;   // facets whose 2304 coordinates are snapped in one go

std::uint32_t little_endian(const char* bytes) {
  const auto* b = reinterpret_cast<const unsigned char*>(bytes);
  return b[0] | static_cast<std::uint32_t>(b[1]) << 8 | static_cast<std::uint32_t>(b[2]) << 16 |
         static_cast<std::uint32_t>(b[3]) << 24;
}

/// Lowest and highest coordinate of each axis as the file has them; snapping keeps the order.
struct FloatBox {
  std::array<float, 12> lo, hi;  // four corners side by side, for the processor's vectors
  FloatBox() {
    lo.fill(3e38f);
    hi.fill(-3e38f);
  }
};

/// Snaps `count` (a multiple of 12) finite coordinates in mm within reach, and grows the box by them.
///
/// A float times 1e6 = 2^6 * 15625 has at most 24 + 14 significant bits, so it is exact in double; adding a half to
/// 38 bits is exact too unless the product is below 2^-15, where any rounding ends at 0 anyway. Truncation then gives
/// llround(x * 1e6): to the nearest, halves away from zero.
void snap_strip(const float* __restrict in, Nm* __restrict out, std::size_t count, FloatBox& box) {
  for (std::size_t i = 0; i < count; ++i) {
    const double nm = static_cast<double>(in[i]) * 1e6;
    out[i] = static_cast<Nm>(nm + __builtin_copysign(0.5, nm));
  }
  std::array<float, 12> lo = box.lo, hi = box.hi;
  for (std::size_t i = 0; i < count; i += 12) {
    for (std::size_t k = 0; k < 12; ++k) {
      lo[k] = in[i + k] < lo[k] ? in[i + k] : lo[k];
      hi[k] = in[i + k] > hi[k] ? in[i + k] : hi[k];
    }
  }
  box.lo = lo;
  box.hi = hi;
}

/// Whether all coordinates are finite and within reach: NaN, infinity and large numbers are large as bits, too.
bool within_reach(const float* in, std::size_t count) {
  constexpr float kLimit = 2147.4836f;  // the largest float below 2147.483647
  std::int32_t limit = 0;
  std::memcpy(&limit, &kLimit, 4);
  std::int32_t worst = 0;
  for (std::size_t i = 0; i < count; ++i) {
    std::int32_t bits = 0;
    std::memcpy(&bits, in + i, 4);
    bits &= 0x7fffffff;
    worst = bits > worst ? bits : worst;
  }
  return worst <= limit;
}

/// Facets of plain millimetres. False if one of them cannot be snapped.
bool snap_plain(const char* facets, std::size_t count, Triangle* out, FloatBox& box) {
  std::array<float, kStrip * 9 + 12> corner;
  for (std::size_t first = 0; first < count; first += kStrip) {
    const std::size_t strip = std::min(kStrip, count - first);
    for (std::size_t i = 0; i < strip; ++i) std::memcpy(corner.data() + 9 * i, facets + (first + i) * kFacet + 12, 36);
    std::size_t numbers = 9 * strip;
    if (!within_reach(corner.data(), numbers)) return false;
    if (strip == kStrip) {
      snap_strip(corner.data(), &out[first].a.x, numbers, box);
    } else {
      // The last strip is filled up with corners that it has already, which change no bound.
      for (; numbers % 12 != 0; ++numbers) corner[numbers] = corner[numbers - 3];
      std::array<Nm, kStrip * 9 + 12> snapped;
      snap_strip(corner.data(), snapped.data(), numbers, box);
      std::memcpy(&out[first].a.x, snapped.data(), 36 * strip);
    }
  }
  return true;
}

Snapped snap_facet(const char* facet, const Snapper& snapper, Triangle& out) {
  std::array<float, 9> corner;
  std::memcpy(corner.data(), facet + 12, 36);
  Triangle triangle{};
  const std::array<Point3*, 3> points =
      snapper.mirrors() ? std::array{&triangle.a, &triangle.c, &triangle.b} : std::array{&triangle.a, &triangle.b, &triangle.c};
  for (std::size_t i = 0; i < 3; ++i) {
    const Snapped snapped = snapper.snap(static_cast<double>(corner[3 * i]), static_cast<double>(corner[3 * i + 1]),
                                         static_cast<double>(corner[3 * i + 2]), *points[i]);
    if (snapped != Snapped::kYes) return snapped;
  }
  out = triangle;
  return Snapped::kYes;
}

bool snap_transformed(const char* facets, std::size_t count, const Snapper& snapper, Triangle* out, Box& box) {
  for (std::size_t i = 0; i < count; ++i) {
    if (snap_facet(facets + i * kFacet, snapper, out[i]) != Snapped::kYes) return false;
    box.add(out[i].a);
    box.add(out[i].b);
    box.add(out[i].c);
  }
  return true;
}

/// The bounds of a file in plain millimetres, in nm.
Box snapped_box(const FloatBox& from, const Snapper& snapper) {
  Box box;
  for (std::size_t k = 0; k < 12; k += 3) {
    Point3 lo{}, hi{};
    if (from.lo[k] > from.hi[k]) continue;
    snapper.snap(static_cast<double>(from.lo[k]), static_cast<double>(from.lo[k + 1]), static_cast<double>(from.lo[k + 2]), lo);
    snapper.snap(static_cast<double>(from.hi[k]), static_cast<double>(from.hi[k + 1]), static_cast<double>(from.hi[k + 2]), hi);
    box.add(lo);
    box.add(hi);
  }
  return box;
}

/// Facet after facet, for files in which something is wrong: says where, or leaves it out.
Status read_carefully(const Source& source, const Snapper& snapper, const LoadOptions& options, std::uint64_t count,
                      Facets& facets) {
  facets.bounds = {};
  std::uint64_t dropped = 0, first_dropped = 0, kept = 0;
  Buffer<char> block(kBlock * kFacet);
  for (std::uint64_t first = 0; first < count; first += kBlock) {
    const auto in_block = static_cast<std::size_t>(std::min<std::uint64_t>(kBlock, count - first));
    if (!source.read(kHeader + first * kFacet, block.data(), in_block * kFacet)) return source.changed_while_read();
    for (std::size_t i = 0; i < in_block; ++i) {
      Triangle triangle{};
      const Snapped snapped = snap_facet(block.data() + i * kFacet, snapper, triangle);
      if (snapped == Snapped::kNotFinite && options.drop_bad) {
        if (dropped++ == 0) first_dropped = first + i;
        continue;
      }
      if (snapped != Snapped::kYes)
        return source.error(
            fmt::format("facet {} (byte {}): {}", first + i + 1, kHeader + (first + i) * kFacet, what_is_wrong(snapped)));
      for (const Point3& corner : {triangle.a, triangle.b, triangle.c}) facets.bounds.add(corner);
      facets.triangles[kept++] = triangle;
    }
  }
  facets.triangles.resize(kept);
  if (dropped > 0)
    facets.notes.push_back({true, fmt::format("{} facet{} with coordinates that are not finite dropped, the first is facet {}",
                                              dropped, dropped == 1 ? "" : "s", first_dropped + 1)});
  return {};
}

std::string cut_short(const Source& source, std::uint64_t claimed, std::uint64_t held) {
  return fmt::format(
      "is cut short: the header says {} facets, the file ends at byte {} within facet {}; copy or export it again", claimed,
      source.size(), held + 1);
}

std::string stray_bytes(std::uint64_t bytes, std::uint64_t facets) {
  return fmt::format("{} stray bytes after the last of {} facets are ignored", bytes, facets);
}

/// How many facets to read, with what there is to say about it.
Result<std::uint64_t> count_facets(const Source& source, const LoadOptions& options, Facets& facets) {
  std::array<char, 4> bytes;
  if (source.size() < kHeader || !source.read(80, bytes.data(), 4))
    return source.error(fmt::format("is {} bytes long, too short for an STL file", source.size()));
  const std::uint64_t claimed = little_endian(bytes.data());
  const std::uint64_t body = source.size() - kHeader, held = body / kFacet, stray = body % kFacet;
  const std::uint64_t count = held;
  if (claimed > held && (held == 0 || stray > 0)) return source.error(cut_short(source, claimed, held));
  if (held == 0 || (claimed == 0 && stray > 0)) return source.error("holds no facets");
  if (claimed == 0) {
    facets.notes.push_back({false, fmt::format("the header says 0 facets, the file holds {}: all are read", held)});
  } else if (claimed == held && stray > 0) {
    facets.notes.push_back({false, stray_bytes(stray, claimed)});
  } else if (claimed < held) {
    const std::string differ = fmt::format("the header says {} facets, the file holds {}", claimed, held);
    facets.doubt = Doubt{differ + ", which close: all are read", "", claimed, stray_bytes(body - claimed * kFacet, claimed)};
  } else if (claimed > held) {
    facets.doubt = Doubt{fmt::format("the header says {} facets, the file holds {}, which close: all are read", claimed, held),
                         cut_short(source, claimed, held), 0, ""};
  }
  if (count > options.triangle_limit)
    return source.error(fmt::format("{} facets are more than the limit of {}", count, options.triangle_limit));
  return count;
}

/// Asks for large pages: the triangles are written once from end to end, and faulting 4 KiB at a time takes as long as
/// snapping. Where the system has none to give, nothing changes.
void prefer_large_pages(Buffer<Triangle>& triangles) {
  constexpr std::uintptr_t kPage = std::uintptr_t{2} << 20;
  const auto begin = (reinterpret_cast<std::uintptr_t>(triangles.data()) + kPage - 1) / kPage * kPage;
  const auto end = reinterpret_cast<std::uintptr_t>(triangles.data() + triangles.size()) / kPage * kPage;
  if (begin < end) ::madvise(reinterpret_cast<void*>(begin), end - begin, MADV_HUGEPAGE);
}

struct Progress {
  FloatBox plain;
  Box transformed;
};

/// Reads the first `count` facets.
Status read_facets(const Source& source, const Snapper& snapper, const LoadOptions& options, std::uint64_t count,
                   Facets& facets) {
  facets.triangles.reserve(count + kTriangleSlack);
  facets.triangles.resize(count);
  prefer_large_pages(facets.triangles);
  Triangle* const out = facets.triangles.data();

  const bool plain = snapper.plain() && !snapper.mirrors();
  tbb::enumerable_thread_specific<Buffer<char>> scratch([] { return Buffer<char>(kBlock * kFacet); });
  std::atomic<bool> unreadable{false}, bad{false};
  const Progress progress = tbb::parallel_reduce(
      tbb::blocked_range<std::uint64_t>(0, (count + kBlock - 1) / kBlock), Progress{},
      [&](const tbb::blocked_range<std::uint64_t>& blocks, Progress so_far) {
        char* const block = scratch.local().data();
        for (std::uint64_t b = blocks.begin(); b != blocks.end() && !unreadable && !bad; ++b) {
          const std::uint64_t first = b * kBlock;
          const auto in_block = static_cast<std::size_t>(std::min<std::uint64_t>(kBlock, count - first));
          if (!source.read(kHeader + first * kFacet, block, in_block * kFacet)) {
            unreadable = true;
          } else if (plain ? !snap_plain(block, in_block, out + first, so_far.plain)
                           : !snap_transformed(block, in_block, snapper, out + first, so_far.transformed)) {
            bad = true;
          }
        }
        return so_far;
      },
      [](Progress one, const Progress& other) {
        for (std::size_t k = 0; k < 12; ++k) {
          one.plain.lo[k] = std::min(one.plain.lo[k], other.plain.lo[k]);
          one.plain.hi[k] = std::max(one.plain.hi[k], other.plain.hi[k]);
        }
        one.transformed.add(other.transformed);
        return one;
      });
  if (unreadable) return source.changed_while_read();
  if (bad) return read_carefully(source, snapper, options, count, facets);
  facets.bounds = plain ? snapped_box(progress.plain, snapper) : progress.transformed;
  return {};
}

}  // namespace

Result<Facets> read_binary_stl(const Source& source, const Snapper& snapper, const LoadOptions& options) {
  Facets facets;
  const Result<std::uint64_t> count = count_facets(source, options, facets);
  if (!count) return count.error();
  Status read = read_facets(source, snapper, options, *count, facets);
  if (!read && facets.doubt && facets.doubt->claimed > 0) {
    // What follows the claimed facets is none.
    facets.notes.push_back({false, facets.doubt->rest_left_out});
    read = read_facets(source, snapper, options, facets.doubt->claimed, facets);
    facets.doubt.reset();
  } else if (!read && facets.doubt) {
    return source.error(facets.doubt->error);
  }
  if (!read) return read.error();
  return facets;
}

}  // namespace lamina::load
