// stages/load/repair/vertices.cpp: each chunk of the list finds its own vertices in a core's cache; an open table then finds
// those that several chunks have.
//
// Every vertex goes to the first corner that names it, whichever thread came first: the table keeps the smallest name of each
// point. So numbers do not depend on threads.
#include "stages/load/repair/vertices.h"

#include <tbb/blocked_range.h>
#include <tbb/enumerable_thread_specific.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cstring>
#include <memory>
#include <utility>
#include <vector>

#include "stages/geometry/blocks/pages.h"
#include "stages/load/diagnosis/chunk_edges.h"
#include "stages/load/diagnosis/spatial_order.h"

namespace lamina::load {
namespace {

constexpr std::uint32_t kFree = UINT32_MAX;
constexpr std::size_t kChunk = Numbered::kChunk;  // 144 KiB
constexpr std::size_t kTogether = 16;             // chunks a task, 2.25 MiB of the list
constexpr std::uint32_t kNameBits = 14;           // of a point's name, within its chunk
static_assert(kChunk == kBlockSize);
static_assert(3 * kChunk <= std::size_t{1} << kNameBits);

using Local = Numbered::Local;

/// The points of a chunk, each once, in the order in which its facets name them.
struct Chunk {
  const Point3* point = nullptr;
  std::uint32_t count = 0;
  std::uint32_t numbers_from = 0;  // of those that no earlier chunk has
  std::size_t before = 0;          // points of earlier chunks
};

/// Numbers chunks whose facets lie apart, in memory of its own.
struct ChunkGatherer {
  ChunkNumbers numbers;
  std::array<Triangle, kChunk> list;
  std::array<Point3, 3 * kChunk> points;
};

/// Points of all chunks, each in one slot, which holds its smallest name and later its number.
class PointTable {
 public:
  PointTable(std::span<const Chunk> chunks, std::size_t slots)
      : chunks_(chunks),
        pages_(slots * sizeof(std::uint32_t)),
        slots_(reinterpret_cast<std::uint32_t*>(pages_.take(slots * sizeof(std::uint32_t))), slots),
        mask_(slots - 1) {
    for (std::size_t i = slots; i > 1; i /= 2) --shift_;
    tbb::parallel_for(tbb::blocked_range<std::size_t>(0, slots, std::size_t{1} << 16),
                      [&](const auto& range) { std::fill(slots_.data() + range.begin(), slots_.data() + range.end(), kFree); });
  }

  std::uint32_t& operator[](std::uint32_t slot) { return slots_[slot]; }

  /// Enters the points of a chunk, and tells their slots; any thread may. false  it would fill the table
  bool enter(std::uint32_t number, std::uint32_t* slots) {
    const Chunk& chunk = chunks_[number];
    if (4 * (reserved_ += chunk.count) > 3 * slots_.size()) return false;
    // What a slot points at is on its way when it is compared, and the slot itself before that.
    constexpr std::uint32_t kAhead = 16;
    std::array<std::uint64_t, 4 * kAhead> hashes;
    std::uint32_t taken = 0;
    for (std::uint32_t i = 0; i < chunk.count + 2 * kAhead; ++i) {
      if (i < chunk.count) {
        std::uint64_t& hashed = hashes[i % hashes.size()];
        hashed = hash_of(chunk.point[i]);
        __builtin_prefetch(&slots_[hashed >> shift_], 1);
      }
      if (i >= kAhead && i - kAhead < chunk.count) {
        const std::uint32_t held = std::atomic_ref<std::uint32_t>(slots_[hashes[(i - kAhead) % hashes.size()] >> shift_])
                                       .load(std::memory_order_relaxed);
        if (held != kFree) __builtin_prefetch(&point_named(held));
      }
      if (i < 2 * kAhead) continue;
      const std::uint32_t at = i - 2 * kAhead;
      slots[at] = slot_of(chunk.point[at], hashes[at % hashes.size()], number << kNameBits | at, taken);
    }
    reserved_ -= chunk.count - taken;
    return true;
  }

