#include "stages/raster/beams.h"

#include <fmt/core.h>
#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#if defined(__SSE2__)
#include <emmintrin.h>
#endif

#include <algorithm>
#include <atomic>
#include <bit>
#include <cstring>
#include <limits>
#include <vector>

#include "stages/support/late/embree.h"

namespace lamina::raster {
namespace {

/// Bits by which a length is shifted to fit into 16.
std::uint32_t shift_for(std::int64_t length) {
  return static_cast<std::uint32_t>(std::max(16, static_cast<int>(std::bit_width(static_cast<std::uint64_t>(length))))) - 16;
}

std::uint16_t step_of(std::int64_t distance, std::uint32_t shift) { return static_cast<std::uint16_t>(distance >> shift); }

/// Margin around every box, nm: float holds coordinates up to 2.1e9 nm to 128 nm, and an instance adds two roundings.
constexpr float kRoundingMargin = 1024;

/// What Embree hands back with a run of clusters.
struct BeamSource {
  const PlacedMesh* placed;  // the first, or only, instance of the mesh
  HeightRuns runs;
  bool shared = false;         // several instances: the beam says which one
  std::uint32_t instance = 0;  // if not shared
  float half_band = 0;
};

/// Copies of meshes that stand several times: one primitive a copy, 8 bytes, where Embree's own instances are objects of
/// hundreds of bytes each.
struct Copies {
  struct One {
    std::uint32_t instance, scene;
  };
  std::span<const PlacedMesh> placed;
  std::vector<RTCScene> scenes;  // of each mesh
  Buffer<One> copies;
};

/// A ray towards +x, and what it carries through the tree. Its position is in nm, for copies see it from their own frames.
struct Beam {
  RayContext context;
  std::int64_t x, y, z;
  std::int64_t low, high;      // y of the first and the last row of the band
  std::uint32_t instance = 0;  // the copy in which it is
  std::span<const PlacedMesh> placed;
  ClusterVisits* visits;
};

/// Sends the beam through a scene whose origin is at `offset`.
void shoot(Beam& beam, RTCScene scene, Point3 offset) {
  RTCRayHit ray;
  std::memset(&ray, 0, sizeof ray);
  ray.ray.org_x = static_cast<float>(beam.x - offset.x);
  ray.ray.org_y = static_cast<float>(beam.y - offset.y);
  ray.ray.org_z = static_cast<float>(beam.z - offset.z);
  ray.ray.dir_x = 1;
  ray.ray.tnear = 0;
  ray.ray.tfar = std::numeric_limits<float>::infinity();
  ray.ray.mask = ~0u;
  ray.hit.geomID = RTC_INVALID_GEOMETRY_ID;
  ray.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
  trace(scene, beam.context, ray);
}

void run_bounds(const RTCBoundsFunctionArguments* arguments) {
  const auto& source = *static_cast<const BeamSource*>(arguments->geometryUserPtr);
  const Box& box = source.runs.box(arguments->primID);
  const Point3 move = source.shared ? Point3{0, 0, 0} : source.placed->offset;
  const auto at = [](Nm coordinate, Nm offset) { return static_cast<float>(std::int64_t{coordinate} + offset); };
  RTCBounds& bounds = *arguments->bounds_o;
  bounds.lower_x = at(box.lo.x, move.x) - kRoundingMargin;
  bounds.lower_y = at(box.lo.y, move.y) - kRoundingMargin - source.half_band;
  bounds.lower_z = at(box.lo.z, move.z) - kRoundingMargin;
  bounds.upper_x = at(box.hi.x, move.x) + kRoundingMargin;
  bounds.upper_y = at(box.hi.y, move.y) + kRoundingMargin + source.half_band;
  bounds.upper_z = at(box.hi.z, move.z) + kRoundingMargin;
}

void copy_bounds(const RTCBoundsFunctionArguments* arguments) {
  const auto& all = *static_cast<const Copies*>(arguments->geometryUserPtr);
  const Copies::One copy = all.copies[arguments->primID];
  const Point3 move = all.placed[copy.instance].offset;
  RTCBounds& bounds = *arguments->bounds_o;
  rtcGetSceneBounds(all.scenes[copy.scene], &bounds);
  bounds.lower_x += static_cast<float>(move.x) - kRoundingMargin;
  bounds.lower_y += static_cast<float>(move.y) - kRoundingMargin;
  bounds.lower_z += static_cast<float>(move.z) - kRoundingMargin;
  bounds.upper_x += static_cast<float>(move.x) + kRoundingMargin;
  bounds.upper_y += static_cast<float>(move.y) + kRoundingMargin;
  bounds.upper_z += static_cast<float>(move.z) + kRoundingMargin;
}

/// Embree reports its own lack of memory, or of threads, by a code.
Error failed(RTCError code, const std::string& what) {
  if (code == RTC_ERROR_OUT_OF_MEMORY) return {Fault::kMemory, "Embree: " + out_of_memory().message};
  return {Fault::kInternal, fmt::format("Embree: {} (error {})", what, static_cast<int>(code))};
}

/// Notes the run's clusters and never reports a hit, so that the traversal continues.
void visit_run(const RTCIntersectFunctionNArguments* arguments) {
  if (arguments->valid[0] == 0) return;
  const auto& source = *static_cast<const BeamSource*>(arguments->geometryUserPtr);
  auto& beam = *reinterpret_cast<Beam*>(arguments->context);
  const std::uint32_t instance = source.shared ? beam.instance : source.instance;
  const Point3& offset = beam.placed[instance].offset;
  source.runs.find_clusters(arguments->primID, beam.z - offset.z, beam.low - offset.y, beam.high - offset.y, instance,
                            *beam.visits);
}

/// Continues within a copy, and never reports a hit either.
void visit_copy(const RTCIntersectFunctionNArguments* arguments) {
  if (arguments->valid[0] == 0) return;
  const auto& all = *static_cast<const Copies*>(arguments->geometryUserPtr);
  const Copies::One copy = all.copies[arguments->primID];
  Beam within = *reinterpret_cast<const Beam*>(arguments->context);
  within.instance = copy.instance;
  shoot(within, all.scenes[copy.scene], all.placed[copy.instance].offset);
}

}  // namespace

HeightRuns::HeightRuns(std::span<const Box> bounds)
    : bounds_(bounds),
      runs_(ceil_div(bounds.size(), std::size_t{kRun})),
      groups_(ceil_div(bounds.size(), std::size_t{kLanes})),
      tops_(runs_.size()) {
  constexpr std::uint32_t kAtOnce = 16;
  tbb::parallel_for(tbb::blocked_range<std::uint32_t>(0, count(), kAtOnce),
                    [&](const tbb::blocked_range<std::uint32_t>& range) {
                      for (std::uint32_t run = range.begin(); run != range.end(); ++run) build_run(bounds, run);
                    });
}

void HeightRuns::build_run(std::span<const Box> bounds, std::uint32_t run) {
  const std::size_t first = std::size_t{run} * kRun, size = std::min<std::size_t>(kRun, bounds.size() - first);
  Box box;
  for (const Box& one : bounds.subspan(first, size)) box.add(one);
  runs_[run] = box;
  const std::uint32_t z_shift = shift_for(box.height()), y_shift = shift_for(box.depth());
  Group& top = tops_[run];
  top.clear();
  for (std::size_t begin = 0; begin < size; begin += kLanes) {
    Group& group = groups_[(first + begin) / kLanes];
    group.clear();
    for (std::size_t lane = 0; lane < std::min<std::size_t>(kLanes, size - begin); ++lane) {
      const Box& one = bounds[first + begin + lane];
      if (one.height() == 0) continue;
      group.z_begin[lane] = step_of(std::int64_t{one.lo.z} - box.lo.z, z_shift);
      group.z_last[lane] = step_of(std::int64_t{one.hi.z} - 1 - box.lo.z, z_shift);
      group.y_begin[lane] = step_of(std::int64_t{one.lo.y} - box.lo.y, y_shift);
      group.y_last[lane] = step_of(std::int64_t{one.hi.y} - box.lo.y, y_shift);
    }
    top.join(begin / kLanes, group);
  }
}

void HeightRuns::Group::clear() {
  std::ranges::fill(z_begin, UINT16_MAX);
  std::ranges::fill(y_begin, UINT16_MAX);
  std::ranges::fill(z_last, std::uint16_t{0});
  std::ranges::fill(y_last, std::uint16_t{0});
}

void HeightRuns::Group::join(std::size_t lane, const Group& group) {
  z_begin[lane] = std::ranges::min(group.z_begin);
  z_last[lane] = std::ranges::max(group.z_last);
  y_begin[lane] = std::ranges::min(group.y_begin);
  y_last[lane] = std::ranges::max(group.y_last);
}

inline std::uint32_t HeightRuns::lanes_met(const Group& group, const Search& search) {
#if defined(__SSE2__)
  // Differences of unsigned numbers that stop at zero: a <= b exactly if a - b does.
  const auto all = [](std::uint16_t value) { return _mm_set1_epi16(static_cast<short>(value)); };
  const auto eight = [](const std::uint16_t* row, int half) {
    return _mm_load_si128(reinterpret_cast<const __m128i*>(row) + half);
  };
  const auto neighbour = [&](const std::uint16_t* begin, const std::uint16_t* last, __m128i low, __m128i high, int half) {
    return _mm_or_si128(_mm_subs_epu16(eight(begin, half), high), _mm_subs_epu16(low, eight(last, half)));
  };
  const __m128i z = all(search.z);
  __m128i gap[2] = {neighbour(group.z_begin, group.z_last, z, z, 0), neighbour(group.z_begin, group.z_last, z, z, 1)};
  if (!search.all_rows) {
    const __m128i low = all(search.y_low), high = all(search.y_high);
    for (int half = 0; half < 2; ++half) {
      gap[half] = _mm_or_si128(gap[half], neighbour(group.y_begin, group.y_last, low, high, half));
    }
  }
  const __m128i none = _mm_setzero_si128();
  const __m128i met = _mm_packs_epi16(_mm_cmpeq_epi16(gap[0], none), _mm_cmpeq_epi16(gap[1], none));
  return static_cast<std::uint32_t>(_mm_movemask_epi8(met));
#else
  std::uint32_t lanes = 0;
  for (std::uint32_t lane = 0; lane < kLanes; ++lane) {
    const bool met = group.z_begin[lane] <= search.z && search.z <= group.z_last[lane] &&
                     (search.all_rows || (group.y_begin[lane] <= search.y_high && search.y_low <= group.y_last[lane]));
    lanes |= static_cast<std::uint32_t>(met) << lane;
  }
  return lanes;
#endif
}

void HeightRuns::find_clusters(std::uint32_t run, std::int64_t plane, std::int64_t low, std::int64_t high,
                               std::uint32_t instance, ClusterVisits& out) const {
  const Box& box = runs_[run];
  if (plane < box.lo.z || plane >= box.hi.z || high < box.lo.y || low > box.hi.y) return;
  const std::uint32_t y_shift = shift_for(box.depth());
  const Search search{step_of(plane - box.lo.z, shift_for(box.height())),
                      step_of(std::max<std::int64_t>(0, low - box.lo.y), y_shift),
                      step_of(std::min(box.depth(), high - box.lo.y), y_shift), low <= box.lo.y && high >= box.hi.y};
  const std::uint32_t first = run * (kRun / kLanes), met = lanes_met(tops_[run], search);
  for (std::uint32_t groups = met; groups != 0; groups &= groups - 1) {  // no cache holds the tables of a large mesh
    const auto* const group =
        reinterpret_cast<const char*>(&groups_[first + static_cast<std::uint32_t>(std::countr_zero(groups))]);
    __builtin_prefetch(group);
    __builtin_prefetch(group + sizeof(Group) / 2);
  }
  for (std::uint32_t groups = met; groups != 0; groups &= groups - 1) {
    const std::uint32_t number = first + static_cast<std::uint32_t>(std::countr_zero(groups));
    const Group& group = groups_[number];
    for (std::uint32_t lanes = lanes_met(group, search); lanes != 0; lanes &= lanes - 1) {
      const auto lane = static_cast<std::uint32_t>(std::countr_zero(lanes));
      const std::uint32_t cluster = number * kLanes + lane;
      const bool ends_here = group.z_begin[lane] == search.z || group.z_last[lane] == search.z;
      if (ends_here && (bounds_[cluster].lo.z > plane || bounds_[cluster].hi.z <= plane)) continue;
      out.push_back({cluster, instance});
    }
  }
}

struct BeamIndex::State {
  RTCDevice device = nullptr;
  RTCScene scene = nullptr;
  std::vector<BeamSource> sources;  // of each mesh
  Copies copies;
  std::span<const PlacedMesh> placed;
  std::atomic<std::int64_t> bytes{0};
  std::string failure;
  RTCError failure_code = RTC_ERROR_NONE;

