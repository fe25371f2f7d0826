// pipeline/show/swath.h: lamina preview --swath: a layer at a step of its print program.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "pipeline/output/manifest.h"
#include "stages/data/buffer.h"
#include "stages/data/status.h"

namespace lamina::pipeline {

struct SwathChoice {
  std::uint32_t layer = 0;
  std::optional<std::uint32_t> swath, step;  // the middle ones of those that fire, if not chosen
  std::uint32_t width = 1200;
};

/// Replays the layer's program up to the step and draws what is jetted by then. errors  kUsage: no such layer, swath, step;
/// kVerification: files that are missing or are not what was written; kInternal
Result<Buffer<std::byte>> draw_swath(const std::string& directory, const Manifest& manifest, const SwathChoice& choice);

}  // namespace lamina::pipeline