 private:
  // A slot that holds a name of a point never holds one of another point.
  std::uint32_t slot_of(const Point3& p, std::uint64_t hashed, std::uint32_t name, std::uint32_t& taken) {
    for (std::size_t at = hashed >> shift_;; at = (at + 1) & mask_) {
      const std::atomic_ref<std::uint32_t> slot(slots_[at]);
      std::uint32_t held = slot.load(std::memory_order_relaxed);
      if (held == kFree && slot.compare_exchange_strong(held, name, std::memory_order_relaxed)) {
        ++taken;
        return static_cast<std::uint32_t>(at);
      }
      if (!(point_named(held) == p)) continue;
      while (name < held && !slot.compare_exchange_weak(held, name, std::memory_order_relaxed)) {
      }
      return static_cast<std::uint32_t>(at);
    }
  }
  const Point3& point_named(std::uint32_t name) const {
    return chunks_[name >> kNameBits].point[name & ((1u << kNameBits) - 1)];
  }

  std::span<const Chunk> chunks_;
  Pages pages_;  // large ones: a slot is anywhere
  std::span<std::uint32_t> slots_;
  std::size_t mask_;
  int shift_ = 64;                        // the upper bits of a hash are the slot: they depend on all of the point
  std::atomic<std::size_t> reserved_{0};  // slots that are taken, or may be by chunks that are being entered
};

}  // namespace

class Numbering {
 public:
  explicit Numbering(std::size_t triangles) : facets_(triangles), chunks_((triangles + kChunk - 1) / kChunk) {
    prefer_large_pages(facets_);
  }

  /// Calls done(end, triangle) when the list has been read up to a triangle from the beginning of a task on.
  /// points  room for as many points as corners; may be the memory of the list
  template <class Done>
  void read(std::span<const Triangle> triangles, Point3* points, const Done& done) {
    tbb::enumerable_thread_specific<std::unique_ptr<ChunkNumbers>> workers([] { return std::make_unique<ChunkNumbers>(); });
    tbb::parallel_for(
        tbb::blocked_range<std::size_t>(0, chunks_.size(), kTogether),
        [&](const tbb::blocked_range<std::size_t>& range) {
          ChunkNumbers& worker = *workers.local();
          Point3* to = points + 3 * kChunk * range.begin();
          for (std::size_t c = range.begin(); c != range.end(); ++c) {
            const std::size_t first = c * kChunk, count = std::min(kChunk, triangles.size() - first);
            chunks_[c].point = to;
            chunks_[c].count = worker.number(triangles.subspan(first, count), facets_.data() + first, to);
            to += chunks_[c].count;
          }
          done(to, std::min(range.end() * kChunk, triangles.size()));
        },
        tbb::simple_partitioner());
  }

  /// Facets are read in an order; points go to `listed`.
  void read(std::span<const Triangle> triangles, std::span<const std::uint32_t> order, std::vector<Buffer<Point3>>& listed) {
    Gatherers gatherers([] { return std::make_unique<ChunkGatherer>(); });
    for_each_chunk([&](std::uint32_t c) {
      ChunkGatherer& gatherer = *gatherers.local();
      const std::size_t first = c * kChunk, count = std::min(kChunk, triangles.size() - first);
      for (std::size_t i = 0; i < count; ++i) gatherer.list[i] = triangles[order[first + i]];
      number_gathered(c, count, gatherer, listed);
    });
  }

  /// The chunks are blocks. Points of blocks that hold clusters as they are read go to `listed`.
  void read(const MeshBlocks& blocks, std::vector<Buffer<Point3>>& listed) {
    Gatherers gatherers([] { return std::make_unique<ChunkGatherer>(); });
    for_each_chunk([&](std::uint32_t c) {
      const std::uint32_t cluster = c * MeshBlocks::kClusters, count = blocks.triangles_in(c);
      Local* const facets = facets_.data() + c * kChunk;
      const MeshBlocks::Indexed first = blocks.indexed(cluster);
      if (first.cluster == nullptr) {
        ChunkGatherer& gatherer = *gatherers.local();
        for (std::uint32_t i = 0; i < count; ++i)
          gatherer.list[i] = blocks.listed(cluster + i / kClusterSize).triangle(i % kClusterSize);
        return number_gathered(c, count, gatherer, listed);
      }
      std::uint16_t last = 0;  // vertices count in the order in which corners name them
      for (std::uint32_t i = 0; i < count; ++i) {
        const auto& corner = first.cluster[i / kClusterSize].corner;
        const std::uint32_t lane = i % kClusterSize;
        facets[i] = {corner[0][lane], corner[1][lane], corner[2][lane]};
        last = std::max({last, facets[i][0], facets[i][1], facets[i][2]});
      }
      chunks_[c].point = first.vertex;
      chunks_[c].count = last + 1u;
    });
  }

