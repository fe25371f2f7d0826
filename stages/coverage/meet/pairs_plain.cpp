// A lane at a time, on any processor.
#include <cmath>

#include "stages/coverage/meet/facet_group.h"

#define LAMINA_LANES inline

namespace lamina::coverage::plain {
namespace {

constexpr std::uint32_t kLanes = 1;
using Ints = Nm;
using Floats = float;

Ints load(const Nm* at) { return *at; }
Floats load(const float* at) { return *at; }
Ints all(Nm value) { return value; }
Floats all(float value) { return value; }
Floats zero() { return 0; }
Ints less(Ints a, Ints b) { return static_cast<Nm>(static_cast<std::uint32_t>(a) - static_cast<std::uint32_t>(b)); }
Floats floats(Ints a) { return static_cast<float>(a); }
Floats plus(Floats a, Floats b) { return a + b; }
Floats less(Floats a, Floats b) { return a - b; }
Floats times(Floats a, Floats b) { return a * b; }
Floats absolute(Floats a) { return std::abs(a); }
std::uint32_t not_above(Ints a, Ints b) { return a <= b ? 1 : 0; }
std::uint32_t equal(Ints a, Ints b) { return a == b ? 1 : 0; }
std::uint32_t above(Floats a, Floats b) { return a > b ? 1 : 0; }

#include "stages/coverage/meet/pairs_body.h"

}  // namespace

std::uint32_t touching(const BoxLanes& boxes, const Box& box) { return touching_body(boxes, box); }
void pairs(const FacetGroup& a, const FacetGroup& b, const Box& around_b, FoundPairs& found) {
  pairs_body(a, b, around_b, found);
}

}  // namespace lamina::coverage::plain
#undef LAMINA_LANES
