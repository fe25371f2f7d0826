#include "stages/heights/surface.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <bit>
#include <cmath>
#include <cstdlib>
#include <map>
#include <numbers>
#include <optional>
#include <tuple>
#include <utility>

namespace lamina::heights {
namespace {

constexpr std::size_t kBlock = 1 << 14;  // facets; fixed, so that sums do not depend on the threads
constexpr std::size_t kGroup = 256;      // facets

struct Normal {
  double x, y, z;  // length: twice the area, nm2
};

// Exact before the last rounding: edges below 2^30 nm (1 m) in 64 bits, longer ones in 128.
Normal normal_of(const Triangle& t) {
  const std::int64_t ux = std::int64_t{t.b.x} - t.a.x, uy = std::int64_t{t.b.y} - t.a.y, uz = std::int64_t{t.b.z} - t.a.z;
  const std::int64_t vx = std::int64_t{t.c.x} - t.a.x, vy = std::int64_t{t.c.y} - t.a.y, vz = std::int64_t{t.c.z} - t.a.z;
  constexpr std::int64_t kSmall = 1 << 30;
  const auto small = [](std::int64_t v) { return static_cast<std::uint64_t>(v + kSmall) < 2 * kSmall; };
  if (small(ux) && small(uy) && small(uz) && small(vx) && small(vy) && small(vz)) {
    return {static_cast<double>(uy * vz - uz * vy), static_cast<double>(uz * vx - ux * vz),
            static_cast<double>(ux * vy - uy * vx)};
  }
  using Wide = __int128;
  return {static_cast<double>(Wide{uy} * vz - Wide{uz} * vy), static_cast<double>(Wide{uz} * vx - Wide{ux} * vz),
          static_cast<double>(Wide{ux} * vy - Wide{uy} * vx)};
}

// Joins facets at the same height that come soon after each other: a terrain of whole metres has a hundred thousand of
// them at a hundred heights. A place for each height that another height may take; what loses its place is listed.
class FlatJoiner {
 public:
  explicit FlatJoiner(std::vector<FlatFacet>& out) : out_(out) {}
  ~FlatJoiner() {
    for (const FlatFacet& flat : table_) list(flat);
  }
  FlatJoiner(const FlatJoiner&) = delete;
  FlatJoiner& operator=(const FlatJoiner&) = delete;

  void add(const FlatFacet& flat) {
    const std::uint32_t mixed = (static_cast<std::uint32_t>(flat.height) * 2 + flat.up) * 2654435769u;
    FlatFacet& position = table_[mixed >> (32 - kBits)];
    if (position.height == flat.height && position.up == flat.up) {
      position.mm2 += flat.mm2;
    } else {
      list(position);
      position = flat;
    }
  }

 private:
  static constexpr int kBits = 8;
  void list(const FlatFacet& flat) {
    if (flat.mm2 > 0) out_.push_back(flat);
  }
  std::vector<FlatFacet>& out_;
  std::array<FlatFacet, 1 << kBits> table_{};
};

// Facets whose roots and quotients are taken together, two and more at a time.
struct FacetBatch {
  double x[kGroup], y[kGroup], z[kGroup], length[kGroup];
  double up[kGroup];     // |n_z| of the unit normal; no number for a facet without area
  double angle[kGroup];  // the same before a stretch, and
  double whole[kGroup];  // length of the normal there
  Nm lo[kGroup], hi[kGroup];

