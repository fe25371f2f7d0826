// pipeline/show/swath.h: lamina preview --swath, a layer at a step of its print program.
#pragma once

#include <cstdint>
#include <string>

#include "pipeline/manifest/manifest.h"
#include "stages/data/buffer.h"
#include "stages/data/status.h"
#include "stages/replay/jetting.h"

namespace lamina::pipeline {

/// Replays the layer's program up to the step and draws the drops jetted so far, `width` pixels wide. errors  kUsage: no
/// such layer, swath or step; kVerification: missing or changed files; kInternal
Result<Buffer<std::byte>> draw_swath(const std::string& directory, const Manifest& manifest, const replay::StepChoice& choice,
                                     std::uint32_t width);

}  // namespace lamina::pipeline
