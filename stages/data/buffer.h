// stages/data/buffer.h: a growable flat array that touches only memory that it is to write.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <new>
#include <type_traits>
#include <utility>
#include <vector>

namespace lamina {

/// Notes the size of a block that was refused, for out_of_memory().
void note_refused_block(std::uint64_t bytes);

/// Leaves new elements of trivial types unset, so that a buffer of a gigabyte can be filled by many threads
/// without one of them zeroing it first.
template <class T>
struct UnsetAllocator : std::allocator<T> {
  template <class U>
  struct rebind {
    using other = UnsetAllocator<U>;
  };
  T* allocate(std::size_t count) try {
    return std::allocator<T>::allocate(count);
  } catch (const std::bad_alloc&) {
    note_refused_block(count * sizeof(T));
    throw;
  }
  template <class U>
  void construct(U* position) noexcept(std::is_nothrow_default_constructible_v<U>) {
    ::new (static_cast<void*>(position)) U;
  }
  template <class U, class... Arguments>
  void construct(U* position, Arguments&&... arguments) {
    ::new (static_cast<void*>(position)) U(std::forward<Arguments>(arguments)...);
  }
};

/// std::vector whose resize() leaves trivial elements unset. Scratch buffers keep their capacity from layer to layer.
template <class T>
using Buffer = std::vector<T, UnsetAllocator<T>>;

/// Bytes that a buffer holds on to.
template <class T>
std::size_t bytes_held(const Buffer<T>& buffer) {
  return buffer.capacity() * sizeof(T);
}

/// Capacity for `count` elements, and where it has to grow an eighth more, so that layers that need ever more move the buffer
/// rarely and never double it; what was in it is lost then.
template <class T>
void ensure_capacity(Buffer<T>& buffer, std::size_t count) {
  if (count <= buffer.capacity()) return;
  buffer = {};
  buffer.reserve(count + count / 8);
}

}  // namespace lamina

/// Made once, optimised: of the copies that files make of what they do not inline, linkers take any, also that of a file that
/// is compiled to be compiled fast, where resize() counts up to what it leaves unset.
extern template class std::vector<std::uint8_t, lamina::UnsetAllocator<std::uint8_t>>;
extern template class std::vector<std::uint32_t, lamina::UnsetAllocator<std::uint32_t>>;
extern template class std::vector<std::uint64_t, lamina::UnsetAllocator<std::uint64_t>>;
extern template class std::vector<double, lamina::UnsetAllocator<double>>;
