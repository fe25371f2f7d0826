// stages/geometry/blocks/pages.h: memory that is taken piece by piece, by many threads, and never moves.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>

#include "stages/data/buffer.h"

namespace lamina {

/// Addresses for as much as may be needed; memory only for what is written. Pieces lie side by side, so that large pages
/// serve them, which are faulted in 500 times as fast as small ones. Where little may be needed, each piece comes from the
/// heap instead: of thousands of small meshes none has pages of its own.
class Pages {
 public:
  /// throws  std::bad_alloc: the system has no such room
  explicit Pages(std::uint64_t max_bytes);
  ~Pages();
  Pages(const Pages&) = delete;
  Pages& operator=(const Pages&) = delete;

  /// A piece at a multiple of 64 bytes, unset. All pieces together, each rounded up to 64, stay within max_bytes.
  char* take(std::size_t bytes);

  /// Gives addresses behind the last piece back; nothing may be taken afterwards.
  void give_back_rest();

  std::uint64_t bytes() const { return taken_; }

 private:
  static constexpr std::uint64_t kLittle = 256 << 10;
  struct HeapPiece;
  char* take_from_heap(std::uint64_t bytes);

  char* begin_ = nullptr;  // null: pieces come from the heap
  std::uint64_t mapped_ = 0;
  std::atomic<HeapPiece*> last_{nullptr};
  std::atomic<std::uint64_t> taken_{0};
};

/// Requests large pages where memory is about to be written from end to end: faulting 4 KiB at a time takes as long as reading
/// and snapping facets. Where the system has none to give, nothing changes.
void prefer_large_pages(void* begin, void* end);
template <class T>
void prefer_large_pages(Buffer<T>& buffer) {
  prefer_large_pages(buffer.data(), buffer.data() + buffer.size());
}

/// Gives the memory of whole pages within [begin, end) back to the system; what they held is lost, the addresses stay.
void forget_pages(void* begin, void* end);

}  // namespace lamina