  void measure(const Triangle* facets, std::size_t count) {
    for (std::size_t k = 0; k < count; ++k) {
      const Triangle& t = facets[k];
      const Normal n = normal_of(t);
      x[k] = n.x, y[k] = n.y, z[k] = n.z;
      lo[k] = std::min(std::min(t.a.z, t.b.z), t.c.z);
      hi[k] = std::max(std::max(t.a.z, t.b.z), t.c.z);
    }
    for (std::size_t k = 0; k < count; ++k) {
      length[k] = std::sqrt(x[k] * x[k] + y[k] * y[k] + z[k] * z[k]);
      up[k] = std::abs(z[k]) / length[k];
    }
  }
  // A stretch by s turns a normal n, as long as twice the area, into (n_x / s_x, n_y / s_y, n_z / s_z) s_x s_y s_z.
  void undo(const ScaleFactors& by, std::size_t count) {
    const double volume = by[0] * by[1] * by[2];
    for (std::size_t k = 0; k < count; ++k) {
      const double nx = x[k] * by[0], ny = y[k] * by[1], nz = z[k] * by[2], size = std::sqrt(nx * nx + ny * ny + nz * nz);
      whole[k] = size / volume;
      angle[k] = std::abs(nz) / size;
    }
  }
};

// In units of the header, rounded up; the cast cuts off, and what is cut off is put back.
Steepness rounded_up(double up) {
  const double scaled = up * kHorizontal;
  const auto whole = static_cast<std::int32_t>(scaled);
  return static_cast<Steepness>(whole + (whole < scaled));
}

// At most kGroup facets, measured. A mesh that is stretched by factors other than 1 gets angles of its own, and with
// SlopeRule::shrunk_steps also steps.
struct MeasuredGroup {
  FacetBatch batch;
  Steepness steps[kGroup], angles[kGroup];  // angles: of a stretched mesh only
  std::uint32_t level[kGroup], levels;      // horizontal facets

  // area  of facets that are not horizontal is added to it, mm2, where steps are considered
  void measure(const Triangle* facets, std::size_t count, const SlopeRule& rule, double& area) {
    const bool is_scaled = rule.is_scaled();
    batch.measure(facets, count);
    if (is_scaled) batch.undo(rule.scale, count);
    const double* angle = is_scaled ? batch.angle : batch.up;
    const double* surface = rule.shrunk_steps ? batch.whole : batch.length;
    levels = 0;
    for (std::size_t k = 0; k < count; ++k) {
      const bool counts = (batch.z[k] != 0) & (batch.length[k] * 0.5e-12 >= rule.min_mm2);
      const bool flat = counts & (angle[k] >= rule.horizontal) & (std::int64_t{batch.hi[k]} - batch.lo[k] <= rule.tolerance);
      level[levels] = static_cast<std::uint32_t>(k);
      levels += flat;
      area += flat ? 0 : surface[k] * 0.5e-12;
      steps[k] = rounded_up((counts & !flat) ? batch.up[k] : 0);
    }
    for (std::size_t k = 0; is_scaled && k < count; ++k) {
      const bool slope = steps[k] != 0;
      angles[k] = rounded_up(slope ? angle[k] : 0);
      // The step of a layer that shrinks with the part; factors below a half are no shrinkage.
      if (rule.shrunk_steps) steps[k] = rounded_up(slope ? std::min(angle[k] / rule.scale[2], 1.999) : 0);
    }
  }
};

MeshSlopes slopes_of(const Mesh& mesh, const SlopeRule& rule) {
  MeshSlopes slopes{&mesh, rule, {}, {}, {}};
  const std::size_t count = slopes.facets(), listed = mesh.triangles.size();
  slopes.steepness.resize(listed);
  if (rule.is_scaled()) slopes.nominal.resize(listed);
  if (rule.shrunk_steps) slopes.step_share = 1 / (rule.scale[0] * rule.scale[1] * rule.scale[2]);
  const std::size_t blocks = (count + kBlock - 1) / kBlock;
  std::vector<std::vector<FlatFacet>> flats(blocks);
  std::vector<double> areas(blocks);
  tbb::parallel_for(std::size_t{0}, blocks, [&](std::size_t block) {
    FlatJoiner joiner(flats[block]);
    MeasuredGroup group;
    Buffer<Triangle> list;
    std::size_t at = block * kBlock;
    each_listed(mesh, at, std::min(count, at + kBlock), list, [&](std::span<const Triangle> facets) {
      for (std::size_t first = 0; first < facets.size(); first += kGroup) {
        const std::size_t size = std::min(kGroup, facets.size() - first);
        group.measure(facets.data() + first, size, rule, areas[block]);
        if (listed > 0) std::copy_n(group.steps, size, slopes.steepness.data() + at);
        if (!slopes.nominal.empty()) std::copy_n(group.angles, size, slopes.nominal.data() + at);
        at += size;
        for (std::uint32_t l = 0; l < group.levels; ++l) {
          const FacetBatch& batch = group.batch;
          const std::uint32_t k = group.level[l];
          const auto middle = static_cast<Nm>(batch.lo[k] + (std::int64_t{batch.hi[k]} - batch.lo[k]) / 2);
          joiner.add({middle, batch.z[k] > 0, batch.length[k] * 0.5e-12});
        }
      }
    });
  });
  for (std::size_t block = 0; block < blocks; ++block) {
    slopes.flats.insert(slopes.flats.end(), flats[block].begin(), flats[block].end());
    slopes.area_mm2 += areas[block];
  }
  return slopes;
}

struct Face {
  Nm height;
  std::uint32_t part;
  bool up, end;
  double mm2;
};

Flat flat_of(std::span<const Face> faces) {
  Flat flat{};
  double all = 0, below = 0, part_mm2 = 0, max_mm2 = -1;
  for (const Face& face : faces) {
    all += face.mm2;
    (face.up ? flat.up_mm2 : flat.down_mm2) += face.mm2;
    flat.end = flat.end || face.end;
  }
  flat.height = faces.front().height;
  for (const Face& face : faces) {
    below += face.mm2;
    if (2 * below >= all) {
      flat.height = face.height;
      break;
    }
  }
  // Dimensions of a part are measured between its ends, so an end decides; the highest one where there are several.
  for (const Face& face : faces) {
    if (face.end) flat.height = face.height;
  }
  std::vector<Face> by_part(faces.begin(), faces.end());
  std::ranges::stable_sort(by_part, {}, &Face::part);
  for (std::size_t i = 0; i < by_part.size(); ++i) {
    part_mm2 = i > 0 && by_part[i - 1].part == by_part[i].part ? part_mm2 + by_part[i].mm2 : by_part[i].mm2;
    if (part_mm2 > max_mm2) {
      max_mm2 = part_mm2;
      flat.part = by_part[i].part;
    }
  }
  return flat;
}

// Raises ranges of an array to at least a value, many times, and then returns every entry: level l of the table contains
// the values set for intervals of 2^l entries; any range is two such intervals that may overlap. Handing levels down
// once at the end makes it O(1) a range. Ranges longer than a block are a range of blocks and two short ones, which
// keeps the table small.
class RangeRaiser {
 public:
  static constexpr std::uint32_t kLevels = 12;

