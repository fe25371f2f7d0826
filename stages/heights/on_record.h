// stages/heights/on_record.h: whether layers that somebody tells can be those of a job.
#pragma once

#include <cstdint>
#include <optional>
#include <utility>

#include "stages/heights/heights.h"

namespace lamina::heights {

/// Holds layers, from the bottom up, to the options that decided them: each begins where the one before ends, the first on the
/// bed, and has a thickness of the set, or of an even division of a slab. Which thickness of the set a layer has the parts
/// decide, which are not at hand.
class OnRecord {
 public:
  /// options  none: they are not known
  explicit OnRecord(std::optional<Options> options) : options_(std::move(options)) {}

  /// Takes the next layer. errors  kVerification: "layer 3: begins 300000 nm above the bed, the manifest says 300001"
  Status check(const Layer& layer);

 private:
  Status check_thickness(const Layer& layer);
  bool divides_slab(const Layer& layer);

  std::optional<Options> options_;
  std::optional<std::int64_t> begins_;  // the next layer
  // Of a slab that is divided evenly: the layers of it so far, and into how many it can be divided.
  std::int64_t count_ = -1, fewest_ = 1, max_ = 1;  // count_: below 0 within a slab whose first layers are not known
};

}  // namespace lamina::heights
