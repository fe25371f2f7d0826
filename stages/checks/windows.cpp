#include "stages/checks/windows.h"

#include "stages/geometry/isa.h"
#include "stages/geometry/targets.h"

namespace lamina::checks {

Windows profile(const StencilSteps& stencil, bool from_first) {
  Windows windows;
  const std::uint32_t first = from_first ? stencil.rising : stencil.falling,
                      last = from_first ? stencil.falling : stencil.rising;
  windows.added = static_cast<std::int32_t>(first);
  windows.add(first, -1);
  windows.add(stencil.down, 0);
  windows.add(last, 1);
  return windows;
}

namespace {

constexpr std::size_t kBlock = 2048;

// Before a loop whose reads are of elements that later turns write. clang fails where it does not vectorise what it is to.
#if defined(__clang__)
#define LAMINA_READS_AHEAD
#else
#define LAMINA_READS_AHEAD _Pragma("GCC ivdep")
#endif

LAMINA_BODY void slide_body(const std::int32_t* values, std::size_t count, std::int32_t sign, const Windows& windows,
                            std::int32_t* held, std::int32_t* result) {
  for (std::size_t base = 0; base < count; base += kBlock) {
    const std::size_t size = std::min(kBlock, count - base);
    std::size_t left = size + windows.reach;
    for (std::size_t i = 0; i < left; ++i) held[i] = sign * values[base + i] + windows.added;
    for (std::uint32_t s = 0; s < windows.steps; ++s) {
      const auto [further, more] = windows.step[s];
      left -= further;
      const std::int32_t* const next = held + further;
LAMINA_READS_AHEAD
      for (std::size_t i = 0; i < left; ++i) held[i] = std::min(held[i], next[i] + more);
    }
    std::copy(held, held + size, result + base);
  }
}

using Slide = void (*)(const std::int32_t*, std::size_t, std::int32_t, const Windows&, std::int32_t*, std::int32_t*);
void slide_plain(const std::int32_t* values, std::size_t count, std::int32_t sign, const Windows& windows, std::int32_t* held,
                 std::int32_t* result) {
  slide_body(values, count, sign, windows, held, result);
}
#if defined(LAMINA_WIDE_KERNELS)
LAMINA_AVX2 void slide_avx2(const std::int32_t* values, std::size_t count, std::int32_t sign, const Windows& windows,
                            std::int32_t* held, std::int32_t* result) {
  slide_body(values, count, sign, windows, held, result);
}
#endif

Slide slide_function() {
#if defined(LAMINA_WIDE_KERNELS)
  if (widest_isa() != Isa::kPlain) return slide_avx2;
#endif
  return slide_plain;
}

}  // namespace

void slide_minima(const std::int32_t* values, std::size_t count, std::int32_t sign, const Windows& windows,
                  Buffer<std::int32_t>& held, std::int32_t* result) {
  static const Slide slide = slide_function();
  held.resize(kBlock + windows.reach);
  slide(values, count, sign, windows, held.data(), result);
}

}  // namespace lamina::checks
