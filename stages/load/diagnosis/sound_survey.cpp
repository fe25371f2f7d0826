#include "stages/load/diagnosis/sound_survey.h"

#include <tbb/enumerable_thread_specific.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <bit>
#include <mutex>
#include <numeric>
#include <tuple>
#include <utility>
#include <vector>

#include "stages/load/diagnosis/chunk_numbers.h"
#include "stages/load/diagnosis/diagnosed_shells.h"
#include "stages/load/reader.h"
#include "stages/load/repair/geometry.h"
#include "stages/load/repair/topology.h"

namespace lamina::load {
namespace {

constexpr std::uint32_t kChunk = Numbered::kChunk, kSides = 3 * kChunk;
constexpr int kShareBits = 7;
constexpr std::uint32_t kShares = 1 << kShareBits;  // of points and of sides, by their hashes

/// Grows by pages, so that nothing moves and little is left over.
template <class T>
class Pile {
 public:
  void push(const T& value) {
    if (used_ == kPage) pages_.push_back(std::make_unique_for_overwrite<T[]>(kPage)), used_ = 0;
    pages_.back()[used_++] = value;
  }
  std::size_t size() const { return pages_.size() * kPage - (kPage - used_); }
  /// Appends all to a list and gives the pages back.
  void move_to(std::vector<T>& list) {
    for (std::size_t p = 0; p < pages_.size(); ++p)
      list.insert(list.end(), pages_[p].get(), pages_[p].get() + (p + 1 < pages_.size() ? kPage : used_));
    pages_.clear();
    pages_.shrink_to_fit();
    used_ = kPage;
  }

 private:
  static constexpr std::size_t kPage = 8192 / sizeof(T);
  std::vector<std::unique_ptr<T[]>> pages_;
  std::size_t used_ = kPage;
};

/// A side of an edge on the rim of a chunk, or both sides of one that met within it.
struct RimSide {
  Point3 low, high;
  std::uint32_t of;  // kind, and from its third bit on the piece of one of the facets

  std::uint32_t kind() const { return of & 3; }
  std::uint32_t piece() const { return of >> 2; }
};
enum SideKind : std::uint32_t { kDown, kUp, kBoth };

/// Facets of a chunk that share edges, directly or through others.
struct ChunkPiece {
  Int128 sixfold_volume = 0;
  Box box;
  std::uint32_t facets = 0;
};

/// Facets that use a vertex twice, by their corners in order.
using Collapsed = std::array<Point3, 3>;

bool precedes(const Point3& p, const Point3& q) { return std::tie(p.x, p.y, p.z) < std::tie(q.x, q.y, q.z); }

std::uint64_t edge_hash(const Point3& low, const Point3& high) {
  return (point_hash(low) ^ std::rotl(point_hash(high), 23)) * 0x9e3779b97f4a7c15u;
}
std::uint32_t share_of(std::uint64_t hash) { return static_cast<std::uint32_t>(hash >> (64 - kShareBits)); }

// --- files in disorder.

/// A cube around a box in cells.
class SurveyCells {
 public:
  static constexpr std::uint32_t kBits = 3, kCount = 1u << 3 * kBits;  // along an axis; of all

  SurveyCells() = default;
  /// Points beyond the box go to the cells at its sides.
  explicit SurveyCells(const Box& box) : lo_(box.lo) {
    const auto side = static_cast<std::uint64_t>(std::max({box.width(), box.depth(), box.height(), std::int64_t{1}}));
    shift_ = std::max(static_cast<int>(std::bit_width(side)) - static_cast<int>(kBits), 0);
  }
  std::uint32_t operator()(const Point3& p) const {
    return along(p.x, lo_.x, shift_, kBits) << 2 * kBits | along(p.y, lo_.y, shift_, kBits) << kBits |
           along(p.z, lo_.z, shift_, kBits);
  }
  /// Of the cells that each cell is divided into in the same way, neighbours mostly near each other.
  std::uint32_t fine(const Point3& p) const {
    constexpr std::uint32_t kSpread[1 << kBits] = {0, 1, 8, 9, 64, 65, 72, 73};
    const int shift = std::max(shift_ - static_cast<int>(kBits), 0);
    const auto of = [&](Nm at, Nm lo) {
      return kSpread[static_cast<std::uint64_t>(std::int64_t{at} - lo) >> shift & ((1 << kBits) - 1)];
    };
    return of(p.x, lo_.x) << 2 | of(p.y, lo_.y) << 1 | of(p.z, lo_.z);
  }

