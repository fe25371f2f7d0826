// stages/geometry/blocks/mesh_blocks.h: a mesh as blocks of triangles whose vertices are stored once, in clusters of 16
// neighbouring ones: the shape that every kernel reads.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <memory>
#include <span>

#include "stages/data/buffer.h"
#include "stages/data/mesh.h"
#include "stages/geometry/blocks/pages.h"

namespace lamina {

inline constexpr std::uint32_t kClusterSize = 16;
/// Triangles that are ordered and stored together: neighbours of a file's order, 144 KiB, which fits a core's cache.
inline constexpr std::uint32_t kBlockSize = 4096;

/// 16 triangles, coordinate by coordinate, so that one plane is compared with 16 facets at a time. Corner k of
/// triangle i is (x[k][i], y[k][i], z[k][i]), nm, frame of the mesh. Unused lanes hold a point, which no plane crosses.
struct alignas(16) Cluster {
  Nm z[3][kClusterSize];
  Nm y[3][kClusterSize];
  Nm x[3][kClusterSize];

  Triangle triangle(std::uint32_t lane) const {
    return {{x[0][lane], y[0][lane], z[0][lane]}, {x[1][lane], y[1][lane], z[1][lane]}, {x[2][lane], y[2][lane], z[2][lane]}};
  }
};
static_assert(sizeof(Cluster) == kClusterSize * sizeof(Triangle));

/// The heights that the 16 triangles of a cluster reach, in steps that their block defines, modulo 256: enough to skip nearly
/// all triangles that a plane does not cut, without reading any vertex.
struct FacetSteps {
  std::uint8_t low[kClusterSize];   // the step of the lowest corner
  std::uint8_t span[kClusterSize];  // steps from there to the one 1 nm below the highest corner, or 255: any plane may cut it
};

/// 16 triangles as numbers of vertices in the table of their block: corner k of triangle i is vertex corner[k][i].
struct alignas(64) IndexedCluster {
  FacetSteps steps;
  std::uint16_t corner[3][kClusterSize];
};
static_assert(sizeof(IndexedCluster) == 128);

/// Writes all corners of an indexed cluster. 4 bytes behind the last vertex of the table must be readable.
void expand_cluster(const IndexedCluster& from, const Point3* vertices, Cluster& out);

/// A block while it is made: at most kBlockSize triangles as clusters in the order in which they will be stored, and a hash of
/// each corner: what each step of making a block reads from a core's cache, coordinate by coordinate. Unused lanes of the last
/// cluster hold the first corner of the last triangle. 168 KiB.
struct alignas(64) SortedBlock {
  static constexpr std::uint32_t kCorners = 3 * kClusterSize;  // of a cluster; corner k of triangle i is k * kClusterSize + i

  std::array<Cluster, kBlockSize / kClusterSize> cluster;
  std::array<std::uint16_t, 3 * kBlockSize> hash;  // cluster by cluster; equal where vertices are
  std::uint32_t triangles = 0;

  std::uint32_t clusters() const { return (triangles + kClusterSize - 1) / kClusterSize; }

  /// Takes at least one triangle; order[i] is the i-th of them.
  void take(std::span<const Triangle> list, std::span<const std::uint16_t> order);
  /// Hashes by itself, where no caller does.
  void hash_corners();
};

/// Triangles in clusters of 16, 256 clusters a block. A block holds each of its vertices once, 12 bytes, and three numbers of
/// 16 bits and two of 8 a triangle: 14 to 26 bytes a triangle. A block with more than 1.5 vertices a triangle, of a file in
/// disorder, holds its clusters as they are read, 36 bytes a triangle. Vertices lie in the order in which clusters name them
/// first, so those of a cluster are near each other. A box a cluster is 1.5 bytes a triangle on top.
///
/// Blocks are made by any number of threads (block_maker.h), each once; from then on nothing changes but shift().
class MeshBlocks {
 public:
  static constexpr std::uint32_t kClusters = kBlockSize / kClusterSize;  // a block

  /// own, added   triangles of the file, and of those the ones that repair added: they begin a cluster and a block
  /// keeps_order  blocks with numbered vertices are in the order of the file; in others, 2 bytes a triangle more say where each
  ///              is
  MeshBlocks(std::uint32_t own, std::uint32_t added, bool keeps_order = false);

