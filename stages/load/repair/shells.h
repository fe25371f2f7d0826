// stages/load/repair/shells.h: shells of a mesh that are inside out and overlap others; internal to load.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "stages/data/mesh.h"

namespace lamina::load {

/// Turns over each closed shell of negative volume that no other shell contains, with all shells in it but hollows of bodies that only
/// overlap it. Where such a shell overlaps
/// another, their winding numbers would add up to 0, a hole in both. Shells in others stay: they are hollows.
///
/// A shell is what facets join across edges; where more than two meet, those that continue each other. A shell contains another if no
/// facet of that one lies outside, by winding numbers at seven points of it; touching is not outside.
///
/// mesh.fingerprint and mesh.volume_mm3 follow
/// mesh     closed, as a list
/// returns  how many were turned
/// cost     O(T log T), 100 bytes a triangle
std::uint32_t turn_inverted_shells(Mesh& mesh);

/// The same of any closed mesh; a note is appended, after `prefix`. Blocks of a mesh become a list where shells are turned. Blocks of
/// more than kBlockSize triangles are searched by surfaces.h, which says what it may miss.
/// returns  whether any were turned
/// cost     that of surfaces.h, or of a diagnosis for small meshes and lists; where there are hollows, turn_inverted_shells()
bool turn_shells(Mesh& mesh, const std::string& prefix, std::vector<Note>& notes);

}  // namespace lamina::load
