#include "stages/replay/totals.h"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cstdlib>
#include <string>

namespace lamina::replay {

void Count::add(const Count& other) {
  drops += other.drops;
  vectors += other.vectors;
  sweeps += other.sweeps;
  added += other.added;
  max_per_position = std::max(max_per_position, other.max_per_position);
  scan_mm += other.scan_mm;
  travel_mm += other.travel_mm;
  microseconds += other.microseconds;
  added_microseconds += other.added_microseconds;
  fed_mm[0] += other.fed_mm[0];
  fed_mm[1] += other.fed_mm[1];
  vats |= other.vats;
  spat += other.spat;
  spits += other.spits;
  wipes += other.wipes;
  refills += other.refills;
  moves |= other.moves;
  build_mm = std::max(build_mm, other.build_mm);
  farthest_along_um = std::max(farthest_along_um, other.farthest_along_um);
  farthest_across_um = std::max(farthest_across_um, other.farthest_across_um);
}

Status check_count(const Machine& machine, const Count& reported, const Count& found) {
  const auto wrong = [](std::string what) { return Error{Fault::kVerification, std::move(what)}; };
  if (found.drops != reported.drops || found.spat != reported.spat) {
    return wrong(fmt::format("{} drops and {} off the bed, the manifest says {} and {}", found.drops, found.spat,
                             reported.drops, reported.spat));
  }
  if (found.sweeps != reported.sweeps)
    return wrong(fmt::format("{} sweeps fire, the manifest says {}", found.sweeps, reported.sweeps));
  // Further sweeps for blocked nozzles are over no place of their own.
  const auto& head = machine.head;
  const bool counted = head.max_drops > 1 && (head.blocked.empty() || head.blocked_rule != BlockedRule::kSecondPass);
  if (counted && found.added != reported.added) {
    return wrong(
        fmt::format("{} sweeps are there for the head's frequency, the manifest says {}", found.added, reported.added));
  }
  if (reported.microseconds > 0 && std::abs(found.microseconds - reported.microseconds) > 1)
    return wrong(fmt::format("takes {:.6f} s, the manifest says {:.6f}", found.seconds(), reported.seconds()));
  // Of two times, each a whole number.
  if (counted && reported.microseconds > 0 && std::abs(found.added_microseconds - reported.added_microseconds) > 2) {
    return wrong(fmt::format("{:.6f} s are for sweeps that the head's frequency adds, the manifest says {:.6f}",
                             1e-6 * static_cast<double>(found.added_microseconds),
                             1e-6 * static_cast<double>(reported.added_microseconds)));
  }
  return {};
}

std::uint32_t vats_wanted(const Machine& machine, std::span<const std::uint64_t> set, std::span<const std::uint32_t> vat) {
  const auto is_set = [](std::uint64_t pixels) { return pixels > 0; };
  const auto first = std::ranges::find_if(set, is_set);
  if (first == set.end()) return 1u << vat[0];
  const auto after = std::find_if(first + 1, set.end(), is_set);
  if (after == set.end()) return 1u << vat[static_cast<std::size_t>(first - set.begin())];
  switch (machine.powder.vat_rule) {
    case VatRule::kFirst: return 1;
    case VatRule::kSecond: return 2;
    case VatRule::kBoth: return 3;
    case VatRule::kMajority: return 1u << vat[*after > *first ? 1 : 0];
    case VatRule::kRefuse: break;
  }
  return 0;
}

Status check_unfed(std::span<const std::uint64_t> set, std::span<const std::uint32_t> vat,
                   std::span<const std::uint64_t> recorded, std::uint32_t feeds) {
  const auto none = [](std::uint64_t pixels) { return pixels == 0; };
  if (std::ranges::all_of(recorded, none)) return {};
  for (std::size_t m = 0; m < set.size(); ++m) {
    const std::uint64_t unfed = (feeds >> vat[m] & 1) != 0 ? 0 : set[m];
    if (recorded[m] == unfed) continue;
    return Error{Fault::kVerification,
                 fmt::format("{} pixels of material {} lie in another powder, the manifest says {}", unfed, m, recorded[m])};
  }
  return {};
}

Status VatLevels::take(std::uint32_t layer, const std::optional<Count>& taken) {
  const bool fills = layer == 0 || (taken && taken->refills > 0);
  known_ = taken && (fills || (known_ && layer == next_));
  next_ = layer + 1;
  if (!known_) return {};
  if (fills) left_mm_ = depth_mm_;
  const Count& count = *taken;
  Status status;
  for (std::size_t vat = 0; vat < 2; ++vat) {
    const double before = left_mm_[vat];
    left_mm_[vat] -= count.fed_mm[vat];
    if (depth_mm_[vat] == 0 || reports_[vat] || left_mm_[vat] > -1e-3) continue;
    reports_[vat] = true;
    status =
        Error{Fault::kVerification, fmt::format("layer {}: takes {:g} mm of the {} vat, where {:g} of {:g} are left", layer,
                                                count.fed_mm[vat], vat == 0 ? "first" : "second", before, depth_mm_[vat])};
  }
  return status;
}

std::optional<Count> with_fed_by_host(const Machine& machine, const Layer& layer, std::optional<Count> count) {
  if (!count || count->moves || count->vats == 0) return count;
  const double base = layer.index == 0 ? machine.powder.base_mm() : 0;
  const double fed = machine.powder.dose * (mm(layer.thickness) + base) / std::popcount(count->vats & 3);
  for (std::size_t vat = 0; vat < 2; ++vat) count->fed_mm[vat] = (count->vats >> vat & 1) != 0 ? fed : 0;
  return count;
}

Material material_of(const Machine& machine, const Count& count) {
  return {static_cast<double>(count.drops + count.spat) * machine.head.drop_pl * 1e-6,
          (count.fed_mm[0] + count.fed_mm[1]) * fed_area_mm2(machine) * machine.powder.packing};
}

}  // namespace lamina::replay
