// stages/load/stl_sound.cpp: a sound binary STL becomes blocks in one pass, each read, snapped, judged and stored in a core's
// cache. The list of triangles never exists.
#include <tbb/blocked_range.h>
#include <tbb/enumerable_thread_specific.h>
#include <tbb/parallel_for.h>

#include <atomic>
#include <memory>

#include "stages/geometry/blocks/block_maker.h"
#include "stages/geometry/isa.h"
#include "stages/load/kernels/kernels.h"
#include "stages/load/repair/census.h"
#include "stages/load/stl_facets.h"

namespace lamina::load {

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

std::shared_ptr<Scratch> make_scratch(Isa isa) { return std::make_shared<Scratch>(isa_at_most(isa)); }

namespace {

/// Reads one block. false  it cannot be read or snapped
bool read_block(const Source& source, const Snapper& snapper, std::uint32_t block, std::uint64_t share, const SeeTriangles& see,
                Scratch::Worker& worker, MeshBlocks& blocks, Prisms& prisms) {
  const std::uint64_t first = blocks.first_triangle(block), count = blocks.triangles_in(block);
  if (!source.read(kHeaderBytes + first * kFacetBytes, worker.bytes.data(), count * kFacetBytes)) return false;
  if (!snap_facets(worker.bytes.data(), count, snapper, worker.kernels.isa, worker.facets.data(), worker.box)) return false;
  if (see) see(static_cast<std::uint32_t>(first), {worker.facets.data(), count});
  SortedBlock& sorted = worker.maker.sort({worker.facets.data(), count}, blocks, block);
  worker.kernels.census(sorted, share, worker.sums);
  prisms = worker.kernels.prisms(sorted, worker.facets.front().a.z);
  worker.maker.store(blocks, block);
  return true;
}

/// Whether too many blocks are in disorder for who looks at edges: a file of such is better read as a list.
class Disorder {
 public:
  bool is_found(const MeshBlocks& blocks, std::uint32_t block) {
    constexpr std::uint32_t kFew = 8;
    const std::uint32_t seen = ++seen_;
    if (blocks.indexed(block * MeshBlocks::kClusters).cluster != nullptr) return false;
    return ++listed_ > kFew + seen / 4;
  }

 private:
  std::atomic<std::uint32_t> seen_{0}, listed_{0};
};

/// Of all facets, nm3; the sum is taken in the order of blocks, whichever thread read them.
double sixfold_volume(const Buffer<Prisms>& pieces, Nm plane) {
  double sum = 0;
  for (const Prisms& piece : pieces) sum += piece.sixfold_volume_above(plane);
  return sum;
}

}  // namespace

std::optional<Mesh> read_sound_stl(const Source& source, const Snapper& snapper, const LoadOptions& options,
                                   const SeeTriangles& see, std::vector<Note>& notes) {
  Facets header;
  const Result<std::uint64_t> count = count_facets(source, options, header);
  if (!count || header.doubt) return std::nullopt;
  const auto triangles = static_cast<std::uint32_t>(*count);
  const auto blocks = std::make_shared<MeshBlocks>(triangles, 0);
  Buffer<Prisms> pieces(blocks->block_count());
  const std::uint64_t share = sampled_share(triangles);
  const std::shared_ptr<Scratch> scratch = options.scratch ? options.scratch : make_scratch(options.isa);
  auto& workers = scratch->workers;
  for (auto& worker : workers) {  // of the file before
    worker->sums = {};
    worker->box = {};
  }
  std::atomic<bool> failed{false};
  Disorder disorder;
  tbb::parallel_for(tbb::blocked_range<std::uint32_t>(0, blocks->block_count()),
                    [&](const tbb::blocked_range<std::uint32_t>& range) {
                      Scratch::Worker& worker = *workers.local();
                      for (std::uint32_t b = range.begin(); b != range.end() && !failed; ++b) {
                        if (!read_block(source, snapper, b, share, see, worker, *blocks, pieces[b])) failed = true;
                        if (see && !failed && disorder.is_found(*blocks, b)) failed = true;
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
  mesh.bounds = box.nm(snapper);
  mesh.fingerprint = sums.fingerprint;
  mesh.volume_mm3 = sixfold_volume(pieces, mesh.bounds.middle().z) / 6e18;
  const double of_box = mm(mesh.bounds.width()) * mm(mesh.bounds.depth()) * mm(mesh.bounds.height());
  const bool sound = sums.boundary == 0 && mesh.volume_mm3 > kHardlyAny * of_box && !any_reversed(sums.sampled);
  if (!sound) return std::nullopt;
  mesh.name = source.path();
  mesh.repaired_from = triangles;
  mesh.blocks = blocks;
  notes.insert(notes.end(), header.notes.begin(), header.notes.end());
  return mesh;
}

}  // namespace lamina::load