 private:
  static std::uint32_t along(Nm at, Nm lo, int shift, std::uint32_t bits) {
    return static_cast<std::uint32_t>(std::clamp<std::int64_t>((std::int64_t{at} - lo) >> shift, 0, (1 << bits) - 1));
  }

  Point3 lo_{};
  int shift_ = 0;
};

// --- the edges of one chunk.

/// Matches the sides of a chunk, in memory that stays in a core's cache. Side k of facet f is side 3 f + k.
class ChunkSides {
 public:
  using Pair = std::array<std::uint16_t, 2>;

  /// returns  false: an edge has more than two sides, or two in the same direction
  bool match(std::span<const Numbered::Local> facets) {
    pairs_ = 0;
    std::uint32_t left = 0;
    for (std::uint32_t f = 0; f < facets.size(); ++f) {
      const auto& [a, b, c] = facets[f];
      key_[3 * f] = key_of(a, b), key_[3 * f + 1] = key_of(b, c), key_[3 * f + 2] = key_of(c, a);
      const bool collapsed = a == b || b == c || c == a;
      for (std::uint32_t k = 0; k < 3; ++k) {
        done_[3 * f + k] = collapsed ? 1 : 0;
        list_[left] = static_cast<std::uint16_t>(3 * f + k);
        left += collapsed ? 0 : 1;
      }
    }
    // Sides that met another edge's meet each other by another hash, as a rule in the second round.
    constexpr std::uint32_t kRounds = 8;
    std::uint32_t factor = 0x9e3779b1;
    for (std::uint32_t round = 0; left > 0; ++round, factor = factor * 0x85ebca77 | 1) {
      if (round == kRounds) return false;
      if (!match_once(left, factor)) return false;
    }
    return true;
  }

  /// The two sides of edges that have both.
  std::span<const Pair> pairs() const { return {pair_.data(), pairs_}; }
  bool is_single(std::uint32_t side) const { return done_[side] == 0; }
  std::uint32_t low(std::uint32_t side) const { return key_[side] >> (kEndBits + 1); }
  std::uint32_t high(std::uint32_t side) const { return key_[side] >> 1 & kEndMask; }
  bool goes_up(std::uint32_t side) const { return (key_[side] & 1) != 0; }

 private:
  static constexpr int kEndBits = 14, kSlotBits = 15;
  static constexpr std::uint32_t kEndMask = (1u << kEndBits) - 1;
  static_assert(kSides <= kEndMask + 1);

  static std::uint32_t key_of(std::uint32_t from, std::uint32_t to) {
    return std::min(from, to) << (kEndBits + 1) | std::max(from, to) << 1 | static_cast<std::uint32_t>(from < to);
  }

  /// All sides of an edge have one hash: they meet the first of them, or all of them are left, in list_.
  bool match_once(std::uint32_t& left, std::uint32_t factor) {
    const auto slot_of = [&](std::uint32_t i) { return (key_[i] >> 1) * factor >> (32 - kSlotBits); };
    for (std::uint32_t s = left; s-- > 0;) {
      const std::uint16_t i = list_[s];
      slot_[hash_[s] = static_cast<std::uint16_t>(slot_of(i))] = i;
    }
    const std::uint32_t first_pair = pairs_, sides = std::exchange(left, 0);
    for (std::uint32_t s = 0; s < sides; ++s) {
      const std::uint16_t i = list_[s], first = slot_[hash_[s]];
      const bool same = (key_[i] ^ key_[first]) <= 1;
      pair_[pairs_] = {first, i};
      pairs_ += std::uint32_t{same} & std::uint32_t{first != i};
      list_[left] = i;
      left += !same;
      if (pairs_ == pair_.size()) return false;
    }
    std::uint32_t wrong = 0;
    for (std::uint32_t p = first_pair; p < pairs_; ++p) {
      const auto [one, other] = pair_[p];
      wrong |= done_[one] | std::uint32_t{key_[one] == key_[other]};
      done_[one] = done_[other] = 1;
    }
    return wrong == 0;
  }

