// stages/load/repair/finish.h: the facets of a file become a mesh that later stages can trust; internal to load.
#pragma once

#include <string>
#include <vector>

#include "stages/load/reader.h"

namespace lamina::load {

/// Takes the census, settles what the file says of its own length, repairs what is open, and turns over what is inside
/// out. Notes on all of it are appended, each after `prefix`.
///
/// errors  kInput, one line: facets are missing, or they enclose nothing, or closing them would lose most of what they
///         enclose, or joining edges that lie apart may change the volume by more than 3 % and no --weld is given; it names the
///         --weld that would close them if there is one
/// cost    a sound mesh: one pass; a broken one: repair(), and for the message weld_that_closes()
Result<Mesh> finish(const Source& source, const std::string& name, const std::string& prefix, Facets facets,
                    const LoadOptions& options, std::vector<Note>& notes);

}  // namespace lamina::load
