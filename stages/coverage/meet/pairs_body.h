// stages/coverage/meet/pairs_body.h: the kernels of facet_group.h, on the lanes of an instruction set. Included once for each,
// in its namespace, behind kLanes, Ints, Floats and what is done with them; LAMINA_LANES has the target.
//
// Planes part facets for certain: a value above its room is above 0 for the exact plane, and the facet that the plane is of
// lies in it or behind it, exactly. What both have on the plane is a corner, so they meet in nothing else.

struct Shared {
  std::uint32_t corner[3][3];  // [corner of a][corner of b]: lanes
  std::uint32_t of_a[3], of_b[3];
};

/// Facets of lanes, or one of a group in all lanes.
struct Corners {
  Ints at[3][3];
};

LAMINA_LANES Corners lanes_of(const FacetGroup& group, std::uint32_t first) {
  Corners c;
  for (int k = 0; k < 3; ++k) {
    for (int axis = 0; axis < 3; ++axis) c.at[k][axis] = load(group.corner[k][axis] + first);
  }
  return c;
}
LAMINA_LANES Corners one_of(const FacetGroup& group, std::uint32_t lane) {
  Corners c;
  for (int k = 0; k < 3; ++k) {
    for (int axis = 0; axis < 3; ++axis) c.at[k][axis] = all(group.corner[k][axis][lane]);
  }
  return c;
}

/// Which boxes touch: lanes from `first` on.
LAMINA_LANES std::uint32_t touching_lanes(const BoxLanes& boxes, std::uint32_t first, const Nm* low, const Nm* high) {
  std::uint32_t touch = (1u << kLanes) - 1;
  for (int axis = 0; axis < 3; ++axis) {
    touch &=
        not_above(load(boxes.low[axis] + first), all(high[axis])) & not_above(all(low[axis]), load(boxes.high[axis] + first));
  }
  return touch;
}

LAMINA_LANES Shared shared_corners(const Corners& a, const Corners& b, std::uint32_t lanes) {
  Shared shared;
  for (int i = 0; i < 3; ++i) {
    for (int k = 0; k < 3; ++k) {
      shared.corner[i][k] =
          lanes & equal(a.at[i][0], b.at[k][0]) & equal(a.at[i][1], b.at[k][1]) & equal(a.at[i][2], b.at[k][2]);
    }
  }
  for (int i = 0; i < 3; ++i) {
    shared.of_a[i] = shared.corner[i][0] | shared.corner[i][1] | shared.corner[i][2];
    shared.of_b[i] = shared.corner[0][i] | shared.corner[1][i] | shared.corner[2][i];
  }
  return shared;
}

/// Lanes where a plane of a facet has all corners of the other before it, or on it where it is a corner of both.
/// get    a plane's numbers for all lanes; on, off  shared corners of the facet with the planes, and of the other
template <class Get>
LAMINA_LANES std::uint32_t parted(const Corners& with_planes, const Corners& other, Get get, const std::uint32_t* on,
                                  const std::uint32_t* off) {
  Floats d[3][3], far[3];
  for (int k = 0; k < 3; ++k) {
    for (int axis = 0; axis < 3; ++axis) d[k][axis] = floats(less(other.at[k][axis], with_planes.at[0][axis]));
    far[k] = plus(plus(absolute(d[k][0]), absolute(d[k][1])), absolute(d[k][2]));
  }
  const std::uint32_t on_plane[4] = {on[0] | on[1] | on[2], on[0] | on[1], on[1] | on[2], on[2] | on[0]};
  std::uint32_t apart = 0;
  for (int plane = 0; plane < 4; ++plane) {
    const Floats x = get.normal(plane, 0), y = get.normal(plane, 1), z = get.normal(plane, 2), slack = get.slack(plane);
    std::uint32_t before = ~0u, behind = ~0u;
    for (int k = 0; k < 3; ++k) {
      Floats value = plus(plus(times(x, d[k][0]), times(y, d[k][1])), times(z, d[k][2]));
      Floats distance = far[k];
      if (plane == 2) value = less(value, get.offset()), distance = plus(distance, get.reach());
      const Floats off_by = times(slack, distance);
      const std::uint32_t shared = off[k] & on_plane[plane];
      before &= above(value, off_by) | shared;
      if (plane == 0) behind &= above(less(zero(), value), off_by) | shared;
    }
    apart |= before;
    if (plane == 0) apart |= behind;
  }
  return apart;
}

