#include "pipeline/pores/bead_voxels.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "pipeline/machine/profiles.h"
#include "stages/pores/registration.h"
#include "stages/raster/beads.h"
#include "stages/support/text/readable.h"

namespace lamina::pipeline {
namespace {

/// The shipped printer of that name. errors  those of find_extruder
Result<std::optional<ExtruderProfile>> shipped_extruder_named(const std::string& name) {
  for (const ShippedProfile& shipped : shipped_extruders()) {
    Result<ExtruderProfile> profile = find_extruder(std::string(shipped.name));
    if (!profile) return profile.error();
    if (profile->machine.name == name) return std::optional<ExtruderProfile>(std::move(*profile));
  }
  return std::optional<ExtruderProfile>();
}

/// "500 mm/s2", and whether the file commands it.
std::string acceleration_text(const formats::GcodeFile& file, const Extruder& machine) {
  const auto& [low, high] = file.accelerations();
  if (!(high > 0)) return fmt::format("{:g} mm/s2", machine.speed.acceleration_mm_s2);
  return low == high ? fmt::format("{:g} mm/s2 as commanded", low) : fmt::format("{:g} to {:g} mm/s2 as commanded", low, high);
}

bead::DepositionRules rules_of(const Extruder& machine) {
  bead::DepositionRules rules;
  rules.machine.tau_s = machine.material.lag_s;
  rules.machine.acceleration_mm_s2 = machine.speed.acceleration_mm_s2;
  rules.corner_mm_s = machine.speed.corner_mm_s;
  rules.feed_ratio = machine.material.feed_ratio;
  rules.usual_mm_s = machine.speed.print_mm_s;
  return rules;
}

constexpr std::int64_t kMinLayer = 1000;  // nm: what is thinner is none

/// The width of a bead at a height above the middle of its layer, nm; 0 where it is not.
Nm width_at(Nm width, std::int64_t height, double above) {
  const double round = static_cast<double>(std::min<std::int64_t>(width, height)), half = round / 2;
  if (std::abs(above) >= half) return 0;
  return static_cast<Nm>(std::lround(static_cast<double>(width) - round + 2 * std::sqrt(half * half - above * above)));
}

bool is_near(const Box& box, Point2 from, Point2 to, std::int64_t reach) {
  return std::max(from.x, to.x) + reach >= box.lo.x && std::min(from.x, to.x) - reach <= box.hi.x &&
         std::max(from.y, to.y) + reach >= box.lo.y && std::min(from.y, to.y) - reach <= box.hi.y;
}

/// Whether a straight way comes so near to the box, also where it passes aslant.
bool passes_near(const Box& box, Point2 from, Point2 to, std::int64_t reach) {
  if (!is_near(box, from, to, reach)) return false;
  const double x = mm(to.x) - mm(from.x), y = mm(to.y) - mm(from.y), length = std::hypot(x, y);
  const double from_middle_x = (mm(box.lo.x) + mm(box.hi.x)) / 2 - mm(from.x);
  const double from_middle_y = (mm(box.lo.y) + mm(box.hi.y)) / 2 - mm(from.y);
  const double aside = std::abs(x * from_middle_y - y * from_middle_x);
  return aside <= std::abs(y) * mm(box.width()) / 2 + std::abs(x) * mm(box.depth()) / 2 + length * mm(reach);
}

/// Whether a piece continues where the previous one ended, in another direction.
bool bends(const bead::DepositedPiece& before, const bead::DepositedPiece& piece) {
  if (before.to != piece.from) return false;
  const double ax = (mm(before.to.x) - mm(before.from.x)), ay = (mm(before.to.y) - mm(before.from.y));
  const double bx = (mm(piece.to.x) - mm(piece.from.x)), by = (mm(piece.to.y) - mm(piece.from.y));
  return std::abs(ax * by - ay * bx) > 1e-3 * std::hypot(ax, ay) * std::hypot(bx, by);
}

/// Beads of one layer become slices.
class SliceCutter {
 public:
  SliceCutter(const Window& window)
      : origin_{window.box.lo.x, window.box.lo.y},
        raster_({PixelAxis(window.count[0], window.box.width(), window.box.width()),
                 PixelAxis(window.count[1], window.box.depth(), window.box.depth())}) {}

