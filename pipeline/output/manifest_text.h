// pipeline/output/manifest_text.h: the manifest's lines, shared by its writer and its reader.
#pragma once

#include <string>
#include <string_view>

#include "pipeline/output/manifest.h"

namespace lamina::pipeline {

/// All up to the first layer, without a line end.
std::string head_text(const ManifestHead& head);

/// Appends one layer's object, without comma or line end.
void add_record_text(const LayerRecord& record, const ManifestHead& head, std::string& text);

bool read_reason(std::string_view name, LayerReason& reason);

}  // namespace lamina::pipeline
