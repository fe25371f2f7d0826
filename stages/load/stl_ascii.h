// stages/load/stl_ascii.h: text STL; internal to load.
#pragma once

#include "stages/load/reader.h"

namespace lamina::load {

/// Text, a word after the other; see stl_ascii.cpp for what is tolerated.
/// cost    one pass, parallel over blocks of 1 MiB; 32 MiB of text at a time
Result<Facets> read_ascii_stl(const Source& source, const Snapper& snapper, const LoadOptions& options);

}  // namespace lamina::load