  explicit RangeRaiser(std::uint32_t count)
      : count_(count), fine_(make_levels(count, kLevels)), coarse_(make_levels((count >> kBlockBits) + 1, 32)) {}

  void raise(std::uint32_t first, std::uint32_t last, Steepness value) {  // [first, last)
    if (last - first < (2u << kBlockBits)) return raise(fine_, first, last, value);
    const std::uint32_t whole_first = (first + kMask) >> kBlockBits, whole_last = last >> kBlockBits;
    raise(coarse_, whole_first, whole_last, value);
    if (first < whole_first << kBlockBits) raise(fine_, first, whole_first << kBlockBits, value);
    if (whole_last << kBlockBits < last) raise(fine_, whole_last << kBlockBits, last, value);
  }

  Buffer<Steepness> finish() {
    hand_down(coarse_);
    hand_down(fine_);
    Buffer<Steepness>& all = fine_.front();
    for (std::uint32_t i = 0; i < count_; ++i) all[i] = std::max(all[i], coarse_.front()[i >> kBlockBits]);
    return std::move(all);
  }

 private:
  static constexpr std::uint32_t kBlockBits = kLevels - 2, kMask = (1u << kBlockBits) - 1;
  using Levels = std::vector<Buffer<Steepness>>;

  static Levels make_levels(std::uint32_t count, std::uint32_t maximum) {
    Levels levels(std::min<std::uint32_t>(std::bit_width(count), maximum));
    for (auto& level : levels) level.assign(count, 0);
    return levels;
  }
  static void raise(Levels& levels, std::uint32_t first, std::uint32_t last, Steepness value) {
    const std::uint32_t l = std::bit_width(last - first) - 1;
    Buffer<Steepness>& level = levels[l];
    level[first] = std::max(level[first], value);
    Steepness& second = level[last - (1u << l)];
    second = std::max(second, value);
  }
  static void hand_down(Levels& levels) {
    for (std::size_t l = levels.size(); l-- > 1;) {
      const std::uint32_t half = 1u << (l - 1);
      const Buffer<Steepness>& from = levels[l];
      Buffer<Steepness>& to = levels[l - 1];
      const auto count = static_cast<std::uint32_t>(from.size());
      for (std::uint32_t i = 0; i < count; ++i) to[i] = std::max(to[i], from[i]);
      for (std::uint32_t i = half; i < count; ++i) to[i] = std::max(to[i], from[i - half]);
    }
  }

