// pipeline/manifest/possible.h: what a manifest says is held against what lamina can have written.
//
// The id of a manifest is no signature: anybody can write one that holds together. Names of files are made of what stands
// in it, so an extension "/../../x.tif" would lead out of the job's folder.
#pragma once

#include <string>
#include <string_view>

#include "pipeline/manifest/manifest.h"

namespace lamina {

/// Empty, or what no job of this version has. The extension is its format's, that of programs their dialect's, materials
/// have names that files can have, the grid is one of a bed.
std::string what_is_impossible(const ManifestHead& head);

/// The same of a layer, and of its print program.
std::string what_is_impossible(const Layer& layer);
std::string what_is_impossible(const ProgramRecord& program);

/// The name of a file in a folder: no folder in it, and not the folder itself or the one above.
bool is_file_name(std::string_view name);

/// The grid's axis. errors  throws std::invalid_argument for one that no bed has
PixelAxis possible_axis(std::int64_t dots, std::int64_t length, std::int64_t span);

}  // namespace lamina
