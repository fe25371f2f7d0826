// pipeline/show/sheet.h: layers of a finished job, or of G-code, as one picture.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "stages/data/buffer.h"
#include "stages/data/status.h"
#include "stages/view/choice.h"

namespace lamina::pipeline {

struct PreviewRequest {
  std::string source;  // directory of a job, or a G-code file
  std::string output;  // the picture's name: .png, or .svg for one layer of slices or G-code
  view::LayerChoice layers;
  std::optional<std::uint32_t> width;  // pixels
  bool whole_bed = false;              // images: not only where they have something
  bool swath = false;                  // images: the layer while its print program jets it
  std::optional<std::uint32_t> swath_number, step;
};

struct Preview {
  Buffer<std::byte> bytes;        // of the file
  std::vector<std::string> said;  // of it, a line each
};

/// errors  kUsage: what cannot be drawn so; kVerification: files of the job that are missing or have changed; of the readers
Result<Preview> draw_preview(const PreviewRequest& request);

}  // namespace lamina::pipeline
