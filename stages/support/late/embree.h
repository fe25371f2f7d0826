// stages/support/late/embree.h: Embree's functions, and Embree when it is first needed. Engine rays and views of parts use it.
// Embree 3 (Debian 12) and 4 (Debian 13) differ in how a ray carries its context.
#pragma once

#if LAMINA_EMBREE_MAJOR >= 4
#include <embree4/rtcore.h>
#else
#include <embree3/rtcore.h>
#endif

#include "stages/data/status.h"
#include "stages/support/late/late.h"

#define LAMINA_EMBREE(each)                                                                                                    \
  each(rtcNewDevice) each(rtcReleaseDevice) each(rtcGetDeviceError) each(rtcSetDeviceErrorFunction)                            \
      each(rtcSetDeviceMemoryMonitorFunction) each(rtcNewScene) each(rtcReleaseScene) each(rtcCommitScene)                     \
          each(rtcSetSceneFlags) each(rtcGetSceneBounds) each(rtcNewGeometry) each(rtcReleaseGeometry) each(rtcCommitGeometry) \
              each(rtcAttachGeometry) each(rtcSetNewGeometryBuffer) each(rtcSetGeometryUserPrimitiveCount)                     \
                  each(rtcSetGeometryUserData) each(rtcSetGeometryBoundsFunction) each(rtcSetGeometryIntersectFunction)        \
                      each(rtcSetGeometryInstancedScene) each(rtcSetGeometryTransform) each(rtcIntersect1)

namespace lamina {

LAMINA_EMBREE(LAMINA_LATE_DECLARED)

#if LAMINA_EMBREE_MAJOR >= 4
using RayContext = RTCRayQueryContext;
#else
using RayContext = RTCIntersectContext;
#endif

/// Sends a ray through a scene. context  is reset, and reaches the callbacks of geometries
inline void trace(RTCScene scene, RayContext& context, RTCRayHit& ray) {
#if LAMINA_EMBREE_MAJOR >= 4
  rtcInitRayQueryContext(&context);
  RTCIntersectArguments arguments;
  rtcInitIntersectArguments(&arguments);
  arguments.context = &context;
  rtcIntersect1(scene, &ray, &arguments);
#else
  rtcInitIntersectContext(&context);
  rtcIntersect1(scene, &context, &ray);
#endif
}

/// Before the first call of any of these; by any thread. errors  of load_library()
Status load_embree();

}  // namespace lamina
