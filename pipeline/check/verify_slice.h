// pipeline/check/verify_slice.h: is a directory of contours what its manifest says.
#pragma once

#include <string>

#include "pipeline/check/verify.h"
#include "stages/data/status.h"

namespace lamina::pipeline {

/// Compares what `lamina slice` wrote with its manifest: each layer's bytes, in the one file or in files of their own,
/// are there and have the recorded hash; layers follow each other without a gap; what stands before the first and
/// behind the last one is unchanged as well; no other layers lie in layers/.
///
/// directory  for which is_slice_directory() holds
/// errors     kVerification: a manifest that cannot be read, with the line
/// cost       reads every file once
Result<VerifyReport> verify_slices(const std::string& directory);

}  // namespace lamina::pipeline
