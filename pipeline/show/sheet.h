// pipeline/show/sheet.h: layers of a finished job, or of G-code, as one picture.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "stages/data/buffer.h"
#include "stages/data/status.h"
#include "stages/formats/gcode/read_gcode.h"
#include "stages/view/drawable_layers.h"

namespace lamina::pipeline {

struct PreviewRequest {
  std::string source;  // directory of a job, or a G-code file
  std::string output;  // the picture's name: .png, or .svg for one layer of slices or G-code
  view::LayerChoice layers;
  std::optional<std::uint32_t> width;  // pixels
  bool whole_bed = false;              // images: the whole bed instead of the set pixels' window
  bool swath = false;                  // images: the layer during its print program
  std::optional<std::uint32_t> swath_number, step;
  std::uint64_t memory_bytes = std::uint64_t{1} << 30;  // of images in flight
  formats::GcodeOptions gcode;  // for G-code alone
};

struct Preview {
  Buffer<std::byte> bytes;                 // of the file
  std::string said;                        // what is drawn, one line
  std::vector<std::string> warnings = {};  // what it lacks, or may have wrong, and why; a line each
};

/// errors  kUsage: options that do not fit the source; kVerification: missing or changed files of the job; of the readers
Result<Preview> draw_preview(const PreviewRequest& request);

}  // namespace lamina::pipeline
