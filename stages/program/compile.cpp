#include "stages/program/compile.h"

#include <algorithm>
#include <array>
#include <bit>
#include <utility>

#include "stages/geometry/drop_rows.h"
#include "stages/program/lines.h"

namespace lamina::program {
namespace {

/// The swaths of a layer, and which of its lines the nozzles of a sweep fire.
class Swaths {
 public:
  explicit Swaths(const HeadGrid& grid) : grid_(grid), blocked_(grid.nozzles, false) {
    for (const std::uint32_t nozzle : grid.blocked) blocked_[nozzle] = true;
    stride_ = grid.swath_lines() - grid.overlap;
  }
  void begin(std::int64_t first_line, std::uint32_t layer) {
    first_ = first_line - static_cast<std::int64_t>(std::uint64_t{layer} * grid_.joint_shift % stride_);
    count_ = grid_.swaths(first_);
  }

  std::uint32_t count() const { return count_; }
  bool blocked(std::uint32_t nozzle) const { return blocked_[nozzle]; }
  std::int64_t first_line(std::uint32_t swath, std::uint32_t pass) const {
    return first_ + std::int64_t{swath} * stride_ + pass;
  }
  /// The first line of the bed that a swath comes over.
  std::uint32_t top() const { return static_cast<std::uint32_t>(std::max<std::int64_t>(first_, 0)); }

  /// Whether no swath can fire a line.
  bool dead(std::uint32_t line) const {
    const auto from_first = static_cast<std::uint32_t>(line - first_);
    const std::uint32_t swath = std::min(from_first / stride_, count_ - 1);
    const std::uint32_t own = from_first - swath * stride_;
    if (!nozzle_blocked(own)) return false;
    return swath == 0 || own >= grid_.overlap || nozzle_blocked(own + stride_);
  }
  /// Whether a neighbour of a dead line can fire its pixels.
  bool serves(std::int64_t neighbour) const {
    return neighbour >= top() && neighbour < grid_.lines && !dead(static_cast<std::uint32_t>(neighbour));
  }

  /// The line under a nozzle of a sweep, and what of it this swath fires.
  struct Share {
    bool any = false, divided = false, upper = false;
    std::uint32_t line = 0, of_64 = 64;
  };
  Share under(std::uint32_t swath, std::uint32_t pass, std::uint32_t i) const {
    const std::uint32_t own = pass + i * grid_.passes;  // line in the swath
    const std::int64_t over = first_line(swath, pass) + std::int64_t{i} * grid_.passes;
    if (over < 0 || over >= grid_.lines || blocked_[i]) return {};
    const auto number = static_cast<std::uint32_t>(over);
    const bool lower = swath > 0 && own < grid_.overlap, upper = swath + 1 < count_ && own >= stride_;
    if (!lower && !upper) return {true, false, false, number};
    if (nozzle_blocked(lower ? own + stride_ : own - stride_)) return {true, false, false, number};  // the other swath cannot
    const std::uint32_t position = lower ? own : own - stride_;
    return {true, true, upper, number, (grid_.overlap - position) * 64 / (grid_.overlap + 1)};
  }

  /// Of two swaths that share a line that neither can fire, the lower one sees to it.
  bool owns(std::uint32_t swath, std::uint32_t own) const { return swath + 1 == count_ || own < stride_; }

 private:
  bool nozzle_blocked(std::uint32_t line_in_swath) const { return blocked_[line_in_swath / grid_.passes]; }

  const HeadGrid& grid_;
  std::vector<bool> blocked_;
  std::int64_t first_ = 0;  // line of the first swath
  std::uint32_t stride_ = 0, count_ = 0;
};

/// Pixels of one drop, as runs.
class RunLines {
 public:
  RunLines(const HeadGrid& grid, const RunsView& image, CompileScratch& scratch) : grid_(grid), scratch_(scratch) {
    scratch.made_used = 0;
    const RunsView frame = to_scan_frame(grid, image, scratch.scan);
    scratch.line.resize(grid.lines);
    for (std::uint32_t l = 0; l < grid.lines; ++l) scratch.line[l] = frame.row(l);
    scratch.nozzle.assign(std::size_t{grid.nozzles} * grid.drop_bits, ColumnChanges());
  }

  std::uint32_t drops() const { return 1; }
  bool empty(std::uint32_t line, std::uint32_t) const { return scratch_.line[line].empty(); }

