#include "stages/program/compile.h"

#include <algorithm>

#include "stages/program/lines.h"

namespace lamina::program {
namespace {

/// One layer while it is compiled.
class LayerCompiler {
 public:
  LayerCompiler(const HeadGrid& grid, std::span<const RunsView> planes, CompileScratch& scratch, const EmitSweep& emit,
                std::uint32_t layer)
      : grid_(grid),
        scratch_(scratch),
        emit_(emit),
        blocked_(grid.nozzles, false),
        planes_(static_cast<std::uint32_t>(planes.size())) {
    for (const std::uint32_t nozzle : grid.blocked) blocked_[nozzle] = true;
    scratch.made_used = 0;
    if (scratch.scan.size() < planes.size()) scratch.scan.resize(planes.size());
    scratch.line.resize(std::size_t{grid.lines} * planes.size());
    for (std::uint32_t p = 0; p < planes_; ++p) {
      const RunsView frame = to_scan_frame(grid, planes[p], scratch.scan[p]);
      for (std::uint32_t l = 0; l < grid.lines; ++l) scratch.line[std::size_t{p} * grid.lines + l] = frame.row(l);
    }
    scratch.nozzle.assign(std::size_t{grid.nozzles} * grid.drop_bits, ColumnChanges());
    fired_.resize(grid.sweep_drops);
    if (grid.first_swath == FirstSwath::kLayer) {
      while (first_ + 1 < grid.lines && scratch.line[static_cast<std::size_t>(first_)].empty()) ++first_;
    }
    stride_ = grid.swath_lines() - grid.overlap;
    first_ -= static_cast<std::int64_t>(std::uint64_t{layer} * grid.joint_shift % stride_);
    swaths_ = grid.swaths(first_);
  }

  Result<ProgramCount> run() {
    for (plane_ = 0; plane_ < planes_; ++plane_) {
      if (!grid_.blocked.empty() && grid_.blocked_rule != BlockedRule::kSecondPass) resolve_dead_lines();
    }
    kept_ = scratch_.made_used;
    regular_ = further_ = swaths_ * grid_.passes * grid_.sweeps_for(planes_);
    std::uint32_t number = 0;
    for (std::uint32_t swath = 0; swath < swaths_; ++swath) {
      for (std::uint32_t pass = 0; pass < grid_.passes; ++pass) {
        for (first_drop_ = 0; first_drop_ < planes_; first_drop_ += grid_.sweep_drops) {
          scratch_.made_used = kept_;
          Sweep sweep{number++, regular_, swath, pass, false, first_line(swath, pass), first_drop_};
          load([&](std::uint32_t i) { return under(swath, pass, i); });
          if (Status status = make(sweep); !status) return status.error();
        }
      }
      if (grid_.blocked_rule != BlockedRule::kSecondPass || grid_.blocked.empty()) continue;
      for (first_drop_ = 0; first_drop_ < planes_; first_drop_ += grid_.sweep_drops) {
        if (Status status = further_sweeps(swath); !status) return status.error();
      }
    }
    return count_;
  }

 private:
  std::int64_t first_line(std::uint32_t swath, std::uint32_t pass) const {
    return first_ + std::int64_t{swath} * stride_ + pass;
  }

  /// The first line of the bed that a swath comes over.
  std::uint32_t top() const { return static_cast<std::uint32_t>(std::max<std::int64_t>(first_, 0)); }

  /// A line of the plane at hand.
  ColumnChanges& line(std::uint32_t number) { return scratch_.line[std::size_t{plane_} * grid_.lines + number]; }

  /// Another line, in a buffer that lives as long as the layer.
  Buffer<std::uint32_t>& new_line() {
    if (scratch_.made_used == scratch_.made.size()) scratch_.made.emplace_back();
    Buffer<std::uint32_t>& line = scratch_.made[scratch_.made_used++];
    line.clear();
    return line;
  }

  bool nozzle_blocked(std::uint32_t line_in_swath) const { return blocked_[line_in_swath / grid_.passes]; }

