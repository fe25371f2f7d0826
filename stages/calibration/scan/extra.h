// stages/calibration/scan/extra.h: ink in the photograph of a layer where the layer has none.
#pragma once

#include <vector>

#include "stages/calibration/scan/compare.h"

namespace lamina::scan {

/// Connected dark places of a square millimetre and more, half a millimetre wide and more, of half of full ink and more, half a
/// millimetre away from what was to be printed. Looked for wherever the photograph shows the image of the layer; what reaches
/// the image's edge is taken for the edge of the bed.
/// view  of the photograph
/// ink   darkness of full ink, of the light of the blank sheet
/// cost  O(cells of the image, 4 million at most)
std::vector<ExtraInk> extra_ink(const Photo& photo, const ExpectedLayer& layer, const View& view, double ink);

}  // namespace lamina::scan
