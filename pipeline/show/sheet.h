// pipeline/show/sheet.h: layers of a finished job, or of G-code, as one picture.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "stages/data/buffer.h"
#include "stages/data/status.h"

namespace lamina::pipeline {

inline constexpr std::uint32_t kMostCells = 400;  // of a picture

/// Which layers are drawn: one, every so many, or so many over the height (12 if nothing is chosen); at most one is set.
struct LayerChoice {
  std::optional<std::uint32_t> layer, every, count;
};

/// Places in the list of a job's layer numbers. errors  kUsage: several choices, no such layer, too many for a picture
Result<std::vector<std::size_t>> chosen_layers(const LayerChoice& choice, const std::vector<std::uint32_t>& layers);

struct PreviewRequest {
  std::string source;  // directory of a job, or a G-code file
  std::string output;  // the picture's name: .png, or .svg for one layer of slices or G-code
  LayerChoice layers;
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
