// stages/load/threemf/roles.h: what the program that wrote a package does with its volumes; internal to load.
#pragma once

#include <string_view>
#include <vector>

#include "stages/load/threemf/archive.h"
#include "stages/load/threemf/model.h"

namespace lamina::load {

/// Whether a program's settings of an object, in words such as "infill_mesh" and "True", make it other than a part to print.
///
/// source  Cura, resources/definitions/fdmprinter.def.json, category "meshfix" and "Mesh Fixes"
void apply_cura_setting(std::string_view key, std::string_view value, ModelObject& object);

/// Reads the settings that PrusaSlicer, SuperSlicer, Bambu Studio and OrcaSlicer put alongside the model, and takes from the
/// objects the triangles of what modifies or blocks something, and is no part to print. Ranges of triangles that the model
/// itself names (Slic3r) are treated alike.
///
/// errors  kInput: a range of triangles that the object does not have
/// source  prusa3d/PrusaSlicer, src/libslic3r/Format/3mf.cpp; bambulab/BambuStudio, src/libslic3r/Format/bbs_3mf.cpp;
///         slic3r/Slic3r, xs/src/libslic3r/IO/TMF.cpp
Status apply_roles(const Source& source, Archive& archive, ModelPackage& package, std::vector<Note>& notes);

}  // namespace lamina::load
