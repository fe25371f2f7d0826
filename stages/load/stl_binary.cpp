// stages/load/stl_binary.cpp: read in blocks and snapped straight into the mesh; a sound file becomes blocks in one pass, each
// read, snapped, judged and stored in a core's cache, and the list of triangles never exists.
#include "stages/load/stl_binary.h"

#include <fmt/core.h>
#include <tbb/blocked_range.h>
#include <tbb/enumerable_thread_specific.h>
#include <tbb/parallel_for.h>
#include <tbb/parallel_reduce.h>

#include <algorithm>
#include <atomic>
#include <cstring>
#include <memory>

#include "stages/geometry/blocks/block_maker.h"
#include "stages/geometry/blocks/pages.h"
#include "stages/geometry/isa.h"
#include "stages/load/kernels/kernels.h"
#include "stages/load/repair/census.h"
#include "stages/load/repair/shells.h"

namespace lamina::load {
namespace {

/// The coordinates are millimetres and stay where they are.
bool is_plain(const Snapper& snapper) { return snapper.plain() && !snapper.mirrors(); }

/// The box around facets; boxes of parts of a file add up in any order.
struct FacetBox {
  CoordinateBox plain;  // of a file in plain millimetres
  Box transformed;      // nm, of any other

  void add(const FacetBox& other) {
    for (std::size_t k = 0; k < 3; ++k) {
      plain.lo[k] = std::min(plain.lo[k], other.plain.lo[k]);
      plain.hi[k] = std::max(plain.hi[k], other.plain.hi[k]);
    }
    transformed.add(other.transformed);
  }
  Box nm(const Snapper& snapper) const {
    if (!is_plain(snapper)) return transformed;
    Box box;
    if (plain.lo[0] > plain.hi[0]) return box;
    for (const auto& corner : {plain.lo, plain.hi}) {
      Point3 at{};
      snapper.snap(static_cast<double>(corner[0]), static_cast<double>(corner[1]), static_cast<double>(corner[2]), at);
      box.add(at);
    }
    return box;
  }
};

}  // namespace

struct Scratch {
  /// What a thread needs for a block, and what it found in all of its blocks.
  struct Worker {
    std::array<char, kBlockSize * kFacetBytes> bytes;
    std::array<Triangle, kBlockSize> facets;
    const LoadKernels& kernels;
    BlockMaker maker;
    CensusSums sums;
    FacetBox box;

    explicit Worker(Isa isa) : kernels(load_kernels_for(isa)), maker(isa) {}
  };

  tbb::enumerable_thread_specific<std::unique_ptr<Worker>> workers;

