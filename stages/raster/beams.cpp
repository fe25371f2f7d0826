#include "stages/raster/beams.h"

#include <fmt/core.h>

#include <atomic>
#include <cstring>
#include <limits>
#include <vector>

#include "stages/raster/height_runs.h"
#include "stages/support/late/embree.h"

namespace lamina::raster {
namespace {

/// Spare room of every box, nm: float holds coordinates up to 2.1e9 nm to 128 nm, and an instance adds two roundings.
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

/// A ray towards +x, and what it carries through the tree. Its place is in nm, for copies see it from their own frames.
struct Beam {
  RTCIntersectContext context;
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
  rtcInitIntersectContext(&beam.context);
  rtcIntersect1(scene, &beam.context, &ray);
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

/// Notes the run's clusters and never reports a hit, so that the traversal goes on.
void visit_run(const RTCIntersectFunctionNArguments* arguments) {
  if (arguments->valid[0] == 0) return;
  const auto& source = *static_cast<const BeamSource*>(arguments->geometryUserPtr);
  auto& beam = *reinterpret_cast<Beam*>(arguments->context);
  const std::uint32_t instance = source.shared ? beam.instance : source.instance;
  const Point3& offset = beam.placed[instance].offset;
  source.runs.find_clusters(arguments->primID, beam.z - offset.z, beam.low - offset.y, beam.high - offset.y, instance,
                            *beam.visits);
}

/// Goes on within a copy, and never reports a hit either.
void visit_copy(const RTCIntersectFunctionNArguments* arguments) {
  if (arguments->valid[0] == 0) return;
  const auto& all = *static_cast<const Copies*>(arguments->geometryUserPtr);
  const Copies::One copy = all.copies[arguments->primID];
  Beam within = *reinterpret_cast<const Beam*>(arguments->context);
  within.instance = copy.instance;
  shoot(within, all.scenes[copy.scene], all.placed[copy.instance].offset);
}

}  // namespace

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

BeamIndex::BeamIndex(BeamIndex&&) noexcept = default;
BeamIndex& BeamIndex::operator=(BeamIndex&&) noexcept = default;
BeamIndex::~BeamIndex() = default;

void BeamIndex::prepare() { static_cast<void>(load_embree()); }

Result<BeamIndex> BeamIndex::build(std::span<const PlacedMesh> placed, const PixelGrid& grid, std::uint32_t band_rows) {
  if (const Status loaded = load_embree(); !loaded) {
    if (loaded.error().fault == Fault::kMemory) return loaded.error();
    return Error{loaded.error().fault, loaded.error().message + ", or use --engine contours"};
  }
  BeamIndex index;
  index.state_ = std::make_unique<State>();
  State& state = *index.state_;
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
      const RTCScene shared = state.copies.scenes.emplace_back(state.new_scene());
      state.attach_runs(shared, source);
      rtcCommitScene(shared);
      for (std::size_t i = begin; i < end; ++i) state.copies.copies.push_back({order[i], number});
    }
    begin = end;
  }
  if (!state.copies.copies.empty()) {
    state.attach(state.scene, state.copies.copies.size(), &state.copies, copy_bounds, visit_copy);
  }
  rtcCommitScene(state.scene);
  if (!state.failure.empty()) return failed(state.failure_code, state.failure);
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
