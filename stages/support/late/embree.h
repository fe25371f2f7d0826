// stages/support/late/embree.h: Embree's functions, and Embree when it is first needed. Engine rays and views of parts use it.
#pragma once

#include <embree3/rtcore.h>

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

/// Before the first call of any of these; by any thread. errors  of load_library()
Status load_embree();

}  // namespace lamina
