#include "stages/formats/gcode/replay/layer_track.h"

#include <algorithm>
#include <cmath>

namespace lamina::formats::gcode {
namespace {

constexpr double kSameHeight = 1e-4;  // mm
constexpr double kGap = 0.5;          // of a layer's height, below it
constexpr double kClosed = 0.5;       // mm between the ends of a wall
constexpr double kJoined = 0.02;      // mm between beads of a wall

}  // namespace

BeadRole role_of(std::string_view type) {
  struct RoleWord {
    std::string_view part;
    BeadRole role;
  };
  // The first part that the type contains decides: PrusaSlicer, Slic3r, lamina; Orca, BambuStudio; Cura.
  constexpr RoleWord kParts[] = {
      {"upport", BeadRole::kSupport},          {"SUPPORT", BeadRole::kSupport}, {"kirt", BeadRole::kSupport},
      {"SKIRT", BeadRole::kSupport},           {"Brim", BeadRole::kSupport},    {"tower", BeadRole::kSupport},
      {"PRIME", BeadRole::kSupport},           {"Raft", BeadRole::kSupport},    {"Custom", BeadRole::kSupport},
      {"xternal perimeter", BeadRole::kOuter}, {"verhang", BeadRole::kOuter},   {"uter wall", BeadRole::kOuter},
      {"WALL-OUTER", BeadRole::kOuter},        {"erimeter", BeadRole::kInner},  {"nner wall", BeadRole::kInner},
      {"WALL-INNER", BeadRole::kInner}};
  for (const auto& [part, role] : kParts) {
    if (type.find(part) != std::string_view::npos) return role;
  }
  return BeadRole::kOther;
}

void LayerTrack::begin_layer(std::uint64_t line) {
  const std::uint32_t index = begun_ ? now_.index + 1 : 0;
  now_ = TrackedLayer();
  now_.index = index;
  now_.line = line;
  stated_z_ = -1;
  begun_ = true;
}

void LayerTrack::tag(std::uint64_t line, Defects& defects) {
  end_path(defects);
  close_layer(defects);
  tagged_ = true;
  begin_layer(line);
}

void LayerTrack::bead(const RawBead& bead, BeadRole role, double height, std::uint64_t line, Defects& defects) {
  const bool flat = bead.from[2] == bead.to[2];
  const double z = bead.to[2];
  if (!tagged_ && (!begun_ || std::abs(bead.from[2] - last_z_) > kSameHeight)) {
    close_layer(defects);
    begin_layer(line);
  }
  const bool part = role != BeadRole::kSupport;
  last_z_ = z;
  now_.top = now_.beads == 0 ? z : std::max(now_.top, z);
  if (now_.beads++ == 0) {
    now_.z = bead.from[2];
    now_.climbs = !flat;
    now_.height = height;
    now_.line = line;
  } else if (tagged_ && flat && part && std::abs(z - now_.z) > 1.5 * (height > 0 ? height : 0.2) + 0.05) {
    defects.add(Defect::kBeadHeight, {line, now_.index}, z, now_.z);
  }
  if (z < -kSameHeight) defects.add(Defect::kBelowBed, {line, now_.index}, z, 0);
  now_.part = now_.part || part;
  now_.outer = now_.outer || role == BeadRole::kOuter;
  const bool wall = role == BeadRole::kOuter || role == BeadRole::kInner;
  if (!wall || (path_ && std::hypot(bead.from[0] - path_to_[0], bead.from[1] - path_to_[1]) > kJoined)) end_path(defects);
  if (!wall) return;
  if (!path_) {
    path_ = true;
    path_line_ = line;
    std::copy_n(bead.from, 2, path_from_);
  }
  std::copy_n(bead.to, 2, path_to_);
  return;
}

void LayerTrack::end_path(Defects& defects) {
  if (!path_) return;
  path_ = false;
  const double open = std::hypot(path_to_[0] - path_from_[0], path_to_[1] - path_from_[1]);
  if (rules_.walls_close && open > kClosed) defects.add(Defect::kOpenWall, {path_line_, now_.index}, open, 0);
}

/// A layer of supports, skirts or a raft alone may have a gap above it.
void LayerTrack::compare_rise(double rise, Defects& defects) {
  if (gap_rise_ > 1.5 * rise) defects.add(Defect::kSkippedLayer, gap_, gap_z_, gap_below_);
  gap_rise_ = 0;
  const bool may_gap = !below_.part || (rules_.raft_layers > 0 && below_.index <= rules_.raft_layers);
  if (empties_ > 0) {
    if (!may_gap) defects.add(Defect::kEmptyLayer, empty_, empty_z_, 0, empties_);
  } else if (now_.height > 0) {
    if (!may_gap && rise - now_.height > kGap * now_.height) defects.add(Defect::kSkippedLayer, now_.begin(), now_.z, top_);
  } else if (!may_gap && rise_ > 0 && rise > 1.5 * rise_) {
    gap_ = now_.begin(), gap_z_ = now_.z, gap_below_ = top_, gap_rise_ = rise;
  }
}

void LayerTrack::compare_heights(Defects& defects) {
  // Cura's layer_0_z_overlap lowers all layers above the first one on a raft by a part of a layer.
  const double lower = std::max(kSameHeight, now_.height > 0 ? 0.5 * now_.height : 0.25 * rise_);
  if (!has_below_) {
    if (now_.height > 0 && now_.z - now_.height > kGap * now_.height)
      defects.add(Defect::kLateLayer, now_.begin(), now_.z, now_.height);
    first_z_ = now_.z;
    top_ = now_.top;
  } else if (now_.z < below_.z - lower) {
    // Parts one after another begin again at the bed.
    if (now_.z > first_z_ + kSameHeight) {
      defects.add(Defect::kLayerOrder, now_.begin(), now_.z, below_.z);
    } else {
      top_ = now_.top;
    }
    rise_ = gap_rise_ = 0;
  } else {
    const double rise = now_.z - top_;
    if (!now_.climbs && rise > kSameHeight) {
      compare_rise(rise, defects);
      rise_ = rise;
    } else if (now_.climbs && (rise > rules_.nozzle_mm || (tagged_ && now_.top - now_.z > 1.5 * rules_.nozzle_mm))) {
      defects.add(Defect::kSkippedLayer, now_.begin(), now_.top, top_);
    }
    top_ = std::max(top_, now_.top);
  }
}

void LayerTrack::compare_walls(Defects& defects) {
  if (!now_.part) return;
  if (now_.outer) {
    if (wall_less_ > 0) defects.add(Defect::kNoWall, without_wall_, 0, 0, wall_less_);
    wall_less_ = 0;
    had_wall_ = true;
  } else if (had_wall_) {
    if (wall_less_++ == 0) without_wall_ = now_.begin();
  }
}

void LayerTrack::close_layer(Defects& defects) {
  if (!begun_) return;
  if (now_.beads == 0) {
    if (!has_below_) return;
    if (empties_++ == 0) empty_ = now_.begin(), empty_z_ = std::max(stated_z_, 0.0);
    return;
  }
  compare_heights(defects);
  compare_walls(defects);
  empties_ = 0;
  below_ = now_;
  has_below_ = true;
}

void LayerTrack::finish(Defects& defects) {
  end_path(defects);
  close_layer(defects);
}

}  // namespace lamina::formats::gcode
