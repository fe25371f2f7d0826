// stages/load/threemf/cavities.h: an object inside out within another one is a void; internal to load.
#pragma once

#include <vector>

#include "stages/load/threemf/expansion.h"
#include "stages/load/threemf/model.h"

namespace lamina::load {

/// Gives the leaves of negative volume that lie within one of positive volume of the same build item their container: the rule
/// by which 3MF fills a group of meshes makes them voids. All others of negative volume are no solid by that rule, and are left
/// to be turned over: programs that mirror write them.
///
/// leaves  in the order of the build
/// source  3MF Consortium, Core Specification 1.3, sections 4.1, 4.1.1 and 3.4.3.1
/// cost    two passes over the triangles of items that have an object of negative volume, one of others of several objects;
///         100 bytes a triangle of the objects that may contain such an one, once for all copies; a bounded number of facets
///         is inspected, half a minute at worst, after which the others are left, with a note
void find_cavities(const ModelPackage& package, std::vector<Leaf>& leaves, std::vector<Note>& notes);

}  // namespace lamina::load