  ~State() {
    for (RTCScene shared : copies.scenes) rtcReleaseScene(shared);
    if (scene != nullptr) rtcReleaseScene(scene);
    if (device != nullptr) rtcReleaseDevice(device);
  }

  void attach(RTCScene parent, std::size_t count, void* data, RTCBoundsFunction bounds, RTCIntersectFunctionN visit) const {
    RTCGeometry geometry = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_USER);
    rtcSetGeometryUserPrimitiveCount(geometry, static_cast<unsigned>(count));
    rtcSetGeometryUserData(geometry, data);
    rtcSetGeometryBoundsFunction(geometry, bounds, nullptr);
    rtcSetGeometryIntersectFunction(geometry, visit);
    rtcCommitGeometry(geometry);
    rtcAttachGeometry(parent, geometry);
    rtcReleaseGeometry(geometry);
  }

  void attach_runs(RTCScene parent, BeamSource& source) const {
    attach(parent, source.runs.count(), &source, run_bounds, visit_run);
  }

  RTCScene new_scene() const {
    RTCScene made = rtcNewScene(device);
    rtcSetSceneFlags(made, RTC_SCENE_FLAG_ROBUST | RTC_SCENE_FLAG_COMPACT);
    return made;
  }
};

void BeamIndex::prepare() { static_cast<void>(load_embree()); }