  std::uint32_t count_;
  Levels fine_, coarse_;
};

// The largest |n_z| of all facets by the range of entries that each covers. Every share raises entries of its own; the
// larger of two is the same in any order.
template <class RangeOf>
Buffer<Steepness> steepest_by(const SurfaceIndex& index, std::span<const PartSurface> parts, std::uint32_t entries, Slope slope,
                              const RangeOf& range_of) {
  const std::uint32_t shares = worthwhile_shares(index, parts, RangeRaiser::kLevels * entries);
  std::vector<Buffer<Steepness>> found(shares);
  tbb::parallel_for(0u, shares, [&](std::uint32_t share) {
    RangeRaiser raiser(entries);
    const auto raise = [&](Nm lo, Nm hi, Steepness steepness, double) {
      const CandidateHeights::CellRange range = range_of(lo, hi);
      if (range.first < range.last) raiser.raise(range.first, range.last, steepness);
    };
    for (const PartSurface& part : parts) for_each_slope(index, part, share, shares, raise, slope);
    found[share] = raiser.finish();
  });
  for (std::uint32_t share = 1; share < shares; ++share) {
    for (std::uint32_t i = 0; i < entries; ++i) found[0][i] = std::max(found[0][i], found[share][i]);
  }
  return std::move(found[0]);
}

// What facets put below each candidate; sums of floating point, so shares are joined in their order.
struct Spread {
  Buffer<double> within;  // mm2 inside of a cell
  Buffer<double> slope;   // mm2 per nm that begins (or ends) to cover whole cells at a candidate
  explicit Spread(std::uint32_t candidates) : within(candidates, 0.0), slope(candidates + 1, 0.0) {}

