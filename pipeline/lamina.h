// pipeline/lamina.h: lamina for other programs. All that is installed is this header and what it includes.
//
//      Job job;                                       what is asked for, by its fields or by the keys of a job file
//      job.parts.push_back({.path = "part.stl"});
//      set_key(job, "bed.dpi=600");
//      check_job(job);
//      run(job, Product::kImages, progress, cancel);  into files, with a manifest: Summary
//      verify(job.output, {});                        are they what the manifest says: VerifyReport
//      LayerSource::make(job);                        or layer by layer, without a file: images, contours
//
// What fails is a Result with one line and a Fault, which is the exit code of the program too. Only what a library below
// throws, as std::bad_alloc, passes through.
#pragma once

#include <string_view>

#include "pipeline/check/verify.h"
#include "pipeline/job/file.h"
#include "pipeline/job/job.h"
#include "pipeline/run/layer_source.h"
#include "pipeline/run/run.h"
#include "stages/read/image.h"

namespace lamina {

/// As in "0.1.0".
std::string_view version();

}  // namespace lamina
