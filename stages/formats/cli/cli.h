// stages/formats/cli/cli.h: slices in the Common Layer Interface, text and binary.
#pragma once

#include <memory>

#include "stages/formats/slice_format.h"

namespace lamina::formats {

std::unique_ptr<SliceEncoder> make_cli_encoder(bool binary, const SliceFormatOptions& options);
/// CLI with commands of 16 bits.
std::unique_ptr<SliceEncoder> make_cli_16_encoder(const SliceFormatOptions& options);

}  // namespace lamina::formats
