#include "stages/geometry/blocks/block_maker.h"

#include <tbb/blocked_range.h>
#include <tbb/enumerable_thread_specific.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <bit>
#include <cstring>
#include <numeric>

namespace lamina {

// Corners find the first corner that is the same vertex through a table in which the first corner of each hash stands: it is
// written from the last corner to the first, so its previous content is never read. Vertices whose slot another one has are
// few; they are matched the same way among themselves, and those that are left then by probing.

bool VertexNumbers::number(const SortedBlock& block, const BlockKernels& kernels) {
  const std::uint32_t corners = block.clusters() * SortedBlock::kCorners, maximum = block.triangles * 3 / 2;
  // A fixed number of corners a round, so that compilers unroll it.
  constexpr std::uint32_t kRound = 16;
  static_assert(SortedBlock::kCorners % kRound == 0);
  for (std::uint32_t end = corners; end > 0; end -= kRound) {
    const std::uint16_t* const hash = block.hash.data() + end;
    for (std::uint32_t i = 1; i <= kRound; ++i) {
      matches_.slot[*(hash - i) % CornerMatches::kSlots] = static_cast<std::uint16_t>(end - i);
    }
  }
  kernels.match(block, matches_);
  if (matches_.found > maximum) return false;
  if (matches_.unmatched > 0) match_again(block);
  if (matches_.unmatched > 0) match_rest(block);
  count_ = kernels.number(corners, matches_);
  return count_ <= maximum;
}

/// The same once more among those that are left: nearly all of their slots had two vertices, one of which is matched. Whether
/// one matches is not foreseen, so nothing branches on it.
void VertexNumbers::match_again(const SortedBlock& block) {
  auto& [slot, first, rest, number, vertex, found, unmatched] = matches_;
  for (std::uint32_t r = unmatched; r-- > 0;) slot[block.hash[rest[r]] % CornerMatches::kSlots] = rest[r];
  std::uint32_t left = 0;
  for (std::uint32_t r = 0; r < unmatched; ++r) {
    const std::uint16_t i = rest[r], candidate = slot[block.hash[i] % CornerMatches::kSlots];
    first[i] = candidate;
    rest[left] = i;
    left += difference(corner_at(block, i), corner_at(block, candidate)) != 0 ? 1 : 0;
  }
  unmatched = left;
}

/// By open addressing. Hashes decide only where the search begins.
void VertexNumbers::match_rest(const SortedBlock& block) {
  constexpr std::uint16_t kNone = UINT16_MAX;
  auto& slot = matches_.slot;
  slot.fill(kNone);
  for (std::uint32_t r = 0; r < matches_.unmatched; ++r) {
    const std::uint16_t i = matches_.rest[r];
    const Nm* const corner = corner_at(block, i);
    std::uint32_t at = block.hash[i] % CornerMatches::kSlots;
    while (slot[at] != kNone && difference(corner, corner_at(block, slot[at])) != 0) at = (at + 1) % CornerMatches::kSlots;
    if (slot[at] == kNone) slot[at] = i;
    matches_.first[i] = slot[at];
  }
}

namespace {

/// Of a step of a 16th to a 32nd of the mean height of facets: up to 8 times as high ones fit, still higher ones are never
/// passed over.
std::uint32_t step_shift(std::uint64_t heights, std::size_t clusters) {
  const std::uint64_t mean = heights / (clusters * kClusterSize);
  return static_cast<std::uint32_t>(std::max(0, static_cast<int>(std::bit_width(mean)) - 5));
}

using Makers = tbb::enumerable_thread_specific<std::unique_ptr<BlockMaker>>;

std::shared_ptr<MeshBlocks> take_blocks_of(Mesh& mesh, Makers& makers) {
  if (mesh.blocks) return std::move(mesh.blocks);
  const auto total = static_cast<std::uint32_t>(mesh.triangles.size()), own = std::min(mesh.repaired_from, total);
  Buffer<Triangle> list = std::move(mesh.triangles);
  mesh.triangles = {};
  auto blocks = std::make_shared<MeshBlocks>(own, total - own);
  constexpr std::uint32_t kTogether = 16;  // blocks, 2.25 MiB of the list
  tbb::parallel_for(
      tbb::blocked_range<std::uint32_t>(0, blocks->block_count(), kTogether),
      [&](const tbb::blocked_range<std::uint32_t>& range) {
        BlockMaker& maker = *makers.local();
        Triangle* const begin = list.data() + blocks->first_triangle(range.begin());
        Triangle* end = begin;
        for (std::uint32_t b = range.begin(); b != range.end(); ++b) {
          const std::uint32_t count = blocks->triangles_in(b);
          maker.make({end, count}, *blocks, b);
          end += count;
        }
        if (blocks->block_count() > kTogether) forget_pages(begin, end);
      },
      tbb::simple_partitioner());
  blocks->seal();
  return blocks;
}

}  // namespace

SortedBlock& BlockMaker::sort(std::span<const Triangle> triangles, const MeshBlocks& mesh, std::uint32_t block) {
  const std::span<std::uint16_t> order(order_.data(), triangles.size());
  if (mesh.is_added(block)) {
    std::iota(order.begin(), order.end(), std::uint16_t{0});
  } else {
    kernels_.order(triangles, order.data());
  }
  sorted_.take(triangles, order);
  return sorted_;
}

/// Numbers the vertices. returns  whether they are few; then, where the order is kept, triangles are in it
bool BlockMaker::number(std::span<const Triangle> triangles, MeshBlocks& mesh, std::uint32_t block) {
  if (!mesh.keeps_order()) return vertices_.number(sorted_, kernels_);
  std::array<std::uint16_t, kBlockSize> listed;
  std::iota(listed.data(), listed.data() + triangles.size(), std::uint16_t{0});
  sorted_.take(triangles, {listed.data(), triangles.size()});
  sorted_.hash_corners();
  if (vertices_.number(sorted_, kernels_)) return true;
  sorted_.take(triangles, {order_.data(), triangles.size()});
  std::copy_n(order_.data(), triangles.size(), mesh.order_.data() + mesh.first_triangle(block));
  return false;
}

void BlockMaker::store(std::span<const Triangle> triangles, MeshBlocks& mesh, std::uint32_t number) {
  MeshBlocks::Block& block = mesh.blocks_[number];
  const bool few = this->number(triangles, mesh, number);
  block.clusters = sorted_.clusters();
  block.vertices = few ? vertices_.count() : 0;
  const std::span<const Cluster> clusters(sorted_.cluster.data(), block.clusters);
  const std::uint64_t heights = kernels_.bounds(clusters, mesh.bounds_.data() + mesh.first_cluster(number));
  if (few) {
    const std::size_t indexed = block.clusters * sizeof(IndexedCluster), vertices = block.vertices * sizeof(Point3);
    block.bytes = mesh.pages_.take(indexed + vertices + 4);
    block.shift = step_shift(heights, block.clusters);
    kernels_.index(clusters, vertices_.corners(), block.shift, reinterpret_cast<IndexedCluster*>(block.bytes));
    kernels_.write(sorted_, vertices_.matches(), block.vertices, reinterpret_cast<Point3*>(block.bytes + indexed));
  } else {
    block.bytes = mesh.pages_.take(clusters.size_bytes());
    std::memcpy(block.bytes, clusters.data(), clusters.size_bytes());
  }
}

void BlockMaker::make(std::span<const Triangle> triangles, MeshBlocks& mesh, std::uint32_t block) {
  sort(triangles, mesh, block).hash_corners();
  store(triangles, mesh, block);
}

std::vector<std::shared_ptr<MeshBlocks>> take_blocks(std::span<Mesh> meshes, Isa isa) {
  std::vector<std::shared_ptr<MeshBlocks>> blocks(meshes.size());
  Makers makers([isa] { return std::make_unique<BlockMaker>(isa); });
  tbb::parallel_for(std::size_t{0}, meshes.size(), [&](std::size_t i) { blocks[i] = take_blocks_of(meshes[i], makers); });
  return blocks;
}

}  // namespace lamina
