// stages/slice/contact.h: do contours keep clear of each other and of themselves?
#pragma once

#include "stages/data/buffer.h"
#include "stages/data/contours.h"

namespace lamina::slice {

/// Reused from layer to layer.
struct ContactScratch {
  Buffer<std::uint32_t> offset;  // cells + 1
  Buffer<std::uint32_t> edge;    // of each cell: the number of an edge's first point
  Buffer<std::uint32_t> next;    // point -> next point of its contour

  std::uint64_t bytes() const { return bytes_held(offset) + bytes_held(edge) + bytes_held(next); }
};

/// Whether two edges that are not neighbours in a contour share a point, exactly. Contours without straight or repeated
/// points (tidy.h) for which this is false are simple and apart from each other, so they need no boolean operation.
/// cost  O(P) as a rule: edges are compared within the cells of a grid about as fine as they are long
bool have_contact(const ContoursView& contours, ContactScratch& scratch);

}  // namespace lamina::slice
