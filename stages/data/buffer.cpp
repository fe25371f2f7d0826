#include "stages/data/buffer.h"

template class std::vector<std::uint8_t, lamina::UnsetAllocator<std::uint8_t>>;
template class std::vector<std::uint32_t, lamina::UnsetAllocator<std::uint32_t>>;
template class std::vector<std::uint64_t, lamina::UnsetAllocator<std::uint64_t>>;
template class std::vector<double, lamina::UnsetAllocator<double>>;
