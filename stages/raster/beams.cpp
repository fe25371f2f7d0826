#include "stages/raster/beams.h"

#include <embree3/rtcore.h>
#include <fmt/core.h>

#include <atomic>
#include <cstring>
#include <limits>
#include <vector>

namespace lamina::raster {
namespace {

/// Spare room of every box, nm: float holds coordinates up to 2.1e9 nm to 128 nm, and an instance adds two roundings.
constexpr float kRoundingRoom = 1024;

/// What Embree hands back with a primitive.
struct Source {
  const PlacedMesh* placed = nullptr;  // the first, or only, instance of the mesh
  bool shared = false;                 // several instances: the instance says which one
  std::uint32_t instance = 0;          // if not shared
  float half_band = 0;
};

/// The context that a ray carries through the tree.
struct Beam {
  RTCIntersectContext context;
  const std::uint32_t* instance_of_geometry;
  ClusterVisits* visits;
};

void cluster_bounds(const RTCBoundsFunctionArguments* arguments) {
  const auto& source = *static_cast<const Source*>(arguments->geometryUserPtr);
  const Box& box = source.placed->mesh->bounds[arguments->primID];
  const Point3 move = source.shared ? Point3{0, 0, 0} : source.placed->offset;
  const auto at = [](Nm coordinate, Nm offset) { return static_cast<float>(std::int64_t{coordinate} + offset); };
  RTCBounds& bounds = *arguments->bounds_o;
  bounds.lower_x = at(box.lo.x, move.x) - kRoundingRoom;
  bounds.lower_y = at(box.lo.y, move.y) - kRoundingRoom - source.half_band;
  bounds.lower_z = at(box.lo.z, move.z) - kRoundingRoom;
  bounds.upper_x = at(box.hi.x, move.x) + kRoundingRoom;
  bounds.upper_y = at(box.hi.y, move.y) + kRoundingRoom + source.half_band;
  bounds.upper_z = at(box.hi.z, move.z) + kRoundingRoom;
}

/// Embree reports its own lack of memory, or of threads, by a code.
Error failed(RTCError code, const std::string& what) {
  if (code == RTC_ERROR_OUT_OF_MEMORY) return {Fault::kMemory, "Embree: " + out_of_memory().message};
  return {Fault::kInternal, fmt::format("Embree: {} (error {})", what, static_cast<int>(code))};
}

/// Notes the cluster and never reports a hit, so that the traversal goes on.
void visit_cluster(const RTCIntersectFunctionNArguments* arguments) {
  if (arguments->valid[0] == 0) return;
  const auto& source = *static_cast<const Source*>(arguments->geometryUserPtr);
  auto& beam = *reinterpret_cast<Beam*>(arguments->context);
  beam.visits->push_back(
      {arguments->primID, source.shared ? beam.instance_of_geometry[arguments->context->instID[0]] : source.instance});
}

}  // namespace

struct BeamIndex::State {
  RTCDevice device = nullptr;
  RTCScene scene = nullptr;
  std::vector<RTCScene> shared_scenes;
  std::vector<Source> sources;
  std::vector<std::uint32_t> instance_of_geometry;  // by geometry id of the top scene
  std::span<const PlacedMesh> placed;
  std::atomic<std::int64_t> bytes{0};
  std::string failure;
  RTCError failure_code = RTC_ERROR_NONE;

  ~State() {
    for (RTCScene shared : shared_scenes) rtcReleaseScene(shared);
    if (scene != nullptr) rtcReleaseScene(scene);
    if (device != nullptr) rtcReleaseDevice(device);
  }

  void attach(RTCScene parent, RTCGeometry geometry, std::uint32_t instance) {
    rtcCommitGeometry(geometry);
    const std::uint32_t id = rtcAttachGeometry(parent, geometry);
    rtcReleaseGeometry(geometry);
    if (parent != scene) return;
    if (instance_of_geometry.size() <= id) instance_of_geometry.resize(std::size_t{id} + 1);
    instance_of_geometry[id] = instance;
  }

  RTCGeometry cluster_geometry(Source& source) const {
    RTCGeometry geometry = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_USER);
    rtcSetGeometryUserPrimitiveCount(geometry, static_cast<unsigned>(source.placed->mesh->clusters.size()));
    rtcSetGeometryUserData(geometry, &source);
    rtcSetGeometryBoundsFunction(
        geometry, [](const RTCBoundsFunctionArguments* a) { cluster_bounds(a); }, nullptr);
    rtcSetGeometryIntersectFunction(geometry, visit_cluster);
    return geometry;
  }
};

