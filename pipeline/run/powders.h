// pipeline/run/powders.h: refuses jobs whose layers would need two powders at once, or have no dose.
#pragma once

#include "pipeline/plan/plan.h"
#include "pipeline/run/layer_imager.h"

namespace lamina::pipeline {

/// By the rule `refuse`: looks, before anything is written, for a layer of the job's range with pixels of two materials, among
/// those whose parts' heights allow it.
/// errors  kUsage: names these layers, and the pixels of each material in the first one that has both
/// cost    one layer's image as a rule; more only where parts stand at the same height without pixels
Status refuse_mixed_powders(const Plan& plan, const LayerImager& imager);

/// Where a formula of a saturation is in doubt by the boxes of parts: looks, before anything is written, at the doses of all
/// layers of the job's range. errors  kUsage: of the lowest layer with a part where it is no number, or does not bind
/// cost    the images of all layers, if it is in doubt; else nothing
Status refuse_faulty_formulas(const Plan& plan, const LayerImager& imager);

/// The layers of the range before which the whole job pauses for vats to be filled.
/// errors  kUsage: a vat runs empty, by the profile's rule
/// cost    O(layers); where materials differ, an image of each layer, whose pixels decide which vat feeds
Result<std::vector<std::uint32_t>> plan_refills(const Plan& plan, const LayerImager& imager);

}  // namespace lamina::pipeline