  /// Pixels of dead lines are left out, or moved to the line of the next nozzle where that is free.
  void resolve(const Swaths& swaths, ProgramCount& count) {
    const std::int64_t next = grid_.passes;
    for (std::uint32_t l = swaths.top(); l < grid_.lines; ++l) {
      if (scratch_.line[l].empty() || !swaths.dead(l)) continue;
      ColumnChanges left = scratch_.line[l];
      scratch_.line[l] = {};
      for (const std::int64_t neighbour : {l - next, l + next}) {
        if (grid_.blocked_rule != BlockedRule::kNeighbour || left.empty()) break;
        if (!swaths.serves(neighbour)) continue;
        ColumnChanges& target = scratch_.line[static_cast<std::size_t>(neighbour)];
        Buffer<std::uint32_t>& both = new_line();
        combine(target, left, LineOperation::kUnion, both);
        Buffer<std::uint32_t>& added = new_line();
        combine(left, target, LineOperation::kDifference, added);
        Buffer<std::uint32_t>& rest = new_line();  // was set in both
        combine(left, added, LineOperation::kDifference, rest);
        count.moved += pixels_of(added);
        target = both;
        left = rest;
      }
      count.lost += pixels_of(left);
    }
    kept_ = scratch_.made_used;
  }

  void begin_sweep() { scratch_.made_used = kept_; }
  /// What nozzle i has to fire.
  void load(std::uint32_t i, const Swaths::Share& share) {
    ColumnChanges& nozzle = scratch_.nozzle[i];
    nozzle = {};
    if (!share.any) return;
    nozzle = scratch_.line[share.line];
    if (!share.divided || nozzle.empty()) return;
    Buffer<std::uint32_t>& part = new_line();
    divide(nozzle, share.line, share.of_64, share.upper, part);
    nozzle = part;
  }
  bool fire_from(std::uint32_t, FiredDrops& fired) {
    if (!fire(grid_, scratch_.nozzle, scratch_.fire, scratch_.vectors)) return false;
    fired = {0, 1};
    for (const ColumnChanges& line : scratch_.nozzle) fired.drops += pixels_of(line);
    return true;
  }
  bool repeats(std::uint32_t, std::uint32_t) const { return false; }

 private:
  /// Another line, in a buffer that lives as long as the layer.
  Buffer<std::uint32_t>& new_line() {
    if (scratch_.made_used == scratch_.made.size()) scratch_.made.emplace_back();
    Buffer<std::uint32_t>& line = scratch_.made[scratch_.made_used++];
    line.clear();
    return line;
  }

  const HeadGrid& grid_;
  CompileScratch& scratch_;
  std::size_t kept_ = 0;  // made lines that are needed to the end of the layer
};

/// Pixels of the drops of a drop image.
class DropLines {
 public:
  DropLines(const HeadGrid& grid, const DropImageView& image, std::uint32_t drops, CompileScratch& scratch)
      : grid_(grid), scratch_(scratch), frame_(to_scan_frame(grid, image, scratch.scan)), drops_(drops) {
    scratch.own.clear();
    scratch.drop_nozzle.assign(grid.nozzles, DropLine());
    if (scratch.whole.zone.empty()) {
      for (std::uint32_t n = 0; n <= UINT8_MAX; ++n) scratch.whole.zone.push_back({static_cast<std::uint8_t>(n)});
    }
    std::array<bool, UINT8_MAX + 1> used{};
    for (const std::uint8_t level : frame_.zones.level) used[level] = true;
    for (std::size_t zone = 1; zone < frame_.patterns->zone.size(); ++zone) {
      if (used[zone]) used_.push_back(frame_.patterns->zone[zone]);
    }
  }

  std::uint32_t drops() const { return drops_; }
  /// Whether no pixel of a line gets more than so many drops.
  bool empty(std::uint32_t line, std::uint32_t drop) const {
    const DropLine of = line_of(line);
    for (std::size_t k = 0; 2 * k < of.change.size(); ++k) {
      const DropZone& zone = of.patterns->zone[of.zone[k]];
      if (zone.base > drop) return false;
      if (zone.base < drop || zone.extra == DropZone::Extra::kNone) continue;
      const std::uint32_t end = of.change[2 * k + 1];
      for (std::uint32_t at = of.change[2 * k]; at < end; at = (at / 64 + 1) * 64) {
        const std::uint64_t bits = extra_bits(*of.patterns, zone, of.row, at / 64) >> (at % 64);
        if (bits != 0 && at + static_cast<std::uint32_t>(std::countr_zero(bits)) < end) return false;
      }
    }
    return true;
  }