  void clear() { raster_.clear(); }
  /// above  nm, of the slice, over the middle of the layer
  void add(const DepositedBead& bead, std::int64_t height, double above) {
    const Nm width = width_at(bead.width, height, above);
    if (width > 0) raster_.add(at(bead.from), at(bead.to), width, raster::BeadEnds::kRound);
  }
  void add(const bead::DepositedPiece& piece, const bead::PieceSides& sides, std::int64_t height, double above) {
    const double height_mm = mm(height), above_mm = above * 1e-6;
    const double left = bead::reach_at(piece, sides.left, height_mm, above_mm);
    const double right = bead::reach_at(piece, sides.right, height_mm, above_mm);
    const double from = left >= 0 ? left : 0, to = right >= 0 ? -right : 0;  // leftward of the line
    const auto width = static_cast<Nm>(std::llround((from - to) * 1e6));
    if (width <= 0) return;
    const double x = (mm(piece.to.x) - mm(piece.from.x)), y = (mm(piece.to.y) - mm(piece.from.y)), length = std::hypot(x, y);
    if (!(length > 0)) return;
    // Rounded ends of pieces aslant leave gaps of a nanometre: each reaches a little into the next.
    const double aside = (from + to) / 2 * 1e6 / length, further = 3 / length;
    const auto moved = [&](Point2 p, double sign) {
      return at({static_cast<Nm>(std::llround(p.x - y * aside + sign * x * further)),
                 static_cast<Nm>(std::llround(p.y + x * aside + sign * y * further))});
    };
    raster_.add(moved(piece.from, -1), moved(piece.to, 1), width, raster::BeadEnds::kSquare);
  }
  /// What lies outside of a bend, as wide as the bead behind it.
  void round_off(const bead::DepositedPiece& piece, const bead::PieceSides& sides, std::int64_t height, double above) {
    const double reach = std::min(bead::reach_at(piece, sides.left, mm(height), above * 1e-6),
                                  bead::reach_at(piece, sides.right, mm(height), above * 1e-6));
    const auto width = static_cast<Nm>(std::llround(2e6 * reach));
    if (width > 0) raster_.add(at(piece.from), at(piece.from), width, raster::BeadEnds::kRound);
  }
  const Runs& cut() {
    raster_.runs(image_);
    // Images begin at the back of the bed, windows in front.
    upright_.columns = image_.columns;
    upright_.row_offset.assign(1, 0);
    upright_.change.clear();
    for (std::uint32_t r = image_.view().rows(); r-- > 0;) {
      const auto row = image_.view().row(r);
      upright_.change.insert(upright_.change.end(), row.begin(), row.end());
      upright_.row_offset.push_back(static_cast<std::uint32_t>(upright_.change.size()));
    }
    return upright_;
  }

 private:
  Point2 at(Point2 p) const { return {p.x - origin_.x, p.y - origin_.y}; }

  Point2 origin_;
  raster::BeadRaster raster_;
  Runs image_, upright_;
};

/// The beads of one layer, or the pieces that they come to lie as.
class LayerBeads {
 public:
  LayerBeads(const Window& window, const bead::DepositionRules* rules) : window_(window) {
    if (rules != nullptr) rules_ = *rules;
  }

  Status read(const formats::GcodeFile& file, const Pile::PileLayer& layer) {
    Result<formats::GcodeLayer> found = file.layer(layer.index, rules_.has_value());
    if (!found) return found.error();
    beads_ = std::move(found->beads);
    height_ = layer.high - layer.low;
    if (!rules_) {
      std::erase_if(beads_, [&](const DepositedBead& b) { return !is_near(window_.box, b.from, b.to, b.width); });
      return {};
    }
    keep_lines(found->feeds);
    rules_->height_mm = mm(height_);
    rules_->within = window_.box;
    rules_->within.add(Point3{window_.box.lo.x - kNeighbours, window_.box.lo.y - kNeighbours, window_.box.lo.z});
    rules_->within.add(Point3{window_.box.hi.x + kNeighbours, window_.box.hi.y + kNeighbours, window_.box.lo.z});
    bead::deposit(beads_, found->feeds, *rules_, pieces_);
    const double area_mm2 = mm(rules_->within.width()) * mm(rules_->within.depth());
    if (static_cast<double>(pieces_.size()) * rules_->piece_mm > kMaxLineDensity * area_mm2)
      return Error{Fault::kInput,
                   fmt::format("layer {}: beads overlap many times; analyse them with --beads stated", layer.index)};
    left_out_mm3_ += bead::flow_along(pieces_, rules_->height_mm, sides_);
    for (const bead::DepositedPiece& p : pieces_)
      deposited_mm3_ += p.area_mm2 * std::hypot((mm(p.to.x) - mm(p.from.x)), (mm(p.to.y) - mm(p.from.y)));
    return {};
  }

  void cut(double above, SliceCutter& cutter) const {
    if (!rules_)
      for (const DepositedBead& bead : beads_) cutter.add(bead, height_, above);
    else
      for (std::size_t i = 0; i < pieces_.size(); ++i) {
        cutter.add(pieces_[i], sides_[i], height_, above);
        if (i > 0 && bends(pieces_[i - 1], pieces_[i])) cutter.round_off(pieces_[i], sides_[i], height_, above);
      }
  }

