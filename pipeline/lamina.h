// pipeline/lamina.h: the library interface. Only this header and its includes are installed.
//
//      Job job;                                       the request, set by fields or by the keys of a job file
//      job.parts.push_back({.path = "part.stl"});
//      set_key(job, "bed.dpi=600");
//      check_job(job);
//      run(job, Product::kImages, progress, cancel);  into files, with a manifest: Summary
//      verify(job.output, {});                        compares files and manifest: VerifyReport
//      LayerSource::make(job);                        or layer by layer, without a file: images, contours
//
// Errors are Results with one line of text and a Fault, which is also the program's exit code. Only exceptions of the libraries
// below, such as std::bad_alloc, pass through.
#pragma once

#include <string_view>

#include "pipeline/check/verify.h"
#include "pipeline/job/file.h"
#include "pipeline/job/job.h"
#include "pipeline/run/layer_source.h"
#include "pipeline/run/run.h"
#include "stages/formats/images/image.h"

namespace lamina {

/// As in "0.1.0".
std::string_view version();

}  // namespace lamina