  /// As RunLines::resolve(), drop by drop of a pixel: a neighbour takes what it has less.
  void resolve(const Swaths& swaths, ProgramCount& count) {
    const std::int64_t next = grid_.passes;
    std::vector<std::uint8_t> left, target;
    for (std::uint32_t l = swaths.top(); l < grid_.lines; ++l) {
      if (line_of(l).change.empty() || !swaths.dead(l)) continue;
      expand(l, left);
      scratch_.own[l].start(grid_.positions);
      scratch_.own[l].end_row();
      for (const std::int64_t neighbour : {l - next, l + next}) {
        if (grid_.blocked_rule != BlockedRule::kNeighbour) break;
        if (!swaths.serves(neighbour)) continue;
        const auto number = static_cast<std::uint32_t>(neighbour);
        expand(number, target);
        for (std::size_t p = 0; p < left.size(); ++p) {
          const std::uint8_t both = std::min(left[p], target[p]);
          count.moved += left[p] - both;
          target[p] = std::max(left[p], target[p]);
          left[p] = both;
        }
        keep(number, target);
      }
      for (const std::uint8_t drops : left) count.lost += drops;
    }
  }

  void begin_sweep() {}
  void load(std::uint32_t i, const Swaths::Share& share) {
    DropLine& nozzle = scratch_.drop_nozzle[i];
    nozzle = share.any ? line_of(share.line) : DropLine();
    if (share.divided) nozzle.allowed = allowed_positions(share.line, share.of_64, share.upper);
  }
  bool fire_from(std::uint32_t first_drop, FiredDrops& fired) {
    return fire_drops(grid_, scratch_.drop_nozzle, first_drop, scratch_.drop, scratch_.vectors, fired);
  }
  /// Whether a sweep from one drop on fires what that from another one does, of the same lines.
  bool repeats(std::uint32_t drop, std::uint32_t before) const {
    return scratch_.own.empty() && std::ranges::all_of(used_, [&](const DropZone& zone) {
             const bool extra = zone.extra != DropZone::Extra::kNone;
             return drops_in_sweep(grid_, zone.base, drop) == drops_in_sweep(grid_, zone.base, before) &&
                    (!extra || drops_in_sweep(grid_, zone.base + 1u, drop) == drops_in_sweep(grid_, zone.base + 1u, before));
           });
  }

 private:
  static DropLine row_of(const LevelsView& zones, std::uint32_t row, const DropPatterns& patterns, std::uint32_t number) {
    const std::size_t first = zones.row_offset[row], runs = zones.row_offset[row + 1] - first;
    return {zones.change.subspan(2 * first, 2 * runs), zones.level.data() + first, &patterns, number};
  }
  DropLine line_of(std::uint32_t number) const {
    if (!scratch_.own.empty()) {
      if (const auto own = scratch_.own.find(number); own != scratch_.own.end())
        return row_of(own->second, 0, scratch_.whole, number);
    }
    return row_of(frame_.zones, number, *frame_.patterns, number);
  }
  /// The drops of each position of a line.
  void expand(std::uint32_t number, std::vector<std::uint8_t>& drops) const {
    const DropLine line = line_of(number);
    drops.assign(grid_.positions, 0);
    for (std::size_t k = 0; 2 * k < line.change.size(); ++k) {
      const DropZone& zone = line.patterns->zone[line.zone[k]];
      for (std::uint32_t p = line.change[2 * k]; p < line.change[2 * k + 1]; ++p) {
        const bool more = (extra_bits(*line.patterns, zone, number, p / 64) >> (p % 64) & 1) != 0;
        drops[p] = static_cast<std::uint8_t>(zone.base + (more ? 1 : 0));
      }
    }
  }
  void keep(std::uint32_t number, const std::vector<std::uint8_t>& drops) {
    Levels& own = scratch_.own[number];
    own.start(grid_.positions);
    for (std::uint32_t p = 0; p < grid_.positions; ++p) own.append(p, p + 1, drops[p]);
    own.end_row();
  }

  const HeadGrid& grid_;
  CompileScratch& scratch_;
  DropImageView frame_;
  std::uint32_t drops_;
  std::vector<DropZone> used_;  // zones with a pixel
};

/// One layer while it is compiled.
template <class Lines>
class LayerCompiler {
 public:
  LayerCompiler(const HeadGrid& grid, Lines lines, SweepVectors& vectors, const EmitSweep& emit, std::uint32_t layer)
      : grid_(grid), lines_(std::move(lines)), vectors_(vectors), emit_(emit), swaths_(grid) {
    std::int64_t first = 0;
    if (grid.first_swath == FirstSwath::kLayer) {
      while (first + 1 < grid.lines && lines_.empty(static_cast<std::uint32_t>(first), 0)) ++first;
    }
    swaths_.begin(first, layer);
  }

