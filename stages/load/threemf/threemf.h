// stages/load/threemf/threemf.h: the objects of a 3MF file; internal to load.
#pragma once

#include <string>
#include <vector>

#include "stages/load/reader.h"

namespace lamina::load {

/// A mesh of a 3MF file with one transform, before census and repair.
struct PlacedObject {
  std::string name;  // in the file, for notes
  Facets facets;
  std::vector<Point3> offsets;  // where it stands, at least once
};
struct Package {
  std::vector<PlacedObject> objects;
  std::vector<Note> notes;
};

/// 3MF: core specification, production extension, components. Numbers are read in double precision, the unit is
/// the file's own.
///
/// errors  kInput: no whole package, or no model that may be planned as what it holds; what it is, and what to do
/// cost    0.3 us a vertex and a triangle; 24 bytes a vertex and 12 a triangle besides the facets
Result<Package> read_3mf(const Source& source, const LoadOptions& options);

}  // namespace lamina::load