  explicit Scratch(Isa isa) : workers([isa] { return std::make_unique<Worker>(isa); }) {}
};

std::shared_ptr<Scratch> make_scratch(Isa isa) { return std::make_shared<Scratch>(limited_isa(isa)); }

namespace {

/// Snaps one facet, turned over if the transform mirrors.
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

/// Snaps facets that follow each other, and grows the box by them. isa  the widest instruction set to use
/// false  one of them cannot be snapped
bool snap_facets(const char* facets, std::size_t count, const Snapper& snapper, Isa isa, Triangle* out, FacetBox& box) {
  if (is_plain(snapper)) return load_kernels_for(limited_isa(isa)).snap(facets, count, out, box.plain);
  for (std::size_t i = 0; i < count; ++i) {
    if (snap_facet(facets + i * kFacetBytes, snapper, out[i]) != Snapped::kYes) return false;
    for (const Point3& corner : {out[i].a, out[i].b, out[i].c}) box.transformed.add(corner);
  }
  return true;
}

constexpr std::size_t kFacetsOfBlock = 5120;  // facets, 250 KiB: a block and its triangles stay in a core's cache

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
  Buffer<char> block(kFacetsOfBlock * kFacetBytes);
  for (std::uint64_t first = 0; first < count; first += kFacetsOfBlock) {
    const auto in_block = static_cast<std::size_t>(std::min<std::uint64_t>(kFacetsOfBlock, count - first));
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

  tbb::enumerable_thread_specific<Buffer<char>> scratch([] { return Buffer<char>(kFacetsOfBlock * kFacetBytes); });
  std::atomic<bool> unreadable{false}, bad{false};
  const FacetBox box = tbb::parallel_reduce(
      tbb::blocked_range<std::uint64_t>(0, (count + kFacetsOfBlock - 1) / kFacetsOfBlock), FacetBox{},
      [&](const tbb::blocked_range<std::uint64_t>& blocks, FacetBox so_far) {
        char* const block = scratch.local().data();
        for (std::uint64_t b = blocks.begin(); b != blocks.end() && !unreadable && !bad; ++b) {
          const std::uint64_t first = b * kFacetsOfBlock;
          const auto in_block = static_cast<std::size_t>(std::min<std::uint64_t>(kFacetsOfBlock, count - first));
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

/// How many facets a file holds, with what there is to say about it in `facets`.
/// errors  kInput: the header and the length of the file contradict each other, or there are more than the limit
Result<std::uint64_t> count_facets(const Source& source, const LoadOptions& options, Facets& facets) {
  std::array<char, 4> bytes;
  if (source.size() < kHeaderBytes || !source.read(80, bytes.data(), 4))
    return source.error(fmt::format("is {} bytes long, too short for an STL file", source.size()));
  const std::uint64_t claimed = little_endian(bytes.data());
  const std::uint64_t body = source.size() - kHeaderBytes, held = body / kFacetBytes, stray = body % kFacetBytes;
  if (held > 0 && stray == 0 && claimed != held && __builtin_bswap32(static_cast<std::uint32_t>(claimed)) == held)
    return source.error("is binary STL in big-endian byte order, which STL does not have; export it again, or as ASCII STL");
  if (claimed > held && (held == 0 || stray > 0)) return source.error(cut_short(source, claimed, held));
  if (held == 0 || (claimed == 0 && stray > 0)) return source.error("holds no facets");
  if (claimed == 0) {
    facets.notes.push_back({false, fmt::format("the header says 0 facets, the file holds {}: all are read", held)});
  } else if (claimed == held && stray > 0) {
    facets.notes.push_back({false, stray_bytes(stray, claimed)});
  } else if (claimed != held) {
    facets.warning.emplace().note =
        fmt::format("the header says {} facets, the file holds {}, which close: all are read", claimed, held);
    if (claimed < held) {
      facets.warning->claimed = claimed;
      facets.warning->rest_left_out = stray_bytes(body - claimed * kFacetBytes, claimed);
    } else {
      facets.warning->error = cut_short(source, claimed, held);
    }
  }
  if (held > options.triangle_limit)
    return source.error(fmt::format("{} facets are more than the limit of {}", held, options.triangle_limit));
  return held;
}

/// Reads one block. prisms  null: it is shown only. false  it cannot be read or snapped, or is refused
bool read_block(const Source& source, const Snapper& snapper, std::uint32_t block, std::uint64_t share, const SeeTriangles& see,
                Scratch::Worker& worker, MeshBlocks& blocks, Prisms* prisms) {
  const std::uint64_t first = blocks.first_triangle(block), count = blocks.triangles_in(block);
  if (!source.read(kHeaderBytes + first * kFacetBytes, worker.bytes.data(), count * kFacetBytes)) return false;
  if (!snap_facets(worker.bytes.data(), count, snapper, worker.kernels.isa, worker.facets.data(), worker.box)) return false;
  if (see && !see(static_cast<std::uint32_t>(first), {worker.facets.data(), count})) return false;
  if (prisms == nullptr) return true;
  SortedBlock& sorted = worker.maker.sort({worker.facets.data(), count}, blocks, block);
  worker.kernels.census(sorted, share, worker.sums);
  *prisms = worker.kernels.prisms(sorted, worker.facets.front().a.z);
  worker.maker.store({worker.facets.data(), count}, blocks, block);
  return true;
}

}  // namespace

Result<Facets> read_binary_stl(const Source& source, const Snapper& snapper, const LoadOptions& options) {
  Facets facets;
  const Result<std::uint64_t> count = count_facets(source, options, facets);
  if (!count) return count.error();
  Status read = read_facets(source, snapper, options, *count, facets);
  if (!read && facets.warning && facets.warning->claimed > 0) {
    // What follows the claimed facets is none.
    facets.notes.push_back({false, facets.warning->rest_left_out});
    read = read_facets(source, snapper, options, facets.warning->claimed, facets);
    facets.warning.reset();
  } else if (!read && facets.warning) {
    return source.error(facets.warning->error);
  }
  if (!read) return read.error();
  return facets;
}

std::optional<Mesh> read_sound_stl(const Source& source, const Snapper& snapper, const LoadOptions& options,
                                   const SeeTriangles& see, std::vector<Note>& notes) {
  Facets header;
  const Result<std::uint64_t> count = count_facets(source, options, header);
  if (!count || header.warning) return std::nullopt;
  const auto triangles = static_cast<std::uint32_t>(*count);
  const auto blocks = std::make_shared<MeshBlocks>(triangles, 0, options.order);
  Buffer<Prisms> pieces(blocks->block_count());
  const std::uint64_t share = sampled_share(triangles);
  const std::shared_ptr<Scratch> scratch = options.scratch ? options.scratch : make_scratch(options.isa);
  auto& workers = scratch->workers;
  for (auto& worker : workers) {  // of the file before
    worker->sums = {};
    worker->box = {};
  }
  std::atomic<bool> failed{false};
  tbb::parallel_for(tbb::blocked_range<std::uint32_t>(0, blocks->block_count()),
                    [&](const tbb::blocked_range<std::uint32_t>& range) {
                      Scratch::Worker& worker = *workers.local();
                      for (std::uint32_t b = range.begin(); b != range.end() && !failed; ++b) {
                        Prisms* const prisms = options.shown_only ? nullptr : &pieces[b];
                        if (!read_block(source, snapper, b, share, see, worker, *blocks, prisms)) failed = true;
                      }
                    });
  if (failed) return std::nullopt;
  blocks->seal();

  CensusSums sums;
  FacetBox box;
  for (const auto& worker : workers) {
    sums.add(worker->sums);
    box.add(worker->box);
  }
  Mesh mesh;
  mesh.name = source.path();
  mesh.bounds = box.nm(snapper);
  notes.insert(notes.end(), header.notes.begin(), header.notes.end());
  if (options.shown_only) return mesh;
  mesh.fingerprint = sums.fingerprint;
  double sixfold_volume = 0;  // nm3; the sum is taken in the order of blocks, whichever thread read them
  for (const Prisms& piece : pieces) sixfold_volume += piece.sixfold_volume_above(mesh.bounds.middle().z);
  mesh.volume_mm3 = sixfold_volume / 6e18;
  const double of_box = mm(mesh.bounds.width()) * mm(mesh.bounds.depth()) * mm(mesh.bounds.height());
  const bool sound = sums.boundary == 0 && mesh.volume_mm3 > kHardlyAny * of_box && !any_reversed(sums.sampled);
  if (!sound) return std::nullopt;
  mesh.repaired_from = triangles;
  mesh.blocks = blocks;
  if (options.repair && options.turn_shells) turn_shells(mesh, "", notes);
  return mesh;
}

}  // namespace lamina::load