  std::uint32_t triangle_count() const { return own_ + added_; }
  std::uint32_t cluster_count() const { return static_cast<std::uint32_t>(bounds_.size()); }
  /// Clusters from here on hold only triangles that repair added.
  std::uint32_t first_cap() const { return first_cap_; }
  /// Of each cluster, nm.
  std::span<const Box> bounds() const { return bounds_; }

  /// A cluster, where it is stored or expanded into `unpacked`; the reference lives as long as both.
  const Cluster& cluster(std::uint32_t index, Cluster& unpacked) const {
    const ClusterSlot position = slot_of(index);
    if (position.block.vertices == 0) return position.block.plain()[position.cluster];
    expand_cluster(position.block.indexed()[position.cluster], position.block.vertex(), unpacked);
    return unpacked;
  }

  /// What names a cluster's corners.
  struct Indexed {
    const IndexedCluster* cluster;  // null: its block stores clusters as they are read
    const Point3* vertex;           // of the block; 4 bytes behind the last one can be read
    std::uint32_t shift;            // a step is 2^shift nm
    Nm step_0;                      // where steps are counted from
    /// Of a height, in the frame of the mesh.
    std::uint8_t step_of(std::int64_t z) const { return static_cast<std::uint8_t>((z - step_0) >> shift); }
  };
  Indexed indexed(std::uint32_t index) const {
    const ClusterSlot position = slot_of(index);
    if (position.block.vertices == 0) return {};
    return {position.block.indexed() + position.cluster, position.block.vertex(), position.block.shift, position.block.step_0};
  }
  /// A cluster of a block that stores them as they are read.
  const Cluster& listed(std::uint32_t index) const {
    const ClusterSlot position = slot_of(index);
    return position.block.plain()[position.cluster];
  }

  /// One triangle of a cluster.
  Triangle triangle(std::uint32_t cluster, std::uint32_t lane) const {
    const ClusterSlot position = slot_of(cluster);
    if (position.block.vertices == 0) return position.block.plain()[position.cluster].triangle(lane);
    const Point3* const vertex = position.block.vertex();
    const auto& corner = position.block.indexed()[position.cluster].corner;
    return {vertex[corner[0][lane]], vertex[corner[1][lane]], vertex[corner[2][lane]]};
  }

  bool keeps_order() const { return keeps_order_; }
  /// Where the order is kept: the number of a triangle in the file's list.
  std::uint32_t listed_number(std::uint32_t cluster, std::uint32_t lane) const {
    const std::uint32_t block =
        cluster < first_cap_ ? cluster / kClusters : first_cap_block_ + (cluster - first_cap_) / kClusters;
    const std::uint32_t first = first_triangle(block), at = (cluster - first_cluster(block)) * kClusterSize + lane;
    return first + (blocks_[block].vertices > 0 ? at : order_[first + at]);
  }
  /// Where the order is kept: the triangles of a block as the file lists them. list  of at least triangles_in(block)
  void list_block(std::uint32_t block, std::span<Triangle> list) const;

  /// Where indexed() or listed() points to, to be fetched early. Nothing here fetches it: compilers take a function that does
  /// nothing else for one without effect, and leave calls of it out.
  std::span<const char> stored(std::uint32_t index) const {
    const ClusterSlot position = slot_of(index);
    const std::size_t size = position.block.vertices == 0 ? sizeof(Cluster) : sizeof(IndexedCluster);
    return {position.block.bytes + position.cluster * size, size};
  }

  /// Calls `see` for each vertex at least once, in no order of the file.
  template <class See>
  void each_vertex(See&& see) const {
    for (std::uint32_t b = 0; b < blocks_.size(); ++b) {
      const Block& block = blocks_[b];
      for (std::uint32_t v = 0; v < block.vertices; ++v) see(block.vertex()[v]);
      if (block.vertices > 0) continue;
      for (std::uint32_t i = 0; i < triangles_in(b); ++i) {
        const Triangle t = block.plain()[i / kClusterSize].triangle(i % kClusterSize);
        see(t.a), see(t.b), see(t.c);
      }
    }
  }

  /// Moves every vertex. Not while others read.
  void shift(const Point3& by);

