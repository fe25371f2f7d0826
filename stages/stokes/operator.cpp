#include "stages/stokes/operator.h"

#include <algorithm>

namespace lamina::stokes {

Field field_of(const Cells& cells) {
  Field field(cells.size() + std::size_t{1});
  std::fill(field.begin(), field.end(), Four{});
  return field;
}

Operator::Operator(const Cells& cells) : cells_(cells), step_{}, around_{} {
  float sum = 0;
  for (std::size_t a = 0; a < 3; ++a) {
    weight_[a] = static_cast<float>(1 / (cells.edge[a] * cells.edge[a]));
    step_[static_cast<int>(a)] = static_cast<float>(1 / cells.edge[a]);
    sum += 2 * weight_[a];
  }
  around_ = Four{sum, sum, sum, 0};
}

}  // namespace lamina::stokes
