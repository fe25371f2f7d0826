#include "stages/stokes/operator.h"

#include <algorithm>

namespace lamina::stokes {

Field field_of(const Cells& cells) {
  Field field(cells.size() + std::size_t{1});
  std::fill(field.begin(), field.end(), Four{});
  return field;
}

Operator::Operator(const Cells& cells) : cells_(cells), step_{}, table_(1000) {
  for (std::size_t a = 0; a < 3; ++a) {
    weight_[a] = static_cast<float>(1 / (cells.edge[a] * cells.edge[a]));
    step_[static_cast<int>(a)] = static_cast<float>(1 / cells.edge[a]);
  }
  for (int kind = 0; kind < 1000; ++kind) {
    const std::array<int, 3> digit = {kind % 10, kind / 10 % 10, kind / 100};
    Diagonal& diagonal = table_[static_cast<std::size_t>(kind)];
    diagonal = Diagonal{};
    for (std::size_t a = 0; a < 3; ++a) {
      if (digit[a] == 9) continue;
      const int walls[2] = {digit[a] % 3, digit[a] / 3};
      float sum = 2 * weight_[a];
      for (std::size_t k = 0; k < 2; ++k) sum += weight_[(a + k + 1) % 3] * static_cast<float>(2 + walls[k]);
      diagonal.value[static_cast<int>(a)] = sum;
      diagonal.exists[static_cast<int>(a)] = 1;
    }
  }
}

}  // namespace lamina::stokes