  std::array<std::uint32_t, kSides> key_;  // its lower and its higher end, and whether it is walked upwards
  std::array<std::uint16_t, kSides> list_, hash_;
  std::array<std::uint16_t, std::size_t{1} << kSlotBits> slot_;
  std::array<std::uint8_t, kSides> done_;
  std::array<Pair, kSides / 2 + 1> pair_;
  std::uint32_t pairs_ = 0;
};

// --- what a thread finds in its chunks.

/// All sides at a point met their others in the chunk; some did not; there is none, only facets that use a vertex twice.
enum PointKind : std::uint8_t { kInner, kRim, kLoose };
constexpr std::size_t kPointKinds = 3;

struct Worker {
  ChunkNumbers numbers;
  ChunkSides sides;
  std::array<Numbered::Local, kChunk> facets;
  std::array<Point3, kSides> points;
  std::array<std::uint8_t, kSides> point_kind;                       // of each point: PointKind
  std::array<std::uint16_t, kChunk> parent;                          // of each facet, in its piece
  std::array<std::uint32_t, kChunk> piece_of;                        // of each facet that is its own parent
  std::array<std::array<Pile<Point3>, kShares>, kPointKinds> piles;  // of points, by their hashes
  std::array<Pile<RimSide>, kShares> rim_sides;
  std::vector<std::pair<std::uint32_t, std::vector<ChunkPiece>>> pieces;  // with the number of the first
  std::vector<Collapsed> collapsed;
  std::vector<Pile<Triangle>> cells;  // of a file in disorder
  std::uint64_t edges = 0, triangles = 0;
  Box bounds;

