// stages/geometry/blocks/block_maker.h: triangles become a block; lists of them become blocks.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "stages/geometry/blocks/mesh_blocks.h"

namespace lamina {

/// Makes one block after the other, in scratch memory of its own: 200 KiB, which stays in a core's cache.
class BlockMaker {
 public:
  /// Stores a block of `mesh` and the boxes of its clusters. Other threads may make other blocks meanwhile.
  /// triangles  those of the block, in the order of the file; those that repair added stay in it
  /// hashes     of each corner, three a triangle; equal where vertices are, and of many values where they are not
  void make(std::span<const Triangle> triangles, std::span<const std::uint16_t> hashes, MeshBlocks& mesh, std::uint32_t block);
  /// The same, with hashes of its own.
  void make(std::span<const Triangle> triangles, MeshBlocks& mesh, std::uint32_t block);

 private:
  static constexpr std::uint32_t kSlots = 1 << 14;                    // more than twice the vertices of a block
  static constexpr std::uint32_t kMostVertices = kBlockSize * 3 / 2;  // of a block whose vertices are stored once
  static constexpr std::uint16_t kNone = kMostVertices + 3;           // no vertex; a triangle more than the most is numbered

  bool number_vertices(std::span<const Triangle> triangles, std::span<const std::uint16_t> hashes);
  void fill_up(std::uint32_t count);
  void write_plain(std::span<const Triangle> triangles, MeshBlocks::Block& block) const;

  std::array<IndexedCluster, MeshBlocks::kClusters> cluster_;
  std::array<Point3, kNone + 1> vertex_;  // in the order of clusters
  std::array<std::uint16_t, kBlockSize> order_;
  std::array<std::uint16_t, kSlots> slot_;  // numbers of vertices, by hash
  std::array<std::uint16_t, 3 * kBlockSize> hash_;
  std::uint32_t vertices_;
};

/// A maker whose scratch memory is unset until it is used: blocks of few triangles touch little of it.
inline std::unique_ptr<BlockMaker> new_block_maker() { return std::make_unique_for_overwrite<BlockMaker>(); }

/// Takes the triangles out of a mesh and makes blocks of them; a mesh that has blocks already gives these. The list's
/// memory goes back to the system while blocks are made.
/// cost  O(T), parallel; no more memory than the list and a block a thread
std::shared_ptr<MeshBlocks> take_blocks(Mesh& mesh);

/// The same of many meshes at once: those of few triangles by one thread each.
std::vector<std::shared_ptr<MeshBlocks>> take_blocks(std::span<Mesh> meshes);

}  // namespace lamina
