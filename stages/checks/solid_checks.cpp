#include "stages/checks/solid_checks.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>
#include <utility>

#include "stages/checks/layer_warnings.h"
#include "stages/geometry/blocks/mesh_blocks.h"
#include "stages/support/text/number_text.h"

namespace lamina::checks {
namespace {

/// Rows of a group that are measured in one layer, each at another place of its stretch; more of them where layers are few.
constexpr std::uint32_t kRows = 8, kRowsInAll = 2000;

bool crosses(const Box& box, const Layer& layer) {
  return box.lo.z < layer.bottom + layer.thickness && layer.bottom < box.hi.z;
}

/// Set pixels of a row within [first, last).
std::uint64_t set_within(std::span<const std::uint32_t> row, std::uint32_t first, std::uint32_t last) {
  std::uint64_t set = 0;
  // An odd place is within a run, whose begin stands before it.
  auto at = static_cast<std::size_t>(std::upper_bound(row.begin(), row.end(), first) - row.begin()) & ~std::size_t{1};
  for (; at + 1 < row.size() && row[at] < last; at += 2) set += std::min(last, row[at + 1]) - std::max(first, row[at]);
  return set;
}

std::vector<Group> groups_of(std::span<const Solid> solids) {
  std::vector<Group> groups;
  std::vector<double> sum, largest;
  for (const Solid& solid : solids) {
    if (solid.group >= groups.size()) groups.resize(solid.group + 1);
    sum.resize(groups.size());
    largest.resize(groups.size());
    Group& group = groups[solid.group];
    if (group.box.empty()) group.part = solid.part;
    group.box.add(solid.box);
    group.closed = group.closed && solid.closed;
    sum[solid.group] += std::abs(solid.mesh_mm3);
    largest[solid.group] = std::max(largest[solid.group], std::abs(solid.mesh_mm3));
  }
  for (std::size_t g = 0; g < groups.size(); ++g) {
    groups[g].max_mm3 = sum[g];
    groups[g].min_mm3 = largest[g];
  }
  return groups;
}

/// Sound jobs stay well between these shares of a mesh. Shells that overlap within a mesh make less of it.
constexpr double kMin = 0.55, kMax = 1.2;
/// A top that ends amid a layer adds or takes up to half of one; at most this much of a part's height is forgiven.
constexpr double kMaxTopShare = 0.2;
/// A bleed that leaves less of a part is hardly meant.
constexpr double kLeft = 0.7;
/// Pixels and layers are coarse if fewer than these lie across a solid.
constexpr double kAcross = 5;

std::string volume_text(double mm3) {
  return mm3 < 1000 ? fmt::format("{:.4g} mm3", mm3) : fmt::format("{:.4g} cm3", mm3 / 1000);
}

std::string size_text(const Box& box) {
  return fmt::format("{:.4g} x {:.4g} x {:.4g} mm", mm(box.width()), mm(box.depth()), mm(box.height()));
}

/// What about the job is coarse for a solid, and what to do; "" if nothing is.
std::string too_coarse(const Box& box, const Sampling& sampling) {
  const auto [x, y] = sampling.pixel_mm;
  if (x * kAcross > mm(box.width()) || y * kAcross > mm(box.depth())) {
    return fmt::format("a pixel of {:.4g} x {:.4g} mm is coarse for {}: give a higher --dpi{}", x, y, size_text(box),
                       mm(box.height()) < 1 ? ", or the right --unit" : "");
  }
  if (sampling.thickest_mm * kAcross > mm(box.height())) {
    return fmt::format("layers of {} mm are coarse for {}: give a smaller --layer", number_text(sampling.thickest_mm),
                       size_text(box));
  }
  if (sampling.tolerance_um * 1e-3 * kAcross > mm(std::min(box.width(), box.depth()))) {
    return fmt::format("--tolerance {} um is coarse for {}: give a smaller one", number_text(sampling.tolerance_um),
                       size_text(box));
  }
  return {};
}

/// The worst solid or group of each part.
struct Worst {
  double badness = 0;
  std::uint32_t at = 0, count = 0;
};
using WorstOfParts = std::vector<Worst>;

void note(WorstOfParts& worst, std::uint32_t part, std::uint32_t at, double badness) {
  if (worst.size() <= part) worst.resize(part + 1);
  ++worst[part].count;
  if (worst[part].count == 1 || badness > worst[part].badness) worst[part].badness = badness, worst[part].at = at;
}

/// Calls warn(part, its worst) for each part with any.
void for_each_part(const WorstOfParts& worst, const auto& warn) {
  for (std::uint32_t part = 0; part < worst.size(); ++part) {
    if (worst[part].count > 0) warn(part, worst[part]);
  }
}

std::string and_more(const Worst& worst) {
  return worst.count > 1 ? fmt::format(" ({} of its copies or objects alike)", worst.count) : "";
}

/// By how much planned and mesh differ beyond what sound jobs show; 1 or less: not at all.
double badness_of(const Group& group, double planned_mm3, const Sampling& sampling) {
  const double top = std::min(kMaxTopShare, 0.5 * sampling.thickest_mm / std::max(1e-6, mm(group.box.height())));
  if (group.max_mm3 <= 0) return 0;
  if (sampling.offset_mm <= 0 && planned_mm3 > (kMax + top) * group.max_mm3) return planned_mm3 / group.max_mm3;
  if (sampling.offset_mm >= 0 && planned_mm3 < (kMin - top) * group.min_mm3) {
    return group.min_mm3 / std::max(planned_mm3, 1e-9);
  }
  return 0;
}

/// The same, with what the group's solids hold together where their meshes speak against them. `group` is then that.
Result<double> badness_as_union(std::uint32_t g, Group& group, double planned_mm3, const Sampling& sampling) {
  const double badness = badness_of(group, planned_mm3, sampling);
  if (badness <= 1 || !sampling.union_mm3) return badness;
  const Result<double> merged = sampling.union_mm3(g);
  if (!merged) {
    const Fault fault = merged.error().fault;
    if (fault == Fault::kInterrupted || fault == Fault::kMemory) return merged.error();
    return 0.0;
  }
  if (*merged <= 0) return badness;
  group.min_mm3 = group.max_mm3 = *merged;
  return badness_of(group, planned_mm3, sampling);
}

Status check_volumes(const Tally& tally, const Sampling& sampling, std::vector<Warning>& warnings) {
  WorstOfParts worst;
  std::vector<Group> groups(tally.groups().begin(), tally.groups().end());
  for (std::uint32_t g = 0; g < groups.size(); ++g) {
    Group& group = groups[g];
    // Solids that have vanished as a whole are reported as such.
    if (!group.closed || !tally.measured(g) || tally.planned_mm3(g) == 0) continue;
    const Result<double> badness = badness_as_union(g, group, tally.planned_mm3(g), sampling);
    if (!badness) return badness.error();
    if (*badness > 1) note(worst, group.part, g, *badness);
  }
  for_each_part(worst, [&](std::uint32_t part, const Worst& one) {
    const Group& group = groups[one.at];
    const double planned = tally.planned_mm3(one.at);
    std::string why = too_coarse(group.box, sampling);
    if (why.empty()) why = "its walls are too thin, or its shells overlap, cancel or are inside out: see `lamina info`";
    const double mesh = planned > group.max_mm3 ? group.max_mm3 : group.min_mm3;
    warnings.push_back({"volume",
                        fmt::format("{}: {} are planned where the mesh contains {} ({:.0f} %){}; {}", sampling.part[part],
                                    volume_text(planned), volume_text(mesh), 100 * planned / mesh, and_more(one), why),
                        sampling.part[part]});
  });
  return {};
}

/// "a bleed of 40 um", or "its bleed" where parts or edges have several.
std::string bleed_text(const Sampling& sampling, std::string_view of_several) {
  const auto [x, y] = sampling.bleed_um;
  if (x == 0 && y == 0) return std::string(of_several);
  return fmt::format("a bleed of {} um", x == y ? number_text(x) : number_text(x) + " x " + number_text(y));
}

void warn_of_bleed(const Sampling& sampling, std::uint32_t part, double taken, const Worst& worst,
                   std::vector<Warning>& warnings) {
  warnings.push_back({"bleed",
                      fmt::format("{}: {} takes away {:.0f} % of it{}; --bleed counts in um", sampling.part[part],
                                  bleed_text(sampling, "its bleed"), 100 * taken, and_more(worst)),
                      sampling.part[part]});
}

/// Whether bleed or dose took a solid of a finished job: it lies over pixels and is as high as a layer.
bool was_taken(const Tally& tally, std::uint32_t solid, const Sampling& sampling) {
  return sampling.finished && (sampling.bleeds || sampling.drops_none) && tally.has_pixels(solid) &&
         mm(tally.solids()[solid].box.height()) >= sampling.thickest_mm;
}

void check_lost(const Tally& tally, const Sampling& sampling, std::vector<Warning>& warnings) {
  WorstOfParts worst, taken;  // taken: by bleed or dose
  for (std::uint32_t s = 0; s < tally.solids().size(); ++s) {
    const Solid& solid = tally.solids()[s];
    if (tally.detected(s) || solid.box.empty()) continue;
    note(was_taken(tally, s, sampling) ? taken : worst, solid.part, s, std::abs(solid.mesh_mm3));
  }
  if (sampling.bleeds)
    for_each_part(taken, [&](std::uint32_t part, const Worst& one) { warn_of_bleed(sampling, part, 1, one, warnings); });
  for_each_part(worst, [&](std::uint32_t part, const Worst& one) {
    std::string why = too_coarse(tally.solids()[one.at].box, sampling);
    if (why.empty() && sampling.offset_mm < 0) why = fmt::format("--offset {} leaves none", number_text(sampling.offset_mm));
    if (why.empty()) why = "its walls are too thin, or its shells cancel each other: see `lamina info`";
    warnings.push_back({"part-lost",
                        fmt::format("{}: no layer has anything of it{}; {}", sampling.part[part], and_more(one), why),
                        sampling.part[part]});
  });
}

void check_bleed(const Tally& tally, const Sampling& sampling, std::vector<Warning>& warnings) {
  WorstOfParts worst;
  for (std::uint32_t g = 0; g < tally.groups().size(); ++g) {
    const Group& group = tally.groups()[g];
    const double left = sampling.finished ? tally.planned_mm3(g) : tally.left_mm3(g);
    const bool known = group.closed && !sampling.one_sided && too_coarse(group.box, sampling).empty();
    const double planned = !sampling.finished ? tally.planned_mm3(g) : known ? group.min_mm3 : 0;
    if (!tally.measured(g) || planned <= 0 || left >= kLeft * planned || (sampling.finished && left == 0)) continue;
    note(worst, group.part, g, 1 - left / planned);
  }
  for_each_part(worst,
                [&](std::uint32_t part, const Worst& one) { warn_of_bleed(sampling, part, one.badness, one, warnings); });
}

}  // namespace

Tally::Tally(std::vector<Solid> solids)
    : solids_(std::move(solids)),
      groups_(groups_of(solids_)),
      detected_(solids_.size()),
      planned_(groups_.size()),
      left_(groups_.size()) {}

void Tally::inspect_layers(const PixelGrid& grid) {
  grid_ = &grid;
  for (const Solid& solid : solids_) solid_window_.push_back(pixels_of(solid.box, grid, 0));
  for (const Group& group : groups_) group_window_.push_back(pixels_of(group.box, grid, 0));
}

PixelBox Tally::mirrored(PixelBox window, const RunsView& image, bool mirror_x, bool mirror_y) {
  const auto turn = [](std::uint32_t& first, std::uint32_t& last, std::uint32_t count) {
    const std::uint32_t end = count - first;
    first = count - last;
    last = end;
  };
  if (mirror_x) turn(window.left, window.right, image.columns);
  if (mirror_y) turn(window.top, window.bottom, image.rows());
  return window;
}

void Tally::add_image(const Layer& layer, const RunsView& image, bool mirror_x, bool mirror_y) {
  for (std::uint32_t s = 0; s < solids_.size(); ++s) {
    if (detected(s) || !crosses(solids_[s].box, layer)) continue;
    const PixelBox window = mirrored(solid_window_[s], image, mirror_x, mirror_y);
    for (std::uint32_t row = window.top; row < window.bottom; ++row) {
      if (set_within(image.row(row), window.left, window.right) == 0) continue;
      detected_[s].store(1, std::memory_order_relaxed);
      break;
    }
  }
  add(layer, image, mirror_x, mirror_y, planned_);
}

void Tally::add_left(const Layer& layer, const RunsView& image, bool mirror_x, bool mirror_y) {
  bleeds_.store(true, std::memory_order_relaxed);
  add(layer, image, mirror_x, mirror_y, left_);
}

void Tally::add(const Layer& layer, const RunsView& image, bool mirror_x, bool mirror_y, std::vector<Sum>& sums) const {
  const double pixel_mm2 = mm(1) * mm(1) / (grid_->x.pixels_per_nm() * grid_->y.pixels_per_nm());
  const auto measured = static_cast<std::uint32_t>(std::min<std::size_t>(groups_.size(), kMeasured));
  for (std::uint32_t g = 0; g < measured; ++g) {
    if (!crosses(groups_[g].box, layer)) continue;
    const PixelBox window = mirrored(group_window_[g], image, mirror_x, mirror_y);
    const std::uint32_t rows = window.bottom - window.top;
    if (rows == 0 || window.left == window.right) continue;
    const auto layers =
        static_cast<std::uint32_t>(std::max(std::int64_t{1}, std::int64_t{groups_[g].box.height()} / layer.thickness));
    const std::uint32_t step = std::max(1u, rows / std::max(kRows, kRowsInAll / layers / measured));
    std::uint64_t set = 0;
    std::uint32_t inspected = 0;
    for (std::uint32_t first = 0; first < rows; first += step, ++inspected) {
      // Multiples of the golden section spread over a stretch of rows as layers and stretches go by: no period of a part
      // falls in with them.
      const std::uint32_t within = std::min(step, rows - first), position = (layer.index * 8191 + inspected) * 2654435769u;
      const std::uint32_t r = first + static_cast<std::uint32_t>(std::uint64_t{position} * within >> 32);
      // The same rows of the bed, whichever way the image is mirrored.
      const std::uint32_t row = mirror_y ? window.bottom - 1 - r : window.top + r;
      set += set_within(image.row(row), window.left, window.right);
    }
    const double pixels = static_cast<double>(set) * rows / static_cast<double>(inspected);
    add_to(sums[g], pixels * pixel_mm2 * mm(layer.thickness));
  }
}

void Tally::add_area(std::uint32_t group, const Layer& layer, double area_mm2) {
  add_to(planned_[group], std::max(0.0, area_mm2) * mm(layer.thickness));
}

Status check_solids(const Tally& tally, const Sampling& sampling, std::vector<Warning>& warnings) {
  check_lost(tally, sampling, warnings);
  if (!sampling.one_sided && !sampling.bleeds) {
    if (Status status = check_volumes(tally, sampling, warnings); !status) return status;
  }
  if (tally.measures_bleed() || sampling.bleeds) check_bleed(tally, sampling, warnings);
  return {};
}

void check_layers(std::span<const Solid> solids, std::span<const std::uint8_t> filled,
                  const std::function<Layer(std::uint32_t)>& layer, std::vector<Warning>& warnings) {
  const auto first = std::ranges::find(filled, 1);
  if (first == filled.end()) return;
  const auto begin = static_cast<std::uint32_t>(first - filled.begin());
  auto end = static_cast<std::uint32_t>(filled.size());
  while (filled[end - 1] == 0) --end;
  ReportedLayers empty;
  for (std::uint32_t i = begin; i < end; ++i) {
    if (filled[i] != 0) continue;
    const Layer at = layer(i);
    const auto within = [&](const Solid& solid) {
      return solid.box.lo.z < at.bottom && at.bottom + at.thickness < solid.box.hi.z;
    };
    if (std::ranges::any_of(solids, within)) empty.add(at);
  }
  empty.warn("layers-empty",
             fmt::format("{} of {} layers are empty amid a part, first {}", empty.count, filled.size(), empty.first), warnings);
}

void check_tolerance(std::span<const Solid> solids, const Sampling& sampling, std::vector<Warning>& warnings) {
  const double tolerance = sampling.tolerance_um * 1e-3;
  for (const Solid& solid : solids) {
    const double maximum = std::clamp(0.02 * mm(std::min(solid.box.width(), solid.box.depth())), 0.05, 0.25);
    if (solid.box.empty() || tolerance <= maximum * (1 + 1e-9)) continue;
    warnings.push_back({"tolerance",
                        fmt::format("{}: --tolerance {} moves contours by up to {:.3g} mm; it counts in um",
                                    sampling.part[solid.part], number_text(sampling.tolerance_um), tolerance),
                        sampling.part[solid.part]});
    return;
  }
}

void check_footing(std::span<const Solid> solids, const Sampling& sampling, std::vector<Warning>& warnings) {
  std::vector<std::int64_t> lowest(sampling.part.size(), std::numeric_limits<std::int64_t>::max());
  for (const Solid& solid : solids) {
    if (!solid.box.empty()) lowest[solid.part] = std::min<std::int64_t>(lowest[solid.part], solid.box.lo.z);
  }
  for (std::uint32_t part = 0; part < lowest.size(); ++part) {
    const std::int64_t low = lowest[part];
    if (low <= 0 || low == std::numeric_limits<std::int64_t>::max()) continue;
    const auto own = std::ranges::find_if(solids, [&](const Solid& s) { return s.part == part && s.box.lo.z == low; });
    const Box& box = own->box;
    const auto carries = [&](const Solid& other) {
      return other.part != part && other.box.lo.z < low && other.box.hi.z >= low && other.box.lo.x < box.hi.x &&
             box.lo.x < other.box.hi.x && other.box.lo.y < box.hi.y && box.lo.y < other.box.hi.y;
    };
    if (std::ranges::any_of(solids, carries)) continue;
    warnings.push_back({"above-bed",
                        fmt::format("{}: begins {:.3f} mm above the bed, in the air; leave out --bottom, or put it on a part",
                                    sampling.part[part], mm(low)),
                        sampling.part[part], std::nullopt, mm(low)});
  }
}

Status check_anything(const Tally& tally, const Sampling& sampling) {
  const auto because = [](std::string why) { return Error{Fault::kInput, std::move(why)}; };
  const auto solids = tally.solids();
  for (std::uint32_t s = 0; s < solids.size(); ++s) {
    if (tally.detected(s)) {
      const bool bleeds = tally.measures_bleed() && tally.left_mm3(solids[s].group) == 0;
      if (!bleeds) return {};
      return because(bleed_text(sampling, "the bleed") + " takes away all of the parts: --bleed counts in um");
    }
  }
  for (const Solid& solid : solids) {
    if (std::string why = too_coarse(solid.box, sampling); !why.empty()) return because(std::move(why));
  }
  if (sampling.offset_mm < 0)
    return because(fmt::format("--offset {} leaves none of the parts", number_text(sampling.offset_mm)));
  return because("the shells of the parts enclose nothing or cancel each other: see `lamina info`");
}

std::vector<std::uint8_t> crossed_planes(std::span<const Mesh> meshes, std::span<const Instance> instances,
                                         std::span<const Nm> planes) {
  std::vector<std::uint8_t> crossed(planes.size(), 0);
  std::set<std::pair<std::uint32_t, Nm>> detected;
  for (const Instance& instance : instances) {
    if (!detected.emplace(instance.mesh, instance.offset.z).second) continue;
    const auto mark = [&](const Triangle& t) {
      const std::int64_t lowest = std::int64_t{std::min({t.a.z, t.b.z, t.c.z})} + instance.offset.z,
                         highest = std::int64_t{std::max({t.a.z, t.b.z, t.c.z})} + instance.offset.z;
      auto plane = std::ranges::lower_bound(planes, lowest);
      for (; plane != planes.end() && *plane < highest; ++plane) crossed[static_cast<std::size_t>(plane - planes.begin())] = 1;
    };
    const Mesh& mesh = meshes[instance.mesh];
    for (const Triangle& t : mesh.triangles) mark(t);
    for (std::uint32_t c = 0; mesh.blocks && c < mesh.blocks->cluster_count(); ++c) {
      for (std::uint32_t lane = 0; lane < kClusterSize; ++lane) mark(mesh.blocks->triangle(c, lane));
    }
  }
  return crossed;
}

GroupUnion::GroupUnion(std::span<const Mesh> meshes, std::span<const Instance> instances, std::span<const Solid> solids,
                       Volume volume, Again again)
    : meshes_(meshes), volume_(std::move(volume)), again_(std::move(again)) {
  for (std::size_t i = 0; i < instances.size(); ++i) {
    if (members_.size() <= solids[i].group) members_.resize(std::size_t{solids[i].group} + 1);
    members_[solids[i].group].push_back(instances[i]);
  }
}

GroupUnion::Key GroupUnion::key_of(std::span<const Instance> members) {
  Key key;
  for (const Instance& one : members) key.push_back({one.mesh, one.offset.x, one.offset.y, one.offset.z});
  std::ranges::sort(key);
  for (auto at = key.rbegin(); at != key.rend(); ++at)
    for (std::size_t axis = 1; axis < 4; ++axis) (*at)[axis] -= key.front()[axis];
  return key;
}

Result<double> GroupUnion::compute(std::span<const Instance> members) {
  if (!again_) return volume_(meshes_, members);
  if (!reread_) reread_.emplace(again_());
  if (!*reread_) return reread_->error();
  const std::vector<Mesh>& now = **reread_;
  const auto changed = [&](const Instance& one) {
    return one.mesh >= now.size() || now[one.mesh].fingerprint != meshes_[one.mesh].fingerprint;
  };
  if (now.size() != meshes_.size() || std::ranges::any_of(members, changed)) {
    return Error{Fault::kInput, "a part has changed since it was planned"};
  }
  return volume_(now, members);
}

Result<double> GroupUnion::mm3(std::uint32_t group) {
  if (group >= members_.size()) return 0.0;
  const std::vector<Instance>& members = members_[group];
  Key key = key_of(members);
  const auto found = known_.find(key);
  return found != known_.end() ? found->second : known_.emplace(std::move(key), compute(members)).first->second;
}

}  // namespace lamina::checks