Result<BeamIndex> BeamIndex::build(std::span<const PlacedMesh> placed, const PixelGrid& grid, std::uint32_t band_rows) {
  if (const Status loaded = load_embree(); !loaded) {
    if (loaded.error().fault == Fault::kMemory) return loaded.error();
    return Error{loaded.error().fault, loaded.error().message + ", or use --engine contours"};
  }
  const auto shared = std::make_shared<State>();
  State& state = *shared;
  state.placed = placed;
  state.device = rtcNewDevice("start_threads=0,set_affinity=0");
  if (state.device == nullptr) {
    return failed(rtcGetDeviceError(nullptr), "could not be started");
  }
  rtcSetDeviceErrorFunction(
      state.device,
      [](void* user, RTCError code, const char* text) {
        auto& embree = *static_cast<State*>(user);
        if (embree.failure.empty()) embree.failure = text, embree.failure_code = code;
      },
      &state);
  rtcSetDeviceMemoryMonitorFunction(
      state.device,
      [](void* user, ssize_t bytes, bool) {
        static_cast<State*>(user)->bytes += bytes;
        return true;
      },
      &state);
  state.scene = state.new_scene();

  const auto half_band = static_cast<float>((grid.y.centre(std::int64_t{band_rows} - 1) - grid.y.centre(0)) / 2 + 2);

  // Instances of one mesh follow each other here; a mesh that stands once needs no level of its own.
  std::vector<std::uint32_t> order(placed.size());
  for (std::uint32_t i = 0; i < order.size(); ++i) order[i] = i;
  std::stable_sort(order.begin(), order.end(),
                   [&](std::uint32_t a, std::uint32_t b) { return placed[a].mesh < placed[b].mesh; });
  std::size_t meshes = 0;
  for (std::size_t i = 0; i < order.size(); ++i) meshes += i == 0 || placed[order[i]].mesh != placed[order[i - 1]].mesh ? 1 : 0;
  state.sources.reserve(meshes);  // Embree keeps their addresses
  state.copies.placed = placed;
  for (std::size_t begin = 0; begin < order.size();) {
    std::size_t end = begin + 1;
    while (end < order.size() && placed[order[end]].mesh == placed[order[begin]].mesh) ++end;
    const PlacedMesh& first = placed[order[begin]];
    BeamSource& source = state.sources.emplace_back(
        BeamSource{&first, HeightRuns(first.mesh->bounds), end - begin > 1, order[begin], half_band});
    if (!source.shared) {
      state.attach_runs(state.scene, source);
    } else {
      const auto number = static_cast<std::uint32_t>(state.copies.scenes.size());
      const RTCScene of_copies = state.copies.scenes.emplace_back(state.new_scene());
      state.attach_runs(of_copies, source);
      rtcCommitScene(of_copies);
      for (std::size_t i = begin; i < end; ++i) state.copies.copies.push_back({order[i], number});
    }
    begin = end;
  }
  if (!state.copies.copies.empty()) {
    state.attach(state.scene, state.copies.copies.size(), &state.copies, copy_bounds, visit_copy);
  }
  rtcCommitScene(state.scene);
  if (!state.failure.empty()) return failed(state.failure_code, state.failure);
  BeamIndex index;
  index.state_ = shared;
  return index;
}

void BeamIndex::find_clusters(const PixelSampling& sampling, Nm plane, std::uint32_t first_row, std::uint32_t last_row,
                              ClusterVisits& out) const {
  Beam beam{};
  beam.x = static_cast<std::int64_t>(-4 * kRoundingMargin);
  beam.low = sampling.y.centre(first_row);
  beam.high = sampling.y.centre(last_row - 1);
  beam.y = (beam.low + beam.high) / 2;
  beam.z = plane;
  beam.placed = state_->placed;
  beam.visits = &out;
  shoot(beam, state_->scene, {0, 0, 0});
}

std::uint64_t BeamIndex::bytes() const {
  std::uint64_t total =
      static_cast<std::uint64_t>(std::max<std::int64_t>(0, state_->bytes)) + bytes_held(state_->copies.copies);
  for (const BeamSource& source : state_->sources) total += source.runs.bytes();
  return total;
}

}  // namespace lamina::raster