  /// Numbers the points of all chunks. returns  the vertices
  Buffer<Point3> join() {
    std::size_t points = 0, slots = 64;
    for (Chunk& chunk : chunks_) chunk.before = std::exchange(points, points + chunk.count);
    slot_.resize(points);
    prefer_large_pages(slot_);
    first_.resize(points);
    // A closed mesh has half as many vertices as facets; where there are more, the table is made anew.
    const std::size_t expected = std::min(points, facets_.size() / 2 + facets_.size() / 16);
    while (2 * slots < 3 * expected) slots *= 2;
    std::unique_ptr<PointTable> table;
    for (;; slots *= 2) {
      table.reset();
      table = std::make_unique<PointTable>(chunks_, slots);
      std::atomic<bool> all{true};
      for_each_chunk([&](std::uint32_t c) {
        if (all && !table->enter(c, slot_.data() + chunks_[c].before)) all = false;
      });
      if (all) break;
    }
    for_each_chunk([&](std::uint32_t c) { find_first(c, *table); });
    std::uint32_t count = 0;
    for (Chunk& chunk : chunks_) chunk.numbers_from = std::exchange(count, count + chunk.numbers_from);
    Buffer<Point3> vertices(count);
    prefer_large_pages(vertices);
    for_each_chunk([&](std::uint32_t c) { number(chunks_[c], *table, vertices); });
    in_several_.resize(count);
    std::fill(in_several_.begin(), in_several_.end(), std::uint8_t{0});
    for_each_chunk([&](std::uint32_t c) {
      for (std::size_t i = chunks_[c].before, end = i + chunks_[c].count; i < end; ++i) {
        slot_[i] = (*table)[slot_[i]];
        if (first_[i] == 0) std::atomic_ref<std::uint8_t>(in_several_[slot_[i]]).store(1, std::memory_order_relaxed);
      }
    });
    return vertices;
  }

  std::size_t chunks() const { return chunks_.size(); }
  Buffer<Local> take_local() { return std::move(facets_); }
  Buffer<std::uint32_t> take_numbers() { return std::move(slot_); }
  Buffer<std::uint8_t> take_in_several() { return std::move(in_several_); }
  Buffer<std::size_t> begins() const {
    Buffer<std::size_t> begins;
    for (const Chunk& chunk : chunks_) begins.push_back(chunk.before);
    begins.push_back(slot_.size());
    return begins;
  }

 private:
  template <class Visit>
  void for_each_chunk(const Visit& visit) const {
    tbb::parallel_for(std::uint32_t{0}, static_cast<std::uint32_t>(chunks_.size()), visit);
  }

  using Gatherers = tbb::enumerable_thread_specific<std::unique_ptr<ChunkGatherer>>;
  void number_gathered(std::uint32_t c, std::size_t count, ChunkGatherer& from, std::vector<Buffer<Point3>>& listed) {
    chunks_[c].count = from.numbers.number({from.list.data(), count}, facets_.data() + c * kChunk, from.points.data());
    listed[c].assign(from.points.begin(), from.points.begin() + chunks_[c].count);
    chunks_[c].point = listed[c].data();
  }