  std::uint16_t root(std::uint16_t facet) {
    while (parent[facet] != facet) facet = parent[facet] = parent[parent[facet]];
    return facet;
  }
  bool inspect(std::span<const Triangle> list, std::uint32_t points_count, std::atomic<std::uint32_t>& next);
  void mark_rim(std::uint32_t count, std::uint32_t points_count);
  void list_collapsed(std::uint32_t count);
  void find_pieces(std::span<const Triangle> triangles, std::uint32_t points_count, std::atomic<std::uint32_t>& next);
  void list_points(std::uint32_t points_count);
  void list_sides(std::uint32_t count);
  void add_side(std::uint32_t side, std::uint32_t kind);
};

bool is_collapsed(const Numbered::Local& facet) { return facet[0] == facet[1] || facet[1] == facet[2] || facet[2] == facet[0]; }

void Worker::mark_rim(std::uint32_t count, std::uint32_t points_count) {
  std::fill_n(point_kind.begin(), points_count, kInner);
  for (std::uint32_t i = 0; i < 3 * count; ++i) {
    if (!sides.is_single(i)) [[likely]]
      continue;
    point_kind[sides.low(i)] = point_kind[sides.high(i)] = kRim;
  }
}

void Worker::list_collapsed(std::uint32_t count) {
  const std::size_t before_these = collapsed.size();
  for (std::uint32_t f = 0; f < count; ++f) {
    if (!is_collapsed(facets[f])) [[likely]]
      continue;
    Collapsed corners;
    for (std::size_t k = 0; k < 3; ++k) corners[k] = points[facets[f][k]];
    std::ranges::sort(corners, precedes);
    collapsed.push_back(corners);
  }
  if (collapsed.size() == before_these) return;
  std::vector<std::uint8_t> has_side(kSides, 0);
  for (std::uint32_t f = 0; f < count; ++f) {
    if (is_collapsed(facets[f])) continue;
    for (const std::uint16_t point : facets[f]) has_side[point] = 1;
  }
  for (std::uint32_t f = 0; f < count; ++f) {
    for (const std::uint16_t point : facets[f])
      if (has_side[point] == 0) point_kind[point] = kLoose;
  }
}

void Worker::find_pieces(std::span<const Triangle> list, std::uint32_t points_count, std::atomic<std::uint32_t>& next) {
  const auto count = static_cast<std::uint32_t>(list.size());
  std::iota(parent.begin(), parent.begin() + count, std::uint16_t{0});
  for (const auto& [one, other] : sides.pairs()) {
    const std::uint16_t f = one / 3, g = other / 3;
    if (parent[f] == parent[g]) continue;
    const std::uint16_t a = root(f), b = root(g);
    parent[std::max(a, b)] = std::min(a, b);
  }
  std::uint32_t own = 0;
  for (std::uint32_t f = 0; f < count; ++f) {
    parent[f] = parent[parent[f]];  // none is larger than its child: those before have their roots already
    if (parent[f] == f && !is_collapsed(facets[f])) piece_of[f] = own++;
  }
  const std::uint32_t first = next.fetch_add(own);
  std::vector<ChunkPiece>& found = pieces.emplace_back(first, std::vector<ChunkPiece>(own)).second;
  const Point3 origin{0, 0, 0};
  const bool whole = own == 1 && collapsed.empty();
  for (std::uint32_t f = 0; f < count; ++f) {
    if (is_collapsed(facets[f])) continue;
    ChunkPiece& piece = found[piece_of[parent[f]]];
    piece.sixfold_volume += sixfold_volume(list[f], origin);
    ++piece.facets;
    if (!whole)
      for (const Point3& corner : {list[f].a, list[f].b, list[f].c}) piece.box.add(corner);
  }
  Box box;
  for (std::uint32_t p = 0; p < points_count; ++p) box.add(points[p]);
  bounds.add(box);
  if (whole) found.front().box = box;
}

void Worker::list_points(std::uint32_t points_count) {
  for (std::uint32_t p = 0; p < points_count; ++p) piles[point_kind[p]][share_of(point_hash(points[p]))].push(points[p]);
}

void Worker::add_side(std::uint32_t side, std::uint32_t kind) {
  Point3 low = points[sides.low(side)], high = points[sides.high(side)];
  if (precedes(high, low)) std::swap(low, high), kind = kind == kBoth ? kBoth : kind ^ 1;
  const std::uint32_t piece = pieces.back().first + piece_of[parent[side / 3]];
  rim_sides[share_of(edge_hash(low, high))].push({low, high, piece << 2 | kind});
}

void Worker::list_sides(std::uint32_t count) {
  for (std::uint32_t i = 0; i < 3 * count; ++i)
    if (sides.is_single(i)) add_side(i, sides.goes_up(i) ? kUp : kDown);
  for (const auto& [one, other] : sides.pairs())
    if ((point_kind[sides.low(one)] & point_kind[sides.high(one)]) != 0) add_side(one, kBoth);
}

/// Of facets whose corners have numbers. returns  false: it is not sound
bool Worker::inspect(std::span<const Triangle> list, std::uint32_t points_count, std::atomic<std::uint32_t>& next) {
  const auto count = static_cast<std::uint32_t>(list.size());
  if (!sides.match({facets.data(), count})) return false;
  triangles += count;
  edges += sides.pairs().size();
  mark_rim(count, points_count);
  list_collapsed(count);
  find_pieces(list, points_count, next);
  list_points(points_count);
  list_sides(count);
  return true;
}

// --- shares of all chunks.

/// Finds equal ones among the entries of a share. Entries whose hashes meet are compared.
class EqualTable {
 public:
  explicit EqualTable(std::size_t entries)
      : slots_(std::bit_ceil(2 * entries + 2), 0u), shift_(65 - static_cast<int>(std::bit_width(slots_.size()))) {}
  /// returns  the number of the first entry that is equal, or its own. same(i)  whether entry i is
  template <class Same>
  std::uint32_t find(std::uint64_t hash, std::uint32_t own, const Same& same) {
    for (std::size_t at = hash << kShareBits >> shift_;; at = (at + 1) & (slots_.size() - 1)) {
      if (slots_[at] == 0) slots_[at] = own + 1;
      if (slots_[at] == own + 1 || same(slots_[at] - 1)) return slots_[at] - 1;
    }
  }