BeamIndex::BeamIndex(BeamIndex&&) noexcept = default;
BeamIndex& BeamIndex::operator=(BeamIndex&&) noexcept = default;
BeamIndex::~BeamIndex() = default;

Result<BeamIndex> BeamIndex::build(std::span<const PlacedMesh> placed, const PixelGrid& grid, std::uint32_t band_rows) {
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
  state.scene = rtcNewScene(state.device);
  rtcSetSceneFlags(state.scene, RTC_SCENE_FLAG_ROBUST | RTC_SCENE_FLAG_COMPACT);

  const auto half_band = static_cast<float>((grid.y.centre(std::int64_t{band_rows} - 1) - grid.y.centre(0)) / 2 + 2);

  // Instances of one mesh follow each other here; a mesh that stands once needs no level of its own.
  std::vector<std::uint32_t> order(placed.size());
  for (std::uint32_t i = 0; i < order.size(); ++i) order[i] = i;
  std::stable_sort(order.begin(), order.end(),
                   [&](std::uint32_t a, std::uint32_t b) { return placed[a].mesh < placed[b].mesh; });
  state.sources.reserve(placed.size());
  for (std::size_t begin = 0; begin < order.size();) {
    std::size_t end = begin + 1;
    while (end < order.size() && placed[order[end]].mesh == placed[order[begin]].mesh) ++end;
    Source& source = state.sources.emplace_back();
    source = {&placed[order[begin]], end - begin > 1, order[begin], half_band};
    if (!source.shared) {
      state.attach(state.scene, state.cluster_geometry(source), source.instance);
    } else {
      RTCScene shared = rtcNewScene(state.device);
      state.shared_scenes.push_back(shared);
      rtcSetSceneFlags(shared, RTC_SCENE_FLAG_ROBUST | RTC_SCENE_FLAG_COMPACT);
      state.attach(shared, state.cluster_geometry(source), 0);
      rtcCommitScene(shared);
      for (std::size_t i = begin; i < end; ++i) {
        const Point3& offset = placed[order[i]].offset;
        const float transform[12] = {1, 0, 0, static_cast<float>(offset.x), 0, 1, 0, static_cast<float>(offset.y),
                                     0, 0, 1, static_cast<float>(offset.z)};
        RTCGeometry geometry = rtcNewGeometry(state.device, RTC_GEOMETRY_TYPE_INSTANCE);
        rtcSetGeometryInstancedScene(geometry, shared);
        rtcSetGeometryTransform(geometry, 0, RTC_FORMAT_FLOAT3X4_ROW_MAJOR, transform);
        state.attach(state.scene, geometry, order[i]);
      }
    }
    begin = end;
  }
  rtcCommitScene(state.scene);
  if (!state.failure.empty()) return failed(state.failure_code, state.failure);
  return index;
}

void BeamIndex::find_clusters(const PixelSampling& sampling, Nm plane, std::uint32_t first_row, std::uint32_t last_row,
                              ClusterVisits& out) const {
  Beam beam;
  rtcInitIntersectContext(&beam.context);
  beam.instance_of_geometry = state_->instance_of_geometry.data();
  beam.visits = &out;

  RTCRayHit ray;
  std::memset(&ray, 0, sizeof ray);
  const std::int64_t y = (sampling.y.centre(first_row) + sampling.y.centre(last_row - 1)) / 2;
  ray.ray.org_x = -4 * kRoundingRoom;
  ray.ray.org_y = static_cast<float>(y);
  ray.ray.org_z = static_cast<float>(plane);
  ray.ray.dir_x = 1;
  ray.ray.tnear = 0;
  ray.ray.tfar = std::numeric_limits<float>::infinity();
  ray.ray.mask = ~0u;
  ray.hit.geomID = RTC_INVALID_GEOMETRY_ID;
  ray.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
  rtcIntersect1(state_->scene, &beam.context, &ray);
}

std::uint64_t BeamIndex::bytes() const { return static_cast<std::uint64_t>(std::max<std::int64_t>(0, state_->bytes)); }

}  // namespace lamina::raster
