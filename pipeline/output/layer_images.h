// pipeline/output/layer_images.h: the images that a layer has of several materials, together.
#pragma once

#include "stages/data/runs.h"

namespace lamina::pipeline {

/// Adds the image of another material to those of a layer; `whole` is empty before the first one.
/// returns  false if a pixel is set in both, or their sizes differ; `whole` is then as it was
bool add_image(Runs&& image, Runs& whole);

}  // namespace lamina::pipeline