  std::uint64_t bytes() const {  // of triangles
    return pages_.bytes() - bounds_taken_ + bytes_held(blocks_) + order_bytes();
  }
  std::uint64_t bounds_bytes() const { return bounds_taken_; }

  std::uint32_t block_count() const { return static_cast<std::uint32_t>(blocks_.size()); }
  /// Which triangles of the list a block holds: own ones first, then those added.
  std::uint32_t first_triangle(std::uint32_t block) const {
    return block < first_cap_block_ ? block * kBlockSize : own_ + (block - first_cap_block_) * kBlockSize;
  }
  std::uint32_t triangles_in(std::uint32_t block) const;
  bool is_added(std::uint32_t block) const { return block >= first_cap_block_; }

  /// Gives back what blocks did not need; once all are made.
  void seal() { pages_.give_back_rest(); }

 private:
  friend class BlockMaker;

  struct Block {
    char* bytes = nullptr;       // the clusters, and behind indexed ones the vertices and 4 bytes to spare
    std::uint32_t clusters = 0;  // in the block
    std::uint32_t vertices = 0;  // 0: the clusters are stored as they are read
    std::uint32_t shift = 0;     // of the steps of indexed clusters
    Nm step_0 = 0;

    const Cluster* plain() const { return reinterpret_cast<const Cluster*>(bytes); }
    const IndexedCluster* indexed() const { return reinterpret_cast<const IndexedCluster*>(bytes); }
    const Point3* vertex() const { return reinterpret_cast<const Point3*>(bytes + clusters * sizeof(IndexedCluster)); }
  };
  struct ClusterSlot {
    const Block& block;
    std::uint32_t cluster;  // in the block
  };

  ClusterSlot slot_of(std::uint32_t cluster) const {
    if (cluster < first_cap_) return {blocks_[cluster / kClusters], cluster % kClusters};
    const std::uint32_t cap = cluster - first_cap_;
    return {blocks_[first_cap_block_ + cap / kClusters], cap % kClusters};
  }
  std::uint32_t first_cluster(std::uint32_t block) const {
    return block < first_cap_block_ ? block * kClusters : first_cap_ + (block - first_cap_block_) * kClusters;
  }

  std::uint64_t order_bytes() const;

  std::uint32_t own_, added_, first_cap_, first_cap_block_;
  bool keeps_order_;
  Buffer<Block> blocks_;
  // Where the order is kept, of each place in the clusters of a block, the triangle of the block's list. Unset, and without
  // memory as a rule, in blocks that are in the order of the file.
  Buffer<std::uint16_t> order_;
  Pages pages_;
  std::uint64_t bounds_taken_;
  std::span<Box> bounds_;  // in pages_: written first where blocks are made, by all threads
};

/// All triangles, in the order of the file where it is kept.
Buffer<Triangle> list_of(const MeshBlocks& blocks);

/// Of a list or of blocks.
inline std::uint64_t triangle_count(const Mesh& mesh) {
  return mesh.blocks ? mesh.blocks->triangle_count() : mesh.triangles.size();
}

/// Calls visit(triangles) for triangles [first, end) of a mesh in the order of its file, piece by piece.
/// mesh     a list, or blocks that keep the order
/// scratch  what blocks are listed into
template <class Visit>
void each_listed(const Mesh& mesh, std::uint64_t first, std::uint64_t end, Buffer<Triangle>& scratch, Visit&& visit) {
  if (!mesh.blocks) return visit(std::span(mesh.triangles).subspan(first, end - first));
  const MeshBlocks& blocks = *mesh.blocks;
  scratch.resize(kBlockSize);
  for (auto b = static_cast<std::uint32_t>(first / kBlockSize); first < end; ++b) {
    const std::uint64_t begin = blocks.first_triangle(b), behind = begin + blocks.triangles_in(b);
    if (behind <= first) continue;
    blocks.list_block(b, scratch);
    const std::uint64_t last = std::min(behind, end);
    visit(std::span<const Triangle>(scratch).subspan(first - begin, last - first));
    first = last;
  }
}

/// Calls `see` for each vertex at least once: in the order of a list, in no order of blocks.
template <class See>
void each_vertex(const Mesh& mesh, See&& see) {
  for (const Triangle& t : mesh.triangles) see(t.a), see(t.b), see(t.c);
  if (mesh.blocks) mesh.blocks->each_vertex(see);
}

}  // namespace lamina
