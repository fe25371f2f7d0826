// stages/load/text_formats.h: Wavefront OBJ and text STL; internal to load.
#pragma once

#include "stages/load/reader.h"

namespace lamina::load {

/// Vertices and polygons; see text_formats.cpp for what is understood.
/// cost    one pass; 12 bytes a vertex and a corner besides the triangles
Result<Facets> read_obj(const Source& source, const Snapper& snapper, const LoadOptions& options);

/// Text, a word after the other; see text_formats.cpp for what is tolerated.
/// cost    one pass, parallel over blocks of 1 MiB; 32 MiB of text at a time
Result<Facets> read_ascii_stl(const Source& source, const Snapper& snapper, const LoadOptions& options);

}  // namespace lamina::load