  /// Whether no swath can fire a line.
  bool dead(std::uint32_t line) const {
    const auto from_first = static_cast<std::uint32_t>(line - first_);
    const std::uint32_t swath = std::min(from_first / stride_, swaths_ - 1);
    const std::uint32_t own = from_first - swath * stride_;
    if (!nozzle_blocked(own)) return false;
    return swath == 0 || own >= grid_.overlap || nozzle_blocked(own + stride_);
  }

  /// What nozzle i of a sweep has to fire.
  ColumnChanges under(std::uint32_t swath, std::uint32_t pass, std::uint32_t i) {
    const std::uint32_t own = pass + i * grid_.passes;  // line in the swath
    const std::int64_t over = first_line(swath, pass) + std::int64_t{i} * grid_.passes;
    if (over < 0 || over >= grid_.lines || blocked_[i]) return {};
    const auto number = static_cast<std::uint32_t>(over);
    const ColumnChanges whole = line(number);
    const bool lower = swath > 0 && own < grid_.overlap, upper = swath + 1 < swaths_ && own >= stride_;
    if (whole.empty() || (!lower && !upper)) return whole;
    if (nozzle_blocked(lower ? own + stride_ : own - stride_)) return whole;  // the other swath cannot
    const std::uint32_t position = lower ? own : own - stride_;
    const std::uint32_t share = (grid_.overlap - position) * 64 / (grid_.overlap + 1);
    Buffer<std::uint32_t>& part = new_line();
    divide(whole, number, share, upper, part);
    return part;
  }

  /// Gives each nozzle the drops that a sweep fires. under(nozzle)  its line in the plane at hand
  template <class Under>
  void load(const Under& under) {
    plane_ = first_drop_;
    max_here_ = 1;
    if (grid_.drop_bits == 1) {
      for (std::uint32_t i = 0; i < grid_.nozzles; ++i) scratch_.nozzle[i] = under(i);
      return;
    }
    const std::uint32_t end = std::min(planes_, first_drop_ + grid_.sweep_drops);
    scratch_.bits.begin(grid_.drop_bits);
    for (std::uint32_t i = 0; i < grid_.nozzles; ++i) {
      std::uint32_t drops = 0;
      for (plane_ = first_drop_; plane_ < end && !(fired_[drops] = under(i)).empty(); ++plane_) ++drops;
      scratch_.bits.add({fired_.data(), drops});
      max_here_ = std::max(max_here_, drops);
    }
    scratch_.bits.end(scratch_.nozzle);
    plane_ = first_drop_;
  }

  Status make(Sweep& sweep) {
    ++count_.sweeps;
    if (!fire(grid_, scratch_.nozzle, scratch_.fire, scratch_.vectors)) {
      ++count_.skipped;
      return {};
    }
    sweep.backward = grid_.both_directions && backward_;
    backward_ = !backward_;
    // A sweep of all drops that the head has would have fired these with those before.
    const auto whole = [&](std::uint32_t drops) { return (drops + grid_.head_drops - 1) / grid_.head_drops; };
    sweep.drops = max_here_;
    sweep.added = whole(first_drop_ + max_here_) == whole(first_drop_);
    count_.added += sweep.added ? 1 : 0;
    for (std::size_t i = 0; i < scratch_.nozzle.size(); ++i) {
      count_.drops += pixels_of(scratch_.nozzle[i]) << (i / grid_.nozzles);
    }
    const SweepVectors& vectors = scratch_.vectors;
    count_.vectors += pixels_of(vectors.firing);
    return emit_(sweep, vectors);
  }

