// pipeline/show/report_cast.h: the parts of a finished job, found again, for pictures of them.
#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

#include "stages/data/status.h"
#include "stages/view/cast.h"
#include "stages/write/manifest/manifest.h"

namespace lamina::pipeline {

/// The job's parts from above, from the front and from the right, `most` pixels along the longest side of all.
///
/// A manifest names parts without their folders. Each is looked for in `folders` (files among them stand for themselves), and
/// is the one only if its triangles have the recorded fingerprint. errors  kInput: a part that is not there or has changed,
/// with its name; of load_scene
Result<std::array<view::Picture, 3>> cast_parts(const ManifestHead& head, const std::vector<std::string>& folders,
                                                std::uint32_t most);

}  // namespace lamina::pipeline
