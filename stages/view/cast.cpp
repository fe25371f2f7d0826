#include "stages/view/cast.h"

#include <fmt/core.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "stages/support/late/embree.h"

namespace lamina::view {
namespace {

using RayVector = std::array<float, 3>;

/// Which axis of the bed is to the right, up and towards the viewer, and which way.
struct ViewFrame {
  int right, up, towards;
  float sign;  // of `towards`
};
constexpr ViewFrame frame_of(ViewSide side) {
  if (side == ViewSide::kTop) return {0, 1, 2, 1};
  if (side == ViewSide::kFront) return {0, 2, 1, -1};
  return {1, 2, 0, 1};
}

/// Where the light comes from: left, above, and from behind the viewer. Unit length; the rest is never quite dark.
constexpr RayVector kLight = {-0.35f, 0.45f, 0.82f};
constexpr float kMinLight = 0.15f;
constexpr float kDepthShade = 0.4f;

float float_mm(std::int64_t nm) { return static_cast<float>(mm(nm)); }

}  // namespace

struct Caster::State {
  RTCDevice device = nullptr;
  RTCScene scene = nullptr;
  std::vector<RTCScene> scene_of_mesh;
  Box box;

  ~State() {
    for (RTCScene shared : scene_of_mesh) {
      if (shared != nullptr) rtcReleaseScene(shared);
    }
    if (scene != nullptr) rtcReleaseScene(scene);
    if (device != nullptr) rtcReleaseDevice(device);
  }

  void add(RTCScene parent, RTCGeometry geometry) const {
    rtcCommitGeometry(geometry);
    rtcAttachGeometry(parent, geometry);
    rtcReleaseGeometry(geometry);
  }

  RTCScene new_scene() const {
    RTCScene made = rtcNewScene(device);
    rtcSetSceneFlags(made, static_cast<RTCSceneFlags>(RTC_SCENE_FLAG_ROBUST | RTC_SCENE_FLAG_COMPACT));
    return made;
  }

  /// false if there was no memory for it
  bool add_mesh(const Mesh& mesh) {
    RTCGeometry geometry = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_TRIANGLE);
    const std::size_t count = mesh.triangles.size();
    auto* corners = static_cast<RayVector*>(
        rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, sizeof(RayVector), 3 * count));
    auto* indices = static_cast<unsigned*>(
        rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, 3 * sizeof(unsigned), count));
    if (corners == nullptr || indices == nullptr) {
      rtcReleaseGeometry(geometry);
      return false;
    }
    for (const Triangle& triangle : mesh.triangles) {
      for (const Point3& p : {triangle.a, triangle.b, triangle.c}) *corners++ = {float_mm(p.x), float_mm(p.y), float_mm(p.z)};
    }
    for (unsigned i = 0; i < 3 * count; ++i) indices[i] = i;
    scene_of_mesh.push_back(new_scene());
    add(scene_of_mesh.back(), geometry);
    rtcCommitScene(scene_of_mesh.back());
    return true;
  }

  /// How light the facet is that a ray meets first; negative if it meets none. The parts lie between the two depths, mm.
  float light(const ViewFrame& frame, const RayVector& origin, float first_depth, float last_depth) const {
    RayContext context;
    RTCRayHit ray{};
    ray.ray.org_x = origin[0], ray.ray.org_y = origin[1], ray.ray.org_z = origin[2];
    RayVector way{};
    way[static_cast<std::size_t>(frame.towards)] = -frame.sign;
    ray.ray.dir_x = way[0], ray.ray.dir_y = way[1], ray.ray.dir_z = way[2];
    ray.ray.tfar = std::numeric_limits<float>::infinity();
    ray.ray.mask = ~0u;
    ray.hit.geomID = ray.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
    trace(scene, context, ray);
    if (ray.hit.geomID == RTC_INVALID_GEOMETRY_ID) return -1;
    const RayVector normal = {ray.hit.Ng_x, ray.hit.Ng_y, ray.hit.Ng_z};
    const auto of = [&](int axis) { return normal[static_cast<std::size_t>(axis)]; };
    const float length = std::hypot(normal[0], normal[1], normal[2]);
    if (!(length > 0)) return kMinLight;
    // A facet that is turned over is shaded like one that is not.
    const float turned = of(frame.towards) * frame.sign < 0 ? -1.0f : 1.0f;
    const float lit =
        (kLight[0] * of(frame.right) + kLight[1] * of(frame.up) + kLight[2] * frame.sign * of(frame.towards)) * turned;
    // What lies deeper is darker, so that faces of one orientation can be distinguished.
    const float depth = (ray.ray.tfar - first_depth) / std::max(last_depth - first_depth, 1e-6f);
    const float near = 1 - kDepthShade * std::clamp(depth, 0.0f, 1.0f);
    return (kMinLight + (1 - kMinLight) * std::max(0.0f, lit / length)) * near;
  }
};

