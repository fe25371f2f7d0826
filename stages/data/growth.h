// stages/data/growth.h: capacity for what is appended piece by piece.
#pragma once

#include <algorithm>
#include <cstddef>

#include "stages/data/buffer.h"

namespace lamina {

/// Capacity for `more` elements behind those that are there, which stay. It at least doubles where it has to grow: reserving
/// exactly what each of many pieces needs would move the buffer for every piece.
template <class T>
void reserve_more(Buffer<T>& buffer, std::size_t more) {
  const std::size_t needed = buffer.size() + more;
  if (needed > buffer.capacity()) buffer.reserve(std::max(needed, 2 * buffer.capacity()));
}

}  // namespace lamina
