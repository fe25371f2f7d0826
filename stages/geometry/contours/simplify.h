// stages/geometry/contours/simplify.h: contours with fewer points, moved by no more than a tolerance.
//
// The points that stay are points of the full contour, so a stretch between two of them replaces those between. A stretch
// may do so if all of them lie within the tolerance of it, by squares of whole numbers. They reach both its ends, so none of
// its points is further from the full contour either: the two are never further apart than the tolerance.
//
//   split      at the furthest point, until every stretch may stand for its points (Douglas and Peucker 1973), from the two
//              ends of the contour that lie furthest apart along x; where that splits off little too often, as in combs, in the
//              middle
//   thin out   points whose two stretches may be one, until there is none: no point stays for nothing
//   compare    a contour that would touch another one or itself, turn over or vanish keeps all its points, and so do all
//              contours of a layer in which one would lie inside others than before
#pragma once

#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

#include "stages/data/buffer.h"
#include "stages/data/contours.h"
#include "stages/geometry/contours/contact.h"

namespace lamina {

/// Reused from layer to layer.
struct SimplifyScratch {
  Contours thinned;             // what the contours become unless they meet
  Buffer<std::uint8_t> kept;    // of each point
  Buffer<std::uint8_t> whole;   // of each contour: all its points stay
  Buffer<std::uint32_t> index;  // of a contour's points that stay: numbers, the next one and the one before
  Buffer<std::uint32_t> next, before;
  std::vector<std::pair<std::size_t, std::size_t>> open;
  std::uint64_t inspections = 0;  // at points while splitting, of all contours so far: the cost
  ContactScratch contact;
  Buffer<std::uint32_t> group;

  std::uint64_t bytes() const {
    return bytes_held(thinned.point) + bytes_held(thinned.offset) + bytes_held(kept) + bytes_held(whole) + bytes_held(index) +
           bytes_held(next) + bytes_held(before) + open.capacity() * sizeof(open[0]) + contact.bytes() + bytes_held(group);
  }
};

/// Leaves out points of clean contours. As many contours as before stay, in their order, clean, each within the tolerance of
/// what it was, both ways. The same for any thread.
///
/// tolerance  nm, 0 <= tolerance <= 10^9; 0 changes nothing
/// cost       O(P log P) for P points but for thinning out and contacts, which are linear as a rule
/// source     D. Douglas, T. Peucker, "Algorithms for the reduction of the number of points required to represent a
///            digitized line or its caricature", Cartographica 10 (1973)
void simplify(Contours& contours, Nm tolerance, SimplifyScratch& scratch);

// --- short edges of contours become points.

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

// --- points of contours that say nothing are dropped.

/// Drops points that lie exactly on the line through their neighbours: spikes that run back on themselves and repeated
/// points among them. Contours that have no area left are dropped.
/// cost  O(P)
void tidy(Contours& contours);

}  // namespace lamina
