#include "stages/heights/on_record.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

namespace lamina::heights {

Status OnRecord::check(const Layer& layer) {
  const bool uniform = options_ && options_->mode == Mode::kUniform;
  if (layer.index == 0) begins_ = 0;
  if (uniform) begins_ = std::int64_t{layer.index} * options_->set.minimum();
  const auto begins = std::exchange(begins_, std::int64_t{layer.bottom} + layer.thickness);
  const Status thick = options_ ? check_thickness(layer) : Status();
  if (begins && layer.bottom != *begins) {
    return Error{Fault::kVerification,
                 fmt::format("layer {}: begins {} nm above the bed, the manifest says {}", layer.index, *begins, layer.bottom)};
  }
  return thick;
}

Status OnRecord::check_thickness(const Layer& layer) {
  const ThicknessSet& set = options_->set;
  const auto wrong = [&](const std::string& what) {
    return Error{Fault::kVerification, fmt::format("layer {}: {}", layer.index, what)};
  };
  if (options_->mode == Mode::kStepwise) {
    if (divides_slab(layer)) return {};
    return wrong(fmt::format("divides no slab of {} nm evenly, from {} to {} nm", set.maximum(), layer.bottom,
                             std::int64_t{layer.bottom} + layer.thickness));
  }
  if (std::ranges::binary_search(set.values, layer.thickness)) return {};
  if (options_->mode == Mode::kUniform) {
    return wrong(fmt::format("is {} nm thick as all of the job, the manifest says {}", set.minimum(), layer.thickness));
  }
  return wrong(fmt::format("is {} nm thick, by the manifest, which is none of the job's thicknesses", layer.thickness));
}

bool OnRecord::divides_slab(const Layer& layer) {
  const std::int64_t slab = options_->set.maximum(), low = layer.bottom % slab, high = low + layer.thickness;
  if (low == 0) {
    count_ = 0;
    fewest_ = 1;
    max_ = slab / options_->set.minimum();
  }
  if (count_ < 0) return high <= slab;
  // Boundary i of n divisions lies at floor(slab * i / n).
  const auto meet = [&](std::int64_t i, std::int64_t position) {
    fewest_ = std::max(fewest_, slab * i / (position + 1) + 1);
    if (position > 0) max_ = std::min(max_, slab * i / position);
  };
  meet(count_, low);
  meet(++count_, high);
  if (high <= slab && fewest_ <= max_) return true;
  count_ = -1;
  return false;
}

}  // namespace lamina::heights