  double left_out() const { return deposited_mm3_ > 0 ? left_out_mm3_ / deposited_mm3_ : 0; }

 private:
  static constexpr Nm kNeighbours = 2'000'000;   // nm: what may push those that reach into the window
  static constexpr double kMaxLineDensity = 50;  // mm of line a mm2: fifty lines a millimetre

  /// nm: what the melt and the head have forgotten does not count
  std::int64_t memory(std::span<const BeadFeed> feeds) const {
    double fastest = rules_->usual_mm_s;
    bead::BeadMachine machine = rules_->machine;
    for (const BeadFeed& feed : feeds) {
      fastest = std::max(fastest, feed.speed_mm_s);
      if (feed.acceleration_mm_s2 > 0)
        machine.acceleration_mm_s2 = std::min(machine.acceleration_mm_s2, feed.acceleration_mm_s2);
    }
    const double way = fastest * fastest / (2 * machine.acceleration_mm_s2) + 5 * machine.tau_s * fastest;
    return static_cast<std::int64_t>(1e6 * std::clamp(way, 10.0, 200.0));
  }

  /// Beads far from the window, also along the line, deposit nothing there, and the melt stores nothing of them.
  void keep_lines(Buffer<BeadFeed>& feeds) {
    const std::int64_t reach = memory(feeds);
    keep_.assign(beads_.size(), false);
    std::int64_t back = 0;  // nm: how far the melt remembers from a bead that is near
    for (std::size_t i = beads_.size(); i-- > 0;) {
      const DepositedBead& bead = beads_[i];
      const bool near = passes_near(window_.box, bead.from, bead.to, reach);
      keep_[i] = near || back > 0;
      const double length =
          std::hypot(static_cast<double>(bead.to.x) - bead.from.x, static_cast<double>(bead.to.y) - bead.from.y);
      back = near ? reach : back - std::llround(length);
    }
    std::size_t kept = 0;
    for (std::size_t i = 0; i < beads_.size(); ++i) {
      if (!keep_[i]) continue;
      feeds[kept] = feeds[i];
      feeds[kept].joined = feeds[i].joined && i > 0 && keep_[i - 1];
      beads_[kept++] = beads_[i];
    }
    beads_.resize(kept);
    feeds.resize(kept);
  }

