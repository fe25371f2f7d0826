// stages/geometry/contours/merge.h: short edges of contours become points.
#pragma once

#include "stages/data/contours.h"
#include "stages/geometry/contours/contact.h"

namespace lamina {

/// Reused from layer to layer.
struct MergeScratch {
  Contours merged;
  ContactScratch contact;
  Buffer<std::uint32_t> group;
};

/// Merges both ends of edges shorter than `shortest` into one point where no point of a contour moves further than the
/// tolerance from what it was, nor the other way: their middle, or where both ends turn the same way half as high above it as
/// their other edges meet. Contours stay as many, and clean: if any would touch another or itself, all keep their points.
///
/// tolerance  nm; 0 changes nothing
/// cost       that of find_contacts()
void merge_short_edges(Contours& contours, Nm shortest, Nm tolerance, MergeScratch& scratch);

}  // namespace lamina
