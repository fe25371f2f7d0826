// pipeline/show/swath.h: lamina preview --swath: a layer at a step of its print program.
#pragma once

#include <cstdint>
#include <string>

#include "stages/data/buffer.h"
#include "stages/data/status.h"
#include "stages/replay/jetting.h"
#include "stages/write/manifest/manifest.h"

namespace lamina::pipeline {

/// Replays the layer's program up to the step and draws what is jetted by then, `width` pixels wide. errors  kUsage: no such
/// layer, swath, step; kVerification: files that are missing or are not what was written; kInternal
Result<Buffer<std::byte>> draw_swath(const std::string& directory, const Manifest& manifest, const replay::StepChoice& choice,
                                     std::uint32_t width);

}  // namespace lamina::pipeline
