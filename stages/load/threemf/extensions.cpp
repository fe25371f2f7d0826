#include "stages/load/threemf/extensions.h"

namespace lamina::load {
namespace {

constexpr std::string_view kAsMesh = "export it with this geometry turned into triangles";

/// source  https://3mf.io/spec/ and the specifications there
constexpr ExtensionRow kExtensions[] = {
    {kCoreNamespace, "core", "", Extension::kUnderstood},
    {"http://schemas.microsoft.com/3dmanufacturing/2013/01", "core of 2013", "", Extension::kUnderstood},
    {"http://schemas.microsoft.com/3dmanufacturing/material/", "materials and properties", "", Extension::kUnderstood},
    {kProductionNamespace, "production", "", Extension::kUnderstood},
    {"http://schemas.microsoft.com/3dmanufacturing/trianglesets/", "triangle sets", "", Extension::kUnderstood},
    {"http://schemas.microsoft.com/3dmanufacturing/beamlattice/", "beam lattice", kAsMesh, Extension::kBeams},
    {"http://schemas.microsoft.com/3dmanufacturing/slice/", "slice", "export it as a mesh", Extension::kSlices},
    {"http://schemas.microsoft.com/3dmanufacturing/securecontent/", "secure content", "export it without encryption",
     Extension::kUnknown},
    {"http://schemas.microsoft.com/3dmanufacturing/volumetric/", "volumetric", kAsMesh, Extension::kUnknown},
    {"http://schemas.3mf.io/3dmanufacturing/volumetric/", "volumetric", kAsMesh, Extension::kUnknown},
    {"http://schemas.3mf.io/3dmanufacturing/implicit/", "implicit", kAsMesh, Extension::kUnknown},
    {"http://schemas.microsoft.com/3dmanufacturing/displacement/", "displacement", kAsMesh, Extension::kUnknown},
    {"http://schemas.3mf.io/3dmanufacturing/displacement/", "displacement", kAsMesh, Extension::kUnknown},
    {"http://schemas.3mf.io/3dmanufacturing/booleanoperations/", "boolean operations", kAsMesh, Extension::kUnknown},
    {"http://schemas.3mf.io/3dmanufacturing/production/alternatives/", "production alternatives",
     "export it without alternatives", Extension::kUnknown},
    {"http://schemas.microsoft.com/3dmanufacturing/mirroring/", "mirroring", kAsMesh, Extension::kUnknown},
    {"http://software.ultimaker.com/", "Cura", "", Extension::kSettings},
    {"http://schemas.slic3r.org/", "Slic3r", "", Extension::kSettings},
    {"http://schemas.bambulab.com/", "Bambu Studio", "", Extension::kSettings},
    {"http://www.w3.org/", "XML", "", Extension::kSettings},
    {"http://schemas.openxmlformats.org/", "Open Packaging Conventions", "", Extension::kSettings},
    {"http://purl.org/", "Dublin Core", "", Extension::kSettings},
};

constexpr ExtensionRow kNotKnown{"", "", "export it without this extension", Extension::kUnknown};

}  // namespace

const ExtensionRow& extension_of(std::string_view space) {
  for (const ExtensionRow& row : kExtensions)
    if (space.starts_with(row.space)) return row;
  return kNotKnown;
}

/// That of the extension's first version; there is no other yet.
bool is_material(std::string_view space) { return space == "http://schemas.microsoft.com/3dmanufacturing/material/2015/02"; }

bool is_slic3r(std::string_view space) { return space.starts_with("http://schemas.slic3r.org/"); }

bool is_core_too(std::string_view space) {
  return space == kCoreNamespace || space == "http://schemas.microsoft.com/3dmanufacturing/2013/01" ||
         space.starts_with("http://software.ultimaker.com/xml/cura/3mf/");
}

}  // namespace lamina::load