  const Window& window_;
  std::optional<bead::DepositionRules> rules_;
  Buffer<DepositedBead> beads_;
  std::vector<bool> keep_;
  Buffer<bead::DepositedPiece> pieces_;
  Buffer<bead::PieceSides> sides_;
  std::int64_t height_ = 1;
  double deposited_mm3_ = 0, left_out_mm3_ = 0;  // of all layers that were read
};

}  // namespace

Result<BeadRules> bead_rules(const formats::GcodeFile& file, const std::string& beads, const std::string& machine) {
  if (!beads.empty() && beads != "deposited" && beads != "spread" && beads != "stated")
    return Error{Fault::kUsage,
                 fmt::format("--beads: unknown model '{}'; must be deposited, spread or stated", one_line(beads))};
  const std::string reported =
      file.states_widths() ? "widths are those that the file states" : "widths are those of the fed volume";
  if (beads == "stated" && !machine.empty())
    return Error{Fault::kUsage, "--machine has no effect with --beads stated; remove one"};
  std::optional<ExtruderProfile> printer;
  if (!machine.empty()) {
    Result<ExtruderProfile> profile = find_extruder(machine);
    if (!profile) return profile.error();
    printer = std::move(*profile);
  } else if (!file.machine().empty()) {
    Result<std::optional<ExtruderProfile>> named = shipped_extruder_named(file.machine());
    if (!named) return named.error();
    printer = std::move(*named);
  }
  if (beads == "stated") {
    BeadRules stated{std::nullopt, reported};
    // A file of lamina states the widths of segmented lines that the calibration gave it.
    if (printer && file.states_widths()) {
      if (auto warning = calibration_warning(*printer)) stated.warnings.push_back(std::move(*warning));
    }
    return stated;
  }
  if (printer) {
    const Extruder& known = printer->machine;
    BeadRules found{rules_of(known), fmt::format("widths are those that {} deposits: lag {:g} s, {}", known.name,
                                                 known.material.lag_s, acceleration_text(file, known))};
    found.rules->spread = beads != "deposited";
    found.depends_on_acceleration = known.material.lag_s > 0 && file.changes_speeds();
    if (!(known.material.lag_s > 0))
      found.warnings.push_back(
          {"calibration", fmt::format("{} states no lag of its melt (material.lag_s): beads follow the feed "
                                      "at once, which makes pores of segmented lines too narrow",
                                      known.name)});
    return found;
  }
  if (!beads.empty())
    return Error{Fault::kUsage,
                 fmt::format("--beads {}: the file names no printer that is shipped; add --machine NAME", beads)};
  return BeadRules{std::nullopt, reported};
}

Result<Pile> pile_of(const formats::GcodeFile& file) {
  Pile pile;
  std::int64_t top = 0;
  for (std::uint32_t i = 0; i < file.count(); ++i) {
    const Result<formats::GcodeLayer> layer = file.layer(i);
    if (!layer) return layer.error();
    if (layer->beads.empty()) continue;
    if (layer->z < top + kMinLayer) {
      ++pile.skipped;
      continue;
    }
    pile.layers.push_back({i, top, layer->z});
    top = layer->z;
  }
  return pile;
}

Result<VoxelStack> bead_voxels(const formats::GcodeFile& file, const Pile& pile, const Window& window,
                               const bead::DepositionRules* rules, double* left_out) {
  const Box& box = window.box;
  const std::array<std::int64_t, 3> side = {box.width(), box.depth(), box.height()};
  std::array<Nm, 3> edge{};
  for (std::size_t a = 0; a < 3; ++a) edge[a] = static_cast<Nm>((side[a] + window.count[a] / 2) / window.count[a]);
  VoxelStack stack(window.count[0], window.count[1], edge, window.periodic);
  SliceCutter cutter(window);
  auto layer = pile.layers.begin();
  LayerBeads beads(window, rules);
  std::int64_t read_low = -1;
  for (std::uint32_t k = 0; k < window.count[2]; ++k) {
    const std::int64_t z = box.lo.z + (2 * std::int64_t{k} + 1) * side[2] / (2 * std::int64_t{window.count[2]});
    while (layer != pile.layers.end() && layer->high <= z) ++layer;
    if (layer != pile.layers.end() && layer->low <= z && layer->low != read_low) {
      if (Status status = beads.read(file, *layer); !status) return status.error();
      read_low = layer->low;
    }
    cutter.clear();
    if (layer != pile.layers.end() && layer->low <= z)
      beads.cut(static_cast<double>(z) - static_cast<double>(layer->low + layer->high) / 2, cutter);
    if (!stack.append(cutter.cut()))
      return Error{Fault::kInput, "the window has too many runs of voxels; take a smaller one or larger voxels"};
  }
  if (left_out != nullptr) *left_out = beads.left_out();
  return stack;
}

Result<Repeat> find_repeat(const formats::GcodeFile& file, const Pile& pile, Point2 middle, std::size_t layer) {
  constexpr Nm kVoxel = 10'000, kMin = 150'000, kHalf = 4'500'000;  // nm
  constexpr std::uint32_t kMaxLayers = 8;
  constexpr double kMiss = 0.02;
  const auto around = [&](const Pile::PileLayer& of) {
    Window window;
    const auto half = static_cast<Nm>((of.high - of.low) / 2);
    const auto low = static_cast<Nm>(of.low + half - 1);
    window.box.add(Point3{middle.x - kHalf, middle.y - kHalf, low});
    window.box.add(Point3{middle.x + kHalf, middle.y + kHalf, low + 2});
    window.count = {2 * kHalf / kVoxel, 2 * kHalf / kVoxel, 1};
    return bead_voxels(file, pile, window);
  };
  const auto image_of = [](const VoxelStack& slice) { return RunsView{slice.nx, slice.row_offset, slice.change}; };
  const Result<VoxelStack> slice = around(pile.layers[layer]);
  if (!slice) return slice.error();
  Repeat repeat;
  std::array<bool, 2> none{};
  // Each layer has its own period, or is the same all along: the longest one holds for all if the others go into it.
  for (std::uint32_t n = 0; n <= kMaxLayers && layer + n < pile.layers.size(); ++n) {
    const Result<VoxelStack> above = around(pile.layers[layer + n]);
    if (!above) return above.error();
    if (n > 0 && pores::mismatch(image_of(*slice), image_of(*above)) <= kMiss) {
      repeat.layers = n;
      break;
    }
    for (std::size_t axis = 0; axis < 2; ++axis) {
      const std::int64_t here = std::int64_t{kVoxel} * pores::period(image_of(*above), axis == 0, kMin / kVoxel, kMiss);
      const std::int64_t longer = std::max(here, repeat.length[axis]), shorter = std::min(here, repeat.length[axis]);
      const std::int64_t rest = shorter > kMin ? longer % shorter : 0;
      none[axis] = none[axis] || here == 0 || std::min(rest, shorter - rest) > kVoxel;
      repeat.length[axis] = longer;
    }
  }
  for (std::size_t axis = 0; axis < 2; ++axis)
    if (none[axis]) repeat.length[axis] = 0;
  return repeat;
}

}  // namespace lamina::pipeline
