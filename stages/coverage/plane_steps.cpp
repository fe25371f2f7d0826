#include "stages/coverage/plane_steps.h"

#include <algorithm>
#include <cmath>

#include "stages/coverage/row_tents.h"

namespace lamina::cover {
namespace {

/// What computed shares may be off by, and more, of what they are made of.
constexpr double kShareRoom = 0x1p-46;

/// The share of a voxel as a function of how far its middle lies behind the plane: two tents over the voxel's front.
class ShareBehind {
 public:
  /// What the plane gains over the voxel's depth and height, and the voxel's width: all at least 0.
  ShareBehind(double over_y, double over_z, double width) : half_width_(width / 2), per_volume_(1 / width) {
    const double a = (over_y + over_z) / 2, b = (over_y - over_z) / 2;
    front_ = TentPair(Two{-a, a}, Two{-b, -b}, Two{b, b}, Two{0.5, 0.5});
    reach_ = a + half_width_;
    widest_ = std::max(std::max(over_y, over_z), width);
  }
  double at(double distance, double& density) const {
    Two covered_before{}, covered{}, before{}, behind{};
    front_.add(distance - half_width_, covered_before, before);
    front_.add(distance + half_width_, covered, behind);
    covered -= covered_before;
    behind -= before;
    density = (covered[0] + covered[1]) * per_volume_;
    return (behind[0] + behind[1]) * per_volume_;
  }
  double reach() const { return reach_; }

  /// The distance where the share is `share`, less than half, to `room`; false if it cannot be told.
  bool find(double share, double deviation, double room, double& distance) const {
    // Where the widest number alone decides, the share is a straight line.
    distance = (share - 0.5) * widest_;
    if (-distance <= widest_ - reach_ - room) return true;
    double density = 0, least = -reach_, most = 0;
    distance = std::max(deviation * std::min(2 * share - 1, 0.0) * 1.45, -reach_ * (1 - 1e-3));
    for (int i = 0; i < 40; ++i) {
      const double off = at(distance, density) - share;
      (off < 0 ? least : most) = distance;
      const double next = distance - off / density;
      const double step = next > least && next < most ? next : (least + most) / 2;
      const bool near = std::abs(step - distance) < room / 4;
      distance = step;
      if (near) break;
    }
    const double off = kShareRoom * (1 + reach_ * per_volume_);
    return at(distance - room, density) < share - off && at(distance + room, density) > share + off;
  }

 private:
  TentPair front_;
  double half_width_, per_volume_, reach_, widest_;
};

}  // namespace

void PlaneSteps::find(const SlabFacet& facet, double bottom, const VoxelSides& sides, double widest_room,
                      std::span<double> step) {
  is_known = false;
  const Point3 &a = facet.facet.a, &b = facet.facet.b, &c = facet.facet.c;
  const std::int64_t ux = std::int64_t{b.x} - a.x, uy = std::int64_t{b.y} - a.y, uz = std::int64_t{b.z} - a.z;
  const std::int64_t vx = std::int64_t{c.x} - a.x, vy = std::int64_t{c.y} - a.y, vz = std::int64_t{c.z} - a.z;
  const auto nx = static_cast<double>(uy * vz - uz * vy), ny = static_cast<double>(uz * vx - ux * vz),
             nz = static_cast<double>(ux * vy - uy * vx);
  if (nx == 0) return;
  per_y = -ny / nx;
  const double per_z = -nz / nx;
  const double from_y = static_cast<double>(a.y - facet.low.y), from_z = bottom + sides.z / 2 - static_cast<double>(a.z);
  x = static_cast<double>(a.x - facet.low.x) - per_y * from_y + per_z * from_z;
  const double over_y = std::abs(per_y) * sides.y, over_z = std::abs(per_z) * sides.z;
  const double size = static_cast<double>(facet.size) + sides.y + sides.z;
  const ShareBehind share(over_y, over_z, sides.x);
  const double found_to = share.reach() * 0x1p-18;
  // Middles of columns and rows lie within 1 nm of nominal ones; sides that differ by 1 nm move a distance by half of that.
  room = found_to + 2 + 2 * std::abs(per_y) + 0x1p-48 * (size * (1 + std::abs(per_y) + std::abs(per_z)));
  if (!(room <= widest_room)) return;
  const double deviation = std::sqrt((over_y * over_y + over_z * over_z + sides.x * sides.x) / 12);
  const std::size_t steps = step.size();
  for (std::size_t k = 0; 2 * k + 1 < steps; ++k) {
    if (!share.find(static_cast<double>(2 * k + 1) / static_cast<double>(2 * steps), deviation, found_to, step[k])) return;
    step[steps - 1 - k] = -step[k];
  }
  if (steps % 2 == 1) step[steps / 2] = 0;
  is_known = true;
}

}  // namespace lamina::cover
