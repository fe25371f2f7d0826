// stages/load/repair/sheets.cpp: patches, and what is left at their rims without them.
#include "stages/load/repair/sheets.h"

#include <algorithm>
#include <vector>

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

}  // namespace lamina::load
