// stages/load/repair/vertices.cpp: each chunk of the list finds its own vertices in a core's cache. Nearly all are of one chunk
// alone: the bits of a sketch say so of all but a few. An open table then finds which of the others several chunks have.
//
// Every vertex goes to the first corner that names it, whichever thread came first: the table keeps the smallest name of each
// point. So numbers do not depend on threads.
#include "stages/load/repair/vertices.h"

#include <tbb/blocked_range.h>
#include <tbb/enumerable_thread_specific.h>
#include <tbb/parallel_for.h>

#include <atomic>
#include <bit>
#include <cstring>
#include <memory>
#include <utility>
#include <vector>

#include "stages/geometry/blocks/pages.h"
#include "stages/load/diagnosis/chunk_numbers.h"

namespace lamina::load {
namespace {

constexpr std::uint32_t kFree = UINT32_MAX;
constexpr std::size_t kChunk = Numbered::kChunk;  // 144 KiB
constexpr std::size_t kTogether = 16;             // chunks a task, 2.25 MiB of the list
constexpr std::uint32_t kNameBits = 14;           // of a point's name, within its chunk
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

/// Calls visit(i, hash) for each point of a list, after prefetch(hash) for those ahead.
template <class Prefetch, class Visit>
void for_each_hash(const Chunk& chunk, const Prefetch& prefetch, const Visit& visit) {
  constexpr std::uint32_t kAhead = 16;
  std::array<std::uint64_t, kAhead> hashes;
  for (std::uint32_t i = 0; i < chunk.count + kAhead; ++i) {
    if (i >= kAhead) visit(i - kAhead, hashes[i % kAhead]);
    if (i < chunk.count) prefetch(hashes[i % kAhead] = point_hash(chunk.point[i]));
  }
}

/// Two bits for a hash: it was noted, and it was noted again. So of a point that was noted once, and whose bits no other has,
/// no other chunk has it.
class Sketch {
 public:
  explicit Sketch(std::size_t points) {
    while ((std::size_t{1} << bits_) < kSpread * points) ++bits_;
    pairs_ = std::make_unique<Pages>(bytes());
    words_ = reinterpret_cast<std::uint64_t*>(pairs_->take(bytes()));  // new pages are zero, but pieces of the heap are not
    std::memset(words_, 0, bytes());
    prefer_large_pages(words_, words_ + bytes() / sizeof(std::uint64_t));
  }
  void prefetch(std::uint64_t hashed) const { __builtin_prefetch(&words_[pair_of(hashed) / kPairs], 1); }
  /// Any thread may.
  void note(std::uint64_t hashed) {
    const std::size_t pair = pair_of(hashed);
    const std::atomic_ref<std::uint64_t> word(words_[pair / kPairs]);
    const std::uint64_t bit = std::uint64_t{1} << 2 * (pair % kPairs);
    if ((word.fetch_or(bit, std::memory_order_relaxed) & bit) != 0) word.fetch_or(bit << 1, std::memory_order_relaxed);
  }
  bool noted_once(std::uint64_t hashed) const {
    const std::size_t pair = pair_of(hashed);
    return (words_[pair / kPairs] >> (2 * (pair % kPairs) + 1) & 1) == 0;
  }

 private:
  static constexpr std::size_t kSpread = 8, kPairs = 32;  // pairs of bits for each point; in a word
  std::size_t bytes() const { return (std::size_t{2} << bits_) / 8; }
  std::size_t pair_of(std::uint64_t hashed) const { return hashed >> (64 - bits_); }

  int bits_ = 8;
  std::unique_ptr<Pages> pairs_;
  std::uint64_t* words_ = nullptr;
};

/// What is known of a point of a chunk.
enum Occurrence : std::uint8_t { kLater, kFirst, kOnly };  // an earlier chunk has it; none has it; no other chunk has it

/// Points that several chunks may have, each in one slot, which holds its smallest name and later its number.
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

