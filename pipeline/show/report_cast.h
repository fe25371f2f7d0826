// pipeline/show/report_cast.h: finds the parts of a finished job and renders them.
#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

#include "pipeline/job/job.h"
#include "pipeline/manifest/manifest.h"
#include "pipeline/plan/scene.h"
#include "stages/data/status.h"
#include "stages/view/cast.h"

namespace lamina::pipeline {

/// The job's parts where they stand.
///
/// A manifest names parts without their folders. Each is searched in `folders` (entries may also be files) and accepted if
/// its triangles match the recorded fingerprint. errors  kInput: a missing or changed part, with its name; of load_scene
Result<Scene> find_parts(const ManifestHead& head, const Job& job, const std::vector<std::string>& folders);

/// Parts from above, from the front and from the right, `most` pixels along the longest side of all.
Result<std::array<view::Picture, 3>> cast_parts(const Scene& scene, std::uint32_t maximum);

}  // namespace lamina::pipeline