  // Left out, or moved to the line of the next nozzle where that is free.
  void resolve_dead_lines() {
    const std::int64_t next = grid_.passes;
    for (std::uint32_t l = top(); l < grid_.lines; ++l) {
      if (line(l).empty() || !dead(l)) continue;
      ColumnChanges left = line(l);
      line(l) = {};
      for (const std::int64_t neighbour : {l - next, l + next}) {
        if (grid_.blocked_rule != BlockedRule::kNeighbour || left.empty()) break;
        if (neighbour < top() || neighbour >= grid_.lines || dead(static_cast<std::uint32_t>(neighbour))) continue;
        ColumnChanges& target = line(static_cast<std::uint32_t>(neighbour));
        Buffer<std::uint32_t>& both = new_line();
        combine(target, left, LineOperation::kUnion, both);
        Buffer<std::uint32_t>& added = new_line();
        combine(left, target, LineOperation::kDifference, added);
        Buffer<std::uint32_t>& rest = new_line();  // was set in both
        combine(left, added, LineOperation::kDifference, rest);
        count_.moved += pixels_of(added);
        target = both;
        left = rest;
      }
      count_.lost += pixels_of(left);
    }
  }

  // The head shifted by d nozzles: nozzle j + d is where nozzle j was.
  Status further_sweeps(std::uint32_t swath) {
    plane_ = first_drop_;
    std::uint32_t further_pass = grid_.passes;
    for (std::uint32_t pass = 0; pass < grid_.passes; ++pass) {
      std::vector<std::uint32_t> waiting;
      for (const std::uint32_t j : grid_.blocked) {
        const std::int64_t over = first_line(swath, pass) + std::int64_t{j} * grid_.passes;
        const auto own = static_cast<std::uint32_t>(over);
        if (over >= 0 && over < grid_.lines && !line(own).empty() && dead(own) && owns(swath, pass + j * grid_.passes)) {
          waiting.push_back(j);
        }
      }
      for (std::int64_t d = 1; !waiting.empty(); d = d > 0 ? -d : 1 - d) {
        const auto served = [&](std::uint32_t j) {
          const std::int64_t other = j + d;
          return other >= 0 && other < grid_.nozzles && !blocked_[static_cast<std::size_t>(other)];
        };
        if (std::ranges::none_of(waiting, served)) continue;
        load([&](std::uint32_t i) -> ColumnChanges {
          const std::int64_t j = i - d;
          if (blocked_[i] || j < 0 || !std::ranges::binary_search(waiting, j)) return {};
          return line(static_cast<std::uint32_t>(first_line(swath, pass) + j * grid_.passes));
        });
        std::erase_if(waiting, served);
        Sweep sweep{further_++, regular_, swath, further_pass++, false, first_line(swath, pass) - d * grid_.passes,
                    first_drop_};
        if (Status status = make(sweep); !status) return status;
      }
    }
    return {};
  }

  /// Of two swaths that share a line that neither can fire, the lower one sees to it.
  bool owns(std::uint32_t swath, std::uint32_t own) const { return swath + 1 == swaths_ || own < stride_; }

  const HeadGrid& grid_;
  CompileScratch& scratch_;
  const EmitSweep& emit_;
  std::vector<bool> blocked_;
  std::uint32_t planes_, plane_ = 0, first_drop_ = 0, max_here_ = 1;
  std::vector<ColumnChanges> fired_;  // of a nozzle, drop after drop
  std::int64_t first_ = 0;            // line of the first swath
  std::uint32_t stride_ = 0, swaths_ = 0, regular_ = 0, further_ = 0;
  std::size_t kept_ = 0;  // made lines that are needed to the end of the layer
  bool backward_ = false;
  ProgramCount count_;
};

}  // namespace

Result<ProgramCount> compile(const HeadGrid& grid, const RunsView& image, CompileScratch& scratch, const EmitSweep& emit,
                             std::uint32_t layer) {
  return compile(grid, {&image, 1}, scratch, emit, layer);
}

Result<ProgramCount> compile(const HeadGrid& grid, std::span<const RunsView> planes, CompileScratch& scratch,
                             const EmitSweep& emit, std::uint32_t layer) {
  return LayerCompiler(grid, planes, scratch, emit, layer).run();
}

}  // namespace lamina::program