  /// Enters the points of a chunk that others may have, and returns their slots; any thread may.
  void enter(std::uint32_t number, const std::uint8_t* occurrence, std::uint32_t* slots) {
    const Chunk& chunk = chunks_[number];
    std::array<std::uint16_t, 3 * kChunk> shared;
    std::uint32_t count = 0;
    for (std::uint32_t i = 0; i < chunk.count; ++i) {
      shared[count] = static_cast<std::uint16_t>(i);
      count += occurrence[i] != kOnly;
    }
    // What a slot points at is on its way when it is compared, and the slot itself before that.
    constexpr std::uint32_t kAhead = 16;
    std::array<std::uint64_t, 4 * kAhead> hashes;
    for (std::uint32_t i = 0; i < count + 2 * kAhead; ++i) {
      if (i < count) {
        std::uint64_t& hashed = hashes[i % hashes.size()];
        hashed = point_hash(chunk.point[shared[i]]);
        __builtin_prefetch(&slots_[hashed >> shift_], 1);
      }
      if (i >= kAhead && i - kAhead < count) {
        const std::uint32_t held = std::atomic_ref<std::uint32_t>(slots_[hashes[(i - kAhead) % hashes.size()] >> shift_])
                                       .load(std::memory_order_relaxed);
        if (held != kFree) __builtin_prefetch(&point_named(held));
      }
      if (i < 2 * kAhead) continue;
      const std::uint32_t at = i - 2 * kAhead, point = shared[at];
      slots[point] = slot_of(chunk.point[point], hashes[at % hashes.size()], number << kNameBits | point);
    }
  }