  void add(const CandidateHeights& candidate_heights, Nm lo, Nm hi, double mm2) {
    const auto [first, last] = candidate_heights.cells_between(lo, hi);
    if (first >= last) return;
    if (last - first == 1 && lo >= candidate_heights[first] && hi <= candidate_heights[last]) {
      within[first] += mm2;
      return;
    }
    const double density = mm2 / (static_cast<double>(hi) - lo);
    const auto share = [&](std::uint32_t cell) {
      return density * static_cast<double>(std::min<std::int64_t>(hi, candidate_heights[cell + 1]) -
                                           std::max<std::int64_t>(lo, candidate_heights[cell]));
    };
    within[first] += share(first);
    if (last - first < 2) return;
    within[last - 1] += share(last - 1);
    if (last - first < 3) return;
    slope[first + 1] += density;
    slope[last - 1] -= density;
  }
  void add(const Spread& other) {
    for (std::size_t i = 0; i < within.size(); ++i) within[i] += other.within[i];
    for (std::size_t i = 0; i < slope.size(); ++i) slope[i] += other.slope[i];
  }
};

}  // namespace

double angle_of(Steepness steepness) {
  return std::asin(static_cast<double>(steepness) / kHorizontal) * 180 / std::numbers::pi;
}

const Steepness* measure_slopes(std::span<const Triangle> facets, const SlopeRule& rule, Slope slope, Buffer<Steepness>& out) {
  MeasuredGroup group;
  double unused = 0;
  out.resize(facets.size());
  for (std::size_t first = 0; first < facets.size(); first += kGroup) {
    const std::size_t size = std::min(kGroup, facets.size() - first);
    group.measure(facets.data() + first, size, rule, unused);
    std::copy_n(slope == Slope::kAngles && rule.is_scaled() ? group.angles : group.steps, size, out.data() + first);
  }
  return out.data();
}

std::uint32_t worthwhile_shares(const SurfaceIndex& index, std::span<const PartSurface> parts, std::size_t entries) {
  std::size_t facets = 0;
  for (const PartSurface& part : parts) {
    for (const PlacedSurface& placed : part.placed) facets += index.meshes[placed.mesh].facets();
  }
  constexpr std::size_t kFacetsAnEntry = 1, kMax = 32;
  return static_cast<std::uint32_t>(std::clamp<std::size_t>(facets / (kFacetsAnEntry * entries + 1), 1, kMax));
}

SurfaceIndex index_surface(std::span<const Mesh> meshes, std::span<const Instance> instances,
                           std::span<const std::uint32_t> part_of_instance, std::uint32_t part_count,
                           const SurfaceOptions& options, std::span<const ScaleFactors> scale) {
  SurfaceIndex index;
  index.meshes.reserve(meshes.size());
  for (std::size_t m = 0; m < meshes.size(); ++m) {
    SlopeRule rule{std::sin(options.peak_angle_deg * std::numbers::pi / 180) - options.normal_tolerance, options.flat_tolerance,
                   options.min_facet_mm2};
    if (!scale.empty()) rule.scale = scale[m];
    rule.shrunk_steps = rule.is_scaled() && options.nominal_cusps;
    index.meshes.push_back(slopes_of(meshes[m], rule));
  }

  std::map<std::tuple<std::uint32_t, std::uint32_t, Nm>, std::uint32_t> copies;  // (part, mesh, raise)
  for (std::size_t i = 0; i < instances.size(); ++i) {
    ++copies[{part_of_instance[i], instances[i].mesh, instances[i].offset.z}];
  }
  index.parts.resize(part_count);
  std::vector<bool> detected(part_count);
  for (const auto& [key, count] : copies) {
    const auto& [part, mesh, raise] = key;
    const Box& box = meshes[mesh].bounds;
    PartSurface& surface = index.parts[part];
    surface.placed.push_back({mesh, raise, count});
    const Nm bottom = box.lo.z + raise, top = box.hi.z + raise;
    surface.bottom = detected[part] ? std::min(surface.bottom, bottom) : bottom;
    surface.top = detected[part] ? std::max(surface.top, top) : top;
    detected[part] = true;
    index.top = std::max(index.top, top);
    index.area_mm2 += index.meshes[mesh].area_mm2 * count;
  }
  return index;
}

std::vector<Flat> find_flats(const SurfaceIndex& index, Nm tolerance, double min_mm2) {
  std::vector<Face> faces;
  for (std::uint32_t part = 0; part < index.parts.size(); ++part) {
    const PartSurface& surface = index.parts[part];
    for (const PlacedSurface& placed : surface.placed) {
      for (const FlatFacet& flat : index.meshes[placed.mesh].flats) {
        faces.push_back({flat.height + placed.raise, part, flat.up, false, flat.mm2});
      }
    }
    faces.push_back({surface.bottom, part, false, true, 0});
    faces.push_back({surface.top, part, true, true, 0});
  }
  std::ranges::stable_sort(faces, {}, &Face::height);
  std::vector<Flat> flats;
  for (std::size_t first = 0, last = 0; first < faces.size(); first = last) {
    while (last < faces.size() && faces[last].height - faces[first].height <= tolerance) ++last;
    const Flat flat = flat_of(std::span(faces).subspan(first, last - first));
    if (flat.height > tolerance && (flat.end || flat.up_mm2 + flat.down_mm2 >= min_mm2)) flats.push_back(flat);
  }
  return flats;
}

std::int64_t distance_to_nearest(std::span<const std::int64_t> boundaries, std::int64_t height) {
  const auto above = std::ranges::lower_bound(boundaries, height);
  std::int64_t distance = INT64_MAX;
  if (above != boundaries.end()) distance = *above - height;
  if (above != boundaries.begin()) distance = std::min(distance, height - *(above - 1));
  return distance;
}

Buffer<Steepness> steepest_in_cells(const SurfaceIndex& index, std::span<const PartSurface> parts,
                                    const CandidateHeights& candidate_heights, Slope slope) {
  return steepest_by(index, parts, candidate_heights.cells(), slope,
                     [&](Nm lo, Nm hi) { return candidate_heights.cells_between(lo, hi); });
}

Buffer<Steepness> steepest_at_candidates(const SurfaceIndex& index, std::span<const PartSurface> parts,
                                         const CandidateHeights& candidate_heights, Slope slope) {
  return steepest_by(index, parts, candidate_heights.candidates(), slope, [&](Nm lo, Nm hi) {
    return CandidateHeights::CellRange{candidate_heights.candidates_up_to(lo), candidate_heights.candidates_up_to(hi)};
  });
}

Buffer<double> projected_below(const SurfaceIndex& index, std::span<const PartSurface> parts,
                               const CandidateHeights& candidate_heights, Sign sign) {
  const std::uint32_t shares = worthwhile_shares(index, parts, 4 * candidate_heights.candidates());  // doubles of two arrays
  std::vector<std::optional<Spread>> spreads(shares);
  tbb::parallel_for(0u, shares, [&](std::uint32_t share) {
    Spread& spread = spreads[share].emplace(candidate_heights.candidates());
    for (const PartSurface& part : parts) {
      for (const PlacedSurface& placed : part.placed) {
        const MeshSlopes& mesh = index.meshes[placed.mesh];
        for_each_slope(mesh, placed, share, shares, [&](Nm lo, Nm hi, Steepness, double projected) {
          spread.add(candidate_heights, lo, hi, sign == Sign::kBoth ? std::abs(projected) * mesh.step_share : projected);
        });
      }
    }
  });
  Spread& all = *spreads[0];
  for (std::uint32_t share = 1; share < shares; ++share) all.add(*spreads[share]);
  Buffer<double> below(candidate_heights.candidates(), 0.0);
  double density = 0;
  for (std::uint32_t cell = 0; cell < candidate_heights.cells(); ++cell) {
    density += all.slope[cell];
    below[cell + 1] =
        below[cell] + all.within[cell] + density * static_cast<double>(candidate_heights[cell + 1] - candidate_heights[cell]);
  }
  return below;
}

Buffer<double> section_at_candidates(const SurfaceIndex& index, const CandidateHeights& candidate_heights, Nm tolerance) {
  Buffer<double> section = projected_below(index, index.parts, candidate_heights, Sign::kUpMinusDown);
  std::vector<std::pair<std::int64_t, double>> faces;  // horizontal ones change the section at once
  for (const PartSurface& part : index.parts) {
    for (const PlacedSurface& placed : part.placed) {
      for (const FlatFacet& flat : index.meshes[placed.mesh].flats) {
        faces.emplace_back(std::int64_t{flat.height} + placed.raise, (flat.up ? flat.mm2 : -flat.mm2) * placed.copies);
      }
    }
  }
  std::ranges::stable_sort(faces, {}, &std::pair<std::int64_t, double>::first);
  double flat = 0;
  std::size_t next = 0;
  for (std::uint32_t candidate = 0; candidate < candidate_heights.candidates(); ++candidate) {
    for (; next < faces.size() && faces[next].first <= candidate_heights[candidate] + tolerance; ++next)
      flat += faces[next].second;
    section[candidate] = std::max(0.0, -flat - section[candidate]);
  }
  return section;
}

}  // namespace lamina::heights