 private:
  std::vector<std::uint32_t> slots_;
  int shift_;  // the upper bits of a hash depend on all of it
};

using Workers = tbb::enumerable_thread_specific<std::unique_ptr<Worker>>;

/// How many vertices a share has. returns  nothing: one that is on no rim is another chunk's as well
std::optional<std::uint64_t> count_points(Workers& workers, std::uint32_t share) {
  std::vector<Point3> points;
  std::size_t all = 0;
  for (auto& worker : workers)
    for (const auto& pile : worker->piles) all += pile[share].size();
  points.reserve(all);
  std::array<std::size_t, kPointKinds> end{};
  for (std::size_t k = 0; k < kPointKinds; ++k) {
    for (auto& worker : workers) worker->piles[k][share].move_to(points);
    end[k] = points.size();
  }
  EqualTable table(points.size());
  std::uint64_t vertices = 0;
  for (std::uint32_t i = 0; i < points.size(); ++i) {
    const std::uint32_t first =
        table.find(point_hash(points[i]), i, [&](std::uint32_t other) { return points[other] == points[i]; });
    vertices += first == i;
    if (first != i && first < end[kInner] && i < end[kRim]) return std::nullopt;
  }
  return vertices;
}

/// How many edges between chunks a share has; joins pieces that they are of. returns  nothing: not all of them have two sides
std::optional<std::uint64_t> count_edges(Workers& workers, std::uint32_t share, DisjointSets& sets) {
  std::vector<RimSide> sides;
  std::size_t all = 0;
  for (auto& worker : workers) all += worker->rim_sides[share].size();
  sides.reserve(all);
  for (auto& worker : workers) worker->rim_sides[share].move_to(sides);
  EqualTable table(sides.size());
  std::vector<std::uint8_t> sides_of(sides.size(), 0);  // of the first: which kinds there are
  for (std::uint32_t i = 0; i < sides.size(); ++i) {
    const RimSide& side = sides[i];
    const std::uint32_t first = table.find(edge_hash(side.low, side.high), i, [&](std::uint32_t other) {
      return sides[other].low == side.low && sides[other].high == side.high;
    });
    const auto kinds = static_cast<std::uint8_t>(side.kind() == kBoth ? 1 << kUp | 1 << kDown : 1 << side.kind());
    if ((sides_of[first] & kinds) != 0) return std::nullopt;
    sides_of[first] |= kinds;
    if (first != i) sets.join(sides[first].piece(), side.piece());
  }
  std::uint64_t edges = 0;
  for (std::uint32_t i = 0; i < sides.size(); ++i) {
    if (sides_of[i] == 0) continue;
    if (sides_of[i] != (1 << kUp | 1 << kDown)) return std::nullopt;
    edges += sides[i].kind() != kBoth;
  }
  return edges;
}

}  // namespace

struct SoundSurvey::State {
  Workers workers{[] { return std::make_unique<Worker>(); }};
  std::atomic<std::uint32_t> pieces{0}, visited{0}, disordered{0};
  std::atomic<bool> failed{false}, scatters{false};
  std::mutex mutex;
  SurveyCells cells;  // set before `scatters` is
  std::vector<Worker*> scattered;  // those with cells; while these are inspected, workers may be added