struct PlanesOfOne {
  const FacetGroup& group;
  std::uint32_t lane;
  LAMINA_LANES Floats normal(int plane, int axis) const { return all(group.normal[plane][axis][lane]); }
  LAMINA_LANES Floats slack(int plane) const { return all(group.slack[plane][lane]); }
  LAMINA_LANES Floats offset() const { return all(group.offset[lane]); }
  LAMINA_LANES Floats reach() const { return all(group.reach[lane]); }
};
struct PlanesOfLanes {
  const FacetGroup& group;
  std::uint32_t first;
  LAMINA_LANES Floats normal(int plane, int axis) const { return load(group.normal[plane][axis] + first); }
  LAMINA_LANES Floats slack(int plane) const { return load(group.slack[plane] + first); }
  LAMINA_LANES Floats offset() const { return load(group.offset + first); }
  LAMINA_LANES Floats reach() const { return load(group.reach + first); }
};

/// Lanes whose normals are surely less than a right angle from that of a facet.
LAMINA_LANES std::uint32_t alike_normals(const FacetGroup& a, std::uint32_t i, const FacetGroup& b, std::uint32_t first) {
  const Floats x = times(all(a.normal[0][0][i]), load(b.normal[0][0] + first)),
               y = times(all(a.normal[0][1][i]), load(b.normal[0][1] + first)),
               z = times(all(a.normal[0][2][i]), load(b.normal[0][2] + first));
  return above(plus(plus(x, y), z), times(all(0x1p-20F), plus(plus(absolute(x), absolute(y)), absolute(z))));
}

LAMINA_LANES void note_edges(const Shared& shared, std::uint32_t i, std::uint32_t first, FoundPairs& found) {
  for (std::uint8_t e = 0; e < 3; ++e) {
    for (std::uint8_t k = 0; k < 3; ++k) {
      const int next_e = (e + 1) % 3, next_k = (k + 1) % 3;
      for (std::uint32_t on = shared.corner[e][next_k] & shared.corner[next_e][k]; on != 0; on &= on - 1) {
        const auto lane = static_cast<std::uint8_t>(first + static_cast<std::uint32_t>(__builtin_ctz(on)));
        found.edge[found.edges++] = {static_cast<std::uint8_t>(i), lane, e, k};
      }
      for (std::uint32_t on = shared.corner[e][k] & shared.corner[next_e][next_k]; on != 0; on &= on - 1) {
        const auto lane = static_cast<std::uint8_t>(first + static_cast<std::uint32_t>(__builtin_ctz(on)));
        found.alike[found.alikes++] = {static_cast<std::uint8_t>(i), lane};
      }
    }
  }
}

LAMINA_LANES void pairs_of_lanes(const FacetGroup& a, std::uint32_t i, const FacetGroup& b, std::uint32_t first,
                                 FoundPairs& found) {
  Nm low[3], high[3];
  for (int axis = 0; axis < 3; ++axis) low[axis] = a.box.low[axis][i], high[axis] = a.box.high[axis][i];
  std::uint32_t lanes = touching_lanes(b.box, first, low, high);
  if (&a == &b) lanes &= i < first ? ~0u : i - first >= 31 ? 0u : ~0u << (i - first + 1);
  if (lanes == 0) return;
  const Corners one = one_of(a, i), others = lanes_of(b, first);
  const Shared shared = shared_corners(one, others, lanes);
  const std::uint32_t *s = shared.of_a, two = (s[0] & s[1]) | (s[1] & s[2]) | (s[2] & s[0]);
  std::uint32_t uncertain = lanes & ~two;
  if (uncertain != 0) uncertain &= ~parted(one, others, PlanesOfOne{a, i}, shared.of_a, shared.of_b);
  if (uncertain != 0) uncertain &= ~parted(others, one, PlanesOfLanes{b, first}, shared.of_b, shared.of_a);
  if (two != 0) {
    note_edges(shared, i, first, found);
    uncertain |= two & (~alike_normals(a, i, b, first) | (s[0] & s[1] & s[2]));
  }
  for (; uncertain != 0; uncertain &= uncertain - 1) {
    const auto lane = static_cast<std::uint8_t>(first + static_cast<std::uint32_t>(__builtin_ctz(uncertain)));
    found.uncertain[found.uncertain_count++] = {static_cast<std::uint8_t>(i), lane};
  }
}

LAMINA_LANES std::uint32_t touching_body(const BoxLanes& boxes, const Box& box) {
  const Nm low[3] = {box.lo.x, box.lo.y, box.lo.z}, high[3] = {box.hi.x, box.hi.y, box.hi.z};
  std::uint32_t touch = 0;
  for (std::uint32_t first = 0; first < kGroupSize; first += kLanes) touch |= touching_lanes(boxes, first, low, high) << first;
  return touch;
}

LAMINA_LANES void pairs_body(const FacetGroup& a, const FacetGroup& b, const Box& around_b, FoundPairs& found) {
  found.edges = found.uncertain_count = found.alikes = 0;
  for (std::uint32_t near = touching_body(a.box, around_b); near != 0; near &= near - 1) {
    const auto i = static_cast<std::uint32_t>(__builtin_ctz(near));
    for (std::uint32_t first = 0; first < b.used; first += kLanes) pairs_of_lanes(a, i, b, first, found);
  }
}