 private:
  // A slot that holds a name of a point never holds one of another point.
  std::uint32_t slot_of(const Point3& p, std::uint64_t hashed, std::uint32_t name) {
    for (std::size_t at = hashed >> shift_;; at = (at + 1) & mask_) {
      const std::atomic_ref<std::uint32_t> slot(slots_[at]);
      std::uint32_t held = slot.load(std::memory_order_relaxed);
      if (held == kFree && slot.compare_exchange_strong(held, name, std::memory_order_relaxed))
        return static_cast<std::uint32_t>(at);
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
  int shift_ = 64;  // the upper bits of a hash are the slot: they depend on all of the point
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

  void join(Numbered& to) {
    std::size_t points = 0, slots = 64;
    for (Chunk& chunk : chunks_) chunk.before = std::exchange(points, points + chunk.count);
    slot_.resize(points);
    prefer_large_pages(slot_);
    occurrence_.resize(points);
    const std::size_t shared = sketch(points);
    while (2 * slots < 3 * shared) slots *= 2;
    PointTable table(chunks_, slots);
    for_each_chunk(
        [&](std::uint32_t c) { table.enter(c, occurrence_.data() + chunks_[c].before, slot_.data() + chunks_[c].before); });
    for_each_chunk([&](std::uint32_t c) { find_first(c, table); });
    std::uint32_t count = 0;
    for (Chunk& chunk : chunks_) chunk.numbers_from = std::exchange(count, count + chunk.numbers_from);
    Buffer<Point3> vertices(count);
    prefer_large_pages(vertices);
    for_each_chunk([&](std::uint32_t c) { number(chunks_[c], table, vertices); });
    in_several_.assign(count, std::uint8_t{0});
    for_each_chunk([&](std::uint32_t c) {
      for (std::size_t i = chunks_[c].before, end = i + chunks_[c].count; i < end; ++i) {
        if (occurrence_[i] == kOnly) continue;
        slot_[i] = table[slot_[i]];
        if (occurrence_[i] == kLater) std::atomic_ref<std::uint8_t>(in_several_[slot_[i]]).store(1, std::memory_order_relaxed);
      }
    });
    for (const Chunk& chunk : chunks_) to.begin_.push_back(chunk.before);
    to.begin_.push_back(points);
    to.vertices_ = std::move(vertices);
    to.numbers_ = std::move(slot_);
    to.in_several_ = std::move(in_several_);
    to.local_ = std::move(facets_);
  }

  std::size_t chunks() const { return chunks_.size(); }

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

  /// Which points one chunk alone has, by a sketch. returns  how many are left
  std::size_t sketch(std::size_t points) {
    Sketch sketch(points);
    const auto prefetch = [&](std::uint64_t hashed) { sketch.prefetch(hashed); };
    for_each_chunk([&](std::uint32_t c) {
      for_each_hash(chunks_[c], prefetch, [&](std::uint32_t, std::uint64_t hashed) { sketch.note(hashed); });
    });
    std::atomic<std::size_t> shared{0};
    for_each_chunk([&](std::uint32_t c) {
      std::uint8_t* const occurrence = occurrence_.data() + chunks_[c].before;
      std::size_t left = 0;
      for_each_hash(chunks_[c], prefetch, [&](std::uint32_t i, std::uint64_t hashed) {
        const bool only = sketch.noted_once(hashed);
        occurrence[i] = only ? kOnly : kFirst;
        left += !only;
      });
      shared += left;
    });
    return shared;
  }
  /// Which points of a chunk no earlier one has, and how many.
  void find_first(std::uint32_t c, PointTable& table) {
    Chunk& chunk = chunks_[c];
    for (std::uint32_t i = 0; i < chunk.count; ++i) {
      std::uint8_t& occurrence = occurrence_[chunk.before + i];
      if (occurrence != kOnly && table[slot_[chunk.before + i]] != (c << kNameBits | i)) occurrence = kLater;
      chunk.numbers_from += occurrence != kLater;
    }
  }
  void number(const Chunk& chunk, PointTable& table, Buffer<Point3>& vertices) {
    std::uint32_t next = chunk.numbers_from;
    for (std::uint32_t i = 0; i < chunk.count; ++i) {
      const std::uint8_t occurrence = occurrence_[chunk.before + i];
      if (occurrence == kLater) continue;
      vertices[next] = chunk.point[i];
      std::uint32_t& slot = slot_[chunk.before + i];
      (occurrence == kOnly ? slot : table[slot]) = next++;
    }
  }

  Buffer<Local> facets_;
  std::vector<Chunk> chunks_;
  Buffer<std::uint32_t> slot_;       // of each point of all chunks: in the table, then its number
  Buffer<std::uint8_t> occurrence_;  // of each point of all chunks
  Buffer<std::uint8_t> in_several_;  // of each vertex: several chunks have it
};

namespace {

// --- a counting sort by coarse cells, each part of the list on its own, then one by fine cells in each coarse one.

constexpr std::uint32_t kParts = 16;
constexpr unsigned kBits = 7, kFineBits = 6;  // of a cell along an axis; of its Morton code within the coarse cell
constexpr std::uint32_t kCoarse = 1u << (3 * kBits - kFineBits), kFine = 1u << kFineBits;

/// A cube around a box, divided into 2^kBits cells along each axis.
class CubeCells {
 public:
  explicit CubeCells(const Box& bounds) : lo_(bounds.lo) {
    const std::uint64_t side = std::max({reach(lo_.x, bounds.hi.x), reach(lo_.y, bounds.hi.y), reach(lo_.z, bounds.hi.z)});
    shift_ = std::max(static_cast<int>(std::bit_width(side)) - static_cast<int>(kBits), 0);
    for (std::uint32_t i = 0; i < spread_.size(); ++i) {
      spread_[i] = 0;
      for (unsigned bit = 0; bit < kBits; ++bit) spread_[i] |= (i >> bit & 1) << 3 * bit;
    }
  }
  /// The Morton code of a point's cell.
  std::uint32_t operator()(const Point3& p) const {
    return along(lo_.x, p.x) | along(lo_.y, p.y) << 1 | along(lo_.z, p.z) << 2;
  }

 private:
  static std::uint64_t reach(Nm lo, Nm hi) { return hi > lo ? static_cast<std::uint64_t>(std::int64_t{hi} - lo) : 0; }
  std::uint32_t along(Nm lo, Nm at) const {
    return spread_[std::min<std::uint64_t>(reach(lo, at) >> shift_, spread_.size() - 1)];
  }

  Point3 lo_;
  int shift_;
  std::array<std::uint32_t, 1u << kBits> spread_;  // Morton codes of cells along x
};

/// Turns how many facets each part has in each coarse cell into where they go. returns  the ends of cells
Buffer<std::uint32_t> begin_cells(Buffer<std::uint32_t>& parts) {
  Buffer<std::uint32_t> at(kCoarse, 0u);
  for (std::size_t i = 0; i < parts.size(); ++i) at[i % kCoarse] += parts[i];
  std::uint32_t end = 0;
  for (std::uint32_t& here : at) end += std::exchange(here, end);
  for (std::size_t i = 0; i < parts.size(); ++i) {
    std::uint32_t& here = at[i % kCoarse];
    here += std::exchange(parts[i], here);
  }
  return at;
}

/// Puts facets of one coarse cell in the order of its fine ones.
void order_finely(std::span<std::uint32_t> facets, std::span<const std::uint32_t> code, Buffer<std::uint32_t>& scratch) {
  std::array<std::uint32_t, kFine> next{};
  for (const std::uint32_t f : facets) ++next[code[f] % kFine];
  std::uint32_t end = 0;
  for (std::uint32_t& here : next) end += std::exchange(here, end);
  scratch.assign(facets.begin(), facets.end());
  for (const std::uint32_t f : scratch) facets[next[code[f] % kFine]++] = f;
}

/// The facets of a list by the cells of a grid in which their first corners lie, cells in Morton order, of one cell in the
/// order of the list.
///
/// bounds   of the list; no facet is lost where it is wrong
/// returns  numbers of facets; the same for any number of threads
/// cost     O(T), parallel; 8 bytes a triangle, 4 of them kept, and 2 MiB
Buffer<std::uint32_t> spatial_order(std::span<const Triangle> triangles, const Box& bounds) {
  const CubeCells cells(bounds);
  const auto from = [&](std::uint32_t part) { return triangles.size() * part / kParts; };
  Buffer<std::uint32_t> code(triangles.size()), next(std::size_t{kParts} * kCoarse), order(triangles.size());
  prefer_large_pages(code);
  prefer_large_pages(order);
  tbb::parallel_for(std::uint32_t{0}, kParts, [&](std::uint32_t part) {
    std::uint32_t* const in = next.data() + std::size_t{part} * kCoarse;
    std::fill(in, in + kCoarse, 0u);
    for (std::size_t i = from(part); i < from(part + 1); ++i) ++in[(code[i] = cells(triangles[i].a)) / kFine];
  });
  const Buffer<std::uint32_t> ends = begin_cells(next);
  tbb::parallel_for(std::uint32_t{0}, kParts, [&](std::uint32_t part) {
    std::uint32_t* const in = next.data() + std::size_t{part} * kCoarse;
    for (std::size_t i = from(part); i < from(part + 1); ++i) order[in[code[i] / kFine]++] = static_cast<std::uint32_t>(i);
  });
  tbb::parallel_for(tbb::blocked_range<std::uint32_t>(0, kCoarse, 256), [&](const auto& range) {
    Buffer<std::uint32_t> scratch;
    for (std::uint32_t c = range.begin(); c != range.end(); ++c) {
      const std::uint32_t begin = c == 0 ? 0 : ends[c - 1];
      if (ends[c] - begin > 1) order_finely({order.data() + begin, ends[c] - begin}, code, scratch);
    }
  });
  return order;
}

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

Numbered::Numbered(std::span<const Triangle> triangles, const Box& bounds) {
  Numbering numbering(triangles.size());
  if (in_disorder(triangles)) {
    order_ = spatial_order(triangles, bounds);
    std::vector<Buffer<Point3>> listed(numbering.chunks());
    numbering.read(triangles, order_, listed);
    numbering.join(*this);
  } else {
    Buffer<Point3> points(3 * triangles.size());  // of whose memory little is touched
    numbering.read(triangles, points.data(), [](Point3*, std::size_t) {});
    numbering.join(*this);
  }
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
    numbering.join(*this);
  } else {
    numbering.read(taken_, reinterpret_cast<Point3*>(taken_.data()),
                   [&](Point3* points_end, std::size_t end) { forget_pages(points_end, taken_.data() + end); });
    numbering.join(*this);
    if (!taken_.empty()) forget_pages(taken_.data(), end_of_list);
  }
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