  bool is_in_disorder(const Worker& worker, std::uint32_t points, std::size_t facets);
  void sort_finely(std::vector<Triangle>& list) const;
  void inspect_cell(std::uint32_t cell);
  std::optional<Diagnosis> finish();
  bool repeats_collapsed();
  std::vector<Shell> shells(DisjointSets& sets);
};

SoundSurvey::SoundSurvey() : state_(std::make_unique<State>()) {}
SoundSurvey::~SoundSurvey() = default;

/// Too many chunks are: facets are put into cells from here on.
bool SoundSurvey::State::is_in_disorder(const Worker& worker, std::uint32_t point_count, std::size_t facets) {
  constexpr std::uint32_t kFewChunks = 3;
  const std::uint32_t so_far = ++visited;
  if (2 * point_count <= 3 * facets || ++disordered <= kFewChunks + so_far / 4) return false;
  const std::lock_guard lock(mutex);
  if (scatters) return true;
  Box box;
  for (std::uint32_t p = 0; p < point_count; ++p) box.add(worker.points[p]);
  cells = SurveyCells(box);
  scatters = true;
  return true;
}

bool SoundSurvey::inspect(std::span<const Triangle> facets) {
  State& all = *state_;
  if (all.failed) return false;
  Worker& worker = *all.workers.local();
  if (!all.scatters) {
    const std::uint32_t points = worker.numbers.number(facets, worker.facets.data(), worker.points.data());
    if (!all.is_in_disorder(worker, points, facets.size())) {
      if (!worker.inspect(facets, points, all.pieces)) all.failed = true;
      return !all.failed;
    }
  }
  worker.cells.resize(SurveyCells::kCount);
  for (const Triangle& t : facets) worker.cells[all.cells(t.a)].push(t);
  return true;
}

/// A counting sort.
void SoundSurvey::State::sort_finely(std::vector<Triangle>& list) const {
  std::array<std::uint32_t, SurveyCells::kCount> position{};
  for (const Triangle& t : list) ++position[cells.fine(t.a)];
  std::uint32_t total = 0;
  for (std::uint32_t& of : position) total += std::exchange(of, total);
  std::vector<Triangle> sorted(list.size());
  for (const Triangle& t : list) sorted[position[cells.fine(t.a)]++] = t;
  list.swap(sorted);
}

/// Those of a large cell in the order of finer ones, chunk by chunk.
void SoundSurvey::State::inspect_cell(std::uint32_t cell) {
  std::vector<Triangle> list;
  std::size_t count = 0;
  for (const Worker* of : scattered) count += of->cells[cell].size();
  list.reserve(count);
  for (Worker* of : scattered) of->cells[cell].move_to(list);
  if (list.size() > kChunk) sort_finely(list);
  Worker& worker = *workers.local();
  for (std::size_t first = 0; first < list.size() && !failed; first += kChunk) {
    const auto chunk = std::span<const Triangle>(list).subspan(first, std::min<std::size_t>(kChunk, list.size() - first));
    const std::uint32_t points = worker.numbers.number(chunk, worker.facets.data(), worker.points.data());
    if (!worker.inspect(chunk, points, pieces)) failed = true;
  }
}

std::optional<Diagnosis> SoundSurvey::finish() { return state_->failed ? std::nullopt : state_->finish(); }

bool SoundSurvey::State::repeats_collapsed() {
  std::vector<Collapsed> all;
  for (auto& worker : workers) all.insert(all.end(), worker->collapsed.begin(), worker->collapsed.end());
  std::ranges::sort(all, [](const Collapsed& one, const Collapsed& other) {
    return std::ranges::lexicographical_compare(one, other, precedes);
  });
  return std::ranges::adjacent_find(all) != all.end();
}

/// In no order; the same for any number of threads but for it.
std::vector<Shell> SoundSurvey::State::shells(DisjointSets& sets) {
  std::vector<ChunkPiece> of_root(pieces);
  for (auto& worker : workers) {
    for (const auto& [first, found] : worker->pieces) {
      for (std::uint32_t i = 0; i < found.size(); ++i) {
        ChunkPiece& root = of_root[sets.find(first + i)];
        root.sixfold_volume += found[i].sixfold_volume;
        root.box.add(found[i].box);
        root.facets += found[i].facets;
      }
    }
  }
  std::vector<Shell> result;
  for (const ChunkPiece& piece : of_root) {
    if (piece.facets == 0) continue;
    if (piece.facets == 2) return {};
    result.push_back({piece.sixfold_volume, piece.box, true});
  }
  return result;
}

std::optional<Diagnosis> SoundSurvey::State::finish() {
  if (scatters) {
    for (auto& worker : workers)
      if (!worker->cells.empty()) scattered.push_back(worker.get());
    tbb::parallel_for(std::uint32_t{0}, SurveyCells::kCount, [&](std::uint32_t cell) { inspect_cell(cell); });
  }
  if (failed || repeats_collapsed()) return std::nullopt;
  DisjointSets sets(pieces);
  std::atomic<std::uint64_t> vertices{0}, edges{0};
  tbb::parallel_for(std::uint32_t{0}, kShares, [&](std::uint32_t share) {
    if (failed) return;
    const auto points = count_points(workers, share);
    const auto between = points ? count_edges(workers, share, sets) : std::nullopt;
    if (!between) failed = true;
    vertices += points.value_or(0);
    edges += between.value_or(0);
  });
  if (failed) return std::nullopt;
  Diagnosis result;
  result.balanced = true;
  result.vertices = vertices;
  result.edges = edges;
  for (auto& worker : workers) {
    result.triangles += worker->triangles;
    result.edges += worker->edges;
    result.bounds.add(worker->bounds);
  }
  const std::vector<Shell> found = shells(sets);
  Int128 volume = 0;
  for (const Shell& shell : found) volume += shell.volume;
  result.volume_mm3 = static_cast<double>(volume) / 6e18;
  const Box& box = result.bounds;
  if (found.empty() || result.volume_mm3 <= kHardlyAny * mm(box.width()) * mm(box.depth()) * mm(box.height()))
    return std::nullopt;
  describe_shells(found, result);
  return result.inverted_shells == 0 ? std::optional(std::move(result)) : std::nullopt;
}

}  // namespace lamina::load
