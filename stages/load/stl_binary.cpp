// stages/load/stl_binary.cpp: binary STL, read in blocks and snapped straight into the mesh.
#include <fmt/core.h>
#include <tbb/blocked_range.h>
#include <tbb/enumerable_thread_specific.h>
#include <tbb/parallel_reduce.h>

#include <algorithm>
#include <atomic>
#include <cstring>

#include "stages/geometry/blocks/pages.h"
#include "stages/load/stl_facets.h"

namespace lamina::load {
namespace {

constexpr std::size_t kBlock = 5120;  // facets, 250 KiB: a block and its triangles stay in a core's cache

std::uint32_t little_endian(const char* bytes) {
  const auto* b = reinterpret_cast<const unsigned char*>(bytes);
  return b[0] | static_cast<std::uint32_t>(b[1]) << 8 | static_cast<std::uint32_t>(b[2]) << 16 |
         static_cast<std::uint32_t>(b[3]) << 24;
}

/// Facet after facet, for files in which something is wrong: says where, or leaves it out.
Status read_carefully(const Source& source, const Snapper& snapper, const LoadOptions& options, std::uint64_t count,
                      Facets& facets) {
  facets.bounds = {};
  std::uint64_t dropped = 0, first_dropped = 0, kept = 0;
  Buffer<char> block(kBlock * kFacetBytes);
  for (std::uint64_t first = 0; first < count; first += kBlock) {
    const auto in_block = static_cast<std::size_t>(std::min<std::uint64_t>(kBlock, count - first));
    if (!source.read(kHeaderBytes + first * kFacetBytes, block.data(), in_block * kFacetBytes))
      return source.changed_while_read();
    for (std::size_t i = 0; i < in_block; ++i) {
      Triangle triangle{};
      const Snapped snapped = snap_facet(block.data() + i * kFacetBytes, snapper, triangle);
      if (snapped == Snapped::kNotFinite && options.drop_bad) {
        if (dropped++ == 0) first_dropped = first + i;
        continue;
      }
      if (snapped != Snapped::kYes)
        return source.error(fmt::format("facet {} (byte {}): {}", first + i + 1, kHeaderBytes + (first + i) * kFacetBytes,
                                        what_is_wrong(snapped)));
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

/// Reads the first `count` facets.
Status read_facets(const Source& source, const Snapper& snapper, const LoadOptions& options, std::uint64_t count,
                   Facets& facets) {
  facets.triangles.reserve(count + kTriangleSlack);
  facets.triangles.resize(count);
  prefer_large_pages(facets.triangles);
  Triangle* const out = facets.triangles.data();

  tbb::enumerable_thread_specific<Buffer<char>> scratch([] { return Buffer<char>(kBlock * kFacetBytes); });
  std::atomic<bool> unreadable{false}, bad{false};
  const FacetBox box = tbb::parallel_reduce(
      tbb::blocked_range<std::uint64_t>(0, (count + kBlock - 1) / kBlock), FacetBox{},
      [&](const tbb::blocked_range<std::uint64_t>& blocks, FacetBox so_far) {
        char* const block = scratch.local().data();
        for (std::uint64_t b = blocks.begin(); b != blocks.end() && !unreadable && !bad; ++b) {
          const std::uint64_t first = b * kBlock;
          const auto in_block = static_cast<std::size_t>(std::min<std::uint64_t>(kBlock, count - first));
          if (!source.read(kHeaderBytes + first * kFacetBytes, block, in_block * kFacetBytes)) {
            unreadable = true;
          } else if (!snap_facets(block, in_block, snapper, options.isa, out + first, so_far)) {
            bad = true;
          }
        }
        return so_far;
      },
      [](FacetBox one, const FacetBox& other) {
        one.add(other);
        return one;
      });
  if (unreadable) return source.changed_while_read();
  if (bad) return read_carefully(source, snapper, options, count, facets);
  facets.bounds = box.nm(snapper);
  return {};
}

}  // namespace

Result<std::uint64_t> count_facets(const Source& source, const LoadOptions& options, Facets& facets) {
  std::array<char, 4> bytes;
  if (source.size() < kHeaderBytes || !source.read(80, bytes.data(), 4))
    return source.error(fmt::format("is {} bytes long, too short for an STL file", source.size()));
  const std::uint64_t claimed = little_endian(bytes.data());
  const std::uint64_t body = source.size() - kHeaderBytes, held = body / kFacetBytes, stray = body % kFacetBytes;
  const std::uint64_t count = held;
  if (claimed > held && (held == 0 || stray > 0)) return source.error(cut_short(source, claimed, held));
  if (held == 0 || (claimed == 0 && stray > 0)) return source.error("holds no facets");
  if (claimed == 0) {
    facets.notes.push_back({false, fmt::format("the header says 0 facets, the file holds {}: all are read", held)});
  } else if (claimed == held && stray > 0) {
    facets.notes.push_back({false, stray_bytes(stray, claimed)});
  } else if (claimed < held) {
    const std::string differ = fmt::format("the header says {} facets, the file holds {}", claimed, held);
    facets.doubt =
        Doubt{differ + ", which close: all are read", "", claimed, stray_bytes(body - claimed * kFacetBytes, claimed)};
  } else if (claimed > held) {
    facets.doubt = Doubt{fmt::format("the header says {} facets, the file holds {}, which close: all are read", claimed, held),
                         cut_short(source, claimed, held), 0, ""};
  }
  if (count > options.triangle_limit)
    return source.error(fmt::format("{} facets are more than the limit of {}", count, options.triangle_limit));
  return count;
}

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