  /// Which points of a chunk no earlier one has, and how many.
  void find_first(std::uint32_t c, PointTable& table) {
    Chunk& chunk = chunks_[c];
    for (std::uint32_t i = 0; i < chunk.count; ++i) {
      const bool is = table[slot_[chunk.before + i]] == (c << kNameBits | i);
      first_[chunk.before + i] = is;
      chunk.numbers_from += is;
    }
  }
  void number(const Chunk& chunk, PointTable& table, Buffer<Point3>& vertices) const {
    std::uint32_t next = chunk.numbers_from;
    for (std::uint32_t i = 0; i < chunk.count; ++i) {
      if (first_[chunk.before + i] == 0) continue;
      vertices[next] = chunk.point[i];
      table[slot_[chunk.before + i]] = next++;
    }
  }

  Buffer<Local> facets_;
  std::vector<Chunk> chunks_;
  Buffer<std::uint32_t> slot_;       // of each point of all chunks: in the table, then its number
  Buffer<std::uint8_t> first_;       // whether it is the first of its name
  Buffer<std::uint8_t> in_several_;  // of each vertex: several chunks have it
};

namespace {

/// Whether a few chunks, spread over a list, have points of their own for most of their facets.
bool in_disorder(std::span<const Triangle> triangles) {
  constexpr std::size_t kProbes = 4;
  if (triangles.size() < kProbes * kChunk) return false;
  const auto worker = std::make_unique<ChunkNumbers>();
  Buffer<Local> facets(kChunk);
  Buffer<Point3> points(3 * kChunk);
  std::size_t count = 0;
  for (std::size_t i = 0; i < kProbes; ++i) {
    const std::size_t first = (triangles.size() - kChunk) / (kProbes - 1) * i;
    count += worker->number(triangles.subspan(first, kChunk), facets.data(), points.data());
  }
  return 4 * count > 3 * kProbes * kChunk;
}

}  // namespace

void Numbered::take(Numbering& numbering) {
  begin_ = numbering.begins();
  numbers_ = numbering.take_numbers();
  in_several_ = numbering.take_in_several();
  local_ = numbering.take_local();
}

Numbered::Numbered(std::span<const Triangle> triangles, const Box& bounds) {
  Numbering numbering(triangles.size());
  if (in_disorder(triangles)) {
    order_ = spatial_order(triangles, bounds);
    std::vector<Buffer<Point3>> listed(numbering.chunks());
    numbering.read(triangles, order_, listed);
    vertices_ = numbering.join();
  } else {
    Buffer<Point3> points(3 * triangles.size());  // of whose memory little is touched
    numbering.read(triangles, points.data(), [](Point3*, std::size_t) {});
    vertices_ = numbering.join();
  }
  take(numbering);
}

Numbered::Numbered(const MeshBlocks& blocks) {
  Numbering numbering(blocks.triangle_count());
  {
    std::vector<Buffer<Point3>> listed(blocks.block_count());
    numbering.read(blocks, listed);
    vertices_ = numbering.join();
  }
  take(numbering);
}

// Points of a list in order lie where their triangles were until vertices are known.
Numbered::Numbered(Buffer<Triangle>&& triangles, const Box& bounds) : taken_(std::move(triangles)) {
  Numbering numbering(taken_.size());
  Triangle* const end_of_list = taken_.data() + taken_.size();
  if (in_disorder(taken_)) {
    order_ = spatial_order(taken_, bounds);
    std::vector<Buffer<Point3>> listed(numbering.chunks());
    numbering.read(taken_, order_, listed);
    forget_pages(taken_.data(), end_of_list);
    vertices_ = numbering.join();
  } else {
    numbering.read(taken_, reinterpret_cast<Point3*>(taken_.data()),
                   [&](Point3* points_end, std::size_t end) { forget_pages(points_end, taken_.data() + end); });
    vertices_ = numbering.join();
    if (!taken_.empty()) forget_pages(taken_.data(), end_of_list);
  }
  take(numbering);
}

Buffer<Triangle> Numbered::give_back_list() {
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, taken_.size(), kChunk), [&](const auto& range) {
    for (std::size_t i = range.begin(); i != range.end(); ++i) {
      const auto f = static_cast<std::uint32_t>(i);
      const Triangle t = triangle(f);
      std::memcpy(static_cast<void*>(taken_.data() + listed(f)), &t, sizeof t);
    }
  });
  return std::move(taken_);
}

}  // namespace lamina::load
