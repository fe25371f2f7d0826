#include "stages/geometry/blocks/block_maker.h"

#include <tbb/blocked_range.h>
#include <tbb/enumerable_thread_specific.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <bit>
#include <cstring>
#include <numeric>

namespace lamina {
namespace {

/// Of a step of a 16th to a 32nd of the mean height of facets: up to 8 times as high ones fit, still higher ones are never
/// passed over.
std::uint32_t step_shift(std::uint64_t heights, std::size_t clusters) {
  const std::uint64_t mean = heights / (clusters * kClusterSize);
  return static_cast<std::uint32_t>(std::max(0, static_cast<int>(std::bit_width(mean)) - 5));
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

void BlockMaker::store(MeshBlocks& mesh, std::uint32_t number) {
  MeshBlocks::Block& block = mesh.blocks_[number];
  const bool few = vertices_.number(sorted_, kernels_);
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
  store(mesh, block);
}

namespace {

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

std::vector<std::shared_ptr<MeshBlocks>> take_blocks(std::span<Mesh> meshes, Isa isa) {
  std::vector<std::shared_ptr<MeshBlocks>> blocks(meshes.size());
  Makers makers([isa] { return std::make_unique<BlockMaker>(isa); });
  tbb::parallel_for(std::size_t{0}, meshes.size(), [&](std::size_t i) { blocks[i] = take_blocks_of(meshes[i], makers); });
  return blocks;
}

std::shared_ptr<MeshBlocks> take_blocks(Mesh& mesh, Isa isa) {
  return std::move(take_blocks(std::span(&mesh, 1), isa).front());
}

}  // namespace lamina
