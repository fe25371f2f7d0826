// pipeline/manifest/manifest_head.h: the text before and after a manifest's lines, for writer and reader.
#pragma once

#include <string>
#include <string_view>

#include "pipeline/manifest/manifest.h"

namespace lamina {

/// The head without the fields that differ between shards of a job; its hash is the job's id.
std::string lasting_text(const ManifestHead& head);

/// The text up to the first layer, without a line end.
std::string head_text(const ManifestHead& head);

/// The text after the last layer. file  the single file of all layers, if the head names one
std::string tail_text(const ManifestHead& head, const FileDigest& file);

/// Reads the output of head_text(). errors  kVerification: the reason, without a place
Result<ManifestHead> read_head(const std::string& text);

/// Reads the output of tail_text() without its first line. errors  false for any other text
bool read_tail(const ManifestHead& head, const std::string& text, FileDigest& file);

// --- what a manifest says is held against what lamina can have written.
//
// The id of a manifest is no signature: anybody can write one that holds together. Names of files are made of what stands
// in it, so an extension "/../../x.tif" would lead out of the job's folder.

/// Empty, or what no layer, and no print program of one, that lamina writes has.
std::string what_is_impossible(const Layer& layer);
std::string what_is_impossible(const ProgramRecord& program);

}  // namespace lamina
