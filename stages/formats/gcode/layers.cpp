#include "stages/formats/gcode/layers.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace lamina::formats {
namespace {

constexpr double kRound = 2 * std::numbers::pi;
constexpr double kAlmost = 0.02;    // rad: ends of beads are rounded to micrometres
constexpr double kJump = 0.1;       // mm of z without a bead that end a climb
constexpr double kTurnless = 5;     // mm of climb without a turn that are a layer
constexpr double kMinLayer = 0.04;  // mm: a slope that high leads to a new flat layer if a long flat way follows
constexpr double kMinRise = 0.02;   // mm from a layer to the next
constexpr double kSame = 1e-6;      // mm

double heading_of(const RawBead& bead) { return std::atan2(bead.to[1] - bead.from[1], bead.to[0] - bead.from[0]); }

}  // namespace

void LayerCutter::tag(const GcodeFile::FilePosition& before) {
  if (!tagged_) layers_.clear();  // beads of start code belong to no layer
  tagged_ = true;
  if (step_ > 0) return;
  begin(before, false);
}

void LayerCutter::begin(const GcodeFile::FilePosition& before, bool climb_goes_on) {
  const double below = layers_.empty() ? 0 : layers_.back().top;
  layers_.emplace_back();
  layers_.back().position.start = before;
  layers_.back().position.below = below;
  layers_.back().low = layers_.back().top = below;  // of a layer without a bead
  climbs_ = climbs_ && climb_goes_on;
  slope_length_ = flat_length_ = 0;
}

bool LayerCutter::begins_step(const RawBead& bead) {
  const long step = std::lround(std::ceil((bead.from[2] + bead.to[2]) / 2 / step_ - kSame));
  const bool fell = step < last_step_ && bead.from[2] < z_ - kJump;  // the next part, or the next strand
  if (!layers_.empty() && step <= last_step_ && !fell) return false;
  last_step_ = step;
  return true;
}

/// A turn ends where the direction has gone round and the way leads away from where it began: outlines that wave go round
/// early, and back.
bool LayerCutter::ends_turn(const RawBead& bead) {
  const double turned = std::abs(turned_ + std::remainder(heading_of(bead) - heading_, kRound));
  const bool away =
      std::hypot(bead.to[0] - seam_[0], bead.to[1] - seam_[1]) >= std::hypot(bead.from[0] - seam_[0], bead.from[1] - seam_[1]);
  const bool turns = turned >= kRound - kAlmost && (away || turned >= 1.5 * kRound);
  if (!turns && bead.to[2] <= climb_from_ + kTurnless) return false;
  if (turns) turned_ -= std::copysign(kRound, turned_);
  layers_.back().turned = turns;
  ++(turns ? turns_ : turnless_);
  start_turn(bead);
  return true;
}

void LayerCutter::start_turn(const RawBead& bead) {
  climb_from_ = bead.from[2];
  seam_[0] = bead.from[0];
  seam_[1] = bead.from[1];
}

/// Of the first bead of a line in a file without tags.
LayerCutter::Cut LayerCutter::cut_at(const RawBead& bead) {
  if (layers_.empty()) return Cut::kLayer;
  const bool slope = bead.from[2] != bead.to[2];
  const double jump = std::abs(bead.from[2] - z_);
  if (!slope && (!climbs_ || jump > kSame)) return jump > kSame ? Cut::kLayer : Cut::kNone;
  if (!climbs_ || jump > kJump) return Cut::kLayer;
  const CutLayer& now = layers_.back();
  const bool flat = flat_length_ > 4 * slope_length_ && now.top - now.position.below >= kMinLayer;
  if (slope && flat) return Cut::kLayer;
  return ends_turn(bead) ? Cut::kClimb : Cut::kNone;
}

/// Keeps what the next bead is compared with.
void LayerCutter::follow(const RawBead& bead) {
  const double heading = heading_of(bead), length = bead.length();
  if (climbs_) {
    const double turn = std::remainder(heading - heading_, kRound);
    turned_ += turn;
    layers_.back().turn += turn;
  }
  if (bead.from[2] != bead.to[2]) {
    if (!climbs_) {
      turned_ = 0;
      start_turn(bead);
    }
    climbs_ = true;
    slope_length_ += length;
    flat_length_ = 0;
  } else {
    flat_length_ += length;
  }
  heading_ = heading;
  z_ = bead.to[2];
}

void LayerCutter::add(const RawBead& bead, const GcodeFile::FilePosition& before, const GcodeFile::FilePosition& now) {
  if (step_ > 0) {
    if (bead.first && begins_step(bead)) begin(before, false);
  } else if (bead.first && !tagged_) {
    if (const Cut cut = cut_at(bead); cut != Cut::kNone) begin(before, cut == Cut::kClimb);
  }
  if (layers_.empty()) begin(before, false);
  CutLayer& layer = layers_.back();
  const double length = bead.length();
  const double low = std::min(bead.from[2], bead.to[2]), top = std::max(bead.from[2], bead.to[2]);
  layer.low = layer.position.beads == 0 ? low : std::min(layer.low, low);
  layer.top = layer.position.beads == 0 ? top : std::max(layer.top, top);
  ++layer.position.beads;
  layer.length += length;
  if (bead.from[2] != bead.to[2]) layer.sloped += length;
  if (now.width == 0) {
    layer.untagged_length += length;
    layer.untagged_fed += bead.fed;
  }
  const double rise = bead.from[2] - z_;
  if (rise > kMinRise && (layer.min_rise == 0 || rise < layer.min_rise)) layer.min_rise = rise;
  layer.tag_height = now.height;
  layer.volumetric = bead.volumetric;
  follow(bead);
}

/// Layers by a given height hold several turns, or heights, or less than one.
void LayerCutter::finish_steps() {
  double climbed = 0, turned = 0;
  for (const CutLayer& layer : layers_) {
    if (!(layer.sloped > layer.length / 2)) continue;
    climbed += layer.top - layer.low;
    turned += std::abs(layer.turn);
  }
  const double pitch = turned >= kRound ? climbed / turned * kRound : step_;
  for (CutLayer& layer : layers_) {
    const bool climbs = layer.sloped > layer.length / 2;
    layer.position.height = climbs ? pitch : layer.min_rise > 0 ? layer.min_rise : step_;
  }
}

void LayerCutter::finish() {
  if (step_ > 0) return finish_steps();
  double pitch = 0;
  for (CutLayer& layer : layers_) {
    if (!(layer.sloped > layer.length / 2)) {
      pitch = 0;
      continue;
    }
    // What is left of a climb behind its last turn is as high as that turn.
    if (layer.turned || (tagged_ && &layer != &layers_.back())) pitch = layer.top - layer.low;
    layer.position.height = pitch > 0.02 ? pitch : kUsualHeight;
  }
}

}  // namespace lamina::formats