Caster::Caster() : state_(std::make_unique<State>()) {}
Caster::Caster(Caster&&) noexcept = default;
Caster::~Caster() = default;

Result<Caster> Caster::build(std::span<const Mesh> meshes, std::span<const Instance> instances) {
  if (const Status loaded = load_embree(); !loaded) return loaded.error();
  Caster caster;
  State& state = *caster.state_;
  state.device = rtcNewDevice(nullptr);
  const auto failed = [&] {
    return Error{Fault::kInternal, fmt::format("Embree: error {} while parts were made ready for a picture",
                                               static_cast<int>(rtcGetDeviceError(state.device)))};
  };
  if (state.device == nullptr) return failed();
  for (const Mesh& mesh : meshes) {
    if (!state.add_mesh(mesh)) return failed();
  }
  state.scene = state.new_scene();
  for (const Instance& instance : instances) {
    const Box& own = meshes[instance.mesh].bounds;
    const Point3& by = instance.offset;
    if (own.empty()) continue;
    state.box.add(Point3{own.lo.x + by.x, own.lo.y + by.y, own.lo.z + by.z});
    state.box.add(Point3{own.hi.x + by.x, own.hi.y + by.y, own.hi.z + by.z});
    RTCGeometry geometry = rtcNewGeometry(state.device, RTC_GEOMETRY_TYPE_INSTANCE);
    rtcSetGeometryInstancedScene(geometry, state.scene_of_mesh[instance.mesh]);
    const float move[12] = {1, 0, 0, 0, 1, 0, 0, 0, 1, float_mm(by.x), float_mm(by.y), float_mm(by.z)};
    rtcSetGeometryTransform(geometry, 0, RTC_FORMAT_FLOAT3X4_COLUMN_MAJOR, move);
    state.add(state.scene, geometry);
  }
  rtcCommitScene(state.scene);
  if (rtcGetDeviceError(state.device) != RTC_ERROR_NONE) return failed();
  return caster;
}

Picture Caster::render(ViewSide side, std::uint32_t maximum) const {
  const ViewFrame frame = frame_of(side);
  const Box& box = state_->box;
  const RayVector lo = {float_mm(box.lo.x), float_mm(box.lo.y), float_mm(box.lo.z)};
  const RayVector hi = {float_mm(box.hi.x), float_mm(box.hi.y), float_mm(box.hi.z)};
  const auto extent = [&](int axis) { return hi[static_cast<std::size_t>(axis)] - lo[static_cast<std::size_t>(axis)]; };
  const float longest = std::max({extent(0), extent(1), extent(2), 1e-6f}), pixel = longest / static_cast<float>(maximum);
  const auto pixels = [&](int axis) {
    return std::clamp(static_cast<std::uint32_t>(std::ceil(extent(axis) / pixel)), 1u, maximum);
  };
  Picture picture;
  picture.width = pixels(frame.right);
  picture.height = pixels(frame.up);
  picture.width_mm = extent(frame.right);
  picture.height_mm = extent(frame.up);
  picture.light_cover.resize(std::size_t{2} * picture.width * picture.height);
  const auto right = static_cast<std::size_t>(frame.right), up = static_cast<std::size_t>(frame.up);
  const auto towards = static_cast<std::size_t>(frame.towards);
  tbb::parallel_for(0u, picture.height, [&](std::uint32_t row) {
    std::uint8_t* position = picture.light_cover.data() + std::size_t{2} * picture.width * row;
    for (std::uint32_t column = 0; column < picture.width; ++column) {
      float sum = 0;
      int hits = 0;
      for (const auto& [x, y] : {std::pair{0.25f, 0.25f}, {0.75f, 0.25f}, {0.25f, 0.75f}, {0.75f, 0.75f}}) {
        RayVector origin{};
        origin[right] = lo[right] + (static_cast<float>(column) + x) / static_cast<float>(picture.width) * extent(frame.right);
        origin[up] = hi[up] - (static_cast<float>(row) + y) / static_cast<float>(picture.height) * extent(frame.up);
        origin[towards] = (frame.sign > 0 ? hi : lo)[towards] + frame.sign * longest;
        const float light = state_->light(frame, origin, longest, longest + extent(frame.towards));
        if (light < 0) continue;
        sum += light;
        ++hits;
      }
      *position++ = hits == 0 ? std::uint8_t{0} : static_cast<std::uint8_t>(std::lround(255 * sum / static_cast<float>(hits)));
      *position++ = static_cast<std::uint8_t>(std::min(255, 64 * hits));
    }
  });
  return picture;
}

}  // namespace lamina::view