  Result<ProgramCount> run() {
    const std::uint32_t drops = lines_.drops();
    if (!grid_.blocked.empty() && grid_.blocked_rule != BlockedRule::kSecondPass) lines_.resolve(swaths_, count_);
    regular_ = further_ = swaths_.count() * grid_.passes * grid_.sweeps_for(drops);
    std::uint32_t number = 0;
    for (std::uint32_t swath = 0; swath < swaths_.count(); ++swath) {
      for (std::uint32_t pass = 0; pass < grid_.passes; ++pass) {
        lines_.begin_sweep();
        for (std::uint32_t i = 0; i < grid_.nozzles; ++i) lines_.load(i, swaths_.under(swath, pass, i));
        for (std::uint32_t first = 0; first < drops; first += grid_.sweep_drops) {
          Sweep sweep{number++, regular_, swath, pass, false, swaths_.first_line(swath, pass), first};
          sweep.repeated = first > 0 && lines_.repeats(first, first - grid_.sweep_drops);
          if (Status status = make(sweep); !status) return status.error();
        }
      }
      if (grid_.blocked_rule != BlockedRule::kSecondPass || grid_.blocked.empty()) continue;
      for (std::uint32_t first = 0; first < drops; first += grid_.sweep_drops) {
        if (Status status = further_sweeps(swath, first); !status) return status.error();
      }
    }
    return count_;
  }

 private:
  Status make(Sweep& sweep) {
    ++count_.sweeps;
    if (!sweep.repeated) fires_ = lines_.fire_from(sweep.drop, fired_);
    if (!fires_) {
      ++count_.skipped;
      return {};
    }
    sweep.backward = grid_.both_directions && backward_;
    backward_ = !backward_;
    // A sweep of all drops that the head has would have fired these with those before.
    const auto whole = [&](std::uint32_t drops) { return (drops + grid_.head_drops - 1) / grid_.head_drops; };
    sweep.drops = fired_.maximum;
    sweep.added = whole(sweep.drop + sweep.drops) == whole(sweep.drop);
    count_.added += sweep.added ? 1 : 0;
    count_.drops += fired_.drops;
    count_.vectors += pixels_of(vectors_.firing);
    return emit_(sweep, vectors_);
  }

  // The head shifted by d nozzles: nozzle j + d is where nozzle j was.
  Status further_sweeps(std::uint32_t swath, std::uint32_t first) {
    std::uint32_t further_pass = grid_.passes;
    for (std::uint32_t pass = 0; pass < grid_.passes; ++pass) {
      std::vector<std::uint32_t> waiting;
      for (const std::uint32_t j : grid_.blocked) {
        const std::int64_t over = swaths_.first_line(swath, pass) + std::int64_t{j} * grid_.passes;
        const auto own = static_cast<std::uint32_t>(over);
        if (over >= 0 && over < grid_.lines && !lines_.empty(own, first) && swaths_.dead(own) &&
            swaths_.owns(swath, pass + j * grid_.passes)) {
          waiting.push_back(j);
        }
      }
      for (std::int64_t d = 1; !waiting.empty(); d = d > 0 ? -d : 1 - d) {
        const auto served = [&](std::uint32_t j) {
          const std::int64_t other = j + d;
          return other >= 0 && other < grid_.nozzles && !swaths_.blocked(static_cast<std::uint32_t>(other));
        };
        if (std::ranges::none_of(waiting, served)) continue;
        lines_.begin_sweep();
        for (std::uint32_t i = 0; i < grid_.nozzles; ++i) {
          const std::int64_t j = i - d;
          const bool fires = !swaths_.blocked(i) && j >= 0 && std::ranges::binary_search(waiting, j);
          const std::int64_t line = swaths_.first_line(swath, pass) + j * grid_.passes;
          lines_.load(i, fires ? Swaths::Share{true, false, false, static_cast<std::uint32_t>(line)} : Swaths::Share());
        }
        std::erase_if(waiting, served);
        Sweep sweep{further_++, regular_, swath, further_pass++, false, swaths_.first_line(swath, pass) - d * grid_.passes,
                    first};
        if (Status status = make(sweep); !status) return status;
      }
    }
    return {};
  }

  const HeadGrid& grid_;
  Lines lines_;
  SweepVectors& vectors_;
  const EmitSweep& emit_;
  Swaths swaths_;
  std::uint32_t regular_ = 0, further_ = 0;
  bool backward_ = false, fires_ = false;
  FiredDrops fired_;  // of the last sweep
  ProgramCount count_;
};

}  // namespace

Result<ProgramCount> compile(const HeadGrid& grid, const RunsView& image, CompileScratch& scratch, const EmitSweep& emit,
                             std::uint32_t layer) {
  return LayerCompiler(grid, RunLines(grid, image, scratch), scratch.vectors, emit, layer).run();
}

Result<ProgramCount> compile(const HeadGrid& grid, const DropImageView& image, std::uint32_t drops, CompileScratch& scratch,
                             const EmitSweep& emit, std::uint32_t layer) {
  return LayerCompiler(grid, DropLines(grid, image, drops, scratch), scratch.vectors, emit, layer).run();
}

}  // namespace lamina::program
