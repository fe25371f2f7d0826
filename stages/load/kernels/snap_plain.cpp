#include "stages/load/kernels/kernels.h"

namespace lamina::load::plain {
namespace {

constexpr std::size_t kStep = 12;

// A loop that a compiler turns into vectors.
void snap_strip(const float* __restrict in, Nm* __restrict out, std::size_t count) {
  for (std::size_t i = 0; i < count; ++i) {
    const double nm = static_cast<double>(in[i]) * 1e6;
    out[i] = static_cast<Nm>(nm + __builtin_copysign(0.5, nm));
  }
}

/// Four numbers that are worked on at once, on any processor that compilers know.
using Four = float __attribute__((vector_size(16)));
using FourBits = std::int32_t __attribute__((vector_size(16)));

bool inspection(const float* in, std::size_t count, std::array<float, kStep>& lowest, std::array<float, kStep>& highest) {
  constexpr std::size_t kFours = kStep / 4;
  Four lo[kFours], hi[kFours], at[kFours];
  std::memcpy(lo, lowest.data(), sizeof lo);
  std::memcpy(hi, highest.data(), sizeof hi);
  FourBits within = ~FourBits{};
  for (std::size_t i = 0; i < count; i += kStep) {
    std::memcpy(at, in + i, sizeof at);
    for (std::size_t k = 0; k < kFours; ++k) {
      lo[k] = at[k] < lo[k] ? at[k] : lo[k];
      hi[k] = at[k] > hi[k] ? at[k] : hi[k];
      within &= (at[k] <= kReach) & (at[k] >= -kReach);  // what is no number is not, either
    }
  }
  std::memcpy(lowest.data(), lo, sizeof lo);
  std::memcpy(highest.data(), hi, sizeof hi);
  return (within[0] & within[1] & within[2] & within[3]) != 0;
}

}  // namespace

bool snap(const char* facets, std::size_t count, Triangle* out, CoordinateBox& box) {
  std::array<float, kStep> lo, hi;
  lo.fill(3e38f);
  hi.fill(-3e38f);
  std::array<float, kStripNumbers> corner;
  std::array<Nm, kStripNumbers> snapped;
  for (std::size_t first = 0; first < count; first += kStrip) {
    const std::size_t size = std::min(kStrip, count - first), numbers = take_strip<kStep>(facets, first, size, corner);
    if (!inspection(corner.data(), numbers, lo, hi)) return false;
    snap_strip(corner.data(), size == kStrip ? &out[first].a.x : snapped.data(), numbers);
    if (size < kStrip) std::memcpy(&out[first].a.x, snapped.data(), 36 * size);
  }
  put_lanes(lo, hi, box);
  return true;
}

}  // namespace lamina::load::plain
