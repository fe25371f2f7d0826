// stages/write/manifest/manifest_head.h: the text around the lines of a manifest, for its writer and its reader.
#pragma once

#include <string>

#include "stages/write/manifest/manifest.h"

namespace lamina {

/// The head without what differs between shards of one job: what its id is the hash of.
std::string lasting_text(const ManifestHead& head);

/// All up to the first layer, without a line end.
std::string head_text(const ManifestHead& head);

/// All behind the last layer. file  the one file of all layers, if the head names one
std::string tail_text(const ManifestHead& head, const FileDigest& file);

/// Reads what head_text() wrote. errors  kVerification: what is wrong with it, without a place
Result<ManifestHead> read_head(const std::string& text);

/// Reads what tail_text() wrote, without its first line. errors  false if it is another text
bool read_tail(const ManifestHead& head, const std::string& text, FileDigest& file);

}  // namespace lamina
