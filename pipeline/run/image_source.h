// pipeline/run/image_source.h: the images of a powder job's layers, without any file.
//
// For programs that embed lamina: the images are those of the files that run() would write.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "pipeline/plan/plan.h"
#include "stages/data/runs.h"
#include "stages/data/status.h"

namespace lamina::pipeline {

/// A layer's image, and what of it is of each material.
struct PlannedImages {
  Runs whole;
  std::vector<Runs> material;  // in the order of materials(), no pixel set in two; empty where the whole is of one
};

/// Immutable; layers may be read in any order and from any number of threads.
class ImageSource {
 public:
  /// Loads and places the parts, decides the layers and builds the index. job.output is not read.
  /// errors  of check_job, resolve and make_plan
  static Result<ImageSource> make(const Job& job);
  ImageSource(ImageSource&&) noexcept;
  ImageSource& operator=(ImageSource&&) noexcept;
  ~ImageSource();

  const Plan& plan() const;
  /// Names of the powders, as file names have them; empty if no part names one.
  std::vector<std::string> materials() const;

  /// The images of a layer. errors  kVerification: engine is kBoth and they differ
  /// memory  the runs; scratch is kept for the next layer, one set for each layer that is made at the same time
  Result<PlannedImages> images(std::uint32_t layer) const;

 private:
  ImageSource();
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace lamina::pipeline
