// stages/load/repair/sheets.cpp: patches, and what is left at their rims without them.
#include "stages/load/repair/sheets.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "stages/load/repair/geometry.h"

namespace lamina::load {

StraySheets find_stray_sheets(std::size_t facet_count, std::span<const Side> sides) {
  DisjointSets patches(facet_count);
  for_each_edge(sides, [&](const Side* begin, const Side* end) {
    if (end - begin == 2) patches.join(begin[0].facet, begin[1].facet);
  });

  struct Rim {
    bool open = false, glued = false, needed = false;  // needed: something would be unbalanced without the patch
  };
  Buffer<Rim> rims(facet_count);
  std::fill(rims.begin(), rims.end(), Rim{});
  struct OwnSides {
    std::uint32_t patch;
    std::int32_t direction;  // 1 from low to high, -1 back
  };
  std::vector<OwnSides> meeting;  // at one edge; a broken file may have all its facets there
  for_each_edge(sides, [&](const Side* begin, const Side* end) {
    if (end - begin == 2) return;
    meeting.clear();
    for (const Side* side = begin; side != end; ++side) {
      meeting.push_back({patches.find(side->facet), side->forward ? 1 : -1});
    }
    std::ranges::sort(meeting, {}, &OwnSides::patch);
    const std::int64_t all = surplus(begin, end);
    for (auto first = meeting.begin(), last = first; first != meeting.end(); first = last) {
      std::int64_t own = 0;
      for (; last != meeting.end() && last->patch == first->patch; ++last) own += last->direction;
      Rim& rim = rims[first->patch];
      if (last - first == end - begin) {
        rim.open = rim.open || all != 0;
      } else {
        rim.glued = true;
        rim.needed = rim.needed || all == 0 || all != own;
      }
    }
  });
  const auto is_candidate = [&](std::uint32_t patch) {
    const Rim& rim = rims[patch];
    return rim.open && rim.glued && !rim.needed;
  };
  for_each_edge(sides, [&](const Side* begin, const Side* end) {
    const std::uint32_t first = patches.find(begin->facet);
    for (const Side* side = begin + 1; side < end; ++side) {
      const std::uint32_t patch = patches.find(side->facet);
      if (patch == first || !is_candidate(patch) || !is_candidate(first)) continue;
      rims[patch].needed = rims[first].needed = true;
    }
  });

  StraySheets stray;
  stray.drop.resize(facet_count);
  for (std::uint32_t facet = 0; facet < facet_count; ++facet) {
    const std::uint32_t patch = patches.find(facet);
    stray.drop[facet] = is_candidate(patch);
    stray.facets += stray.drop[facet];
    stray.sheets += stray.drop[facet] && patch == facet;
  }
  return stray;
}

namespace {

/// A piece's plane: through a vertex, with the sum of all normals turned to the side of the first.
struct SheetPiece {
  bool open = false, flat = true;
  Point3 at{};
  std::array<double, 3> normal{};
  Box box;
};

std::array<double, 3> doubled_normal(const Indexed& mesh, const Indexed::Facet& facet) {
  const auto area = doubled_area({mesh.vertex[facet[0]], mesh.vertex[facet[1]], mesh.vertex[facet[2]]});
  return {static_cast<double>(area[0]), static_cast<double>(area[1]), static_cast<double>(area[2])};
}

}  // namespace

StraySheets find_flat_pieces(const Indexed& mesh, std::span<const Side> sides, std::int64_t tolerance_nm) {
  DisjointSets pieces(mesh.vertex.size());
  for (const Indexed::Facet& facet : mesh.facet) {
    pieces.join(facet[0], facet[1]);
    pieces.join(facet[1], facet[2]);
  }
  std::vector<SheetPiece> piece(mesh.vertex.size());
  for (const Indexed::Facet& facet : mesh.facet) {
    SheetPiece& own = piece[pieces.find(facet[0])];
    own.at = mesh.vertex[facet[0]];
    for (const std::uint32_t corner : facet) own.box.add(mesh.vertex[corner]);
    const auto normal = doubled_normal(mesh, facet);
    const double along = normal[0] * own.normal[0] + normal[1] * own.normal[1] + normal[2] * own.normal[2];
    for (std::size_t k = 0; k < 3; ++k) own.normal[k] += along < 0 ? -normal[k] : normal[k];
  }
  for_each_edge(sides, [&](const Side* begin, const Side* end) {
    if (surplus(begin, end) != 0) piece[pieces.find(begin->low)].open = true;
  });
  for (const Indexed::Facet& facet : mesh.facet) {
    SheetPiece& own = piece[pieces.find(facet[0])];
    const auto& n = own.normal;
    const double length = std::sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]);
    const double width = static_cast<double>(own.box.width()), depth = static_cast<double>(own.box.depth()),
                 height = static_cast<double>(own.box.height());
    const double size = std::sqrt(width * width + depth * depth + height * height);
    const double maximum = std::max(static_cast<double>(tolerance_nm), size / 1000) * length;
    for (const std::uint32_t corner : facet) {
      const Point3& p = mesh.vertex[corner];
      const double off = n[0] * (static_cast<double>(p.x) - own.at.x) + n[1] * (static_cast<double>(p.y) - own.at.y) +
                         n[2] * (static_cast<double>(p.z) - own.at.z);
      own.flat = own.flat && std::fabs(off) <= maximum;
    }
  }

  StraySheets stray;
  stray.drop.resize(mesh.facet.size());
  Buffer<std::uint8_t> counted(mesh.vertex.size());
  std::fill(counted.begin(), counted.end(), std::uint8_t{0});
  for (std::size_t f = 0; f < mesh.facet.size(); ++f) {
    const std::uint32_t representative = pieces.find(mesh.facet[f][0]);
    stray.drop[f] = piece[representative].open && piece[representative].flat;
    stray.facets += stray.drop[f];
    stray.sheets += stray.drop[f] && !counted[representative];
    counted[representative] = 1;
  }
  return stray;
}

}  // namespace lamina::load
