#include "stages/geometry/blocks/pages.h"

#include <sys/mman.h>

#include <cassert>
#include <new>

namespace lamina {
namespace {

constexpr std::uint64_t kPiece = 64, kPage = 4096;

std::uint64_t rounded_up(std::uint64_t bytes, std::uint64_t to) { return (bytes + to - 1) / to * to; }

}  // namespace

/// The head of a piece, whose bytes follow.
struct alignas(kPiece) Pages::HeapPiece {
  HeapPiece* before;
};

Pages::Pages(std::uint64_t max_bytes) : mapped_(max_bytes <= kLittle ? 0 : rounded_up(max_bytes, kPage)) {
  if (mapped_ == 0) return;
  void* const position = ::mmap(nullptr, mapped_, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS | MAP_NORESERVE, -1, 0);
  if (position == MAP_FAILED) throw std::bad_alloc();
  begin_ = static_cast<char*>(position);
  ::madvise(begin_, mapped_, MADV_HUGEPAGE);  // where the system has none to give, nothing changes
}

Pages::~Pages() {
  if (mapped_ > 0) ::munmap(begin_, mapped_);
  for (HeapPiece* piece = last_; piece != nullptr;) {
    HeapPiece* const before = piece->before;
    ::operator delete (piece, std::align_val_t{kPiece});
    piece = before;
  }
}

char* Pages::take_from_heap(std::uint64_t bytes) {
  auto* const piece = static_cast<HeapPiece*>(::operator new (sizeof(HeapPiece) + bytes, std::align_val_t{kPiece}));
  piece->before = last_;
  while (!last_.compare_exchange_weak(piece->before, piece)) {
  }
  return reinterpret_cast<char*>(piece + 1);
}

char* Pages::take(std::size_t bytes) {
  const std::uint64_t rounded = rounded_up(bytes, kPiece), at = taken_.fetch_add(rounded);
  if (begin_ == nullptr) return take_from_heap(rounded);
  assert(at + rounded <= mapped_);
  return begin_ + at;
}

void Pages::give_back_rest() {
  if (begin_ == nullptr) return;
  const std::uint64_t used = rounded_up(taken_, kPage);
  if (used < mapped_) ::munmap(begin_ + used, mapped_ - used);
  mapped_ = used;
}

void prefer_large_pages(void* begin, void* end) {
  constexpr std::uintptr_t kLarge = std::uintptr_t{2} << 20;
  const std::uintptr_t first = rounded_up(reinterpret_cast<std::uintptr_t>(begin), kLarge);
  const std::uintptr_t last = reinterpret_cast<std::uintptr_t>(end) / kLarge * kLarge;
  if (first < last) ::madvise(reinterpret_cast<void*>(first), last - first, MADV_HUGEPAGE);
}

void forget_pages(void* begin, void* end) {
  const std::uint64_t first = rounded_up(reinterpret_cast<std::uintptr_t>(begin), kPage);
  const std::uint64_t last = reinterpret_cast<std::uintptr_t>(end) / kPage * kPage;
  if (first < last) ::madvise(reinterpret_cast<void*>(first), last - first, MADV_DONTNEED);
}

}  // namespace lamina
