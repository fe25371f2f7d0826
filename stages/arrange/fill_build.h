// stages/arrange/fill_build.h: as much as possible of a demand for shapes into one level.
#pragma once

#include <compare>
#include <cstdint>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "stages/arrange/bed_level.h"

namespace lamina::arrange {

/// A shape in one turn.
struct NestShape {
  SearchShape search;   // what has to be free: the shape, or more where it keeps others further away
  std::uint32_t reach;  // cells from the first one of that to the first one of the shape, along x and y
  GrownShape put;       // what it takes: grown by its distance to others
  double area_mm2 = 0;  // of the shape itself

  NestShape(const GrownShape& searched, GrownShape taken, double area)
      : search(searched.shape), reach(searched.reach), put(std::move(taken)), area_mm2(area) {}
};

/// Copies that are requested, any of some shapes each.
struct Demand {
  std::uint32_t row = 0;                       // of the caller
  std::uint32_t copies = 0;                    // still requested
  std::pair<std::int32_t, std::int32_t> rank;  // smaller ones come first
  std::vector<std::uint32_t> shapes;           // numbers of the allowed turns
  std::optional<std::uint32_t> group = {};     // all copies of a group come into one level, or none
};

/// A copy in the level: its shape's first cell.
struct PutShape {
  std::uint32_t demand = 0, shape = 0;
  CellPosition at;
};

/// A copy whose position is given.
struct FixedShape {
  GrownShape put;
  CellPosition at;
};

/// Fills a level in four orders of demands of equal rank, by area, depth, width, and as they come; keeps the one that covers
/// most, of the first rank in which they differ.
///
/// fixed    are in the level already
/// returns  in the order in which they were put
/// cost     four times a search for each shape and copy
std::vector<PutShape> fill_build(const BedCells& bed, std::span<const NestShape> shapes, std::span<const Demand> demands,
                                 std::span<const FixedShape> fixed);

}  // namespace lamina::arrange
