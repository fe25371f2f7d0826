// pipeline/report/image_observers.h: what a powder job counts, layer by layer, for its summary.
#pragma once

#include <cstdint>
#include <vector>

#include "pipeline/plan/plan.h"
#include "pipeline/report/observer.h"
#include "stages/checks/thin.h"
#include "stages/raster/raster.h"

namespace lamina::pipeline {

/// What making the images of a layer found.
struct ImageNotes {
  raster::LayerReport report;
  checks::VanishedPieces vanished;                  // by the bleed
  std::uint64_t solid_pixels = 0, bead_pixels = 0;  // of parts, before and after clearing outside beads and shells
  std::vector<std::uint64_t> part_pixels;           // of each part before its dose, or shares of voxels; empty: not requested
};

using ImageObserver = Observer<ImageNotes>;

/// Adds the observers of a powder job; an inspection's warnings come between the two.
/// plan, refills  outlive them. refills  layers before which vats are filled; known before the first layer
void observe_pixels(const Plan& plan, Observers<ImageNotes>& observers);
void observe_images(const Plan& plan, const std::vector<std::uint32_t>& refills, Observers<ImageNotes>& observers);

/// The head of the summary for a plan of images.
void report_image_plan(const Plan& plan, Summary& summary);

/// Puts the facts of a powder job in the order of their names' list.
void sort_image_facts(Summary& summary);

}  // namespace lamina::pipeline
