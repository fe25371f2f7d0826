// stages/geometry/blocks/block_maker.h: triangles become a block; lists of them become blocks.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "stages/geometry/blocks/kernels/kernels.h"
#include "stages/geometry/blocks/mesh_blocks.h"
#include "stages/geometry/isa.h"

namespace lamina {

// --- the vertices of a block, each once, and numbers for its corners.

/// Numbers the vertices of one block after the other, in scratch memory of its own, which stays in a core's cache.
class VertexNumbers {
 public:
  /// Numbers vertices in the order in which clusters name them. returns  whether there are at most 1.5 a triangle
  /// cost  O(T) where hashes are of many values; no branch depends on whether a corner is a new vertex
  bool number(const SortedBlock& block, const BlockKernels& kernels);

  std::uint32_t count() const { return count_; }
  /// Of each corner, in the shape of the clusters: IndexedCluster::corner.
  const std::uint16_t* corners() const { return matches_.number.data(); }
  /// For BlockKernels::write.
  const CornerMatches& matches() const { return matches_; }

 private:
  void match_again(const SortedBlock& block);
  void match_rest(const SortedBlock& block);

  CornerMatches matches_;
  std::uint32_t count_ = 0;
};

// ---

/// Makes one block after the other, in scratch memory of its own: 300 KiB, which stays in a core's cache. It is unset until it
/// is used: blocks of few triangles touch little of it.
class BlockMaker {
 public:
  /// isa  the widest instruction set to use; blocks are the same with any
  explicit BlockMaker(Isa isa = Isa::kAuto) : kernels_(block_kernels_for(limited_isa(isa))) {}

  /// The triangles of a block of `mesh`, sorted; the caller hashes the corners: equal where vertices are, and of many values
  /// where they are not.
  /// triangles  at least one, in the order of the file; those that repair added stay in it
  SortedBlock& sort(std::span<const Triangle> triangles, const MeshBlocks& mesh, std::uint32_t block);
  /// Stores them, the same `triangles`, and the boxes of their clusters. Other threads may make other blocks meanwhile. Where
  /// `mesh` keeps the order of the file, and vertices are shared, they are stored in that order.
  void store(std::span<const Triangle> triangles, MeshBlocks& mesh, std::uint32_t block);
  /// Both, with hashes of its own.
  void make(std::span<const Triangle> triangles, MeshBlocks& mesh, std::uint32_t block);

 private:
  bool number(std::span<const Triangle> triangles, MeshBlocks& mesh, std::uint32_t block);

  const BlockKernels& kernels_;
  SortedBlock sorted_;
  VertexNumbers vertices_;
  std::array<std::uint16_t, kBlockSize> order_;
};

/// Takes the triangles out of meshes and makes blocks of each; a mesh that has blocks already gives these. Meshes of few
/// triangles are worked on by one thread each, at once. The lists' memory goes back to the system while blocks are made.
/// cost  O(T), parallel; no more memory than the list and a block a thread
std::vector<std::shared_ptr<MeshBlocks>> take_blocks(std::span<Mesh> meshes, Isa isa = Isa::kAuto);

}  // namespace lamina
