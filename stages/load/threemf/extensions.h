// stages/load/threemf/extensions.h: the namespaces of 3MF, what they are called and what lamina makes of them; internal to
// load.
#pragma once

#include <string_view>

namespace lamina::load {

inline constexpr std::string_view kCoreNamespace = "http://schemas.microsoft.com/3dmanufacturing/core/2015/02",
                                  kProductionNamespace = "http://schemas.microsoft.com/3dmanufacturing/production/2015/06",
                                  kSliceNamespace = "http://schemas.microsoft.com/3dmanufacturing/slice/2015/07",
                                  kBeamNamespace = "http://schemas.microsoft.com/3dmanufacturing/beamlattice/2017/02";

enum class Extension {
  kUnderstood,  // read, or of no meaning for geometry
  kSettings,    // what a program keeps for itself
  kBeams,       // refused where a package requires it and an object has them
  kSlices,      // refused where nothing else says what an object is
  kUnknown      // refused where a package requires it, reported where it is used
};

struct ExtensionRow {
  std::string_view space;   // its beginning: versions follow
  std::string_view name;    // in the specifications: "beam lattice"; "" where none is known
  std::string_view remedy;  // what to do about a file that needs it
  Extension kind;
};
const ExtensionRow& extension_of(std::string_view space);

bool is_material(std::string_view space);
bool is_slic3r(std::string_view space);

/// Whether <model> may stand in this namespace instead of the core's: that of 3MF before 1.0, and that of Cura, whose projects
/// have it as their default.
bool is_core_too(std::string_view space);

}  // namespace lamina::load
